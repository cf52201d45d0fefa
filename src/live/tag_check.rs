//! Check, before anything moves, that the tags in view are where the datasheet's sensors may have them.

use nalgebra::{Point3, Vector2, Vector3};

use crate::LiveError;
use armcal_core::robot::{Robot, SurveyedTag};
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{JointAngles, JointCounts, TagDetection};

/// Factor on the standard deviations of mount and survey.
const SIGMAS: f64 = 4.0;
/// Allowance beyond all bounds, rad: lens, sag, and noise of one view.
const SLACK_RAD: f64 = 0.03;

/// Comparison of the tags in view with the datasheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagCheck {
    /// Number of known tags in view.
    pub tags: usize,
    /// Largest angle between a tag's measured direction and its direction by the datasheet's angles, rad.
    pub largest_rad: f64,
    /// Bound on this angle from sensors, mount and survey, for that tag, rad.
    pub bound_rad: f64,
}

/// Compares directions from the camera to known tags; `None` where no known tag is in view.
///
/// # Errors
/// [`LiveError::NotReady`] if a tag's direction errs by more than the bounds explain.
pub(crate) fn check_tags(
    robot: &Robot,
    counts: &JointCounts,
    detections: &[TagDetection],
) -> Result<Option<TagCheck>, LiveError> {
    if !robot.camera.lens.is_known() {
        return Ok(None);
    }
    let angles = ArmSensors::nominal(robot).angles(counts);
    let mut check: Option<TagCheck> = None;
    for detection in detections {
        let Some(tag) = robot.tag(detection.id).filter(|tag| tag.is_known()) else { continue };
        let Some(seen) = bearing(robot, detection) else { continue };
        let largest_rad = seen.angle(&towards(robot, &angles, tag));
        let bound_rad = bound_rad(robot, &angles, tag);
        if largest_rad > bound_rad {
            let (id, off_deg, bound_deg) = (tag.id, largest_rad.to_degrees(), bound_rad.to_degrees());
            return Err(LiveError::NotReady(format!(
                "tag {id} is seen {off_deg:.1} deg from where robot.toml and the readings put it, and the bounds of \
                 sensors, camera mount and survey explain {bound_deg:.1} deg; are robot, vehicle and camera the right \
                 ones, and has no sensor slipped?"
            )));
        }
        let tags = check.map_or(0, |check| check.tags) + 1;
        let last = check.filter(|check| check.bound_rad - check.largest_rad < bound_rad - largest_rad);
        check = Some(TagCheck { tags, ..last.unwrap_or(TagCheck { tags, largest_rad, bound_rad }) });
    }
    Ok(check)
}

/// Direction to the middle of a detected tag, camera frame.
fn bearing(robot: &Robot, detection: &TagDetection) -> Option<Vector3<f64>> {
    let corners = detection.corners_px.map(|pixel| robot.camera.lens.unproject(&Vector2::from(pixel)));
    let mut sum = Vector3::zeros();
    for corner in corners {
        sum += corner?.into_inner();
    }
    Some(sum)
}

/// Returns the tag's middle, camera frame, m.
fn towards(robot: &Robot, angles: &JointAngles, tag: &SurveyedTag) -> Vector3<f64> {
    let camera_from_tags = robot.tags_from_camera(angles).inverse();
    (camera_from_tags * Point3::from(tag.base_from_tag.origin().vector())).coords
}

/// Returns the bound on the error of a tag's direction, rad: all errors at their bounds turn the direction the same
/// way.
fn bound_rad(robot: &Robot, angles: &JointAngles, tag: &SurveyedTag) -> f64 {
    let nominal = towards(robot, angles, tag);
    let by_joint = robot.sensors.iter().enumerate().map(|(joint, sensor)| {
        let bound_rad = sensor.offset_bound_rad + sensor.gain_bound * (angles[joint] - sensor.center_rad).abs();
        let turned = |sign: f64| {
            let mut off = *angles;
            off[joint] += sign * bound_rad;
            towards(robot, &off, tag).angle(&nominal)
        };
        turned(1.0).max(turned(-1.0))
    });
    let camera = &robot.camera;
    let position_m = camera.mount_std_m + tag.position_std_m;
    let by_mount = SIGMAS * (camera.mount_std_rad + position_m / nominal.norm().max(0.1));
    by_joint.sum::<f64>() + by_mount + SLACK_RAD
}
