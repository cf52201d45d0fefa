//! `armcal calibrate`: the estimator on a recording.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;
use nalgebra::Isometry3;

use super::exit::Exit;
use super::files;
use super::stdout::say;
use crate::calib::{CompactCalibration, MapResult, Status, calibrate as estimate, calibrate_among};
use crate::log::{Completeness, Recording, read_recording};
use crate::report::{RunSummary, table};
use crate::robot::{self, FileIssue, Robot, SurveyedTag, TagSurvey};
use crate::routine::Method;
use crate::spatial::Pose;
use crate::tagmap::TagPrior;
use crate::tagmap::files::read_tags;

#[derive(Debug, Args)]
pub(super) struct CalibrateArgs {
    /// The recording (.mcap)
    recording: PathBuf,
    /// Folder of the robot (robot.toml and its URDF)
    #[arg(long)]
    robot: PathBuf,
    /// Where the tags are: a tag map (.toml) in the frame of the arm's base, instead of what recording and robot say
    #[arg(long)]
    tag_map: Option<PathBuf>,
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
    let calibration = match &args.tag_map {
        Some(file) => {
            let survey = survey_of(file, &robot)?;
            calibrate_among(&recording, &robot.clone().with_survey(survey), args.method)?
        }
        None => estimate(&recording, &robot, args.method)?,
    };
    let summary = RunSummary::of_calibration(&calibration, started.elapsed().as_secs_f64());
    // Before anything is written: what has no compact form shall leave no half of the answer.
    let shown =
        if args.compact { CompactCalibration::of(&calibration)?.to_text()? } else { table(&summary).to_string() };
    files::make_folder(&args.out)?;
    let json = serde_json::to_string_pretty(&summary).context("summary.json")?;
    let (map_file, calibration_file) = (args.out.join("tagmap.toml"), args.out.join("calibration.toml"));
    let (map, text) = (calibration.map.as_ref().map(MapResult::to_toml), calibration.to_toml());
    let (summary_file, json) = (args.out.join("summary.json"), format!("{json}\n"));
    let mut written: Vec<(&Path, &[u8])> = Vec::new();
    written.extend(map.iter().map(|map| (map_file.as_path(), map.as_bytes())));
    written.extend([(calibration_file.as_path(), text.as_bytes()), (summary_file.as_path(), json.as_bytes())]);
    files::write_together(&written)?;
    say(&shown)?;
    Ok(match (calibration.status, lost) {
        (Status::Refused, _) => Exit::Refused,
        (Status::Accepted, true) => Exit::DataLost,
        (Status::Accepted, false) => Exit::Ok,
    })
}

/// The tags of a map file as if they had been surveyed; those without a place are mapped from the views.
fn survey_of(file: &Path, robot: &Robot) -> Result<TagSurvey> {
    let map = read_tags(file)?;
    let refuse = |key: &str, problem: String| FileIssue::new(file, key, problem);
    if map.frame != robot.base_link {
        let problem = format!("is `{}`; the arm's base is `{}`", map.frame, robot.base_link);
        return Err(refuse("frame", problem).into());
    }
    let known = |tag: &&TagPrior| tag.body == 0;
    let tags: Vec<SurveyedTag> = map.tags.iter().filter(known).map(surveyed_tag).collect();
    let ids: Vec<u32> = tags.iter().map(|tag| tag.id).collect();
    let base_tag = map.base_tag.or(Some(robot.base_tag)).filter(|id| ids.contains(id)).or(ids.first().copied());
    let base_tag = base_tag.ok_or_else(|| refuse("tag", "holds no tag in that frame".to_owned()))?;
    Ok(TagSurvey { base_tag, tags })
}

fn surveyed_tag(tag: &TagPrior) -> SurveyedTag {
    let unknown = || ([f64::INFINITY; 6], Isometry3::identity());
    let (std, pose) = tag.pose.map_or_else(unknown, |pose| (tag.std.unwrap_or([0.0; 6]), pose));
    SurveyedTag {
        id: tag.id,
        size_m: tag.size_m,
        base_from_tag: Pose::from_isometry(pose),
        position_std_m: std[0],
        rotation_std_rad: std[3..].iter().copied().fold(0.0, f64::max),
    }
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
