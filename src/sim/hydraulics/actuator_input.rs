//! Ranges, torque limits and rate limits of a robot's actuators.

use crate::error::SimError;
use armcal_core::kinematics::JointLimits;
use armcal_core::robot::Robot;

/// Data from which an actuator is built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ActuatorInput {
    pub limits: Option<JointLimits>,
    /// Largest torque at the supply pressure, N m; from the URDF's effort.
    pub torque_max_n_m: f64,
    /// Rate limit of the controller.
    pub rate_limit_rad_s: f64,
}

/// Returns the actuators' data: torque limits from the URDF's effort, rates from the sensors' table.
pub(crate) fn actuator_inputs(robot: &Robot) -> Result<Vec<ActuatorInput>, SimError> {
    let file = robot.folder.join("robot.toml");
    let joints = robot.chain.joints().iter().zip(&robot.sensors).zip(&robot.efforts_n_m);
    joints
        .map(|((joint, sensor), &effort_n_m)| {
            if !(effort_n_m.is_finite() && effort_n_m > 0.0) {
                return Err(SimError::NoEffort { file: file.clone(), joint: joint.name.clone(), effort_n_m });
            }
            let rate_limit_rad_s = sensor.max_rate_rad_s;
            Ok(ActuatorInput { limits: joint.limits, torque_max_n_m: effort_n_m, rate_limit_rad_s })
        })
        .collect()
}
