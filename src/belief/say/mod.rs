//! Statements about a calibration, and their words: the same in terminal, report, replay and files.
//!
//! `finding` is a difference from the stated values, `refusal` why a result must not be used (`wrong_input`,
//! `reading_error`, `geometry_error`, `moved_body` are causes), `reservation` its limits. `doubt` holds reasons not to
//! rely on an online estimate. `repair` is the advice on a finding, `sensor_keys` the lines that correct a reading.
//! Only this folder holds their words.

pub(crate) mod constants;
pub(crate) mod doubt;
pub(crate) mod finding;
pub(crate) mod finding_words;
pub(crate) mod geometry_error;
pub(crate) mod length_unit;
pub(crate) mod map_refusal;
pub(crate) mod map_words;
pub(crate) mod moved_body;
pub(crate) mod reading_error;
pub(crate) mod refusal;
pub(crate) mod repair;
pub(crate) mod reservation;
pub(crate) mod sensor_keys;
pub(crate) mod sentence;
pub(crate) mod wrong_input;
pub(crate) mod wrong_input_words;

pub use finding::{Finding, FindingKind, FindingUnit};
pub use finding_words::skipped_poses;
pub(crate) use finding_words::{
    accepted_and_refused, drift, event, explanation, key_of_joint, lost_reading, offset_walks, other_lens_model,
    reading_in_views, slip,
};
pub use repair::{FailedJoint, Repair, repairs};
pub use sentence::sentence;
