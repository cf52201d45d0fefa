//! Errors of recordings, and reasons for the rejection of single messages.

use crate::codes::{Code, Coded};
use std::path::PathBuf;

use super::cdr::CdrError;
use crate::time::Stamp;

/// Reason why a recording could not be read or written at all.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum LogError {
    #[error("{}: cannot be read: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{}: the file is empty, not a recording", path.display())]
    Empty { path: PathBuf },
    #[error("{}: not an MCAP recording: {found}", path.display())]
    NotMcap { path: PathBuf, found: String },
    #[error("{}: not a ROS 2 bag: {found}", path.display())]
    NotBag { path: PathBuf, found: String },
    #[error("{}: it was cut to {bytes} bytes while it was read; {read} bytes were read before", path.display())]
    Truncated { path: PathBuf, bytes: u64, read: u64 },
    #[error("{}: another recording took its place while it was read", path.display())]
    Replaced { path: PathBuf },
    #[error("{}: the directory {} does not exist", path.display(), directory.display())]
    NoDirectory { path: PathBuf, directory: PathBuf },
    #[error("{}: cannot be created: {source}", path.display())]
    Create { path: PathBuf, source: std::io::Error },
    #[error("{}: source and destination are one file", path.display())]
    SameFile { path: PathBuf },
    #[error("{}: cannot be written: {source}", path.display())]
    Write { path: PathBuf, source: mcap::McapError },
    #[error("{}: topic {topic}: {source}", path.display())]
    Encode { path: PathBuf, topic: String, source: EncodeError },
    #[error("{}: topic {topic} holds {first} and cannot hold {now} as well", path.display())]
    SchemaChanged { path: PathBuf, topic: String, first: String, now: String },
    #[error("{}: an image's messages did not come: {source}", path.display())]
    Late { path: PathBuf, source: crate::streams::LateError },
}

/// Reason why a message cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum EncodeError {
    #[error("the message has {got} joints, the recording names {expected}")]
    JointCount { got: usize, expected: usize },
    #[error("the stamp {} ns is outside the range of a ROS time, the years 1901 to 2038", stamp.nanos)]
    StampRange { stamp: Stamp },
    #[error("the log time {} ns lies before 1970", log_time.nanos)]
    LogTimeRange { log_time: Stamp },
    #[error("tag id {id} exceeds the largest id, {}", i32::MAX)]
    TagId { id: u32 },
    #[error(transparent)]
    Cdr(#[from] CdrError),
}

/// Reason why a message of a recording is rejected. Rejections are counted by topic and reported.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum DecodeRejection {
    #[error("message encoding is {found:?}, not \"cdr\"")]
    MessageEncoding { found: String },
    #[error("type is {found:?}, not {expected:?}")]
    Type { found: String, expected: &'static str },
    #[error("cannot be decoded: {0}")]
    Undecodable(#[from] CdrError),
    #[error("log time is past the year 2262")]
    LogTimeRange,
    #[error("stamp has {nanosec} ns in its second")]
    StampNanos { nanosec: u32 },
    #[error("{field} is not finite")]
    NotFinite { field: &'static str },
    #[error("{names} names for {positions} positions")]
    NameCount { names: usize, positions: usize },
    #[error("{got} joints, the recording began with {expected}")]
    JointCount { got: usize, expected: usize },
    #[error("{got} joints, the most that an arm may have is {}", crate::streams::MAX_JOINTS)]
    TooManyJoints { got: usize },
    #[error("no joints")]
    NoJoints,
    #[error("joint names differ from those that the topic began with")]
    NamesChanged,
    #[error("joint names differ from those of the joint sensors")]
    OtherJoints,
    #[error("a tag id is negative")]
    NegativeTagId,
    #[error("variance is negative")]
    NegativeVariance,
    #[error("the sensor gives no orientation")]
    NoOrientation,
    #[error("the quaternion's length differs from 1 by more than 1 %")]
    QuaternionLength,
    #[error("tolerance_m is not above 0")]
    Tolerance,
    #[error("a surveyed tag has no size")]
    TagSize,
    #[error("the survey has a tag twice")]
    TagTwice,
    #[error("the survey's base tag is none of its tags")]
    NoBaseTag,
    #[error("the normal's length differs from 1 by more than 1 %")]
    NormalLength,
    #[error("std_m is not above 0, or tip_radius_m below 0")]
    TouchSize,
    #[error("unknown reason for a reject")]
    UnknownReason,
    #[error("an image that is no JPEG")]
    ImageFormat,
    #[error("unknown kind of mark")]
    MarkKind,
    #[error("the mark ends before it starts")]
    MarkSpan,
}

impl Coded for LogError {
    fn code(&self) -> Code {
        match self {
            Self::Read { .. } => Code::FileUnreadable,
            Self::Empty { .. } | Self::NotMcap { .. } | Self::NotBag { .. } => Code::RecordingFormat,
            Self::Truncated { .. } | Self::Replaced { .. } => Code::RecordingChanged,
            Self::NoDirectory { .. } | Self::Create { .. } | Self::SameFile { .. } | Self::Write { .. } => {
                Code::FileUnwritable
            }
            Self::Encode { .. } | Self::SchemaChanged { .. } | Self::Late { .. } => Code::Internal,
        }
    }
}
