//! Where the estimate starts: gains and offsets from the tags' positions alone, under a robust loss that narrows.

use crate::model::estimated::Model;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::scales::Hyperparameters;
use crate::solve::constants::levenberg_marquardt::LOOSE;
use crate::solve::constants::robust_start::{START_STD_M, START_WIDTH};
use crate::solve::input::BundleInput;
use crate::solve::levenberg_marquardt::solve;
use crate::solve::problem::{BundleProblem, parameters_of};
use crate::views::view::TagMeasurement;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::Loss;

/// Where the estimate starts.
pub(crate) struct RobustStart {
    pub parameters: JointParameters,
    /// Estimated slips of the sensors.
    pub steps: Vec<(Parameter, f64)>,
    pub iterations: usize,
}

/// Gain, offset and steps from the tags' positions in the camera frame; what is far counts little.
pub(crate) fn robust_start(input: &BundleInput<'_>) -> RobustStart {
    let mut views = input.views.to_vec();
    for view in &mut views {
        view.gripper_tag = None;
        for tag in &mut view.tags {
            tag.measured = TagMeasurement::Position;
        }
    }
    let linear = |kind: &ParameterKind| {
        matches!(kind, ParameterKind::Gain | ParameterKind::Offset | ParameterKind::StepBefore(_))
    };
    let n_before = input.robot.n_seen_joints();
    let of_joint = |(joint, kinds): (usize, &Vec<ParameterKind>)| {
        if joint < n_before { kinds.iter().copied().filter(linear).collect() } else { Vec::new() }
    };
    let joints = input.model.joints.iter().enumerate().map(of_joint).collect();
    let model = Model { joints, ..Model::of_blocks(0, []) };
    let (mut parameters, mut steps) = (input.guess, Vec::new());
    let mut iterations = 0;
    for std_m in START_STD_M {
        let scales = Hyperparameters {
            position_std_m: std_m,
            joint_std_rad: straight_sensor_std(input),
            ..input.scales.clone()
        };
        let linear = BundleInput { views: &views, model: model.clone(), joint_prior: None, scales, ..input.clone() };
        let problem = BundleProblem::new(&linear, linear.prior());
        let mut start = problem.start(&parameters);
        problem.set_steps(&mut start, &steps);
        let solved = solve(&problem, start, Loss::Cauchy { c: START_WIDTH }, LOOSE);
        iterations += solved.iterations;
        parameters = parameters_of(&problem, &solved.state, &parameters);
        steps = problem.steps(&solved.state);
    }
    RobustStart { parameters, steps, iterations }
}

/// At least the datasheet's linearity: what straight sensors leave.
pub(crate) fn straight_sensor_std(input: &BundleInput<'_>) -> [f64; MAX_JOINTS] {
    let mut std = input.scales.joint_std_rad;
    for (std, spec) in std.iter_mut().zip(&input.robot.sensors) {
        *std = std.max(spec.linearity_std_rad);
    }
    std
}
