//! `armcal calibrate --online`: a recording followed message by message, and what was believed over its time.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;

use crate::cli::belief_text::{belief, exit_of, summary};
use crate::cli::calibration_inputs::CalibrationInputs;
use crate::cli::closing::say_wrapped;
use crate::cli::exit::Exit;
use crate::cli::stdout::say;
use crate::output;
use armcal_belief::calib::Status;
use armcal_belief::calib::online::{BeliefLog, Follower, OnlineSettings};

/// What is said of a belief.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Told {
    /// How it ended.
    Text,
    /// The lines of belief.jsonl.
    Json,
}

/// Follows the recordings, writes belief.jsonl into `out` and says how it ended.
pub(super) fn calibrate_online(given: &CalibrationInputs<'_>, out: &Path, told: Told) -> Result<Exit> {
    let mut log = BeliefLog::default();
    let (follower, lost) = given.follow(OnlineSettings::default(), &mut |follower, events| {
        log.hear(follower, events);
    })?;
    let text = written(&follower, log, out, told)?;
    match told {
        Told::Text => say_wrapped(&text)?,
        Told::Json => say(&text)?,
    }
    Ok(exit_of(&follower, if lost { Exit::DataLost } else { Exit::Ok }))
}

/// Takes the views of a batch in one by one, nothing drifting, and says how far from the batch it ends.
pub(super) fn stationary(given: &CalibrationInputs<'_>, out: &Path, told: Told) -> Result<Exit> {
    let (batch, lost) = given.batch()?;
    let mut log = BeliefLog::default();
    let follower = batch.follow(&mut |follower, events| {
        log.hear(follower, events);
    });
    let text = written(&follower, log, out, told)?;
    let calibration = &batch.calibration;
    let off = batch.largest_difference_sigmas(follower.estimator());
    if told == Told::Json {
        let batch = BatchLine {
            status: calibration.status,
            refusal: calibration.refusal.as_deref(),
            largest_difference_sigmas: off,
        };
        let line = serde_json::to_string(&LastLine { batch }).context("the batch has no JSON form")?;
        say(&format!("{text}\n{line}"))?;
    } else {
        let verdict =
            calibration.refusal.as_ref().map_or_else(|| "accepted".to_owned(), |reason| format!("refused: {reason}"));
        let off = off.map_or_else(
            || "not comparable: it estimates something else".to_owned(),
            |sigmas| format!("at most {sigmas:.3} of its sigma in any sensor, link, mount, lens or tag"),
        );
        say_wrapped(&format!("{text}\nbatch        {verdict}\ndifference   {off}"))?;
    }
    let by_data = if lost { Exit::DataLost } else { Exit::Ok };
    Ok(if calibration.status == Status::Refused { Exit::Refused } else { exit_of(&follower, by_data) })
}

/// Behind the lines of a stationary belief: the batch that it was taken from.
#[derive(Serialize)]
struct LastLine<'a> {
    batch: BatchLine<'a>,
}

#[derive(Serialize)]
struct BatchLine<'a> {
    status: Status,
    refusal: Option<&'a str>,
    /// Null where the batch estimates something else.
    largest_difference_sigmas: Option<f64>,
}

/// Writes belief.jsonl; what is told of it.
fn written(follower: &Follower, mut log: BeliefLog, out: &Path, told: Told) -> Result<String> {
    let row = belief(follower)?;
    log.end(follower);
    let (file, lines) = (out.join("belief.jsonl"), log.to_jsonl());
    output::write_together(&[(&file, lines.as_bytes())])?;
    if told == Told::Json {
        return Ok(lines.trim_end().to_owned());
    }
    Ok(format!("{}{}\nwritten      {}", log.told(), summary(follower, &row), file.display()))
}
