//! What people read of findings and events: terminal, report, replay and files say the same.
//!
//! `finding` words a finding, or an event as the online belief tells it; `repair` says what to do about it.

mod finding;
mod repair;
mod sentence;

pub(crate) use finding::{drift, event, explanation, offset_walks, slip};
pub use repair::{FailedJoint, Repair, repairs};
pub use sentence::sentence;
