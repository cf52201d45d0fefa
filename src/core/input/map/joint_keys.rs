//! Keys of the input map for the joints' readings.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use super::units::{JointUnit, SlideUnit};
use crate::codes::Code;
use crate::input::lerobot::LerobotToml;
use crate::robot::{FileIssue, JointSensorSpec, Robot, StatedAngle};

/// Allowed absolute values of a factor: beyond the ratio of any two units. Assumed.
const FACTORS: RangeInclusive<f64> = 1e-6..=1e6;
/// Allowed zeros, like those of offset_counts in robot.toml.
const ZEROS: RangeInclusive<f64> = -1e9..=1e9;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct JointsToml {
    /// Topic of sensor_msgs/msg/JointState.
    pub topic: Option<String>,
    /// Recorded name or column of each joint of the robot, if they differ.
    #[serde(default)]
    pub names: BTreeMap<String, String>,
    /// Unit of the recorded numbers.
    #[serde(default)]
    pub unit: JointUnit,
    /// Unit of slides, if `unit` is "rad" or "deg".
    pub slide_unit: Option<SlideUnit>,
    /// Angle over reading of each joint of the robot, if `unit` is "rad" or "deg".
    #[serde(default)]
    #[schemars(extend("additionalProperties" = { "type": "number", "minimum": -1e6, "maximum": 1e6 }))]
    pub factor: BTreeMap<String, f64>,
    /// Reading at angle zero of each joint of the robot, if `unit` is "rad" or "deg".
    #[serde(default)]
    #[schemars(extend("additionalProperties" = { "type": "number", "minimum": -1e9, "maximum": 1e9 }))]
    pub zero: BTreeMap<String, f64>,
    /// Calibration of LeRobot by which the recorded numbers become ticks.
    pub lerobot: Option<LerobotToml>,
}

/// Lines from recorded numbers that are not counts to angles: `angle = factor (recorded - zero)`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointAngleLines {
    /// Unit of slides.
    pub slide_unit: SlideUnit,
    /// Factor of each joint, if it is not 1.
    pub factor: BTreeMap<String, f64>,
    /// Zero of each joint, if it is not 0.
    pub zero: BTreeMap<String, f64>,
}

impl JointAngleLines {
    pub(super) fn checked(file: &Path, joints: &JointsToml) -> Result<Self, FileIssue> {
        let for_counts = "set scale_counts_per_deg and offset_counts in [[joint_sensor]] of robot.toml instead";
        let given = [
            ("slide_unit", joints.slide_unit.is_some(), "set unit = \"rad\" or \"deg\", too"),
            ("factor", !joints.factor.is_empty(), for_counts),
            ("zero", !joints.zero.is_empty(), for_counts),
        ];
        let given = given.into_iter().find(|(_, is_given, _)| *is_given && joints.unit == JointUnit::Counts);
        if let Some((key, _, remedy)) = given {
            let problem = format!("is for numbers that are no raw readings: {remedy}");
            return Err(FileIssue::new(Code::KeysConflict, file, format!("joint_sensors.{key}"), problem));
        }
        for (joint, factor) in &joints.factor {
            let key = format!("joint_sensors.factor.{joint} (size)");
            FileIssue::check_range(file, &key, factor.abs(), FACTORS)?;
        }
        for (joint, zero) in &joints.zero {
            FileIssue::check_range(file, &format!("joint_sensors.zero.{joint}"), *zero, ZEROS)?;
        }
        let slide_unit = joints.slide_unit.unwrap_or_default();
        Ok(Self { slide_unit, factor: joints.factor.clone(), zero: joints.zero.clone() })
    }

    /// Checks that the named joints exist on this robot.
    pub(super) fn check_robot(&self, file: &Path, robot: &Robot) -> Result<(), FileIssue> {
        for (key, of) in [("factor", &self.factor), ("zero", &self.zero)] {
            of.keys().try_for_each(|name| check_name(file, key, name, robot))?;
        }
        Ok(())
    }

    /// Lines for readings in `unit`; `None` for counts.
    pub(in crate::input) fn of(&self, unit: JointUnit, spec: &JointSensorSpec) -> Option<StatedAngle> {
        let unit_rad = match unit {
            JointUnit::Counts => return None,
            JointUnit::Rad | JointUnit::Deg if spec.moves.is_slide() => self.slide_unit.in_m(),
            JointUnit::Rad => 1.0,
            JointUnit::Deg => 1f64.to_radians(),
        };
        let factor = self.factor.get(&spec.joint).copied().unwrap_or(1.0);
        Some(StatedAngle { unit_rad, factor, zero: self.zero.get(&spec.joint).copied().unwrap_or(0.0) })
    }
}

/// Checks that `name`, a key of the table `joint_sensors.key`, is a joint of the robot.
pub(super) fn check_name(file: &Path, key: &str, name: &String, robot: &Robot) -> Result<(), FileIssue> {
    let joints = robot.joint_names();
    if joints.contains(name) {
        return Ok(());
    }
    let problem = format!("`{name}` is no joint of the robot; it has {joints:?}");
    Err(FileIssue::new(Code::NameUnknown, file, format!("joint_sensors.{key}"), problem))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::Coded;
    use crate::input::{InputMap, parse_input_map};
    use crate::robot::load;

    fn titan() -> Robot {
        load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/titan4")).expect("the robot reads")
    }

    fn parsed(keys: &str) -> Result<InputMap, Code> {
        let text = format!(
            "version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/j\"\n{keys}\n[tags]\ntopic = \"/t\"\n\
             use = \"corners\"\n"
        );
        parse_input_map(Path::new("map.toml"), &text).map_err(|error| error.code())
    }

    #[test]
    fn factors_and_zeros_out_of_range_or_of_counts_are_refused() {
        for keys in ["factor.elbow = 0.0", "factor.elbow = nan", "factor.elbow = -2e6", "zero.elbow = inf"] {
            assert_eq!(parsed(&format!("unit = \"rad\"\n{keys}")), Err(Code::ValueOutOfRange), "{keys}");
        }
        for keys in ["factor.elbow = -1.0", "zero.elbow = 90.0", "unit = \"counts\"\nzero.elbow = 1.0"] {
            assert_eq!(parsed(keys), Err(Code::KeysConflict), "{keys}");
        }
        let robot = titan();
        for keys in ["factor.elbow = 2.0", "zero.elbow = 1.0"] {
            let map = parsed(&format!("unit = \"deg\"\n{keys}")).expect("a map");
            let problem = map.check_robot(Path::new("map.toml"), &robot).expect_err("no such joint");
            assert_eq!(problem.code(), Code::NameUnknown, "{keys}");
        }
        let map = parsed("unit = \"deg\"\nfactor.wrist_yaw = 2.0\nzero.wrist_pitch = 1.0").expect("a map");
        assert!(map.check_robot(Path::new("map.toml"), &robot).is_ok());
    }

    /// Holds for each scale and sign of robot.toml's line.
    #[test]
    fn the_angle_is_the_factor_times_the_reading_less_the_zero() {
        let robot = titan();
        for (unit, unit_rad) in [("rad", 1.0), ("deg", 1f64.to_radians())] {
            let keys = format!("unit = \"{unit}\"\nfactor.wrist_yaw = -0.5\nzero.wrist_yaw = 3.0");
            let map = parsed(&keys).expect("a map");
            for spec in &robot.sensors {
                let [factor, zero] = if spec.joint == "wrist_yaw" { [-0.5, 3.0] } else { [1.0, 0.0] };
                let angle_rad = (map.counts(spec, 4.0) - spec.offset_counts) / spec.counts_per_rad;
                let expected_rad = unit_rad * factor * (4.0 - zero);
                assert!((angle_rad - expected_rad).abs() < 1e-9, "{}: {angle_rad}, {expected_rad}", spec.joint);
            }
        }
    }
}
