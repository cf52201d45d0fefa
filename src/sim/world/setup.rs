//! What a world is put together from, and held against before it starts.

use std::path::Path;

use super::WorldInput;
use crate::as_built::AsBuilt;
use crate::error::SimError;
use crate::hydraulics::{ActuatorInput, Hydraulics};
use crate::sensors::OilState;
use crate::sensors::joint::{JointInput, JointSensor};
use crate::sensors::temperatures::Temperatures;
use crate::sensors::thermometer::gauge_pressure_pa;
use crate::spec::WorldSpec;
use crate::truth::TruthHeader;
use armcal_core::robot::{FileIssue, Robot};
use armcal_core::streams::{JointAngles, JointCounts};

/// An arm that starts nearer to an end stop than this starts at this distance, rad.
const END_STOP_MARGIN_RAD: f64 = 1e-3;

/// The true angles at which every sensor reads `stowed` by the datasheet, kept within the end stops.
pub(super) fn stowed_angles(robot: &Robot, pots: &mut [JointSensor], around: &OilState) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |j| {
        let wanted = pots[j].angle_for_reading(robot.stowed[j], around);
        let angle = robot.chain.joints()[j].limits.map_or(wanted, |limits| {
            wanted.clamp(limits.lower_rad + END_STOP_MARGIN_RAD, limits.upper_rad - END_STOP_MARGIN_RAD)
        });
        pots[j].settle(angle);
        angle
    })
}

pub(super) fn sample_joint_sensors(
    pots: &mut [JointSensor],
    angles: &JointAngles,
    around: &OilState,
    elapsed_s: f64,
) -> JointCounts {
    let around = *around;
    JointCounts::from_fn(pots.len(), |j| pots[j].sample(&JointInput { angle_rad: angles[j], around, elapsed_s }))
}

/// At a depth below the surface.
pub(super) fn surroundings(spec: &WorldSpec, temperatures: &Temperatures, t_s: f64, depth_m: f64) -> OilState {
    OilState { oil_c: temperatures.oil_c(t_s), pressure_pa: gauge_pressure_pa(&spec.water, depth_m) }
}

/// Whether the step is short enough for the oil's stiffness.
///
/// # Errors
/// [`SimError::Spec`] with the longest step; what [`actuators`] says.
pub(crate) fn check_step(spec: &WorldSpec, robot: &Robot, file: &Path) -> Result<(), SimError> {
    let longest_s = Hydraulics::new(&spec.hydraulics, &actuators(robot)?, spec.physics.step_s).longest_step_s();
    if spec.physics.step_s <= longest_s {
        return Ok(());
    }
    let problem = format!(
        "{} s is too large for the oil's stiffness (bulk_modulus_pa, dead_volume_ratio): at most {longest_s:.2e} s",
        spec.physics.step_s
    );
    Err(FileIssue::new(file, "world.physics.step_s", problem).into())
}

/// Torque limits from the URDF's effort, rates from the sensors' table.
pub(super) fn actuators(robot: &Robot) -> Result<Vec<ActuatorInput>, SimError> {
    let file = robot.folder.join("robot.toml");
    let urdf = urdf_rs::read_from_string(&robot.urdf_text).ok();
    let effort =
        |name: &str| urdf.iter().flat_map(|u| &u.joints).find(|j| j.name == name).map_or(0.0, |j| j.limit.effort);
    let joints = robot.chain.joints().iter().zip(&robot.sensors);
    joints
        .map(|(joint, sensor)| {
            let effort_n_m = effort(&joint.name);
            if !(effort_n_m.is_finite() && effort_n_m > 0.0) {
                return Err(SimError::NoEffort { file: file.clone(), joint: joint.name.clone(), effort_n_m });
            }
            let rate_limit_rad_s = sensor.max_rate_rad_s;
            Ok(ActuatorInput { limits: joint.limits, torque_max_n_m: effort_n_m, rate_limit_rad_s })
        })
        .collect()
}

pub(super) fn header(input: &WorldInput, as_built: AsBuilt) -> Result<TruthHeader, SimError> {
    Ok(TruthHeader {
        robot: input.robot.name.clone(),
        vehicle: input.vehicle.name.clone(),
        joint_names: input.robot.joint_names(),
        seed: input.seed,
        spec_toml: input.spec.to_toml()?,
        as_built,
    })
}
