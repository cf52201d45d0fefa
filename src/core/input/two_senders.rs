//! Two senders of the same joints on one topic: the readings go back and forth between the values of both.
//!
//! Two senders that agree are no harm, and a moving arm is compared with itself only where it hardly moves.

use super::error::InputError;
use super::map::InputMap;
use super::recording::ExternalRecording;
use crate::robot::Robot;
use crate::time::Stamp;

/// Readings in a row that are compared. Assumed: two senders at rates up to 1 to 5 take turns often enough in them.
const N_TOGETHER: usize = 12;
/// Longest duration of such a group of readings, s: an arm that moves between two poses takes longer. Assumed.
const TOGETHER_S: f64 = 1.0;
/// Least number of changes from one value to the other in such a group. Assumed: noise and single faults make fewer.
const MIN_CHANGES: usize = 4;
/// Distance of the two values over the spread of the readings at each. Assumed: noise stays far below.
const OVER_SPREAD: f64 = 4.0;
/// Distance of the two values over the smallest step that the joint ever made: its resolution, at which it may flicker.
const OVER_STEP: f64 = 3.0;
/// Senders that are nearer to each other count as one, rad or m. Assumed: coarse readings of one sensor.
const LEAST_APART: f64 = 5e-3;
/// Distance of the two values over the sensor's noise, standard deviations.
const OVER_NOISE: f64 = 6.0;
/// Share of the groups of readings that show two values, and their least number. Assumed.
const MIN_SHARE: f64 = 0.1;
const MIN_GROUPS: usize = 3;
/// No joint of an arm is faster, rad/s or m/s: 1700 deg/s. Assumed.
const MAX_SPEED: f64 = 30.0;
/// A leap is at least so large, rad or m. Assumed: smaller steps come from stamps that are rounded or late.
const MIN_LEAP: f64 = 0.1;
/// Share of the readings before a leap that does not last, and their least number. Assumed: rare faults are fewer.
const MIN_LEAPS_SHARE: f64 = 0.05;
const MIN_LEAPS: usize = 5;
/// Differences below it are of rounding, rad or m.
const ROUNDING: f64 = 1e-9;

/// One joint's values by two senders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoSenders {
    /// Difference between the two senders' values, rad or m.
    pub apart: f64,
    /// Time between two readings that differ so, s.
    pub within_s: f64,
}

/// Senders that differ, by one joint's readings in the order of time, rad or m.
///
/// `least` is the smallest difference that counts, `turn` that of readings at the same angle.
#[must_use]
pub fn two_senders(stamps: &[Stamp], values: &[f64], least: f64, turn: Option<f64>) -> Option<TwoSenders> {
    let step = |k: usize| less_turns(values[k + 1] - values[k], turn);
    let n_steps = values.len().min(stamps.len()).saturating_sub(1);
    let smallest = (0..n_steps).map(|k| step(k).abs()).filter(|size| *size > ROUNDING).fold(f64::INFINITY, f64::min);
    let least = least.max(LEAST_APART).max(if smallest.is_finite() { OVER_STEP * smallest } else { 0.0 });
    let groups = stamps.chunks_exact(N_TOGETHER).zip(values.chunks_exact(N_TOGETHER));
    let together = groups.filter(|(at, _)| at[N_TOGETHER - 1].since_s(at[0]) <= TOGETHER_S);
    let found: Vec<Option<TwoSenders>> = together.map(|(at, values)| two_values(at, values, least, turn)).collect();
    let n = found.iter().flatten().count();
    if n >= MIN_GROUPS && n as f64 >= MIN_SHARE * found.len() as f64 {
        return found.into_iter().flatten().next();
    }
    leaps(&stamps[..stamps.len().min(n_steps + 1)], step)
}

/// Checks all joints that the robot needs, in the recording's own topic. The error states the joint with the largest
/// difference between its senders.
///
/// # Errors
/// [`InputError::TwoSenders`].
pub(super) fn check_senders(
    (file, topic): (&str, &str),
    map: &InputMap,
    robot: &Robot,
    recording: &ExternalRecording,
) -> Result<(), InputError> {
    let readings = &recording.readings;
    let stamps: Vec<Stamp> = readings.iter().map(|reading| reading.stamp).collect();
    let of_joint = |joint: usize| {
        let spec = &robot.sensors[joint];
        let angles: Vec<f64> = readings.iter().map(|reading| reading.counts[joint] / spec.counts_per_rad).collect();
        let least = OVER_NOISE * (spec.noise_std_counts / spec.counts_per_rad).abs();
        // Counts jump by this much where the sensor wraps.
        let wrap_rad = (spec.wrap_counts / spec.counts_per_rad).abs();
        let turn = (!spec.moves.is_slide()).then_some(wrap_rad.min(std::f64::consts::TAU));
        Some((joint, two_senders(&stamps, &angles, least, turn)?))
    };
    let found = (0..super::joints::n_needed(robot)).filter_map(of_joint);
    match found.max_by(|(_, a), (_, b)| a.apart.total_cmp(&b.apart)) {
        None => Ok(()),
        Some((joint, TwoSenders { apart, within_s })) => {
            let spec = &robot.sensors[joint];
            let (joint, is_slide) = (map.recorded_name(&spec.joint).clone(), spec.moves.is_slide());
            let (file, topic) = (file.to_owned(), topic.to_owned());
            Err(InputError::TwoSenders { file, topic, joint, apart, is_slide, within_s })
        }
    }
}

fn less_turns(step: f64, turn: Option<f64>) -> f64 {
    turn.map_or(step, |turn| step - turn * (step / turn).round())
}

/// The two values between which a few readings in a row go back and forth.
fn two_values(stamps: &[Stamp], values: &[f64], least: f64, turn: Option<f64>) -> Option<TwoSenders> {
    let from_first: Vec<f64> = values.iter().map(|value| less_turns(value - values[0], turn)).collect();
    let mut sorted = from_first.clone();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len() - 1;
    let (at, apart) = (0..last).map(|k| (k, sorted[k + 1] - sorted[k])).max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    let spread = (sorted[at] - sorted[0]).max(sorted[last] - sorted[at + 1]);
    let is_low = |k: usize| from_first[k] <= sorted[at];
    let changes: Vec<usize> = (0..last).filter(|&k| is_low(k) != is_low(k + 1)).collect();
    if apart < least || apart <= OVER_SPREAD * spread || changes.len() < MIN_CHANGES {
        return None;
    }
    let within_s = changes.iter().map(|&k| stamps[k + 1].since_s(stamps[k])).fold(f64::INFINITY, f64::min);
    Some(TwoSenders { apart, within_s })
}

/// The first of many leaps that no joint makes, and that the reading before or after takes back.
fn leaps(stamps: &[Stamp], step: impl Fn(usize) -> f64) -> Option<TwoSenders> {
    let n_steps = stamps.len().saturating_sub(1);
    let is_back = |k: usize, leap: f64| step(k) * leap < 0.0 && step(k).abs() >= 0.5 * leap.abs();
    let leap = |k: usize| {
        let (leap, within_s) = (step(k), stamps[k + 1].since_s(stamps[k]));
        let is_leap = leap.abs() >= MIN_LEAP && leap.abs() > MAX_SPEED * within_s;
        let is_taken_back = || (k > 0 && is_back(k - 1, leap)) || (k + 1 < n_steps && is_back(k + 1, leap));
        (is_leap && is_taken_back()).then(|| TwoSenders { apart: leap.abs(), within_s })
    };
    let found: Vec<TwoSenders> = (0..n_steps).filter_map(leap).collect();
    let is_often = found.len() >= MIN_LEAPS && found.len() as f64 >= MIN_LEAPS_SHARE * stamps.len() as f64;
    found.into_iter().next().filter(|_| is_often)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    const TURN: Option<f64> = Some(std::f64::consts::TAU);

    /// Time and angle of an arm that goes from pose to pose and rests 1.2 s at each, at 50 Hz.
    fn stream(seed: u64, noise_rad: f64, tick_rad: f64) -> Vec<(f64, f64)> {
        let mut rng = crate::stats::stream_rng(seed, "two senders");
        let mut last = 0.3;
        let mut found = Vec::new();
        for pose in 0..20 {
            let next = rng.random_range(-1.5..1.5);
            for k in 0..100 {
                let part = (f64::from(k) / 40.0).min(1.0);
                let noise = noise_rad * rng.random_range(-1.7..1.7);
                let angle = last + (next - last) * part * part * (3.0 - 2.0 * part) + noise;
                let angle = if tick_rad > 0.0 { (angle / tick_rad).round() * tick_rad } else { angle };
                found.push((2.0 * f64::from(pose) + 0.02 * f64::from(k), angle));
            }
            last = next;
        }
        found
    }

    #[test]
    fn a_stream_without_readings_has_no_senders() {
        assert_eq!(told(Vec::new()), None);
        assert_eq!(told(vec![(0.0, 0.3)]), None);
    }

    fn told(mut readings: Vec<(f64, f64)>) -> Option<TwoSenders> {
        readings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (times, values): (Vec<f64>, Vec<f64>) = readings.into_iter().unzip();
        let stamps: Vec<Stamp> = times.into_iter().map(|time_s| Stamp::default().plus_s(100.0 + time_s)).collect();
        two_senders(&stamps, &values, 0.0, TURN)
    }

    #[test]
    fn one_sender_passes_fast_noisy_coarse_wrapped_or_sent_twice() {
        for seed in 0..8 {
            for (noise_rad, tick_rad) in [(1e-5, 0.0), (0.02, 0.0), (1e-3, 1.6e-3), (0.004, 0.01), (0.0, 0.01)] {
                let one = stream(seed, noise_rad, tick_rad);
                assert_eq!(told(one.clone()), None, "{seed}, {noise_rad}, {tick_rad}");
                let twice = |late_s: f64| one.iter().flat_map(|&(t, x)| [(t, x), (t + late_s, x)]).collect::<Vec<_>>();
                assert_eq!(told(twice(0.0)), None, "{seed}, sent twice");
                assert_eq!(told(twice(0.009)), None, "{seed}, sent again later");
                let coarse = one.iter().map(|&(t, x)| (t.floor(), x)).collect();
                assert_eq!(told(coarse), None, "{seed}, stamps in whole seconds");
                let wrapped = one.iter().map(|&(t, x)| (t, (x + 3.2).rem_euclid(std::f64::consts::TAU))).collect();
                assert_eq!(told(wrapped), None, "{seed}, wrapped");
            }
            // One reading for each pose, home between them.
            let home = (0..40).map(|k| (2.0 * f64::from(k), if k % 2 == 0 { 0.0 } else { 1.2 })).collect();
            assert_eq!(told(home), None);
        }
    }

    #[test]
    fn two_senders_that_differ_are_told_at_any_of_their_rates() {
        for seed in 0..8 {
            let one = stream(seed, 1e-5, 0.0);
            for (late_s, bias_rad) in [(0.001, 0.02), (0.01, 0.012), (0.01, -0.3)] {
                let other = one.iter().map(|&(t, x)| (t + late_s, x + bias_rad));
                let found = told(one.iter().copied().chain(other).collect()).expect("two senders");
                assert!((found.apart - f64::abs(bias_rad)).abs() < 5e-3, "{seed}: {found:?}");
                assert!(found.within_s <= late_s + 1e-6, "{seed}: {found:?}");
            }
            let zeros = |every: usize, late_s: f64| one.iter().step_by(every).map(move |&(t, _)| (t + late_s, 0.0));
            assert!(told(one.iter().copied().chain(zeros(5, 0.0)).collect()).is_some(), "{seed}: at the same stamps");
            // One message of each sender for each pose.
            let poses: Vec<(f64, f64)> = one.iter().skip(90).step_by(100).copied().collect();
            let zeros = poses.iter().map(|&(t, _)| (t + 0.005, 0.0));
            assert!(told(poses.iter().copied().chain(zeros).collect()).is_some(), "{seed}: at poses");
        }
    }
}
