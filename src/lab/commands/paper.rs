//! `armcal-lab paper`: the paper's comparison, in one command.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use armcal::cli::Exit;
use armcal::cli::{note, say};
use armcal::output;
use armcal_paper::study::{Tier, experiments, paper_csv, paper_figures, paper_markdown, run_experiment};

#[derive(Debug, Args)]
pub(super) struct PaperArgs {
    /// Folder for report.md, rows.csv and the plots
    #[arg(long, value_name = "DIR", default_value = "recordings/study-paper")]
    out: PathBuf,
    /// Robot folder whose arm and camera it is
    #[arg(long, value_name = "DIR", default_value = "robots/titan4")]
    robot: PathBuf,
    /// Seed of arms, landmarks, poses and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Few draws of everything: seconds instead of minutes
    #[arg(long)]
    quick: bool,
}

pub(super) fn paper(args: &PaperArgs) -> Result<Exit> {
    let robot = armcal_core::robot::load(&args.robot)?;
    robot.require_turning("this study")?;
    output::make_folder(&args.out)?;
    let experiments = experiments(if args.quick { Tier::Small } else { Tier::Full });
    let mut rows = Vec::new();
    for experiment in &experiments {
        note(format_args!("{} ...", experiment.title));
        rows.extend(run_experiment(&robot, experiment, args.seed)?);
    }
    let report = paper_markdown(&experiments, &rows);
    let figures = paper_figures(&robot, &rows, args.seed)?;
    let mut written = vec![("report.md", report.clone()), ("rows.csv", paper_csv(&rows))];
    written.extend(figures);
    for (name, text) in written {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    say(&format!("{report}\nwritten      {}", args.out.display()))?;
    Ok(Exit::Ok)
}
