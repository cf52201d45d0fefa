//! `armcal-lab sensitivity`: the paper's Figures 4 and 7 for a routine's arm and tags.

use armcal_core::codes::Code;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use armcal::cli::OverrideArgs;
use armcal::cli::expect_routine;
use armcal::cli::say;
use armcal::cli::{Exit, UsageError};
use armcal::output;
use armcal_belief::plan::ClearanceModel;
use armcal_core::routine;
use armcal_paper::study;

#[derive(Debug, Args)]
pub(super) struct SensitivityArgs {
    /// Routine (.toml) with arm, vehicle and tags
    routine: PathBuf,
    /// Folder for sensitivity.csv, statement.md and the plots
    #[arg(long, value_name = "DIR", default_value = "recordings/sensitivity")]
    out: PathBuf,
    /// Random poses
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u16).range(2..=1000))]
    poses: u16,
    /// Least number of tags in each pose
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    min_tags: u16,
    /// Seed of the poses; default: the routine's seed
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    overrides: OverrideArgs,
}

pub(super) fn sensitivity(args: &SensitivityArgs) -> Result<Exit> {
    expect_routine(&args.routine)?;
    let routine = routine::load_with(&args.routine, &args.overrides.overrides())?;
    let (robot, vehicle) = routine.load_arm()?;
    output::check_takes_files(&args.out)?;
    let clearance = ClearanceModel::new(&robot, &vehicle, &routine.scene);
    let (poses, min_tags) = (usize::from(args.poses), usize::from(args.min_tags));
    let found = study::sensitivity(&robot, &clearance, poses, min_tags, args.seed.unwrap_or(routine.seed))
        .map_err(|problem| UsageError::new(Code::UsageInvalid, format!("{}: {problem}", args.routine.display())))?;
    let statement = found.statement();
    output::make_folder(&args.out)?;
    let figures = found.figures().map_err(anyhow::Error::msg)?;
    let mut written = vec![("sensitivity.csv", found.csv()), ("statement.md", statement.clone())];
    written.extend(figures);
    for (name, text) in written {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    say(&format!("{statement}\nwritten      {}", args.out.display()))?;
    Ok(Exit::Ok)
}
