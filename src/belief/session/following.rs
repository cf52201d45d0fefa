//! Detects joints that do not follow their set-points, only from the raw reading.
//!
//! A contact stops a joint that was moving; three failures differ from it. `stuck`: the reading stays the same to the
//! count while the set-point leaves, though a live sensor is noisy. `dead`: the reading jumped farther than any joint
//! turns and stands still there, away from the set-point. `locked`: the joint has stood at its rest since before the
//! set-point left. A joint in cold oil starts late, so `locked` takes three suspected contacts and a long way of the
//! set-point. At the third the joint is probed: the contact is ignored until it moves or has not.

use crate::session::constants::following::{
    DECISIVE_OVER_NOISE, DECISIVE_RAD, FLICKERS, LEAPT_S, LEFT_RAD, LONG_STILL_S, NOISE_SIGMAS, NOISY_COUNTS,
    REACHABLE, REST_S, SAME_S, SET_STANDS_COUNTS, SUSPECTED,
};
use crate::session::constants::settling::NEAR_RAD;
use armcal_core::robot::{FailedKind, Robot};
use armcal_core::sensor::wrap_symmetric;
use armcal_core::streams::JointCounts;

/// A joint whose reading stands still although it was commanded to move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unmoved {
    /// Index, base first.
    pub joint: usize,
    /// Time since the reading last moved, s.
    pub still_s: f64,
    /// Farthest that the set-point was from the reading since, rad; m for a slide.
    pub asked_rad: f64,
}

/// Follows set-points and raw readings, one pair per control period.
pub(crate) struct FollowWatch {
    period_s: f64,
    joints: Vec<JointFollow>,
}

struct JointFollow {
    wrap_counts: f64,
    noise_counts: f64,
    /// Largest difference of readings at rest, counts.
    rest_counts: f64,
    /// Largest step of a reading in one period, counts.
    leap_counts: f64,
    counts_per_rad: f64,
    /// Reading and set-point of the period before, counts.
    last: Option<(f64, f64)>,
    /// Farthest that the set-point was from the reading while it stands still, counts.
    asked_counts: f64,
    same_s: f64,
    /// Set-point when the reading began to stay the same, counts.
    set_at_same: f64,
    /// Reading about which it stands still, counts, and the duration, s.
    anchor: f64,
    still_s: f64,
    set_still_s: f64,
    has_leapt: bool,
    has_rested: bool,
    /// Set-point at that rest, counts.
    set_at_rest: f64,
    /// Number of contacts suspected since.
    n_suspected: u32,
    /// Number of periods at rest in which the reading changed.
    n_flickers: u32,
}

impl FollowWatch {
    pub(crate) fn new(robot: &Robot, period_s: f64) -> Self {
        let joints = robot.sensors.iter().map(|spec| {
            let counts_per_rad = spec.counts_per_rad.abs();
            JointFollow {
                wrap_counts: spec.wrap_counts,
                noise_counts: spec.noise_std_counts,
                rest_counts: NOISE_SIGMAS * spec.noise_std_counts + 2.0,
                leap_counts: REACHABLE * spec.max_rate_rad_s * period_s * counts_per_rad
                    + NOISE_SIGMAS * spec.noise_std_counts,
                counts_per_rad,
                last: None,
                asked_counts: 0.0,
                same_s: 0.0,
                set_at_same: 0.0,
                anchor: 0.0,
                still_s: 0.0,
                set_still_s: 0.0,
                has_leapt: false,
                has_rested: false,
                set_at_rest: 0.0,
                n_suspected: 0,
                n_flickers: 0,
            }
        });
        Self { period_s, joints: joints.collect() }
    }

    /// Takes in one period. Returns a joint whose sensor has failed by now.
    pub(crate) fn update(&mut self, set_point: &JointCounts, word: &JointCounts) -> Option<(usize, FailedKind)> {
        let mut failed = None;
        for (joint, watch) in self.joints.iter_mut().enumerate() {
            let kind = watch.update(set_point[joint], word[joint], self.period_s);
            failed = failed.or(kind.map(|kind| (joint, kind)));
        }
        failed
    }

    /// True if `joint` has stood still since it was at rest at its set-point.
    #[cfg(test)]
    pub(crate) fn has_not_moved(&self, joint: usize) -> bool {
        self.joints[joint].has_rested
    }

    /// Returns a joint whose reading has long stood still although its set-point went far.
    pub(crate) fn unmoved(&self) -> Option<Unmoved> {
        let asked = |watch: &JointFollow| watch.asked_counts / watch.counts_per_rad;
        let stands = |watch: &JointFollow| watch.still_s > LONG_STILL_S && asked(watch) > DECISIVE_RAD;
        let joint = self.joints.iter().position(stands)?;
        let watch = &self.joints[joint];
        Some(Unmoved { joint, still_s: watch.still_s, asked_rad: asked(watch) })
    }

    /// True if `joint` stands still because it is locked.
    pub(crate) fn is_locked(&self, joint: usize) -> bool {
        self.joints[joint].is_locked()
    }

    /// Notes that `joint` is suspected to be in contact.
    pub(crate) fn suspect(&mut self, joint: usize) {
        let watch = &mut self.joints[joint];
        watch.n_suspected += u32::from(watch.has_rested);
    }

    /// True if `joint` continues in spite of a contact, until it has moved or proves to be locked.
    pub(crate) fn is_probed(&self, joint: usize) -> bool {
        let watch = &self.joints[joint];
        watch.has_rested && watch.n_suspected >= SUSPECTED && !watch.is_locked()
    }
}

impl JointFollow {
    fn is_locked(&self) -> bool {
        let gone_counts =
            self.last.map_or(0.0, |(set, _)| wrap_symmetric(set - self.set_at_rest, self.wrap_counts).abs());
        self.has_rested
            && gone_counts > (DECISIVE_RAD * self.counts_per_rad).max(DECISIVE_OVER_NOISE * self.rest_counts)
    }

    fn update(&mut self, set: f64, word: f64, period_s: f64) -> Option<FailedKind> {
        let Some((last_set, last_word)) = self.last.replace((set, word)) else {
            (self.set_at_same, self.anchor) = (set, word);
            return None;
        };
        let apart = |a: f64, b: f64| wrap_symmetric(a - b, self.wrap_counts).abs();
        let (off_counts, leap_counts) = (apart(set, word), apart(word, last_word));
        let left_counts = apart(set, self.set_at_same);
        let (moved_counts, near_counts) = (apart(word, self.anchor), NEAR_RAD * self.counts_per_rad);
        let set_stands = apart(set, last_set) < SET_STANDS_COUNTS;
        (self.same_s, self.set_at_same) =
            if word == last_word { (self.same_s + period_s, self.set_at_same) } else { (0.0, set) };
        self.set_still_s = if set_stands { self.set_still_s + period_s } else { 0.0 };
        if moved_counts > self.rest_counts {
            (self.anchor, self.still_s, self.has_rested, self.n_suspected) = (word, 0.0, false, 0);
            self.asked_counts = 0.0;
        }
        self.asked_counts = self.asked_counts.max(off_counts);
        self.still_s += period_s;
        self.has_leapt = (self.has_leapt || leap_counts > self.leap_counts) && off_counts > self.leap_counts;
        self.n_flickers += u32::from(self.set_still_s > REST_S && word != last_word);
        if self.still_s.min(self.set_still_s) > REST_S && off_counts < near_counts {
            (self.has_rested, self.set_at_rest) = (true, set);
        }
        if self.has_leapt && self.still_s > LEAPT_S {
            return Some(FailedKind::Dead);
        }
        let is_noisy = self.noise_counts >= NOISY_COUNTS && self.n_flickers > FLICKERS;
        let is_same = is_noisy && self.same_s > SAME_S;
        (is_same && left_counts > LEFT_RAD * self.counts_per_rad).then_some(FailedKind::Stuck)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::stream_rng;
    use rand_distr::{Distribution, StandardNormal};

    const PERIOD_S: f64 = 0.01;
    const JOINT: usize = 2;

    /// Simulates an edge of 0.5 rad at 0.25 rad/s after a rest; `word` makes the reading from the exact one.
    fn told(seed: u64, mut word: impl FnMut(f64, f64) -> f64) -> (Option<(f64, FailedKind)>, bool) {
        let robot = crate::fixture::titan();
        let spec = &robot.sensors[JOINT];
        let mut watch = FollowWatch::new(&robot, PERIOD_S);
        let mut rng = stream_rng(seed, "following");
        let mut at = 0.0;
        let quiet = |counts: f64| {
            let mut words = [2000.0; 6];
            words[JOINT] = counts;
            JointCounts::from_slice(&words)
        };
        for k in 0..450 {
            let t_s = f64::from(k) * PERIOD_S;
            let set = 2000.0 + spec.counts_per_rad * (0.25 * (t_s - 1.0)).clamp(0.0, 0.5);
            at += (set - 2000.0 - at) * PERIOD_S / 0.12;
            let noise: f64 = StandardNormal.sample(&mut rng);
            let exact = (2000.0 + at + spec.noise_std_counts * noise).round();
            if let Some((joint, kind)) = watch.update(&quiet(set), &quiet(word(t_s, exact))) {
                assert_eq!(joint, JOINT);
                return (Some((t_s, kind)), watch.has_not_moved(JOINT));
            }
        }
        (None, watch.has_not_moved(JOINT))
    }

    #[test]
    fn a_joint_that_does_not_follow_is_told_from_one_that_is_held_up_or_slips() {
        for seed in 1..=20 {
            assert_eq!(told(seed, |_, word| word), (None, true), "it has come to rest");
            let mut last = 0.0;
            let stuck = told(seed, |t_s, word| {
                last = if t_s < 0.8 { word } else { last };
                last
            });
            assert!(matches!(stuck.0, Some((at_s, FailedKind::Stuck)) if at_s < 1.3), "{stuck:?}");
            let dead = told(seed, |t_s, word| if t_s < 0.8 { word } else { 0.0 });
            assert!(matches!(dead.0, Some((at_s, FailedKind::Dead)) if at_s < 1.2), "{dead:?}");
            // Locked joint: noise continues, and the joint stands.
            let mut first = None;
            let locked = told(seed, |t_s, word| {
                let here = *first.get_or_insert(word);
                if t_s < 1.0 { word } else { here + (word * 7.0).rem_euclid(3.0) - 1.0 }
            });
            assert_eq!(locked, (None, true));
            // Spikes, and a slip that the controller corrects.
            let spikes = |t_s: f64, word: f64| if (t_s * 100.0) as u32 % 40 < 5 { word + 500.0 } else { word };
            assert_eq!(told(seed, spikes).0, None);
            let slip = |t_s: f64, word: f64| if t_s > 1.5 { word + 300.0 * (1.5 - t_s).exp() } else { word };
            assert_eq!(told(seed, slip).0, None);
        }
    }

    #[test]
    fn a_joint_whose_reading_has_long_stood_still_is_named_and_no_other() {
        let robot = crate::fixture::titan();
        for stands in [true, false] {
            let mut watch = FollowWatch::new(&robot, PERIOD_S);
            for k in 0..4000 {
                // To and fro, with a reading that stops within the first second or follows.
                let ramp = |k: i32| robot.sensors[JOINT].counts_per_rad * 0.3 * (0.002 * f64::from(k)).sin();
                let with = |value: f64| JointCounts::from_fn(6, |j| if j == JOINT { 2000.0 + value } else { 2000.0 });
                let word = with(if stands { ramp(k.min(40)) + f64::from(k % 2) } else { ramp(k - 10) });
                assert_eq!(watch.update(&with(ramp(k)), &word), None, "noise was not seen at rest");
            }
            let unmoved = watch.unmoved().map(|found| (found.joint, (10.0 * found.asked_rad).round()));
            assert_eq!(unmoved, stands.then_some((JOINT, 3.0)));
        }
    }

    #[test]
    fn a_joint_that_is_stopped_on_its_way_has_moved() {
        let mut stopped = None;
        let (failed, has_not_moved) = told(1, |t_s, word| {
            let noise = (word * 7.0).rem_euclid(5.0) - 2.0;
            if t_s < 2.0 { word } else { *stopped.get_or_insert(word) + noise }
        });
        assert_eq!((failed, has_not_moved), (None, false));
    }
}
