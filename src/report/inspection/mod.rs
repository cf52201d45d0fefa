//! Report of `armcal inspect` on a recording: its contents, its completeness, and what could be calibrated from it.
//!
//! One pass over the file counts messages and keeps only marks and the task, so a recording may have any length. With a
//! robot, a second pass keeps the readings within the captured spans and asks `calib` which parameters they determine.
//! `tracking_error` compares readings with set-points.

mod arm;
mod contents;
mod observable_parameters;
mod text;
mod topics;
mod tracking_error;

pub use arm::{ArmContents, TagSeen, TaskSeen};
pub use contents::{Attachment, CompletenessReport, Compression, Inspection, Metadata, State, inspect};
pub use observable_parameters::ObservableParameters;
pub use text::to_text;
pub(in crate::report) use topics::MAX_SAMPLES;
pub use topics::TopicContents;
pub use tracking_error::{JointTrackingError, TrackingError};
