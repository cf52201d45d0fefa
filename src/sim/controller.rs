//! The arm's controller: a closed loop on the joint sensors, in raw counts, at 100 Hz.
//!
//! It is proportional, with feed-forward of the set-point's rate. Readings are low-pass filtered and outliers rejected.
//! The command skips the valve's deadband, and the valve closes within a small band about the set-point. For a joint
//! that creeps faster than the loop corrects, the controller learns a counter-command while the valve is open near the
//! set-point. Counts become angles by the nominal scale, without gain and offset errors. Differences of counts take the
//! shorter way across the wrap.

use crate::spec::{CONTROL_PERIOD_S, HydraulicsSpec};
use armcal_core::robot::JointSensorSpec;
use armcal_core::streams::{JointCounts, MAX_JOINTS};

/// Largest interval of set-points that form a path with a rate, periods.
const PATH_PERIODS: u32 = 10;

/// Distance from the set-point within which creep is learnt, rest bands.
const FAR_BANDS: f64 = 8.0;
/// Largest rate of a joint over that of its open valve before its readings count as wild: the joint swings on its oil.
const REACHABLE: f64 = 2.0;
/// Noise within which no reading counts as wild, standard deviations.
const NOISE_SIGMAS: f64 = 8.0;
/// Time of an open valve near its set-point after which the controller counteracts creep, s.
const CREEP_TIME_S: f64 = 1.0;
/// Creep that is left to the rest band, rad/s.
const CREEP_RAD_S: f64 = 1e-3;
/// Largest creep that is held, as a share of the rate limit.
const CREEP_LIMIT: f64 = 0.05;

#[derive(Clone, Debug)]
pub(super) struct Controller {
    joints: Vec<JointLoop>,
    tuning: Tuning,
    periods_since_command: u32,
    /// Duration of the present feed-forward, periods.
    path_periods: u32,
}

/// Settings common to all joints' loops.
#[derive(Clone, Copy, Debug)]
struct Tuning {
    spec: HydraulicsSpec,
    filter_share: f64,
}

#[derive(Clone, Debug)]
struct JointLoop {
    counts_per_rad: f64,
    wrap_counts: f64,
    rate_limit_rad_s: f64,
    noise_counts: f64,
    set_counts: f64,
    /// Last accepted reading; `n_rejected` counts the rejected readings since then.
    believed_counts: f64,
    n_rejected: f64,
    filtered_counts: f64,
    feed_forward_rad_s: f64,
    /// Counter-command for the joint's creep, learnt at rest, rad/s.
    hold_rad_s: f64,
    /// Number of periods with the valve open near the set-point.
    periods_near: u32,
    /// Last command to the spool.
    spool: f64,
    play_side: f64,
    rest: Rest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rest {
    Closed,
    Open,
}

impl Controller {
    /// Starts at rest at `measured`. `gear_ratio` has one value per joint: the controller was tuned on this arm and
    /// knows the sense of the counts. Otherwise it would move joints away from their set-points.
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
            noise_counts: sensor.noise_std_counts,
            set_counts: counts,
            believed_counts: counts,
            n_rejected: 0.0,
            filtered_counts: counts,
            feed_forward_rad_s: 0.0,
            hold_rad_s: 0.0,
            periods_near: 0,
            spool: 0.0,
            play_side: 0.0,
            rest: Rest::Closed,
        });
        let share = |time_s: f64| if time_s > 0.0 { 1.0 - (-CONTROL_PERIOD_S / time_s).exp() } else { 1.0 };
        Self {
            joints: joints.collect(),
            tuning: Tuning { spec: *spec, filter_share: share(spec.controller_filter_s) },
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

    /// Returns the valve commands, -1..1, for the readings of this period.
    pub(super) fn update(&mut self, measured: &JointCounts) -> [f64; MAX_JOINTS] {
        let on_path = self.periods_since_command < self.path_periods;
        self.periods_since_command = self.periods_since_command.saturating_add(1);
        let mut commands = [0.0; MAX_JOINTS];
        for ((command, joint), &counts) in commands.iter_mut().zip(&mut self.joints).zip(measured.iter()) {
            if !on_path {
                joint.feed_forward_rad_s = 0.0;
            }
            *command = joint.update(&self.tuning, counts);
        }
        commands
    }
}

impl JointLoop {
    fn update(&mut self, tuning: &Tuning, counts: f64) -> f64 {
        let spec = &tuning.spec;
        self.believe(spec, counts);
        self.filtered_counts += tuning.filter_share * self.wrap(self.believed_counts - self.filtered_counts);
        let error_rad = self.error_rad(self.filtered_counts) + spec.controller_bias_rad;
        self.open_or_close(spec, error_rad);
        let rate = match self.rest {
            Rest::Closed => 0.0,
            Rest::Open => {
                self.integrate(spec, error_rad);
                self.wanted_rad_s(spec, error_rad)
            }
        };
        self.valve_command(spec, rate)
    }

    /// Rejects a reading that the joint cannot have reached since the last accepted one, but not too many in a row.
    fn believe(&mut self, spec: &HydraulicsSpec, counts: f64) {
        let elapsed_s = (self.n_rejected + 1.0) * CONTROL_PERIOD_S;
        let travel_rad = REACHABLE * self.rate_limit_rad_s * spec.rate_margin * elapsed_s;
        let reachable_counts = travel_rad * self.counts_per_rad.abs() + NOISE_SIGMAS * self.noise_counts;
        let is_wild = self.wrap(counts - self.believed_counts).abs() > reachable_counts;
        if is_wild && self.n_rejected < spec.controller_jump_reject {
            self.n_rejected += 1.0;
        } else {
            self.n_rejected = 0.0;
            self.believed_counts = counts;
        }
    }

    /// Closes the valve within the rest band, and opens it again for a path or beyond twice the band. The valve stays
    /// open to hold a joint against its creep.
    fn open_or_close(&mut self, spec: &HydraulicsSpec, error_rad: f64) {
        let band_rad = match self.rest {
            Rest::Closed => 2.0 * spec.rest_band_rad,
            Rest::Open => spec.rest_band_rad,
        };
        let is_there = error_rad.abs() < band_rad && self.feed_forward_rad_s == 0.0;
        if is_there && self.hold_rad_s.abs() < CREEP_RAD_S {
            self.rest = Rest::Closed;
            self.hold_rad_s = 0.0;
            self.periods_near = 0;
        } else {
            self.rest = Rest::Open;
        }
    }

    /// Integrates the error of a joint that does not arrive, because it creeps faster than the error corrects. The
    /// integral holds it from then on.
    fn integrate(&mut self, spec: &HydraulicsSpec, error_rad: f64) {
        if self.feed_forward_rad_s != 0.0 || error_rad.abs() >= FAR_BANDS * spec.rest_band_rad {
            self.periods_near = 0;
            return;
        }
        self.periods_near = self.periods_near.saturating_add(1);
        if self.hold_rad_s != 0.0 || f64::from(self.periods_near) * CONTROL_PERIOD_S > CREEP_TIME_S {
            let limit_rad_s = CREEP_LIMIT * self.rate_limit_rad_s;
            let step_rad_s = spec.controller_creep_gain * spec.controller_gain_per_s * error_rad * CONTROL_PERIOD_S;
            self.hold_rad_s = (self.hold_rad_s + step_rad_s).clamp(-limit_rad_s, limit_rad_s);
        }
    }

    fn wanted_rad_s(&self, spec: &HydraulicsSpec, error_rad: f64) -> f64 {
        let wanted = self.feed_forward_rad_s + self.hold_rad_s + spec.controller_gain_per_s * error_rad;
        wanted.clamp(-self.rate_limit_rad_s, self.rate_limit_rad_s)
    }

    /// Returns the valve's command for a rate, which compensates the deadband, and the backlash on the side to which
    /// the spool moves.
    fn valve_command(&mut self, spec: &HydraulicsSpec, rate_rad_s: f64) -> f64 {
        let share = rate_rad_s / (self.rate_limit_rad_s * spec.rate_margin);
        let spool =
            if share == 0.0 { 0.0 } else { share.signum() * (spec.deadband + (1.0 - spec.deadband) * share.abs()) };
        if spool != self.spool {
            self.play_side = (spool - self.spool).signum();
            self.spool = spool;
        }
        if spool == 0.0 { 0.0 } else { spool + 0.5 * spec.spool_hysteresis * self.play_side }
    }

    fn error_rad(&self, counts: f64) -> f64 {
        self.wrap(self.set_counts - counts) / self.counts_per_rad
    }

    fn wrap(&self, counts: f64) -> f64 {
        wrap(counts, self.wrap_counts)
    }
}

/// Returns `value` modulo `period`, in -period/2 .. period/2.
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
        let sensor = crate::fixture::exact_sensor(2600.0, 0.5);
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

    /// Returns the command after each reading, for a controller that rests at 1000 counts.
    fn commands(controller_jump_reject: f64, readings: &[f64]) -> Vec<f64> {
        let mut controller = controller(1000.0);
        controller.tuning.spec.controller_jump_reject = controller_jump_reject;
        readings.iter().map(|counts| controller.update(&JointCounts::from_slice(&[*counts]))[0]).collect()
    }

    #[test]
    fn a_reading_from_nowhere_moves_nothing() {
        let readings = [1000.0, 0.0, 0.0, 1000.0, 65_535.0, 1000.0];
        assert_eq!(commands(10.0, &readings), [0.0; 6], "a worn wiper lifts off for a moment");
        let believing = commands(0.0, &readings);
        assert!(believing[1] > 0.1 && believing[4] > 0.1, "{believing:?}");
    }

    #[test]
    fn readings_that_stay_elsewhere_are_believed_in_the_end() {
        let commands = commands(10.0, &[2000.0; 12]);
        assert_eq!(commands[..10], [0.0; 10]);
        assert!(commands[10] < -0.1 && commands[11] < -0.1, "{commands:?}");
    }

    #[test]
    fn a_joint_at_its_full_rate_is_believed() {
        let mut controller = controller(1000.0);
        let counts_a_period = 0.5 * 1.3 * 2600.0 * CONTROL_PERIOD_S;
        for period in 1..100 {
            let counts = 1000.0 + f64::from(period) * counts_a_period;
            controller.update(&JointCounts::from_slice(&[counts]));
            assert_eq!(controller.joints[0].believed_counts, counts);
        }
    }

    #[test]
    fn the_play_is_taken_up_on_the_side_that_the_spool_moves_to() {
        let mut controller = controller(1000.0);
        let mut command = |rate: f64| {
            let spec = HydraulicsSpec { spool_hysteresis: 0.02, ..HydraulicsSpec::default() };
            controller.joints[0].valve_command(&spec, rate)
        };
        let spool = |rate: f64| 0.03 + 0.97 * rate / (0.5 * 1.3);
        assert!((command(0.1) - (spool(0.1) + 0.01)).abs() < 1e-12, "opening");
        assert!((command(0.1) - (spool(0.1) + 0.01)).abs() < 1e-12, "still the same side");
        assert!((command(0.05) - (spool(0.05) - 0.01)).abs() < 1e-12, "closing");
        assert_eq!(command(0.0), 0.0);
    }
}
