//! Errors of a compact calibration.

use crate::file::compact::precision::MAX_COMPACT_BYTES;
use armcal_core::codes::{Code, Coded};
use armcal_core::streams::MAX_JOINTS;

/// Reason why a calibration has no compact form, or why a text is no compact calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum CompactError {
    #[error("no compact calibration: it does not begin with `armcal1` or `armcal2`")]
    NotCompact,
    #[error("compact calibration: version `{found}` is not known; this program reads `armcal1` and `armcal2`")]
    Version { found: String },
    #[error("compact calibration: damaged on its way: the checksum is #{expected}, the text says {found}")]
    Checksum { expected: String, found: String },
    #[error("compact calibration: {field}: `{found}` is not {expected}")]
    Field { field: String, found: String, expected: &'static str },
    #[error("compact calibration: {joints} joints, there may be 1 to {MAX_JOINTS}")]
    Joints { joints: usize },
    #[error("joint `{joint}`: {what} is beyond what the compact form holds")]
    Range { joint: String, what: &'static str },
    #[error("joint `{joint}`: calibration.toml does not tell its gain relative to the datasheet")]
    NoRelativeGain { joint: String },
    #[error("joint `{joint}` slides, and the compact form has angles alone: give calibration.toml")]
    Slide { joint: String },
    #[error("joint `{joint}`: terms about a scale that was measured on the way have no compact form")]
    MeasuredScale { joint: String },
    #[error(
        "link geometry or sag was estimated and has no compact form: a robot needs `[[link]]` and `[sag]` of \
             calibration.toml, too"
    )]
    Links,
    #[error("the compact form has {bytes} bytes, must be below {MAX_COMPACT_BYTES}")]
    TooLong { bytes: usize },
    #[error("compact calibration: was made for robot `{found}`, not for `{expected}`, or for other joints of it")]
    OtherRobot { found: String, expected: String },
}

impl Coded for CompactError {
    fn code(&self) -> Code {
        match self {
            Self::NotCompact | Self::Field { .. } | Self::Joints { .. } | Self::Checksum { .. } => Code::CompactInvalid,
            Self::Version { .. } => Code::VersionUnsupported,
            Self::Range { .. }
            | Self::NoRelativeGain { .. }
            | Self::Slide { .. }
            | Self::MeasuredScale { .. }
            | Self::TooLong { .. }
            | Self::Links => Code::CompactUnsupported,
            Self::OtherRobot { .. } => Code::RobotMismatch,
        }
    }
}
