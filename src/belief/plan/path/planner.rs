//! The planner of paths between configurations that keep clear for every arm within the joint errors.
//!
//! An edge is certified, not sampled (`certify`). The straight edge is tried first; where it is blocked, an RRT-Connect
//! (`connect`) looks for a way round, and shortcuts make it quick. What cannot be done is said by name, with the nearest
//! that can.

use rand_chacha::ChaCha8Rng;

use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::{ClearanceModel, ClosestPair};
use crate::plan::motion::edge::{Edge, Path, SLOWEST, SLOWNESS};
use crate::plan::motion::tracking_error::TrackingErrorBound;
use crate::plan::path::rrt_connect::RrtConnect;
use armcal_core::kinematics::JointLimits;
use armcal_core::streams::JointAngles;

/// Why there is no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    #[error(
        "no way round was found after {tried} attempts; what blocks the straight way is {nearest} ({distance_m:.3} m), and \
         {free:.0} % of it are free",
        free = 100.0 * free_share
    )]
    Blocked {
        tried: usize,
        nearest: String,
        /// Zero: some arm within the bounds touches.
        distance_m: f64,
        /// How far of the straight way an edge from the start is certified, 0 to 1.
        free_share: f64,
    },
    #[error("the start is too near: {distance_m:.3} m between {nearest}; {needed_m:.3} m are needed (0: in collision)")]
    StartTooNear { nearest: String, distance_m: f64, needed_m: f64 },
    #[error(
        "the goal is too near: {distance_m:.3} m between {nearest}; {needed_m:.3} m are needed (0: in collision); free is the \
         straight way up to {free:.3?} rad",
        free = nearest_free.to_vec()
    )]
    GoalTooNear {
        nearest: String,
        distance_m: f64,
        needed_m: f64,
        /// On the straight line from the start, found by halving it: free itself, the way there not looked at.
        nearest_free: JointAngles,
    },
    #[error(
        "the goal turns joint {joint} to {angle_rad:.3} rad; for every arm within the sensors' error to stay off its stops, \
         {lower_rad:.3} to {upper_rad:.3} rad are left"
    )]
    GoalBeyondLimits { joint: usize, angle_rad: f64, lower_rad: f64, upper_rad: f64 },
}

/// Plans paths under one belief.
#[derive(Clone, Copy)]
pub struct PathPlanner<'a> {
    pub clearance: &'a ClearanceModel<'a>,
    pub bounds: &'a JointErrorBounds,
    pub limits: &'a [JointLimits],
    /// Free water to keep, m.
    pub margin_m: f64,
}

/// Halvings of the straight way when an error names the nearest that works.
const HALVINGS: u32 = 8;
/// Places on the straight way where an error looks for what is nearest.
const PLACES: u32 = 20;
/// Angles this near a limit are within it, rad.
const ROUNDING_RAD: f64 = 1e-9;

impl PathPlanner<'_> {
    /// Whether every arm within the bounds keeps the margin at rest at `angles`.
    #[must_use]
    pub fn is_free(&self, angles: &JointAngles) -> bool {
        self.clearance.find_violation(angles, self.bounds, self.margin_m).is_none()
    }

    /// Whether every arm within the bounds keeps the margin when it comes to `angles` slowly.
    #[must_use]
    pub fn is_free_to_arrive(&self, angles: &JointAngles) -> bool {
        self.clearance.find_violation_arriving(angles, self.bounds, self.margin_m).is_none()
    }

    /// Whether every arm within the bounds keeps the margin along the straight edge, if it goes slowly enough.
    #[must_use]
    pub fn is_edge_free(&self, from: &JointAngles, to: &JointAngles) -> bool {
        self.keeps_clear(&Edge { from: *from, to: *to, time_scale: SLOWEST }, &mut 0)
    }

    /// How slow the straight edge must be driven for that, as little as will do; `None` where no slowness up to `at_most` does.
    /// `n_regions` grows by what it cost.
    pub(crate) fn time_scale(
        &self,
        from: &JointAngles,
        to: &JointAngles,
        at_most: f64,
        n_regions: &mut usize,
    ) -> Option<f64> {
        let mut holds = |slowness| {
            let edge = Edge { from: *from, to: *to, time_scale: slowness };
            self.is_within_limits(&edge) && self.keeps_clear(&edge, n_regions)
        };
        let levels = &SLOWNESS[..SLOWNESS.iter().take_while(|&&slowness| slowness <= at_most).count()];
        let [quickest, .., slowest] = *levels else {
            return levels.first().copied().filter(|&only| holds(only));
        };
        // Most are clear at full speed; of the others, the slowest tells whether to go on.
        if holds(quickest) {
            return Some(quickest);
        }
        if !holds(slowest) {
            return None;
        }
        let (mut too_quick, mut slow) = (0, levels.len() - 1);
        while slow - too_quick > 1 {
            let middle = (too_quick + slow) / 2;
            if holds(levels[middle]) { slow = middle } else { too_quick = middle }
        }
        Some(levels[slow])
    }

    /// Whether every arm within the bounds keeps the margin along the edge at its speed.
    pub(crate) fn keeps_clear(&self, edge: &Edge, n_regions: &mut usize) -> bool {
        let verdict = self.clearance.sweep(edge, self.bounds, self.margin_m).verdict();
        *n_regions += verdict.n_regions;
        verdict.violation.is_none()
    }

    /// Whether no joint overshoots its limits at the end of the edge by more than they leave room for.
    pub(crate) fn is_within_limits(&self, edge: &Edge) -> bool {
        let stray = TrackingErrorBound::new(self.clearance.robot(), self.clearance.timing(), edge);
        let arriving = TrackingErrorBound::arriving(self.clearance.robot());
        (0..self.clearance.n_error_joints()).all(|j| {
            let JointLimits { lower_rad, upper_rad } = self.limits[j];
            let way_rad = edge.to[j] - edge.from[j];
            let left_rad = if way_rad > 0.0 { upper_rad - edge.to[j] } else { edge.to[j] - lower_rad };
            // What is beyond its limits already comes back.
            way_rad == 0.0 || stray.end_rad(j) <= left_rad.max(0.0) + arriving.end_rad(j)
        })
    }

    /// A path from `from` to `to`.
    ///
    /// # Errors
    /// [`PathError`]: start or goal are too near or out of range, or no path was found within the budget.
    pub fn plan(&self, from: &JointAngles, to: &JointAngles, rng: &mut ChaCha8Rng) -> Result<Path, PathError> {
        self.check_limits(from, to)?;
        if let Some(slowness) = self.time_scale(from, to, SLOWEST, &mut 0) {
            let mut path = Path::at(*from);
            path.push(*to, slowness);
            return Ok(path);
        }
        self.check_ends(from, to)?;
        let mut connect = RrtConnect::new(self, from, to);
        match connect.search(rng) {
            Some(waypoints) => Ok(connect.shortened(&waypoints, rng)),
            None => Err(self.blocked(from, to, connect.n_tried())),
        }
    }

    /// A goal may be beyond what is safe only where the start is farther beyond.
    fn check_limits(&self, from: &JointAngles, to: &JointAngles) -> Result<(), PathError> {
        for (joint, limits) in self.limits.iter().enumerate().take(self.clearance.n_error_joints()) {
            let JointLimits { lower_rad, upper_rad } = *limits;
            let beyond_rad = |angle: f64| (lower_rad - angle).max(angle - upper_rad);
            if beyond_rad(to[joint]) > beyond_rad(from[joint]).max(0.0) + ROUNDING_RAD {
                return Err(PathError::GoalBeyondLimits { joint, angle_rad: to[joint], lower_rad, upper_rad });
            }
        }
        Ok(())
    }

    fn check_ends(&self, from: &JointAngles, to: &JointAngles) -> Result<(), PathError> {
        if let Some(found) = self.clearance.find_violation(from, self.bounds, self.margin_m) {
            let (nearest, distance_m) = (found.to_string(), found.distance_m);
            return Err(PathError::StartTooNear { nearest, distance_m, needed_m: self.margin_m });
        }
        let too_near = |at: &JointAngles| self.clearance.find_violation_arriving(at, self.bounds, self.margin_m);
        let Some(found) = too_near(to) else { return Ok(()) };
        let free_share = halved(|share| too_near(&between(from, to, share)).is_none());
        Err(PathError::GoalTooNear {
            nearest: found.to_string(),
            distance_m: found.distance_m,
            needed_m: self.margin_m,
            nearest_free: between(from, to, free_share),
        })
    }

    pub(crate) fn blocked(&self, from: &JointAngles, to: &JointAngles, tried: usize) -> PathError {
        let places = (0..=PLACES).map(|k| between(from, to, f64::from(k) / f64::from(PLACES)));
        let nearest: Option<ClosestPair> = places
            .filter_map(|angles| self.clearance.find_violation(&angles, self.bounds, self.margin_m))
            .min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
            // Between the places, or by what the joints stray on the way.
            .or_else(|| {
                let edge = Edge { from: *from, to: *to, time_scale: SLOWEST };
                self.clearance.find_violation_along(&edge, self.bounds, self.margin_m)
            });
        PathError::Blocked {
            tried,
            distance_m: nearest.as_ref().map_or(self.margin_m, |found| found.distance_m),
            nearest: nearest.map_or_else(String::new, |found| found.to_string()),
            free_share: halved(|share| self.is_edge_free(from, &between(from, to, share))),
        }
    }
}

/// A place on the straight way.
pub(crate) fn between(from: &JointAngles, to: &JointAngles, share: f64) -> JointAngles {
    JointAngles::from_fn(from.len(), |j| if from[j] == to[j] { from[j] } else { from[j] + share * (to[j] - from[j]) })
}

/// The largest share found for which `holds`, by halving between 0, where it does, and 1, where it does not.
fn halved(holds: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
