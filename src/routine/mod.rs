//! Routines: what to do with which arm, as users script it in TOML.
//!
//! `load` reads and checks a routine; paths in it are relative to the routine's own file. Its `[world]` table belongs to
//! the simulator and is handed on unread: belief must not learn from it.

mod file;
mod scene;

pub use file::{CaptureSettings, Method, Routine, RoutineError, TaskSettings, load, load_scene};
pub use scene::Scene;
