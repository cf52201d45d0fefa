//! `armcal-lab falsified`: the verdict where nominal model, survey or a sensor is wrong.

use armcal_core::codes::Code;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;

use armcal::cli::say;
use armcal::cli::{Exit, UsageError};
use armcal::output;
use armcal_lab::{
    Case, CaseKind, Tier, falsified_cases, falsified_csv, falsified_markdown, falsified_study, touched_cases,
};

#[derive(Debug, Args)]
pub(super) struct FalsifiedArgs {
    /// Folder for rows.csv and report.md
    #[arg(long, value_name = "DIR", default_value = "recordings/study-falsified")]
    out: PathBuf,
    /// Routine whose world, capture and task it is; routines/titan4-quickstart.toml if not given, with --touches
    /// routines/titan4-touch.toml
    #[arg(long, value_name = "FILE")]
    routine: Option<PathBuf>,
    /// Captures, each of a world of its own
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Seed of the first
    #[arg(long, value_name = "N", default_value_t = 1)]
    first_seed: u64,
    /// Only this kind of falsification, as the table names it; may be given several times
    #[arg(long, value_name = "KIND")]
    kind: Vec<String>,
    /// In place of all cases those that touches can tell of, each with the first three touches of the routine
    #[arg(long)]
    touches: bool,
    /// A dozen cases: seconds instead of minutes
    #[arg(long)]
    quick: bool,
    /// Threads; all cores if not given. The results do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

pub(super) fn falsified(args: &FalsifiedArgs) -> Result<Exit> {
    let of_arm = if args.touches { "routines/titan4-touch.toml" } else { "routines/titan4-quickstart.toml" };
    let routine = armcal_core::routine::load(args.routine.as_deref().unwrap_or(Path::new(of_arm)))?;
    let (robot, vehicle) = routine.load_arm()?;
    let tier = if args.quick { Tier::Small } else { Tier::Full };
    let cases = chosen(falsified_cases(&robot, tier), &args.kind)?;
    let cases = if args.touches { touched_cases(&cases) } else { cases };
    output::make_folder(&args.out)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0).into()).build()?;
    let seeds = args.first_seed..args.first_seed.saturating_add(args.seeds);
    let study = pool.install(|| falsified_study(&routine, (&robot, &vehicle), &cases, seeds))?;
    let report = falsified_markdown(&study);
    for (name, text) in [("rows.csv", &falsified_csv(&study.rows)), ("report.md", &report)] {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    say(&format!("{report}\nwritten      {}", args.out.display()))?;
    Ok(Exit::Ok)
}

/// The cases of `kinds` and the good arm's; all cases where no kind is named.
fn chosen(mut cases: Vec<Case>, kinds: &[String]) -> Result<Vec<Case>, UsageError> {
    let known = CaseKind::ALL.map(CaseKind::name);
    if let Some(unknown) = kinds.iter().find(|kind| !known.contains(&kind.as_str())) {
        return Err(UsageError::new(Code::NameUnknown, format!("--kind {unknown}: is none of {}", known.join(", "))));
    }
    cases.retain(|case| {
        kinds.is_empty() || case.kind == CaseKind::GoodArm || kinds.iter().any(|kind| kind == case.kind.name())
    });
    Ok(cases)
}
