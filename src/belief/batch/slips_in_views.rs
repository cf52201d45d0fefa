//! Check of a calibration by positions for slips that `bundle` finds in the same views.
//!
//! Methods on positions assume the same sensor offset in all views and judge themselves by their own residuals. A slip
//! widens these only a little, and no other figure shows it. `bundle` tests for one by likelihood and by the views'
//! order, against the stated sigmas of noise and sensors.

use crate::batch::rounds::{BundleCalibration, EstimatePurpose};
use crate::file::calibration::{Calibration, Status};
use crate::file::failed_joint::FailedJointTable;
use crate::say::refusal::Refusal;
use crate::views::calibration_data::CalibrationData;

/// Refuses an accepted `calibration` by positions if a sensor slipped among the views of `data`. Only views with
/// corners are tested: the noise of positions has no datasheet.
pub(crate) fn refuse_slips(calibration: &mut Calibration, data: CalibrationData) {
    let mut tags = data.data.fit.iter().flat_map(|view| &view.tags);
    if calibration.status == Status::Accepted && tags.all(|tag| tag.is_in_pixels()) {
        calibration.refuse_for(slips(data));
    }
}

fn slips(data: CalibrationData) -> Vec<Refusal> {
    let by_bundle = BundleCalibration::new(data, None, EstimatePurpose::Final).and_then(BundleCalibration::calibrate);
    let failed = by_bundle.map(|by_bundle| by_bundle.failed_joint).unwrap_or_default();
    let slipped = failed.into_iter().filter(|failed| failed.since_pose.is_some());
    let refusal = |FailedJointTable { joint, evidence, .. }| Refusal::SlipNotEstimated { joint, evidence };
    slipped.map(refusal).collect()
}
