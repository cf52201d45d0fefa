//! `armcal-lab dive`: the online estimate over a dive, for many seeds.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use clap::Args;
use rayon::prelude::*;

use armcal::cli::Exit;
use armcal::cli::say;
use armcal::output;
use armcal_belief::calib::Calibration;
use armcal_core::log::read_recording;
use armcal_core::routine;
use armcal_lab::{AtStart, DiveStudy, DiveTask, dive_csv, dive_study, dive_table};
use armcal_sim::truth::read_truth;

#[derive(Debug, Args)]
pub(super) struct DiveArgs {
    /// Folder for tasks.csv and report.md
    #[arg(long, value_name = "DIR", default_value = "recordings/study-dive")]
    out: PathBuf,
    /// The routine, a dive with tasks
    #[arg(long, value_name = "FILE", default_value = "routines/long-dive.toml")]
    routine: PathBuf,
    /// First seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    first_seed: u64,
    /// Number of seeds
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// Dives at once; all cores if not given. The results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Keep each dive's folder; dives that are there already are not run again
    #[arg(long)]
    keep: bool,
}

pub(super) fn dive(args: &DiveArgs) -> Result<Exit> {
    output::make_folder(&args.out)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0).into()).build()?;
    let seeds: Vec<u64> = (args.first_seed..args.first_seed.saturating_add(args.seeds)).collect();
    let studies: Result<Vec<DiveStudy>> = pool.install(|| seeds.par_iter().map(|seed| one(args, *seed)).collect());
    let studies = studies?;
    let rows: Vec<(u64, DiveTask)> = seeds
        .iter()
        .zip(&studies)
        .flat_map(|(seed, study)| study.tasks.iter().map(move |task| (*seed, *task)))
        .collect();
    let tasks: Vec<DiveTask> = rows.iter().map(|(_, task)| *task).collect();
    let report = format!("{}\n{}", dive_table(&tasks), told(&seeds, &studies));
    for (name, text) in [("tasks.csv", dive_csv(&rows)), ("report.md", report.clone())] {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    say(&format!("{report}\nwritten      {}", args.out.display()))?;
    Ok(Exit::Ok)
}

/// Lines with views and events of each seed.
fn told(seeds: &[u64], studies: &[DiveStudy]) -> String {
    let mut text = String::new();
    for (seed, study) in seeds.iter().zip(studies) {
        let [walk, lag] = study.drift_factors.unwrap_or([1.0; 2]);
        text += &format!(
            "seed {seed}: {} views, walk {walk:.2}, lag {lag:.2} of the first guess, temperature {} s behind\n",
            study.views, study.lag_s
        );
        for event in &study.events {
            text += &format!("  {}\n", event.to_line());
        }
    }
    text
}

fn one(args: &DiveArgs, seed: u64) -> Result<DiveStudy> {
    let kept = args.out.join(format!("seed-{seed}"));
    let folder = tempfile::tempdir_in(&args.out).context("no folder for a run can be made")?;
    let run = if args.keep { kept } else { folder.path().join("run") };
    if !run.join("truth.mcap").exists() {
        run_dive(&args.routine, seed, &[], &run)?;
    }
    let routine = routine::load(&args.routine)?;
    let (robot, _) = routine.load_arm()?;
    let recording = read_recording(run.join("run.mcap"))?;
    let truth = read_truth(run.join("truth.mcap"))?;
    let start = Calibration::read(&run.join("calibration.toml"))?;
    let at_start = AtStart { sensors: &start.sensors(&robot)?, links: start.link_corrections() };
    Ok(dive_study(&recording, &truth, &robot, at_start))
}

/// Runs the dive as a process of its own, as a user would start it.
pub(super) fn run_dive(routine: &Path, seed: u64, settings: &[String], out: &Path) -> Result<()> {
    let mut command = Command::new(std::env::current_exe().context("this program cannot be found")?);
    command.arg("run").arg(routine).arg("--seed").arg(seed.to_string()).arg("--out").arg(out);
    settings.iter().for_each(|setting| {
        command.arg("--set").arg(setting);
    });
    let output = command.stdin(Stdio::null()).stdout(Stdio::null()).output().context("cannot be started")?;
    if !out.join("truth.mcap").exists() {
        bail!("seed {seed}: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(())
}
