//! Errors that prevent a calibration.

use armcal_core::codes::{Code, Coded};
use armcal_core::log::StampRegression;
use armcal_core::robot::{JointSensorSpec, Robot};

/// Reason why there is no calibration at all; a poor calibration is refused instead.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum CalibError {
    #[error(
        "{recording}: the joints {recorded:?} are not those of robot `{robot}`: {expected:?}; name the folder of that \
         robot, or, where it is of another program, give an input map with --input; `armcal inspect {recording} \
         --write-input MAP.toml` proposes one"
    )]
    JointNames { recording: String, robot: String, recorded: Vec<String>, expected: Vec<String> },
    #[error(
        "{recording}: holds no joint readings as armcal records them (topic /joint_sensors): where it is of another \
         program, give an input map with --input; `armcal inspect {recording} --write-input MAP.toml` proposes one"
    )]
    NoReadings { recording: String },
    #[error(
        "{recording}: holds no captured views (no marks `capture_fit` on /marks), so there is nothing to fit; capture \
         views again, or, where it is of another program, give an input map with --input"
    )]
    NoCaptures { recording: String },
    #[error("{recording}: holds no view to fit; the arm came to rest for held-out views alone ({held_out})")]
    NoFitViews { recording: String, held_out: usize },
    #[error("{recording}: {}", no_tags(robot, known, seen))]
    NoTags { recording: String, robot: String, known: Vec<u32>, seen: Vec<u32> },
    #[error("{recording}: only {views} captured views show a surveyed tag; at least {needed} are needed")]
    TooFewViews { recording: String, views: usize, needed: usize },
    #[error("{recording}: no joint lies between the base and the camera with a sensor that the views determine")]
    NothingObservable { recording: String },
    #[error(
        "{robot}: `gain_std` and `offset_std_rad` (of a slide `offset_std_m`) are 0 for every joint before the camera, \
         which holds all their sensors at the datasheet, so nothing is left to calibrate; state one above 0, \
         `gain_std` up to 10 or `offset_std_rad` up to 6.3"
    )]
    AllHeld { robot: String },
    #[error(
        "{recording}: {joint} is declared locked, but its readings move by {moved} over the views, and so does the \
         joint in the camera's sight; take the declaration back, or declare its sensor (dead, stuck or jumps)"
    )]
    DeclaredLocked { recording: String, joint: String, moved: String },
    #[error("{recording}: no joint can be calibrated by its end stops: {problem}")]
    NoStops { recording: String, problem: String },
    #[error("{recording}: no map of the tags can be made from its views: {problem}")]
    Map { recording: String, problem: String },
    #[error("the scale of joint `{joint}` cannot be measured: {problem}")]
    Identify { joint: String, problem: String },
    #[error(
        "{recording}: all {views} views are of one pose: between base and camera, no joint moved by more than its \
         noise (the most: `{joint}`, {moved}), so nothing can be told of any; check the topic and \
         joint_sensors.unit of the joint readings, or capture views at different poses"
    )]
    OnePose { recording: String, views: usize, joint: String, moved: String },
    #[error("{recording}: no interim estimate: {problem}")]
    NoInterimEstimate { recording: String, problem: String },
    #[error("{recording}: duplicate recording: give each recording once")]
    Twice { recording: String },
    #[error("{one} and {other} say different things of the tags; give a tag map that holds for both")]
    Surveys { one: String, other: String },
    #[error(
        "{recording}: the prior says how the arm bends under its weight, which is not estimated before a camera that \
         stands still; calibrate without --prior, or start from a calibration before this camera"
    )]
    PriorSag { recording: String },
    #[error("{recording}: {n} of {of} messages rejected on {what}: too many to go on")]
    NotFinite { recording: String, what: String, n: u64, of: u64 },
    #[error("{recording}: the corners of {n} of {of} tags run the wrong way round, as in a mirror; {todo}")]
    CornerOrder { recording: String, n: usize, of: usize, todo: &'static str },
    #[error("{recording}: no view is left: {reasons}; {todo}")]
    AllRejected { recording: String, reasons: String, todo: &'static str },
    #[error(
        "{recording}: no view is left: {reasons}; the camera stands still, and so do the tags: `frame` of the tag map \
         (tag_link of robot.toml) must name the link that carries the tags"
    )]
    StandingTags { recording: String, reasons: String },
    #[error("{recording}: {problem}")]
    Clocks { recording: String, problem: String },
    #[error("{recording}: topic {topic}: {disorder}")]
    Disorder { recording: String, topic: String, disorder: StampRegression },
}

impl CalibError {
    /// Returns the error of a recording that determines no sensor of `robot`, or that of a robot whose file holds all.
    pub(crate) fn nothing_observable(recording: &str, robot: &Robot) -> Self {
        let seen = &robot.sensors[..robot.n_seen_joints()];
        let is_held = |sensor: &JointSensorSpec| sensor.gain_std <= 0.0 && sensor.offset_std_rad <= 0.0;
        if !seen.is_empty() && seen.iter().all(is_held) {
            return Self::AllHeld { robot: robot.folder.join("robot.toml").display().to_string() };
        }
        Self::NothingObservable { recording: recording.to_owned() }
    }
}

/// Returns the known tags, the detected tags, and the remedy, in words.
fn no_tags(robot: &str, known: &[u32], seen: &[u32]) -> String {
    let todo = if seen.is_empty() {
        "the camera saw no tag at all: check its images, light and water, and the topic of the tags"
    } else {
        "correct the ids in the tag map or in robot.toml"
    };
    format!("no surveyed tag was seen in any view to fit; tags of robot `{robot}`: {known:?}, seen: {seen:?}; {todo}")
}

impl Coded for CalibError {
    fn code(&self) -> Code {
        match self {
            Self::JointNames { .. } => Code::JointsMismatch,
            Self::NoReadings { .. } => Code::ReadingsMissing,
            Self::NoCaptures { .. }
            | Self::NoFitViews { .. }
            | Self::TooFewViews { .. }
            | Self::AllRejected { .. }
            | Self::StandingTags { .. }
            | Self::NoInterimEstimate { .. } => Code::ViewsMissing,
            Self::NoTags { .. } => Code::TagsNotSeen,
            Self::CornerOrder { .. } => Code::InputCornerOrder,
            Self::NothingObservable { .. } | Self::AllHeld { .. } | Self::NoStops { .. } => Code::NothingObservable,
            Self::Map { .. } => Code::MapFailed,
            Self::Identify { .. } => Code::ScaleUnmeasured,
            Self::DeclaredLocked { .. } => Code::ValueInvalid,
            Self::OnePose { .. } => Code::ArmNotMoved,
            Self::Twice { .. } => Code::RecordingDuplicate,
            Self::Surveys { .. } => Code::SurveysConflict,
            Self::PriorSag { .. } => Code::PriorUnusable,
            Self::NotFinite { .. } => Code::MessageInvalid,
            Self::Clocks { .. } => Code::ClocksDiffer,
            Self::Disorder { .. } => Code::StampsDisordered,
        }
    }
}
