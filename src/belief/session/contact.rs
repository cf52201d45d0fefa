//! Contact detection from commands and the arm's own sensors.
//!
//! A hydraulic joint is always behind its set-point: by a time that its valve takes, and, at rest, by an error from
//! load and friction. Both are properties of the arm and are learnt while it moves. A joint that stays farther off has
//! been held up, or pushed away. This is the classical test of a residual against a threshold that depends on the
//! motion. De Luca and Mattone (2003) apply it to momentum, for arms that measure torques; this arm measures only
//! angles.

use crate::session::constants::contact::{
    FIRST_LAG_S, FIRST_REST_RAD, FIRST_WEIGHT, MAX_PERIODS, MOVING, NO_TOUCH, NOISE_SIGMAS, PERSISTS_S, RATE_MEMORY_S,
    REMEMBERED, RESTING, UNUSUAL,
};
use crate::session::constants::following::REACHABLE;
use crate::session::settling::NEAR_RAD;
use armcal_core::robot::Robot;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// A deviation of a joint that only a contact explains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContactEvent {
    pub joint: usize,
    /// Difference of set-point and reading, rad.
    pub behind_rad: f64,
    /// Usual deviation at this rate times the allowed factor, rad.
    pub allowed_rad: f64,
}

/// Follows set-points and readings, one pair per control period.
#[derive(Clone, Debug)]
pub(crate) struct ContactDetector {
    period_s: f64,
    joints: Vec<JointWatch>,
}

#[derive(Clone, Debug)]
struct JointWatch {
    /// False if the joint is declared failed, or pressed against something on purpose: its readings prove nothing.
    is_watched: bool,
    max_rate_rad_s: f64,
    /// Angle of a full turn of the sensor's word, rad.
    turn_rad: f64,
    jump_rad: f64,
    /// Set-point and reading of the period before, rad.
    last: Option<(f64, f64)>,
    /// Largest recent rate of the set-point, rad/s.
    rate_rad_s: f64,
    recent_rad: [f64; MAX_PERIODS],
    next: usize,
    lag_s: AdaptiveThreshold,
    rest_rad: AdaptiveThreshold,
    /// True if its reading has jumped, and not returned.
    has_jumped: bool,
}

/// Running largest value over the edges.
#[derive(Clone, Copy, Debug)]
struct AdaptiveThreshold {
    value: f64,
    /// Largest value of this edge, if any.
    now: Option<f64>,
    edges: f64,
}

impl AdaptiveThreshold {
    fn guessed(value: f64) -> Self {
        Self { value, now: None, edges: 0.0 }
    }

    fn see(&mut self, value: f64) {
        self.now = Some(self.now.map_or(value, |now| now.max(value)));
    }

    /// Takes over the edge's value: larger values count at once, smaller ones gradually.
    fn take(&mut self) {
        let Some(now) = self.now.take() else { return };
        let share = 1.0 / (FIRST_WEIGHT + self.edges).min(REMEMBERED);
        self.value = now.max(self.value + share * (now - self.value));
        self.edges += 1.0;
    }
}

impl ContactDetector {
    pub fn new(robot: &Robot, period_s: f64) -> Self {
        let joints = robot.sensors.iter().enumerate().map(|(joint, spec)| JointWatch {
            is_watched: robot.failed.iter().all(|failed| failed.joint != joint),
            max_rate_rad_s: spec.max_rate_rad_s,
            turn_rad: spec.wrap_counts / spec.counts_per_rad.abs(),
            jump_rad: REACHABLE * spec.max_rate_rad_s * period_s
                + NOISE_SIGMAS * spec.noise_std_counts / spec.counts_per_rad.abs(),
            last: None,
            rate_rad_s: 0.0,
            recent_rad: [0.0; MAX_PERIODS],
            next: 0,
            lag_s: AdaptiveThreshold::guessed(FIRST_LAG_S),
            rest_rad: AdaptiveThreshold::guessed(FIRST_REST_RAD),
            has_jumped: false,
        });
        Self { period_s, joints: joints.collect() }
    }

    /// Takes in one period. Returns the joint that exceeds its allowed deviation most, if any.
    pub fn update(&mut self, set_point: &JointAngles, reading: &JointAngles) -> Option<ContactEvent> {
        let mut worst: Option<ContactEvent> = None;
        for (joint, watch) in self.joints.iter_mut().enumerate().take(MAX_JOINTS) {
            let Some((behind_rad, allowed_rad)) = watch.update(set_point[joint], reading[joint], self.period_s) else {
                continue;
            };
            let excess = behind_rad.abs() / allowed_rad;
            if worst.is_none_or(|worst| excess > worst.behind_rad.abs() / worst.allowed_rad) {
                worst = Some(ContactEvent { joint, behind_rad, allowed_rad });
            }
        }
        worst
    }

    /// Learns the deviations of a finished motion without a contact as usual.
    pub fn learn(&mut self) {
        for watch in &mut self.joints {
            watch.lag_s.take();
            watch.rest_rad.take();
        }
    }

    /// Forgets the deviations of a contact; the joints start again from their present state.
    pub fn forget(&mut self) {
        for watch in &mut self.joints {
            (watch.lag_s.now, watch.rest_rad.now) = (None, None);
            (watch.last, watch.recent_rad, watch.rate_rad_s) = (None, [0.0; MAX_PERIODS], 0.0);
        }
    }
}

impl JointWatch {
    /// Returns the deviation and the allowed deviation, rad, if the first has exceeded the second for long enough.
    fn update(&mut self, set_rad: f64, reading_rad: f64, period_s: f64) -> Option<(f64, f64)> {
        if !self.is_watched {
            return None;
        }
        let short_way = |way_rad: f64| way_rad - self.turn_rad * (way_rad / self.turn_rad).round();
        let behind_rad = short_way(set_rad - reading_rad);
        let (rate_rad_s, leap_rad) = match self.last {
            None => (0.0, 0.0),
            Some((set_before, reading_before)) => {
                (short_way(set_rad - set_before).abs() / period_s, short_way(reading_rad - reading_before).abs())
            }
        };
        self.last = Some((set_rad, reading_rad));
        let faded = self.rate_rad_s * (-period_s / RATE_MEMORY_S).exp();
        self.rate_rad_s = rate_rad_s.max(faded);
        let lasting_rad = self.lasting_rad(behind_rad, period_s);
        let usual_rad = self.lag_s.value * self.rate_rad_s + self.rest_rad.value;
        let allowed_rad = (UNUSUAL * usual_rad).max(NO_TOUCH * NEAR_RAD);
        self.has_jumped = (self.has_jumped || leap_rad > self.jump_rad) && behind_rad.abs() > 0.5 * allowed_rad;
        if self.has_jumped {
            return None;
        }
        if lasting_rad.abs() > allowed_rad {
            return Some((behind_rad, allowed_rad));
        }
        self.see(lasting_rad.abs());
        None
    }

    /// Returns the least deviation over the last periods if all have the same sign, rad; otherwise 0.
    fn lasting_rad(&mut self, behind_rad: f64, period_s: f64) -> f64 {
        let periods = ((PERSISTS_S / period_s).round() as usize).clamp(1, MAX_PERIODS);
        self.recent_rad[self.next % periods] = behind_rad;
        self.next = (self.next + 1) % periods;
        let recent = &self.recent_rad[..periods];
        let (low, high) =
            recent.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
        if low > 0.0 {
            low
        } else if high < 0.0 {
            high
        } else {
            0.0
        }
    }

    fn see(&mut self, off_rad: f64) {
        if self.rate_rad_s > MOVING * self.max_rate_rad_s {
            self.lag_s.see((off_rad - self.rest_rad.value).max(0.0) / self.rate_rad_s);
        } else if self.rate_rad_s < RESTING * self.max_rate_rad_s {
            self.rest_rad.see(off_rad);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::robot::{FailedJoint, FailedKind};
    use armcal_core::stats::stream_rng;
    use rand_distr::{Distribution, StandardNormal};

    const PERIOD_S: f64 = 0.01;
    const LAG_S: f64 = 0.12;
    const WAY_RAD: f64 = 0.8;

    fn titan() -> Robot {
        let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
        armcal_core::robot::load(&folder).expect("the robot reads")
    }

    /// A simulated arm whose joint 0 follows with a lag, to and fro, with noisy readings; a callback acts on it in each
    /// period.
    struct Bench {
        watch: ContactDetector,
        rng: rand_chacha::ChaCha8Rng,
        joint_rad: f64,
        noise_rad: f64,
    }

    impl Bench {
        fn new(robot: &Robot, seed: u64) -> Self {
            let rng = stream_rng(seed, "bump");
            Self { watch: ContactDetector::new(robot, PERIOD_S), rng, joint_rad: 0.0, noise_rad: 0.001 }
        }

        /// Runs one edge at `rate_rad_s` and a rest; `act` changes the joint and the reading after each period. Returns
        /// the time of a detected contact, s.
        fn edge(&mut self, to: f64, rate_rad_s: f64, mut act: impl FnMut(f64, &mut f64, &mut f64)) -> Option<f64> {
            let from = WAY_RAD - to;
            let duration_s = WAY_RAD / rate_rad_s;
            for k in 1..=((duration_s + 1.0) / PERIOD_S) as u32 {
                let t_s = f64::from(k) * PERIOD_S;
                let u = (t_s / duration_s).min(1.0);
                let set = from + (to - from) * u * u * (3.0 - 2.0 * u);
                self.joint_rad += (set - self.joint_rad) * PERIOD_S / LAG_S;
                let noise: f64 = StandardNormal.sample(&mut self.rng);
                let mut reading = self.joint_rad + self.noise_rad * noise;
                act(t_s, &mut self.joint_rad, &mut reading);
                let angles = |value: f64| JointAngles::from_fn(6, |j| if j == 0 { value } else { 0.1 });
                if self.watch.update(&angles(set), &angles(reading)).is_some() {
                    self.watch.forget();
                    return Some(t_s);
                }
            }
            self.watch.learn();
            None
        }

        fn warmed(robot: &Robot, seed: u64) -> Self {
            let mut bench = Self::new(robot, seed);
            for n in 0..6 {
                let to = if n % 2 == 0 { WAY_RAD } else { 0.0 };
                assert_eq!(bench.edge(to, [0.3, 0.15, 0.22][n % 3], |_, _, _| {}), None, "edge {n}");
            }
            bench
        }
    }

    #[test]
    fn a_joint_that_is_held_up_is_noticed_within_tenths_of_a_second_and_a_free_one_never() {
        let robot = titan();
        for seed in 1..=40 {
            let mut bench = Bench::warmed(&robot, seed);
            assert_eq!(bench.edge(WAY_RAD, 0.3, |_, _, _| {}), None);
            // An obstacle stands at 0.4 rad; the joint reaches it at its highest rate.
            let mut touched_s = None;
            let found_s = bench.edge(0.0, 0.3, |t_s, joint, reading| {
                if *joint < 0.4 {
                    touched_s = touched_s.or(Some(t_s));
                    *reading += 0.4 - *joint;
                    *joint = 0.4;
                }
            });
            let after_s = found_s.expect("noticed") - touched_s.expect("it touches");
            assert!((0.08..0.5).contains(&after_s), "{after_s}");
        }
    }

    #[test]
    fn a_joint_that_is_pushed_off_at_rest_is_noticed() {
        let robot = titan();
        for seed in 1..=20 {
            let mut bench = Bench::warmed(&robot, seed);
            let rest_s = WAY_RAD / 0.3 + 0.5;
            let found_s = bench.edge(WAY_RAD, 0.3, |t_s, _, reading| {
                if t_s > rest_s {
                    *reading -= (0.5 * (t_s - rest_s)).min(0.1);
                }
            });
            assert!(found_s.expect("noticed") < rest_s + 0.4, "{found_s:?}");
        }
    }

    /// Wild readings, a slipping sensor and a faster motion than any before are not taken for a contact.
    #[test]
    fn what_is_no_touch_is_not_taken_for_one() {
        let robot = titan();
        for seed in 1..=20 {
            let mut bench = Bench::warmed(&robot, seed);
            let spikes = |t_s: f64, _: &mut f64, reading: &mut f64| {
                if (t_s * 100.0) as u32 % 40 < 5 {
                    *reading += 0.5;
                }
            };
            assert_eq!(bench.edge(WAY_RAD, 0.3, spikes), None, "spikes");
            let slip = |t_s: f64, _: &mut f64, reading: &mut f64| {
                if t_s > 1.0 {
                    *reading += 0.3 * (-(t_s - 1.0) / 0.3).exp();
                }
            };
            assert_eq!(bench.edge(0.0, 0.3, slip), None, "a slip that the loop takes back");
            assert_eq!(bench.edge(WAY_RAD, 0.4, |_, _, _| {}), None, "faster than ever before");
        }
    }

    #[test]
    fn a_joint_that_is_declared_failed_is_not_watched() {
        for kind in FailedKind::ALL {
            let robot = titan().with_failed(&[FailedJoint { joint: 0, kind }]);
            let mut bench = Bench::new(&robot, 1);
            assert_eq!(bench.edge(WAY_RAD, 0.3, |_, joint, reading| (*joint, *reading) = (0.0, 0.0)), None);
        }
        let mut bench = Bench::new(&titan(), 1);
        assert!(bench.edge(WAY_RAD, 0.3, |_, joint, reading| (*joint, *reading) = (0.0, 0.0)).is_some());
    }
}
