//! Parts of a world, and their step.

use std::collections::VecDeque;

use crate::as_built::AsBuilt;
use crate::body_poses::BodyPoses;
use crate::clearance_watch::ClearanceWatch;
use crate::contact_onset::ContactOnsets;
use crate::controller::Controller;
use crate::dynamics::JointLoad;
use crate::error::SimError;
use crate::fault::Timeline;
use crate::gripper::Gripper;
use crate::hydraulics::{Hydraulics, actuator_inputs};
use crate::physics::{ArmPhysics, Drive};
use crate::sensors::SensorSurroundings;
use crate::sensors::attitude::AttitudeSensor;
use crate::sensors::camera::{CameraInput, CameraShot, RenderInput, WristCamera};
use crate::sensors::joint::JointSensor;
use crate::sensors::thermometer::SlowSensors;
use crate::solids::Solids;
use crate::spec::{CONTROL_PERIOD_S, WorldSpec};
use crate::structure::{ArmState, Balance, FlexibleArm};
use crate::temperatures::Temperatures;
use crate::truth::{TruthHeader, TruthSink};
use crate::vehicle::{BaseState, FreeVehicle, Sea, VehicleMotion, WaterMotion};
use crate::world::setup::{
    WorldInput, arm_physics, flexible_arm, header, joint_sensors, oil_state, sample_joint_sensors, scenery,
    stowed_angles,
};
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::streams::{ArmError, ImageDemand, JointAngles, JointCounts, LateMessages, MAX_JOINTS, Message};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

/// Messages that leave the world at a log time.
pub(super) enum Outgoing {
    Ready(Stamp, Message),
    Late(Stamp, LateMessages),
}

/// Simulated arm. Its sensors start at `stowed` by the datasheet, and the arm itself at the angles that follow from
/// their errors.
pub struct World {
    pub(super) spec: WorldSpec,
    /// Robot as built.
    pub(super) robot: Robot,
    pub(super) header: TruthHeader,
    /// Motion of a vehicle whose motion is prescribed.
    pub(super) motion: VehicleMotion,
    /// Vehicle that floats.
    pub(super) free: Option<FreeVehicle>,
    pub(super) sea: Sea,
    /// Present motion of the water.
    pub(super) water: WaterMotion,
    /// Present state of the base.
    pub(super) base: BaseState,
    pub(super) vehicle: Vehicle,
    pub(super) solids: Solids,
    pub(super) physics: ArmPhysics,
    pub(super) structure: FlexibleArm,
    pub(super) hydraulics: Hydraulics,
    pub(super) gripper: Option<Gripper>,
    pub(super) controller: Controller,
    pub(super) joint_sensors: Vec<JointSensor>,
    pub(super) sensor_surroundings: SensorSurroundings,
    pub(super) temperatures: Temperatures,
    pub(super) slow: SlowSensors,
    pub(super) attitude: AttitudeSensor,
    pub(super) camera: WristCamera,
    pub(super) contacts: ContactOnsets,
    /// Watch of the clearance; `None` while nobody takes the truth.
    pub(super) clearance: Option<ClearanceWatch>,
    /// Images on their way; the line keeps their order.
    pub(super) images: VecDeque<CameraShot>,
    pub(super) image_demand: ImageDemand,
    pub(super) n_images: u64,
    pub(super) outbox: Vec<Outgoing>,
    pub(super) measured: JointCounts,
    pub(super) step: u64,
    pub(super) timeline: Timeline,
    pub(super) truth: Option<Box<dyn TruthSink>>,
}

impl World {
    /// Builds a world.
    ///
    /// # Errors
    /// [`SimError`] when the robot lacks masses or effort limits, or is stowed inside something.
    pub fn new(mut input: WorldInput) -> Result<Self, SimError> {
        input.spec = input.spec.completed(input.robot);
        input.robot.require_masses()?;
        let built = AsBuilt::draw(input.robot, &input.spec, input.seed);
        let arm = built.arm(input.robot);
        Self::of_arm(&WorldInput { robot: &arm, ..input }, built)
    }

    /// Builds a world with this arm as built.
    fn of_arm(input: &WorldInput, built: AsBuilt) -> Result<Self, SimError> {
        let WorldInput { robot, vehicle, seed, .. } = *input;
        let spec = input.spec.clone();
        let gear_ratios: Vec<f64> = built.joints.iter().map(|joint| joint.gear_ratio).collect();
        let step_s = CONTROL_PERIOD_S / spec.steps_per_period() as f64;
        let depth_m = spec.water.station_depth_m(0.0);
        let temperatures = Temperatures::new(&spec.temperature, depth_m);
        let mut joint_sensors = joint_sensors(robot, &built, &spec.joint_sensors, seed);
        let mut sensor_surroundings = SensorSurroundings::new(&spec.joint_sensors);
        let around = sensor_surroundings.follow(oil_state(&spec, &temperatures, 0.0, depth_m), 0.0);
        let shafts = stowed_angles(robot, &mut joint_sensors, &around);
        let (scene, solids) = &scenery(input)?;
        let motion = VehicleMotion::new(&spec.vehicle, spec.recorded.as_ref(), vehicle.vehicle_from_base, seed);
        let base = motion.at(0.0);
        let mut hydraulics = Hydraulics::new(&spec.hydraulics, &actuator_inputs(robot)?, step_s);
        let mut structure = flexible_arm(robot, &spec);
        let Balance { angles, torques } = structure.settle(&shafts, &base.gravity);
        let mut chain = robot.chain.clone();
        chain.set_first_place(&structure.first_place());
        let (physics, free) = arm_physics(input, solids, &base, &chain, angles)?;
        hydraulics.balance(&shafts, &torques);
        let sea = Sea::new(&spec.water, seed);
        let measured = sample_joint_sensors(&mut joint_sensors, &shafts, &around, 0.0);
        let mut camera = WristCamera::new(&CameraInput { robot, built: &built, solids, spec: &spec, seed });
        camera.enable_rendering(&RenderInput { robot, vehicle, scene, spec: &spec, seed })?;
        Ok(Self {
            controller: Controller::new(&spec.hydraulics, &robot.sensors, &gear_ratios, &measured),
            slow: SlowSensors::new(&spec.temperature, &spec.water, &built.gauges, seed),
            attitude: AttitudeSensor::new(&spec.vehicle, &built.attitude, seed),
            camera,
            contacts: ContactOnsets::new(solids.pairs(), step_s),
            clearance: None,
            images: VecDeque::new(),
            image_demand: ImageDemand::Few,
            n_images: 0,
            outbox: Vec::with_capacity(16),
            gripper: robot.gripper.as_ref().map(|gripper| Gripper::new(gripper, spec.hydraulics.valve_lag_s)),
            step: 0,
            timeline: Timeline::new(&spec.fault),
            truth: None,
            header: header(input, built)?,
            robot: robot.clone(),
            spec,
            motion,
            free,
            water: sea.at(0.0),
            sea,
            base,
            vehicle: vehicle.clone(),
            solids: solids.clone(),
            physics,
            structure,
            hydraulics,
            joint_sensors,
            sensor_surroundings,
            temperatures,
            measured,
        })
    }

    pub(super) fn time_s(&self) -> f64 {
        self.spec.time_s(self.step)
    }

    pub(super) fn stamp(&self) -> Stamp {
        SIMULATION_EPOCH.plus_s(self.time_s())
    }

    pub(super) fn physics_step(&mut self, commands: &[f64; MAX_JOINTS]) -> Result<(), ArmError> {
        let (angles, rates) = self.shafts();
        self.hydraulics.step(commands, &angles, &rates);
        let friction =
            JointLoad { damping_n_m_s_rad: self.spec.water.joint_friction_n_m_s_rad, ..JointLoad::default() };
        let (links, link_rates) = (self.physics.angles(), self.physics.rates());
        let mut loads = [JointLoad::default(); MAX_JOINTS];
        for (j, load) in loads.iter_mut().enumerate().take(links.len()) {
            let drive = self.hydraulics.load(j);
            *load = self.structure.load(j, drive, [links[j], link_rates[j]]) + friction;
        }
        let (t_s, step_s) = (self.time_s(), self.spec.physics.step_s);
        self.step += 1;
        let next_s = self.time_s();
        let mut wrenches = self.structure.pulls(&links);
        if let Some(free) = &mut self.free {
            wrenches[0] += free.force(t_s, step_s, &self.base);
        }
        let water_next = self.sea.at(next_s);
        let next = if self.free.is_some() { self.base } else { self.motion.at(next_s) };
        self.physics.step(&Drive {
            base: [&self.base, &next],
            water: [self.water, water_next],
            wrenches: &wrenches,
            loads: &loads,
        });
        self.water = water_next;
        self.base = self.physics.base_state(&self.vehicle.vehicle_from_base).unwrap_or(next);
        self.bend();
        self.watch_contacts()?;
        self.watch_clearance();
        let next_image_s = (self.n_images + 1) as f64 / self.spec.camera.rate_hz;
        if self.time_s() >= next_image_s - 1e-9 {
            self.n_images += 1;
            self.expose();
        }
        Ok(())
    }

    /// Returns angles and rates of the joints' shafts, which the sensors read.
    pub(super) fn shafts(&self) -> (JointAngles, JointAngles) {
        self.structure.shafts(&self.physics.angles(), &self.physics.rates())
    }

    /// Updates shafts and mount after the step.
    fn bend(&mut self) {
        let (angles, rates) = (self.physics.angles(), self.physics.rates());
        let state = ArmState { angles: &angles, rates: &rates, base: &self.base, water: &self.water };
        if let Some(place) = self.structure.follow(&state) {
            self.physics.set_first_place(&place);
        }
    }

    pub(super) fn place_solids(&mut self) -> BodyPoses {
        let links = self.physics.poses();
        self.solids.place(&links, self.base.world_from_base.inverse().isometry());
        links
    }
}
