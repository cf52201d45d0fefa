//! Input of a world, and the initial values of its parts.

use crate::as_built::AsBuilt;
use crate::dynamics::{Body, WaterProperties};
use crate::error::SimError;
use crate::physics::{ArmPhysics, PhysicsInput};
use crate::sensors::OilState;
use crate::sensors::joint::{JointInput, JointSensor};
use crate::sensors::thermometer::gauge_pressure_pa;
use crate::solids::Solids;
use crate::spec::{JointSensorsSpec, WorldSpec};
use crate::structure::{FlexibleArm, payload};
use crate::temperatures::Temperatures;
use crate::truth::TruthHeader;
use crate::vehicle::{BaseState, FreeVehicle};
use armcal_core::kinematics::Chain;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::streams::{JointAngles, JointCounts};

/// Parts from which a world is built.
#[derive(Clone, Debug)]
pub struct WorldInput<'a> {
    /// Nominal arm.
    pub robot: &'a Robot,
    /// Nominal vehicle with its tags.
    pub vehicle: &'a Vehicle,
    /// Nominal seafloor and obstacles.
    pub scene: &'a Scene,
    /// Table `[world]`, checked.
    pub spec: WorldSpec,
    /// Seed of all random numbers in the world.
    pub seed: u64,
}

/// Distance from an end stop at which an arm starts that would start nearer to it, rad.
const END_STOP_MARGIN_RAD: f64 = 1e-3;

pub(super) fn joint_sensors(robot: &Robot, built: &AsBuilt, spec: &JointSensorsSpec, seed: u64) -> Vec<JointSensor> {
    let sensors = robot.sensors.iter().zip(&built.joints);
    sensors.map(|(nominal, joint)| JointSensor::new(nominal, joint, spec, seed)).collect()
}

/// Returns the true angles at which every sensor reads `stowed` by the datasheet, within the end stops.
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

/// Returns the oil's temperature and pressure at a depth below the surface.
pub(super) fn oil_state(spec: &WorldSpec, temperatures: &Temperatures, t_s: f64, depth_m: f64) -> OilState {
    OilState { oil_c: temperatures.oil_c(t_s), pressure_pa: gauge_pressure_pa(&spec.water, depth_m) }
}

/// Returns the true scene, and the solids in it.
pub(super) fn scenery(input: &WorldInput) -> Result<(Scene, Solids), SimError> {
    let scene = input.spec.true_scene(input.scene)?;
    let mut solids = Solids::new(input.robot, input.vehicle, &scene);
    if input.spec.vehicle_floats() {
        solids.watch_vehicle();
    }
    let pairs = solids.overlaps();
    if pairs.is_empty() { Ok((scene, solids)) } else { Err(SimError::StowedInside { pairs }) }
}

/// Returns the bodies of the links 0..=n, base first, the payload with the body that carries it.
fn bodies(robot: &Robot, spec: &WorldSpec) -> Vec<Body> {
    let water = WaterProperties::of(&spec.water);
    let mut bodies: Vec<Body> = robot.bodies.iter().map(|link| Body::link(link, &water)).collect();
    if let Some((body, payload)) = payload(spec, robot) {
        bodies[body].carry(&payload);
    }
    bodies
}

/// Returns the compliant parts of the arm, with its own base and the payload.
pub(super) fn flexible_arm(robot: &Robot, spec: &WorldSpec) -> FlexibleArm {
    FlexibleArm::new(&spec.structure, robot, bodies(robot, spec), spec.physics.step_s)
}

/// Builds the arm on its mount as `chain` has it, with a vehicle that floats or is parked; without one for a prescribed
/// motion.
pub(super) fn arm_physics(
    input: &WorldInput,
    solids: &Solids,
    base: &BaseState,
    chain: &Chain,
    angles: JointAngles,
) -> Result<(ArmPhysics, Option<FreeVehicle>), SimError> {
    let WorldInput { robot, vehicle, spec, seed, .. } = input;
    let mut bodies = bodies(robot, spec);
    let mut free = spec.vehicle_floats().then(|| FreeVehicle::new(vehicle, &spec.vehicle, *seed)).transpose()?;
    if let Some(free) = &mut free {
        bodies[0] = free.body(vehicle, &spec.water, &chain.link_poses(&angles), &bodies);
        free.put_on_ground(&spec.ground, vehicle, input.scene.seafloor_z_m, &mut bodies[0])?;
    }
    let physics = ArmPhysics::new(PhysicsInput {
        chain,
        bodies,
        free_base: free.as_ref().map(|_| *base.world_from_base.isometry()),
        solids: Some(solids),
        engine: spec.engine(),
        spec: &spec.physics,
        angles,
    })?;
    Ok((physics, free))
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
