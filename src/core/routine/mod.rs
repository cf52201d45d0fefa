//! Routines: what to do with which arm, as users script it in TOML.
//!
//! `load` reads and checks a routine; paths in it are relative to the routine's own file. Its `[world]` table belongs to
//! the simulator and is handed on unread, and so are the tables of `fault` steps: belief must not learn from them.
//! `step` has the script's steps, `script` reads them. `load_with` replaces keys on the way (`--set`); `[campaign]` and `[regress]` are for running a
//! routine many times.

mod assert_figure;
mod campaign;
mod file;
mod overrides;
mod scene;
mod script;
mod site;
mod step;

pub use assert_figure::{AssertFigure, AssertLimits};
pub use campaign::{CampaignSettings, RegressSettings, SeedRange};
pub use file::{
    CaptureSettings, FailedJointEntry, Margins, Method, PoseCriterion, Routine, RoutineError, TaskSettings, load,
    load_scene, load_with,
};
pub use overrides::{Override, Overrides, effective_table};
pub use scene::Scene;
pub use step::{
    CalibrateSettings, CalibrateViews, IdentifySettings, MoveGoal, OnRefusal, ReachSettings, Step, StopsSettings,
};
