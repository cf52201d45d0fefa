//! Errors of a replay.

use armcal_core::codes::{Code, Coded};
use std::path::PathBuf;

use re_log_encoding::EncodeError;

use armcal_core::log::{CdrError, LogError};

/// Error of writing an .rrd file.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    #[error("{}: the recording has no messages, there is nothing to show", path.display())]
    Empty { path: PathBuf },
    #[error("{}: the recording has {got} joints, the robot `{robot}` has {expected}", path.display())]
    JointCount { path: PathBuf, robot: String, got: usize, expected: usize },
    #[error("{}: the recording spans {got_s:.0} s; the viewer shows at most {limit_s:.0} s", path.display())]
    TooLong { path: PathBuf, got_s: f64, limit_s: f64 },
    #[error(transparent)]
    Truth(#[from] LogError),
    #[error("{}: no topic begins with /truth/; is it a truth file?", path.display())]
    NoTruth { path: PathBuf },
    #[error("{}: topic {topic}: {source}", path.display())]
    TruthMessage { path: PathBuf, topic: String, source: CdrError },
    #[error("{}: topic {topic}: joints {got:?}, the robot has {expected:?}", path.display())]
    TruthJoints { path: PathBuf, topic: String, got: Vec<String>, expected: Vec<String> },
    #[error("{}: cannot be written: {source}", path.display())]
    Create { path: PathBuf, source: std::io::Error },
    #[error("{}: cannot be written: {source}", path.display())]
    Encode { path: PathBuf, source: EncodeError },
    #[error("the viewer takes no data: {0}")]
    Live(EncodeError),
    #[error("{address} is no address of a viewer; it must be HOST:PORT, such as 127.0.0.1:9876")]
    Address { address: String },
    #[error("no viewer took it at {address}; start one with `rerun --bind 127.0.0.1`, or use --save FILE.rrd")]
    NoViewer { address: String },
    #[error("no thread can be started: {source}")]
    Thread { source: std::io::Error },
}

impl Coded for ReplayError {
    fn code(&self) -> Code {
        match self {
            Self::Empty { .. } => Code::RecordingFormat,
            Self::JointCount { .. } => Code::JointsMismatch,
            Self::TooLong { .. } => Code::RecordingTooLong,
            Self::Truth(error) => error.code(),
            Self::NoTruth { .. } | Self::TruthMessage { .. } | Self::TruthJoints { .. } => Code::TruthInvalid,
            Self::Create { .. } | Self::Encode { .. } => Code::FileUnwritable,
            Self::Live(_) | Self::NoViewer { .. } => Code::ViewerMissing,
            Self::Address { .. } => Code::UsageInvalid,
            Self::Thread { .. } => Code::Internal,
        }
    }
}
