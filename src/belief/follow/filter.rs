//! The filter: belief about all parameters that views share, as a state and its information matrix.
//!
//! A view is taken in by Gauss-Newton on its own residuals and the belief so far, as in `bundle`. This is the iterated
//! form of the information filter (Bell and Cathey 1993): the final matrix of the normal equations is the new
//! information. Between views, drifting parameters are widened, `(W^-1 + Q)^-1` by the matrix inversion lemma. Time and
//! memory of a view do not depend on the number of earlier views.

use crate::follow::constants::filter::{LAST_GAIN, MAX_STEPS, SHORTER, SHORTEST_STEP, UNKNOWN_STD};
use crate::solve::constants::estimate::CORNER_WIDTH;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Isometry3, Matrix3, SVector, Vector3};

use crate::explain::angles_by_camera::seen_angles;
use crate::follow::view_stream::is_moving;
use crate::measure::ObservationTerm;
use crate::model::blocks::{Block, MAX_COLUMNS, PerBlock};
use crate::model::estimated::Model;
use crate::model::layout::Layout;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::prior::{Covers, Information, Prior, at_least, off_by};
use crate::model::scales::Hyperparameters;
use crate::model::state::State;
use crate::solve::estimate::Estimate;
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::levenberg_marquardt::{own_gain, take_step};
use crate::solve::linearize::NormalEquations;
use crate::solve::outliers::{reject_by, rejected};
use crate::solve::problem::BundleProblem;
use crate::solve::time_error::TimeErrorOfView;
use crate::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::{Loss, cholesky, solve_lower};
use armcal_core::robot::Robot;

/// Means and information of all columns, from base to tags.
#[derive(Clone)]
pub(crate) struct Filter {
    pub model: Model,
    pub scales: Hyperparameters,
    /// Values of all parameters without a column; its reference is that of the terms.
    pub guess: JointParameters,
    layout: Layout,
    state: State,
    /// Information matrix, the inverse of the covariance.
    info: DMatrix<f64>,
    /// Logarithm of the determinant of `info`.
    log_det: f64,
    /// Ratio of the image noise of a moving arm to that of an arm at rest.
    pub noise_in_motion: f64,
}

/// Result of taking in a view.
#[derive(Clone, Debug)]
pub(crate) struct ViewUpdate {
    /// Sum of squares in sigmas at the solution, including the pull of the belief so far.
    pub cost: f64,
    /// Cost of the rejected observations, in the same units.
    pub rejected_cost: f64,
    /// Number of coordinates of the used observations.
    pub n_coordinates: usize,
    /// Part of the cost that comes from the observations.
    pub observation_cost: f64,
    /// Logarithm of the probability of the view by the belief so far, up to a constant that all beliefs share.
    pub log_evidence: f64,
    /// Tags whose observations were rejected as a whole.
    pub rejected: Vec<Block>,
    /// Error of each joint in this view beyond its sensor's model, rad, and its variance before and after.
    pub joint_error: [JointErrorOfView; MAX_JOINTS],
    /// Error of the image's time.
    pub time_error: TimeErrorOfView,
    /// Scores of changes since the view before.
    pub scores: Scores,
}

/// Scores of the changes that may have happened since the view before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scores {
    /// Score of each joint with an offset.
    pub walk: [WalkScore; MAX_JOINTS],
    /// Score of each observed tag.
    pub tags: Vec<TagScore>,
}

/// First and second derivative of the log-likelihood by the position of a tag, in the tag's frame, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TagScore {
    pub tag: usize,
    pub a: Vector3<f64>,
    pub b: Matrix3<f64>,
}

/// First and second derivative of the log-likelihood by an offset's variance before the view, for a change of the
/// variance: `(a^2 - b) / 2` and `b^2 / 2`.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WalkScore {
    /// Innovation times `S^-1`, along the offset.
    pub a: f64,
    /// Matrix `S^-1`, along the offset.
    pub b: f64,
}

/// A joint's own error in one view.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct JointErrorOfView {
    pub error_rad: f64,
    pub prior_var: f64,
    pub var: f64,
}

/// A view at its solution.
struct SolvedView {
    state: State,
    normal: NormalEquations,
    factor: Cholesky<f64, Dyn>,
}

impl Filter {
    /// Returns the belief of a batch, with the priors of the tags that no view of it saw. `None` if the batch
    /// determines nothing.
    pub(crate) fn of_estimate(estimate: &Estimate<'_>, robot: &Robot) -> Option<Self> {
        let (problem, solved) = (&estimate.problem, &estimate.solved);
        let layout = Layout::new(robot, &estimate.model, |_| true);
        let mut info = DMatrix::zeros(layout.n, layout.n);
        // Column of the batch for each column here.
        let mut column_of: Vec<Option<usize>> = vec![None; layout.n];
        (0..layout.n_joint()).for_each(|column| column_of[column] = Some(column));
        for (block, here) in layout.blocks() {
            let there = problem.layout.at(block);
            (0..block.n_columns()).for_each(|k| column_of[here + k] = there.map(|there| there + k));
        }
        for (row, of_row) in column_of.iter().enumerate() {
            for (column, of_column) in column_of.iter().enumerate().take(row + 1) {
                let (Some(i), Some(k)) = (of_row, of_column) else { continue };
                let value = solved.normal.matrix[(*i.max(k), *i.min(k))];
                (info[(row, column)], info[(column, row)]) = (value, value);
            }
        }
        for (block, at) in layout.blocks().filter(|(_, at)| column_of[*at].is_none()) {
            for (k, std) in problem.prior.std[block][..block.n_columns()].iter().enumerate() {
                info[(at + k, at + k)] = at_least(std.min(UNKNOWN_STD)).powi(-2);
            }
        }
        let state = solved.state.with_views(1);
        let log_det = log_det(&cholesky(info.clone())?);
        let (model, scales, guess) = (estimate.model.clone(), problem.scales.clone(), estimate.guess);
        Some(Self { model, scales, guess, layout, state, info, log_det, noise_in_motion: 1.0 })
    }

    /// Returns each joint with an offset, and the column of the offset.
    pub(crate) fn offsets(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let columns = self.layout.parameters.iter().enumerate();
        columns.filter(|(_, p)| p.kind == ParameterKind::Offset).map(|(column, p)| (p.joint, column))
    }

    /// Returns the first of the six columns of the camera mount.
    pub(crate) fn mount_column(&self) -> Option<usize> {
        self.layout.at(Block::Mount(0))
    }

    /// Returns the first of the six columns of a tag.
    pub(crate) fn tag_column(&self, tag_idx: usize) -> Option<usize> {
        self.layout.at(Block::Tag(tag_idx))
    }

    /// True if a worn spot of a joint's sensor has a column.
    pub(crate) fn has_bump(&self, joint: usize) -> bool {
        let of_joint = &self.layout.parameters[self.joint_columns(joint)];
        of_joint.iter().any(|parameter| matches!(parameter.kind, ParameterKind::Bump(_)))
    }

    /// Returns the columns of a joint's sensor.
    pub(crate) fn joint_columns(&self, joint: usize) -> std::ops::Range<usize> {
        self.layout.of_joint[joint].clone()
    }

    /// Returns the joints' parameters.
    pub(crate) fn parameters(&self) -> JointParameters {
        let mut parameters = self.guess;
        for (parameter, value) in self.layout.parameters.iter().zip(self.state.joint.iter()) {
            parameters.set(*parameter, *value);
        }
        parameters
    }

    /// Returns the sensor parameters that have a column, in the order of their columns.
    pub(crate) fn joint_parameters(&self) -> &[Parameter] {
        &self.layout.parameters
    }

    /// Returns the believed `link_from_camera`.
    pub(crate) fn mount(&self) -> &Isometry3<f64> {
        self.state.pose(Block::Mount(0))
    }

    /// Returns the believed `base_from_tag`.
    pub(crate) fn tag(&self, tag_idx: usize) -> &Isometry3<f64> {
        self.state.pose(Block::Tag(tag_idx))
    }

    /// Returns the delay of the joint sensors' stamps against the camera's, s, and its column.
    pub(crate) fn clock_offset(&self) -> Option<(f64, usize)> {
        self.layout.at(Block::Clock).map(|at| (self.state.blocks.number(Block::Clock), at))
    }

    /// Returns the covariance of the joints' parameters, which are the first columns; `None` only after an overflow.
    pub(crate) fn joint_covariance(&self) -> Option<DMatrix<f64>> {
        let (n, columns) = (self.layout.n, self.layout.parameters.len());
        let mut half = DMatrix::identity(n, columns);
        solve_lower(&cholesky(self.info.clone())?, &mut half);
        Some(half.transpose() * half)
    }

    /// Returns the marginal std of a column; `None` only after an overflow.
    pub(crate) fn std_of(&self, column: usize) -> Option<f64> {
        let mut half = DMatrix::zeros(self.layout.n, 1);
        half[column] = 1.0;
        solve_lower(&cholesky(self.info.clone())?, &mut half);
        Some(half.norm())
    }

    /// Returns the difference of each mean from that of `reference`, in sigmas of `reference`. `None` if the two do not
    /// have the same columns.
    pub(crate) fn sigmas_from(&self, reference: &Self) -> Option<DVector<f64>> {
        if self.layout.parameters != reference.layout.parameters || self.layout.n != reference.layout.n {
            return None;
        }
        let covariance = cholesky(reference.info.clone())?.inverse();
        let off = off_by(&self.layout, (&reference.state.joint, &reference.state.blocks), &self.state, self.layout.n);
        Some(DVector::from_fn(self.layout.n, |k, _| off[k] / covariance[(k, k)].sqrt()))
    }

    /// Adds `variance` to each of the columns, for changes since the last view.
    pub(crate) fn widen(&mut self, columns: &[(usize, f64)]) {
        let columns: Vec<(usize, f64)> = columns.iter().copied().filter(|(_, variance)| *variance > 0.0).collect();
        let k = columns.len();
        if k == 0 {
            return;
        }
        let along = self.info.select_columns(columns.iter().map(|(column, _)| column));
        let inner = DMatrix::from_fn(k, k, |i, j| {
            let own = if i == j { 1.0 / columns[i].1 } else { 0.0 };
            own + self.info[(columns[i].0, columns[j].0)]
        });
        if self.subtract(along, inner).is_some() {
            self.log_det -= columns.iter().map(|(_, variance)| variance.ln()).sum::<f64>();
        }
    }

    /// Returns the number of columns.
    pub(crate) fn n_columns(&self) -> usize {
        self.layout.n
    }

    /// Sets the prior of half a backlash that no view has determined yet. A sensor's shaft lags and never leads. So a
    /// std of s about zero gives 0.8 s ± 0.6 s (the moments of a half-normal).
    pub(crate) fn expect_backlash(&mut self, joint: usize, std_rad: f64) {
        let columns = self.joint_columns(joint);
        let is_backlash = |at: &usize| self.layout.parameters[*at].kind == ParameterKind::HalfBacklash;
        let Some(at) = columns.into_iter().find(is_backlash) else { return };
        let info = (0.603 * std_rad).powi(-2);
        self.log_det += (info / self.info[(at, at)]).ln();
        self.info[(at, at)] = info;
        self.state.joint[at] = 0.798 * std_rad;
    }

    /// Adds a column with only its prior: a parameter that the joint did not have so far.
    pub(crate) fn add_parameter(&mut self, robot: &Robot, parameter: Parameter) {
        let Parameter { joint, kind } = parameter;
        let at = self.layout.of_joint[joint].end;
        let std = self.scales.prior_std(&robot.sensors[joint], joint, kind);
        let info = std::mem::replace(&mut self.info, DMatrix::zeros(0, 0));
        self.info = info.insert_row(at, 0.0).insert_column(at, 0.0);
        self.info[(at, at)] = std.powi(-2);
        self.log_det -= 2.0 * std.ln();
        let means = std::mem::replace(&mut self.state.joint, DVector::zeros(0));
        self.state.joint = means.insert_row(at, self.guess.get(parameter));
        self.model.joints[joint].push(kind);
        self.layout = Layout::new(robot, &self.model, |_| true);
    }

    /// Adds `D D^T` to the covariance.
    pub(crate) fn widen_along(&mut self, directions: &DMatrix<f64>) {
        let along = &self.info * directions;
        let inner = DMatrix::identity(directions.ncols(), directions.ncols()) + directions.tr_mul(&along);
        self.subtract(along, inner);
    }

    /// Subtracts `along inner^-1 along^T` from the information. Returns `None`, with nothing changed, after an
    /// overflow.
    fn subtract(&mut self, mut along: DMatrix<f64>, inner: DMatrix<f64>) -> Option<()> {
        let factor = Cholesky::new(inner)?;
        self.log_det -= log_det(&factor);
        // Computes `along L^-T` by whole columns.
        let lower = factor.l_dirty();
        for k in 0..along.ncols() {
            let (done, mut own) = along.columns_range_pair_mut(..k, k);
            own.gemv(-1.0, &done, &lower.row(k).columns_range(..k).transpose(), 1.0);
            own /= lower[(k, k)];
        }
        // Products with a transposed matrix are several times slower.
        let turned = along.transpose();
        self.info.gemm(-1.0, &along, &turned, 1.0);
        Some(())
    }

    /// Takes in a view. Returns `None`, with nothing changed, if the view has no tag or its numbers are not finite.
    pub(crate) fn update(&mut self, robot: &Robot, view: &View) -> Option<ViewUpdate> {
        let views = std::slice::from_ref(view);
        let info = std::mem::replace(&mut self.info, DMatrix::zeros(0, 0));
        let (log_det_before, before) = (self.log_det, self.state.clone());
        let input = self.input(robot, views);
        let prior = self.prior(robot, info);
        let mut problem = BundleProblem::with_layout(&input, self.layout.clone(), prior);
        self.set_rates(&mut problem, robot, view);
        self.set_shape_errors(&mut problem, view);
        let Some(solved) = self.solve(&mut problem, view, &before) else {
            self.info = problem.prior.information.matrix;
            return None;
        };
        let update = view_update(&problem, &solved, log_det_before);
        if !update.log_evidence.is_finite() {
            self.info = problem.prior.information.matrix;
            return None;
        }
        let SolvedView { state, normal, factor } = solved;
        self.log_det = log_det(&factor);
        self.info = normal.matrix;
        self.info.fill_upper_triangle_with_lower_triangle();
        self.state = state;
        self.state.joint_error[0] = [0.0; MAX_JOINTS];
        self.state.camera_error[0] = Isometry3::identity();
        Some(update)
    }

    /// Sets the joint rates by the sensors' estimated slopes, which differ from the datasheet's.
    fn set_rates(&self, problem: &mut BundleProblem<'_>, robot: &Robot, view: &View) {
        if !is_moving(view) {
            return;
        }
        let parameters = self.parameters();
        let change = view.conditions.departure_from(&parameters.reference);
        for (joint, spec) in robot.sensors.iter().enumerate() {
            let slope = parameters.correction(joint).slope(spec, view.travel_rad[joint], &change);
            problem.views[0].rate_rad_s[joint] *= slope;
        }
    }

    /// Adds noise near a worn spot, because wear does not have the exact shape of a bump of one width.
    fn set_shape_errors(&self, problem: &mut BundleProblem<'_>, view: &View) {
        for (parameter, height_rad) in self.layout.parameters.iter().zip(self.state.joint.iter()) {
            if let ParameterKind::Bump(spot) = parameter.kind {
                let share = spot.shape_error_share(view.travel_rad[parameter.joint]);
                problem.views[0].reading_var[parameter.joint] += (share * height_rad).powi(2);
            }
        }
    }

    /// Solves from `start`. If an observation does not fit and a joint may stand anywhere, also from the angle that the
    /// tags show.
    fn solve(&self, problem: &mut BundleProblem<'_>, view: &View, start: &State) -> Option<SolvedView> {
        let solved = solve_view(problem, start);
        let is_clean = solved.is_some() && problem.observations.iter().all(|observation| observation.is_used);
        let robot = problem.robot;
        let joints: Vec<usize> = (0..robot.n_seen_joints()).filter(|&joint| view.is_free[joint]).collect();
        if is_clean || joints.is_empty() || view.tags.is_empty() {
            return solved;
        }
        let mut by_camera = start.clone();
        let seen = seen_angles(robot, view, &joints, &self.parameters());
        let read = problem.angles(0, start);
        joints.iter().for_each(|&joint| by_camera.joint_error[0][joint] += seen[joint] - read[joint]);
        let used: Vec<[bool; 4]> = problem.observations.iter().map(ObservationTerm::used).collect();
        let cost = solved.as_ref().map_or(f64::INFINITY, |solved| cost_of(problem, solved));
        problem.observations.iter_mut().for_each(|observation| observation.set_used([true; 4]));
        let other = solve_view(problem, &by_camera).filter(|other| cost_of(problem, other) < cost);
        if other.is_none() {
            problem.observations.iter_mut().zip(used).for_each(|(observation, used)| observation.set_used(used));
        }
        other.or(solved)
    }

    fn input<'a>(&self, robot: &'a Robot, views: &'a [View]) -> BundleInput<'a> {
        BundleInput {
            robot,
            views,
            model: self.model.clone(),
            scales: Hyperparameters { noise: self.noise(&views[0]), ..self.scales.clone() },
            guess: self.guess,
            joint_prior: None,
            evidence: HyperparameterMode::Given,
        }
    }

    fn noise(&self, view: &View) -> f64 {
        self.scales.noise * if is_moving(view) { self.noise_in_motion } else { 1.0 }
    }

    /// Returns the belief so far as a view's prior.
    fn prior(&self, robot: &Robot, info: DMatrix<f64>) -> Prior {
        Prior {
            joint_mean: self.state.joint.clone(),
            information: Information { matrix: info, covers: Covers::All },
            mean: self.state.blocks.clone(),
            std: PerBlock::new(robot, |_| [f64::INFINITY; MAX_COLUMNS]),
        }
    }
}

fn log_det(factor: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * factor.l_dirty().diagonal().map(f64::ln).sum()
}

/// Returns the cost of used and rejected observations.
fn cost_of(problem: &BundleProblem<'_>, solved: &SolvedView) -> f64 {
    solved.normal.cost + problem.observations.iter().map(|observation| rejected(observation).chi2).sum::<f64>()
}

/// Solves a view by least squares, after a robust solution if an observation does not fit. `None` if no observation of
/// the view is used.
fn solve_view(problem: &mut BundleProblem<'_>, start: &State) -> Option<SolvedView> {
    let mut solver = ViewSolver::new(problem);
    let (mut state, mut factor) = solver.iterate(problem, start, Loss::Square)?;
    if reject_by(problem, &solver.normal) {
        // One wrong observation biases the others, so a robust solution decides which ones to reject.
        problem.observations.iter_mut().for_each(|observation| observation.set_used([true; 4]));
        (state, _) = solver.iterate(problem, start, Loss::Cauchy { c: CORNER_WIDTH })?;
        reject_by(problem, &solver.normal);
        (state, factor) = solver.iterate(problem, &state, Loss::Square)?;
    }
    let is_any_used = problem.observations.iter().any(|observation| observation.is_used);
    is_any_used.then_some(SolvedView { state, normal: solver.normal, factor })
}

/// Gauss-Newton solver, with the memory of two linearizations.
struct ViewSolver {
    /// Normal equations at the last accepted state.
    normal: NormalEquations,
    trial: NormalEquations,
}

impl ViewSolver {
    fn new(problem: &BundleProblem<'_>) -> Self {
        Self { normal: NormalEquations::new(problem), trial: NormalEquations::new(problem) }
    }

    /// Iterates from `start`; the returned factor belongs to the last linearized state.
    fn iterate(
        &mut self,
        problem: &BundleProblem<'_>,
        start: &State,
        loss: Loss,
    ) -> Option<(State, Cholesky<f64, Dyn>)> {
        let mut state = start.clone();
        self.normal.update(problem, &state, loss);
        let mut factor = cholesky(self.normal.matrix.clone())?;
        let mut trial = state.clone();
        for _ in 0..MAX_STEPS {
            let mut step = self.normal.right.clone();
            factor.solve_mut(&mut step);
            let (gain, cost) = (step.dot(&self.normal.right) + own_gain(&self.normal), self.normal.cost);
            if !(gain.is_finite() && cost.is_finite()) {
                return None;
            }
            loop {
                take_step(problem, &state, &self.normal, &step, &mut trial);
                if gain < LAST_GAIN {
                    return Some((trial, factor));
                }
                self.trial.update(problem, &trial, loss);
                // A NaN cost is no decrease.
                if self.trial.cost <= cost + LAST_GAIN || step.norm() < SHORTEST_STEP {
                    break;
                }
                step *= SHORTER;
            }
            std::mem::swap(&mut state, &mut trial);
            std::mem::swap(&mut self.normal, &mut self.trial);
            factor = cholesky(self.normal.matrix.clone())?;
        }
        Some((state, factor))
    }
}

fn view_update(problem: &BundleProblem<'_>, solved: &SolvedView, log_det_before: f64) -> ViewUpdate {
    let SolvedView { state, normal, factor } = solved;
    let of_own: f64 = normal.eliminated.iter().map(|own| own.log_ratio).sum();
    let rejected_cost: f64 = problem.observations.iter().map(|observation| rejected(observation).chi2).sum();
    let volume = log_det(factor) - log_det_before;
    let used = problem.observations.iter().filter(|observation| observation.is_used);
    let chi2 = problem.observations.iter().zip(&normal.chi2).filter(|(observation, _)| observation.is_used);
    let is_rejected = |observation: &&ObservationTerm| !observation.is_used;
    let (joint_error, time_error) = view_errors(problem, solved);
    ViewUpdate {
        cost: normal.cost,
        rejected_cost,
        observation_cost: chi2.map(|(_, chi2)| chi2).sum(),
        n_coordinates: used.map(|observation| observation.data.n_coordinates()).sum(),
        log_evidence: 0.5 * (of_own - normal.cost - rejected_cost - volume),
        rejected: problem.observations.iter().filter(is_rejected).map(|observation| observation.block).collect(),
        joint_error,
        time_error,
        scores: scores(problem, state, factor),
    }
}

/// Returns the joint errors of the view with their variances, and the error of its time.
fn view_errors(problem: &BundleProblem<'_>, solved: &SolvedView) -> ([JointErrorOfView; MAX_JOINTS], TimeErrorOfView) {
    let SolvedView { state, normal, factor } = solved;
    let mut errors = [JointErrorOfView::default(); MAX_JOINTS];
    let mut time_error = TimeErrorOfView { sigmas: 0.0, var: 1.0 };
    for (k, group) in normal.eliminated.iter().enumerate().filter(|(_, group)| group.has_any) {
        let by_columns = group.inverse * group.own_by_columns(problem, &normal.by_tag, 0);
        let has_column = |joint: &usize| group.twists.column(*joint).iter().any(|v| *v != 0.0);
        let joints: Vec<usize> = (0..MAX_JOINTS).filter(has_column).collect();
        let mut right = DMatrix::from_fn(problem.layout.n, joints.len(), |k, i| by_columns[(joints[i], k)]);
        solve_lower(factor, &mut right);
        let by_common = right.tr_mul(&right);
        let (mut own, mut covariance) = (SVector::zeros(), group.inverse);
        for (k, &joint) in joints.iter().enumerate() {
            own[joint] = state.joint_error[0][joint];
            joints.iter().enumerate().for_each(|(i, &other)| covariance[(joint, other)] += by_common[(k, i)]);
            errors[joint] = JointErrorOfView {
                error_rad: own[joint],
                prior_var: problem.joint_error_var(&problem.views[0], joint),
                var: covariance[(joint, joint)],
            };
        }
        // The tags around the arm determine the time; the gripper's tag depends on one joint.
        if k == 0 {
            time_error = group.time_error.of_view(&own, &covariance);
        }
    }
    (errors, time_error)
}

/// Returns the scores along each offset and along the position of each tag. With W the information before and P the
/// covariance after, `a = W (x' - x)` and `b = W - W P W`.
fn scores(problem: &BundleProblem<'_>, state: &State, factor: &Cholesky<f64, Dyn>) -> Scores {
    let info = &problem.prior.information.matrix;
    let pull = info * problem.prior.off(&problem.layout, state);
    let columns = problem.layout.parameters.iter().enumerate();
    let offsets: Vec<(usize, usize)> =
        columns.filter(|(_, p)| p.kind == ParameterKind::Offset).map(|(column, p)| (p.joint, column)).collect();
    let seen = problem.observations.iter().filter(|observation| observation.is_used);
    let tags: Vec<(usize, usize)> =
        seen.filter_map(|of| Some((of.block.tag_about_arm()?, problem.layout.at(of.block)?))).collect();
    let all: Vec<usize> =
        offsets.iter().map(|(_, column)| *column).chain(tags.iter().flat_map(|(_, at)| *at..at + 3)).collect();
    let mut half = info.select_columns(&all);
    solve_lower(factor, &mut half);
    let mut scores = Scores::default();
    for (k, (joint, column)) in offsets.iter().enumerate() {
        let b = info[(*column, *column)] - half.column(k).norm_squared();
        scores.walk[*joint] = WalkScore { a: pull[*column], b };
    }
    scores.tags = tags
        .iter()
        .enumerate()
        .map(|(k, &(tag, at))| {
            let half = half.fixed_columns::<3>(offsets.len() + 3 * k);
            let b = info.fixed_view::<3, 3>(at, at) - half.tr_mul(&half);
            TagScore { tag, a: pull.fixed_rows::<3>(at).into_owned(), b }
        })
        .collect();
    scores
}
