//! Estimate from the views captured so far, for use during the capture: margins and further poses.

use crate::batch::rounds::{BundleCalibration, EstimatePurpose};
use crate::file::calibration::Calibration;
use crate::views::association::{associate_within, declared_failed, surveyed};
use crate::views::calibration_data::{CalibrationData, HeldOut};
use crate::views::data_checks::{check_joints, check_order};
use crate::views::error::CalibError;
use crate::views::scale_identification::identify_scales;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;

/// Estimates by `bundle` from the views captured since `from`, one view or more, starting from the datasheet or a
/// `prior`.
///
/// The estimate is not judged: no view is held out, failed joints are not searched, and its status means nothing.
/// Margins depend on its covariance, so it is refused where the residuals show that the model does not hold.
///
/// # Errors
/// [`CalibError`] where the views determine nothing yet, or contradict each other or the prior.
pub fn interim_estimate(
    recording: &Recording,
    robot: &Robot,
    from: Stamp,
    prior: Option<&Calibration>,
) -> Result<Calibration, CalibError> {
    let name = recording.path.display().to_string();
    let robot = surveyed(recording, robot);
    check_joints(recording, &robot)?;
    check_order(recording)?;
    let robot = declared_failed(recording, &robot, None);
    let span = Some((from, Stamp { nanos: i64::MAX }));
    let mut data = associate_within(recording, &robot, span);
    let (robot, identified) = identify_scales(&data, &robot)?;
    if !identified.is_empty() {
        data = associate_within(recording, &robot, span);
    }
    data.fit.retain(|view| !view.tags.is_empty());
    data.held_out.retain(|view| !view.tags.is_empty());
    if data.fit.is_empty() && data.held_out.is_empty() {
        return Err(CalibError::NoCaptures { recording: name });
    }
    let data = CalibrationData {
        name,
        // The interim estimate is not written to a file.
        messages_hash: String::new(),
        data,
        gripper_tag_data: None,
        held_out: HeldOut::AsMarked,
        robot,
        identified,
    };
    BundleCalibration::new(data, prior, EstimatePurpose::Interim)?.calibrate()
}
