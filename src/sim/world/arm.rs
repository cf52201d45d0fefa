//! World as the arm that a session drives.

use crate::spec::CONTROL_PERIOD_S;
use crate::world::simulation::World;
use armcal_core::streams::{Arm, ArmError, ImageDemand, JointCounts, Sink};
use armcal_core::time::Stamp;

impl Arm for World {
    fn now(&self) -> Stamp {
        self.stamp()
    }

    fn command(&mut self, set_point: &JointCounts) -> Result<(), ArmError> {
        let expected = self.joint_sensors.len();
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

    fn request_images(&mut self, demand: ImageDemand) {
        self.image_demand = demand;
    }

    fn grip(&mut self, opening: f64) -> Result<(), ArmError> {
        self.tell_jaws(opening)
    }

    fn fault(&mut self, number: usize) -> Result<(), ArmError> {
        self.break_something(number)
    }
}
