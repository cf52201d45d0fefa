//! `armcal calibrate --online`: a recording followed message by message, and what was believed over its time.

use std::path::Path;

use anyhow::Result;

use crate::cli::belief_text::{belief, exit_of, summary};
use crate::cli::calibration_inputs::CalibrationInputs;
use crate::cli::exit::Exit;
use crate::cli::stdout::say;
use crate::output;
use armcal_belief::calib::online::{BeliefLog, DriftModel, OnlineSettings};

/// Follows the recordings, writes belief.jsonl into `out` and says how it ended.
pub(super) fn calibrate_online(given: &CalibrationInputs<'_>, drift: DriftModel, out: &Path) -> Result<Exit> {
    let mut log = BeliefLog::default();
    let settings = OnlineSettings { drift, ..OnlineSettings::default() };
    let (follower, lost) = given.follow(settings, &mut |follower, events| {
        log.hear(follower, events);
    })?;
    let row = belief(&follower)?;
    log.end(&follower);
    output::write_together(&[(&out.join("belief.jsonl"), log.to_jsonl().as_bytes())])?;
    let written = out.join("belief.jsonl");
    say(&format!("{}{}\nwritten      {}", log.told(), summary(&follower, &row), written.display()))?;
    Ok(exit_of(&follower, if lost { Exit::DataLost } else { Exit::Ok }))
}
