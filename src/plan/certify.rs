//! Proves that every arm within the joint errors keeps clear, at one pose or along an edge.
//!
//! A pair of convex shapes with `gap` between their shadows on a direction keeps the distance `gap - drift`, where
//! `drift` bounds what the joints can move the one against the other along that direction: exact to first order in the
//! joints' motion, with a bound on the second. A region of arms (a stretch of the edge times a box of joint errors)
//! whose pairs do not all pass is halved, and the halves have only those pairs to look at. An arm found too near ends
//! the search.

use std::ops::Range;

use parry3d::math::Vec3;

use super::bounds::JointErrorBounds;
use super::clearance::{ClearanceModel, Nearest};
use super::separation::{Placed, gap_m, separate};
use super::shapes::vec3;
use crate::kinematics::LinkPoses;
use crate::streams::{JointAngles, MAX_JOINTS};

/// Where shapes can move less than this and are still not certified, they count as too near, m.
const FINEST_M: f64 = 0.006;
/// Regions that may be looked at for one pair of one pose or one stretch; then it counts as too near.
const MAX_REGIONS: usize = 4000;
/// Two shapes that may touch, the one that more joints move first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pair {
    /// A link's shape and a standing one.
    Standing { moving: usize, standing: usize },
    /// Two links' shapes, the outer first.
    Links { outer: usize, inner: usize },
}

/// Believed angles on a straight line and all that the errors may make of them.
pub(super) struct Sweep<'a> {
    pub model: &'a ClearanceModel<'a>,
    pub from: JointAngles,
    pub to: JointAngles,
    pub bounds: &'a JointErrorBounds,
    /// Free water to keep, m.
    pub margin_m: f64,
}

/// A stretch of the line and a box of errors.
#[derive(Clone, Copy, Debug)]
struct Region {
    /// Shares of the way from `from` to `to`.
    along: [f64; 2],
    error_rad: [[f64; 2]; MAX_JOINTS],
}

/// The middle of a region and how far it reaches to either side.
struct Spot {
    poses: LinkPoses,
    /// Half of the stretch, rad, with its sign.
    step_rad: [f64; MAX_JOINTS],
    error_half_rad: [f64; MAX_JOINTS],
    /// The two together.
    reach_rad: [f64; MAX_JOINTS],
    /// Whether the middle is itself an arm within the bounds.
    is_within: bool,
}

/// Which halves to make of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Split {
    Along,
    Error(usize),
}

/// How far one shape can move against another within a region.
struct Drift {
    total_m: f64,
    /// To first order and along the direction: half of the stretch, and half of each joint's errors; signed.
    along_m: f64,
    error_m: [f64; MAX_JOINTS],
    split: Split,
}

/// What is known of a pair in a region.
enum Finding {
    Clear,
    TooNear(f64),
    /// The direction to look along next time, how much is lacking, and where to split.
    Open {
        direction: Vec3,
        lower_bound_m: f64,
        lacking_m: f64,
        drift: Drift,
    },
}

#[derive(Clone, Copy)]
struct OpenPair {
    pair: Pair,
    direction: Vec3,
}

impl Pair {
    /// Index of the moving shape that more joints move.
    pub(super) fn outer(self) -> usize {
        match self {
            Self::Standing { moving, .. } => moving,
            Self::Links { outer, .. } => outer,
        }
    }
}

impl<'a> Sweep<'a> {
    /// The pair of some arm of the sweep that is, or may be, nearer than the margin; `None` proves that there is none.
    pub(super) fn first_too_near(&self) -> Option<Nearest> {
        let region = self.region([0.0, 1.0], None);
        let spot = self.spot(&region);
        let placed = self.model.placed(&spot.poses);
        let mut open = Vec::new();
        for pair in self.model.pairs() {
            if !self.is_far(*pair, &placed, &spot) {
                open.push(OpenPair { pair: *pair, direction: Vec3::ZERO });
            }
        }
        self.search(&region, &spot, &placed, open)
    }

    /// Looks at the whole stretch for all open pairs together; splits the line while that helps most.
    fn search(&self, region: &Region, spot: &Spot, placed: &[Placed], mut open: Vec<OpenPair>) -> Option<Nearest> {
        let mut worst: Option<(f64, Split)> = None;
        let mut failed = None;
        open.retain_mut(|candidate| {
            if failed.is_some() {
                return false;
            }
            match self.look(candidate, placed, spot) {
                Finding::Clear => false,
                Finding::TooNear(distance_m) => {
                    failed = Some(self.model.named(candidate.pair, distance_m));
                    false
                }
                Finding::Open { direction, lacking_m, drift, .. } => {
                    candidate.direction = direction;
                    if worst.is_none_or(|(most, _)| lacking_m > most) {
                        worst = Some((lacking_m, drift.split));
                    }
                    true
                }
            }
        });
        if failed.is_some() {
            return failed;
        }
        let (_, split) = worst?;
        if split != Split::Along {
            return open.iter().find_map(|pair| self.search_pair(*pair, region));
        }
        let middle = 0.5 * (region.along[0] + region.along[1]);
        [[region.along[0], middle], [middle, region.along[1]]].into_iter().find_map(|along| {
            let half = self.region(along, Some(region));
            let spot = self.spot(&half);
            let placed = self.model.placed(&spot.poses);
            self.search(&half, &spot, &placed, open.clone())
        })
    }

    /// Looks at one pair until every part of the region is certified.
    fn search_pair(&self, open: OpenPair, region: &Region) -> Option<Nearest> {
        let mut stack = vec![(*region, open.direction)];
        for _ in 0..MAX_REGIONS {
            let (region, direction) = stack.pop()?;
            let spot = self.spot(&region);
            let placed = self.model.placed_pair(open.pair, &spot.poses);
            let mut candidate = OpenPair { pair: open.pair, direction };
            match self.look_placed(&mut candidate, &placed, &spot) {
                Finding::Clear => {}
                Finding::TooNear(distance_m) => return Some(self.model.named(open.pair, distance_m)),
                Finding::Open { direction, lower_bound_m, drift, .. } => {
                    if drift.total_m < FINEST_M {
                        return Some(self.model.named(open.pair, lower_bound_m));
                    }
                    if let Some(distance_m) = self.worst_corner(open.pair, direction, &region, &drift) {
                        return Some(self.model.named(open.pair, distance_m));
                    }
                    for half in self.halves(&region, drift.split) {
                        stack.push((half, direction));
                    }
                }
            }
        }
        // Too many regions: what is left may be too near.
        Some(self.model.named(open.pair, 0.0))
    }

    fn needed_m(&self, pair: Pair) -> f64 {
        self.model.needed_m(pair, self.margin_m)
    }

    /// Errors of a stretch: the largest on it, within those of the region it comes from. The error is convex in the
    /// angle, so that it is largest at an end.
    fn region(&self, along: [f64; 2], within: Option<&Region>) -> Region {
        let mut error_rad = [[0.0; 2]; MAX_JOINTS];
        for (joint, error) in error_rad.iter_mut().enumerate().take(self.model.n_error_joints()) {
            let at = |share: f64| self.bounds.error_rad(joint, self.believed(joint, share));
            let most = at(along[0]).max(at(along[1]));
            let [low, high] = within.map_or([-most, most], |region| region.error_rad[joint]);
            *error = [low.max(-most), high.min(most)];
            if error[0] > error[1] {
                // Nothing of this part of the errors is left on this stretch; a point of it keeps the region simple.
                *error = [error[0].min(most).max(-most); 2];
            }
        }
        Region { along, error_rad }
    }

    fn believed(&self, joint: usize, share: f64) -> f64 {
        self.from[joint] + share * (self.to[joint] - self.from[joint])
    }

    fn spot(&self, region: &Region) -> Spot {
        let [begin, end] = region.along;
        let (middle, half) = (0.5 * (begin + end), 0.5 * (end - begin));
        let [mut step_rad, mut error_half_rad, mut reach_rad] = [[0.0; MAX_JOINTS]; 3];
        let (mut angles, mut is_within) = (self.from, true);
        for joint in 0..angles.len() {
            let [low, high] = region.error_rad[joint];
            let (believed, offset) = (self.believed(joint, middle), 0.5 * (low + high));
            angles[joint] = believed + offset;
            step_rad[joint] = half * (self.to[joint] - self.from[joint]);
            error_half_rad[joint] = 0.5 * (high - low);
            reach_rad[joint] = step_rad[joint].abs() + error_half_rad[joint];
            is_within &= offset == 0.0 || offset.abs() <= self.bounds.error_rad(joint, believed);
        }
        Spot { poses: self.model.link_poses(&angles), step_rad, error_half_rad, reach_rad, is_within }
    }

    fn halves(&self, region: &Region, split: Split) -> [Region; 2] {
        match split {
            Split::Along => {
                let middle = 0.5 * (region.along[0] + region.along[1]);
                [[region.along[0], middle], [middle, region.along[1]]].map(|along| self.region(along, Some(region)))
            }
            Split::Error(joint) => {
                let [low, high] = region.error_rad[joint];
                let middle = 0.5 * (low + high);
                [[low, middle], [middle, high]].map(|part| {
                    let mut half = *region;
                    half.error_rad[joint] = part;
                    half
                })
            }
        }
    }

    /// Whether the shapes' boxes alone are farther apart than anything in the region can bring them.
    fn is_far(&self, pair: Pair, placed: &[Placed], spot: &Spot) -> bool {
        let shape = pair.outer();
        let gap = gap_m(&placed[shape].bounds, &self.model.other_placed(pair, placed).bounds);
        let coarse_m: f64 =
            self.model.joints_between(pair).map(|joint| self.model.lever_m(shape, joint) * spot.reach_rad[joint]).sum();
        gap - coarse_m >= self.needed_m(pair)
    }

    fn look(&self, candidate: &mut OpenPair, placed: &[Placed], spot: &Spot) -> Finding {
        let pair = candidate.pair;
        self.look_placed(candidate, &[placed[pair.outer()], *self.model.other_placed(pair, placed)], spot)
    }

    fn look_placed(&self, candidate: &mut OpenPair, placed: &[Placed; 2], spot: &Spot) -> Finding {
        let pair = candidate.pair;
        let needed_m = self.needed_m(pair);
        let shapes = self.model.shapes(pair);
        let levers = self.levers(pair, &placed[0], spot);
        // A direction that served the neighbouring region, or that between the boxes, often serves here.
        let guess = if candidate.direction == Vec3::ZERO {
            placed[0].bounds_direction(&placed[1])
        } else {
            candidate.direction
        };
        if guess != Vec3::ZERO
            && let Some(gap) = shapes.gap_along_m(placed, guess)
            && gap > needed_m
            && gap - self.drift(pair, guess, &placed[0], spot, &levers).total_m >= needed_m
        {
            return Finding::Clear;
        }
        let found = separate(&shapes, placed, guess);
        if found.distance_m < needed_m && spot.is_within {
            return Finding::TooNear(found.distance_m);
        }
        let drift = self.drift(pair, found.direction, &placed[0], spot, &levers);
        let lower_bound_m = found.gap_m - drift.total_m;
        if lower_bound_m >= needed_m {
            return Finding::Clear;
        }
        Finding::Open { direction: found.direction, lower_bound_m, lacking_m: needed_m - lower_bound_m, drift }
    }

    /// For each joint that moves the pair, a bound on the distance of the outer shape from its axis over the region, m.
    fn levers(&self, pair: Pair, outer: &Placed, spot: &Spot) -> [f64; MAX_JOINTS] {
        let mut levers = [0.0; MAX_JOINTS];
        let mut beyond_m = 0.0;
        for joint in self.model.joints_between(pair).rev() {
            let axis = vec3(spot.poses.axis(joint));
            let arm = outer.center - vec3(spot.poses.joint_origin(joint));
            let now_m = axis.cross(arm).length() + outer.radius_m;
            // Joints farther out turn the shape away from where it is now.
            let lever_m = f64::min(self.model.lever_m(pair.outer(), joint), now_m + beyond_m);
            levers[joint] = lever_m;
            beyond_m += lever_m * spot.reach_rad[joint];
        }
        levers
    }

    /// The most that the outer shape moves against `direction` within the region.
    fn drift(&self, pair: Pair, direction: Vec3, outer: &Placed, spot: &Spot, levers: &[f64; MAX_JOINTS]) -> Drift {
        let joints: Range<usize> = self.model.joints_between(pair);
        let mut error_m = [0.0; MAX_JOINTS];
        let (mut coarse_m, mut second_m, mut first_m, mut before_rad) = (0.0, 0.0, 0.0, 0.0);
        let (mut along_turn, mut along_m) = (Vec3::ZERO, 0.0);
        let reach_rad: f64 = joints.clone().map(|joint| spot.reach_rad[joint]).sum();
        let (mut split, mut most_m) = (Split::Along, -1.0);
        for joint in joints.clone() {
            // Along the direction a point p moves by `direction . (axis x (p - origin)) = turn . (p - origin)` a radian.
            let turn = direction.cross(vec3(spot.poses.axis(joint)));
            let rate_m = turn.dot(outer.center - vec3(spot.poses.joint_origin(joint)));
            let (half_rad, reach) = (spot.error_half_rad[joint], spot.reach_rad[joint]);
            error_m[joint] = half_rad * rate_m;
            let own_m = half_rad * (rate_m.abs() + outer.extent_m(turn));
            first_m += own_m;
            along_turn += turn * spot.step_rad[joint];
            along_m += rate_m * spot.step_rad[joint];
            coarse_m += levers[joint] * reach;
            second_m += levers[joint] * reach * (0.5 * reach + before_rad);
            before_rad += reach;
            let share_m = own_m + half_rad * levers[joint] * reach_rad;
            if share_m > most_m {
                (split, most_m) = (Split::Error(joint), share_m);
            }
        }
        let own_m = along_m.abs() + outer.extent_m(along_turn);
        first_m += own_m;
        let bent_m: f64 = joints.map(|joint| spot.step_rad[joint].abs() * levers[joint]).sum();
        if own_m + bent_m * reach_rad > most_m {
            split = Split::Along;
        }
        // Without a direction there is no first order.
        let fine_m = if direction == Vec3::ZERO { f64::INFINITY } else { first_m + second_m };
        Drift { total_m: f64::min(coarse_m, fine_m), along_m, error_m, split }
    }

    /// The distance at the corner of the region that the first order says is worst, if that is too near.
    fn worst_corner(&self, pair: Pair, direction: Vec3, region: &Region, drift: &Drift) -> Option<f64> {
        let share = if drift.along_m > 0.0 { region.along[0] } else { region.along[1] };
        let angles = JointAngles::from_fn(self.from.len(), |joint| {
            let believed = self.believed(joint, share);
            let [low, high] = region.error_rad[joint];
            if low == high && low == 0.0 {
                return believed;
            }
            let error_rad = self.bounds.error_rad(joint, believed);
            let offset = if drift.error_m[joint] > 0.0 { low } else { high };
            believed + offset.clamp(-error_rad, error_rad)
        });
        let placed = self.model.placed_pair(pair, &self.model.link_poses(&angles));
        let found = separate(&self.model.shapes(pair), &placed, direction);
        (found.distance_m < self.needed_m(pair)).then_some(found.distance_m)
    }
}

#[cfg(test)]
mod tests;
