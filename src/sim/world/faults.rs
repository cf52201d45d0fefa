//! Execution of faults, at steps of the script or at their time, with a record in the truth.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::as_built::WornSpot;
use crate::fault::{Fault, Impulse};
use crate::sensors::joint::JointSensor;
use crate::truth::TruthFault;
use crate::world::simulation::World;
use armcal_core::streams::ArmError;

impl World {
    /// Executes fault `number` of the script's steps.
    pub(super) fn break_something(&mut self, number: usize) -> Result<(), ArmError> {
        let of_steps = || self.spec.fault.iter().enumerate().filter(|(_, scheduled)| scheduled.at_s.is_none());
        let Some((index, _)) = of_steps().nth(number) else {
            return Err(ArmError::NoSuchFault { number, known: of_steps().count() });
        };
        self.bring_about(index)
    }

    /// Executes the faults that are due at the start of a period.
    pub(super) fn break_what_is_due(&mut self) -> Result<(), ArmError> {
        while let Some(index) = self.timeline.take_due(self.time_s()) {
            self.bring_about(index)?;
        }
        Ok(())
    }

    fn bring_about(&mut self, index: usize) -> Result<(), ArmError> {
        let fault = self.spec.fault[index].fault.clone();
        self.timeline.last_s = Some(self.time_s());
        let stamp = self.stamp();
        if let Some(truth) = &mut self.truth {
            let record = TruthFault { stamp, kind: fault.kind().to_owned(), details: fault.details() };
            truth.fault(&record).map_err(ArmError::Sink)?;
        }
        match fault {
            Fault::SensorReversed { joint } => self.at_sensor(&joint, JointSensor::reverse),
            Fault::SensorWorn { joint, at_rad, by_rad, width_rad } => {
                let spot = WornSpot { center_rad: at_rad, peak_rad: by_rad, width_rad };
                self.at_sensor(&joint, |sensor| sensor.wear(spot));
            }
            Fault::SensorDying { joint, dropout_per_s } => {
                self.at_sensor(&joint, |sensor| sensor.lose_contact(dropout_per_s));
            }
            Fault::CameraSlipped { by_m, by_rad } => self.camera.slip(motion(by_m, by_rad)),
            Fault::SensorJump { joint, by_rad } => self.at_sensor(&joint, |sensor| sensor.jump(by_rad)),
            Fault::SensorStuck { joint } => self.at_sensor(&joint, JointSensor::stick),
            Fault::SensorDead { joint } => self.at_sensor(&joint, JointSensor::die),
            Fault::JointLocked { joint } => {
                if let Some(joint) = self.joint(&joint) {
                    self.hydraulics.lock(joint);
                }
            }
            Fault::PressureLost { joint: None, ratio } => self.hydraulics.lose_pump(1.0 - ratio),
            Fault::PressureLost { joint: Some(joint), ratio } => {
                if let Some(joint) = self.joint(&joint) {
                    self.hydraulics.lose_pressure(joint, 1.0 - ratio);
                }
            }
            Fault::TagLost { id } => self.camera.lose(id),
            Fault::TagMoved { id, by_m, by_rad } => {
                self.camera.move_tag(id, motion(by_m, by_rad));
            }
            Fault::TagMisread { id, as_id } => self.camera.misread(id, as_id),
            Fault::Silt { seconds } => self.camera.blind(stamp.plus_s(seconds)),
            Fault::VehicleImpulse { force_n, duration_s, at_m } => {
                self.impulse(&Impulse::new(force_n, duration_s, at_m));
            }
            Fault::ArmImpulse { link, force_n, duration_s } => self.bump(&link, force_n, duration_s),
        }
        Ok(())
    }

    fn joint(&self, name: &str) -> Option<usize> {
        self.robot.sensors.iter().position(|sensor| sensor.joint == name)
    }

    fn at_sensor(&mut self, joint: &str, act: impl FnOnce(&mut JointSensor)) {
        if let Some(sensor) = self.joint(joint).and_then(|joint| self.joint_sensors.get_mut(joint)) {
            act(sensor);
        }
    }

    /// Applies an impulse to the vehicle: a force on a free one, a displacement and return of a prescribed one.
    fn impulse(&mut self, impulse: &Impulse) {
        let t_s = self.time_s();
        match &mut self.free {
            Some(free) => free.impulse(t_s, impulse),
            None => {
                let mass_kg = self.vehicle.mass_kg;
                // Without its own values, a vehicle has a radius of gyration of 0.9 m (assumed).
                let inertia = self.vehicle.dynamics.map_or([0.81 * mass_kg; 3], |dynamics| dynamics.inertia_kg_m2);
                self.motion.impulse(t_s, impulse, mass_kg, &Vector3::from(inertia));
            }
        }
    }

    /// Pushes a link at its centre of mass, force in base axes.
    fn bump(&mut self, link: &str, force_n: [f64; 3], duration_s: f64) {
        let body = self.robot.bodies.iter().position(|body| body.name == link);
        if let Some(body) = body {
            self.physics.push(body, &self.robot.bodies[body].com_m, &Vector3::from(force_n), duration_s);
        }
    }
}

/// Returns the motion of a translation and a rotation vector in a body's own axes.
fn motion(by_m: [f64; 3], by_rad: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from(by_rad));
    Isometry3::from_parts(Translation3::from(by_m), turn)
}
