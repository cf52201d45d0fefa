//! Checks of configurations and edges for every arm within the joint errors.

use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::ClearanceModel;
use crate::plan::motion::edge::{Edge, SLOWEST, SLOWNESS};
use crate::plan::motion::tracking_error::TrackingErrorBound;
use armcal_core::kinematics::JointLimits;
use armcal_core::streams::JointAngles;

/// Plans paths under one belief.
#[derive(Clone, Copy)]
pub struct PathPlanner<'a> {
    /// The arm and its environment.
    pub clearance: &'a ClearanceModel<'a>,
    /// Joint errors for which the margin is kept.
    pub bounds: &'a JointErrorBounds,
    /// Range of the believed angles, one per joint.
    pub limits: &'a [JointLimits],
    /// Clearance to keep, m.
    pub margin_m: f64,
}

impl PathPlanner<'_> {
    /// True if every arm within the bounds keeps the margin at rest at `angles`.
    #[must_use]
    pub fn is_free(&self, angles: &JointAngles) -> bool {
        self.clearance.find_violation(angles, self.bounds, self.margin_m).is_none()
    }

    /// True if every arm within the bounds keeps the margin when it arrives slowly at `angles`.
    #[must_use]
    pub fn is_free_to_arrive(&self, angles: &JointAngles) -> bool {
        self.clearance.find_violation_arriving(angles, self.bounds, self.margin_m).is_none()
    }

    /// True if every arm within the bounds keeps the margin along the straight edge at the lowest speed.
    #[must_use]
    pub fn is_edge_free(&self, from: &JointAngles, to: &JointAngles) -> bool {
        self.keeps_clear(&Edge { from: *from, to: *to, time_scale: SLOWEST }, &mut 0)
    }

    /// Returns the least time scaling at which the straight edge keeps the margin; `None` if none up to `at_most` does.
    /// `n_regions` grows by the number of tested regions.
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
        // Most edges are clear at full speed; for the others, the slowest decides whether to continue.
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

    /// True if every arm within the bounds keeps the margin along the edge at its speed.
    pub(crate) fn keeps_clear(&self, edge: &Edge, n_regions: &mut usize) -> bool {
        let verdict = self.clearance.sweep(edge, self.bounds, self.margin_m).verdict();
        *n_regions += verdict.n_regions;
        verdict.violation.is_none()
    }

    /// True if no joint overshoots its limits at the end of the edge by more than the room that they leave.
    pub(crate) fn is_within_limits(&self, edge: &Edge) -> bool {
        let tracking_error = TrackingErrorBound::new(self.clearance.robot(), self.clearance.timing(), edge);
        let arriving = TrackingErrorBound::arriving(self.clearance.robot());
        (0..edge.to.len()).filter(|&j| self.clearance.has_stops(j)).all(|j| {
            let JointLimits { lower_rad, upper_rad } = self.limits[j];
            let way_rad = edge.to[j] - edge.from[j];
            let left_rad = if way_rad > 0.0 { upper_rad - edge.to[j] } else { edge.to[j] - lower_rad };
            // A joint already beyond its limits may return.
            way_rad == 0.0 || tracking_error.end_rad(j) <= left_rad.max(0.0) + arriving.end_rad(j)
        })
    }
}

/// Returns a point on the straight edge.
pub(crate) fn between(from: &JointAngles, to: &JointAngles, share: f64) -> JointAngles {
    JointAngles::from_fn(from.len(), |j| if from[j] == to[j] { from[j] } else { from[j] + share * (to[j] - from[j]) })
}
