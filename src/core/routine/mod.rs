//! Routines: scripts in TOML that state the arm and its steps.
//!
//! `load` reads and checks a routine (`Routine`); paths in it are relative to the routine's own file. `load_with`
//! replaces keys (`--set`). The tables `[world]` and those of `fault` steps stay unread: only the simulator may know
//! them. `[campaign]` and `[regress]` apply to many runs of one routine.

mod assert_figure;
mod camera_mode;
mod campaign;
mod definition;
mod error;
mod file;
mod method;
mod overrides;
mod scene;
mod script;
mod settings;
mod site;
mod step;
mod step_keys;

pub use assert_figure::{AssertFigure, AssertLimits};
pub use campaign::{CampaignSettings, RegressSettings, SeedRange};
pub use definition::{FailedJointEntry, Routine};
pub use error::RoutineError;
pub use file::{load, load_with, schema};
pub use method::Method;
pub use overrides::{Override, OverrideOrigin, Overrides, effective_table};
pub use scene::{Scene, load_scene, scene_schema};
pub use settings::{CaptureSettings, Margins, PoseCriterion, TaskSettings};
pub use step::{
    CalibrateSettings, CalibrateViews, IdentifySettings, MoveGoal, OnRefusal, ReachSettings, Step, StopsSettings,
    TouchSettings, WorkBelief, WorkSettings,
};
