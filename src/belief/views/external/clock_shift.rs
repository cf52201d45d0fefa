//! The offset between the clocks of camera and joints, by when each of them moved.
//!
//! Between two images the tags move in the camera where the joints move. Both motions are compared for all offsets of
//! the clocks: their correlation is high at the right one, whatever the readings, the mount and the tags are.

use crate::views::constants::clock_shift::{
    AS_GOOD, DISTANCE_M, LONGEST_S, MAX_AS_STAMPED, MAX_PAIRS, MIN_CORRELATION, MIN_MOVED, MIN_SHARE, MIN_SHIFT_S,
    MOST, NEARER, NEIGHBOUR_S, STEP_S, STILL_RAD, SURE,
};
use crate::views::external::pairing::TravelSeries;
use armcal_core::input::{ExternalDetection, RawMeasurement, TagFrame};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::stats::quantile;
use armcal_core::time::Stamp;
use nalgebra::{Isometry3, Point3, Vector3};
use std::fmt;

/// Offset between the clocks of camera and joints, and the evidence for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClockShift {
    /// Joints' clock less the camera's, s: to be added to the stamps of the tags.
    pub offset_s: f64,
    /// Correlation of the motions with the offset.
    correlation: f64,
    /// Correlation with the stamps as they are.
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
    /// Points of the tags in the camera frame of the first image, m: those that both images show, if there are any.
    points_m: Vec<Point3<f64>>,
    /// Mean motion of the tags over their distance, as a logarithm.
    tags: f64,
    /// False where the images show no tag in common: then it moved, but how far is unknown.
    is_measured: bool,
    /// Places of the tags in the map, and the points at which the first image shows them, m.
    mapped_m: Vec<(Point3<f64>, Point3<f64>)>,
}

/// Agreement of the motions of tags and joints under one offset.
#[derive(Clone, Copy, Debug)]
struct Agreement {
    shift_s: f64,
    /// Correlation of all motions, which shows when they moved.
    correlation: f64,
    /// Correlation of the sizes where both moved, as Fisher's z in its standard deviations.
    sizes: f64,
}

/// Returns the offset between the clocks where the motions prove one that no estimate can absorb.
///
/// Poses at equal times agree with one another's motions by when they moved. The directions of the tags by the map and
/// the nominal arm then decide, or how far they moved.
pub(crate) fn clock_shift(travels: &TravelSeries<'_>, frames: &[TagFrame], robot: &Robot) -> Option<ClockShift> {
    let pairs = pairs(frames, robot);
    let all = |longest_s: f64| {
        let n = (longest_s / STEP_S).round() as i32;
        let at = |k: i32| agreement(travels, &pairs, STEP_S * f64::from(k), robot);
        (-n..=n).filter_map(at).collect::<Vec<Agreement>>()
    };
    let most = |all: &[Agreement]| all.iter().map(|one| one.correlation).reduce(f64::max);
    let as_stamped = most(&all(MIN_SHIFT_S))?;
    if as_stamped > MAX_AS_STAMPED {
        return None;
    }
    let mut all = all(LONGEST_S);
    let best = most(&all)?;
    if best < MIN_CORRELATION {
        return None;
    }
    all.retain(|one| one.correlation > AS_GOOD * best);
    let off: Vec<(Agreement, f64)> =
        all.iter().map(|one| (*one, -off_rad(travels, &pairs, one.shift_s, robot).ln())).collect();
    let by_sizes: Vec<(Agreement, f64)> = all.iter().map(|one| (*one, one.sizes)).collect();
    let (offset_s, correlation) = unrivalled(&off, -NEARER.ln()).or_else(|| unrivalled(&by_sizes, SURE))?;
    let is_large = offset_s.abs() > MIN_SHIFT_S;
    is_large.then_some(ClockShift { offset_s, correlation, as_stamped, n_pairs: pairs.len() })
}

/// Returns offset and correlation of the highest score, if all others but its neighbours are lower by `margin`.
///
/// An arm that rests for each image fits a range of offsets: their middle is farthest from a motion.
fn unrivalled(scored: &[(Agreement, f64)], margin: f64) -> Option<(f64, f64)> {
    let (surest, most) = scored.iter().filter(|(_, score)| score.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (near, far): (Vec<_>, Vec<_>) =
        scored.iter().partition(|(one, _)| (one.shift_s - surest.shift_s).abs() <= NEIGHBOUR_S);
    let is_lower = |(_, score): &(Agreement, f64)| score + margin < *most;
    let offset_s = near.iter().map(|(one, _)| one.shift_s).sum::<f64>() / near.len() as f64;
    far.iter().all(is_lower).then_some((offset_s, surest.correlation))
}

/// Returns the median angle between the tags as seen, with `shift_s` added to their stamps, and by map and nominal arm.
fn off_rad(travels: &TravelSeries<'_>, pairs: &[Pair], shift_s: f64, robot: &Robot) -> f64 {
    let of_pair = |pair: &Pair| {
        let camera_from_map = camera_at(travels, pair.from.plus_s(shift_s), robot)?.inverse();
        let off = |(place, seen): &(Point3<f64>, Point3<f64>)| (camera_from_map * place).coords.angle(&seen.coords);
        Some(pair.mapped_m.iter().map(off).collect::<Vec<f64>>())
    };
    let all: Vec<f64> = pairs.iter().filter_map(of_pair).flatten().collect();
    quantile(&all, 0.5).unwrap_or(f64::NAN)
}

/// Returns the camera's pose by the nominal arm, in the tags' frame; `None` outside of continuous readings.
fn camera_at(travels: &TravelSeries<'_>, at: Stamp, robot: &Robot) -> Option<Isometry3<f64>> {
    let found = travels.at(at).filter(|found| found.is_continuous)?;
    let angle_rad = |joint: usize| robot.sensors[joint].center_rad + found.travel_rad[joint];
    Some(robot.tags_from_camera(&JointAngles::from_fn(found.travel_rad.len(), angle_rad)))
}

/// Returns successive images, at most [`MAX_PAIRS`] pairs, spread over the recording.
fn pairs(frames: &[TagFrame], robot: &Robot) -> Vec<Pair> {
    let every = frames.len().div_ceil(MAX_PAIRS).max(1);
    frames.windows(2).step_by(every).filter_map(|two| pair(&two[0], &two[1], robot)).collect()
}

fn pair(from: &TagFrame, to: &TagFrame, robot: &Robot) -> Option<Pair> {
    let point = |seen: &ExternalDetection| point_m(&seen.seen, robot);
    let both = |a: &ExternalDetection| Some((point(a)?, point(to.tags.iter().find(|b| a.key() == b.key())?)?));
    let (mut points_m, others_m): (Vec<_>, Vec<_>) = from.tags.iter().filter_map(both).unzip();
    let is_measured = !points_m.is_empty();
    let moved = points_m.iter().zip(&others_m).map(|(a, b)| (b - a).norm() / a.coords.norm());
    let moved = moved.sum::<f64>() / points_m.len() as f64;
    if !is_measured {
        points_m = from.tags.iter().filter_map(point).collect();
    }
    let tags = size(if is_measured { moved } else { 1.0 });
    let mapped = |seen: &ExternalDetection| {
        let tag = robot.tags.iter().find(|tag| Some(tag.id) == seen.id && tag.is_known())?;
        Some((Point3::from(tag.base_from_tag.origin().vector()), point(seen)?))
    };
    let mapped_m = from.tags.iter().filter_map(mapped).collect();
    let (from, to) = (from.stamp, to.stamp);
    (!points_m.is_empty()).then_some(Pair { from, to, points_m, tags, is_measured, mapped_m })
}

/// Returns a point of a landmark in the camera frame, m; those seen in pixels count as [`DISTANCE_M`] away.
fn point_m(seen: &RawMeasurement, robot: &Robot) -> Option<Point3<f64>> {
    let along = |pixel: [f64; 2]| robot.camera.lens.unproject(&pixel.into());
    match seen {
        RawMeasurement::Corners(corners) => {
            let rays = corners.iter().map(|corner| Some(along(*corner)?.into_inner()));
            let sum = rays.sum::<Option<Vector3<f64>>>()?;
            Some(Point3::from(sum.normalize() * DISTANCE_M))
        }
        RawMeasurement::BoardCorner { pixel, .. } => Some(Point3::from(along(*pixel)?.into_inner() * DISTANCE_M)),
        RawMeasurement::Position(position_m) => Some(Point3::from(*position_m)),
        RawMeasurement::Pose(pose) => Some(pose.translation.vector.into()),
    }
}

/// Returns a motion as a logarithm, near zero below the noise of both streams.
fn size(moved_rad: f64) -> f64 {
    (moved_rad / STILL_RAD).ln_1p()
}

/// Returns how the motions agree with `shift_s` added to the stamps of the tags; `None` where too few pairs have
/// readings or moved.
fn agreement(travels: &TravelSeries<'_>, pairs: &[Pair], shift_s: f64, robot: &Robot) -> Option<Agreement> {
    let camera_at = |at: Stamp| camera_at(travels, at.plus_s(shift_s), robot);
    let (mut of_all, mut of_sizes, mut n_moved) = (Sums::default(), Sums::default(), [0_usize; 2]);
    for pair in pairs {
        let (Some(from), Some(to)) = (camera_at(pair.from), camera_at(pair.to)) else { continue };
        let motion = to.inv_mul(&from);
        let moved = pair.points_m.iter().map(|point| (motion * point - point).norm() / point.coords.norm());
        let joints = size(moved.sum::<f64>() / pair.points_m.len() as f64);
        of_all.add(pair.tags, joints);
        let have_moved = [pair.tags, joints].map(|moved| moved > size(STILL_RAD));
        n_moved = [0, 1].map(|k| n_moved[k] + usize::from(have_moved[k]));
        if have_moved == [true; 2] && pair.is_measured {
            of_sizes.add(pair.tags, joints);
        }
    }
    if n_moved.iter().any(|n| *n < MIN_MOVED) || of_all.n < MIN_SHARE * pairs.len() as f64 {
        return None;
    }
    let sizes = of_sizes.correlation().filter(|_| of_sizes.n >= MIN_MOVED as f64);
    let sizes = sizes.map_or(0.0, |found| found.clamp(-MOST, MOST).atanh() * (of_sizes.n - 3.0).sqrt());
    Some(Agreement { shift_s, correlation: of_all.correlation()?, sizes })
}

/// Sums for the correlation of two series.
#[derive(Default)]
struct Sums {
    n: f64,
    sum: [f64; 2],
    squares: [f64; 2],
    products: f64,
}

impl Sums {
    fn add(&mut self, a: f64, b: f64) {
        self.n += 1.0;
        self.sum = [self.sum[0] + a, self.sum[1] + b];
        self.squares = [self.squares[0] + a * a, self.squares[1] + b * b];
        self.products += a * b;
    }

    fn correlation(&self) -> Option<f64> {
        let variance = |k: usize| self.squares[k] - self.sum[k] * self.sum[k] / self.n;
        let covariance = self.products - self.sum[0] * self.sum[1] / self.n;
        Some(covariance / (variance(0) * variance(1)).sqrt()).filter(|found| found.is_finite())
    }
}

#[cfg(test)]
mod tests;
