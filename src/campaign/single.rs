//! One job: a run in a folder of its own, and its row.

use std::path::{Path, PathBuf};

use crate::campaign::row::one_line;
use crate::campaign::{CampaignError, Job, Prepared, Row, RunStatus};
use crate::output::OutputFolder;
use crate::report::RunSummary;
use crate::run::{Failure, Finished, Keep, RunError, RunInputs, RunOutput, execute};
use armcal_belief::calib::Status;
use armcal_belief::session::Progress;

/// What the runs of a campaign share.
pub struct SingleRun<'a> {
    pub prepared: &'a Prepared,
    /// Runs have their folders in here, `SETTING-SEED`.
    pub folder: &'a Path,
    /// Whether a run's folder stays, as `armcal run` leaves it.
    pub keep: Keep,
    /// What the command line exits with, for a run that came to its end (whether it is good) or one that failed.
    pub exit_code: &'a (dyn Fn(Result<&RunSummary, &RunError>) -> u8 + Sync),
}

/// Runs a job. Whatever happens to the arm is in the row.
///
/// # Errors
/// [`CampaignError::Machine`] where the machine was at fault, such as a full disk: that is no row, for the next try may
/// go well.
pub fn run_job(run: &SingleRun<'_>, job: &Job, progress: &mut dyn Progress) -> Result<Row, CampaignError> {
    let folder = run.folder.join(format!("{}-{}", job.setting, job.seed));
    let n_figures = run.prepared.columns.names().len();
    let Some(inputs) = run.prepared.inputs.get(job.setting as usize) else {
        return Ok(job.failed("input", format!("there is no setting {}", job.setting), n_figures));
    };
    let result = in_folder(inputs, job, &folder, run.keep, progress);
    if run.keep == Keep::StreamsAlone {
        // A folder that cannot be removed does no harm to the figures, and goes with the folder about it.
        let _ = std::fs::remove_dir_all(&folder);
    }
    match result {
        Ok(finished) => {
            Ok(Row { exit_code: (run.exit_code)(Ok(&finished.summary)), ..of_finished(run, job, &finished) })
        }
        Err(failure) if failure.error.is_of_machine() => {
            Err(CampaignError::Machine { seed: job.seed, source: failure.error })
        }
        Err(failure) => Ok(Row {
            exit_code: (run.exit_code)(Err(&failure.error)),
            ..job.failed(failure.stage.name(), failure_text(&failure.error, &folder), n_figures)
        }),
    }
}

fn in_folder(
    inputs: &RunInputs,
    job: &Job,
    folder: &PathBuf,
    keep: Keep,
    progress: &mut dyn Progress,
) -> Result<Finished, Failure> {
    // Left behind by a campaign that was killed.
    if folder.exists() {
        let _ = std::fs::remove_dir_all(folder);
    }
    let (output, _) = OutputFolder::open(folder).map_err(Failure::of_output)?;
    execute(inputs, job.seed, RunOutput { folder: &output, keep, listener: None }, progress)
}

fn of_finished(run: &SingleRun<'_>, job: &Job, finished: &Finished) -> Row {
    let status = match finished.calibration.status {
        Status::Accepted if finished.summary.asserts_hold() => RunStatus::Accepted,
        Status::Accepted => RunStatus::Missed,
        Status::Refused => RunStatus::Refused,
    };
    let missed = finished.summary.asserts.iter().filter(|limit| !limit.holds);
    let missed: Vec<String> = missed.map(|limit| format!("step {} {}", limit.step, limit.key)).collect();
    let failure = match &finished.calibration.refusal {
        Some(why) => one_line(why),
        None if missed.is_empty() => String::new(),
        None => format!("does not hold: {}", missed.join(", ")),
    };
    Row { status, figures: run.prepared.columns.figures(finished), ..job.failed("", failure, 0) }
}

/// The message with its causes, without the folder of this run: a row does not depend on where it was made.
fn failure_text(error: &RunError, folder: &Path) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(source) = cause {
        let more = source.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = source.source();
    }
    one_line(&text.replace(&format!("{}/", folder.display()), ""))
}
