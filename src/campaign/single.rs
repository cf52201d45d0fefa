//! One job: a run in its own folder, and its row.

use std::path::{Path, PathBuf};

use crate::campaign::row::one_line;
use crate::campaign::{CampaignError, Job, Prepared, Row, RunStatus};
use crate::output::OutputFolder;
use crate::report::RunSummary;
use crate::run::{Failure, Finished, Keep, RunError, RunInputs, RunOutput, execute};
use armcal_belief::calib::Status;
use armcal_belief::session::Progress;

/// Inputs that the runs of a campaign share.
pub struct SingleRun<'a> {
    pub prepared: &'a Prepared,
    /// Folder that holds the runs' folders, `SETTING-SEED`.
    pub folder: &'a Path,
    /// Files of a run that stay, as for `armcal run`.
    pub keep: Keep,
    /// Exit code of the command line for a finished run, by its summary, or for a failed one.
    pub exit_code: &'a (dyn Fn(Result<&RunSummary, &RunError>) -> u8 + Sync),
}

/// Runs a job. Every outcome for the arm is in the row.
///
/// # Errors
/// [`CampaignError::Machine`] where the machine was at fault, such as a full disk: that gives no row, because the next
/// try may succeed.
pub fn run_job(run: &SingleRun<'_>, job: &Job, progress: &mut dyn Progress) -> Result<Row, CampaignError> {
    let folder = run.folder.join(format!("{}-{}", job.setting, job.seed));
    let n_figures = run.prepared.columns.names().len();
    let Some(inputs) = run.prepared.inputs.get(job.setting as usize) else {
        return Ok(job.failed("input", format!("there is no setting {}", job.setting), n_figures));
    };
    let result = in_folder(inputs, job, &folder, run.keep, progress);
    if run.keep == Keep::StreamsAlone {
        // A folder that cannot be removed does not affect the figures, and is removed with its parent folder.
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
    // An interrupted campaign has left this folder.
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

/// The error message with its causes, without the path of this run: a row does not depend on the folder of its run.
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
