//! The command line: parse, dispatch, progress, exit code. The only place with a clock.
#[cfg(feature = "sim")]
mod batch;
mod belief_text;
mod calibrate;
mod calibration_inputs;
#[cfg(feature = "sim")]
mod campaign;
mod check;
#[cfg(feature = "closed-loop")]
mod closed_loop;
mod closing;
mod command_line;
mod completions;
#[cfg(feature = "closed-loop")]
mod confirm;
#[cfg(feature = "closed-loop")]
mod discover;
#[cfg(feature = "closed-loop")]
mod drive;
mod examples;
mod exit;
mod explain;
mod export;
mod file_kind;
mod groups;
mod inspect;
mod interrupt;
mod live_view;
mod losses;
mod named;
mod new_robot;
mod overrides;
mod own_inputs;
mod plan;
#[cfg(feature = "closed-loop")]
mod progress;
#[cfg(feature = "sim")]
mod regress;
#[cfg(feature = "viewer")]
mod replay;
#[cfg(feature = "sim")]
mod run;
mod schema;
#[cfg(feature = "sim")]
mod serve;
mod stdout;
mod tagmap;
mod waiting;
mod watch;

pub use calibrate::save_results;
pub use command_line::{Loudness, carry_out, command, main, parsed};
pub use examples::with_examples;
pub use exit::{Exit, UsageError, code_of, message_of};
pub use export::export_text;
pub use file_kind::expect_routine;
pub use overrides::OverrideArgs;
pub use plan::plan_routine;
pub use stdout::{note, say};
pub use waiting::Waiting;
