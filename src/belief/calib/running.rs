//! What the views captured so far say, for whoever must go on by it: margins and poses to come.

use super::bad_data::{check_joints, check_order};
use super::bundle_round::{BundleCalibration, EstimatePurpose};
use super::{CalibError, Calibration, associate_within, declared_failed, identify_scales, map, surveyed};
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;

/// Estimates by `bundle` from the views captured since `from`, one view or more, starting from the datasheet or a `prior`.
///
/// It is not judged: no view is left out, no failed joint looked for, and its status says nothing. Its covariance is what margins
/// are made of, so it is refused where the residuals show that the model does not hold.
///
/// # Errors
/// [`CalibError`] where the views tell nothing yet, or contradict each other or the prior.
pub fn interim_estimate(
    recording: &Recording,
    robot: &Robot,
    from: Stamp,
    prior: Option<&Calibration>,
) -> Result<Calibration, CalibError> {
    let name = || recording.path.display().to_string();
    let robot = surveyed(recording, robot);
    check_joints(recording, &robot)?;
    check_order(recording)?;
    let robot = declared_failed(recording, &robot);
    let span = Some((from, Stamp { nanos: i64::MAX }));
    let mut data = associate_within(recording, &robot, span);
    let (mut robot, identified) = identify_scales(&data, &robot)?;
    if !identified.is_empty() {
        data = associate_within(recording, &robot, span);
    }
    data.fit.retain(|view| !view.tags.is_empty());
    data.held_out.retain(|view| !view.tags.is_empty());
    if data.fit.is_empty() && data.held_out.is_empty() {
        return Err(CalibError::NoCaptures { recording: name() });
    }
    let mut found_map = None;
    if robot.tags.iter().any(|tag| !tag.is_known()) {
        let mapped =
            map::map_tags(&mut data, &robot).map_err(|problem| CalibError::Map { recording: name(), problem })?;
        (robot, found_map) = (mapped.start(&robot), Some(mapped.result));
    }
    BundleCalibration {
        recording: name(),
        // Nothing is written of it.
        messages_hash: String::new(),
        robot: &robot,
        identified: &identified,
        prior,
        map: found_map,
        effort: EstimatePurpose::Running,
    }
    .calibrate(data)
}
