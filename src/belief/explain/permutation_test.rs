//! Permutation tests over the views: whether a joint's error depends on time, beyond the arm's configurations.
//!
//! Series are often captured in an order that goes through the configurations. Every effect of the configuration that
//! the model lacks then looks like one of time. So the errors y are regressed on smooth functions X of the angles. A
//! statistic of the residual's order in time is compared with that of its permutations, each regressed again (Freedman
//! and Lane 1983). Residuals are scaled to one variance by their leverages, statistics by the sum of squares. If
//! nothing depends on time, the p-value is uniform.

use crate::explain::constants::permutation_test::{
    ENOUGH_ABOVE, LEAST_LEFT, LEAST_NEW, MAX_FUNCTIONS, N_PERMUTATIONS, VIEWS_PER_FUNCTION,
};
use crate::explain::step_test::JointError;
use crate::explain::walk::WARMTH_WORTH_A_FIT;
use crate::model::parameters::ParameterKind;
use crate::model::scales::Hyperparameters;
use crate::solve::estimate::Estimate;
use armcal_core::joints::JointAngles;
use armcal_core::stats::stream_rng;
use nalgebra::{DMatrix, DVector};
use rand::seq::SliceRandom;

/// Errors of one joint in the order of time, and the part that its configurations explain.
pub(crate) struct TimeOrder {
    /// Functions of the configuration in orthonormal columns.
    by_configuration: DMatrix<f64>,
    /// Errors of unit variance, less the part that the columns explain.
    residual: DVector<f64>,
}

impl TimeOrder {
    /// Regresses `errors`, in the order of time, each with the arm's angles. The regressors are `stated`, effects that
    /// the model has at their stated size, then functions of the angles, the joint's own first.
    pub(crate) fn new(errors: &[f64], angles: &[JointAngles], joint: usize, stated: Vec<DVector<f64>>) -> Self {
        let by_configuration = smooth_functions(angles, joint, stated);
        let residual = without(&by_configuration, &DVector::from_column_slice(errors));
        Self { by_configuration, residual }
    }

    /// Probability of as large a statistic in a random order of the views.
    fn p_value(&self, name: &str, statistic: impl Fn(&DVector<f64>) -> f64) -> f64 {
        let scaled = |y: &DVector<f64>| statistic(y) / y.norm_squared().max(f64::MIN_POSITIVE);
        let observed = scaled(&self.residual);
        let mut rng = stream_rng(0, name);
        let mut permuted = self.exchangeable();
        let mut above = 0;
        for n in 1..=N_PERMUTATIONS {
            permuted.as_mut_slice().shuffle(&mut rng);
            above += usize::from(scaled(&without(&self.by_configuration, &permuted)) >= observed);
            if above == ENOUGH_ABOVE {
                return above as f64 / n as f64;
            }
        }
        (above + 1) as f64 / (N_PERMUTATIONS + 1) as f64
    }

    /// Residuals scaled by the variance that the regression took from each.
    fn exchangeable(&self) -> DVector<f64> {
        let left = |row: usize| (1.0 - self.by_configuration.row(row).norm_squared()).max(LEAST_LEFT);
        DVector::from_fn(self.residual.len(), |row, _| self.residual[row] / left(row).sqrt())
    }

    /// Returns the p-value of the weighted squares of the scores along `patterns`, one row per view.
    pub(crate) fn p_of_patterns(&self, patterns: &DMatrix<f64>, weights: &[f64]) -> f64 {
        self.p_value("permutations/patterns", |y| {
            patterns.column_iter().zip(weights).map(|(pattern, weight)| weight * pattern.dot(y).powi(2)).sum()
        })
    }

    /// Returns the p-value of the largest step between two views, with at least `min_side` views on each side.
    pub(crate) fn p_of_step(&self, min_side: usize) -> f64 {
        let n = self.residual.len();
        let mut explained = DVector::zeros(self.by_configuration.ncols());
        // Square of a step before each view after the regression.
        let left: Vec<f64> = (0..n)
            .map(|at| {
                let left = at as f64 - explained.norm_squared();
                explained += self.by_configuration.row(at).transpose();
                left
            })
            .collect();
        self.p_value("permutations/step", |y| {
            let (mut sum, mut most) = (0.0, 0.0_f64);
            for (at, value) in y.iter().enumerate() {
                let has_sides = at >= min_side && at + min_side <= n;
                if has_sides && left[at] > LEAST_NEW * at as f64 {
                    most = most.max(sum * sum / left[at]);
                }
                sum += value;
            }
            most
        })
    }
}

/// Probability of as large a statistic of the order of `n` in a random order.
pub(crate) fn p_of_order(name: &str, n: usize, statistic: impl Fn(&[usize]) -> f64) -> f64 {
    let mut order: Vec<usize> = (0..n).collect();
    let observed = statistic(&order);
    let mut rng = stream_rng(0, name);
    let mut above = 0;
    for tried in 1..=N_PERMUTATIONS {
        order.shuffle(&mut rng);
        above += usize::from(statistic(&order) >= observed);
        if above == ENOUGH_ABOVE {
            return above as f64 / tried as f64;
        }
    }
    (above + 1) as f64 / (N_PERMUTATIONS + 1) as f64
}

impl Estimate<'_> {
    /// Errors of a joint as input of a test of their order. Terms of the model that are smooth in time are added back.
    /// They become regressors if they are no larger than stated: warmth is not a walk, but absorbs one.
    pub(crate) fn time_order(&self, joint: usize, errors: &[JointError]) -> TimeOrder {
        let is_of_time = |kind: ParameterKind| {
            matches!(kind, ParameterKind::OffsetPerK | ParameterKind::OffsetPerMpa | ParameterKind::DriftPerH)
        };
        let parameters = self.joint_parameters().iter().enumerate();
        let of_time: Vec<usize> =
            parameters.filter(|(_, p)| p.joint == joint && is_of_time(p.kind)).map(|(column, _)| column).collect();
        let whitening = |error: &JointError| (error.weight / error.told).sqrt();
        let by = |column: usize, error: &JointError| self.problem.views[error.view_idx].basis[column];
        let whitened = |error: &JointError| {
            let given_back = of_time.iter().map(|&column| by(column, error) * self.solved.state.joint[column]);
            (error.error_rad + given_back.sum::<f64>()) * whitening(error)
        };
        let stated = Hyperparameters::datasheet(self.problem.robot).offset_std_rad_per_k;
        let is_as_stated = self.scales().offset_std_rad_per_k <= WARMTH_WORTH_A_FIT * stated;
        let effect =
            |&column: &usize| DVector::from_iterator(errors.len(), errors.iter().map(|e| by(column, e) * whitening(e)));
        let effects = of_time.iter().filter(|_| is_as_stated).map(effect).collect();
        let all = self.view_angles();
        let angles: Vec<JointAngles> = errors.iter().map(|error| all[error.view_idx]).collect();
        TimeOrder::new(&errors.iter().map(whitened).collect::<Vec<_>>(), &angles, joint, effects)
    }
}

fn without(columns: &DMatrix<f64>, y: &DVector<f64>) -> DVector<f64> {
    y - columns * columns.tr_mul(y)
}

/// Orthonormal columns, as many as the views allow. They are a constant, `stated`, sines and cosines of each joint's
/// angle and of twice it, then their products.
fn smooth_functions(angles: &[JointAngles], joint: usize, stated: Vec<DVector<f64>>) -> DMatrix<f64> {
    let n_joints = angles.first().map_or(0, |at| at.len());
    let order = || std::iter::once(joint).chain((0..n_joints).filter(move |&other| other != joint));
    let values = |f: &dyn Fn(&JointAngles) -> f64| DVector::from_iterator(angles.len(), angles.iter().map(f));
    let mut functions = vec![values(&|_| 1.0)];
    functions.extend(stated);
    for multiple in [1.0, 2.0] {
        for of in order() {
            functions.push(values(&|at| (multiple * at[of]).sin()));
            functions.push(values(&|at| (multiple * at[of]).cos()));
        }
    }
    for a in order() {
        for b in order().filter(|&b| b > a) {
            functions.push(values(&|at| at[a].sin() * at[b].sin()));
            functions.push(values(&|at| at[a].cos() * at[b].sin()));
            functions.push(values(&|at| at[a].sin() * at[b].cos()));
            functions.push(values(&|at| at[a].cos() * at[b].cos()));
        }
    }
    let most = (angles.len() / VIEWS_PER_FUNCTION).clamp(1, MAX_FUNCTIONS);
    let mut columns: Vec<DVector<f64>> = Vec::with_capacity(most);
    for whole in functions {
        if columns.len() == most {
            break;
        }
        let mut left = whole.clone();
        columns.iter().for_each(|column| left.axpy(-column.dot(&whole), column, 1.0));
        if left.norm_squared() > LEAST_NEW * whole.norm_squared() {
            columns.push(left.normalize());
        }
    }
    DMatrix::from_columns(&columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::tests::data::{normal, rng};
    use crate::explain::step_test::MIN_SIDE;
    use armcal_core::stats::quantile;

    const SERIES: u64 = 200;
    const N_VIEWS: usize = 90;
    const N_JOINTS: usize = 6;

    /// Views along a way through the configurations, and errors: white noise, an equal effect of the configuration, and
    /// a walk of `walk` times the noise over all views.
    fn series(seed: u64, walk: f64) -> (Vec<f64>, Vec<JointAngles>) {
        let mut rng = rng(seed, "permutation test");
        let (mut at, mut walked) = ([0.0; N_JOINTS], 0.0);
        let phase = normal(&mut rng);
        let views = (0..N_VIEWS).map(|_| {
            at.iter_mut().for_each(|angle| *angle += 0.3 * normal(&mut rng));
            walked += walk / (N_VIEWS as f64).sqrt() * normal(&mut rng);
            let of_configuration = (at[0] + phase).sin() + 0.5 * (2.0 * at[2]).sin();
            let error = normal(&mut rng) + of_configuration + walked;
            (error, JointAngles::from_fn(N_JOINTS, |joint| at[joint]))
        });
        views.unzip()
    }

    fn p_values(seed: u64, walk: f64) -> [f64; 2] {
        let (errors, angles) = series(seed, walk);
        let order = TimeOrder::new(&errors, &angles, 0, Vec::new());
        let pattern =
            |row: usize, k: usize| ((k as f64 + 0.5) * std::f64::consts::PI * row as f64 / N_VIEWS as f64).sin();
        let patterns = DMatrix::from_fn(N_VIEWS, 4, pattern);
        let weights: Vec<f64> = (0..4).map(|k| (f64::from(k) + 0.5).powi(-2)).collect();
        [order.p_of_patterns(&patterns, &weights), order.p_of_step(MIN_SIDE)]
    }

    fn largest_distance_from_uniform(mut values: Vec<f64>) -> f64 {
        values.sort_by(f64::total_cmp);
        let n = values.len() as f64;
        let off = |(k, p): (usize, &f64)| (p - k as f64 / n).abs().max((p - (k + 1) as f64 / n).abs());
        values.iter().enumerate().map(off).fold(0.0, f64::max)
    }

    /// Kolmogorov and Smirnov's limit at 1 % is 0.115 for 200 series. Without the regression on configurations, it is
    /// exceeded many times over.
    #[test]
    fn p_values_are_uniform_where_only_the_configurations_matter() {
        let all: Vec<[f64; 2]> = (0..SERIES).map(|seed| p_values(seed, 0.0)).collect();
        for (kind, name) in ["walk", "step"].into_iter().enumerate() {
            let distance = largest_distance_from_uniform(all.iter().map(|p| p[kind]).collect());
            println!("{name}: {distance:.3} from uniform");
            assert!(distance < 0.115, "{name}: {distance:.3}");
        }
    }

    #[test]
    fn walks_are_told_from_effects_of_the_configuration() {
        let p: Vec<f64> = (0..40).map(|seed| p_values(seed, 8.0)[0]).collect();
        let median = quantile(&p, 0.5).expect("series");
        println!("median p of a walk of eight times the noise: {median:.4}");
        assert!(median < 0.05, "{median:.4}");
    }
}
