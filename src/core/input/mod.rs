//! Recordings of real arms by an input map (TOML).
//!
//! `map` reads the input map: topics or columns, frames and names. `external` reads a recording by it, message by
//! message, into raw joint readings (`joints`), slow sensors (`conditions`), attitudes (`attitude`) and detections
//! (`tags`, those in images by an `images::ImageDetector` that is given), `table` a CSV or YAML file. Nothing is
//! paired or averaged. `task` reads `--task` files, the targets that the arm is calibrated for.

mod attitude;
mod conditions;
mod error;
mod external;
mod images;
mod joint_unit;
mod joints;
mod map;
mod recording;
mod stamp;
mod table;
mod tags;
mod task;

pub use attitude::AttitudeReading;
pub use conditions::ConditionReading;
pub use error::{BadPlace, InputError};
pub use external::{read_external, read_external_images};
pub use images::{ImageDetector, ImageProblem, RecordedImage, TagCorners, read_camera_info};
pub use joints::Reading;
pub use map::{
    ChildFrame, ConditionKind, ConditionTopics, Direction, FurtherTopic, InputMap, JointUnit, NotFinite, PoseColumns,
    RotationColumns, RotationForm, SeenColumns, SlideUnit, Source, TableFormat, TableLayout, TagNoise, TagUse,
    TimeColumn, Topics, WhileMoving, parse_input_map, read_input_map,
};
pub use recording::ExternalRecording;
pub use tags::{ExternalDetection, RawMeasurement, TagFrame};
pub use task::{TaskFile, parse_task, read_task};
