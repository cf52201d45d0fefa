//! Recordings of real arms by an input map (TOML).
//!
//! `map` reads the input map: topics or columns, frames and names. `external` reads a recording by it, message by
//! message, into raw joint readings (`joints`) and detections (`tags`), `table` a CSV or YAML file; neither pairs nor
//! averages anything. `task` reads `--task` files, the targets that the arm is calibrated for.

mod error;
mod external;
mod joints;
mod map;
mod stamp;
mod table;
mod tags;
mod task;

pub use error::{BadPlace, InputError};
pub use external::{ExternalRecording, read_external};
pub use joints::Reading;
pub use map::{
    ChildFrame, Direction, InputMap, JointUnit, NotFinite, RotationColumns, RotationForm, Source, TableFormat,
    TableLayout, TagUse, TimeColumn, Topics, WhileMoving, parse_input_map, read_input_map,
};
pub use tags::{ExternalDetection, RawMeasurement, TagFrame};
pub use task::{TaskFile, parse_task, read_task};
