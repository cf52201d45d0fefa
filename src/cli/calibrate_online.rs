//! `armcal calibrate --online`: a recording followed message by message, and what was believed over its time.

use std::path::Path;

use anyhow::Result;
use serde::Serialize;

use crate::cli::calibration_inputs::CalibrationInputs;
use crate::cli::exit::{Exit, UsageError};
use crate::cli::stdout::say;
use crate::output;
use armcal_belief::calib::online::{BeliefRow, DriftModel, Follower, OnlineEvent, OnlineSettings};
use armcal_core::time::Stamp;

/// Between two lines of the belief, s of the arm's time.
const EVERY_S: f64 = 60.0;

/// A line of belief.jsonl.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum Line<'a> {
    Belief(&'a BeliefRow),
    Event(&'a OnlineEvent),
}

/// The lines so far.
#[derive(Default)]
struct BeliefLog {
    lines: String,
    told: String,
    first: Option<Stamp>,
    last: Option<Stamp>,
}

impl BeliefLog {
    fn add(&mut self, line: &Line<'_>) {
        // Plain numbers and text.
        self.lines += &serde_json::to_string(line).unwrap_or_default();
        self.lines.push('\n');
    }

    fn hear(&mut self, follower: &Follower, events: &[OnlineEvent]) {
        let Some(now) = follower.conditions().stamp else { return };
        let first = *self.first.get_or_insert(now);
        for event in events {
            self.add(&Line::Event(event));
            let at_s = Stamp { nanos: event.since_nanos }.since_s(first);
            self.told += &format!("{}  {}\n", clock(at_s), event.to_line());
        }
        if events.is_empty() && self.last.is_some_and(|last| now.since_s(last) < EVERY_S) {
            return;
        }
        self.last = Some(now);
        if let Some(row) = follower.belief() {
            self.add(&Line::Belief(&row));
        }
    }
}

/// `h:mm:ss`.
fn clock(at_s: f64) -> String {
    let s = at_s.max(0.0) as u64;
    format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
}

/// Follows the recordings, writes belief.jsonl into `out` and says how it ended.
pub(super) fn calibrate_online(given: &CalibrationInputs<'_>, drift: DriftModel, out: &Path) -> Result<Exit> {
    let mut log = BeliefLog::default();
    let settings = OnlineSettings { drift, ..OnlineSettings::default() };
    let (follower, lost) = given.follow(settings, &mut |follower, events| log.hear(follower, &events))?;
    let Some(row) = follower.belief() else {
        return Err(UsageError("no view with tags: there is nothing to believe".to_owned()).into());
    };
    log.add(&Line::Belief(&row));
    output::write_together(&[(&out.join("belief.jsonl"), log.lines.as_bytes())])?;
    let mm = |summary: &armcal_core::stats::Summary| {
        format!("{:.2} mm, worst {:.2}", 1e3 * summary.median, 1e3 * summary.max)
    };
    let good = follower.is_good_enough();
    let health = match good {
        Some(true) => "good enough for the task",
        Some(false) => "not good enough for the task: views are needed",
        None => "no task is named",
    };
    say(&format!(
        "{}views        {}\ntool error   {} now, {} in an hour without views\nhealth       {health}\nwritten      {}",
        log.told,
        row.views,
        mm(&row.tool_error_m),
        mm(&row.tool_error_in_an_hour_m),
        out.join("belief.jsonl").display()
    ))?;
    Ok(match (good, lost) {
        (Some(false), _) => Exit::Refused,
        (_, true) => Exit::DataLost,
        _ => Exit::Ok,
    })
}
