//! The commands: parse, dispatch, exit code.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::cli::examples::with_examples;
#[cfg(feature = "viewer")]
use crate::cli::replay;
use crate::cli::stdout::{be_quiet, complain, is_written};
use crate::cli::{calibrate, check, completions, exit, export, inspect, new_robot, plan, tagmap, watch};
#[cfg(feature = "sim")]
use crate::cli::{campaign, regress, run, sensitivity, serve, study};

/// With what this build can do beside the defaults.
#[cfg(feature = "live")]
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (live: ROS 2 humble)");
#[cfg(not(feature = "live"))]
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Calibrates the joint sensors of arms that nobody can walk up to.
#[derive(Debug, Parser)]
#[command(name = "armcal", version = VERSION, about, max_term_width = 100)]
struct Cli {
    #[command(flatten)]
    loudness: Loudness,
    #[command(subcommand)]
    command: Command,
}

/// How much is said.
#[derive(Debug, Args)]
struct Loudness {
    /// Say the verdict and errors alone: no progress, notes, warnings or further lines
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Say on stderr what is done; -vv: why, too
    #[arg(long, short, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

impl Loudness {
    fn level(&self) -> tracing::Level {
        match (self.quiet, self.verbose) {
            (true, _) => tracing::Level::ERROR,
            (false, 0) => tracing::Level::WARN,
            (false, 1) => tracing::Level::INFO,
            (false, _) => tracing::Level::DEBUG,
        }
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a routine in simulation: reach, plan, capture, calibrate, reach again
    #[cfg(feature = "sim")]
    Run(run::RunArgs),
    /// Put a routine's simulated arm behind the ROS 2 topics of a real one
    #[cfg(feature = "sim")]
    Serve(serve::ServeArgs),
    /// Run a routine for many seeds and settings, and sum the figures up
    #[cfg(feature = "sim")]
    Campaign(Box<campaign::CampaignArgs>),
    /// Run a routine for the seeds of a baseline, and say whether it has become worse
    #[cfg(feature = "sim")]
    Regress(Box<regress::RegressArgs>),
    /// Measure a part on its own against known truth
    #[cfg(feature = "sim")]
    Study(study::StudyArgs),
    /// Show what one wrong joint offset does to the paper's two objectives and to the tool
    #[cfg(feature = "sim")]
    Sensitivity(sensitivity::SensitivityArgs),
    /// Choose poses and paths for a routine's first capture without moving: plan.toml for an operator, plan.rrd to look
    /// at
    Plan(plan::PlanArgs),
    /// Calibrate from recordings, simulated or of a real arm
    Calibrate(calibrate::CalibrateArgs),
    /// Follow a recording that another program is still writing, and say what is believed of the arm
    Watch(watch::WatchArgs),
    /// Find where the tags are, from camera views alone
    Tagmap(tagmap::TagmapArgs),
    /// Say what is in a recording, whether it is whole, and what could be calibrated from it
    Inspect(inspect::InspectArgs),
    /// Write a calibration as YAML, TOML or one compact line to stdout
    Export(export::ExportArgs),
    /// Open a recording in the Rerun viewer, or write it as .rrd
    #[cfg(feature = "viewer")]
    Replay(replay::ReplayArgs),
    /// Write a commented robot folder for an arm's URDF
    NewRobot(new_robot::NewRobotArgs),
    /// Read robot folders, routines, vehicles, calibrations, input maps, tag maps, tasks and plans, and say what is
    /// wrong with them
    Check(check::CheckArgs),
    /// Print the script with which a shell completes commands and options
    Completions(completions::CompletionsArgs),
    /// Write manual pages into a folder
    Man(completions::ManArgs),
}

/// The definition of the command line, for those who check quoted command lines.
#[must_use]
pub fn command() -> clap::Command {
    with_examples(Cli::command())
}

/// Parses the command line, does what it says and gives the exit code; errors go to stderr once, here.
#[must_use]
pub fn main() -> ExitCode {
    let parsed = command().try_get_matches().and_then(|matches| Cli::from_arg_matches(&matches));
    let cli = match parsed {
        Ok(cli) => cli,
        Err(answer) => return clap_answer(&answer),
    };
    if cli.loudness.quiet {
        be_quiet();
    }
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(cli.loudness.level())
        .without_time()
        .with_target(false)
        .log_internal_errors(false)
        .init();
    let result = match cli.command {
        #[cfg(feature = "sim")]
        Command::Run(args) => run::run(&args),
        #[cfg(feature = "sim")]
        Command::Serve(args) => serve::serve(&args),
        #[cfg(feature = "sim")]
        Command::Campaign(args) => campaign::campaign(&args),
        #[cfg(feature = "sim")]
        Command::Regress(args) => regress::regress(&args),
        #[cfg(feature = "sim")]
        Command::Study(args) => study::study(&args),
        #[cfg(feature = "sim")]
        Command::Sensitivity(args) => sensitivity::sensitivity(&args),
        Command::Plan(args) => plan::plan(&args),
        Command::Calibrate(args) => calibrate::calibrate(&args),
        Command::Watch(args) => watch::watch(&args),
        Command::Tagmap(args) => tagmap::tagmap(&args),
        Command::Inspect(args) => inspect::inspect(&args),
        Command::Export(args) => export::export(&args),
        #[cfg(feature = "viewer")]
        Command::Replay(args) => replay::replay(&args),
        Command::NewRobot(args) => new_robot::new_robot(&args),
        Command::Check(args) => check::check(&args),
        Command::Completions(args) => completions::completions(&args, command()),
        Command::Man(args) => completions::man(&args, command()),
    };
    ended(result)
}

fn ended(result: Result<exit::Exit>) -> ExitCode {
    result
        .unwrap_or_else(|error| {
            complain(format_args!("error: {}", exit::explain(&error)));
            exit::of_error(&error)
        })
        .into()
}

/// The help that was asked for, on stdout; or, on stderr, what is wrong with the command line.
fn clap_answer(answer: &clap::Error) -> ExitCode {
    let printed = answer.print().and_then(|()| std::io::stdout().flush());
    if answer.use_stderr() {
        return exit::Exit::InvalidInput.into();
    }
    ended(is_written(printed).map(|()| exit::Exit::Ok))
}
