//! Common parts of `campaign` and `regress`: runs on all cores, progress, Ctrl-C.

use armcal_core::codes::Code;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::Result;
use indicatif::ProgressBar;

use crate::campaign::{
    Answer, CampaignError, CampaignSummary, Engine, Job, Prepared, Row, RunStatus, SingleRun, Table, run_job, run_jobs,
};
use crate::cli::exit::{Exit, UsageError, of_cause, of_summary};
use crate::cli::stdout::{is_quiet, note};
use crate::cli::waiting::bar_style;
use crate::output;
use crate::report::RunSummary;
use crate::run::Keep;
use crate::run::RunError;
use armcal_belief::session::Progress;
use armcal_core::routine::SeedRange;
use armcal_core::stats::quantile;
use armcal_core::streams::Phase;

/// Settings of the runs.
pub(super) struct BatchRun<'a> {
    pub prepared: &'a Prepared,
    /// Folder that holds the runs' folders.
    pub folder: &'a Path,
    pub keep: Keep,
    pub threads: Option<u16>,
    pub stop: &'a AtomicBool,
}

/// Runs the jobs; returns false if it was stopped before the last one.
pub(super) fn run_many(
    many: &BatchRun<'_>,
    jobs: &[Job],
    on_row: &mut (dyn FnMut(Row) -> Result<(), CampaignError> + Send),
) -> Result<bool> {
    let single = SingleRun { prepared: many.prepared, folder: many.folder, keep: many.keep, exit_code: &exit_code };
    let engine = Engine {
        threads: many.threads.map(usize::from),
        stop: many.stop,
        n_figures: many.prepared.columns.names().len(),
        panic_exit_code: Exit::Failure.code(),
    };
    let result = run_jobs(&engine, jobs, &|job| run_job(&single, job, &mut Unwatched(Instant::now())), on_row);
    if many.keep == Keep::StreamsAlone {
        // Only a killed campaign leaves files in the folder; they do no harm if they cannot be removed.
        let _ = std::fs::remove_dir_all(many.folder);
    }
    Ok(result?)
}

/// Exit code of `armcal run` for this result.
fn exit_code(result: Result<&RunSummary, &RunError>) -> u8 {
    result.map_or_else(|error| of_cause(error), of_summary).code()
}

/// Exit for the worst result of any row.
pub(super) fn exit_of(summary: &CampaignSummary) -> Exit {
    let any = |of: fn(&crate::campaign::SettingStatistics) -> usize| summary.settings.iter().any(|s| of(s) > 0);
    // With limits, the campaign is good if they hold, regardless of single runs.
    if !summary.until.is_empty() {
        let holds = summary.until.iter().all(|result| result.answer == Answer::Below);
        return if holds { Exit::Ok } else { Exit::Refused };
    }
    if any(|s| s.failed) {
        Exit::Failure
    } else if any(|s| s.refused + s.missed) {
        Exit::Refused
    } else {
        Exit::Ok
    }
}

/// The requested seeds, or else the routine's.
pub(super) fn range_of(asked: Option<SeedRange>, prepared: &Prepared) -> Result<SeedRange> {
    let problem = || {
        let file = prepared.routine.file.display();
        UsageError::new(Code::UsageInvalid, format!("which seeds? Give --seeds A..B, or seeds in [campaign] of {file}"))
    };
    Ok(asked.or(prepared.routine.campaign.seeds).ok_or_else(problem)?)
}

/// Checks that the table's name ends in .csv, because the other files' names are derived from it. The check comes
/// before hours of work.
pub(super) fn check_name(out: &Path) -> Result<()> {
    if out.extension().is_some_and(|extension| extension == "csv") {
        return output::check_writable(out).map_err(Into::into);
    }
    Err(UsageError::new(Code::FileFormat, format!("{}: the name of a table must end in .csv", out.display())).into())
}

/// A clock without display: the progress of a single run among many is not shown.
struct Unwatched(Instant);

impl Progress for Unwatched {
    fn update(&mut self, _: Phase, _: usize, _: usize, _: f64) {}

    fn wall_s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Progress line on stderr: number of finished and failed runs, and the median error so far.
pub(super) struct CampaignBar {
    bar: ProgressBar,
    tool_error: Option<usize>,
    tool_errors_m: Vec<f64>,
    failed: usize,
    refused: usize,
}

impl CampaignBar {
    /// Makes the line; `before` has the existing rows.
    pub fn new(prepared: &Prepared, before: &Table, n_jobs: usize) -> Self {
        let bar = if is_quiet() { ProgressBar::hidden() } else { ProgressBar::new(n_jobs as u64) };
        if let Some(style) = bar_style("{elapsed_precise} {msg} {wide_bar} {pos}/{len}{left}") {
            bar.set_style(style);
        }
        let tool_error = prepared.columns.names().iter().position(|name| name == "tool_error_after_median_m");
        let mut made = Self { bar, tool_error, tool_errors_m: Vec::new(), failed: 0, refused: 0 };
        for row in &before.rows {
            made.count(row);
        }
        made
    }

    fn count(&mut self, row: &Row) {
        self.failed += usize::from(row.status == RunStatus::Failed);
        self.refused += usize::from(matches!(row.status, RunStatus::Refused | RunStatus::Missed));
        self.tool_errors_m.extend(self.tool_error.and_then(|place| row.figures.get(place).copied().flatten()));
    }

    pub fn add(&mut self, row: &Row) {
        self.count(row);
        let median =
            quantile(&self.tool_errors_m, 0.5).map_or_else(|| "-".to_owned(), |m| format!("{:.2} mm", m * 1e3));
        let (failed, refused) = (self.failed, self.refused);
        self.bar.set_message(format!("tool error {median} (median), {refused} refused or missed, {failed} failed"));
        self.bar.inc(1);
    }

    /// Prints a line above the bar, on stderr, whether that is a terminal or not.
    pub fn say(&self, line: &str) {
        self.bar.suspend(|| note(line));
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
