//! LeRobot's calibration JSON with calibrated homing offsets.

use std::path::Path;

use serde::Serialize;
use serde_json::ser::{PrettyFormatter, Serializer};

use crate::export::ros2_control::{gain_in_words, joints_with_terms};
use crate::export::urdf::left_out;
use armcal_belief::calib::Calibration;
use armcal_core::codes::Code;
use armcal_core::input::InputMap;
use armcal_core::robot::{FileIssue, Robot};
use armcal_core::sensor::{ArmSensors, SensorModel};

/// Smallest difference of two zeros, deg: two ticks of 4096 a turn.
const APART_DEG: f64 = 0.18;

/// A calibration JSON of LeRobot, and the parts of the calibration that it cannot hold.
#[derive(Clone, Debug, PartialEq)]
pub struct LerobotHomings {
    /// Text of the file.
    pub text: String,
    /// Parts of the calibration that the file does not hold, in words.
    pub left_out: Vec<String>,
}

/// Returns the JSON that `map`, read from `file`, names, with calibrated homing offsets. With them the middle of each
/// motor's range reads as its angle in robot.toml. The offsets are whole ticks; LeRobot's scale is fixed, so gains are
/// omitted.
///
/// # Errors
/// [`FileIssue`]: a map that names no such JSON, a joint without a motor, or an offset that a motor cannot hold.
pub fn lerobot_homings(
    (file, map): (&Path, &InputMap),
    calibration: &Calibration,
    (robot, sensors): (&Robot, &ArmSensors),
) -> Result<LerobotHomings, FileIssue> {
    let Some(given) = &map.lerobot else {
        let problem = "is missing; name the JSON that the recording was made with: file, motors, values";
        return Err(FileIssue::new(Code::KeyMissing, file, "joint_sensors.lerobot", problem));
    };
    map.check_robot(file, robot)?;
    let mut homed = given.clone();
    let mut not_held = Vec::new();
    for (joint, model) in sensors.models.iter().enumerate() {
        let recorded = map.recorded_name(&model.spec.joint);
        let middle = given.middle_tick(recorded)?;
        let middle_rad = SensorModel::nominal(&robot.sensors[joint]).angle_rad(middle);
        let ahead = model.counts(middle_rad) - middle;
        let turn = model.spec.wrap_counts;
        homed.rehome(recorded, middle + ahead - turn * (ahead / turn).round(), middle)?;
        not_held.extend(gain_in_words(robot, joint, model));
        not_held.extend(zero_in_words(&model.spec.joint, middle_rad.to_degrees()));
    }
    let terms = joints_with_terms(sensors).map(|joint| format!("the terms of {joint}"));
    let links = calibration.link.iter().map(|link| format!("the link correction of {}", link.joint));
    let mount = calibration.camera_mount.iter().map(|_| "the camera's mount".to_owned());
    not_held.extend(terms.chain(links).chain(mount).chain(left_out(calibration)));
    let mut text = Vec::new();
    // LeRobot indents its JSON by four spaces.
    let written = homed.serialize(&mut Serializer::with_formatter(&mut text, PrettyFormatter::with_indent(b"    ")));
    let text = written.ok().and_then(|()| String::from_utf8(text).ok()).unwrap_or_default();
    Ok(LerobotHomings { text, left_out: not_held })
}

/// Names a joint whose zero by robot.toml, `middle_deg` from the middle of its range, is not LeRobot's.
fn zero_in_words(joint: &str, middle_deg: f64) -> Option<String> {
    let is_apart = middle_deg.abs() > APART_DEG;
    is_apart.then(|| format!("the zero of {joint}: LeRobot's 0 deg will be {middle_deg:.2} deg of {joint}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_that_is_not_the_middle_of_the_range_is_named() {
        assert!([0.0, 0.04, -0.04].into_iter().all(|deg| zero_in_words("elbow_flex", deg).is_none()));
        assert!([-5.98, 90.0].into_iter().all(|deg| zero_in_words("elbow_flex", deg).is_some()));
    }
}
