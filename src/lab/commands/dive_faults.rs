//! `armcal-lab dive-faults`: the time until the online estimate names a fault on a dive.

use armcal_core::codes::Code;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use rayon::prelude::*;

use super::dive::run_dive;
use armcal::cli::say;
use armcal::cli::{Exit, UsageError};
use armcal::output;
use armcal_core::log::read_recording;
use armcal_core::routine::{self, Step};
use armcal_lab::{DiveFaultKind, DiveFaultRow, dive_fault_study, dive_faults_csv, dive_faults_table, drawn_dive_fault};

#[derive(Debug, Args)]
pub(super) struct DiveFaultsArgs {
    /// Folder for rows.csv and report.md
    #[arg(long, value_name = "DIR", default_value = "recordings/study-dive-faults")]
    out: PathBuf,
    /// The routine, a dive of at least an hour with tasks
    #[arg(long, value_name = "FILE", default_value = "routines/short-dive.toml")]
    routine: PathBuf,
    /// First seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    first_seed: u64,
    /// Number of seeds, each with every kind of fault
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// Only kinds whose names have this in them
    #[arg(long, alias = "only", value_name = "KIND", default_value = "")]
    kind: String,
    /// Dives at once; all cores if not given. The results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Keep each dive's folder; dives that are there already are not run again
    #[arg(long)]
    keep: bool,
}

pub(super) fn dive_faults(args: &DiveFaultsArgs) -> Result<Exit> {
    output::make_folder(&args.out)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0).into()).build()?;
    let seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
    let kinds: Vec<DiveFaultKind> =
        DiveFaultKind::ALL.into_iter().filter(|kind| kind.name().contains(&args.kind)).collect();
    if kinds.is_empty() {
        let names = DiveFaultKind::ALL.map(DiveFaultKind::name).join(", ");
        return Err(UsageError::new(
            Code::NameUnknown,
            format!("--kind {}: no kind has this in its name; there are {names}", args.kind),
        )
        .into());
    }
    let all: Vec<(DiveFaultKind, u64)> =
        kinds.into_iter().flat_map(|kind| seeds.clone().map(move |seed| (kind, seed))).collect();
    let rows: Result<Vec<DiveFaultRow>> =
        pool.install(|| all.par_iter().map(|(kind, seed)| one(args, *kind, *seed)).collect());
    let rows = rows?;
    let table = dive_faults_table(&rows);
    for (name, text) in [("rows.csv", dive_faults_csv(&rows)), ("report.md", table.clone())] {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    say(&format!("{table}\nwritten      {}", args.out.display()))?;
    Ok(Exit::Ok)
}

fn one(args: &DiveFaultsArgs, kind: DiveFaultKind, seed: u64) -> Result<DiveFaultRow> {
    let kept = args.out.join(format!("{}-{seed}", kind.name().replace(' ', "-")));
    let folder = tempfile::tempdir_in(&args.out).context("no folder for a run can be made")?;
    let run = if args.keep { kept } else { folder.path().join("run") };
    let routine = routine::load(&args.routine)?;
    let (robot, _) = routine.load_arm()?;
    let works = routine.steps.iter().enumerate().find_map(|(place, step)| match step {
        Step::Work(work) => Some((place, work)),
        _ => None,
    });
    let Some((works, work)) = works else {
        return Err(
            UsageError::new(Code::UsageInvalid, format!("{}: it has no step `work`", args.routine.display())).into()
        );
    };
    let fault = drawn_dive_fault(kind, seed, &robot, &work.looks_rad);
    if !run.join("truth.mcap").exists() {
        // The arm works by the estimate that the study examines.
        let settings = [format!("step.{works}.belief=\"online\""), format!("world.fault={}", fault.setting)];
        run_dive(&args.routine, seed, &settings, &run)?;
    }
    Ok(dive_fault_study(&read_recording(run.join("run.mcap"))?, &robot, &fault))
}
