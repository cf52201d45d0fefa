//! What happens to a world besides being driven: time passes at rest, and things break.

use super::{AWAKE_S, SLOW_PERIODS, World, sample_pots};
use crate::sim::fault::Fault;
use crate::sim::spec::CONTROL_PERIOD_S;
use crate::streams::{Arm, ArmError, JointSensorSample, Message, Sink};

impl World {
    /// Whole seconds at rest are skipped, with one reading of each slow stream and of the joints a second. The last ones
    /// pass step by step, so that the controller answers to what drifted meanwhile.
    pub(super) fn rest(&mut self, seconds: f64, sink: &mut dyn Sink) -> Result<(), ArmError> {
        let until = self.now().plus_s(seconds);
        // To a whole second first, for slow streams keep their beat.
        while self.now() < until && !(self.step / self.spec.steps_per_period()).is_multiple_of(SLOW_PERIODS) {
            self.step(sink)?;
        }
        while until.since_s(self.now()) > AWAKE_S {
            self.skip();
            self.hand_over(sink)?;
        }
        while self.now() < until {
            self.step(sink)?;
        }
        Ok(())
    }

    /// One second at rest in one go: the world's clock, temperatures and drift go on, the arm's dynamics do not.
    fn skip(&mut self) {
        self.step += SLOW_PERIODS * self.spec.steps_per_period();
        let (now, t_s) = (self.stamp(), self.time_s());
        self.n_images = (t_s * self.spec.camera.rate_hz + 1e-9).floor() as u64;
        while let Some((arrival, image)) = self.images.pop_front() {
            self.outbox.push((arrival.min(now), Message::Detections(image)));
        }
        let oil_c = self.temperatures.oil_c(t_s);
        let elapsed_s = SLOW_PERIODS as f64 * CONTROL_PERIOD_S;
        self.measured = sample_pots(&mut self.pots, &self.physics.angles(), oil_c, elapsed_s);
        self.outbox.push((now, Message::JointSensors(JointSensorSample { stamp: now, counts: self.measured })));
        self.sample_slow_sensors(now, t_s);
    }

    /// Brings fault `number` of the spec about.
    pub(super) fn break_something(&mut self, number: usize) -> Result<(), ArmError> {
        let known = self.spec.fault.len();
        let Some(fault) = self.spec.fault.get(number) else { return Err(ArmError::NoSuchFault { number, known }) };
        let sensor = |name: &str| self.robot.sensors.iter().position(|sensor| sensor.joint == name);
        match fault {
            Fault::SensorJump { joint, by_rad } => {
                if let Some(pot) = sensor(joint).and_then(|j| self.pots.get_mut(j)) {
                    pot.jump(*by_rad);
                }
            }
            Fault::SensorStuck { joint } => {
                if let Some(pot) = sensor(joint).and_then(|j| self.pots.get_mut(j)) {
                    pot.stick();
                }
            }
            Fault::TagLost { id } => self.camera.lose(*id),
            Fault::Silt { seconds } => self.camera.blind(self.stamp().plus_s(*seconds)),
        }
        Ok(())
    }
}
