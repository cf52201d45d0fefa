//! The command line: parse, dispatch, progress, exit code. The only place with a clock.

#[cfg(feature = "sim")]
mod batch;
mod belief_text;
mod calibrate;
mod calibrate_online;
mod calibration_inputs;
#[cfg(feature = "sim")]
mod campaign;
mod check;
mod closing;
mod command_line;
mod completions;
#[cfg(feature = "sim")]
mod confirm;
mod examples;
mod exit;
mod explain;
mod export;
mod file_kind;
mod inspect;
mod interrupt;
#[cfg(feature = "sim")]
mod live;
mod live_view;
mod losses;
mod new_robot;
mod overrides;
mod plan;
#[cfg(feature = "sim")]
mod progress;
#[cfg(feature = "sim")]
mod regress;
#[cfg(feature = "viewer")]
mod replay;
#[cfg(feature = "sim")]
mod run;
#[cfg(feature = "sim")]
mod sensitivity;
#[cfg(feature = "sim")]
mod serve;
mod stdout;
#[cfg(feature = "sim")]
mod study;
#[cfg(feature = "sim")]
mod study_dive;
#[cfg(feature = "sim")]
mod study_dive_faults;
#[cfg(feature = "sim")]
mod study_falsified;
#[cfg(feature = "sim")]
mod study_plan;
#[cfg(feature = "sim")]
mod study_worlds;
mod tagmap;
mod waiting;
mod watch;

pub use command_line::{command, main};
pub use exit::Exit;
