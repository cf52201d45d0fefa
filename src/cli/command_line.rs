//! The commands: parse, dispatch, exit code.

mod log_lines;

use std::ffi::OsString;
use std::io::{IsTerminal, Write};
use std::sync::LazyLock;

use anyhow::Result;
use armcal_core::codes::Code;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use self::log_lines::LogLines;
use crate::cli::examples::{EXAMPLES, with_examples};
use crate::cli::exit::Exit;
use crate::cli::groups::grouped;
#[cfg(feature = "viewer")]
use crate::cli::replay;
use crate::cli::stdout::{be_quiet, complain, is_written};
use crate::cli::{
    calibrate, check, completions, exit, explain, export, inspect, new_robot, plan, schema, tagmap, watch,
};
#[cfg(feature = "sim")]
use crate::cli::{campaign, regress, run, serve};
#[cfg(feature = "closed-loop")]
use crate::cli::{discover, drive};

/// Optional parts, and true for those in this build.
const PARTS: [(bool, &str); 5] = [
    (cfg!(feature = "images"), "tags in images"),
    (cfg!(feature = "sim"), "simulator"),
    (cfg!(feature = "viewer"), "replays"),
    (cfg!(feature = "live"), "live arms over ROS 2 humble"),
    (cfg!(feature = "parquet"), "Parquet"),
];

/// Version, commit of a release (ARMCAL_COMMIT at compile time), parts: "0.3.0 (1a2b3c4d5e6f; simulator, replays)".
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let commit = option_env!("ARMCAL_COMMIT").unwrap_or("no release");
    let parts: Vec<_> = PARTS.into_iter().filter_map(|(is_built, name)| is_built.then_some(name)).collect();
    format!("{} ({commit}; {})", env!("CARGO_PKG_VERSION"), parts.join(", "))
});

/// Calibrate a robot arm's joint sensors in place, with its wrist camera and a few AprilTags.
#[derive(Debug, Parser)]
#[command(name = "armcal", version = VERSION.as_str(), about, max_term_width = 100)]
struct Cli {
    #[command(flatten)]
    loudness: Loudness,
    #[command(subcommand)]
    command: Command,
}

/// How much is said.
#[derive(Debug, Args)]
pub struct Loudness {
    /// Print only the verdict and errors: no progress, notes, warnings or further lines
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print each step on stderr; -vv also prints the reasons
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

/// In the order of `GROUPS`.
#[derive(Debug, Subcommand)]
enum Command {
    /// Calibrate from recordings of a simulated or real arm
    Calibrate(calibrate::CalibrateArgs),
    /// Plan poses and paths of a routine's first capture without moving
    Plan(plan::PlanArgs),
    /// Print what a recording holds, whether it is complete, and what it can calibrate
    Inspect(inspect::InspectArgs),
    /// Check files of all kinds for errors: robot folders, routines, tag maps, calibrations ...
    Check(check::CheckArgs),
    /// Print a calibration in the form that a driver or another program reads
    Export(export::ExportArgs),
    /// Open a recording in the Rerun viewer, or write it as .rrd
    #[cfg(feature = "viewer")]
    Replay(replay::ReplayArgs),
    /// Compute a tag map from camera views only
    Tagmap(tagmap::TagmapArgs),
    /// Write a commented robot folder for an arm's URDF
    NewRobot(new_robot::NewRobotArgs),
    /// Carry out a routine on a real arm: the only command that moves one
    #[cfg(feature = "closed-loop")]
    Drive(Box<drive::DriveArgs>),
    /// Find the topics of a real arm
    #[cfg(feature = "closed-loop")]
    Discover(discover::DiscoverArgs),
    /// Follow a recording, whole or still being written, and print the current estimate
    Watch(watch::WatchArgs),
    /// Run a routine in simulation: reach, plan, capture, calibrate, reach again
    #[cfg(feature = "sim")]
    Run(run::RunArgs),
    /// Run a routine for many seeds and settings, and summarise the figures
    #[cfg(feature = "sim")]
    Campaign(Box<campaign::CampaignArgs>),
    /// Run a routine for the seeds of a baseline, and fail if it has become worse
    #[cfg(feature = "sim")]
    Regress(Box<regress::RegressArgs>),
    /// Serve a routine's simulated arm on the ROS 2 topics of a real arm
    #[cfg(feature = "sim")]
    Serve(serve::ServeArgs),
    /// Print the JSON Schema of a kind of file, or list all kinds
    Schema(schema::SchemaArgs),
    /// Print cause, evidence, remedy and page of a code, or list all codes
    Explain(explain::ExplainArgs),
    /// Print the completion script of a shell
    #[command(hide = true)]
    Completions(completions::CompletionsArgs),
    /// Write manual pages into a folder
    #[command(hide = true)]
    Man(completions::ManArgs),
}

/// Definition of the command line, for tests of quoted command lines.
#[must_use]
pub fn command() -> clap::Command {
    grouped(with_examples(Cli::command(), EXAMPLES))
}

/// Parses `words`, the first of which is the program's name, carries the command out and returns its exit. Errors are
/// written to stderr once, here.
#[must_use]
pub fn main(words: impl IntoIterator<Item = OsString>) -> Exit {
    let cli: Cli = match parsed(command(), words) {
        Ok(cli) => cli,
        Err(exit) => return exit,
    };
    carry_out(&cli.loudness, || cli.command.carry_out())
}

/// Parses the words of a command line by `command`.
///
/// # Errors
/// Exit of the program, if help was requested and printed, or if the words are wrong, which was reported.
pub fn parsed<C: FromArgMatches>(command: clap::Command, words: impl IntoIterator<Item = OsString>) -> Result<C, Exit> {
    let matches = command.try_get_matches_from(words).and_then(|matches| C::from_arg_matches(&matches));
    matches.map_err(|answer| clap_answer(&answer))
}

/// Carries a command out with the requested loudness; reports an error, and returns the exit.
pub fn carry_out(loudness: &Loudness, work: impl FnOnce() -> Result<Exit>) -> Exit {
    if loudness.quiet {
        be_quiet();
    }
    begin_log(loudness.level());
    ended(work())
}

impl Command {
    fn carry_out(&self) -> Result<Exit> {
        match self {
            Self::Calibrate(args) => calibrate::calibrate(args),
            Self::Plan(args) => plan::plan(args),
            Self::Inspect(args) => inspect::inspect(args),
            Self::Check(args) => check::check(args),
            Self::Export(args) => export::export(args),
            #[cfg(feature = "viewer")]
            Self::Replay(args) => replay::replay(args),
            Self::Tagmap(args) => tagmap::tagmap(args),
            Self::NewRobot(args) => new_robot::new_robot(args),
            #[cfg(feature = "closed-loop")]
            Self::Drive(args) => drive::drive(args),
            #[cfg(feature = "closed-loop")]
            Self::Discover(args) => discover::discover(args),
            Self::Watch(args) => watch::watch(args),
            #[cfg(feature = "sim")]
            Self::Run(args) => run::run(args),
            #[cfg(feature = "sim")]
            Self::Campaign(args) => campaign::campaign(args),
            #[cfg(feature = "sim")]
            Self::Regress(args) => regress::regress(args),
            #[cfg(feature = "sim")]
            Self::Serve(args) => serve::serve(args),
            Self::Schema(args) => schema::schema(args),
            Self::Explain(args) => explain::explain(args),
            Self::Completions(args) => completions::completions(args, command()),
            Self::Man(args) => completions::man(args, command()),
        }
    }
}

/// Sends messages of the libraries to stderr. It omits the middleware's messages about every long message and about a
/// missing ROS installation.
fn begin_log(level: tracing::Level) {
    let of_use = Targets::new()
        .with_default(LevelFilter::from_level(level))
        .with_target("rustdds::network", LevelFilter::ERROR)
        .with_target("ros2_client::distributions", LevelFilter::ERROR);
    // Only the first command of a process has an effect.
    let _ = tracing_subscriber::fmt()
        .with_writer(LogLines::new(level, std::io::stderr))
        .with_ansi(false)
        .without_time()
        .with_target(false)
        .with_max_level(level)
        .log_internal_errors(false)
        .finish()
        .with(of_use)
        .try_init();
}

fn ended(result: Result<Exit>) -> Exit {
    result.unwrap_or_else(|error| {
        complain(format_args!("error: {}", exit::explain(&error)));
        exit::of_error(&error)
    })
}

/// Prints requested help on stdout, or the error of the command line on stderr.
fn clap_answer(answer: &clap::Error) -> Exit {
    if answer.use_stderr() {
        let styled = answer.render();
        let text = if std::io::stderr().is_terminal() { styled.ansi().to_string() } else { styled.to_string() };
        // The code ends the first line; usage and hints follow.
        let (problem, rest) = text.split_once('\n').unwrap_or((&text, ""));
        let _ = write!(std::io::stderr().lock(), "{problem} [{}]\n{rest}", Code::UsageInvalid);
        return Exit::InvalidInput;
    }
    let printed = answer.print().and_then(|()| std::io::stdout().flush());
    ended(is_written(printed).map(|()| Exit::Ok))
}
