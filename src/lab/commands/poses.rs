//! `armcal-lab poses`: tool error against the number of poses and the time, for chosen and random poses.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use armcal::cli::Exit;
use armcal::cli::say;
use armcal::output;
use armcal_lab::{PoseGrid, pose_study, poses_csv, poses_figure, poses_table};
use armcal_sim::WorldSpec;

#[derive(Debug, Args)]
pub(super) struct PosesArgs {
    /// Folder for rows.csv, report.md and poses.svg
    #[arg(long, value_name = "DIR", default_value = "recordings/study-poses")]
    out: PathBuf,
    /// Routine whose scene, task and capture it is; the world is the standard one
    #[arg(long, value_name = "FILE", default_value = "routines/titan4-quickstart.toml")]
    routine: PathBuf,
    /// Arms, each with candidates of its own
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
}

pub(super) fn poses(args: &PosesArgs) -> Result<Exit> {
    let routine = armcal_core::routine::load(&args.routine)?;
    let (robot, vehicle) = routine.load_arm()?;
    output::make_folder(&args.out)?;
    let rows = pose_study(&routine, (&robot, &vehicle), &WorldSpec::default(), PoseGrid::WHOLE, 0..args.seeds)?;
    let report = poses_table(&rows);
    let figure = poses_figure(&rows).map_err(anyhow::Error::msg)?;
    for (name, text) in [("rows.csv", &poses_csv(&rows)), ("report.md", &report), ("poses.svg", &figure)] {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    say(&format!("{report}\nwritten      {}", args.out.display()))?;
    Ok(Exit::Ok)
}
