//! Errors of making or using a connection to an arm.

use armcal_core::codes::{Code, Coded};
use armcal_core::robot::RobotError;

/// Reason for which there is no live arm.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum LiveError {
    #[error(transparent)]
    File(#[from] RobotError),
    #[error("DDS: {what}: {problem}")]
    Dds { what: String, problem: String },
    #[error(
        "nobody was seen in ROS domain {domain} in {seconds} s; is the driver running there, and are --domain and \
         --network right?"
    )]
    Nobody { domain: u16, seconds: f64 },
    #[error("rosbridge at {url}: {problem}")]
    Rosbridge { url: String, problem: String },
    #[error(
        "the program grew by {grown_mb} MB since it joined the ROS domain; the limit is {limit_mb} MB. A peer floods \
         the domain or claims samples that are too large: find it, or move the arm to a domain of its own"
    )]
    Memory { grown_mb: u64, limit_mb: u64 },
    #[error("the arm is not ready: {0}")]
    NotReady(String),
    #[error("a message cannot be written: {0}")]
    Encode(#[from] armcal_core::log::EncodeError),
    #[error("no thread can be started: {0}")]
    Thread(#[source] std::io::Error),
}

impl LiveError {
    /// Wraps errors of the middleware, which are of many types.
    pub(crate) fn dds<E: std::fmt::Debug>(what: &str) -> impl FnOnce(E) -> Self {
        move |error| Self::Dds { what: what.to_owned(), problem: format!("{error:?}") }
    }

    pub(crate) fn rosbridge(url: &str, problem: impl Into<String>) -> Self {
        Self::Rosbridge { url: url.to_owned(), problem: problem.into() }
    }
}

impl Coded for LiveError {
    fn code(&self) -> Code {
        match self {
            Self::File(error) => error.code(),
            Self::Dds { .. } | Self::Rosbridge { .. } | Self::Nobody { .. } | Self::Memory { .. } => {
                Code::ArmConnection
            }
            Self::NotReady(_) => Code::ArmNotReady,
            Self::Encode(_) | Self::Thread(_) => Code::Internal,
        }
    }
}
