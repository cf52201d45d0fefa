//! The paper's first method, after Kim et al. (2010): one landmark, seen from many poses, must have one position.
//!
//! Objective: `sum_j tr(C_j)`, over the landmarks seen at least twice. `C_j` is the covariance (divisor m - 1) of the m
//! positions of landmark j in the base frame. It needs no map, so motions that turn all positions together do not
//! change it. An offset of the first joint turns them about its axis and changes no distance between any two of them.
//! Where the arm carries the landmarks and they are in its hand's frame, that is the last joint. This is an exact gauge
//! freedom, not a weak direction, and noise does not affect it. The offset is held, and so are all parameters that the
//! views leave without any effect.

use crate::constants::minimum_variance::{NULL_SHARE, PART_OF_NULL};
use nalgebra::{Const, DMatrix, DVector, Dyn, OMatrix, Vector3};

use armcal_belief::calib::Unobservable;
use armcal_belief::calib::{CommonErrors, ParameterCovariance};
use armcal_belief::calib::{PositionProblem, TagResidual};
use armcal_belief::model::{JointParameters, Parameter, ParameterKind};
use armcal_core::robot::Robot;

/// Treatment of the first joint's offset under minimum variance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gauge {
    /// Estimated like the others; its result is arbitrary.
    Free,
    /// Held at the guess.
    Fixed,
}

/// Sums of one landmark's positions, about the first of them so that nothing cancels.
#[derive(Clone, Copy, Debug, Default)]
struct Cloud {
    n: usize,
    first_m: Vector3<f64>,
    sum_m: Vector3<f64>,
    sum_m2: f64,
}

impl Cloud {
    fn add(&mut self, position_m: &Vector3<f64>) {
        if self.n == 0 {
            self.first_m = *position_m;
        }
        let from_first = position_m - self.first_m;
        self.sum_m += from_first;
        self.sum_m2 += from_first.norm_squared();
        self.n += 1;
    }

    fn trace_m2(&self) -> f64 {
        if self.n < 2 {
            return 0.0;
        }
        let n = self.n as f64;
        (self.sum_m2 - self.sum_m.norm_squared() / n) / (n - 1.0)
    }
}

/// The objective, with its working memory.
#[derive(Clone, Debug)]
pub struct VarianceObjective<'a> {
    problem: &'a PositionProblem<'a>,
    clouds: Vec<Cloud>,
}

impl<'a> VarianceObjective<'a> {
    /// The objective over all tags of the views.
    #[must_use]
    pub fn new(problem: &'a PositionProblem<'a>) -> Self {
        Self { problem, clouds: vec![Cloud::default(); problem.robot.tags.len()] }
    }

    /// Sum over landmarks of the trace of the covariance of their positions, m^2.
    pub fn trace_m2(&mut self, at: &JointParameters) -> f64 {
        self.clouds.fill(Cloud::default());
        let clouds = &mut self.clouds;
        self.problem.each(at, |o| clouds[o.tag.tag_idx].add(&o.predicted_m));
        self.clouds.iter().map(Cloud::trace_m2).sum()
    }
}

/// Square roots of the objective's terms, `(z_ij - mean_j) / sqrt(m_j - 1)`, and their derivatives.
struct Centered {
    /// View of each observation.
    view_idx: Vec<usize>,
    residuals: DVector<f64>,
    by_parameters: DMatrix<f64>,
    /// Derivatives by the camera's mount: translation m, rotation rad, on the right.
    by_mount: DMatrix<f64>,
}

impl Centered {
    fn new(problem: &PositionProblem<'_>, columns: &[Parameter], at: &JointParameters) -> Self {
        let (n, rows) = (columns.len(), 3 * problem.n_observations());
        let mut tags = Vec::with_capacity(rows / 3);
        let mut view_idx = Vec::with_capacity(rows / 3);
        // Columns: position, derivatives by parameters, derivatives by the mount.
        let mut all = DMatrix::zeros(rows, 1 + n + 6);
        problem.each(at, |o| {
            fill(problem, columns, o, &mut all, 3 * tags.len());
            tags.push(o.tag.tag_idx);
            view_idx.push(o.view_idx);
        });
        for tag in 0..problem.robot.tags.len() {
            let of_tag: Vec<usize> = (0..tags.len()).filter(|&k| tags[k] == tag).collect();
            center(&mut all, &of_tag);
        }
        Self {
            view_idx,
            residuals: all.column(0).into_owned(),
            by_parameters: all.columns(1, n).into_owned(),
            by_mount: all.columns(1 + n, 6).into_owned(),
        }
    }
}

fn fill(problem: &PositionProblem<'_>, columns: &[Parameter], o: &TagResidual<'_>, all: &mut DMatrix<f64>, row: usize) {
    let n = columns.len();
    all.fixed_view_mut::<3, 1>(row, 0).copy_from(&o.predicted_m);
    for (column, &parameter) in columns.iter().enumerate() {
        all.fixed_view_mut::<3, 1>(row, 1 + column).copy_from(&problem.derivative(o, parameter));
    }
    let (by_translation, by_rotation) = PositionProblem::mount_derivative(o);
    all.fixed_view_mut::<3, 3>(row, 1 + n).copy_from(&by_translation);
    all.fixed_view_mut::<3, 3>(row, 4 + n).copy_from(&by_rotation);
}

/// Subtracts the mean over one landmark's observations from each, and divides by `sqrt(m - 1)`; zero for a single
/// observation.
fn center(all: &mut DMatrix<f64>, observations: &[usize]) {
    let m = observations.len() as f64;
    let weight = if observations.len() < 2 { 0.0 } else { (m - 1.0).sqrt().recip() };
    for column in 0..all.ncols() {
        let mut mean = Vector3::zeros();
        for &k in observations {
            mean += all.fixed_view::<3, 1>(3 * k, column) / m;
        }
        for &k in observations {
            let mut block = all.fixed_view_mut::<3, 1>(3 * k, column);
            block -= mean;
            block *= weight;
        }
    }
}

/// The joint nearest to the tags: the first, or the last before tags that the arm carries.
fn gauge_joint(robot: &Robot) -> usize {
    if robot.is_watched() { robot.tag_frame.n_joints - 1 } else { 0 }
}

/// Parameters of `free` that minimum variance can determine, and those to which it is exactly blind; linearized at
/// `guess`.
#[must_use]
pub fn determined_by_variance(
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    guess: &JointParameters,
) -> (Vec<Parameter>, Vec<Unobservable>) {
    let gauge = gauge_joint(problem.robot);
    let is_gauge = |p: &Parameter| p.joint == gauge && p.kind == ParameterKind::Offset;
    let mut left: Vec<Parameter> = free.iter().copied().filter(|p| !is_gauge(p)).collect();
    let mut blind: Vec<Unobservable> = free
        .iter()
        .copied()
        .filter(is_gauge)
        .map(|parameter| {
            let reason = "minimum variance is exactly blind to it: it turns every position about the axis nearest \
                          to the tags alike. Held; only the place of a base tag determines it";
            Unobservable { parameter, reason: reason.to_owned() }
        })
        .collect();
    while let Some(worst) = largest_in_null_space(problem, &left, guess) {
        let parameter = left.remove(worst);
        let reason = "it changes nothing in the spread of any landmark that these views show twice: held".to_owned();
        blind.push(Unobservable { parameter, reason });
    }
    blind.sort_by_key(|u| u.parameter);
    (left, blind)
}

/// The parameter with the largest part in the directions that do not change the objective.
fn largest_in_null_space(problem: &PositionProblem<'_>, free: &[Parameter], guess: &JointParameters) -> Option<usize> {
    if free.is_empty() {
        return None;
    }
    let mut jacobian = Centered::new(problem, free, guess).by_parameters;
    for (column, parameter) in free.iter().enumerate() {
        jacobian.column_mut(column).scale_mut(parameter.prior_std(problem.robot));
    }
    let eigen = (jacobian.transpose() * &jacobian).symmetric_eigen();
    let floor = eigen.eigenvalues.amax() * NULL_SHARE;
    let part = |row: usize| {
        let null = (0..free.len()).filter(|&k| eigen.eigenvalues[k] <= floor);
        null.map(|k| eigen.eigenvectors[(row, k)].powi(2)).sum::<f64>()
    };
    let (worst, share) =
        (0..free.len()).map(|row| (row, part(row))).max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
    (share > PART_OF_NULL).then_some(worst)
}

/// Covariance of the parameters that minimum variance determined, as the sandwich `A^-1 B A^-1` over views, and
/// d(parameter)/d(mount), six columns. See [`ParameterCovariance::estimate`] for the other objective. The landmarks'
/// means are marginalised, so no survey enters; the mount's error does. Held parameters keep their prior.
#[must_use]
pub fn variance_covariance(
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    at: &JointParameters,
    errors: &CommonErrors,
) -> (ParameterCovariance, DMatrix<f64>) {
    let n = free.len();
    let terms = Centered::new(problem, free, at);
    let transposed = terms.by_parameters.transpose();
    let Some(inverse) = (&transposed * &terms.by_parameters).try_inverse() else {
        let matrix = DMatrix::from_diagonal_element(n, n, f64::INFINITY);
        return (
            ParameterCovariance { parameters: free.to_vec(), matrix, residual_std_rad: None },
            DMatrix::zeros(n, 6),
        );
    };
    let mut view_gradients = DMatrix::zeros(n, problem.views.len());
    for (k, &view) in terms.view_idx.iter().enumerate() {
        let residual: Vector3<f64> = terms.residuals.fixed_rows::<3>(3 * k).into_owned();
        let block: OMatrix<f64, Dyn, Const<3>> = transposed.fixed_columns::<3>(3 * k).into_owned();
        let mut sum = view_gradients.column_mut(view);
        sum += block * residual;
    }
    let used = problem.views.iter().filter(|view| !view.tags.is_empty()).count();
    let small_sample = used as f64 / used.saturating_sub(1).max(1) as f64;
    let scatter = &view_gradients * view_gradients.transpose() * small_sample;
    let by_mount = -(&inverse * &transposed * &terms.by_mount);
    let from_mount = &by_mount * errors.mount * by_mount.transpose();
    let matrix = &inverse * scatter * &inverse + from_mount;
    (ParameterCovariance { parameters: free.to_vec(), matrix, residual_std_rad: None }, by_mount)
}
