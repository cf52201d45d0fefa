//! `armcal calibrate --online`: a recording followed message by message, and what was believed over its time.

use std::path::Path;

use anyhow::Result;

use crate::cli::belief_text::{belief, exit_of, summary};
use crate::cli::calibration_inputs::CalibrationInputs;
use crate::cli::exit::Exit;
use crate::cli::stdout::say;
use crate::output;
use armcal_belief::calib::Status;
use armcal_belief::calib::online::{BeliefLog, Follower, OnlineSettings};

/// Follows the recordings, writes belief.jsonl into `out` and says how it ended.
pub(super) fn calibrate_online(given: &CalibrationInputs<'_>, out: &Path) -> Result<Exit> {
    let mut log = BeliefLog::default();
    let (follower, lost) = given.follow(OnlineSettings::default(), &mut |follower, events| {
        log.hear(follower, events);
    })?;
    let text = written(&follower, log, out)?;
    say(&text)?;
    Ok(exit_of(&follower, if lost { Exit::DataLost } else { Exit::Ok }))
}

/// Takes the views of a batch in one by one, nothing drifting, and says how far from the batch it ends.
pub(super) fn stationary(given: &CalibrationInputs<'_>, out: &Path) -> Result<Exit> {
    let (batch, lost) = given.batch()?;
    let mut log = BeliefLog::default();
    let follower = batch.follow(&mut |follower, events| {
        log.hear(follower, events);
    });
    let text = written(&follower, log, out)?;
    let verdict = match &batch.calibration.refusal {
        Some(reason) => format!("refused: {reason}"),
        None => "accepted".to_owned(),
    };
    let off = batch.largest_difference_sigmas(follower.estimator()).map_or_else(
        || "not comparable: it estimates something else".to_owned(),
        |sigmas| format!("at most {sigmas:.3} of its sigma in any sensor, link, mount, lens or tag"),
    );
    say(&format!("{text}\nbatch        {verdict}\ndifference   {off}"))?;
    let by_data = if lost { Exit::DataLost } else { Exit::Ok };
    Ok(if batch.calibration.status == Status::Refused { Exit::Refused } else { exit_of(&follower, by_data) })
}

/// Writes belief.jsonl; what is told of it.
fn written(follower: &Follower, mut log: BeliefLog, out: &Path) -> Result<String> {
    let row = belief(follower)?;
    log.end(follower);
    let file = out.join("belief.jsonl");
    output::write_together(&[(&file, log.to_jsonl().as_bytes())])?;
    Ok(format!("{}{}\nwritten      {}", log.told(), summary(follower, &row), file.display()))
}
