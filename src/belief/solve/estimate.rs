//! The estimate from start to end: a robust start, rejection of outliers, scales by evidence, least squares for the
//! rest.

use crate::measure::BlockMeasurement;
use crate::solve::constants::estimate::{
    CONSISTENT_COST, CONVERGED_CHANGE, CORNER_WIDTH, LAST_ROUNDS, LITTLE_AS_FITTED, LITTLE_AS_GIVEN, MAX_ROUNDS,
    ROUNDS_AS_GIVEN,
};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, Vector6};

use crate::measure::{ObservationTerm, WeightedMeasurement};
use crate::model::blocks::Block;
use crate::model::estimated::Model;
use crate::model::parameters::{JointParameters, Parameter};
use crate::model::scales::Hyperparameters;
use crate::model::state::State;
use crate::solve::constants::levenberg_marquardt::{LOOSE, TIGHT};
use crate::solve::details::FitDetails;
use crate::solve::evidence::{Marginal, Posterior, ScaleTarget, change, updated};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::levenberg_marquardt::{Solved, solve, until};
use crate::solve::outliers::{Outlier, outliers, reject};
use crate::solve::problem::{BundleProblem, parameters_of};
use crate::solve::robust_start::{RobustStart, robust_start, straight_sensor_std};
use crate::views::view::View;
use armcal_core::joints::JointAngles;
use armcal_core::numeric::{Loss, Outcome};
use armcal_core::optics::CameraModel;
use armcal_core::robot::Robot;
use armcal_core::spatial::Pose;

/// Result of the estimate.
#[derive(Clone)]
pub struct Estimate<'a> {
    pub(crate) problem: BundleProblem<'a>,
    pub(crate) solved: Solved,
    pub(crate) posterior: Posterior,
    /// Widened covariance, if requested.
    pub(crate) marginal: Option<Marginal>,
    /// True if the joints' prior is the datasheet's under the fitted scales.
    pub(crate) has_own_priors: bool,
    /// Estimated parameters.
    pub model: Model,
    /// Initial guess; parameters without a column keep its values, and its reference is that of the terms.
    pub guess: JointParameters,
    /// Tag observations that the estimate rejected.
    pub outliers: Vec<Outlier>,
    /// Number of steps of all solutions, the robust start included.
    pub iterations: usize,
    /// Cost at the first guess, under the final scales.
    pub cost_initial: f64,
    /// Sum of squared whitened residuals at the end, priors and view-local errors included.
    pub cost_final: f64,
}

/// Estimates all parameters; `None` if the views determine nothing at all (no finite cost).
#[must_use]
pub fn estimate<'a>(input: &BundleInput<'a>) -> Option<Estimate<'a>> {
    estimate_with_lengths(input, &[])
}

/// Estimates all parameters, with measured lengths between blocks that have columns.
#[must_use]
pub(crate) fn estimate_with_lengths<'a>(input: &BundleInput<'a>, lengths: &[BlockMeasurement]) -> Option<Estimate<'a>> {
    let RobustStart { parameters: start, steps, mut iterations } = robust_start(input);
    let mut problem = BundleProblem::new(input, input.prior());
    problem.block_measurements = lengths.to_vec();
    let first_state = problem.start(&input.guess);
    let mut state = problem.start(&start);
    problem.set_steps(&mut state, &steps);
    // The loss is robust on the corners; straight sensors leave the nonlinearity that the datasheet states.
    problem.scales.joint_std_rad = straight_sensor_std(input);
    let mut solved = solve(&problem, state, Loss::Cauchy { c: CORNER_WIDTH }, LOOSE);
    iterations += solved.iterations;
    reject(&mut problem, &solved);
    if input.evidence == HyperparameterMode::Given {
        problem.set_scales(input.scales.clone());
    }
    let first = input.scales.clone();
    let mut posterior;
    let mut round = 0;
    loop {
        // An estimate that leaves out most observations cannot win, so that it may stop at a loose tolerance.
        let is_loose = round == 0 || input.evidence == HyperparameterMode::Given && fits_little(&problem);
        solved = solve(&problem, solved.state, Loss::Square, if is_loose { LOOSE } else { TIGHT });
        iterations += solved.iterations;
        posterior = Posterior::of(&problem, &solved.normal)?;
        let mut settled = !reject(&mut problem, &solved);
        if input.evidence == HyperparameterMode::Fitted && round < MAX_ROUNDS {
            let next = updated(&problem, &solved.state, &solved.normal, &posterior, &ScaleTarget::fitted(&first));
            settled &= change(&next, &problem.scales) < CONVERGED_CHANGE;
            if !settled {
                problem.set_scales(next);
                if input.joint_prior.is_none() {
                    problem.rescale_priors();
                }
            }
        }
        round += 1;
        if (settled && round > 1) || round > most_rounds(&problem, input.evidence) {
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
        marginal: None,
        has_own_priors: input.joint_prior.is_none(),
        model,
        guess: input.guess,
        outliers,
        iterations,
        cost_initial,
        cost_final,
    })
}

/// Returns true if most observations are left out.
fn fits_little(problem: &BundleProblem<'_>) -> bool {
    let n_used = problem.observations.iter().filter(|observation| observation.is_used).count();
    2 * n_used < problem.observations.len()
}

/// Returns the number of rounds after which an estimate ends that has not settled.
fn most_rounds(problem: &BundleProblem<'_>, evidence: HyperparameterMode) -> usize {
    match (evidence, fits_little(problem)) {
        (HyperparameterMode::Given, true) => LITTLE_AS_GIVEN,
        (HyperparameterMode::Given, false) => ROUNDS_AS_GIVEN,
        (HyperparameterMode::Fitted, true) => LITTLE_AS_FITTED,
        (HyperparameterMode::Fitted, false) => MAX_ROUNDS + LAST_ROUNDS,
    }
}

/// Plain least squares from the guess, with every observation and the given scales, to compare solvers.
#[derive(Clone, Debug)]
pub struct LeastSquares {
    /// Parameters of the least cost.
    pub parameters: JointParameters,
    /// Outcome of the solver.
    pub outcome: Outcome,
    /// Number of steps.
    pub iterations: usize,
    /// Sum of squared whitened residuals at the guess.
    pub cost_initial: f64,
    /// Cost at the end.
    pub cost_final: f64,
}

/// Minimizes until one more step would save less than `relative_gain` of the cost.
#[must_use]
pub fn least_squares(input: &BundleInput<'_>, relative_gain: f64) -> LeastSquares {
    let problem = BundleProblem::new(input, input.prior());
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
    let mut normal = crate::solve::linearize::NormalEquations::new(problem);
    normal.update(problem, state, Loss::Square);
    normal.cost
}

impl Estimate<'_> {
    /// Returns true if the used observations and the priors agree about as well as their standard deviations say. The
    /// cost, a sum of squares in standard deviations, is then not many times the number of measurements.
    #[must_use]
    pub fn is_consistent(&self) -> bool {
        let used = self.problem.observations.iter().filter(|observation| observation.is_used);
        let n: usize = used.map(|observation| observation.data.n_coordinates()).sum();
        n > 0 && self.cost_final < CONSISTENT_COST * n as f64
    }

    /// Adds to `details` the rejected observations and each joint's error in each view.
    pub(crate) fn complete(&self, details: &mut FitDetails) {
        let n_joints = self.problem.robot.n_joints();
        for (view, error_rad) in details.views.iter_mut().zip(&self.solved.state.joint_error) {
            view.joint_error_rad = Some(JointAngles::from_fn(n_joints, |joint| error_rad[joint]));
        }
        for outlier in &self.outliers {
            let Some(view) = details.views.get_mut(outlier.view_idx) else { continue };
            for tag in view.tags.iter_mut().filter(|tag| tag.id == outlier.tag_id) {
                match outlier.corner {
                    None => tag.is_used = false,
                    Some(corner) => tag.corners[corner].iter_mut().for_each(|corner| corner.is_used = false),
                }
            }
        }
    }

    /// Returns true if the estimate uses any observation of the view.
    #[must_use]
    pub fn uses(&self, view_idx: usize) -> bool {
        let observations = self.problem.views[view_idx].observations.clone();
        self.problem.observations[observations].iter().any(|observation| observation.is_used)
    }

    /// Returns the standard deviation of a joint's mean angle over the views, from its parameters, rad.
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

    /// Returns a joint's estimated angle in a view, and the standard deviation of its error beyond the sensor's model,
    /// rad.
    #[must_use]
    pub fn angle(&self, view_idx: usize, joint: usize) -> (f64, f64) {
        let angle_rad = self.problem.angles(view_idx, &self.solved.state)[joint];
        (angle_rad, self.posterior.own[view_idx][joint].max(0.0).sqrt())
    }

    /// Returns the joints' parameters.
    #[must_use]
    pub fn parameters(&self) -> JointParameters {
        parameters_of(&self.problem, &self.solved.state, &self.guess)
    }

    /// Returns the outcome of the last solution.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        self.solved.outcome
    }

    /// Returns `input` with the terms that were selected since.
    pub(crate) fn with_found_terms<'b>(&self, input: &BundleInput<'b>) -> BundleInput<'b> {
        let mut scales = input.scales.clone();
        scales.camera_error_std = self.scales().camera_error_std.or(scales.camera_error_std);
        scales.walk_std_rad = self.scales().walk_std_rad;
        BundleInput { model: self.model.clone(), scales, ..input.clone() }
    }

    /// Returns the final scales.
    #[must_use]
    pub fn scales(&self) -> &Hyperparameters {
        &self.problem.scales
    }

    /// Returns the root mean square standard deviation of the corners from their frames and robot.toml, before the
    /// fitted noise, px. `None` without corners.
    pub(crate) fn mean_corner_std_px(&self) -> Option<f64> {
        let variance = |observation: &ObservationTerm| match &observation.data {
            WeightedMeasurement::Corners(corners) if observation.is_used => Some(1.0 / corners.info),
            WeightedMeasurement::Board { points } if observation.is_used => {
                Some(points.iter().map(|point| 1.0 / point.info).sum::<f64>() / points.len() as f64)
            }
            _ => None,
        };
        let variances: Vec<f64> = self.problem.observations.iter().filter_map(variance).collect();
        (!variances.is_empty()).then(|| (variances.iter().sum::<f64>() / variances.len() as f64).sqrt())
    }

    /// Returns true if positions or poses were measured instead of corners.
    #[must_use]
    pub fn has_positions(&self) -> bool {
        self.problem.observations.iter().any(|observation| !observation.data.is_in_pixels())
    }

    /// Returns true if poses were measured instead of corners.
    #[must_use]
    pub fn has_poses(&self) -> bool {
        let mut observations = self.problem.observations.iter();
        observations.any(|observation| matches!(observation.data, WeightedMeasurement::Pose { .. }))
    }

    /// Returns the delay of the joint sensors' stamps after the camera's and its standard deviation, s; `None` if it is
    /// not estimated.
    #[must_use]
    pub fn time_offset_s(&self) -> Option<[f64; 2]> {
        let at = self.problem.layout.at(Block::Clock)?;
        Some([self.solved.state.blocks.number(Block::Clock), self.posterior.covariance[(at, at)].sqrt()])
    }

    /// Returns the joints' parameters in the order of [`Self::joint_covariance`].
    #[must_use]
    pub fn joint_parameters(&self) -> &[Parameter] {
        &self.problem.layout.parameters
    }

    /// Returns the covariance of [`Self::joint_parameters`], in their units.
    #[must_use]
    pub fn joint_covariance(&self) -> DMatrix<f64> {
        let n = self.problem.layout.n_joint();
        self.wide_covariance().view((0, 0), (n, n)).into_owned()
    }

    /// Returns the `link_from_camera` of the camera with that number, and its covariance (translation m, rotation rad,
    /// on the right); the prior's if it is not estimated.
    #[must_use]
    pub fn mount(&self, camera: usize) -> (Isometry3<f64>, Matrix6<f64>) {
        let block = Block::Mount(camera);
        let covariance = match self.problem.layout.at(block) {
            Some(at) => self.wide_covariance().fixed_view::<6, 6>(at, at).into_owned(),
            None => {
                let std = Vector6::from_fn(|k, _| self.problem.prior.std[block][k]);
                Matrix6::from_diagonal(&std.component_mul(&std))
            }
        };
        (*self.solved.state.pose(block), covariance)
    }

    /// Returns the numbers of the cameras that have views, in their order.
    pub(crate) fn cameras(&self) -> impl Iterator<Item = usize> + '_ {
        let has_views = |camera: &usize| self.problem.views.iter().any(|view| view.camera == *camera);
        (0..=self.problem.robot.further_cameras.len()).filter(has_views)
    }

    /// Returns true for a block that is estimated.
    #[must_use]
    pub fn has(&self, block: Block) -> bool {
        self.problem.layout.at(block).is_some()
    }

    /// Returns the lens of the camera with that number.
    pub(crate) fn lens(&self, camera: usize) -> &CameraModel {
        self.solved.state.blocks.lens(Block::Lens(camera))
    }

    /// Returns the `base_from_tag` of a tag of the robot, and its covariance (on the right); `None` for a tag that was
    /// not seen.
    #[must_use]
    pub fn tag(&self, tag_idx: usize) -> (Isometry3<f64>, Option<Matrix6<f64>>) {
        let at = self.problem.layout.at(Block::Tag(tag_idx));
        let covariance = at.map(|at| self.posterior.covariance.fixed_view::<6, 6>(at, at).into_owned());
        (*self.solved.state.pose(Block::Tag(tag_idx)), covariance)
    }

    /// Sets the estimated lenses of `robot`.
    pub(crate) fn give_lenses(&self, robot: &mut Robot) {
        let cameras = std::iter::once(&mut robot.camera).chain(&mut robot.further_cameras);
        for (number, camera) in cameras.enumerate().filter(|(number, _)| self.has(Block::Lens(*number))) {
            camera.lens = *self.lens(number);
        }
    }

    /// Recomputes the positions of a view's tags with the lens of `robot`, if the lens of the view's camera was
    /// estimated.
    pub(crate) fn see_through_found_lens(&self, view: &mut View, robot: &Robot) {
        if self.has(Block::Lens(view.camera)) {
            view.see_through(robot);
        }
    }

    /// Returns `robot` with links, cameras and tags as estimated.
    #[must_use]
    pub fn as_found(&self, robot: &Robot) -> Robot {
        let (mount, covariance) = self.mount(0);
        let mut found = self.parameters().with_links(robot.clone()).with_camera_at(mount, &covariance);
        self.give_lenses(&mut found);
        for (at, camera) in found.further_cameras.iter_mut().enumerate() {
            camera.mount.link_from_frame = *self.solved.state.pose(Block::Mount(at + 1));
        }
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
