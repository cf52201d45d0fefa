//! Input of a world, and the initial values of its parts.

use crate::as_built::AsBuilt;
use crate::dynamics::{Body, WaterProperties};
use crate::error::SimError;
use crate::physics::{ArmPhysics, PhysicsInput};
use crate::sensors::OilState;
use crate::sensors::joint::{JointInput, JointSensor};
use crate::sensors::thermometer::gauge_pressure_pa;
use crate::solids::Solids;
use crate::spec::{JointSensorsSpec, MotionKind, WorldSpec};
use crate::structure::{FlexibleArm, payload};
use crate::temperatures::Temperatures;
use crate::truth::TruthHeader;
use crate::vehicle::{BaseState, FreeVehicle};
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::streams::{JointAngles, JointCounts};

/// Parts of a world.
#[derive(Clone, Debug)]
pub struct WorldInput<'a> {
    /// Nominal arm.
    pub robot: &'a Robot,
    /// Nominal vehicle with its tags.
    pub vehicle: &'a Vehicle,
    /// Nominal seafloor and obstacles.
    pub scene: &'a Scene,
    /// `[world]`, checked.
    pub spec: WorldSpec,
    /// Of everything random in the world.
    pub seed: u64,
}

/// An arm that starts nearer to an end stop than this starts at this distance, rad.
const END_STOP_MARGIN_RAD: f64 = 1e-3;

pub(super) fn joint_sensors(robot: &Robot, built: &AsBuilt, spec: &JointSensorsSpec, seed: u64) -> Vec<JointSensor> {
    let sensors = robot.sensors.iter().zip(&built.joints);
    sensors.map(|(nominal, joint)| JointSensor::new(nominal, joint, spec, seed)).collect()
}

/// The true angles at which every sensor reads `stowed` by the datasheet, kept within the end stops.
pub(super) fn stowed_angles(robot: &Robot, sensors: &mut [JointSensor], around: &OilState) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |j| {
        let wanted = sensors[j].angle_for_reading(robot.stowed[j], around);
        let angle = robot.chain.joints()[j].limits.map_or(wanted, |limits| {
            wanted.clamp(limits.lower_rad + END_STOP_MARGIN_RAD, limits.upper_rad - END_STOP_MARGIN_RAD)
        });
        sensors[j].settle(angle);
        angle
    })
}

pub(super) fn sample_joint_sensors(
    sensors: &mut [JointSensor],
    angles: &JointAngles,
    around: &OilState,
    elapsed_s: f64,
) -> JointCounts {
    let around = *around;
    JointCounts::from_fn(sensors.len(), |j| sensors[j].sample(&JointInput { angle_rad: angles[j], around, elapsed_s }))
}

/// At a depth below the surface.
pub(super) fn surroundings(spec: &WorldSpec, temperatures: &Temperatures, t_s: f64, depth_m: f64) -> OilState {
    OilState { oil_c: temperatures.oil_c(t_s), pressure_pa: gauge_pressure_pa(&spec.water, depth_m) }
}

/// What gives and pulls about the arm, its own base and the payload included.
pub(super) fn flexible_arm(robot: &Robot, spec: &WorldSpec) -> FlexibleArm {
    let water = WaterProperties::of(&spec.water);
    let mut bodies: Vec<Body> = robot.bodies.iter().map(|link| Body::link(link, &water)).collect();
    if let Some((body, payload)) = payload(spec, robot) {
        bodies[body].carry(&payload);
    }
    FlexibleArm::new(&spec.structure, robot, bodies, spec.physics.step_s)
}

/// The arm with its payload at rest at these angles.
pub(super) fn arm_physics(robot: &Robot, spec: &WorldSpec, solids: &Solids, angles: JointAngles) -> ArmPhysics {
    ArmPhysics::new(&PhysicsInput {
        chain: &robot.chain,
        bodies: &robot.bodies,
        solids: Some(solids),
        water: &spec.water,
        payload: payload(spec, robot).as_ref(),
        spec: &spec.physics,
        angles,
    })
}

/// The free vehicle that the world asks for, set on the physics at its start; `None` for a prescribed motion.
pub(super) fn free_vehicle(
    input: &WorldInput,
    physics: &mut ArmPhysics,
    base: &BaseState,
) -> Result<Option<FreeVehicle>, SimError> {
    let WorldInput { vehicle, spec, seed, .. } = input;
    if !matches!(spec.vehicle.motion, MotionKind::Free | MotionKind::Parked) {
        return Ok(None);
    }
    let mut free = FreeVehicle::new(vehicle, &spec.vehicle, *seed)?;
    let mut body = free.body(vehicle, &spec.water, physics.multibody(), &physics.angles());
    free.put_on_ground(&spec.ground, vehicle, input.scene.seafloor_z_m, &mut body)?;
    physics.set_free(body, base.world_from_base.isometry());
    Ok(Some(free))
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
