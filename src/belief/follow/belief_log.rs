//! Log of the online estimate: one line per minute of arm time, and one for each event.

use crate::follow::constants::belief_log::EVERY_S;
use serde::{Deserialize, Serialize};

use crate::follow::event::OnlineEvent;
use crate::follow::follower::{BeliefRow, Follower};
use armcal_core::codes::{Code, Coded};
use armcal_core::time::Stamp;

/// A line of belief.jsonl.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BeliefLine {
    /// Online estimate at one time.
    Belief(BeliefRow),
    /// An event.
    Event(OnlineEvent),
}

impl BeliefLine {
    /// Returns the line of belief.jsonl, without its end.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Plain numbers and text always serialize.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// Lines recorded so far.
#[derive(Clone, Debug, Default)]
pub struct BeliefLog {
    /// Lines in the order in which they became known.
    pub lines: Vec<BeliefLine>,
    first: Option<Stamp>,
    last: Option<Stamp>,
    /// Code of the last reported doubt.
    doubt: Option<Code>,
}

impl BeliefLog {
    /// Adds lines after a message with the `events` that it revealed. Returns true if there are new lines.
    pub fn hear(&mut self, follower: &Follower, events: Vec<OnlineEvent>) -> bool {
        let Some(now) = follower.conditions().stamp else { return false };
        self.first.get_or_insert(now);
        let doubt = follower.doubt().map(|doubt| doubt.code());
        let is_new = !events.is_empty() || doubt != self.doubt;
        let is_due = is_new || self.last.is_none_or(|last| now.since_s(last) >= EVERY_S);
        if !is_due {
            return false;
        }
        self.lines.extend(events.into_iter().map(BeliefLine::Event));
        (self.last, self.doubt) = (Some(now), doubt);
        self.lines.extend(follower.belief().map(BeliefLine::Belief));
        true
    }

    /// Adds the final estimate after the last message.
    pub fn end(&mut self, follower: &Follower) {
        self.lines.extend(follower.belief().map(BeliefLine::Belief));
    }

    /// Returns the logged events.
    pub fn events(&self) -> impl Iterator<Item = &OnlineEvent> {
        self.lines.iter().filter_map(|line| match line {
            BeliefLine::Event(event) => Some(event),
            BeliefLine::Belief(_) => None,
        })
    }

    /// Returns the logged estimates.
    pub fn beliefs(&self) -> impl Iterator<Item = &BeliefRow> {
        self.lines.iter().filter_map(|line| match line {
            BeliefLine::Belief(row) => Some(row),
            BeliefLine::Event(_) => None,
        })
    }

    /// Returns the time since the first message as `h:mm:ss`.
    #[must_use]
    pub fn clock(&self, nanos: i64) -> String {
        let s = self.first.map_or(0.0, |first| Stamp { nanos }.since_s(first)).max(0.0) as u64;
        format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
    }

    /// Returns each event with its time, one per line.
    #[must_use]
    pub fn told(&self) -> String {
        self.events().map(|event| format!("{}  {}\n", self.clock(event.since_nanos), event.to_line())).collect()
    }

    /// Reads the text of belief.jsonl.
    ///
    /// # Errors
    /// Number of the first invalid line, and the reason.
    pub fn from_jsonl(text: &str) -> Result<Self, String> {
        let line = |(n, line): (usize, &str)| {
            serde_json::from_str::<BeliefLine>(line).map_err(|error| format!("line {}: {error}", n + 1))
        };
        let lines = text.lines().enumerate().map(line).collect::<Result<Vec<_>, _>>()?;
        let mut log = Self { lines, ..Self::default() };
        let first = log.beliefs().next().map(|row| Stamp { nanos: row.stamp_nanos });
        log.first = first;
        Ok(log)
    }

    /// Returns the text of belief.jsonl.
    #[must_use]
    pub fn to_jsonl(&self) -> String {
        self.lines.iter().map(|line| line.to_json() + "\n").collect()
    }
}
