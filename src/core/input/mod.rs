//! Recordings of real arms by an input map (TOML).
//!
//! `map` reads the input map: topics or columns, frames and names. `external` reads a recording by it, message by
//! message, into raw joint readings (`joints`), slow sensors (`conditions`), attitudes (`attitude`) and detections
//! (`tags`). The caller supplies an `images::ImageDetector` for detections in images. `table` reads a CSV or YAML file.
//! Nothing is paired or averaged. `task` reads `--task` files, the targets that the arm is calibrated for.

mod attitude;
mod clocks;
mod conditions;
mod error;
mod external;
mod images;
mod joint_unit;
mod joints;
mod lerobot;
mod map;
mod message_type;
mod recording;
mod stamp;
mod table;
mod tags;
mod task;
mod two_senders;

pub use attitude::AttitudeReading;
pub use clocks::{ClockDoubt, ClockRemedy, StreamTimes, compare_clocks, header_stamp};
pub use conditions::ConditionReading;
pub use error::{BadPlace, InputError, ONE_SENDER};
pub use external::{read_external, read_external_images};
pub use images::{
    CameraInfoLens, ImageDetector, ImageProblem, RecordedImage, TagCorners, lens_of_camera_info, read_camera_info,
};
pub use joints::Reading;
pub use lerobot::{LerobotCalibration, LerobotMotors, LerobotValues};
pub use map::{
    ChildFrame, ConditionKind, ConditionTopics, CornerOrder, DEFAULT_MAX_GAP_S, Direction, FurtherTopic, InputMap,
    JointAngleLines, JointUnit, NotFinite, PoseColumns, RotationColumns, RotationForm, SeenColumns, SlideUnit, Source,
    StampSource, TableFormat, TableJoin, TableLayout, TagNoise, TagTable, TagUse, TimeColumn, TimeUnit, Topics,
    WhileMoving, input_schema, parse_input_map, read_input_map,
};
pub use recording::ExternalRecording;
pub use table::{
    MAX_ROWS, MIN_APART_S, TableColumn, TableContents, plain_key, read_table_contents, tag_number, whole_key,
};
pub use tags::{ExternalDetection, RawMeasurement, TagFrame};
pub use task::{TaskFile, parse_task, read_task, task_schema};
pub use two_senders::{TwoSenders, two_senders};
