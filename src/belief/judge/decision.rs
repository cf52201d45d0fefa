//! The decision rule (ILAC-G8; JCGM 106, 8.3.2). A result is accepted if the probability that the tool's error exceeds
//! the tolerance is at most 5 % at every target of the task. A target that cannot be judged is not accepted.

use armcal_core::codes::Code;
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use crate::judge::constants::decision::MAX_RISK;
use crate::judge::coverage::ErrorDistribution;

/// Decision rule in the words of files and reports.
pub const RULE: &str = "P(error > tolerance) <= 5 % at every target";

/// `[u95]` of calibration.toml: predicted tool error and its comparison with the tolerance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct U95Table {
    /// Largest U95 over the targets, or without a task over the recorded configurations, m; absent if it is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_m: Option<f64>,
    /// Tolerance of the task, m; absent without a task.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance_m: Option<f64>,
    /// Largest probability over the targets that the error exceeds the tolerance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_beyond_tolerance: Option<f64>,
    /// Keys of `[geometry]` that robot.toml lacks; U95 does not include the unobservable parameters that they describe.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_included: Vec<String>,
    /// U95 at each target of the task.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub target: Vec<TargetU95>,
}

/// U95 at one target of the task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TargetU95 {
    /// Number of the target in the task, from 0.
    pub index: usize,
    /// U95 at the target, m; absent if the target cannot be judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub u95_m: Option<f64>,
    /// Probability that the error exceeds the tolerance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_beyond_tolerance: Option<f64>,
    /// True if both are known.
    pub judged: bool,
    /// Reason why the target cannot be judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<Code>,
}

/// Covariance of the tool's position at one target of the task, or at one configuration, m^2.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TargetError {
    /// Number of the target, from 0.
    pub index: usize,
    /// Part from the recording, with its fitted noise.
    pub by_data_m2: Matrix3<f64>,
    /// Part from the stated standard deviations of parameters that the recording does not determine.
    pub by_priors_m2: Matrix3<f64>,
}

impl TargetError {
    /// Returns the total covariance, m^2.
    pub(crate) fn total_m2(&self) -> Matrix3<f64> {
        self.by_data_m2 + self.by_priors_m2
    }

    /// Returns the total covariance with its effective degrees of freedom (Welch-Satterthwaite, GUM G.4). The data's
    /// share has `dof_of_noise`, stated standard deviations have infinitely many.
    pub(crate) fn distribution(&self, dof_of_noise: f64) -> Option<ErrorDistribution> {
        let total_m2 = self.total_m2();
        let share = self.by_data_m2.trace() / total_m2.trace();
        let dof = if share > 0.0 { dof_of_noise / (share * share) } else { f64::INFINITY };
        ErrorDistribution::new(&total_m2, dof)
    }
}

impl U95Table {
    /// Returns the table of a task with `n_targets`; targets without an error have the code that `why_not` returns.
    pub(crate) fn of_task(
        n_targets: usize,
        tolerance_m: f64,
        (errors, dof_of_noise): (&[TargetError], f64),
        why_not: impl Fn(usize) -> Code,
    ) -> Self {
        let judge = |index: usize| {
            let Some(error) = errors.iter().find(|error| error.index == index) else {
                return TargetU95::unjudged(index, why_not(index));
            };
            let Some(distribution) = error.distribution(dof_of_noise) else {
                return TargetU95::unjudged(index, Code::NothingObservable);
            };
            TargetU95 {
                index,
                u95_m: Some(distribution.u95_m()),
                p_beyond_tolerance: Some(distribution.beyond(tolerance_m)),
                judged: true,
                code: None,
            }
        };
        let target: Vec<TargetU95> = (0..n_targets).map(judge).collect();
        Self {
            max_m: target.iter().filter_map(|target| target.u95_m).reduce(f64::max),
            tolerance_m: Some(tolerance_m),
            p_beyond_tolerance: target.iter().filter_map(|target| target.p_beyond_tolerance).reduce(f64::max),
            target,
            not_included: Vec::new(),
        }
    }

    /// Returns the table with the keys of unobservable parameters that it does not include.
    pub(crate) fn without(self, keys: &[&str]) -> Self {
        Self { not_included: keys.iter().map(|key| (*key).to_owned()).collect(), ..self }
    }

    /// Returns the table without a task: the largest U95 of the recorded configurations.
    pub(crate) fn of_configurations(errors: &[TargetError], dof_of_noise: f64) -> Self {
        let distributions = errors.iter().map(|error| error.distribution(dof_of_noise));
        // The largest U95 is unknown if any of them is.
        let all: Option<Vec<f64>> = distributions.map(|one| one.map(|one| one.u95_m())).collect();
        Self { max_m: all.and_then(|all| all.into_iter().reduce(f64::max)), ..Self::default() }
    }

    /// Returns the numbers, from 1, of the targets that cannot be judged, except [`Self::kept_by_failed_joint`].
    #[must_use]
    pub fn unjudged(&self) -> Vec<usize> {
        self.numbers(|code| code != Code::SensorFailed)
    }

    /// Returns the numbers, from 1, of the targets that a failed joint keeps out of reach.
    #[must_use]
    pub fn kept_by_failed_joint(&self) -> Vec<usize> {
        self.numbers(|code| code == Code::SensorFailed)
    }

    fn numbers(&self, is_wanted: impl Fn(Code) -> bool) -> Vec<usize> {
        let wanted = self.target.iter().filter(|target| target.code.is_some_and(&is_wanted));
        wanted.map(|target| target.index + 1).collect()
    }

    /// Returns the target with the greatest risk, if that exceeds the rule's limit.
    #[must_use]
    pub fn beyond(&self) -> Option<&TargetU95> {
        let risk = |target: &TargetU95| target.p_beyond_tolerance.unwrap_or(0.0);
        let worst = self.target.iter().max_by(|a, b| risk(a).total_cmp(&risk(b)))?;
        (risk(worst) > MAX_RISK).then_some(worst)
    }
}

impl TargetU95 {
    fn unjudged(index: usize, code: Code) -> Self {
        Self { index, u95_m: None, p_beyond_tolerance: None, judged: false, code: Some(code) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(index: usize, data_mm: f64, priors_mm: f64) -> TargetError {
        let of = |mm: f64| Matrix3::from_diagonal_element((1e-3 * mm).powi(2));
        TargetError { index, by_data_m2: of(data_mm), by_priors_m2: of(priors_mm) }
    }

    /// U95 of an isotropic error is 2.796 of its standard deviation.
    #[test]
    fn accepted_is_what_is_within_the_tolerance_with_95_percent_at_each_target() {
        let u95_mm = 2.795_5 * f64::hypot(3.0, 4.0);
        let decide = |tolerance_mm: f64| {
            let errors = [error(0, 1.0, 1.0), error(1, 3.0, 4.0)];
            U95Table::of_task(2, 1e-3 * tolerance_mm, (&errors, f64::INFINITY), |_| Code::TargetOutOfReach)
        };
        let within = decide(u95_mm * 1.001);
        assert!(within.beyond().is_none() && within.unjudged().is_empty(), "{within:?}");
        assert!((within.max_m.expect("judged") - 1e-3 * u95_mm).abs() < 1e-6);
        let beyond = decide(u95_mm * 0.999);
        assert_eq!(beyond.beyond().map(|target| target.index), Some(1), "{beyond:?}");
        assert!((beyond.p_beyond_tolerance.expect("judged") - 0.05).abs() < 1e-3);
    }

    #[test]
    fn targets_without_an_error_are_named_and_not_within() {
        let unknown = TargetError { by_data_m2: Matrix3::from_element(f64::INFINITY), ..error(2, 1.0, 0.0) };
        let errors = [error(1, 1.0, 1.0), unknown];
        let table = U95Table::of_task(3, 0.02, (&errors, 100.0), |_| Code::TargetOutOfReach);
        assert_eq!((table.unjudged(), table.kept_by_failed_joint()), (vec![1, 3], vec![]));
        let table = U95Table::of_task(3, 0.02, (&errors, 100.0), |_| Code::SensorFailed);
        assert_eq!((table.unjudged(), table.kept_by_failed_joint()), (vec![3], vec![1]));
        let table = U95Table::of_task(3, 0.02, (&errors, 100.0), |_| Code::TargetOutOfReach);
        let codes: Vec<Option<Code>> = table.target.iter().map(|target| target.code).collect();
        assert_eq!(codes, [Some(Code::TargetOutOfReach), None, Some(Code::NothingObservable)]);
        assert_eq!(U95Table::of_configurations(&[error(0, 1.0, 1.0), unknown], 100.0).max_m, None);
    }

    /// Three degrees of freedom of the data alone widen U95; a larger share of stated deviations widens it less.
    #[test]
    fn stated_sigmas_count_as_known() {
        let u95 = |data_mm: f64, priors_mm: f64| {
            let errors = [error(0, data_mm, priors_mm)];
            let table = U95Table::of_task(1, 0.02, (&errors, 3.0), |_| Code::TargetOutOfReach);
            table.max_m.expect("judged") / f64::hypot(data_mm, priors_mm)
        };
        let (data, half, priors) = (u95(5.0, 0.0), u95(3.0, 4.0), u95(0.0, 5.0));
        assert!(data > half && half > priors, "{data} {half} {priors}");
        assert!((1e3 * priors - 2.795_5).abs() < 1e-3, "{priors}");
    }
}
