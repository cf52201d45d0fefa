//! Comparison of a joint's readings with the angles that the camera shows.

pub(crate) use crate::explain::constants::failure_pattern::MIN_STILL_VIEWS;
use crate::explain::constants::failure_pattern::{
    ALL_ALIKE, FLOOR_RAD, FOLLOWS, LEAST_GAIN_STD, LOCKED_RAD, LOCKED_SIGMAS, LOST_SHARE, MAX_SINGLE, MIN_BACK,
    MIN_LOST, MIN_SIDE, MOVED_RAD, REFITS, RIGHT_SIGMAS, ROUNDS, STEP_LEAVES, STEP_SIGMAS, STILL_SIGMAS, STRAIGHT,
    STUCK_SIGMAS, WHOLE_TURN_RAD,
};
use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector3};

use crate::explain::failures::{FAR_RAD, FAR_SIGMAS, SensorLine, SensorUse, slip_in_words};
use crate::say;
use crate::solve::estimate::Estimate;
use crate::views::constants::external_board::SIGMA_OF_MEDIAN;
use crate::views::view::View;
use armcal_core::robot::{FailedKind, JointSensorSpec, Robot};
use armcal_core::sensor::wrap_symmetric;
use armcal_core::stats::quantile;

/// Readings and angles of one joint over the views that show tags, in the order of time.
pub(crate) struct Readings {
    joint: usize,
    view_idx: Vec<usize>,
    travel_rad: Vec<f64>,
    /// Angle by the camera, with its standard deviation in `std_rad`.
    angle_rad: Vec<f64>,
    std_rad: Vec<f64>,
}

/// Relation of a joint's readings to its angles.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum FailurePattern {
    /// The angle is always the same: the joint is locked if its reading moves, else it was not moved.
    Still(FailedKind, SensorUse),
    /// The reading is the same in this number of views up to the last; the angle is not.
    Stuck(usize),
    /// Readings and angles are unrelated.
    Dead,
    /// The readings go the other way, along a line.
    Reversed(SensorLine),
    /// The readings follow a line of a slope that no sensor of the datasheet has.
    Scaled(SensorLine),
    /// The readings of these views are wrong.
    Single(Vec<usize>),
    /// Nearly all readings from one view up to the end are wrong, `n_off` in number.
    Lost { since: usize, n_off: usize },
    /// The readings from one view on differ by a constant step from those before it, rad.
    Lasting { since: usize, step_rad: f64 },
}

/// Number of the last readings that are the same except for noise.
pub(crate) fn n_still(travel_rad: &[f64], spec: &JointSensorSpec) -> usize {
    let span_rad = STILL_SIGMAS * spec.noise_std_counts / spec.counts_per_rad.abs();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let is_same = |travel_rad: &&f64| {
        (low, high) = (low.min(**travel_rad), high.max(**travel_rad));
        high - low <= span_rad
    };
    travel_rad.iter().rev().take_while(is_same).count()
}

impl Readings {
    /// Readings and angles by an estimate in which the joint is free in all views.
    pub(crate) fn new(robot: &Robot, views: &[View], joint: usize, found: &Estimate<'_>) -> Self {
        let mut seen: Vec<usize> = (0..views.len()).filter(|&k| found.uses(k)).collect();
        seen.sort_by_key(|&k| (views[k].end, k));
        let angles: Vec<(f64, f64)> = seen.iter().map(|&k| found.angle(k, joint)).collect();
        debug_assert!(joint < robot.n_joints());
        let travel_rad: Vec<f64> = seen.iter().map(|&k| views[k].travel_rad[joint]).collect();
        let mut angle_rad: Vec<f64> = angles.iter().map(|(angle, _)| *angle).collect();
        let spec = &robot.sensors[joint];
        if !spec.moves.is_slide() && spec.half_range_rad > PI - WHOLE_TURN_RAD {
            on_one_turn(&mut angle_rad[travel_rad.len() - n_still(&travel_rad, spec)..]);
        }
        Self { joint, travel_rad, angle_rad, std_rad: angles.iter().map(|(_, std)| *std).collect(), view_idx: seen }
    }

    pub(crate) fn joint(&self) -> usize {
        self.joint
    }

    pub(crate) fn len(&self) -> usize {
        self.view_idx.len()
    }

    /// Pattern of the readings; `None` if they follow the angles as they should.
    pub(crate) fn pattern(&self, robot: &Robot) -> Option<FailurePattern> {
        let spec = &robot.sensors[self.joint];
        let noise_rad = FAR_SIGMAS * spec.noise_std_counts / spec.counts_per_rad.abs();
        let spread_rad = deviation(&self.angle_rad);
        let own_rad = rms(&self.std_rad);
        if spread_rad < LOCKED_RAD.max(LOCKED_SIGMAS * own_rad) {
            let moves = deviation(&self.travel_rad) > noise_rad;
            let kind = if moves { FailedKind::Locked } else { FailedKind::NotMoved };
            let is_right = !moves && self.is_as_stated(robot);
            return Some(FailurePattern::Still(kind, if is_right { SensorUse::Used } else { SensorUse::Ignored }));
        }
        let n_still = n_still(&self.travel_rad, spec);
        let shown_rad = deviation(&self.angle_rad[self.len() - n_still..]);
        if n_still >= MIN_STILL_VIEWS && n_still < self.len() && shown_rad > STUCK_SIGMAS * own_rad.max(LOCKED_RAD) {
            return Some(FailurePattern::Stuck(n_still));
        }
        if deviation(&self.travel_rad) < noise_rad {
            let counts = (spec.offset_counts
                + spec.counts_per_rad * (spec.center_rad + quantile(&self.travel_rad, 0.5)?))
            .rem_euclid(spec.wrap_counts);
            // A broken wire reads only noise about zero.
            let near_zero = counts.min(spec.wrap_counts - counts) < FAR_SIGMAS * spec.noise_std_counts.max(1.0);
            return Some(if near_zero { FailurePattern::Dead } else { FailurePattern::Stuck(self.len()) });
        }
        let all: Vec<usize> = (0..self.len()).collect();
        let (off_rad, line) = self.off_line(spec.center_rad, &all);
        let slope = line.slope;
        let sizes: Vec<f64> = off_rad.iter().map(|off| off.abs()).collect();
        let is_straight = SIGMA_OF_MEDIAN * quantile(&sizes, 0.5)? < STRAIGHT * spread_rad;
        if is_straight && (slope - 1.0).abs() > FAR_SIGMAS * spec.gain_std.max(LEAST_GAIN_STD) {
            return Some(if slope < 0.0 { FailurePattern::Reversed(line) } else { FailurePattern::Scaled(line) });
        }
        if let Some(step) = self.step() {
            return Some(step);
        }
        if SIGMA_OF_MEDIAN * quantile(&sizes, 0.5)? > FOLLOWS * spread_rad || !(0.7..1.3).contains(&slope) {
            return Some(FailurePattern::Dead);
        }
        self.single(&self.are_far(&off_rad, &all), spec.center_rad)
    }

    /// Range of the readings, if they move as no locked joint's do and the camera shows that the joint does, too.
    pub(crate) fn moved_rad(&self) -> Option<f64> {
        let least_rad = MOVED_RAD.max(LOCKED_SIGMAS * rms(&self.std_rad));
        let moves = robust_deviation(&self.angle_rad) > least_rad && robust_deviation(&self.travel_rad) > MOVED_RAD;
        moves.then(|| range(&self.travel_rad))
    }

    /// Returns true for each distance that is large against those of the `usual` views.
    fn are_far(&self, off_rad: &[f64], usual: &[usize]) -> Vec<bool> {
        let sizes: Vec<f64> = usual.iter().map(|&k| off_rad[k].abs()).collect();
        let sigma_rad = (SIGMA_OF_MEDIAN * quantile(&sizes, 0.5).unwrap_or(0.0)).max(rms(&self.std_rad));
        off_rad.iter().map(|off| off.abs() > FAR_RAD.max(FAR_SIGMAS * sigma_rad)).collect()
    }

    /// Returns true for each reading far from the line of those that are not: many wrong ones pull at the line of all.
    fn far_from_others(&self, is_far: &[bool], center_rad: f64) -> Vec<bool> {
        let mut is_far = is_far.to_vec();
        for _ in 0..REFITS {
            let near: Vec<usize> = (0..self.len()).filter(|&k| !is_far[k]).collect();
            is_far = self.are_far(&self.off_line(center_rad, &near).0, &near);
        }
        is_far
    }

    /// Pattern of single views whose readings are far off, or of nearly all since one of them.
    fn single(&self, is_far: &[bool], center_rad: f64) -> Option<FailurePattern> {
        let is_off = self.far_from_others(is_far, center_rad);
        if let Some(from) = lost_from(&is_off) {
            let n_off = is_off[from..].iter().filter(|off| **off).count();
            return Some(FailurePattern::Lost { since: self.view_idx[from], n_off });
        }
        let mut single: Vec<usize> =
            self.view_idx.iter().zip(is_far).filter(|(_, far)| **far).map(|(k, _)| *k).collect();
        single.sort_unstable();
        let is_exception = single.len() as f64 <= MAX_SINGLE * self.len() as f64;
        (is_exception && !single.is_empty()).then_some(FailurePattern::Single(single))
    }

    /// Returns true if the readings of these views are the same except for noise.
    fn is_still_in(&self, views: &[usize], spec: &JointSensorSpec) -> bool {
        let at = self.view_idx.iter().zip(&self.travel_rad).filter(|(k, _)| views.contains(k));
        let travel_rad: Vec<f64> = at.map(|(_, travel_rad)| *travel_rad).collect();
        travel_rad.len() >= MIN_STILL_VIEWS && n_still(&travel_rad, spec) == travel_rad.len()
    }

    /// Returns true if the sensor of a joint that stands still reads an angle that its datasheet allows.
    fn is_as_stated(&self, robot: &Robot) -> bool {
        let spec = &robot.sensors[self.joint];
        let travel_rad = quantile(&self.travel_rad, 0.5).unwrap_or(0.0);
        let off_rad = quantile(&self.angle_rad, 0.5).unwrap_or(0.0) - spec.center_rad - travel_rad;
        let allowed_rad = RIGHT_SIGMAS * spec.offset_std_rad.hypot(spec.gain_std * travel_rad);
        off_rad.abs() < allowed_rad
    }

    /// Slip that explains the most, if it explains nearly all (least squares of 1, reading and a step).
    fn step(&self) -> Option<FailurePattern> {
        let n = self.len();
        let squares_of = |off_rad: &[f64]| off_rad.iter().map(|off| off * off).sum::<f64>();
        let with_step = |at: usize| {
            let (off_rad, step_rad) = self.off_line_with_step(at)?;
            Some((squares_of(&off_rad), step_rad, off_rad))
        };
        let without = with_step(n)?.0;
        let best = (MIN_SIDE..=n.checked_sub(MIN_SIDE)?)
            .filter_map(|at| Some((at, with_step(at)?)))
            .min_by(|(_, a), (_, b)| a.0.total_cmp(&b.0))?;
        let (at, (squares, step_rad, off_rad)) = best;
        let sigma_rad = (squares / n.saturating_sub(3).max(1) as f64).sqrt();
        let is_clear = squares < STEP_LEAVES * without
            && step_rad.abs() > FAR_RAD.max(STEP_SIGMAS * sigma_rad)
            && sigma_rad < FOLLOWS * deviation(&self.angle_rad)
            // A sensor that slipped follows the angle afterwards.
            && lost_from(&self.are_far(&off_rad, &(0..n).collect::<Vec<usize>>())).is_none();
        is_clear.then(|| FailurePattern::Lasting { since: self.view_idx[at], step_rad })
    }

    /// Distances from a straight line with a step at the `at`-th view, and the step; at the end there is none.
    fn off_line_with_step(&self, at: usize) -> Option<(Vec<f64>, f64)> {
        let row = |k: usize| Vector3::new(1.0, self.travel_rad[k], if k >= at { 1.0 } else { 0.0 });
        let (mut matrix, mut right) = (Matrix3::<f64>::identity() * 1e-9, Vector3::zeros());
        for k in 0..self.len() {
            matrix += row(k) * row(k).transpose();
            right += row(k) * self.angle_rad[k];
        }
        let x = matrix.cholesky()?.solve(&right);
        // The step of the reading is opposite to that of the angle.
        Some(((0..self.len()).map(|k| self.angle_rad[k] - row(k).dot(&x)).collect(), -x[2]))
    }

    /// Distances from the line of least absolute deviations of the `used` views, and the line (iteratively reweighted
    /// least squares).
    fn off_line(&self, center_rad: f64, used: &[usize]) -> (Vec<f64>, SensorLine) {
        let differences: Vec<f64> = used.iter().map(|&k| self.angle_rad[k] - self.travel_rad[k]).collect();
        let (mut offset, mut slope) = (quantile(&differences, 0.5).unwrap_or(0.0), 1.0);
        let off = |offset: f64, slope: f64| -> Vec<f64> {
            self.angle_rad.iter().zip(&self.travel_rad).map(|(a, t)| a - offset - slope * t).collect()
        };
        for _ in 0..ROUNDS {
            let weights: Vec<f64> = off(offset, slope).iter().map(|r| 1.0 / r.abs().max(FLOOR_RAD)).collect();
            let sum = |f: &dyn Fn(usize) -> f64| used.iter().map(|&k| weights[k] * f(k)).sum::<f64>();
            let (w, t, tt) = (sum(&|_| 1.0), sum(&|k| self.travel_rad[k]), sum(&|k| self.travel_rad[k].powi(2)));
            let (a, at) = (sum(&|k| self.angle_rad[k]), sum(&|k| self.angle_rad[k] * self.travel_rad[k]));
            let determinant = w * tt - t * t;
            if determinant <= ALL_ALIKE * w * tt {
                break;
            }
            slope = (w * at - t * a) / determinant;
            offset = (a - slope * t) / w;
        }
        (off(offset, slope), SensorLine { slope, offset_rad: offset - center_rad })
    }

    /// Evidence of the pattern, in words.
    pub(crate) fn in_words(&self, spec: &JointSensorSpec, pattern: &FailurePattern, views: &[View]) -> String {
        let unit = spec.unit();
        let read = |digits: usize| unit.shown(range(&self.travel_rad), digits);
        let shown = |digits: usize| unit.shown(range(&self.angle_rad), digits);
        let n = self.len();
        let number = |k: usize| views[k].pose_idx + 1;
        match pattern {
            FailurePattern::Still(_, SensorUse::Used) => {
                format!("the camera shows one angle in {n} views (within {}), as the sensor says", shown(2))
            }
            FailurePattern::Still(_, SensorUse::Ignored) => {
                format!(
                    "the camera shows one angle in {n} views (within {}); the sensor reads {} apart, or elsewhere",
                    shown(2),
                    read(2)
                )
            }
            FailurePattern::Stuck(n_still) => {
                let shown = unit.shown(range(&self.angle_rad[n - n_still..]), 1);
                let since = if *n_still < n { "the last " } else { "" };
                format!("the reading stands still over {since}{n_still} views while the camera shows {shown} of motion")
            }
            FailurePattern::Dead => {
                format!("the reading spans {} and does not follow the {} that the camera shows", read(1), shown(1))
            }
            FailurePattern::Reversed(SensorLine { slope, .. }) => format!(
                "the reading goes the other way: over {n} views the {} that the camera shows follow it with a \
                 slope of {slope:.2}",
                shown(1)
            ),
            FailurePattern::Scaled(SensorLine { slope, .. }) => format!(
                "the {} that the camera shows in {n} views follow the {} of the reading along a line of slope \
                 {slope:.2}",
                shown(1),
                read(1)
            ),
            FailurePattern::Single(of) => {
                let numbers: Vec<String> = of.iter().map(|&k| number(k).to_string()).collect();
                let what = if self.is_still_in(of, spec) { "stands still" } else { "is off" };
                say::reading_in_views(what, [of.len(), n], &numbers)
            }
            FailurePattern::Lost { since, n_off } => {
                let n_since = n - self.view_idx.iter().position(|k| k == since).unwrap_or(0);
                say::lost_reading([*n_off, n_since], number(*since))
            }
            FailurePattern::Lasting { since, step_rad } => slip_in_words(unit.shown(*step_rad, 2), views, *since),
        }
    }
}

/// First view from which nearly all are off, several and up to the end; the views are in the order of time.
fn lost_from(is_off: &[bool]) -> Option<usize> {
    let n_back = is_off.iter().rev().take_while(|off| !**off).count();
    let is_lost_from = |from: &usize| {
        let n_off = is_off[*from..].iter().filter(|off| **off).count();
        is_off[*from] && n_off >= MIN_LOST && n_off as f64 >= LOST_SHARE * (is_off.len() - from) as f64
    };
    if n_back >= MIN_BACK { None } else { (0..is_off.len()).find(is_lost_from) }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Puts the angles on the turn of the first one: the camera leaves whole turns open, and so does a reading that stands
/// still.
fn on_one_turn(angles_rad: &mut [f64]) {
    let Some(first_rad) = angles_rad.first().copied() else { return };
    for angle_rad in angles_rad {
        *angle_rad = first_rad + wrap_symmetric(*angle_rad - first_rad, TAU);
    }
}

fn range(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    high - low
}

/// Standard deviation by the median distance from the median, which a few wrong values leave alone.
fn robust_deviation(values: &[f64]) -> f64 {
    let middle = quantile(values, 0.5).unwrap_or(0.0);
    let off: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
    SIGMA_OF_MEDIAN * quantile(&off, 0.5).unwrap_or(0.0)
}

/// Root mean square about the mean.
fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::titan;
    use armcal_core::stats::stream_rng;
    use rand::RngExt;

    const JOINT: usize = 1;

    /// Forty views of a joint whose sensor reads `reading` of the view and the angle.
    fn readings(seed: u64, reading: impl Fn(usize, f64) -> f64) -> Readings {
        let mut rng = stream_rng(seed, "patterns");
        let angle_rad: Vec<f64> = (0..40).map(|_| rng.random_range(-1.0..1.0)).collect();
        let noisy = |(k, angle_rad): (usize, &f64)| reading(k, *angle_rad) + 1e-6 * rng.random_range(-1.0..1.0);
        let travel_rad = angle_rad.iter().enumerate().map(noisy).collect();
        Readings { joint: JOINT, view_idx: (0..40).collect(), travel_rad, angle_rad, std_rad: vec![1e-4; 40] }
    }

    /// The sensor reads another line, or another joint's angle, since a view. The first readings may be right by
    /// chance.
    #[test]
    fn a_sensor_that_reads_something_else_up_to_the_end_is_lost() {
        const FROM: usize = 32;
        let robot = titan();
        for seed in 0..8 {
            let other = |k: usize| (7.0 * k as f64 + seed as f64).sin();
            let wrong: [&dyn Fn(usize, f64) -> f64; 3] =
                [&|_, angle| 2.0 * angle, &|_, angle| -angle, &|k, _| other(k)];
            for (kind, wrong) in wrong.iter().enumerate() {
                let readings = readings(seed, |k, angle| if k < FROM { angle } else { wrong(k, angle) });
                let Some(FailurePattern::Lost { since, n_off }) = readings.pattern(&robot) else {
                    panic!("seed {seed}, {kind}: {:?}", readings.pattern(&robot))
                };
                assert!((FROM..FROM + 3).contains(&since), "seed {seed}, {kind}: {since}");
                assert!(n_off >= MIN_LOST && n_off <= 40 - since, "seed {seed}, {kind}: {n_off}");
            }
        }
    }

    /// The readings are wrong in a block that ends, and in scattered views.
    #[test]
    fn a_sensor_that_reads_right_again_jumped_in_single_views() {
        let robot = titan();
        for seed in 0..8 {
            let mut rng = stream_rng(seed, "scattered");
            let scattered: Vec<usize> = (0..6).map(|n| 6 * n + rng.random_range(0..6)).collect();
            for off in [(20..30).collect(), (22..33).collect(), scattered] {
                let readings =
                    readings(seed, |k, angle| angle + if off.contains(&k) { 0.3 + 0.1 * angle } else { 0.0 });
                assert_eq!(readings.pattern(&robot), Some(FailurePattern::Single(off)), "seed {seed}");
            }
        }
    }

    #[test]
    fn readings_that_stand_still_for_a_while_are_told_from_others_that_are_off() {
        let (robot, of) = (titan(), (12..22).collect::<Vec<usize>>());
        let spec = &robot.sensors[JOINT];
        let still = readings(1, |k, angle| if of.contains(&k) { 0.4 } else { angle });
        let off = readings(1, |k, angle| if of.contains(&k) { angle + 0.3 } else { angle });
        assert_eq!([&still, &off].map(|one| one.is_still_in(&of, spec)), [true, false]);
        assert!(matches!(still.pattern(&robot), Some(FailurePattern::Single(_))), "{:?}", still.pattern(&robot));
    }

    #[test]
    fn angles_that_are_one_but_for_whole_turns_become_one() {
        let mut angles = [PI - 0.01, -PI + 0.005, PI - 0.02, 3.0 * PI + 0.01];
        on_one_turn(&mut angles);
        assert!(deviation(&angles) < 0.02, "{angles:?}");
        assert!((angles[1] - (PI + 0.005)).abs() < 1e-12, "{angles:?}");
        let mut apart = [0.0, 1.0, -1.5];
        on_one_turn(&mut apart);
        assert_eq!(apart, [0.0, 1.0, -1.5]);
    }
}
