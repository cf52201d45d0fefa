//! Comparison of a calibration with the robot folder that it is used with.

use std::path::Path;

use armcal_core::robot::{JointSensorSpec, Robot};

use crate::file::calibration::{Calibration, JointResult};
use crate::file::constants::robot_match::SAME_DATASHEET;
use crate::file::file_error::CalibrationFileError;

/// A value of robot.toml that is not the one that the calibration was made with.
#[derive(Clone, Debug, PartialEq)]
struct Difference {
    key: &'static str,
    found: f64,
    expected: f64,
}

impl Calibration {
    /// Refuses a robot whose joints or datasheets are not those that the calibration was made with. `file` is for
    /// messages.
    ///
    /// # Errors
    /// [`CalibrationFileError::OtherRobot`] or [`CalibrationFileError::OtherDatasheet`].
    pub fn check_robot(&self, file: &Path, robot: &Robot) -> Result<(), CalibrationFileError> {
        self.check_joints(file, robot)?;
        for (joint, spec) in self.joint.iter().zip(&robot.sensors) {
            if let Some(Difference { key, found, expected }) = joint.difference_to(spec) {
                return Err(CalibrationFileError::OtherDatasheet {
                    file: file.display().to_string(),
                    robot_file: robot.folder.join("robot.toml"),
                    joint: joint.name.clone(),
                    key,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }

    /// Refuses a robot of another name, or with other joints.
    pub(crate) fn check_joints(&self, file: &Path, robot: &Robot) -> Result<(), CalibrationFileError> {
        let names: Vec<String> = self.joint.iter().map(|joint| joint.name.clone()).collect();
        let moves_as = |(joint, spec): (&JointResult, &JointSensorSpec)| joint.moves == spec.moves;
        let is_same = self.robot == robot.name
            && names == robot.joint_names()
            && self.joint.iter().zip(&robot.sensors).all(moves_as);
        let other = || CalibrationFileError::OtherRobot {
            file: file.display().to_string(),
            found: self.robot.clone(),
            found_joints: names.clone(),
            expected: robot.name.clone(),
        };
        if is_same { Ok(()) } else { Err(other()) }
    }
}

impl JointResult {
    /// Returns the datasheet's counts per radian; `None` in older files without a relative gain.
    pub(crate) fn datasheet_scale(&self) -> Option<f64> {
        self.counts_per_rad.or_else(|| Some(self.gain_over_datasheet? / self.gain_rad_per_count))
    }

    /// Returns the first datasheet value in which `spec` differs from the one that the calibration was made with.
    fn difference_to(&self, spec: &JointSensorSpec) -> Option<Difference> {
        let (scale_key, per_unit) = if spec.moves.is_slide() {
            ("scale_counts_per_mm", 1e-3)
        } else {
            ("scale_counts_per_deg", std::f64::consts::PI / 180.0)
        };
        let is_off = |by: f64| by.abs() > SAME_DATASHEET;
        let scale = self.datasheet_scale().filter(|scale| is_off(scale / spec.counts_per_rad - 1.0));
        let zero = self.offset_counts.filter(|counts| is_off((counts - spec.offset_counts) / spec.counts_per_rad));
        let middle = Some(self.center_rad).filter(|center| is_off(center - spec.center_rad));
        let of_scale = |scale| (scale_key, scale * per_unit, spec.counts_per_rad * per_unit);
        let differences = [
            scale.map(of_scale),
            zero.map(|counts| ("offset_counts", counts, spec.offset_counts)),
            middle.map(|center| ("center_rad (middle of the limits in the URDF)", center, spec.center_rad)),
        ];
        let (key, found, expected) = differences.into_iter().flatten().next()?;
        Some(Difference { key, found: shown(found), expected: shown(expected) })
    }
}

/// Rounds a value for a message, so that its last digits are no noise.
fn shown(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{sample, titan};
    use armcal_core::codes::{Code, Coded};

    fn refused(calibration: &Calibration, change: impl Fn(&mut JointSensorSpec)) -> Option<String> {
        let mut robot = titan();
        change(&mut robot.sensors[1]);
        let error = calibration.check_robot(Path::new("a/calibration.toml"), &robot).err()?;
        assert_eq!(error.code(), Code::RobotMismatch);
        Some(error.to_string())
    }

    #[test]
    fn a_robot_with_another_datasheet_is_refused_by_joint_key_and_both_values() {
        let mut calibration = sample();
        let spec = titan().sensors[1].clone();
        assert_eq!(refused(&calibration, |_| ()), None);
        // An older file does not have the datasheet's zero.
        assert_eq!(refused(&calibration, |spec| spec.offset_counts -= 5322.0), None);
        calibration.joint[1].offset_counts = Some(spec.offset_counts);
        calibration.joint[1].counts_per_rad = Some(spec.counts_per_rad);
        assert_eq!(refused(&calibration, |spec| spec.noise_std_counts *= 2.0), None);
        let zero = refused(&calibration, |spec| spec.offset_counts = 60_000.0).expect("another zero");
        for word in ["a/calibration.toml", "shoulder_pitch", "offset_counts", "60000", "robot.toml"] {
            assert!(zero.contains(word), "{zero}");
        }
        let scale = refused(&calibration, |spec| spec.counts_per_rad *= 2.0).expect("another scale");
        assert!(scale.contains("scale_counts_per_deg"), "{scale}");
        let middle = refused(&calibration, |spec| spec.center_rad += 0.1).expect("other limits");
        assert!(middle.contains("center_rad"), "{middle}");
    }

    /// A scale that was measured on the way leaves the datasheet as it was.
    #[test]
    fn a_measured_scale_is_no_other_datasheet() {
        let mut calibration = sample();
        let joint = &mut calibration.joint[1];
        let ratio = -2.3;
        joint.gain_rad_per_count /= ratio;
        joint.gain_over_datasheet = joint.gain_over_datasheet.map(|gain| gain / ratio);
        joint.identified_ratio = Some(ratio);
        assert_eq!(refused(&calibration, |_| ()), None);
        assert!(refused(&calibration, |spec| *spec = spec.with_scale(ratio)).is_some());
    }
}
