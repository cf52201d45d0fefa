//! Uncertainty of the tool position, as the arm itself can know it: for viewers.

use nalgebra::{DMatrix, Matrix3};

use crate::file::calibration::Calibration;
use crate::solve::covariance::ParameterCovariance;
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, Conditions};
use armcal_core::streams::JointAngles;

/// Source of the uncertainty of an epoch's sensors.
#[derive(Clone, Debug)]
pub enum Certainty {
    /// The sensors' datasheet.
    Datasheet,
    /// The epoch's calibration.
    Calibration,
    /// An estimate from the views captured so far.
    Interim(Box<Calibration>),
    /// The online estimate, at the epoch's start.
    Online(ParameterCovariance),
    /// No source: a joint is held.
    Unknown,
}

/// Believed sensors, with their uncertainty.
#[derive(Clone, Debug)]
pub struct ToolBelief {
    robot: Robot,
    sensors: ArmSensors,
    covariance: ParameterCovariance,
    /// The only conditions for which the covariance holds; `None` for any.
    at: Option<Conditions>,
}

impl ToolBelief {
    /// Returns the belief of sensors known only by their datasheet.
    #[must_use]
    pub fn by_datasheet(robot: &Robot, sensors: &ArmSensors) -> Self {
        let covariance =
            ParameterCovariance { parameters: Vec::new(), matrix: DMatrix::zeros(0, 0), residual_std_rad: None };
        Self { robot: robot.clone(), sensors: sensors.clone(), covariance, at: None }
    }

    /// Returns the belief of a calibration with its covariance; `None` without one, or for another robot.
    #[must_use]
    pub fn by_calibration(robot: &Robot, calibration: &Calibration) -> Option<Self> {
        let robot = calibration.scaled_robot(robot);
        let sensors = calibration.sensors(&robot).ok()?;
        let covariance = calibration.parameter_covariance(&robot);
        let is_known = !covariance.parameters.is_empty();
        is_known.then_some(Self { robot, sensors, covariance, at: None })
    }

    /// Returns the belief of the online estimate; `covariance` includes time and temperature since the sensors'
    /// reference.
    #[must_use]
    pub fn online(robot: Robot, sensors: &ArmSensors, covariance: &ParameterCovariance) -> Self {
        let at = Some(sensors.reference);
        Self { robot, sensors: sensors.clone(), covariance: covariance.clone(), at }
    }

    /// Returns the covariance of the tool's position (base frame, m^2) at believed `angles` under `conditions`; `None`
    /// if it is unbounded.
    #[must_use]
    pub fn position_m2(&self, angles: &JointAngles, conditions: &Conditions) -> Option<Matrix3<f64>> {
        let conditions = self.at.as_ref().unwrap_or(conditions);
        let found = self.covariance.tool_position_under_m2(&self.robot, &self.sensors, angles, conditions);
        found.iter().all(|v| v.is_finite()).then_some(found)
    }
}
