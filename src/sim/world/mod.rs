//! The world: arm, vehicle, water and sensors in step.

mod meanwhile;

use std::collections::VecDeque;

use super::as_built::AsBuilt;
use super::contact::ContactWatch;
use super::controller::Controller;
use super::error::SimError;
use super::hydraulics::{ActuatorInput, Hydraulics};
use super::physics::{ArmPhysics, PhysicsInput};
use super::places::BodyPoses;
use super::sensors::attitude::AttitudeSensor;
use super::sensors::camera::{CameraInput, WristCamera};
use super::sensors::pot::{Pot, PotInput};
use super::sensors::thermometer::{SlowSensors, Temperatures};
use super::solids::Solids;
use super::spec::{CONTROL_PERIOD_S, WorldSpec};
use super::truth::{TruthClearance, TruthContact, TruthHeader, TruthSink, TruthState};
use super::vehicle::{BaseState, VehicleMotion};
use crate::robot::{Robot, Vehicle};
use crate::routine::Scene;
use crate::spatial::Pose;
use crate::streams::{
    Arm, ArmError, JointAngles, JointCounts, JointSensorSample, MAX_JOINTS, Message, Sink, TagDetections, Thermometer,
};
use crate::time::{SIMULATION_EPOCH, Stamp};

const ATTITUDE_PERIODS: u64 = 5;
const SLOW_PERIODS: u64 = 100;
/// The end of a wait that passes step by step, s.
const AWAKE_S: f64 = 2.0;
/// An arm that starts nearer to an end stop than this starts at this distance, rad.
const END_STOP_MARGIN_RAD: f64 = 1e-3;

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
    motion: VehicleMotion,
    solids: Solids,
    physics: ArmPhysics,
    hydraulics: Hydraulics,
    controller: Controller,
    pots: Vec<Pot>,
    temperatures: Temperatures,
    slow: SlowSensors,
    attitude: AttitudeSensor,
    camera: WristCamera,
    contacts: ContactWatch,
    /// Images under way, with their time of arrival; the line keeps their order.
    images: VecDeque<(Stamp, TagDetections)>,
    n_images: u64,
    outbox: Vec<(Stamp, Message)>,
    measured: JointCounts,
    step: u64,
    truth: Option<Box<dyn TruthSink>>,
}

impl World {
    /// # Errors
    /// [`SimError`] when the robot lacks masses or effort limits.
    pub fn new(mut input: WorldInput) -> Result<Self, SimError> {
        input.spec = input.spec.completed(input.robot);
        let WorldInput { robot, vehicle, scene, seed, .. } = input;
        let spec = input.spec.clone();
        robot.require_masses()?;
        let built = AsBuilt::draw(robot, &spec, seed);
        let gear_ratios: Vec<f64> = built.joints.iter().map(|joint| joint.gear_ratio).collect();
        let step_s = CONTROL_PERIOD_S / spec.steps_per_period() as f64;
        let temperatures = Temperatures { spec: spec.temperature };
        let sensors = robot.sensors.iter().zip(&built.joints);
        let mut pots: Vec<Pot> =
            sensors.map(|(nominal, joint)| Pot::new(nominal, joint, &spec.joint_sensors, seed)).collect();
        let angles = stowed_angles(robot, &mut pots, temperatures.oil_c(0.0));
        let solids = Solids::new(robot, vehicle, scene);
        let motion = VehicleMotion::new(&spec.vehicle, vehicle.vehicle_from_base, seed);
        let mut hydraulics = Hydraulics::new(&spec.hydraulics, &actuators(robot)?, step_s);
        let mut physics = ArmPhysics::new(&PhysicsInput {
            chain: &robot.chain,
            bodies: &robot.bodies,
            solids: Some(&solids),
            water: &spec.water,
            step_s,
            angles,
        })?;
        physics.set_damping(&hydraulics.damping().map(|column| column + spec.water.joint_friction_n_m_s_rad));
        hydraulics.balance(&angles, &physics.static_torques(&robot.chain, &motion.at(0.0), &angles));
        let measured = sample_pots(&mut pots, &angles, temperatures.oil_c(0.0), 0.0);
        Ok(Self {
            controller: Controller::new(&spec.hydraulics, &robot.sensors, &gear_ratios, &measured),
            slow: SlowSensors::new(&spec.temperature, &spec.water, seed),
            attitude: AttitudeSensor::new(&spec.vehicle, seed),
            camera: WristCamera::new(&CameraInput { robot, built: &built, solids: &solids, spec: &spec, seed }),
            contacts: ContactWatch::new(solids.pairs(), step_s),
            images: VecDeque::new(),
            n_images: 0,
            outbox: Vec::with_capacity(16),
            step: 0,
            truth: None,
            header: header(&input, built)?,
            robot: robot.clone(),
            spec,
            motion,
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
        let base = self.motion.at(self.time_s());
        let angles = self.physics.angles();
        self.hydraulics.step(commands, &angles);
        for joint in 0..angles.len() {
            self.physics.set_column(joint, &self.hydraulics.column(joint));
        }
        self.physics.step(&base);
        self.step += 1;
        self.watch_contacts()?;
        let next_image_s = (self.n_images + 1) as f64 / self.spec.camera.rate_hz;
        if self.time_s() >= next_image_s - 1e-9 {
            self.n_images += 1;
            self.expose();
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

    fn expose(&mut self) {
        let links = self.place_solids(&self.motion.at(self.time_s()));
        let exposure = self.stamp();
        let image = self.camera.expose(&links, &self.solids, exposure);
        // It arrives when its late clock says that it was taken, but never before the image ahead of it.
        let arrival = self.images.back().map_or(image.stamp, |(ahead, _)| image.stamp.max(*ahead));
        self.images.push_back((arrival, image));
    }

    fn place_solids(&mut self, base: &BaseState) -> BodyPoses {
        let links = self.physics.poses();
        self.solids.place(&links, base.world_from_base.inverse().isometry());
        links
    }

    /// Readings at the end of the period, and images that arrived in it.
    fn collect_messages(&mut self) {
        let (now, t_s) = (self.stamp(), self.time_s());
        let period = self.step / self.spec.steps_per_period();
        while let Some((arrival, image)) = self.images.pop_front_if(|(arrival, _)| *arrival <= now) {
            self.outbox.push((arrival, Message::Detections(image)));
        }
        let oil_c = self.temperatures.oil_c(t_s);
        self.measured = sample_pots(&mut self.pots, &self.physics.angles(), oil_c, CONTROL_PERIOD_S);
        let sample = JointSensorSample { stamp: now, counts: self.measured };
        self.outbox.push((now, Message::JointSensors(sample)));
        if period.is_multiple_of(ATTITUDE_PERIODS) {
            let attitude = self.attitude.sample(&self.motion.at(t_s), now);
            self.outbox.push((now, Message::Attitude(attitude)));
        }
        if period.is_multiple_of(SLOW_PERIODS) {
            self.sample_slow_sensors(now, t_s);
        }
    }

    /// Thermometers and depth gauge.
    fn sample_slow_sensors(&mut self, now: Stamp, t_s: f64) {
        let oil_c = self.temperatures.oil_c(t_s);
        let oil = self.slow.temperature(Thermometer::Oil, oil_c, now);
        let water = self.slow.temperature(Thermometer::Water, self.temperatures.water_c(t_s), now);
        let heave_m = self.motion.at(t_s).world_from_vehicle.origin().vector().z;
        let pressure = self.slow.pressure(heave_m, now);
        self.outbox.push((now, Message::Temperature(oil)));
        self.outbox.push((now, Message::Temperature(water)));
        self.outbox.push((now, Message::Pressure(pressure)));
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
            self.place_solids(&self.motion.at(self.time_s()));
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
        let angles = self.physics.angles();
        let links = self.physics.poses();
        let t_s = self.time_s();
        TruthState {
            stamp: self.stamp(),
            angles,
            rates: self.physics.rates(),
            torques: self.hydraulics.torques(&angles),
            // The engine's raw poses get their names here: the tool and the camera in the base frame.
            base_from_tool: Pose::from_isometry(links.frame(&self.robot.tool.mount)),
            base_from_camera: Pose::from_isometry(self.camera.base_from_camera(&links)),
            world_from_vehicle: self.motion.at(t_s).world_from_vehicle,
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

    fn fault(&mut self, number: usize) -> Result<(), ArmError> {
        self.break_something(number)
    }
}

/// Whole control periods between samples of about `rate_hz`.
fn periods_between(rate_hz: f64) -> u64 {
    (1.0 / (rate_hz * CONTROL_PERIOD_S)).round().max(1.0) as u64
}

/// The true angles at which every sensor reads `stowed` by the datasheet, kept within the end stops.
fn stowed_angles(robot: &Robot, pots: &mut [Pot], oil_c: f64) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |j| {
        let wanted = pots[j].angle_for_reading(robot.stowed[j], oil_c);
        let angle = robot.chain.joints()[j].limits.map_or(wanted, |limits| {
            wanted.clamp(limits.lower_rad + END_STOP_MARGIN_RAD, limits.upper_rad - END_STOP_MARGIN_RAD)
        });
        pots[j].settle(angle);
        angle
    })
}

fn sample_pots(pots: &mut [Pot], angles: &JointAngles, oil_c: f64, elapsed_s: f64) -> JointCounts {
    JointCounts::from_fn(pots.len(), |j| pots[j].sample(&PotInput { angle_rad: angles[j], oil_c, elapsed_s }))
}

/// Torque limits from the URDF's effort, rates from the sensors' table.
fn actuators(robot: &Robot) -> Result<Vec<ActuatorInput>, SimError> {
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

fn header(input: &WorldInput, as_built: AsBuilt) -> Result<TruthHeader, SimError> {
    Ok(TruthHeader {
        robot: input.robot.name.clone(),
        vehicle: input.vehicle.name.clone(),
        joint_names: input.robot.joint_names(),
        seed: input.seed,
        spec_toml: input.spec.to_toml()?,
        as_built,
    })
}

#[cfg(test)]
mod tests;
