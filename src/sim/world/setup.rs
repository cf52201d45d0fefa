//! What a world is put together from, and held against before it starts.

use crate::as_built::AsBuilt;
use crate::error::SimError;
use crate::sensors::OilState;
use crate::sensors::joint::{JointInput, JointSensor};
use crate::sensors::thermometer::gauge_pressure_pa;
use crate::spec::WorldSpec;
use crate::temperatures::Temperatures;
use crate::truth::TruthHeader;
use crate::world::WorldInput;
use armcal_core::robot::Robot;
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
