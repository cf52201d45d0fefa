//! Errors of building a world and of recording its truth.

use armcal_core::codes::{Code, Coded};
use std::path::PathBuf;

use armcal_core::robot::{FileIssue, RobotError};
use armcal_core::streams::SinkError;

/// Reason why a simulated world could not be built.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum SimError {
    /// Wrong value in the routine's `[world]`.
    #[error(transparent)]
    Spec(#[from] FileIssue),
    /// Robot without the data of a simulated arm.
    #[error(transparent)]
    Robot(#[from] RobotError),
    #[error("{}: joint `{joint}` has effort limit {effort_n_m}; a simulated joint needs one above 0", file.display())]
    NoEffort { file: PathBuf, joint: String, effort_n_m: f64 },
    #[error(
        "the arm is stowed inside something, or its vehicle is: {} overlap at stowed_rad. Parts of the arm that touch \
         by design belong to allowed_pairs of robot.toml",
        pairs.join(", ")
    )]
    StowedInside { pairs: Vec<String> },
    #[error("the physics engine refused joint `{joint}`")]
    Joint { joint: String },
    #[error("the engine \"rapier\" has no vehicle that floats: use \"featherstone\"")]
    FreeBase,
    #[error("world spec cannot be written as text: {0}")]
    SpecText(#[from] toml::ser::Error),
    #[error(
        "world.camera.mode = \"rendered\": this build of armcal reads no images; build it with `--features images`"
    )]
    ImagesNotBuilt,
    #[error("the tag detector: {0}")]
    Detector(String),
    #[error("an image could not be compressed: {0}")]
    Jpeg(String),
    #[error("the truth could not be kept: {0}")]
    Truth(#[source] SinkError),
    #[error("{}: {problem}", path.display())]
    TruthFile { path: PathBuf, problem: String },
}

impl Coded for SimError {
    fn code(&self) -> Code {
        match self {
            Self::Spec(issue) => issue.code(),
            Self::Robot(error) => error.code(),
            Self::NoEffort { .. } => Code::ValueOutOfRange,
            Self::StowedInside { .. } => Code::ClearanceTooSmall,
            Self::Joint { .. } | Self::FreeBase => Code::SimulationUnsupported,
            Self::ImagesNotBuilt => Code::BuildFeatureMissing,
            Self::SpecText(_) | Self::Detector(_) | Self::Jpeg(_) => Code::Internal,
            Self::Truth(_) => Code::FileUnwritable,
            Self::TruthFile { .. } => Code::TruthInvalid,
        }
    }
}
