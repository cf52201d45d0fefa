//! `watch --stationary`: the online estimator on a batch's views, whose result must agree with the batch.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;

use super::told::{Form, Told};
use crate::cli::belief_text::exit_of;
use crate::cli::calibration_inputs::CalibrationInputs;
use crate::cli::closing::say_wrapped;
use crate::cli::exit::Exit;
use crate::cli::stdout::say;
use armcal_belief::calib::Status;

/// Adds the views of a batch one by one, without drift, and prints the distance of the last estimate from the batch.
pub(super) fn stationary(given: &CalibrationInputs<'_>, out: Option<&Path>, form: Form) -> Result<Exit> {
    let (batch, lost) = given.batch()?;
    let mut told = Told::new(form);
    let follower = batch.follow(&mut |follower, events| told.hear(follower, events));
    told.end(&follower, out)?;
    let calibration = &batch.calibration;
    let off = batch.largest_difference_sigmas(follower.estimator());
    if form == Form::Json {
        let batch = BatchLine {
            status: calibration.status,
            refusal: calibration.refusal.as_deref(),
            largest_difference_sigmas: off,
        };
        say(&serde_json::to_string(&LastLine { batch }).context("the batch has no JSON form")?)?;
    } else {
        let verdict =
            calibration.refusal.as_ref().map_or_else(|| "accepted".to_owned(), |reason| format!("refused: {reason}"));
        let off = off.map_or_else(
            || "not comparable: it estimates something else".to_owned(),
            |sigmas| format!("at most {sigmas:.3} of its sigma in any sensor, link, mount, lens or tag"),
        );
        say_wrapped(&format!("batch        {verdict}\ndifference   {off}"))?;
    }
    let by_data = if lost { Exit::DataLost } else { Exit::Ok };
    Ok(if calibration.status == Status::Refused { Exit::Refused } else { exit_of(&follower, by_data) })
}

/// Last line of a stationary estimate: the batch for comparison.
#[derive(Serialize)]
struct LastLine<'a> {
    batch: BatchLine<'a>,
}

#[derive(Serialize)]
struct BatchLine<'a> {
    status: Status,
    refusal: Option<&'a str>,
    /// Largest difference from the batch in standard deviations; null where the batch estimates other parameters.
    largest_difference_sigmas: Option<f64>,
}
