//! The command line: parse, dispatch, progress, exit code. The only place with a clock.

mod calibrate;
mod check;
mod exit;
mod files;
#[cfg(feature = "sim")]
mod progress;
#[cfg(feature = "viewer")]
mod replay;
#[cfg(feature = "sim")]
mod run;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

pub use exit::Exit;

/// Calibrates the joint sensors of arms that nobody can walk up to.
#[derive(Debug, Parser)]
#[command(name = "armcal", version, about, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a routine in simulation: reach, plan, capture, calibrate, reach again
    #[cfg(feature = "sim")]
    Run(run::RunArgs),
    /// Calibrate from a recording, simulated or of a real arm
    Calibrate(calibrate::CalibrateArgs),
    /// Open a recording in the Rerun viewer, or write it as .rrd
    #[cfg(feature = "viewer")]
    Replay(replay::ReplayArgs),
    /// Read robot folders, routines, vehicles and calibrations, and say what is wrong with them
    Check(check::CheckArgs),
}

/// Parses the command line, does what it says and gives the exit code; errors go to stderr once, here.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_max_level(tracing::Level::WARN)
        .without_time()
        .with_target(false)
        .init();
    let result = match cli.command {
        #[cfg(feature = "sim")]
        Command::Run(args) => run::run(&args),
        Command::Calibrate(args) => calibrate::calibrate(&args),
        #[cfg(feature = "viewer")]
        Command::Replay(args) => replay::replay(&args),
        Command::Check(args) => check::check(&args),
    };
    match result {
        Ok(exit) => exit.into(),
        Err(error) => {
            eprintln!("error: {}", explain(&error));
            exit::of_error(&error).into()
        }
    }
}

/// The chain of causes, each said once: many messages already hold that of their source.
fn explain(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1) {
        let cause = cause.to_string();
        if !text.contains(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
    }
    text
}
