//! `armcal regress`: comparison of a routine's runs with a baseline.

use armcal_core::codes::Code;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use crate::campaign::{
    Comparison, Job, Metric, Prepared, Request, Row, Table, Undecided, Verdict, baseline_text, compare, jobs,
    read_baseline, read_rows, regress_junit, regress_markdown, regress_page, regress_table, statistics, table,
    table_text,
};
use crate::cli::batch::{BatchRun, CampaignBar, check_name, range_of, run_many};
use crate::cli::closing::{say_wrapped, terminal_width};
use crate::cli::exit::{Exit, UsageError};
use crate::cli::file_kind::expect_routine;
use crate::cli::interrupt::Interrupt;
use crate::cli::named;
use crate::cli::overrides::OverrideArgs;
use crate::cli::own_inputs::spare_inputs;
use crate::cli::stdout::{note, say};
use crate::output;
use crate::run::Keep;
use armcal_core::routine::SeedRange;
use armcal_core::stats::quantile;

#[derive(Debug, Args)]
#[command(group(clap::ArgGroup::new("side").required(true).args(["baseline", "write_baseline"])))]
pub(super) struct RegressArgs {
    /// Routine (.toml); [regress] in it may give budgets
    #[arg(value_parser = named::routine())]
    routine: PathBuf,
    /// Baseline table, written by --write-baseline or `armcal campaign`
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Write the runs as a baseline (.csv) and compare nothing
    #[arg(long, value_name = "FILE")]
    write_baseline: Option<PathBuf>,
    /// Seeds A..B, both included, or one number; default: all of the baseline, or campaign.seeds for --write-baseline
    #[arg(long, value_name = "A..B")]
    seeds: Option<SeedRange>,
    /// Also write the new runs (.csv)
    #[arg(long, value_name = "FILE", conflicts_with = "write_baseline")]
    out: Option<PathBuf>,
    /// Compare this table of `armcal campaign` and run nothing
    #[arg(long, value_name = "FILE", requires = "baseline", conflicts_with_all = ["seeds", "out", "threads"])]
    rows: Option<PathBuf>,
    /// Threads, one run each; default: all cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Exit with 0 if the comparison is inconclusive
    #[arg(long, conflicts_with = "write_baseline")]
    allow_inconclusive: bool,
    /// Print the comparison as JSON instead of the table
    #[arg(long, conflicts_with = "write_baseline")]
    json: bool,
    /// Also write JUnit XML with one test case per check (.xml), a page (.html) or Markdown (.md); repeatable
    #[arg(long, value_name = "FILE", conflicts_with = "write_baseline")]
    report: Vec<PathBuf>,
    #[command(flatten)]
    overrides: OverrideArgs,
}

impl RegressArgs {
    /// Refuses, before hours of work, outputs that cannot be written or that overwrite an input.
    fn check_outputs(&self) -> Result<()> {
        let inputs = || [Some(&self.routine), self.baseline.as_ref(), self.rows.as_ref()].into_iter().flatten();
        if let Some(out) = self.write_baseline.as_ref().or(self.out.as_ref()) {
            spare_inputs(out, inputs().map(PathBuf::as_path))?;
            check_name(out)?;
        }
        for path in &self.report {
            Form::of(path)?;
            spare_inputs(path, inputs().map(PathBuf::as_path))?;
            output::check_writable(path)?;
        }
        Ok(())
    }
}

/// Form of a report, by the extension of its name.
enum Form {
    JUnit,
    Page,
    Markdown,
}

impl Form {
    fn of(path: &Path) -> Result<Self, UsageError> {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("xml") => Ok(Self::JUnit),
            Some("html") => Ok(Self::Page),
            Some("md") => Ok(Self::Markdown),
            _ => {
                let problem = "its name must end with .xml (JUnit), .html or .md";
                Err(UsageError::new(Code::UsageInvalid, format!("--report {}: {problem}", path.display())))
            }
        }
    }
}

pub(super) fn regress(args: &RegressArgs) -> Result<Exit> {
    expect_routine(&args.routine)?;
    args.check_outputs()?;
    let prepared = Prepared::load(Request { routine: args.routine.clone(), overrides: args.overrides.overrides() })?;
    let baseline = args.baseline.as_deref().map(|path| read_baseline(path, &prepared)).transpose()?;
    if let (Some(baseline), Some(rows)) = (&baseline, &args.rows) {
        return compared(args, &prepared, baseline, &read_rows(rows, &prepared, baseline)?);
    }
    let jobs = match &baseline {
        Some(baseline) => jobs_of(baseline, args, &prepared)?,
        None => jobs(&prepared, range_of(args.seeds, &prepared)?, None, &BTreeSet::new()),
    };
    note(foretold(baseline.as_ref(), jobs.len(), n_threads(args)));
    let Some(now) = run(args, &prepared, &jobs)? else {
        note("stopped; nothing was compared");
        return Ok(Exit::Failure);
    };
    match (&baseline, &args.write_baseline) {
        (Some(baseline), _) => compared(args, &prepared, baseline, &now),
        (None, Some(out)) => written(out, &prepared, &now),
        (None, None) => Ok(Exit::Ok),
    }
}

/// Writes the runs as a baseline.
fn written(out: &Path, prepared: &Prepared, now: &Table) -> Result<Exit> {
    output::write_whole(out, baseline_text(prepared, now)?.as_bytes())?;
    let summary = statistics(now, &prepared.routine.name, &prepared.fingerprint);
    say_wrapped(&format!("{}written      {}", table(&summary, terminal_width()), out.display()))?;
    Ok(crate::cli::batch::exit_of(&summary))
}

/// Compares the runs with the baseline, and writes the result.
fn compared(args: &RegressArgs, prepared: &Prepared, baseline: &Table, now: &Table) -> Result<Exit> {
    if let Some(out) = &args.out {
        output::write_whole(out, table_text(now).as_bytes())?;
    }
    let comparison = compare(baseline, now, &prepared.routine.regress);
    let name = &prepared.routine.name;
    for path in &args.report {
        let text = match Form::of(path)? {
            Form::Markdown => regress_markdown(&comparison, name),
            Form::Page => regress_page(&comparison, name),
            Form::JUnit => {
                let undecided = if args.allow_inconclusive { Undecided::Passes } else { Undecided::Fails };
                regress_junit(&comparison, name, undecided).context("the comparison has no XML form")?
            }
        };
        output::write_whole(path, text.as_bytes())?;
    }
    if args.json {
        say(&json(&comparison, args)?)?;
    } else {
        say_wrapped(&regress_table(&comparison, terminal_width()))?;
    }
    Ok(match comparison.verdict {
        Verdict::Worse => Exit::Refused,
        Verdict::Inconclusive if !args.allow_inconclusive => Exit::Refused,
        Verdict::Inconclusive | Verdict::NotWorse => Exit::Ok,
    })
}

fn json(comparison: &Comparison, args: &RegressArgs) -> Result<String> {
    let mut value = serde_json::to_value(comparison).context("the comparison has no JSON form")?;
    value["routine"] = args.routine.display().to_string().into();
    value["baseline"] = args.baseline.as_ref().map(|path| path.display().to_string()).into();
    serde_json::to_string_pretty(&value).context("the comparison has no JSON form")
}

/// Usual speed of a run over the arm's time, with tags as corners. Rendered images take tens of times as long.
const USUAL_SPEED: f64 = 50.0;

fn n_threads(args: &RegressArgs) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    args.threads.map_or_else(cores, usize::from)
}

/// Text with the number of runs, and their estimated time.
fn foretold(baseline: Option<&Table>, n_jobs: usize, n_threads: usize) -> String {
    let times_s: Vec<f64> = baseline
        .and_then(|table| Some((table, table.place(Metric::SimulatedTime)?)))
        .map(|(table, place)| table.rows.iter().filter_map(|row| row.figures[place]).collect())
        .unwrap_or_default();
    let runs = format!("{n_jobs} runs on {n_threads} threads");
    match quantile(&times_s, 0.5) {
        Some(each_s) => format!(
            "{runs}, {each_s:.0} s of the arm's time each: about {:.0} s",
            each_s / USUAL_SPEED * n_jobs.div_ceil(n_threads) as f64
        ),
        None => format!("{runs}; the first one says how long they take"),
    }
}

/// Jobs that repeat the baseline's runs with the current routine.
fn jobs_of(baseline: &Table, args: &RegressArgs, prepared: &Prepared) -> Result<Vec<Job>> {
    let file = args.baseline.as_deref().unwrap_or(&args.routine).display();
    let wanted = |row: &&Row| args.seeds.is_none_or(|seeds| seeds.contains(row.seed));
    let job = |row: &Row| {
        let setting = prepared.settings.iter().find(|setting| setting.text() == row.settings);
        let problem = || {
            let routine = args.routine.display();
            UsageError::new(
                Code::KeyMissing,
                format!("{file}: the matrix of {routine} has no point `{}`", row.settings),
            )
        };
        Ok(prepared.job(setting.ok_or_else(problem)?, row.seed))
    };
    let jobs = baseline.rows.iter().filter(wanted).map(job).collect::<Result<Vec<Job>>>()?;
    let there: BTreeSet<u64> = jobs.iter().map(|job| job.seed).collect();
    // A baseline has few seeds, so that few of a long range are visited.
    if let Some((seeds, first)) =
        args.seeds.and_then(|seeds| Some((seeds, seeds.seeds().find(|s| !there.contains(s))?)))
    {
        let problem = format!(
            "{file}: has {} of the seeds {seeds}, and lacks seed {first}: give seeds that the baseline has, or write a \
             baseline of more",
            there.len()
        );
        return Err(UsageError::new(Code::UsageInvalid, problem).into());
    }
    if jobs.is_empty() {
        return Err(UsageError::new(Code::UsageInvalid, format!("{file}: has no runs")).into());
    }
    Ok(jobs)
}

/// The new rows, sorted; `None` when stopped. Rows of earlier runs are not used, because the program may have changed.
fn run(args: &RegressArgs, prepared: &Prepared, jobs: &[Job]) -> Result<Option<Table>> {
    let stop = Interrupt::install()?;
    let folder = tempfile::tempdir().context("no temporary folder can be made")?;
    let many = BatchRun {
        prepared,
        folder: folder.path(),
        keep: Keep::StreamsAlone,
        threads: args.threads,
        stop: stop.flag(),
    };
    let mut now = Table { names: prepared.columns.names(), rows: Vec::new() };
    let mut bar = CampaignBar::new(prepared, &now, jobs.len());
    let started = Instant::now();
    let whole = run_many(&many, jobs, &mut |row| {
        bar.add(&row);
        if now.rows.is_empty() && jobs.len() > 1 {
            let first_s = started.elapsed().as_secs_f64();
            let all_s = first_s * jobs.len().div_ceil(n_threads(args)) as f64;
            bar.say(&format!("the first run took {first_s:.0} s: about {all_s:.0} s for all of them"));
        }
        now.rows.push(row);
        Ok(())
    });
    bar.finish();
    now.rows.sort_by_key(Row::key);
    Ok(whole?.then_some(now))
}
