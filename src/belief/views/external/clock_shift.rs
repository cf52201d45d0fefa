//! The offset between the clocks of camera and joints, by when each of them moved.
//!
//! Between two images the tags move in the camera where the joints move. Both motions are compared for all offsets of
//! the clocks: their correlation is high at the right one, whatever the readings, the mount and the tags are.

use crate::views::constants::clock_shift::{
    LONGEST_S, MAX_AS_STAMPED, MAX_PAIRS, MIN_CORRELATION, MIN_MOVED, MIN_SHARE, MIN_SHIFT_S, NEIGHBOUR_S, STEP_S,
    STILL_RAD, UNRIVALLED,
};
use crate::views::external::pairing::TravelSeries;
use armcal_core::input::{ExternalDetection, RawMeasurement, TagFrame};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::time::Stamp;
use std::fmt;

/// Offset between the clocks of camera and joints, and the evidence for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClockShift {
    /// Joints' clock less the camera's, s: to be added to the stamps of the tags.
    pub offset_s: f64,
    /// Correlation of the motions with the offset.
    correlation: f64,
    /// The same with the stamps as they are.
    as_stamped: f64,
    n_pairs: usize,
}

impl fmt::Display for ClockShift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = if self.offset_s > 0.0 { "behind" } else { "ahead of" };
        write!(
            f,
            "the camera's clock is {:.1} s {side} the joints': only with stamps corrected by it do the tags move when \
             the joints do, in {} pairs of images (correlation {:.2}; {:.2} as stamped). Add {:.2} to clock_offset_s \
             in [tags] of the input map, which is 0 where it is absent, or synchronize the clocks",
            self.offset_s.abs(),
            self.n_pairs,
            self.correlation,
            self.as_stamped,
            self.offset_s,
        )
    }
}

/// Two images, and how far the tags moved between them.
struct Pair {
    from: Stamp,
    to: Stamp,
    /// Motion of the tags as a logarithm.
    tags: f64,
}

/// Returns the offset between the clocks where the motions prove one that no estimate can absorb.
pub(crate) fn clock_shift(travels: &TravelSeries<'_>, frames: &[TagFrame], robot: &Robot) -> Option<ClockShift> {
    let pairs = pairs(frames, robot);
    let at = |shift_s: f64| correlation(travels, &pairs, shift_s, robot.n_joints_seen_by(&robot.camera));
    let steps =
        |from_s: f64, to_s: f64| (0..=((to_s - from_s) / STEP_S) as usize).map(move |k| from_s + STEP_S * k as f64);
    let best_of = |shifts: &mut dyn Iterator<Item = f64>| {
        shifts.filter_map(|shift_s| Some((shift_s, at(shift_s)?))).max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (_, as_stamped) = best_of(&mut steps(-MIN_SHIFT_S, MIN_SHIFT_S))?;
    if as_stamped > MAX_AS_STAMPED {
        return None;
    }
    let all: Vec<(f64, f64)> =
        steps(-LONGEST_S, LONGEST_S).filter_map(|shift_s| Some((shift_s, at(shift_s)?))).collect();
    let (best_s, best) = all.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_far = |(shift_s, _): &&(f64, f64)| (shift_s - best_s).abs() > NEIGHBOUR_S;
    let rival = all.iter().filter(is_far).map(|(_, found)| *found).fold(0.0, f64::max);
    // Of an arm that rests for each image, a range of offsets is as good: its middle is farthest from a motion.
    let as_good: Vec<f64> =
        all.iter().filter(|found| !is_far(found) && found.1 > UNRIVALLED * best).map(|(s, _)| *s).collect();
    let offset_s = as_good.iter().sum::<f64>() / as_good.len().max(1) as f64;
    let is_proven = best >= MIN_CORRELATION && rival < UNRIVALLED * best && offset_s.abs() > MIN_SHIFT_S;
    is_proven.then_some(ClockShift { offset_s, correlation: best, as_stamped, n_pairs: pairs.len() })
}

/// Returns successive images, at most [`MAX_PAIRS`] pairs, spread over the recording.
fn pairs(frames: &[TagFrame], robot: &Robot) -> Vec<Pair> {
    let every = frames.len().div_ceil(MAX_PAIRS).max(1);
    let pair = |two: &[TagFrame]| Pair { from: two[0].stamp, to: two[1].stamp, tags: moved(&two[0], &two[1], robot) };
    frames.windows(2).step_by(every).map(pair).collect()
}

/// Returns how far the tags moved in the camera, as a logarithm: the mean change of direction or, of other tags, 1 rad.
fn moved(from: &TagFrame, to: &TagFrame, robot: &Robot) -> f64 {
    let is_same = |a: &ExternalDetection, b: &ExternalDetection| a.key() == b.key();
    let change = |a: &ExternalDetection| {
        let changes = to.tags.iter().filter(|b| is_same(a, b)).filter_map(|b| change_rad(&a.seen, &b.seen, robot));
        changes.min_by(f64::total_cmp)
    };
    let changes: Vec<f64> = from.tags.iter().filter_map(change).collect();
    let mean = changes.iter().sum::<f64>() / changes.len().max(1) as f64;
    size(if changes.is_empty() { 1.0 } else { mean })
}

/// Returns the change of direction of a landmark, rad; a change of distance counts as one.
fn change_rad(from: &RawMeasurement, to: &RawMeasurement, robot: &Robot) -> Option<f64> {
    let focal_px = robot.camera.lens.focal_px()[0];
    let of_pixels = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) / focal_px;
    match (from, to) {
        (RawMeasurement::Corners(a), RawMeasurement::Corners(b)) => {
            Some(a.iter().zip(b).map(|(a, b)| of_pixels(*a, *b)).sum::<f64>() / 4.0)
        }
        (RawMeasurement::BoardCorner { number, pixel }, RawMeasurement::BoardCorner { number: other, pixel: to }) => {
            (number == other).then(|| of_pixels(*pixel, *to))
        }
        (RawMeasurement::Position(a), RawMeasurement::Position(b)) => Some((a - b).norm() / a.norm()),
        (RawMeasurement::Pose(a), RawMeasurement::Pose(b)) => {
            let [a, b] = [a, b].map(|pose| pose.translation.vector);
            Some((a - b).norm() / a.norm())
        }
        _ => None,
    }
}

/// Returns a motion as a logarithm, near zero below the noise of both streams.
fn size(moved_rad: f64) -> f64 {
    (moved_rad / STILL_RAD).ln_1p()
}

/// Returns the correlation of the motions of tags and joints, with `shift_s` added to the stamps of the tags; `None`
/// where too few pairs have readings or moved.
fn correlation(travels: &TravelSeries<'_>, pairs: &[Pair], shift_s: f64, n_joints: usize) -> Option<f64> {
    let travel = |at: Stamp| travels.at(at.plus_s(shift_s)).filter(|found| found.is_continuous);
    let joints = |to: &JointAngles, from: &JointAngles| {
        (0..n_joints).map(|joint| travels.difference(to, from, joint).abs()).fold(0.0, f64::max)
    };
    let both = pairs.iter().filter_map(|pair| {
        let (from, to) = (travel(pair.from)?, travel(pair.to)?);
        Some((pair.tags, size(joints(&to.travel_rad, &from.travel_rad))))
    });
    let (mut n, mut n_moved, mut sum, mut products) = (0_usize, [0_usize; 2], [0.0; 2], [0.0; 3]);
    for (tags, joints) in both {
        n += 1;
        for (k, moved) in [tags, joints].into_iter().enumerate() {
            n_moved[k] += usize::from(moved > size(STILL_RAD));
            sum[k] += moved;
        }
        products = [products[0] + tags * tags, products[1] + joints * joints, products[2] + tags * joints];
    }
    if n_moved.iter().any(|n| *n < MIN_MOVED) || (n as f64) < MIN_SHARE * pairs.len() as f64 {
        return None;
    }
    let n = n as f64;
    let variance = |k: usize| products[k] - sum[k] * sum[k] / n;
    let covariance = products[2] - sum[0] * sum[1] / n;
    Some(covariance / (variance(0) * variance(1)).sqrt()).filter(|found| found.is_finite())
}

#[cfg(test)]
mod tests;
