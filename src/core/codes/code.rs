//! The codes themselves.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Declares the codes, each with the text that scripts read.
macro_rules! codes {
    ($($variant:ident = $text:literal,)*) => {
        /// Stable name of one error, refusal, warning or finding.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[expect(missing_docs, reason = "explanations.toml documents each code")]
        pub enum Code {
            $($variant,)*
        }

        impl Code {
            /// All codes in the order of this file.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// Text of the code in snake case.
            #[must_use]
            pub const fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)*
                }
            }
        }
    };
}

codes! {
    // Command line, files and their keys.
    UsageInvalid = "usage_invalid",
    BuildFeatureMissing = "build_feature_missing",
    FileUnreadable = "file_unreadable",
    FileUnwritable = "file_unwritable",
    FileExists = "file_exists",
    FileFormat = "file_format",
    FileKind = "file_kind",
    FileSyntax = "file_syntax",
    VersionUnsupported = "version_unsupported",
    KeyUnknown = "key_unknown",
    KeyMissing = "key_missing",
    KeysConflict = "keys_conflict",
    ValueType = "value_type",
    ValueOutOfRange = "value_out_of_range",
    ValueCount = "value_count",
    ValueDuplicate = "value_duplicate",
    ValueInvalid = "value_invalid",
    NameUnknown = "name_unknown",
    UrdfStructure = "urdf_structure",
    MeshUnusable = "mesh_unusable",
    RobotMismatch = "robot_mismatch",
    CovarianceMismatch = "covariance_mismatch",
    CompactInvalid = "compact_invalid",
    CompactUnsupported = "compact_unsupported",
    // Recordings.
    RecordingFormat = "recording_format",
    RecordingChanged = "recording_changed",
    RecordingTooLong = "recording_too_long",
    RecordingDuplicate = "recording_duplicate",
    TopicMissing = "topic_missing",
    MessageType = "message_type",
    MessageInvalid = "message_invalid",
    StampsDisordered = "stamps_disordered",
    ClocksDiffer = "clocks_differ",
    JointsMismatch = "joints_mismatch",
    InputUnit = "input_unit",
    CameraInfoInvalid = "camera_info_invalid",
    ImageInvalid = "image_invalid",
    TableInvalid = "table_invalid",
    TruthInvalid = "truth_invalid",
    // Data that no calibration or map can be made of.
    ReadingsMissing = "readings_missing",
    ViewsMissing = "views_missing",
    TagsNotSeen = "tags_not_seen",
    SurveysConflict = "surveys_conflict",
    ArmNotMoved = "arm_not_moved",
    NothingObservable = "nothing_observable",
    ScaleUnmeasured = "scale_unmeasured",
    MapFailed = "map_failed",
    PriorUnusable = "prior_unusable",
    // Plans.
    TargetOutOfReach = "target_out_of_reach",
    ClearanceTooSmall = "clearance_too_small",
    PosesMissing = "poses_missing",
    PathNotFound = "path_not_found",
    JointLimit = "joint_limit",
    StepImpossible = "step_impossible",
    // Arms, simulated and real.
    CaptureFailed = "capture_failed",
    Interrupted = "interrupted",
    ArmStopped = "arm_stopped",
    ArmNotReady = "arm_not_ready",
    ArmConnection = "arm_connection",
    SetPointInvalid = "set_point_invalid",
    SimulationUnstable = "simulation_unstable",
    SimulationUnsupported = "simulation_unsupported",
    ReadingsStale = "readings_stale",
    ReadingsFrozen = "readings_frozen",
    ReadingJumped = "reading_jumped",
    ClockJumped = "clock_jumped",
    DeadmanReleased = "deadman_released",
    JointNotFollowing = "joint_not_following",
    SetPointsReversed = "set_points_reversed",
    SetPointsScaled = "set_points_scaled",
    SetPointsExchanged = "set_points_exchanged",
    // Campaigns and the viewer.
    CampaignChanged = "campaign_changed",
    CampaignBusy = "campaign_busy",
    CampaignIncomplete = "campaign_incomplete",
    ViewerMissing = "viewer_missing",
    Internal = "internal",
    // Refusals.
    TooFewViews = "too_few_views",
    NotSolved = "not_solved",
    TooFewHeldOutViews = "too_few_held_out_views",
    NoHeldOutTag = "no_held_out_tag",
    NoBetterThanDatasheet = "no_better_than_datasheet",
    NoBetterThanBaseline = "no_better_than_baseline",
    Overfitted = "overfitted",
    BeyondTolerance = "beyond_tolerance",
    PriorsBeyondTolerance = "priors_beyond_tolerance",
    TargetsNotJudged = "targets_not_judged",
    TargetsNotCovered = "targets_not_covered",
    HeldOutError = "held_out_error",
    InputRotation = "input_rotation",
    InputOrder = "input_order",
    InputDirection = "input_direction",
    InputImageSize = "input_image_size",
    InputLensModel = "input_lens_model",
    InputTagSize = "input_tag_size",
    InputTagIds = "input_tag_ids",
    InputMapAxes = "input_map_axes",
    InputTagMap = "input_tag_map",
    RotationNoise = "rotation_noise",
    SensorUnit = "sensor_unit",
    JointsExchanged = "joints_exchanged",
    JointsCoupled = "joints_coupled",
    JointsAlike = "joints_alike",
    JointZeros = "joint_zeros",
    JointTurns = "joint_turns",
    ReadingsShifted = "readings_shifted",
    InputCamera = "input_camera",
    InputCornerOrder = "input_corner_order",
    InputTagFrames = "input_tag_frames",
    InputMapUnit = "input_map_unit",
    InputPoseUnit = "input_pose_unit",
    MapFrame = "map_frame",
    MovedBetweenViews = "moved_between_views",
    RepairTooLarge = "repair_too_large",
    LensContradicted = "lens_contradicted",
    GeometryContradicted = "geometry_contradicted",
    SensorError = "sensor_error",
    OffsetsWalk = "offsets_walk",
    Nonlinearity = "nonlinearity",
    CornerNoise = "corner_noise",
    BeyondDatasheet = "beyond_datasheet",
    TooManyOutliers = "too_many_outliers",
    Innovations = "innovations",
    TouchContradicted = "touch_contradicted",
    LengthContradicted = "length_contradicted",
    PriorReused = "prior_reused",
    PriorSingular = "prior_singular",
    PriorUntested = "prior_untested",
    PriorContradicted = "prior_contradicted",
    TooFewViewsSinceSlip = "too_few_views_since_slip",
    SlipNotEstimated = "slip_not_estimated",
    SensorLine = "sensor_line",
    SensorNeeded = "sensor_needed",
    // Findings.
    TagMoved = "tag_moved",
    TagsMoved = "tags_moved",
    TagSize = "tag_size",
    TagSwapped = "tag_swapped",
    TagLeftOut = "tag_left_out",
    Lens = "lens",
    Link = "link",
    Sag = "sag",
    CameraMount = "camera_mount",
    Base = "base",
    Tool = "tool",
    SensorSlip = "sensor_slip",
    SensorReversed = "sensor_reversed",
    SensorScale = "sensor_scale",
    SensorFailed = "sensor_failed",
    SensorWorn = "sensor_worn",
    SensorUnusual = "sensor_unusual",
    OffsetWalks = "offset_walks",
    Outliers = "outliers",
    // Warnings.
    LengthUnused = "length_unused",
    LinksUnobservable = "links_unobservable",
    SensorsUnconfirmed = "sensors_unconfirmed",
    GeometryDoubtful = "geometry_doubtful",
    JointNoise = "joint_noise",
    CornersNoisy = "corners_noisy",
    InnovationsLarge = "innovations_large",
    ErrorsCorrelated = "errors_correlated",
    ScaleAtBound = "scale_at_bound",
    MapGroupsApart = "map_groups_apart",
    MapTagDisagrees = "map_tag_disagrees",
    MapTagSize = "map_tag_size",
    MapNotConverged = "map_not_converged",
    MapUndetermined = "map_undetermined",
    MapDetectionsRejected = "map_detections_rejected",
    KeyIgnored = "key_ignored",
    RecordingDamaged = "recording_damaged",
    MessagesRejected = "messages_rejected",
    StampsReplaced = "stamps_replaced",
    ChunksDisordered = "chunks_disordered",
    InputUnitDoubtful = "input_unit_doubtful",
    UrdfSkipped = "urdf_skipped",
    PlanningIncomplete = "planning_incomplete",
    TagHidden = "tag_hidden",
    TargetSkipped = "target_skipped",
    PoseSkipped = "pose_skipped",
    WorldBeyondDatasheet = "world_beyond_datasheet",
    ExportIncomplete = "export_incomplete",
    ReplayMissing = "replay_missing",
    ReplayIncomplete = "replay_incomplete",
    RunLeftOver = "run_left_over",
    TagsUnknown = "tags_unknown",
    ViewsLeftOut = "views_left_out",
    TaskMissing = "task_missing",
    FileOutdated = "file_outdated",
    JointsIgnored = "joints_ignored",
    JointAssumed = "joint_assumed",
    ViewerLost = "viewer_lost",
    ResultKept = "result_kept",
    NotCovered = "not_covered",
    NotIncluded = "not_included",
    ImagesFrozen = "images_frozen",
    BaseDoubtful = "base_doubtful",
    LensChanged = "lens_changed",
}

/// Types that have a code: errors, refusals, findings.
pub trait Coded {
    /// Code of this value.
    fn code(&self) -> Code;
}

/// Error: a text that is not a code.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is no code; `armcal explain` lists all")]
pub struct UnknownCode {
    /// The text that was read.
    pub text: String,
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Code {
    type Err = UnknownCode;

    fn from_str(text: &str) -> Result<Self, UnknownCode> {
        let found = Self::ALL.iter().find(|code| code.as_str() == text);
        found.copied().ok_or_else(|| UnknownCode { text: text.to_owned() })
    }
}

impl JsonSchema for Code {
    fn schema_name() -> Cow<'static, str> {
        "Code".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<&str> = Self::ALL.iter().map(|code| code.as_str()).collect();
        json_schema!({ "type": "string", "enum": names })
    }
}

impl Serialize for Code {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for Code {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}
