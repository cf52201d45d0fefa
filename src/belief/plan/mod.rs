//! BELIEF: which poses to look from, and how to get there without touching anything while the joints are still wrong.
//!
//! `bounds` says how far a joint may truly be from where it is believed; `clearance` measures free water for every arm
//! within those bounds; `visibility` predicts which tags a pose sees; `choice` chooses the most telling ones; `path`
//! connects them by edges that are certified, not sampled; `targets` does the same for the reach task; `timing` says how
//! long motions take. `itinerary` puts all of it together before anything moves, `file` is plan.toml.

mod believed;
mod bounds;
mod certify;
mod choice;
mod clearance;
mod connect;
mod edge;
mod ensemble;
mod file;
mod itinerary;
mod pairs;
mod path;
mod separation;
mod shapes;
mod stray;
mod targets;
mod timing;
mod visibility;

pub use bounds::{Elapsed, JointErrorBounds, UnknownScale};
pub use choice::{CaptureState, CapturedView, PlannedPose, PosePlan, PosePool, PoseRequest, StopReason, choose_poses};
pub use clearance::{ClearanceModel, ClosestPair, SELF_MARGIN_REDUCTION_M};
pub use edge::{Edge, Path};
pub use ensemble::{ArmEnsemble, link_ends};
pub use file::{LeftOutTable, PathTable, PlanFile, PlanHeader, PlanTotals, PoseTable, SetName, TagTable};
pub use itinerary::{
    ArmBelief, CapturePlan, ItineraryError, ItineraryRequest, LeastClearance, PlanStop, PlannedVisit, UnreachablePose,
    plan_itinerary,
};
pub use pairs::sample_self_pairs;
pub use path::{PathError, PathPlanner};
pub use stray::TrackingErrorBound;
pub use targets::{TargetRequest, plan_targets};
pub use timing::Timing;
pub use visibility::VisibilityModel;

use armcal_core::kinematics::IkError;

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    #[error("target {target} at ({x:.3}, {y:.3}, {z:.3}) m: {source}", x = at_m[0], y = at_m[1], z = at_m[2])]
    TargetOutOfReach { target: usize, at_m: [f64; 3], source: IkError },
    #[error(
        "target {target} at ({x:.3}, {y:.3}, {z:.3}) m: reached only with {clearance_m:.3} m of clearance between \
         {nearest}; {needed_m:.3} m are needed for every arm within the sensors' error",
        x = at_m[0], y = at_m[1], z = at_m[2]
    )]
    TargetTooClose { target: usize, at_m: [f64; 3], clearance_m: f64, nearest: String, needed_m: f64 },
    #[error(
        "the arm starts too close: {clearance_m:.3} m between {nearest}; {needed_m:.3} m are needed (0: in collision)"
    )]
    StartTooClose { clearance_m: f64, nearest: String, needed_m: f64 },
    #[error(
        "no pose was found that sees {min_tags} of the {n_tags} surveyed tags and keeps {clearance_m:.3} m clear ({tried} tried): {hint}"
    )]
    NoUsefulPose { min_tags: u32, n_tags: usize, clearance_m: f64, tried: usize, hint: String },
    #[error("no pose was found that sees {min_tags} of the {n_tags} surveyed tags: min_tags may be 1 to {n_tags}")]
    TooFewTags { min_tags: u32, n_tags: usize },
    #[error("only {found} of {wanted} poses were found that see {min_tags} tags and keep clear: {hint}")]
    TooFewPoses { found: usize, wanted: usize, min_tags: u32, hint: String },
    #[error(transparent)]
    Path(#[from] PathError),
}
