//! `armcal regress`: is it worse than it was?

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;

use crate::campaign::{
    Job, Prepared, Request, Row, Table, compare, jobs, read_table, regress_table, statistics, table, table_text,
};
use crate::cli::batch::{BatchRun, CampaignBar, check_name, interrupts, range_of, run_many};
use crate::cli::exit::{Exit, UsageError};
use crate::cli::overrides::OverrideArgs;
use crate::cli::stdout::{note, say};
use crate::output;
use crate::run::Keep;
use armcal_core::routine::SeedRange;

#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("side").required(true).args(["baseline", "write_baseline"])))]
pub(super) struct RegressArgs {
    /// The routine (.toml); [regress] in it may give budgets
    routine: PathBuf,
    /// Compare with this table: what --write-baseline or `armcal campaign` wrote
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Write the runs here (.csv) as a baseline, and compare with nothing
    #[arg(long, value_name = "FILE")]
    write_baseline: Option<PathBuf>,
    /// Seeds A..B, both included, or one number. All of the baseline's if not given; for --write-baseline the routine's
    /// campaign.seeds
    #[arg(long, value_name = "A..B")]
    seeds: Option<SeedRange>,
    /// Write the new runs here, too (.csv)
    #[arg(long, value_name = "FILE", conflicts_with = "write_baseline")]
    out: Option<PathBuf>,
    /// Threads, one run on each; all cores if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    overrides: OverrideArgs,
}

pub(super) fn regress(args: &RegressArgs) -> Result<Exit> {
    if let Some(out) = args.write_baseline.as_ref().or(args.out.as_ref()) {
        check_name(out)?;
    }
    let prepared = Prepared::load(Request { routine: args.routine.clone(), overrides: args.overrides.overrides() })?;
    let baseline = args.baseline.as_deref().map(read_table).transpose()?;
    let jobs = match &baseline {
        Some(baseline) => jobs_of(baseline, args, &prepared)?,
        None => jobs(&prepared, range_of(args.seeds, &prepared)?, None, &std::collections::BTreeSet::new()),
    };
    let Some(now) = run(args, &prepared, &jobs)? else {
        note("stopped; nothing was compared");
        return Ok(Exit::Failure);
    };
    if let Some(out) = args.write_baseline.as_ref().or(args.out.as_ref()) {
        output::write_whole(out, table_text(&now).as_bytes())?;
    }
    let Some(baseline) = baseline else {
        let summary = statistics(&now, &prepared.routine.name, &prepared.fingerprint);
        let out = args.write_baseline.as_deref().unwrap_or(&args.routine);
        say(&format!("{}written      {}", table(&summary), out.display()))?;
        return Ok(crate::cli::batch::exit_of(&summary));
    };
    let comparison = compare(&baseline, &now, &prepared.routine.regress);
    let verdict = if comparison.is_worse() { "WORSE than the baseline" } else { "not worse than the baseline" };
    say(&format!("{}\nregress      {verdict}", regress_table(&comparison)))?;
    Ok(if comparison.is_worse() { Exit::Refused } else { Exit::Ok })
}

/// The runs of the baseline, as the routine makes them today.
fn jobs_of(baseline: &Table, args: &RegressArgs, prepared: &Prepared) -> Result<Vec<Job>> {
    let file = args.baseline.as_deref().unwrap_or(&args.routine).display();
    let wanted = |row: &&Row| args.seeds.is_none_or(|seeds| seeds.contains(row.seed));
    let job = |row: &Row| {
        let setting = prepared.settings.iter().find(|setting| setting.text() == row.settings);
        let problem = || {
            let routine = args.routine.display();
            UsageError(format!("{file}: the matrix of {routine} has no point `{}`", row.settings))
        };
        Ok(prepared.job(setting.ok_or_else(problem)?, row.seed))
    };
    let jobs = baseline.rows.iter().filter(wanted).map(job).collect::<Result<Vec<Job>>>()?;
    if jobs.is_empty() {
        return Err(UsageError(format!("{file}: has none of the seeds asked for")).into());
    }
    Ok(jobs)
}

/// The new rows, sorted; `None` when stopped. Nothing is taken over from earlier runs: the program may have changed.
fn run(args: &RegressArgs, prepared: &Prepared, jobs: &[Job]) -> Result<Option<Table>> {
    let stop = interrupts()?;
    let folder = tempfile::tempdir().context("no temporary folder can be made")?;
    let many =
        BatchRun { prepared, folder: folder.path(), keep: Keep::StreamsAlone, threads: args.threads, stop: &stop };
    let mut now = Table { names: prepared.columns.names(), rows: Vec::new() };
    let mut bar = CampaignBar::new(prepared, &now, jobs.len());
    let whole = run_many(&many, jobs, &mut |row| {
        bar.add(&row);
        now.rows.push(row);
        Ok(())
    });
    bar.finish();
    now.rows.sort_by_key(Row::key);
    Ok(whole?.then_some(now))
}
