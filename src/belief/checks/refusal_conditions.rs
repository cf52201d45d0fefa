//! Accept or refuse: the held-out views decide, never the fit's own residuals.

use crate::checks::constants::refusal_conditions::{HARMLESS_HELD_OUT_M, MAX_HELD_OUT_OVER_FIT, MAX_SHARE_OF_REACH};
pub use crate::checks::constants::refusal_conditions::{MIN_HELD_OUT_VIEWS, MIN_VIEWS_PER_PARAMETER};
use crate::judge::baseline_comparison::BaselineComparison;
use crate::judge::constants::FALSE_ALARM;
use crate::say::refusal::{HeldOutLimitSource, Refusal};
use armcal_core::numeric::Outcome;
use armcal_core::robot::Robot;
use armcal_core::stats::chi_square_quantile;

/// Data for the decision to accept or refuse a calibration.
#[derive(Clone, Copy, Debug)]
pub struct AcceptanceData {
    pub outcome: Outcome,
    /// Number of steps or evaluations of the solver.
    pub evaluations: usize,
    pub held_out_views: usize,
    pub held_out_rms_m: Option<f64>,
    /// Root mean square error of the held-out views with datasheet sensors, m; for `baseline`, mount and map are
    /// fitted, too. `None` if the method judges them by its own covariance, or nothing could be fitted.
    pub held_out_nominal_rms_m: Option<f64>,
    pub baseline: Option<BaselineComparison>,
    pub fit_rms_m: f64,
    /// Number of wanted parameters of the sensors that move the camera, determined by these views or not.
    pub n_parameters: usize,
    pub fit_views: usize,
    /// Largest held-out distance of positions and poses; `None` where all tags have corners.
    pub held_out_limit: Option<HeldOutLimit>,
}

/// Largest held-out error of positions and poses, root mean square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOutLimit {
    pub limit_m: f64,
    pub source: HeldOutLimitSource,
}

impl HeldOutLimit {
    /// Limit without a stated noise: the task's tolerance, else a share of the arm's reach.
    #[must_use]
    pub fn without_noise(robot: &Robot, tolerance_m: Option<f64>) -> Self {
        let by_reach = Self { limit_m: MAX_SHARE_OF_REACH * robot.reach_m(), source: HeldOutLimitSource::Reach };
        tolerance_m.map_or(by_reach, |limit_m| Self { limit_m, source: HeldOutLimitSource::Tolerance })
    }

    /// Limit that `n_views` exceed with the probability of a false alarm. `expected_m`: root mean square error of a tag
    /// by its noise and the estimate's uncertainty, m. The tags of a view share most of it.
    #[must_use]
    pub fn by_noise(expected_m: f64, n_views: usize) -> Self {
        let dof = 3 * n_views.max(1);
        let ratio = (chi_square_quantile(1.0 - FALSE_ALARM, dof) / dof as f64).sqrt();
        Self { limit_m: expected_m * ratio, source: HeldOutLimitSource::StatedNoise }
    }
}

/// Least number of fitted views to accept a calibration of all joints proximal to the camera from the datasheet.
#[must_use]
pub fn fewest_views(robot: &Robot) -> usize {
    (MIN_VIEWS_PER_PARAMETER * 2.0 * robot.n_seen_joints() as f64).ceil() as usize
}

/// Returns the first reason to refuse; `None` to accept.
#[must_use]
pub fn refusal(e: &AcceptanceData) -> Option<Refusal> {
    if (e.fit_views as f64) < MIN_VIEWS_PER_PARAMETER * e.n_parameters as f64 {
        return Some(Refusal::TooFewViews { views: e.fit_views, parameters: e.n_parameters });
    }
    if e.outcome != Outcome::Converged {
        return Some(Refusal::NotSolved { outcome: e.outcome, evaluations: e.evaluations });
    }
    if e.held_out_views < MIN_HELD_OUT_VIEWS {
        return Some(Refusal::TooFewHeldOutViews { views: e.held_out_views, needed: MIN_HELD_OUT_VIEWS });
    }
    let Some(held_out_m) = e.held_out_rms_m else { return Some(Refusal::NoHeldOutTag) };
    if let Some(datasheet_m) = e.held_out_nominal_rms_m.filter(|datasheet_m| held_out_m >= *datasheet_m) {
        return Some(Refusal::NoBetterThanDatasheet { held_out_m, datasheet_m });
    }
    if let Some(BaselineComparison { rms_m, p_value, .. }) = e.baseline.filter(|baseline| !baseline.is_beaten()) {
        return Some(Refusal::NoBetterThanBaseline { held_out_m, baseline_m: rms_m, p_value });
    }
    if held_out_m > HARMLESS_HELD_OUT_M.max(MAX_HELD_OUT_OVER_FIT * e.fit_rms_m) {
        return Some(Refusal::Overfitted { held_out_m, fit_m: e.fit_rms_m });
    }
    let HeldOutLimit { limit_m, source } = e.held_out_limit?;
    (held_out_m > limit_m).then_some(Refusal::HeldOutError { held_out_m, limit_m, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> AcceptanceData {
        AcceptanceData {
            outcome: Outcome::Converged,
            evaluations: 120,
            held_out_views: 8,
            held_out_rms_m: Some(0.004),
            held_out_nominal_rms_m: Some(0.08),
            baseline: Some(BaselineComparison { rms_m: 0.05, ratio: 0.08, p_value: 1e-4 }),
            fit_rms_m: 0.004,
            n_parameters: 10,
            fit_views: 30,
            held_out_limit: Some(HeldOutLimit { limit_m: 0.012, source: HeldOutLimitSource::Tolerance }),
        }
    }

    #[test]
    fn each_single_fault_refuses_and_none_accepts() {
        assert_eq!(refusal(&good()), None);
        let exact = AcceptanceData { held_out_rms_m: Some(0.0005), fit_rms_m: 0.0001, ..good() };
        assert_eq!(refusal(&exact), None, "half a millimetre is no overfitting");
        let faults = [
            AcceptanceData { outcome: Outcome::Stalled, ..good() },
            AcceptanceData { fit_views: 8, ..good() },
            AcceptanceData { held_out_views: 2, ..good() },
            AcceptanceData { held_out_rms_m: None, ..good() },
            AcceptanceData { held_out_rms_m: Some(0.09), ..good() },
            AcceptanceData {
                baseline: Some(BaselineComparison { rms_m: 0.0041, ratio: 0.97, p_value: 0.2 }),
                ..good()
            },
            AcceptanceData { held_out_rms_m: Some(0.011), ..good() },
            AcceptanceData { held_out_rms_m: Some(0.013), fit_rms_m: 0.013, ..good() },
        ];
        for fault in faults {
            assert!(refusal(&fault).is_some(), "{fault:?} must be refused");
        }
    }
}
