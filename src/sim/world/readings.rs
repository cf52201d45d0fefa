//! Messages of the sensors, control period by control period.

use crate::sensors::OilState;
use crate::spec::CONTROL_PERIOD_S;
use crate::world::setup::{oil_state, sample_joint_sensors};
use crate::world::simulation::{Outgoing, World};
use armcal_core::streams::{ArmError, JointSensorSample, Message, Sink, Thermometer};
use armcal_core::time::Stamp;

const ATTITUDE_PERIODS: u64 = 5;
pub(super) const SLOW_PERIODS: u64 = 100;

impl World {
    /// Collects readings at the end of the period, and images that arrived in it.
    pub(super) fn collect_messages(&mut self) {
        let (now, t_s) = (self.stamp(), self.time_s());
        let period = self.step / self.spec.steps_per_period();
        while let Some(image) = self.images.pop_front_if(|image| image.arrival <= now) {
            self.deliver(image.arrival, image);
        }
        self.warm(t_s, CONTROL_PERIOD_S);
        let around = self.sensor_surroundings(CONTROL_PERIOD_S);
        let (angles, _) = self.shafts();
        self.measured = sample_joint_sensors(&mut self.joint_sensors, &angles, &around, CONTROL_PERIOD_S);
        let sample = JointSensorSample { stamp: now, counts: self.measured };
        self.tell(now, Message::JointSensors(sample));
        self.move_jaws(period);
        if period.is_multiple_of(ATTITUDE_PERIODS) {
            let attitude = self.attitude.sample(&self.base, now);
            self.tell(now, Message::Attitude(attitude));
        }
        if period.is_multiple_of(SLOW_PERIODS) {
            self.sample_slow_sensors(now, t_s);
        }
    }

    /// Advances water and oil to `t_s`: power that the drives take from the pump and do not use as work warms the oil.
    pub(super) fn warm(&mut self, t_s: f64, elapsed_s: f64) {
        self.temperatures.advance(t_s, elapsed_s, self.hydraulics.power_w().max(0.0), self.depth_m());
    }

    /// Advances the joint sensors' surroundings: they follow the oil's temperature and the pressure at the vehicle.
    pub(super) fn sensor_surroundings(&mut self, elapsed_s: f64) -> OilState {
        let oil = oil_state(&self.spec, &self.temperatures, self.time_s(), self.depth_m());
        self.sensor_surroundings.follow(oil, elapsed_s)
    }

    /// Samples thermometers and depth gauge.
    pub(super) fn sample_slow_sensors(&mut self, now: Stamp, t_s: f64) {
        let oil_c = self.temperatures.oil_c(t_s);
        let oil = self.slow.temperature(Thermometer::Oil, oil_c, now);
        let water = self.slow.temperature(Thermometer::Water, self.temperatures.water_c(t_s), now);
        let heave_m = self.base.world_from_vehicle.origin().vector().z;
        let pressure = self.slow.pressure(heave_m, now);
        self.tell(now, Message::Temperature(oil));
        self.tell(now, Message::Temperature(water));
        self.tell(now, Message::Pressure(pressure));
        self.report_gap();
    }

    pub(super) fn tell(&mut self, log_time: Stamp, message: Message) {
        self.outbox.push(Outgoing::Ready(log_time, message));
    }

    pub(super) fn hand_over(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError> {
        for outgoing in self.outbox.drain(..) {
            let kept = match outgoing {
                Outgoing::Ready(log_time, message) => sink.record(log_time, &message),
                Outgoing::Late(log_time, late) => sink.record_late(log_time, late),
            };
            kept.map_err(ArmError::Sink)?;
        }
        self.record_truth()
    }
}
