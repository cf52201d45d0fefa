//! Path planning between two configurations.
//!
//! The straight edge is tried first. If it is blocked, RRT-Connect (`rrt_connect`) searches a path, and shortcuts make
//! it faster. An error names the closest goal that can be reached on the straight edge.

use crate::plan::constants::path_planner::{HALVINGS, PLACES, ROUNDING_RAD};
use rand_chacha::ChaCha8Rng;

use crate::plan::clearance::ClosestPair;
use crate::plan::motion::edge::{Edge, Path, SLOWEST};
use crate::plan::path::edge_check::{PathPlanner, between};
use crate::plan::path::error::PathError;
use crate::plan::path::rrt_connect::RrtConnect;
use armcal_core::kinematics::JointLimits;
use armcal_core::streams::JointAngles;

impl PathPlanner<'_> {
    /// Returns a path from `from` to `to`.
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
            None => Err(self.blocked(from, to, &connect)),
        }
    }

    /// Checks that the goal is within the safe limits, or no farther beyond them than the start.
    fn check_limits(&self, from: &JointAngles, to: &JointAngles) -> Result<(), PathError> {
        for (joint, limits) in self.limits.iter().enumerate().filter(|(joint, _)| self.clearance.has_stops(*joint)) {
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
            let (distance_m, needed_m) = (found.true_distance_m(), found.needed_m(self.margin_m));
            return Err(PathError::StartTooNear { nearest: found.to_string(), distance_m, needed_m });
        }
        let too_near = |at: &JointAngles| self.clearance.find_violation_arriving(at, self.bounds, self.margin_m);
        let Some(found) = too_near(to) else { return Ok(()) };
        let free_share = halved(|share| too_near(&between(from, to, share)).is_none());
        Err(PathError::GoalTooNear {
            nearest: found.to_string(),
            distance_m: found.true_distance_m(),
            needed_m: found.needed_m(self.margin_m),
            nearest_free: between(from, to, free_share),
        })
    }

    pub(crate) fn blocked(&self, from: &JointAngles, to: &JointAngles, tried: &RrtConnect<'_, '_>) -> PathError {
        let places = (0..=PLACES).map(|k| between(from, to, f64::from(k) / f64::from(PLACES)));
        let nearest: Option<ClosestPair> = places
            .filter_map(|angles| self.clearance.find_violation(&angles, self.bounds, self.margin_m))
            .min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
            // The violation may be between the sampled points, or caused by the tracking error.
            .or_else(|| {
                let edge = Edge { from: *from, to: *to, time_scale: SLOWEST };
                self.clearance.find_violation_along(&edge, self.bounds, self.margin_m)
            });
        PathError::Blocked {
            tried: tried.n_tried(),
            is_stuck: tried.is_stuck(),
            distance_m: nearest.as_ref().map_or(self.margin_m, ClosestPair::true_distance_m),
            nearest: nearest.map_or_else(String::new, |found| found.to_string()),
            free_share: halved(|share| self.is_edge_free(from, &between(from, to, share))),
        }
    }
}

/// Returns the largest share found for which `holds`, by halving between 0, where it does, and 1, where it does not.
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
