//! `armcal calibrate`: the estimator on a recording.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use super::exit::Exit;
use super::files;
use super::stdout::say;
use crate::calib::{CompactCalibration, Status, calibrate as estimate};
use crate::log::{Completeness, Recording, read_recording};
use crate::report::{RunSummary, table};
use crate::robot;
use crate::routine::Method;

#[derive(Debug, Args)]
pub(super) struct CalibrateArgs {
    /// The recording (.mcap)
    recording: PathBuf,
    /// Folder of the robot (robot.toml and its URDF)
    #[arg(long)]
    robot: PathBuf,
    /// Calibration method
    #[arg(long, default_value_t)]
    method: Method,
    /// Where to write calibration.toml and summary.json
    #[arg(long, default_value = ".")]
    out: PathBuf,
    /// Print the calibration as one line below 512 bytes instead of the table
    #[arg(long)]
    compact: bool,
}

pub(super) fn calibrate(args: &CalibrateArgs) -> Result<Exit> {
    let robot = robot::load(&args.robot)?;
    let recording = read_recording(&args.recording)?;
    let lost = warn_of_losses(&recording);
    let started = Instant::now();
    let calibration = estimate(&recording, &robot, args.method)?;
    let summary = RunSummary::of_calibration(&calibration, started.elapsed().as_secs_f64());
    // Before anything is written: what has no compact form shall leave no half of the answer.
    let shown =
        if args.compact { CompactCalibration::of(&calibration)?.to_text()? } else { table(&summary).to_string() };
    files::make_folder(&args.out)?;
    let json = serde_json::to_string_pretty(&summary).context("summary.json")?;
    files::write_together(&[
        (&args.out.join("calibration.toml"), calibration.to_toml().as_bytes()),
        (&args.out.join("summary.json"), format!("{json}\n").as_bytes()),
    ])?;
    say(&shown)?;
    Ok(match (calibration.status, lost) {
        (Status::Refused, _) => Exit::Refused,
        (Status::Accepted, true) => Exit::DataLost,
        (Status::Accepted, false) => Exit::Ok,
    })
}

fn describe(completeness: &Completeness) -> String {
    match completeness {
        Completeness::Whole => "whole".to_owned(),
        Completeness::Cut { reason, readable_messages } => format!("cut: {reason}; {readable_messages} messages read"),
        Completeness::Damaged { reason, lost_bytes, readable_messages, .. } => {
            format!("damaged: {reason}; {lost_bytes} bytes lost, {readable_messages} messages read")
        }
    }
}

/// Says on stderr what a recording has lost; `true` if it has lost anything.
pub(super) fn warn_of_losses(recording: &Recording) -> bool {
    let file = recording.path.display();
    let whole = recording.completeness == Completeness::Whole;
    if !whole {
        eprintln!("warning: {file}: {}; what could be read is used", describe(&recording.completeness));
    }
    for (what, n) in &recording.rejected {
        eprintln!("warning: {file}: {n} messages rejected on {what}");
    }
    if recording.non_monotonic > 0 {
        eprintln!("warning: {file}: log time went backwards {} times", recording.non_monotonic);
    }
    !whole || !recording.rejected.is_empty()
}
