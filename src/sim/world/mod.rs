//! The world: arm, vehicle, water and sensors in step.

mod faults;
mod from_routine;
mod images;
mod jaws;
mod meanwhile;
mod setup;

use std::collections::VecDeque;

use setup::{header, sample_joint_sensors, stowed_angles, surroundings};

use crate::as_built::AsBuilt;
use crate::body_poses::BodyPoses;
use crate::contact_onset::ContactOnsets;
use crate::controller::Controller;
use crate::dynamics::Force;
use crate::dynamics::JointLoad;
use crate::error::SimError;
use crate::fault::Timeline;
use crate::gripper::Gripper;
use crate::hydraulics::{Hydraulics, actuator_inputs};
use crate::physics::{ArmPhysics, Drive, PhysicsInput};
use crate::sensors::attitude::AttitudeSensor;
use crate::sensors::camera::{CameraInput, CameraShot, ImageDemand, RenderInput, WristCamera};
use crate::sensors::joint::JointSensor;
use crate::sensors::thermometer::SlowSensors;
use crate::solids::Solids;
use crate::spec::{CONTROL_PERIOD_S, MotionKind, WorldSpec};
use crate::temperatures::Temperatures;
use crate::truth::{TruthClearance, TruthContact, TruthHeader, TruthSink, TruthState};
use crate::vehicle::{BaseState, FreeVehicle, Sea, VehicleMotion, WaterMotion};
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::spatial::Pose;
use armcal_core::streams::{Arm, ArmError, JointCounts, JointSensorSample, MAX_JOINTS, Message, Sink, Thermometer};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

const ATTITUDE_PERIODS: u64 = 5;
const SLOW_PERIODS: u64 = 100;
/// The end of a wait that passes step by step, s.
const AWAKE_S: f64 = 2.0;
/// What a world is made of.
#[derive(Clone, Debug)]
pub struct WorldInput<'a> {
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
    pub scene: &'a Scene,
    pub spec: WorldSpec,
    pub seed: u64,
}

/// A simulated arm. Its sensors start at `stowed` by the datasheet, so that the arm itself is where their errors put
/// it.
pub struct World {
    spec: WorldSpec,
    robot: Robot,
    header: TruthHeader,
    /// Of a vehicle whose motion is prescribed.
    motion: VehicleMotion,
    /// A vehicle that floats.
    free: Option<FreeVehicle>,
    sea: Sea,
    /// The water now.
    water: WaterMotion,
    /// The base now.
    base: BaseState,
    vehicle: Vehicle,
    solids: Solids,
    physics: ArmPhysics,
    hydraulics: Hydraulics,
    gripper: Option<Gripper>,
    controller: Controller,
    pots: Vec<JointSensor>,
    temperatures: Temperatures,
    slow: SlowSensors,
    attitude: AttitudeSensor,
    camera: WristCamera,
    contacts: ContactOnsets,
    /// Images under way; the line keeps their order.
    images: VecDeque<CameraShot>,
    image_demand: ImageDemand,
    n_images: u64,
    outbox: Vec<(Stamp, Message)>,
    measured: JointCounts,
    step: u64,
    timeline: Timeline,
    truth: Option<Box<dyn TruthSink>>,
}

impl World {
    /// # Errors
    /// [`SimError`] when the robot lacks masses or effort limits.
    pub fn new(mut input: WorldInput) -> Result<Self, SimError> {
        input.spec = input.spec.completed(input.robot);
        let WorldInput { robot, vehicle, scene, seed, .. } = input;
        let spec = input.spec.clone();
        let scene = &spec.true_scene(scene)?;
        robot.require_masses()?;
        let built = AsBuilt::draw(robot, &spec, seed);
        let gear_ratios: Vec<f64> = built.joints.iter().map(|joint| joint.gear_ratio).collect();
        let step_s = CONTROL_PERIOD_S / spec.steps_per_period() as f64;
        let temperatures = Temperatures::new(&spec.temperature, spec.water.depth_m);
        let sensors = robot.sensors.iter().zip(&built.joints);
        let mut pots: Vec<JointSensor> =
            sensors.map(|(nominal, joint)| JointSensor::new(nominal, joint, &spec.joint_sensors, seed)).collect();
        let around = surroundings(&spec, &temperatures, 0.0, spec.water.depth_m);
        let angles = stowed_angles(robot, &mut pots, &around);
        let solids = Solids::new(robot, vehicle, scene);
        let motion = VehicleMotion::new(&spec.vehicle, spec.recorded.as_ref(), vehicle.vehicle_from_base, seed);
        let base = motion.at(0.0);
        let mut hydraulics = Hydraulics::new(&spec.hydraulics, &actuator_inputs(robot)?, step_s);
        let mut physics = ArmPhysics::new(&PhysicsInput {
            chain: &robot.chain,
            bodies: &robot.bodies,
            solids: Some(&solids),
            water: &spec.water,
            spec: &spec.physics,
            angles,
        });
        let free = match spec.vehicle.motion {
            MotionKind::Free => Some(FreeVehicle::new(vehicle, &spec.vehicle, seed)?),
            MotionKind::Swell | MotionKind::Recorded => None,
        };
        if let Some(free) = &free {
            let body = free.body(vehicle, &spec.water, physics.multibody(), &angles);
            physics.set_free(body, base.world_from_base.isometry());
        }
        hydraulics.balance(&angles, &physics.static_torques(&base.gravity, &angles));
        let sea = Sea::new(&spec.water, seed);
        let measured = sample_joint_sensors(&mut pots, &angles, &around, 0.0);
        let mut camera = WristCamera::new(&CameraInput { robot, built: &built, solids: &solids, spec: &spec, seed });
        camera.enable_rendering(&RenderInput { robot, vehicle, scene, spec: &spec, seed })?;
        Ok(Self {
            controller: Controller::new(&spec.hydraulics, &robot.sensors, &gear_ratios, &measured),
            slow: SlowSensors::new(&spec.temperature, &spec.water, &built.gauges, seed),
            attitude: AttitudeSensor::new(&spec.vehicle, &built.attitude, seed),
            camera,
            contacts: ContactOnsets::new(solids.pairs(), step_s),
            images: VecDeque::new(),
            image_demand: ImageDemand::Preview,
            n_images: 0,
            outbox: Vec::with_capacity(16),
            gripper: robot.gripper.as_ref().map(|gripper| Gripper::new(gripper, spec.hydraulics.valve_lag_s)),
            step: 0,
            timeline: Timeline::new(&spec.fault),
            truth: None,
            header: header(&input, built)?,
            robot: robot.clone(),
            spec,
            motion,
            free,
            water: sea.at(0.0),
            sea,
            base,
            vehicle: vehicle.clone(),
            solids,
            physics,
            hydraulics,
            pots,
            temperatures,
            measured,
        })
    }

    /// Hands the truth to `sink` from now on.
    ///
    /// # Errors
    /// [`SimError::Truth`] when the sink refuses.
    pub fn set_truth_sink(&mut self, mut sink: Box<dyn TruthSink>) -> Result<(), SimError> {
        sink.begin(&self.header).map_err(SimError::Truth)?;
        self.truth = Some(sink);
        Ok(())
    }

    /// Ends the truth's stream, if there is one.
    ///
    /// # Errors
    /// [`SimError::Truth`] when the sink cannot keep what it has.
    pub fn finish_truth(&mut self) -> Result<(), SimError> {
        self.truth.take().map_or(Ok(()), |sink| sink.finish().map_err(SimError::Truth))
    }

    fn time_s(&self) -> f64 {
        // Multiplied, not summed: whole periods fall on whole stamps.
        self.step as f64 / self.spec.steps_per_period() as f64 * CONTROL_PERIOD_S
    }

    fn stamp(&self) -> Stamp {
        SIMULATION_EPOCH.plus_s(self.time_s())
    }

    fn physics_step(&mut self, commands: &[f64; MAX_JOINTS]) -> Result<(), ArmError> {
        let (angles, rates) = (self.physics.angles(), self.physics.rates());
        self.hydraulics.step(commands, &angles, &rates);
        let friction =
            JointLoad { damping_n_m_s_rad: self.spec.water.joint_friction_n_m_s_rad, ..JointLoad::default() };
        let loads = std::array::from_fn(|j| {
            if j < angles.len() { self.hydraulics.load(j) + friction } else { JointLoad::default() }
        });
        let (t_s, step_s) = (self.time_s(), self.spec.physics.step_s);
        self.step += 1;
        let next_s = self.time_s();
        let vehicle_force = match &mut self.free {
            Some(free) => free.force(t_s, step_s, &self.base),
            None => Force::zero(),
        };
        let water_next = self.sea.at(next_s);
        let next = if self.free.is_some() { self.base } else { self.motion.at(next_s) };
        self.physics.step(&Drive {
            base: [&self.base, &next],
            water: [self.water, water_next],
            vehicle_force,
            loads: &loads,
        });
        self.water = water_next;
        self.base = if self.free.is_some() { self.physics.base_state(&self.vehicle.vehicle_from_base) } else { next };
        self.watch_contacts()?;
        let next_image_s = (self.n_images + 1) as f64 / self.spec.camera.rate_hz;
        if self.time_s() >= next_image_s - 1e-9 {
            self.n_images += 1;
            self.expose()?;
        }
        Ok(())
    }

    fn watch_contacts(&mut self) -> Result<(), ArmError> {
        let stamp = self.stamp();
        let began = self.contacts.update(&self.physics, self.step);
        let Some(truth) = &mut self.truth else { return Ok(()) };
        for &(a, b) in began {
            let name = |part| self.solids.part_name(part).to_owned();
            let contact = TruthContact { stamp, part_a: name(a), part_b: name(b) };
            truth.contact(&contact).map_err(ArmError::Sink)?;
        }
        Ok(())
    }

    fn place_solids(&mut self) -> BodyPoses {
        let links = self.physics.poses();
        self.solids.place(&links, self.base.world_from_base.inverse().isometry());
        links
    }

    /// Readings at the end of the period, and images that arrived in it.
    fn collect_messages(&mut self) {
        let (now, t_s) = (self.stamp(), self.time_s());
        let period = self.step / self.spec.steps_per_period();
        while let Some(image) = self.images.pop_front_if(|image| image.arrival <= now) {
            self.deliver(image.arrival, image);
        }
        self.warm(t_s, CONTROL_PERIOD_S);
        let around = surroundings(&self.spec, &self.temperatures, t_s, self.depth_m());
        self.measured = sample_joint_sensors(&mut self.pots, &self.physics.angles(), &around, CONTROL_PERIOD_S);
        let sample = JointSensorSample { stamp: now, counts: self.measured };
        self.outbox.push((now, Message::JointSensors(sample)));
        self.move_jaws(period);
        if period.is_multiple_of(ATTITUDE_PERIODS) {
            let attitude = self.attitude.sample(&self.base, now);
            self.outbox.push((now, Message::Attitude(attitude)));
        }
        if period.is_multiple_of(SLOW_PERIODS) {
            self.sample_slow_sensors(now, t_s);
        }
    }

    /// Water and oil until `t_s`: what the drives take from the pump and do not pass on as work warms the oil.
    fn warm(&mut self, t_s: f64, elapsed_s: f64) {
        self.temperatures.advance(t_s, elapsed_s, self.hydraulics.power_w().max(0.0), self.depth_m());
    }

    /// Thermometers and depth gauge.
    fn sample_slow_sensors(&mut self, now: Stamp, t_s: f64) {
        let oil_c = self.temperatures.oil_c(t_s);
        let oil = self.slow.temperature(Thermometer::Oil, oil_c, now);
        let water = self.slow.temperature(Thermometer::Water, self.temperatures.water_c(t_s), now);
        let heave_m = self.base.world_from_vehicle.origin().vector().z;
        let pressure = self.slow.pressure(heave_m, now);
        self.outbox.push((now, Message::Temperature(oil)));
        self.outbox.push((now, Message::Temperature(water)));
        self.outbox.push((now, Message::Pressure(pressure)));
        self.report_gap();
    }

    fn hand_over(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError> {
        for (log_time, message) in self.outbox.drain(..) {
            sink.record(log_time, &message).map_err(ArmError::Sink)?;
        }
        self.record_truth()
    }

    fn record_truth(&mut self) -> Result<(), ArmError> {
        if self.truth.is_none() {
            return Ok(());
        }
        let period = self.step / self.spec.steps_per_period();
        let is_due = |rate_hz: f64| period.is_multiple_of(periods_between(rate_hz));
        if is_due(self.spec.physics.truth_rate_hz) {
            let state = self.truth_state();
            if let Some(truth) = &mut self.truth {
                truth.state(&state).map_err(ArmError::Sink)?;
            }
        }
        if is_due(self.spec.physics.clearance_rate_hz) {
            self.place_solids();
            let stamp = self.stamp();
            if let (Some(nearest), Some(truth)) = (self.solids.nearest(), &mut self.truth) {
                let name = |part| self.solids.part_name(part).to_owned();
                let (part_a, part_b) = (name(nearest.part_a), name(nearest.part_b));
                let clearance = TruthClearance { stamp, distance_m: nearest.distance_m, part_a, part_b };
                truth.clearance(&clearance).map_err(ArmError::Sink)?;
            }
        }
        Ok(())
    }

    fn truth_state(&self) -> TruthState {
        let (angles, rates) = (self.physics.angles(), self.physics.rates());
        let links = self.physics.poses();
        let t_s = self.time_s();
        TruthState {
            stamp: self.stamp(),
            angles,
            rates,
            torques: self.hydraulics.torques(&angles, &rates),
            // The engine's raw poses get their names here: the tool and the camera in the base frame.
            base_from_tool: Pose::from_isometry(links.frame(&self.robot.tool.mount)),
            base_from_camera: Pose::from_isometry(self.camera.base_from_camera(&links)),
            world_from_vehicle: self.base.world_from_vehicle,
            oil_c: self.temperatures.oil_c(t_s),
            water_c: self.temperatures.water_c(t_s),
        }
    }
}

impl Arm for World {
    fn now(&self) -> Stamp {
        self.stamp()
    }

    fn command(&mut self, set_point: &JointCounts) -> Result<(), ArmError> {
        let expected = self.pots.len();
        if set_point.len() != expected {
            return Err(ArmError::JointCount { got: set_point.len(), expected });
        }
        if let Some((joint, &counts)) = set_point.iter().enumerate().find(|(_, counts)| !counts.is_finite()) {
            return Err(ArmError::SetPoint { joint, counts });
        }
        self.controller.command(set_point);
        Ok(())
    }

    fn step(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError> {
        self.break_what_is_due()?;
        let commands = self.controller.update(&self.measured);
        for _ in 0..self.spec.steps_per_period() {
            self.physics_step(&commands)?;
        }
        if self.physics.angles().iter().any(|angle| !angle.is_finite()) {
            return Err(ArmError::NotFinite { at_s: self.time_s() });
        }
        self.collect_messages();
        self.hand_over(sink)
    }

    fn period_s(&self) -> f64 {
        CONTROL_PERIOD_S
    }

    fn idle(&mut self, seconds: f64, sink: &mut dyn Sink) -> Result<(), ArmError> {
        self.rest(seconds, sink)
    }

    fn look(&mut self, is_wanted: bool) {
        self.image_demand = if is_wanted { ImageDemand::Every } else { ImageDemand::Preview };
    }

    fn grip(&mut self, opening: f64) -> Result<(), ArmError> {
        self.tell_jaws(opening)
    }

    fn fault(&mut self, number: usize) -> Result<(), ArmError> {
        self.break_something(number)
    }
}

/// Whole control periods between samples of about `rate_hz`.
fn periods_between(rate_hz: f64) -> u64 {
    (1.0 / (rate_hz * CONTROL_PERIOD_S)).round().max(1.0) as u64
}

#[cfg(test)]
mod tests;
