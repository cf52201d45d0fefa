//! `armcal campaign`: one routine, many seeds and settings.

use armcal_core::codes::Code;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use crate::campaign::ExistingRows;
use crate::campaign::{
    CampaignSummary, MissingShards, Origin, Prepared, Request, Row, Shard, Share, Stopping, Store, Table, Until, jobs,
    merge, table, worst_rows, write_results,
};
use crate::cli::batch::{BatchRun, CampaignBar, check_name, exit_of, range_of, run_many};
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

/// Runs whose folders stay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KeptRuns {
    All,
    Worst(u16),
}

/// Largest number of folders of worst runs.
const MAX_WORST: u16 = 1000;

fn kept(text: &str) -> Result<KeptRuns, String> {
    let worst = text.parse().ok().filter(|n| *n <= MAX_WORST).map(KeptRuns::Worst);
    if text == "all" { Some(KeptRuns::All) } else { worst }.ok_or_else(|| format!("write all, or 0 to {MAX_WORST}"))
}

#[derive(Debug, Args)]
pub(super) struct CampaignArgs {
    /// Routine (.toml); [campaign] in it may give seeds and a matrix of settings
    #[arg(required_unless_present = "merge", conflicts_with = "merge")]
    #[arg(value_parser = named::routine())]
    routine: Option<PathBuf>,
    /// Seeds A..B, both included, or one number; default: campaign.seeds of the routine
    #[arg(long, value_name = "A..B")]
    seeds: Option<SeedRange>,
    /// Run every N-th seed from the K-th on
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Table (.csv); -summary.json, -summary.md, -report.html and, where it is built, .parquet are written next to
    /// it; default: recordings/ROUTINE-NAME/campaign.csv
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Stop when a rate is decided, such as "contacts < 0.001 at 95 %"; rates: contacts, missed, refused, failed,
    /// not_accepted; repeatable. --seeds is the upper limit
    #[arg(long, value_name = "LIMIT", conflicts_with = "shard")]
    until: Vec<Until>,
    /// Threads, one run each; default: all cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print -summary.json instead of the table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overrides: OverrideArgs,
    /// Keep the folders of `all` runs in FILE.runs, or run the N worst seeds again and keep their folders with replays
    /// in FILE.worst: contacts, failures, refusals, missed limits, then the largest tool errors
    #[arg(long, value_name = "all|N", default_value = "0", value_parser = kept)]
    keep: KeptRuns,
    /// Discard existing rows
    #[arg(long)]
    fresh: bool,
    /// Merge the tables of shards into --out
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "out",
          conflicts_with_all = ["seeds", "shard", "until", "threads", "keep", "fresh", "set", "robot"])]
    merge: Vec<PathBuf>,
    /// Merge even if tables of some shards are missing
    #[arg(long, requires = "merge")]
    allow_missing: bool,
}

pub(super) fn campaign(args: &CampaignArgs) -> Result<Exit> {
    match (&args.routine, &args.out) {
        (None, Some(out)) => merged(args, out),
        (Some(routine), _) => run(args, routine),
        (None, None) => Err(UsageError::new(Code::UsageInvalid, "a routine is missing".to_owned()).into()),
    }
}

fn merged(args: &CampaignArgs, out: &Path) -> Result<Exit> {
    spare_inputs(out, args.merge.iter().map(PathBuf::as_path))?;
    check_name(out)?;
    let missing = if args.allow_missing { MissingShards::LeaveOut } else { MissingShards::Refuse };
    let (rows, summary) = merge(&args.merge, missing)?;
    output::make_folder(output::parent(out))?;
    write_results(out, &rows, &summary)?;
    show(args, &summary, out)
}

fn run(args: &CampaignArgs, routine: &Path) -> Result<Exit> {
    let started = Instant::now();
    expect_routine(routine)?;
    let stop = Interrupt::install()?;
    let request = Request { routine: routine.to_owned(), overrides: args.overrides.overrides() };
    let prepared = Prepared::load(request)?;
    let out =
        args.out.clone().unwrap_or_else(|| Path::new("recordings").join(&prepared.routine.name).join("campaign.csv"));
    check_name(&out)?;
    let range = range_of(args.seeds, &prepared)?;
    let mut store = opened(args, &prepared, range, &out)?;
    let n_before = store.table().rows.len();
    let jobs = jobs(&prepared, range, args.shard, &store.done());
    let (suffix, keep) = match args.keep {
        KeptRuns::All => (".runs", Keep::Everything),
        KeptRuns::Worst(_) => (".work", Keep::StreamsAlone),
    };
    let folder = output::with_suffix(&out, suffix);
    let many = BatchRun { prepared: &prepared, folder: &folder, keep, threads: args.threads, stop: stop.flag() };
    let mut stopping = stopping(args, &prepared, range, &store);
    let jobs = if stopping.is_answered() { Vec::new() } else { jobs };
    if n_before > 0 {
        note(format_args!("{n_before} rows are there already; {} runs are left", jobs.len()));
    }
    let mut bar = CampaignBar::new(&prepared, store.table(), jobs.len());
    let whole = run_many(&many, &jobs, &mut |row| {
        bar.add(&row);
        stopping.add(&row);
        if stopping.is_answered() {
            stop.flag().store(true, Ordering::SeqCst);
        }
        store.append(row)
    });
    bar.finish();
    if !whole? && !stopping.is_answered() {
        let done = store.table().rows.len();
        note(format_args!("stopped with {done} rows kept; the same command goes on from there"));
        return Ok(Exit::Failure);
    }
    let (rows, summary) = store.answered(&stopping).finish(&prepared.routine.name)?;
    if !jobs.is_empty() {
        note(format_args!("{} runs in {:.0} s", jobs.len(), started.elapsed().as_secs_f64()));
    }
    // The answer that ended the campaign must not stop these runs.
    stop.flag().store(false, Ordering::SeqCst);
    keep_worst(
        args,
        &BatchRun { folder: &output::with_suffix(&out, ".worst"), keep: Keep::Everything, ..many },
        &rows,
    )?;
    show(args, &summary, &out)
}

/// Opens the store with its existing rows, and sets the contents of the summary.
fn opened(args: &CampaignArgs, prepared: &Prepared, range: SeedRange, out: &Path) -> Result<Store> {
    let existing = if args.fresh { ExistingRows::Discard } else { ExistingRows::Keep };
    let store = Store::open(out, &prepared.fingerprint, prepared.columns.names(), existing)?;
    let seeds = range.seeds();
    let share = args.shard.map(|shard| Share { shard, seeds: [*seeds.start(), *seeds.end()] });
    Ok(store.of(Origin::of_campaign(prepared)?).sharing(share).weighed(prepared.weights()))
}

/// Limits of `--until`, with the existing rows counted.
fn stopping(args: &CampaignArgs, prepared: &Prepared, range: SeedRange, store: &Store) -> Stopping {
    let seeds = (0..).zip(range.seeds()).map(|(place, seed)| (seed, prepared.met_by(place).count()));
    let settings = prepared.settings.iter().map(|setting| setting.index).collect();
    let stopping = Stopping::new(&args.until, seeds.collect(), settings, &store.table().names);
    let mut stopping = stopping.weighted(prepared.weights());
    store.table().rows.iter().for_each(|row| stopping.add(row));
    stopping
}

/// Repeats the worst runs to get their folders, because no folder was kept before the worst runs were known. Complete
/// folders stay.
fn keep_worst(args: &CampaignArgs, many: &BatchRun<'_>, rows: &Table) -> Result<()> {
    let KeptRuns::Worst(n_worst) = args.keep else { return Ok(()) };
    let is_there = |row: &Row| many.folder.join(format!("{}-{}/summary.json", row.setting, row.seed)).exists();
    let job = |row: &&Row| {
        let setting = many.prepared.settings.iter().find(|setting| setting.index == row.setting)?;
        (!is_there(row)).then(|| many.prepared.job(setting, row.seed))
    };
    let jobs: Vec<_> = worst_rows(rows, usize::from(n_worst)).iter().filter_map(job).collect();
    if jobs.is_empty() {
        return Ok(());
    }
    note(format_args!("{} of the worst runs are made again, for {}", jobs.len(), many.folder.display()));
    run_many(many, &jobs, &mut |_| Ok(()))?;
    Ok(())
}

fn show(args: &CampaignArgs, summary: &CampaignSummary, out: &Path) -> Result<Exit> {
    if args.json {
        say(&serde_json::to_string_pretty(summary).context("the summary has no JSON form")?)?;
    } else {
        say_wrapped(&format!("{}written      {}", table(summary, terminal_width()), out.display()))?;
    }
    Ok(exit_of(summary))
}
