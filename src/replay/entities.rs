//! Paths of the entities that more than one module names.

/// Frames World, Vehicle and Base.
pub(super) const WORLD: &str = "/world";
pub(super) const VEHICLE: &str = "/world/vehicle";
pub(super) const BASE: &str = "/world/vehicle/base";
/// The wrist camera's image plane, raw pixels.
pub(super) const CAMERA: &str = "/camera";
/// Plots.
pub(super) const JOINT_ERROR: &str = "/plots/joint_error";
pub(super) const JOINT_ANGLE: &str = "/plots/joint_angle";
pub(super) const TOOL_ERROR: &str = "/plots/tool_error";
pub(super) const TEMPERATURE: &str = "/plots/temperature";
pub(super) const COUNTS: &str = "/plots/counts";
pub(super) const CLEARANCE: &str = "/plots/clearance";
pub(super) const PREDICTED: &str = "/plots/predicted";
pub(super) const OFFSET_CHANGE: &str = "/plots/offset_change";
/// Distance of a tag's observations from their mean.
pub(super) const SIGHTING: &str = "/plots/sighting";
/// Lanes of states: the viewer names a lane by its path only.
pub(super) const PHASE_LANE: &str = "/phase";
pub(super) const TARGETS_LANE: &str = "/targets";
pub(super) const VIEWS_LANE: &str = "/views";
/// Latest fault of each kind; the viewer sorts lanes by name.
pub(super) const ARM_FAULT_LANE: &str = "/fault_arm";
pub(super) const TAG_FAULT_LANE: &str = "/fault_tag";
pub(super) const SEA_FAULT_LANE: &str = "/fault_sea";
pub(super) const EVENTS_LANE: &str = "/events";
/// The lines of the log.
pub(super) const LOG: &str = "/log";
pub(super) const SUMMARY: &str = "/summary";
