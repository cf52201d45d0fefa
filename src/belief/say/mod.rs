//! Findings and events in words: the same in terminal, report, replay and files.
//!
//! `finding` words a finding, or an event as the online belief tells it; `repair` says what to do about it.

mod finding;
mod repair;
mod sentence;

pub(crate) use finding::{drift, event, explanation, offset_walks, slip};
pub use repair::{FailedJoint, Repair, repairs};
pub use sentence::sentence;
