//! Recordings of real arms: what an input map (TOML) says of them, and what they hold.
//!
//! `map` reads the input map: topics, frames and names. `foreign` reads a recording by it, message by message and with the number
//! of each, into raw joint readings (`joints`) and what the camera saw (`tags`); it pairs and averages nothing. `task` reads
//! `--task` files: what the arm is calibrated for, where no recording says it.

mod error;
mod foreign;
mod joints;
mod map;
mod tags;
mod task;

pub use error::{BadPlace, InputError};
pub use foreign::{ForeignRecording, read_foreign};
pub use joints::Reading;
pub use map::{ChildFrame, InputMap, NotFinite, TagUse, WhileMoving, parse_input_map, read_input_map};
pub use tags::{ExternalDetection, RawMeasurement, TagFrame};
pub use task::{TaskFile, parse_task, read_task};
