//! `armcal-lab bound`: closed loops against the Bayesian bound of their views, for many seeds.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use rayon::prelude::*;

use super::dive::run_dive;
use armcal::cli::Exit;
use armcal::cli::say;
use armcal::output;
use armcal_belief::calib::Calibration;
use armcal_core::log::read_recording;
use armcal_core::routine::{self, Override, Overrides};
use armcal_lab::{AS_MODELLED, BoundInput, BoundRun, bound_csv, bound_run, bound_table};
use armcal_sim::WorldSpec;
use armcal_sim::truth::read_truth;

#[derive(Debug, Args)]
pub(super) struct BoundArgs {
    /// Folder for targets.csv and report.md
    #[arg(long, value_name = "DIR", default_value = "recordings/study-bound")]
    out: PathBuf,
    /// The routine, a closed loop
    #[arg(long, value_name = "FILE", default_value = "routines/titan4-watched.toml")]
    routine: PathBuf,
    /// Replace a key of the routine, as capture.poses=20; may be given many times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Override>,
    /// First seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    first_seed: u64,
    /// Number of seeds
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// Runs at once; all cores if not given. The results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Keep each run's folder; runs that are there already are not made again
    #[arg(long)]
    keep: bool,
}

/// Worlds: one with only gain, offset and noise, where there is a bound, and the routine's own.
const WORLDS: [(&str, &[&str]); 2] = [("as modelled", &AS_MODELLED), ("as the routine has it", &[])];

pub(super) fn bound(args: &BoundArgs) -> Result<Exit> {
    output::make_folder(&args.out)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0).into()).build()?;
    let seeds: Vec<u64> = (args.first_seed..args.first_seed.saturating_add(args.seeds)).collect();
    let mut worlds: Vec<(&str, Vec<BoundRun>)> = Vec::new();
    for (name, settings) in WORLDS {
        let runs: Result<Vec<BoundRun>> =
            pool.install(|| seeds.par_iter().map(|seed| one(args, (name, settings), *seed)).collect());
        worlds.push((name, runs?));
    }
    let worlds: Vec<(&str, &[BoundRun])> = worlds.iter().map(|(name, runs)| (*name, &runs[..])).collect();
    let report = bound_table(&worlds);
    for (name, text) in [("targets.csv", bound_csv(&worlds)), ("report.md", report.clone())] {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    say(&format!("{report}\nwritten      {}", args.out.display()))?;
    Ok(Exit::Ok)
}

fn one(args: &BoundArgs, (name, settings): (&str, &[&str]), seed: u64) -> Result<BoundRun> {
    let kept = args.out.join(format!("{}-{seed}", name.replace(' ', "-")));
    let folder = tempfile::tempdir_in(&args.out).context("no folder for a run can be made")?;
    let run = if args.keep { kept } else { folder.path().join("run") };
    let given = args.set.iter().map(ToString::to_string);
    let settings: Vec<String> = settings.iter().map(|setting| (*setting).to_owned()).chain(given).collect();
    if !run.join("truth.mcap").exists() {
        run_dive(&args.routine, seed, &settings, &run)?;
    }
    of_run(&args.routine, &settings, seed, &run).with_context(|| format!("seed {seed}, {name}"))
}

fn of_run(path: &Path, settings: &[String], seed: u64, run: &Path) -> Result<BoundRun> {
    let set: Result<Vec<Override>, _> = settings.iter().map(|setting| setting.parse()).collect();
    let set = set.map_err(anyhow::Error::msg)?;
    let routine = routine::load_with(path, &Overrides { set, ..Overrides::default() })?;
    let (robot, _) = routine.load_arm()?;
    let input = BoundInput {
        seed,
        robot: &robot,
        world: &WorldSpec::from_table(&routine.world, path)?,
        recording: &read_recording(run.join("run.mcap"))?,
        truth: &read_truth(run.join("truth.mcap"))?,
        calibration: &Calibration::read(&run.join("calibration.toml"))?,
    };
    bound_run(&input).map_err(anyhow::Error::msg)
}
