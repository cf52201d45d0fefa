//! A calibration for tests, with nothing estimated yet.

use crate::file::calibration::{Calibration, Status};
use crate::file::covariance_file::CovarianceTable;
use crate::file::metrics::{FitMetrics, HeldOutMetrics};
use crate::file::valid_range::ValidRange;
use crate::solve::details::FitDetails;
use armcal_core::document::VERSION;
use armcal_core::kind::Kind;
use armcal_core::numeric::Outcome;
use armcal_core::routine::Method;

/// Returns an accepted calibration without joints or covariance.
pub(crate) fn bare(robot: &str, method: Method) -> Calibration {
    Calibration {
        version: VERSION,
        kind: Kind::Calibration,
        robot: robot.to_owned(),
        method,
        status: Status::Accepted,
        refusal: None,
        refusals: Vec::new(),
        reservations: Vec::new(),
        findings: Vec::new(),
        messages_hash: String::new(),
        unobservable: Vec::new(),
        observability: None,
        verdict: None,
        fit: fit(),
        held_out: HeldOutMetrics {
            views: 0,
            cross_validated: true,
            rms_m: None,
            mean_m: None,
            camera_mean_m: None,
            rms_px: None,
            nominal_rms_m: None,
            baseline: None,
            within_95: None,
        },
        predicted_tool_error_m: None,
        predicted_tool_error_with_priors_m: None,
        u95: Default::default(),
        valid: ValidRange { time_nanos: 0, oil_c: None, water_c: None, pressure_pa: None },
        reference: None,
        camera_mount: None,
        further_camera: Vec::new(),
        lens: Vec::new(),
        map: None,
        model: None,
        outliers: Vec::new(),
        joint: Vec::new(),
        link: Vec::new(),
        sag: None,
        failed_joint: Vec::new(),
        prior: None,
        covariance_hash: None,
        covariance: CovarianceTable::default(),
        details: FitDetails::default(),
    }
}

fn fit() -> FitMetrics {
    FitMetrics {
        outcome: Outcome::Converged,
        evaluations: 1,
        cost_initial: 1.0,
        cost_final: 1.0,
        views: 14,
        tags_seen: 0,
        rejected: 0,
        rejected_corners: None,
        rejected_by_reason: Default::default(),
        rms_m: 0.0,
        rms_px: Some(0.0),
        linearity_scale: 1.0,
    }
}
