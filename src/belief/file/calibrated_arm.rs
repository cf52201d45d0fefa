//! Calibration applied to its arm: joint angles, tool pose and tool covariance from raw readings.

use nalgebra::{Isometry3, Matrix3};

use crate::file::calibration::Calibration;
use crate::file::file_error::CalibrationFileError;
use crate::solve::covariance::ParameterCovariance;
use armcal_core::joints::{JointAngles, JointCounts};
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Conditions};

/// Arm with its sensors, links and camera as calibrated.
#[derive(Clone, Debug)]
pub struct CalibratedArm {
    sensors: ArmSensors,
    /// Robot with links and camera as calibrated.
    robot: Robot,
    /// Robot with the sensor scales that the covariance is relative to.
    scaled: Robot,
    covariance: ParameterCovariance,
}

impl Calibration {
    /// Returns `robot` under this calibration.
    ///
    /// # Errors
    /// [`CalibrationFileError::OtherRobot`] when it was made for another arm.
    pub fn arm(&self, robot: &Robot) -> Result<CalibratedArm, CalibrationFileError> {
        Ok(CalibratedArm {
            sensors: self.sensors(robot)?,
            robot: self.applied_to(robot),
            scaled: self.scaled_robot(robot),
            covariance: self.parameter_covariance(robot),
        })
    }
}

impl CalibratedArm {
    /// Returns the sensors.
    #[must_use]
    pub fn sensors(&self) -> &ArmSensors {
        &self.sensors
    }

    /// Returns the joint angles of a raw reading that was taken under `conditions`, rad (m for slides).
    #[must_use]
    pub fn angles(&self, counts: &JointCounts, conditions: &Conditions) -> JointAngles {
        self.sensors.angles_under(counts, conditions)
    }

    /// Returns the pose of the tool in the frame of the base, m.
    #[must_use]
    pub fn tool_pose(&self, counts: &JointCounts, conditions: &Conditions) -> Isometry3<f64> {
        self.robot.chain.frame(&self.angles(counts, conditions), &self.robot.tool.mount)
    }

    /// Returns the covariance of the tool's position in the base frame, m^2. It includes the estimated parameters and
    /// the remaining error of each sensor. The calibration's U95 also includes links and tool point by their stated
    /// standard deviations.
    #[must_use]
    pub fn tool_covariance_m2(&self, counts: &JointCounts, conditions: &Conditions) -> Matrix3<f64> {
        let angles = self.angles(counts, conditions);
        self.covariance.tool_position_under_m2(&self.scaled, &self.sensors, &angles, conditions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::covariance_file::CovarianceTable;
    use crate::fixture::titan;
    use crate::methods::CalibrationMethod;
    use armcal_core::log::read_recording;

    /// With only offsets estimated, the tool's covariance equals that from finite differences of the tool pose, plus
    /// the datasheet's error of other parameters.
    #[test]
    fn a_reading_has_the_angles_the_tool_and_the_covariance_of_the_calibration() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let robot = titan();
        let recording = read_recording(root.join("recordings/sample/run.mcap")).unwrap();
        let mut calibration =
            crate::batch::marked_calibrations::calibrate(&recording, &robot, CalibrationMethod::Bundle).unwrap();
        let is_offset = |name: &String| name.ends_with(" offset");
        let kept: Vec<usize> = (0..calibration.covariance.parameters.len())
            .filter(|row| is_offset(&calibration.covariance.parameters[*row]))
            .collect();
        let CovarianceTable { parameters, rows } = &calibration.covariance;
        calibration.covariance = CovarianceTable {
            parameters: kept.iter().map(|row| parameters[*row].clone()).collect(),
            rows: kept.iter().map(|row| kept.iter().map(|column| rows[*row][*column]).collect()).collect(),
        };
        let arm = calibration.arm(&robot).unwrap();
        let conditions = arm.sensors().reference;
        let counts = ArmSensors::nominal(&robot).counts(&robot.stowed);
        let tool = |calibration: &Calibration| {
            calibration.arm(&robot).unwrap().tool_pose(&counts, &conditions).translation.vector
        };
        let step = 1e-6;
        let offset = |joint: usize| {
            let mut moved = calibration.clone();
            moved.joint[joint].offset_rad += step;
            (tool(&moved) - tool(&calibration)) / step
        };
        let mut by_offsets_m2 = Matrix3::zeros();
        let names = &calibration.covariance.parameters;
        let row =
            |joint: usize| names.iter().position(|name| *name == format!("{} offset", robot.sensors[joint].joint));
        for (a, b) in (0..5).flat_map(|a| (0..5).map(move |b| (a, b))) {
            if let Some((a_row, b_row)) = row(a).zip(row(b)) {
                by_offsets_m2 += calibration.covariance.rows[a_row][b_row] * offset(a) * offset(b).transpose();
            }
        }
        let all_m2 = arm.tool_covariance_m2(&counts, &conditions);
        assert!(all_m2.symmetric_eigenvalues().min() > 0.0);
        let on_top_m2 = all_m2 - by_offsets_m2;
        assert!(on_top_m2.symmetric_eigenvalues().min() > -1e-3 * by_offsets_m2.trace(), "{all_m2} {by_offsets_m2}");
        let there = arm.angles(&counts, &conditions);
        assert!(there.max_abs_difference(&robot.stowed) < 0.3);
    }
}
