//! The arm's own controller: closes the loop on its own sensors, in raw counts, at 100 Hz.
//!
//! Proportional with feed-forward of the set-point's rate; readings are low-pass filtered; the valve's deadband is
//! jumped over, and the valve closes within a small band about the set-point. Counts become angles by the datasheet's
//! scale only, for the controller knows neither gain nor offset errors. The word's wrap is honoured: the short way
//! round counts.

use super::spec::{CONTROL_PERIOD_S, HydraulicsSpec};
use crate::robot::JointSensorSpec;
use crate::streams::{JointCounts, MAX_JOINTS};

/// Set-points that come no farther apart than this make a path with a rate, periods.
const PATH_PERIODS: u32 = 10;

#[derive(Clone, Debug)]
pub(super) struct Controller {
    spec: HydraulicsSpec,
    joints: Vec<JointLoop>,
    filter_share: f64,
    periods_since_command: u32,
    /// How long the present feed-forward holds, periods.
    path_periods: u32,
}

#[derive(Clone, Debug)]
struct JointLoop {
    counts_per_rad: f64,
    wrap_counts: f64,
    rate_limit_rad_s: f64,
    set_counts: f64,
    filtered_counts: f64,
    feed_forward_rad_s: f64,
    rest: Rest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rest {
    Closed,
    Open,
}

impl Controller {
    /// Starts at rest where `measured` says. `gear_ratio`, one a joint: it was tuned on this arm and knows which way the
    /// counts run, else it would drive away from its set-points.
    pub(super) fn new(
        spec: &HydraulicsSpec,
        sensors: &[JointSensorSpec],
        gear_ratio: &[f64],
        measured: &JointCounts,
    ) -> Self {
        let joints = sensors.iter().zip(gear_ratio).zip(measured.iter()).map(|((sensor, ratio), &counts)| JointLoop {
            counts_per_rad: ratio * sensor.counts_per_rad,
            wrap_counts: sensor.wrap_counts,
            rate_limit_rad_s: sensor.max_rate_rad_s,
            set_counts: counts,
            filtered_counts: counts,
            feed_forward_rad_s: 0.0,
            rest: Rest::Closed,
        });
        Self {
            spec: *spec,
            joints: joints.collect(),
            filter_share: if spec.controller_filter_s > 0.0 {
                1.0 - (-CONTROL_PERIOD_S / spec.controller_filter_s).exp()
            } else {
                1.0
            },
            periods_since_command: PATH_PERIODS,
            path_periods: 0,
        }
    }

    /// Takes a new set-point. A path of set-points gives its rate; a jump gives none.
    pub(super) fn command(&mut self, set_point: &JointCounts) {
        let periods = self.periods_since_command.max(1);
        for (joint, &counts) in self.joints.iter_mut().zip(set_point.iter()) {
            let travel_rad = wrap(counts - joint.set_counts, joint.wrap_counts) / joint.counts_per_rad;
            let rate = travel_rad / (f64::from(periods) * CONTROL_PERIOD_S);
            let is_path = periods <= PATH_PERIODS && rate.abs() <= 1.5 * joint.rate_limit_rad_s;
            joint.feed_forward_rad_s = if is_path { rate } else { 0.0 };
            joint.set_counts = counts;
        }
        self.path_periods = periods;
        self.periods_since_command = 0;
    }

    /// Valve commands, -1..1, for the readings of this period.
    pub(super) fn update(&mut self, measured: &JointCounts) -> [f64; MAX_JOINTS] {
        let on_path = self.periods_since_command < self.path_periods;
        self.periods_since_command = self.periods_since_command.saturating_add(1);
        let mut commands = [0.0; MAX_JOINTS];
        for ((command, joint), &counts) in commands.iter_mut().zip(&mut self.joints).zip(measured.iter()) {
            if !on_path {
                joint.feed_forward_rad_s = 0.0;
            }
            *command = joint.update(&self.spec, self.filter_share, counts);
        }
        commands
    }
}

impl JointLoop {
    fn update(&mut self, spec: &HydraulicsSpec, filter_share: f64, counts: f64) -> f64 {
        self.filtered_counts += filter_share * wrap(counts - self.filtered_counts, self.wrap_counts);
        let away_rad = wrap(self.set_counts - self.filtered_counts, self.wrap_counts) / self.counts_per_rad;
        let error_rad = away_rad + spec.controller_bias_rad;
        let band = match self.rest {
            Rest::Closed => 2.0 * spec.rest_band_rad,
            Rest::Open => spec.rest_band_rad,
        };
        if error_rad.abs() < band && self.feed_forward_rad_s == 0.0 {
            self.rest = Rest::Closed;
            return 0.0;
        }
        self.rest = Rest::Open;
        let wanted = self.feed_forward_rad_s + spec.controller_gain_per_s * error_rad;
        let rate = wanted.clamp(-self.rate_limit_rad_s, self.rate_limit_rad_s);
        let share = rate / (self.rate_limit_rad_s * spec.rate_margin);
        share.signum() * (spec.deadband + (1.0 - spec.deadband) * share.abs())
    }
}

/// `value` modulo `period`, in -period/2 .. period/2.
fn wrap(value: f64, period: f64) -> f64 {
    (value + 0.5 * period).rem_euclid(period) - 0.5 * period
}

#[cfg(test)]
mod tests {
    use super::*;

    fn controller(set: f64) -> Controller {
        biased_controller(set, 0.0)
    }

    fn biased_controller(set: f64, controller_bias_rad: f64) -> Controller {
        let spec = HydraulicsSpec { controller_filter_s: 0.0, controller_bias_rad, ..HydraulicsSpec::default() };
        let sensor = JointSensorSpec {
            joint: "j".into(),
            kind: crate::robot::SensorKind::Potentiometer,
            offset_counts: 0.0,
            counts_per_rad: 2600.0,
            wrap_counts: 65536.0,
            center_rad: 0.0,
            gain_std: 0.0,
            offset_std_rad: 0.0,
            gain_bound: 0.0,
            offset_bound_rad: 0.0,
            noise_std_counts: 0.0,
            linearity_std_rad: 0.0,
            temperature_std_rad_per_k: 0.0,
            drift_std_rad_per_sqrt_h: 0.0,
            max_rate_rad_s: 0.5,
        };
        Controller::new(&spec, &[sensor], &[1.0], &JointCounts::from_slice(&[set]))
    }

    #[test]
    fn the_short_way_round_is_across_the_words_wrap() {
        let mut controller = controller(65_500.0);
        controller.command(&JointCounts::from_slice(&[100.0]));
        let command = controller.update(&JointCounts::from_slice(&[65_500.0]));
        assert!(command[0] > 0.0, "136 counts up, not 65400 down");
    }

    #[test]
    fn a_bias_moves_the_place_of_rest_by_itself() {
        let bias_rad = 0.01;
        let mut controller = biased_controller(1000.0, bias_rad);
        assert!(controller.update(&JointCounts::from_slice(&[1000.0]))[0] > 0.0, "it leaves the set-point upwards");
        let biased = 1000.0 + bias_rad * 2600.0;
        assert_eq!(controller.update(&JointCounts::from_slice(&[biased]))[0], 0.0, "it rests beside it");
    }

    #[test]
    fn a_path_feeds_its_rate_forward_and_a_jump_does_not() {
        let mut controller = controller(1000.0);
        // 0.2 rad/s = 5.2 counts a period.
        let mut set = 1000.0;
        let mut command = 0.0;
        for _ in 0..20 {
            set += 5.2;
            controller.command(&JointCounts::from_slice(&[set]));
            command = controller.update(&JointCounts::from_slice(&[set]))[0];
        }
        let share = 0.2 / (0.5 * 1.3);
        assert!((command - (0.03 + 0.97 * share)).abs() < 1e-9, "{command}");
        controller.update(&JointCounts::from_slice(&[set]));
        assert_eq!(controller.update(&JointCounts::from_slice(&[set]))[0], 0.0, "the path has ended");
        controller.command(&JointCounts::from_slice(&[set + 2000.0]));
        assert_eq!(controller.joints[0].feed_forward_rad_s, 0.0);
    }
}
