//! The estimate from start to end: a robust start, what does not belong left out, the scales by evidence, the rest by least squares.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, Vector6};

use crate::calib::bundle::evidence::{Posterior, change, joint_info, updated};
use crate::calib::bundle::input::{BundleInput, HyperparameterMode};
use crate::calib::bundle::model::{Hyperparameters, Model, shape_kinds};
use crate::calib::bundle::problem::{BundleProblem, Layout, Prior, State, WeightedMeasurement};
use crate::calib::bundle::solve::{LOOSE, Solved, TIGHT, solve, until};
use crate::calib::parameters::{JointParameters, Parameter, ParameterKind};
use crate::calib::views::view::{TagMeasurement, View};
use armcal_core::numeric::{Loss, Outcome};
use armcal_core::robot::Robot;
use armcal_core::sensor::Conditions;
use armcal_core::spatial::Pose;

/// A tag observation that does not fit the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    pub view_idx: usize,
    pub tag_id: u32,
    /// Root mean square of its coordinates' residuals in standard deviations.
    pub sigmas: f64,
}

/// The answer.
pub struct Estimate<'a> {
    pub(crate) problem: BundleProblem<'a>,
    pub(crate) solved: Solved,
    pub(crate) posterior: Posterior,
    pub model: Model,
    pub guess: JointParameters,
    pub outliers: Vec<Outlier>,
    pub iterations: usize,
    /// The cost at the first guess and at the end, under the scales of the end.
    pub cost_initial: f64,
    pub cost_final: f64,
}

/// Standard deviations of the tags' positions in the robust start, one after the other, m.
const START_STD_M: [f64; 3] = [0.3, 0.1, 0.03];
const START_WIDTH: f64 = 1.0;
const CORNER_WIDTH: f64 = 3.0;
/// A sighting whose chi-square is this many times its number of coordinates belongs elsewhere; one below `READMIT` belongs here.
const REJECT: f64 = 7.5;
const READMIT: f64 = 5.0;
/// Cost per used measurement above which something does not hold. Good views have about one (corner noise is not quite normal).
const CONSISTENT_COST: f64 = 3.0;
const MAX_ROUNDS: usize = 40;
const CONVERGED_CHANGE: f64 = 0.01;

/// Fewer views of the tag on the gripper are not used.
pub const MIN_GRIPPER_VIEWS: usize = 4;

/// Model by what the recording can tell: terms whose cause did not change have no column.
#[must_use]
pub fn model_for(robot: &Robot, views: &[View]) -> Model {
    let spread = |f: &dyn Fn(&Conditions) -> Option<f64>| {
        let values = views.iter().filter_map(|v| f(&v.conditions));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if high > low { high - low } else { 0.0 }
    };
    let warmed = spread(&|c| c.oil_c) > 0.5;
    let dived = spread(&|c| c.pressure_pa) > 2e5;
    let gripper_joints = robot.gripper_tag.map_or(0, |tag| tag.mount.n_joints);
    let has_gripper = views.iter().filter(|view| view.gripper_tag.is_some()).count() >= MIN_GRIPPER_VIEWS;
    let last = if has_gripper { gripper_joints } else { 0 }.max(robot.camera.mount.n_joints);
    let joint = |joint: usize| {
        let spec = &robot.sensors[joint];
        let mut kinds = Vec::new();
        // A datasheet that leaves nothing open leaves nothing to estimate.
        if joint >= last || (spec.gain_std <= 0.0 && spec.offset_std_rad <= 0.0) {
            return kinds;
        }
        let from_both_sides = [-1.0, 1.0].iter().all(|side| views.iter().any(|v| v.approach[joint] == *side));
        for (wanted, kind) in [
            (spec.gain_std > 0.0, ParameterKind::Gain),
            (spec.offset_std_rad > 0.0, ParameterKind::Offset),
            (warmed, ParameterKind::OffsetPerK),
            (warmed, ParameterKind::GainPerK),
            (dived, ParameterKind::OffsetPerMpa),
            (from_both_sides, ParameterKind::HalfBacklash),
        ] {
            if wanted {
                kinds.push(kind);
            }
        }
        if spec.linearity_std_rad > 0.0 {
            kinds.extend(shape_kinds());
        }
        kinds
    };
    Model {
        joints: (0..robot.n_joints()).map(joint).collect(),
        mount: robot.camera.mount_std_m > 0.0 || robot.camera.mount_std_rad > 0.0,
        lens: false,
        tags: true,
        gripper_tag: has_gripper,
        time_offset: false,
    }
}

/// The middle of the views' conditions.
#[must_use]
pub fn reference(views: &[View]) -> Conditions {
    let mean = |f: &dyn Fn(&Conditions) -> Option<f64>| {
        let values: Vec<f64> = views.iter().filter_map(|v| f(&v.conditions)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let stamps = views.iter().filter_map(|v| v.conditions.stamp);
    let (first, last) = (stamps.clone().min(), stamps.max());
    let middle = first.zip(last).map(|(a, b)| a.plus_s(0.5 * b.since_s(a)));
    Conditions { oil_c: mean(&|c| c.oil_c), pressure_pa: mean(&|c| c.pressure_pa), stamp: middle }
}

/// Estimates; `None` where the views determine nothing at all (no cost that is finite).
#[must_use]
pub fn estimate<'a>(input: &BundleInput<'a>) -> Option<Estimate<'a>> {
    let (start, mut iterations) = robust_start(input);
    let prior = |scales: &Hyperparameters| prior(input, scales);
    let mut problem = BundleProblem::new(input, prior(&input.scales));
    let first_state = problem.start(&input.guess);
    let mut state = problem.start(&start);
    state.tags.clone_from(&first_state.tags);
    // Robustly on the corners; straight sensors leave what the datasheet says.
    problem.scales.joint_std_rad = straight_sensor_std(input);
    let mut solved = solve(&problem, state, Loss::Cauchy { c: CORNER_WIDTH }, LOOSE);
    iterations += solved.iterations;
    reject(&mut problem, &solved);
    if input.evidence == HyperparameterMode::Given {
        problem.scales.clone_from(&input.scales);
    }
    let first = input.scales.clone();
    let mut posterior;
    let mut round = 0;
    loop {
        solved = solve(&problem, solved.state, Loss::Square, if round == 0 { LOOSE } else { TIGHT });
        iterations += solved.iterations;
        posterior = Posterior::of(&problem, &solved.normal)?;
        let mut settled = !reject(&mut problem, &solved);
        if input.evidence == HyperparameterMode::Fitted && round < MAX_ROUNDS {
            let next = updated(&problem, &solved.state, &solved.normal, &posterior, &first);
            settled &= change(&next, &problem.scales) < CONVERGED_CHANGE;
            if !settled {
                problem.scales = next;
                if input.joint_prior.is_none() {
                    problem.prior.joint_info = joint_info(&problem, &problem.scales);
                }
            }
        }
        round += 1;
        if (settled && round > 1) || round > MAX_ROUNDS + 5 {
            break;
        }
    }
    let cost_initial = cost_at(&problem, &first_state);
    let cost_final = solved.normal.cost;
    let outliers = outliers(&problem, input.views, &solved);
    let model = input.model.clone();
    Some(Estimate {
        problem,
        solved,
        posterior,
        model,
        guess: input.guess,
        outliers,
        iterations,
        cost_initial,
        cost_final,
    })
}

/// Plain least squares from the guess, every sighting used, the scales as given: what a solver alone is compared by.
#[derive(Clone, Debug)]
pub struct LeastSquares {
    pub parameters: JointParameters,
    pub outcome: Outcome,
    pub iterations: usize,
    pub cost_initial: f64,
    pub cost_final: f64,
}

/// Minimizes until one more step would save less than `relative_gain` of the cost.
#[must_use]
pub fn least_squares(input: &BundleInput<'_>, relative_gain: f64) -> LeastSquares {
    let prior = prior(input, &input.scales);
    let problem = BundleProblem::new(input, prior);
    let start = problem.start(&input.guess);
    let solved = solve(&problem, start, Loss::Square, until(TIGHT.max_iterations, relative_gain));
    LeastSquares {
        parameters: parameters_of(&problem, &solved.state, &input.guess),
        outcome: solved.outcome,
        iterations: solved.iterations,
        cost_initial: solved.cost_initial,
        cost_final: solved.normal.cost,
    }
}

fn cost_at(problem: &BundleProblem<'_>, state: &State) -> f64 {
    let mut normal = crate::calib::bundle::linearize::NormalEquations::new(problem);
    normal.update(problem, state, Loss::Square);
    normal.cost
}

fn straight_sensor_std(input: &BundleInput<'_>) -> [f64; armcal_core::joints::MAX_JOINTS] {
    let mut std = input.scales.joint_std_rad;
    for (std, spec) in std.iter_mut().zip(&input.robot.sensors) {
        *std = std.max(spec.linearity_std_rad);
    }
    std
}

/// Gain and offset from the tags' positions in the camera frame; what is far counts little.
pub(crate) fn robust_start(input: &BundleInput<'_>) -> (JointParameters, usize) {
    let mut views = input.views.to_vec();
    for view in &mut views {
        view.gripper_tag = None;
        for tag in &mut view.tags {
            tag.measured = TagMeasurement::Position;
        }
    }
    let linear = |kind: &ParameterKind| matches!(kind, ParameterKind::Gain | ParameterKind::Offset);
    let n_before = input.robot.camera.mount.n_joints;
    let of_joint = |(joint, kinds): (usize, &Vec<ParameterKind>)| {
        if joint < n_before { kinds.iter().copied().filter(linear).collect() } else { Vec::new() }
    };
    let model = Model {
        joints: input.model.joints.iter().enumerate().map(of_joint).collect(),
        mount: false,
        lens: false,
        tags: false,
        gripper_tag: false,
        time_offset: false,
    };
    let mut parameters = input.guess;
    let mut iterations = 0;
    for std_m in START_STD_M {
        let scales = Hyperparameters {
            position_std_m: std_m,
            joint_std_rad: straight_sensor_std(input),
            ..input.scales.clone()
        };
        let linear = BundleInput { views: &views, model: model.clone(), joint_prior: None, scales, ..input.clone() };
        let problem = BundleProblem::new(&linear, prior(&linear, &linear.scales));
        let solved = solve(&problem, problem.start(&parameters), Loss::Cauchy { c: START_WIDTH }, LOOSE);
        iterations += solved.iterations;
        parameters = parameters_of(&problem, &solved.state, &parameters);
    }
    (parameters, iterations)
}

/// `base` with the estimated parameters of `state`.
pub(crate) fn parameters_of(problem: &BundleProblem<'_>, state: &State, base: &JointParameters) -> JointParameters {
    let mut parameters = *base;
    for (parameter, value) in problem.layout.parameters.iter().zip(state.joint.iter()) {
        parameters.set(*parameter, *value);
    }
    parameters
}

/// The datasheet's and the survey's priors.
pub(crate) fn prior(input: &BundleInput<'_>, scales: &Hyperparameters) -> Prior {
    let robot = input.robot;
    let layout = Layout::new(robot, &input.model, input.views);
    let nominal = JointParameters::default();
    let mean = layout.parameters.iter().map(|p| nominal.get(*p));
    let variance = |p: &Parameter| BundleProblem::at_least(scales.prior_std(&robot.sensors[p.joint], p.joint, p.kind));
    let info = layout.parameters.iter().map(|p| variance(p).powi(-2));
    let n = layout.n_joint();
    let (mut joint_mean, joint_info) = input.joint_prior.clone().unwrap_or_else(|| {
        let info = DMatrix::from_diagonal(&DVector::from_iterator(n, info));
        (DVector::from_iterator(n, mean), info)
    });
    if joint_mean.len() > n {
        joint_mean = joint_mean.rows(0, n).into_owned();
    }
    let six = |position: f64, rotation: f64| [position, position, position, rotation, rotation, rotation];
    let camera = &robot.camera;
    let gripper = robot.gripper_tag;
    Prior {
        joint_mean,
        joint_info,
        mount: camera.mount.link_from_frame,
        mount_std: six(camera.mount_std_m, camera.mount_std_rad),
        time_std_s: 0.05,
        lens: camera.lens,
        lens_std: [1.0, 1.0, 1.0, 1.0, 1e-2, 1e-2, 1e-2, 1e-2],
        tags: robot.tags.iter().map(|tag| *tag.base_from_tag.isometry()).collect(),
        tags_std: (0..robot.tags.len()).map(|tag_idx| tag_std(input, tag_idx)).collect(),
        gripper_tag: gripper.map_or_else(Isometry3::identity, |tag| tag.mount.link_from_frame),
        gripper_tag_std: gripper.map_or([0.0; 6], |tag| six(tag.position_std_m, tag.rotation_std_rad)),
    }
}

/// One sigma of a tag's place; a landmark that is seen as a position alone has no attitude to speak of.
fn tag_std(input: &BundleInput<'_>, tag_idx: usize) -> [f64; 6] {
    let tag = &input.robot.tags[tag_idx];
    let mut sightings = input.views.iter().flat_map(|view| &view.tags).filter(|seen| seen.tag_idx == tag_idx);
    let is_point = sightings.all(|seen| matches!(seen.measured, TagMeasurement::Position));
    let (position, rotation) = (tag.position_std_m, if is_point { 1.0 } else { tag.rotation_std_rad });
    [position, position, position, rotation, rotation, rotation]
}

/// Marks what does not belong; whether anything changed.
fn reject(problem: &mut BundleProblem<'_>, solved: &Solved) -> bool {
    let mut changed = false;
    for (sighting, chi2) in problem.sightings.iter_mut().zip(&solved.normal.chi2) {
        let n = sighting.data.n_coordinates() as f64;
        let limit = if sighting.is_used { REJECT } else { READMIT };
        let belongs = *chi2 < limit * n * noise_excess(&sighting.data);
        changed |= belongs != sighting.is_used;
        sighting.is_used = belongs;
    }
    changed
}

/// Positions and poses come with a standard deviation that is a guess until the scales are fitted.
fn noise_excess(seen: &WeightedMeasurement) -> f64 {
    match seen {
        WeightedMeasurement::Corners { .. } => 1.0,
        WeightedMeasurement::Position { .. } | WeightedMeasurement::Pose { .. } => 4.0,
    }
}

fn outliers(problem: &BundleProblem<'_>, views: &[View], solved: &Solved) -> Vec<Outlier> {
    let mut out = Vec::new();
    for (view_idx, view) in problem.views.iter().enumerate() {
        for at in view.sightings.clone().chain(view.gripper) {
            let sighting = &problem.sightings[at];
            if sighting.is_used {
                continue;
            }
            let gripper = problem.robot.gripper_tag.map_or(0, |tag| tag.id);
            let tag_id = views[view_idx].tags.get(at - view.sightings.start).map_or(gripper, |tag| tag.id);
            let sigmas = (solved.normal.chi2[at] / sighting.data.n_coordinates() as f64).sqrt();
            out.push(Outlier { view_idx, tag_id, sigmas });
        }
    }
    out
}

impl Estimate<'_> {
    /// Whether the sightings that are used and the priors fit together about as well as their standard deviations say: the cost, a
    /// sum of squares in standard deviations, is not many times the number of measurements.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        let used = self.problem.sightings.iter().filter(|sighting| sighting.is_used);
        let n: usize = used.map(|sighting| sighting.data.n_coordinates()).sum();
        n > 0 && self.cost_final < CONSISTENT_COST * n as f64
    }

    /// Whether any sighting of a view is used.
    #[must_use]
    pub fn uses(&self, view_idx: usize) -> bool {
        let sightings = self.problem.views[view_idx].sightings.clone();
        self.problem.sightings[sightings].iter().any(|sighting| sighting.is_used)
    }

    /// One sigma of a joint's angle by its parameters, on average over the views, rad.
    #[must_use]
    pub fn mean_angle_std_rad(&self, joint: usize) -> f64 {
        let columns = self.problem.layout.of_joint[joint].clone();
        let mut by = DVector::zeros(self.problem.layout.n);
        for view in &self.problem.views {
            for column in columns.clone() {
                by[column] += view.basis[column] / self.problem.views.len() as f64;
            }
        }
        (&self.posterior.covariance * &by).dot(&by).max(0.0).sqrt()
    }

    /// A joint's angle in a view as estimated, and one sigma of what is not its sensor's model, rad.
    #[must_use]
    pub fn angle(&self, view_idx: usize, joint: usize) -> (f64, f64) {
        let angle_rad = self.problem.angles(view_idx, &self.solved.state)[joint];
        (angle_rad, self.posterior.own[view_idx][joint].max(0.0).sqrt())
    }

    /// The joints' parameters.
    #[must_use]
    pub fn parameters(&self) -> JointParameters {
        parameters_of(&self.problem, &self.solved.state, &self.guess)
    }

    #[must_use]
    pub fn outcome(&self) -> Outcome {
        self.solved.outcome
    }

    /// The scales at the end.
    #[must_use]
    pub fn scales(&self) -> &Hyperparameters {
        &self.problem.scales
    }

    /// Whether positions or poses were measured in place of corners.
    #[must_use]
    pub fn has_positions(&self) -> bool {
        self.problem.sightings.iter().any(|sighting| !matches!(sighting.data, WeightedMeasurement::Corners { .. }))
    }

    /// How much later the joint sensors' stamps are than the camera's, and one sigma; `None` where it is not estimated.
    #[must_use]
    pub fn time_offset_s(&self) -> Option<[f64; 2]> {
        let at = self.problem.layout.time?;
        Some([self.solved.state.time_s, self.posterior.covariance[(at, at)].sqrt()])
    }

    /// The joints' parameters in the order of [`Self::joint_covariance`].
    #[must_use]
    pub fn joint_parameters(&self) -> &[Parameter] {
        &self.problem.layout.parameters
    }

    #[must_use]
    pub fn joint_covariance(&self) -> DMatrix<f64> {
        let n = self.problem.layout.n_joint();
        self.posterior.covariance.view((0, 0), (n, n)).into_owned()
    }

    /// `link_from_camera`, and its covariance (translation m, rotation rad, on the right); the prior's where it is not estimated.
    #[must_use]
    pub fn mount(&self) -> (Isometry3<f64>, Matrix6<f64>) {
        let covariance = match self.problem.layout.mount {
            Some(at) => self.posterior.covariance.fixed_view::<6, 6>(at, at).into_owned(),
            None => Matrix6::from_diagonal(&Vector6::from(self.problem.prior.mount_std.map(|std| std * std))),
        };
        (self.solved.state.mount, covariance)
    }

    /// `base_from_tag` of each of the robot's tags, and its covariance (on the right); `None` for tags that were not seen.
    #[must_use]
    pub fn tag(&self, tag_idx: usize) -> (Isometry3<f64>, Option<Matrix6<f64>>) {
        let at = self.problem.layout.tags[tag_idx];
        let covariance = at.map(|at| self.posterior.covariance.fixed_view::<6, 6>(at, at).into_owned());
        (self.solved.state.tags[tag_idx], covariance)
    }

    /// `robot` with camera and tags where they were found.
    #[must_use]
    pub fn as_found(&self, robot: &Robot) -> Robot {
        let (mount, covariance) = self.mount();
        let mut found = robot.clone().with_camera_at(mount, &covariance);
        for (tag_idx, tag) in found.tags.iter_mut().enumerate() {
            let (pose, covariance) = self.tag(tag_idx);
            tag.base_from_tag = Pose::from_isometry(pose);
            if let Some(covariance) = covariance {
                let rms = |from: usize| ((0..3).map(|k| covariance[(from + k, from + k)]).sum::<f64>() / 3.0).sqrt();
                (tag.position_std_m, tag.rotation_std_rad) = (rms(0), rms(3));
            }
        }
        found
    }
}
