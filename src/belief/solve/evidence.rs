//! Noise and prior sizes from the data: MacKay's fixed point of the evidence.
//!
//! For a group of parameters x with prior variance s^2 and posterior variances v, `gamma = sum (1 - v / s^2)` of them
//! are told by the data, and `s^2 = (sum x^2 + nu s0^2) / (gamma + nu)` (MacKay 1992, eq. 4.9), with nu
//! pseudo-observations of the datasheet's s0. The noise: `(sum chi^2 + nu) / (N - gamma_all + nu)`.

use crate::solve::constants::evidence::{FEW, NU_CAMERA, NU_LINK, NU_NOISE, NU_SHAPE, NU_TERM, STEP};
pub(crate) use crate::solve::constants::evidence::{NOISE_BOUNDS, NU_JOINT, POSITION_BOUNDS, SCALE_BOUNDS};
use nalgebra::{Cholesky, DMatrix, Dyn};

use crate::measure::WeightedMeasurement;
use crate::model::blocks::{Block, Std};
use crate::model::parameters::ParameterKind;
use crate::model::prior::at_least;
use crate::model::scales::{Hyperparameters, SHAPE_LENGTH};
use crate::model::state::State;
use crate::model::walk_modes::mode_std;
use crate::solve::linearize::NormalEquations;
use crate::solve::problem::{BundleProblem, N_VIEW_PARAMETERS};
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::Loss;
use armcal_core::sensor::shape_prior;
use armcal_core::spatial::log;

/// The posterior at the scales of the problem.
#[derive(Clone, Debug)]
pub(crate) struct Posterior {
    /// Covariance of the common parameters.
    pub covariance: DMatrix<f64>,
    /// Variances of each view's own parameters.
    pub own: Vec<[f64; N_VIEW_PARAMETERS]>,
    /// The part of these that is left by the common ones.
    pub by_common: Vec<[f64; N_VIEW_PARAMETERS]>,
}

/// Covariance that an estimate reports.
#[derive(Clone)]
pub(crate) struct Marginal {
    /// Covariance of the common parameters.
    pub covariance: DMatrix<f64>,
    /// Standard deviation of each joint's error at a new pose, rad.
    pub joint_std_rad: [f64; MAX_JOINTS],
    /// Factor on the variances, by the held-out cameras.
    pub factor: f64,
}

impl Posterior {
    /// `None` where the normal equations have no inverse.
    pub(crate) fn of(problem: &BundleProblem<'_>, normal: &NormalEquations) -> Option<Self> {
        let factor = Cholesky::new(normal.matrix.clone())?;
        let covariance = factor.inverse();
        let mut own = vec![[0.0; N_VIEW_PARAMETERS]; problem.views.len()];
        let mut by_common = own.clone();
        let mut groups = normal.eliminated.iter();
        for (view_idx, view) in problem.views.iter().enumerate() {
            for group in groups.by_ref().take(1 + usize::from(view.gripper.is_some())) {
                let by_columns = group.inverse * group.own_by_columns(problem, &normal.by_tag, view_idx);
                let used: Vec<usize> =
                    (0..N_VIEW_PARAMETERS).filter(|&row| group.twists.column(row).iter().any(|v| *v != 0.0)).collect();
                let right = DMatrix::from_fn(problem.layout.n, used.len(), |k, row| by_columns[(used[row], k)]);
                for (variance, &row) in squares_over(&factor, &covariance, right).into_iter().zip(&used) {
                    by_common[view_idx][row] = variance;
                    own[view_idx][row] = group.inverse[(row, row)] + variance;
                }
            }
        }
        Some(Self { covariance, own, by_common })
    }
}

/// `b^T N^-1 b` of each column b of `right`, by the factor of N or by its inverse, the covariance.
fn squares_over(factor: &Cholesky<f64, Dyn>, covariance: &DMatrix<f64>, mut right: DMatrix<f64>) -> Vec<f64> {
    let touched: Vec<usize> = (0..right.nrows()).filter(|&k| right.row(k).iter().any(|v| *v != 0.0)).collect();
    if FEW * touched.len() < right.nrows() {
        let rows = right.select_rows(&touched);
        let among = DMatrix::from_fn(touched.len(), touched.len(), |a, b| covariance[(touched[a], touched[b])]);
        return rows.column_iter().map(|column| column.dot(&(&among * column))).collect();
    }
    factor.l_dirty().solve_lower_triangular_mut(&mut right);
    right.column_iter().map(|column| column.norm_squared()).collect()
}

/// Sums over one group of parameters with a common prior size.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    squares: f64,
    gamma: f64,
}

impl Sums {
    /// `std`: the prior's; `value` and `variance` of the posterior.
    fn add(&mut self, value: f64, variance: f64, std: f64) {
        self.squares += value * value;
        self.gamma += (1.0 - variance / (std * std)).clamp(0.0, 1.0);
    }

    /// Expected square of an error of variance s^2 that n views share, each under a prior of n s^2. `left`: the shares of that which it
    /// has after the views, all of it and what the common parameters leave open. With g = 1 - what its own view leaves
    /// open, the estimate has the square `s^2 g (g + n (1 - g))` on average, less n times what the common parameters
    /// take up; it counts once.
    fn add_shared(&mut self, value: f64, [left, by_common]: [f64; 2], n: f64) {
        let g = (1.0 - left + by_common).clamp(0.0, 1.0);
        self.squares += value * value / n;
        self.gamma += (g * (g + n * (1.0 - g)) - n * by_common).max(0.0) / n;
    }

    fn std(&self, nu: f64, first: f64, moment: ScaleMoment) -> f64 {
        let std = ((self.squares + nu * first * first) / moment.divisor(self.gamma + nu)).sqrt();
        std.clamp(first * SCALE_BOUNDS[0], first * SCALE_BOUNDS[1])
    }
}

/// Which square of a scale is taken of its inverse chi-square distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScaleMoment {
    /// The sum of squares over the degrees of freedom: what the evidence asks for.
    Fitted,
    /// The mean.
    Mean,
}

impl ScaleMoment {
    /// Divisor of a sum of squares of `dof` degrees of freedom. A mean needs more than two; below four it counts as twice the
    /// fitted square.
    fn divisor(self, dof: f64) -> f64 {
        match self {
            Self::Fitted => dof,
            Self::Mean => (dof - 2.0).max(0.5 * dof),
        }
    }
}

/// Where the scales began, and which squares of them are wanted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScaleTarget<'a> {
    first: &'a Hyperparameters,
    moment: ScaleMoment,
}

impl<'a> ScaleTarget<'a> {
    pub(crate) fn fitted(first: &'a Hyperparameters) -> Self {
        Self { first, moment: ScaleMoment::Fitted }
    }

    pub(crate) fn mean(first: &'a Hyperparameters) -> Self {
        Self { first, moment: ScaleMoment::Mean }
    }
}

/// The scales that `posterior` asks for.
pub(crate) fn updated(
    problem: &BundleProblem<'_>,
    state: &State,
    normal: &NormalEquations,
    posterior: &Posterior,
    target: &ScaleTarget<'_>,
) -> Hyperparameters {
    let mut next = problem.scales.clone();
    let update = ScaleUpdate { problem, state, posterior, target };
    update.update_joints(&mut next);
    update.update_terms(&mut next);
    update.update_camera_error(&mut next);
    update.update_noise(normal, &mut next);
    next
}

/// Inputs of new scales.
struct ScaleUpdate<'a, 'b> {
    problem: &'a BundleProblem<'b>,
    state: &'a State,
    posterior: &'a Posterior,
    target: &'a ScaleTarget<'a>,
}

impl ScaleUpdate<'_, '_> {
    fn update_joints(&self, next: &mut Hyperparameters) {
        let Self { problem, state, posterior, .. } = *self;
        let ScaleTarget { first, moment } = *self.target;
        for joint in 0..problem.robot.n_joints() {
            let (mut sums, mut reading_var, mut n) = (Sums::default(), 0.0, 0.0);
            for (view_idx, view) in problem.views.iter().enumerate() {
                let variance = posterior.own[view_idx][joint];
                if view.is_free[joint] || variance <= 0.0 {
                    continue;
                }
                let (value, var) = (state.joint_error[view_idx][joint], problem.joint_error_var(view, joint));
                if view.n_cameras > 1.0 {
                    let left = [variance, posterior.by_common[view_idx][joint]].map(|of| of / var);
                    sums.add_shared(value, left, view.n_cameras);
                } else {
                    sums.add(value, variance, var.sqrt());
                }
                reading_var += view.reading_var[joint] + problem.jitter_rad(view, joint).powi(2);
                n += 1.0;
            }
            if n > 0.0 {
                let reading_var = reading_var / n;
                let total = sums.std(NU_JOINT, first.joint_std_rad[joint].hypot(reading_var.sqrt()), moment);
                let least = first.joint_std_rad[joint] * SCALE_BOUNDS[0];
                next.joint_std_rad[joint] = (total * total - reading_var).max(least * least).sqrt();
            }
        }
    }

    fn update_terms(&self, next: &mut Hyperparameters) {
        let Self { problem, state, posterior, .. } = *self;
        let ScaleTarget { first, moment } = *self.target;
        let layout = &problem.layout;
        let basis = shape_prior(SHAPE_LENGTH);
        let of_kinds = |wanted: &dyn Fn(ParameterKind) -> Option<f64>, columns: std::ops::Range<usize>, std: f64| {
            let mut sums = Sums::default();
            for column in columns {
                let Some(unit) = wanted(layout.parameters[column].kind) else { continue };
                let variance = posterior.covariance[(column, column)] / (unit * unit);
                sums.add((state.joint[column] - problem.prior.joint_mean[column]) / unit, variance, std);
            }
            sums
        };
        let shape = |kind: ParameterKind| match kind {
            ParameterKind::Shape(h) => Some(basis[usize::from(h)]),
            _ => None,
        };
        for (joint, columns) in layout.of_joint.iter().enumerate() {
            let sums = of_kinds(&shape, columns.clone(), problem.scales.shape_std_rad[joint]);
            if sums != Sums::default() {
                next.shape_std_rad[joint] = sums.std(NU_SHAPE, first.shape_std_rad[joint], moment);
            }
        }
        self.update_walks(next);
        self.update_links(next);
        self.update_sag(next);
        let all = 0..layout.n_joint();
        let is = |kind: ParameterKind| move |other: ParameterKind| (other == kind).then_some(1.0);
        let now = &problem.scales;
        for (kind, std, first, next) in [
            (
                ParameterKind::OffsetPerK,
                now.offset_std_rad_per_k,
                first.offset_std_rad_per_k,
                &mut next.offset_std_rad_per_k,
            ),
            (ParameterKind::GainPerK, now.gain_std_per_k, first.gain_std_per_k, &mut next.gain_std_per_k),
            (
                ParameterKind::OffsetPerMpa,
                now.offset_std_rad_per_mpa,
                first.offset_std_rad_per_mpa,
                &mut next.offset_std_rad_per_mpa,
            ),
            (
                ParameterKind::DriftPerH,
                now.drift_std_rad_per_h,
                first.drift_std_rad_per_h,
                &mut next.drift_std_rad_per_h,
            ),
            (ParameterKind::HalfBacklash, now.half_play_std_rad, first.half_play_std_rad, &mut next.half_play_std_rad),
        ] {
            let sums = of_kinds(&is(kind), all.clone(), std);
            if sums != Sums::default() {
                *next = sums.std(NU_TERM, first, moment);
            }
        }
    }

    fn update_walks(&self, next: &mut Hyperparameters) {
        let Self { problem, state, posterior, .. } = *self;
        let ScaleTarget { first, moment } = *self.target;
        for (joint, columns) in problem.layout.of_joint.iter().enumerate() {
            let mut sums = Sums::default();
            for column in columns.clone() {
                if let ParameterKind::WalkMode(k) = problem.layout.parameters[column].kind {
                    let unit = mode_std(k);
                    let variance = posterior.covariance[(column, column)] / (unit * unit);
                    sums.add(state.joint[column] / unit, variance, problem.scales.walk_std_rad[joint]);
                }
            }
            if sums != Sums::default() {
                next.walk_std_rad[joint] = sums.std(NU_TERM, first.walk_std_rad[joint], moment);
            }
        }
    }

    /// Each link's shift and turn has a size of its own, so that one wrong link does not loosen the others (automatic
    /// relevance determination, MacKay 1994); the camera mount's likewise.
    fn update_links(&self, next: &mut Hyperparameters) {
        let Self { problem, state, posterior, .. } = *self;
        let ScaleTarget { first, moment } = *self.target;
        let layout = &problem.layout;
        for (k, columns) in layout.links.clone().collect::<Vec<_>>().chunks_exact(3).enumerate() {
            let mut sums = Sums::default();
            for &column in columns {
                let value = state.joint[column] - problem.prior.joint_mean[column];
                sums.add(value, posterior.covariance[(column, column)], problem.scales.link_std[k / 2][k % 2]);
            }
            next.link_std[k / 2][k % 2] = sums.std(NU_LINK, first.link_std[k / 2][k % 2], moment);
        }
        if layout.links.is_empty() {
            return;
        }
        for (block, at) in layout.blocks() {
            let Block::Mount(camera) = block else { continue };
            let off = state.blocks[block].off(&problem.prior.mean[block]);
            let (std, scale) = (&problem.prior.std[block], problem.scales.mount_scale[camera]);
            next.mount_scale[camera] = self.mount_scale((at, std), &off, scale);
        }
    }

    /// New scales (shift, turn) of a mount whose columns begin at `at`, whose prior is `std`, and which is `off` nominal.
    fn mount_scale(&self, (at, std): (usize, &Std), off: &Std, now: [f64; 2]) -> [f64; 2] {
        let Self { posterior, .. } = *self;
        let unit = std.map(at_least);
        [0, 1].map(|kind| {
            let (mut sums, scale) = (Sums::default(), now[kind]);
            for row in 3 * kind..3 * kind + 3 {
                let unit = unit[row] / scale;
                sums.add(off[row] / unit, posterior.covariance[(at + row, at + row)] / (unit * unit), scale);
            }
            sums.std(NU_LINK, 1.0, self.target.moment)
        })
    }

    /// Joints share a size of their compliances; the base has its own.
    fn update_sag(&self, next: &mut Hyperparameters) {
        let Self { problem, state, posterior, .. } = *self;
        let ScaleTarget { first, moment } = *self.target;
        let mut sums = [Sums::default(); 2];
        for column in problem.layout.sag.clone() {
            let group = match problem.layout.parameters[column].kind {
                ParameterKind::Compliance => 0,
                ParameterKind::MountCompliance(_) => 1,
                _ => continue,
            };
            let value = state.joint[column] - problem.prior.joint_mean[column];
            sums[group].add(value, posterior.covariance[(column, column)], problem.scales.compliance_std[group]);
        }
        if !problem.layout.sag.is_empty() {
            next.compliance_std = [0, 1].map(|group| sums[group].std(NU_LINK, first.compliance_std[group], moment));
        }
    }

    fn update_camera_error(&self, next: &mut Hyperparameters) {
        let Self { problem, state, posterior, .. } = *self;
        let ScaleTarget { first, moment } = *self.target;
        let (Some(now), Some(first)) = (problem.scales.camera_error_std, first.camera_error_std) else { return };
        let mut sums = [Sums::default(); 2];
        for (error, own) in state.camera_error.iter().zip(&posterior.own) {
            let d = log(error);
            for k in (0..6).filter(|k| own[MAX_JOINTS + k] > 0.0) {
                sums[k / 3].add(d[k], own[MAX_JOINTS + k], now[k / 3]);
            }
        }
        next.camera_error_std = Some([0, 1].map(|k| sums[k].std(NU_CAMERA, first[k], moment)));
    }

    /// The noise of corners; of a recording with positions or poses in their place theirs, each by itself.
    fn update_noise(&self, normal: &NormalEquations, next: &mut Hyperparameters) {
        let Self { problem, state, posterior, .. } = *self;
        let used = || problem.observations.iter().enumerate().filter(|(_, observation)| observation.is_used);
        let n_of =
            |kind: NoiseKind| used().map(|(_, observation)| kind.n_coordinates(&observation.data)).sum::<usize>();
        let [n_positions, n_rotations] = [NoiseKind::Position, NoiseKind::Rotation].map(n_of);
        let mut chi2: f64 = used().map(|(at, _)| normal.chi2[at]).sum();
        let mut told = determined(problem, posterior);
        let factor = |chi2: f64, n: usize, told: f64| {
            let free = (n as f64 - told).max(1.0);
            ((chi2 + NU_NOISE) / self.target.moment.divisor(free + NU_NOISE)).sqrt()
        };
        for (kind, n, now, std) in [
            (NoiseKind::Position, n_positions, problem.scales.position_std_m, &mut next.position_std_m),
            (NoiseKind::Rotation, n_rotations, problem.scales.rotation_std_rad, &mut next.rotation_std_rad),
        ] {
            if n > 0 {
                let (own_chi2, own_told) = share_of(problem, state, normal, kind);
                let first = kind.std(self.target.first);
                *std =
                    (now * factor(own_chi2, n, own_told)).clamp(first * POSITION_BOUNDS[0], first * POSITION_BOUNDS[1]);
                (chi2, told) = (chi2 - own_chi2, told - own_told);
            }
        }
        let n_corners = n_of(NoiseKind::Corner);
        if n_corners > 0 {
            let noise = problem.scales.noise * factor(chi2, n_corners, told);
            next.noise = noise.clamp(NOISE_BOUNDS[0], NOISE_BOUNDS[1]);
        }
    }
}

/// Kinds of measurements with a noise of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NoiseKind {
    Corner,
    Position,
    Rotation,
}

impl NoiseKind {
    fn n_coordinates(self, data: &WeightedMeasurement) -> usize {
        match (self, data) {
            (Self::Corner, WeightedMeasurement::Corners(_) | WeightedMeasurement::Board { .. }) => data.n_coordinates(),
            (Self::Position, WeightedMeasurement::Position { .. } | WeightedMeasurement::Pose { .. })
            | (Self::Rotation, WeightedMeasurement::Pose { .. }) => 3,
            _ => 0,
        }
    }

    /// Standard deviation of positions or rotations, m or rad.
    fn std(self, scales: &Hyperparameters) -> f64 {
        if self == Self::Rotation { scales.rotation_std_rad } else { scales.position_std_m }
    }
}

/// Chi-square of positions or of rotations, and the number of parameters that they determine. With the information of that kind
/// times `1 + e`, chi-square grows by `e` times its part, and `ln det` of the normal matrix, the views' own parameters
/// with it, by `ln (1 + e)` times the parameters told.
fn share_of(problem: &BundleProblem<'_>, state: &State, normal: &NormalEquations, kind: NoiseKind) -> (f64, f64) {
    let mut stiffer = problem.clone();
    let by = |wanted: NoiseKind| if kind == wanted { 1.0 + STEP } else { 1.0 };
    stiffer.weigh_positions([by(NoiseKind::Position), by(NoiseKind::Rotation)]);
    let mut other = NormalEquations::new(&stiffer);
    other.update(&stiffer, state, Loss::Square);
    let log_det = |normal: &NormalEquations| {
        let of_views: f64 = normal.eliminated.iter().map(|own| own.log_ratio).sum();
        Cholesky::new(normal.matrix.clone())
            .map_or(f64::NAN, |f| 2.0 * f.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>() - of_views)
    };
    let used = problem.observations.iter().zip(other.chi2.iter().zip(&normal.chi2)).filter(|(o, _)| o.is_used);
    let chi2 = used.map(|(_, (stiffer, chi2))| stiffer - chi2).sum::<f64>() / STEP;
    let told = (log_det(&other) - log_det(normal)) / STEP.ln_1p();
    (chi2.max(0.0), if told.is_finite() { told.max(0.0) } else { 0.0 })
}

/// Number of parameters that the data determine, including the views' own.
pub(crate) fn determined(problem: &BundleProblem<'_>, posterior: &Posterior) -> f64 {
    let layout = &problem.layout;
    let information = &problem.prior.information.matrix;
    let n = information.nrows();
    let prior_share = |at: usize, std: f64| {
        if std.is_finite() { posterior.covariance[(at, at)] / at_least(std).powi(2) } else { 0.0 }
    };
    let mut gamma = layout.n as f64;
    gamma -= posterior.covariance.view((0, 0), (n, n)).component_mul(information).sum();
    for (_, at, std) in problem.prior.by_std(layout) {
        gamma -= std.iter().enumerate().map(|(k, std)| prior_share(at + k, *std)).sum::<f64>();
    }
    for (view, own) in problem.views.iter().zip(&posterior.own) {
        for (joint, variance) in own.iter().take(MAX_JOINTS).enumerate().filter(|(_, v)| **v > 0.0) {
            gamma += (1.0 - variance / problem.joint_error_var(view, joint)).clamp(0.0, 1.0);
        }
        if let Some(std) = problem.scales.camera_error_std {
            let camera = own[MAX_JOINTS..].iter().enumerate().filter(|(_, v)| **v > 0.0);
            gamma += camera.map(|(k, v)| (1.0 - v / std[k / 3].powi(2)).clamp(0.0, 1.0)).sum::<f64>();
        }
    }
    gamma
}

impl PartialEq for Sums {
    fn eq(&self, other: &Self) -> bool {
        self.squares == other.squares && self.gamma == other.gamma
    }
}

/// The largest relative change of any scale.
pub(crate) fn change(a: &Hyperparameters, b: &Hyperparameters) -> f64 {
    let numbers = |s: &Hyperparameters| {
        let mut all = vec![
            s.noise,
            s.position_std_m,
            s.rotation_std_rad,
            s.offset_std_rad_per_k,
            s.gain_std_per_k,
            s.offset_std_rad_per_mpa,
            s.drift_std_rad_per_h,
            s.half_play_std_rad,
        ];
        all.extend(s.joint_std_rad);
        all.extend(s.shape_std_rad);
        all.extend(s.walk_std_rad);
        all.extend(s.link_std.iter().flatten());
        all.extend(s.compliance_std);
        all.extend(s.mount_scale.iter().flatten());
        all.extend(s.camera_error_std.into_iter().flatten());
        all
    };
    numbers(a).iter().zip(numbers(b)).map(|(a, b)| (a / b).ln().abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use rand::RngExt;

    #[test]
    fn columns_with_few_entries_have_the_squares_of_any() {
        let n = 120;
        let mut rng = stream_rng(1, "few entries");
        let mixed = DMatrix::from_fn(n, n, |_, _| rng.random_range(-1.0..1.0));
        let normal = &mixed * mixed.transpose() + DMatrix::identity(n, n);
        let factor = Cholesky::new(normal).expect("positive definite");
        let covariance = factor.inverse();
        for n_entries in [20, 100] {
            let right = DMatrix::from_fn(n, 3, |k, _| {
                let value = rng.random_range(-1.0..1.0);
                if k < n_entries { value } else { 0.0 }
            });
            let expected: Vec<f64> = right.column_iter().map(|b| b.dot(&factor.solve(&b.into_owned()))).collect();
            for (found, expected) in squares_over(&factor, &covariance, right).into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-9, "{n_entries}: {found} for {expected}");
            }
        }
    }
}
