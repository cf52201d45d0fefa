//! Waiting: time that passes at rest, in strides of a second.

use crate::spec::CONTROL_PERIOD_S;
use crate::world::readings::SLOW_PERIODS;
use crate::world::setup::sample_joint_sensors;
use crate::world::simulation::World;
use armcal_core::streams::{Arm, ArmError, JointSensorSample, Message, Sink};

/// Duration at the end of a wait that is simulated step by step, s.
const AWAKE_S: f64 = 2.0;
/// Length of a skipped stride, s.
const STRIDE_S: f64 = SLOW_PERIODS as f64 * CONTROL_PERIOD_S;
/// Time after a fault for which the arm's dynamics continue, s: it may sag, or move away by a wrong sensor.
const UPSET_S: f64 = 10.0;

impl World {
    /// Returns the present depth of the vehicle below the surface, m.
    pub(super) fn depth_m(&self) -> f64 {
        self.spec.water.station_depth_m(self.time_s()) - self.base.world_from_vehicle.origin().vector().z
    }

    /// Skips whole seconds at rest, with one reading of each slow stream and of the joints per second. The last ones
    /// are simulated step by step, so that the controller responds to the drift meanwhile. Seconds during and after a
    /// fault are not skipped either, so that it happens at its time and the arm responds to it.
    pub(super) fn rest(&mut self, seconds: f64, sink: &mut dyn Sink) -> Result<(), ArmError> {
        let until = self.now().plus_s(seconds);
        // First reaches a whole second, because slow streams keep their rate.
        while self.now() < until && !(self.step / self.spec.steps_per_period()).is_multiple_of(SLOW_PERIODS) {
            self.step(sink)?;
        }
        while until.since_s(self.now()) > AWAKE_S {
            if self.timeline.is_calm(self.time_s(), UPSET_S, STRIDE_S) {
                self.skip();
                self.hand_over(sink)?;
            } else {
                for _ in 0..SLOW_PERIODS {
                    self.step(sink)?;
                }
            }
        }
        while self.now() < until {
            self.step(sink)?;
        }
        Ok(())
    }

    /// Skips one second at rest: the world's clock, temperatures and drift advance, the arm's dynamics do not.
    fn skip(&mut self) {
        self.settle_jaws();
        self.step += SLOW_PERIODS * self.spec.steps_per_period();
        let (now, t_s) = (self.stamp(), self.time_s());
        if self.free.is_none() {
            self.base = self.motion.at(t_s);
        }
        self.water = self.sea.at(t_s);
        self.n_images = (t_s * self.spec.camera.rate_hz + 1e-9).floor() as u64;
        while let Some(image) = self.images.pop_front() {
            self.deliver(image.arrival.min(now), image);
        }
        self.warm(t_s, STRIDE_S);
        let around = self.sensor_surroundings(STRIDE_S);
        let (angles, _) = self.shafts();
        self.measured = sample_joint_sensors(&mut self.joint_sensors, &angles, &around, STRIDE_S);
        self.tell(now, Message::JointSensors(JointSensorSample { stamp: now, counts: self.measured }));
        self.sample_slow_sensors(now, t_s);
    }
}
