//! Interface of the certificate for planning: the pair that some arm within the bounds brings too near.

use crate::plan::bounds::JointErrorBounds;
use crate::plan::certify::sweep::{Certificate, Sweep};
use crate::plan::clearance::{ClearanceModel, ClosestPair};
use crate::plan::motion::TrackingErrorBound;
use crate::plan::motion::edge::Edge;
use armcal_core::streams::JointAngles;

impl ClearanceModel<'_> {
    /// Returns a pair that some arm within `bounds` whose sensors read `believed` brings, or may bring, nearer than
    /// `margin_m`. `None` proves that there is none.
    #[must_use]
    pub fn find_violation(
        &self,
        believed: &JointAngles,
        bounds: &JointErrorBounds,
        margin_m: f64,
    ) -> Option<ClosestPair> {
        self.find_violation_along(&Edge::at_full_speed(*believed, *believed), bounds, margin_m)
    }

    /// Returns a pair that the believed arm, without any error, brings nearer than `margin_m` on the straight edge.
    #[must_use]
    pub fn find_violation_exact(&self, from: &JointAngles, to: &JointAngles, margin_m: f64) -> Option<ClosestPair> {
        Sweep {
            model: self,
            from: *from,
            to: *to,
            bounds: None,
            tracking_error: TrackingErrorBound::default(),
            margin_m,
        }
        .first_too_near()
    }

    /// Does the same as [`Self::find_violation`] for an arm that comes to rest after a slow edge, overshoot included.
    #[must_use]
    pub fn find_violation_arriving(
        &self,
        at: &JointAngles,
        bounds: &JointErrorBounds,
        margin_m: f64,
    ) -> Option<ClosestPair> {
        let (pair, distance_m) = self.certify_arriving(at, bounds, margin_m).violation?;
        Some(self.named(pair, distance_m))
    }

    /// Returns the certificate of an arm that comes to rest after a slow edge, overshoot included.
    pub(crate) fn certify_arriving(&self, at: &JointAngles, bounds: &JointErrorBounds, margin_m: f64) -> Certificate {
        let tracking_error = TrackingErrorBound::arriving(self.robot);
        Sweep { model: self, from: *at, to: *at, bounds: Some(bounds), tracking_error, margin_m }.verdict()
    }

    /// Returns a pair that some arm within `bounds` brings, or may bring, nearer than `margin_m` along an edge. The arm
    /// is driven at the rates of `Timing`, and tracking errors are included.
    #[must_use]
    pub fn find_violation_along(&self, edge: &Edge, bounds: &JointErrorBounds, margin_m: f64) -> Option<ClosestPair> {
        self.sweep(edge, bounds, margin_m).first_too_near()
    }

    pub(crate) fn sweep<'b>(&'b self, edge: &Edge, bounds: &'b JointErrorBounds, margin_m: f64) -> Sweep<'b> {
        let tracking_error = TrackingErrorBound::new(self.robot, &self.timing, edge);
        // The line ends at the middle of the angles where the joints may come to rest.
        let to = JointAngles::from_fn(edge.to.len(), |joint| edge.to[joint] + tracking_error.middle_rad(joint));
        Sweep { model: self, from: edge.from, to, bounds: Some(bounds), tracking_error, margin_m }
    }

    /// Returns the closest pair over every arm within `bounds` whose sensors read `believed`. If all of them are
    /// certified to keep `enough_m`, its distance is at least that. Otherwise it is a pair that does not keep
    /// `enough_m`.
    #[must_use]
    pub fn nearest_under(&self, believed: &JointAngles, bounds: &JointErrorBounds, enough_m: f64) -> ClosestPair {
        self.find_violation(believed, bounds, enough_m).unwrap_or_else(|| {
            let nearest = self.nearest(believed);
            ClosestPair { distance_m: nearest.distance_m.max(enough_m), ..nearest }
        })
    }
}
