//! Planning: calibration views, and paths that keep the margin while the joint sensors are not yet calibrated.
//!
//! `bounds`: joint error bounds; `motion`: time scaling and tracking error; `clearance`: distances of one arm to its
//! environment; `certify`: the proof for every arm within the bounds; `path`: RRT-Connect over certified edges;
//! `visibility`: visible tags; `view_planning`: views to capture; `targets`: the reach task. `capture_plan` combines
//! them before the first motion, with `declared_failures` held and `shortfalls` named; `file` is plan.toml;
//! `scene_check` has the checks of `armcal check`.

mod bounds;
mod capture_plan;
mod certify;
mod clearance;
pub(crate) mod constants;
mod declared_failures;
mod error;
mod file;
mod motion;
mod path;
mod scene_check;
mod shortfalls;
mod targets;
mod view_planning;
mod visibility;

pub use bounds::{ArmEnsemble, Elapsed, JointErrorBounds, UnknownScale, link_ends};
pub use capture_plan::{
    ArmBelief, CapturePlan, ItineraryError, ItineraryRequest, LeastClearance, PlannedVisit, UnreachablePose,
    plan_itinerary,
};
pub use clearance::{
    ClearanceModel, ClosestPair, SELF_MARGIN_REDUCTION_M, always_near, clear_angles, sample_self_pairs,
};
pub use error::PlanError;
pub use file::{
    LeftOutTable, PathTable, PlanFile, PlanHeader, PlanTotals, PoseTable, SetName, TagTable, count_digits, plan_schema,
};
pub use motion::{Edge, Path, Timing, TrackingErrorBound};
pub use path::{PathError, PathPlanner};
pub use scene_check::{SceneCheck, SceneIssues};
pub use targets::{TargetRequest, grips_at_first, plan_targets, plan_task};
pub use view_planning::{
    CaptureState, CapturedView, PlannedPose, PosePlan, PosePool, PoseRequest, StopReason, choose_poses,
};
pub use visibility::VisibilityModel;
