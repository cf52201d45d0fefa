//! The online estimates, line by line, and their summary.

use std::path::Path;

use anyhow::Result;

use crate::cli::belief_text::{belief, line, summary};
use crate::cli::closing::say_wrapped;
use crate::cli::stdout::say;
use crate::output;
use armcal_belief::calib::online::{BeliefLine, BeliefLog, Follower, OnlineEvent};

/// Form of the printed lines.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    Text,
    Json,
}

/// The online estimates, and the number of printed ones.
pub(super) struct Told {
    log: BeliefLog,
    n_told: usize,
    form: Form,
    /// Result of the writes to stdout: a failure is reported at the end.
    printed: Result<()>,
}

impl Told {
    pub fn new(form: Form) -> Self {
        Self { log: BeliefLog::default(), n_told: 0, form, printed: Ok(()) }
    }

    pub fn hear(&mut self, follower: &Follower, events: Vec<OnlineEvent>) {
        if self.log.hear(follower, events) {
            self.print_new(follower);
        }
    }

    fn print_new(&mut self, follower: &Follower) {
        let new = &self.log.lines[self.n_told..];
        let clock = |nanos| self.log.clock(nanos);
        let mut lines: Vec<String> = match self.form {
            Form::Json => new.iter().map(BeliefLine::to_json).collect(),
            Form::Text => {
                let in_words = |new: &BeliefLine| match new {
                    BeliefLine::Event(event) => format!("{}  {}", clock(event.since_nanos), event.to_line()),
                    BeliefLine::Belief(row) => format!("{}  {}", clock(row.stamp_nanos), line(follower, row)),
                };
                new.iter().map(in_words).collect()
            }
        };
        if let (Form::Text, [], Some(now)) = (self.form, new, follower.conditions().stamp) {
            lines.push(format!("{}  no view yet of a tag whose place is known", clock(now.nanos)));
        }
        self.n_told = self.log.lines.len();
        if self.printed.is_ok() {
            self.printed = lines.iter().try_for_each(|line| say(line));
        }
    }

    /// Prints the last line, writes the file, and prints the summary.
    pub fn end(mut self, follower: &Follower, out: Option<&Path>) -> Result<()> {
        let row = belief(follower)?;
        self.log.end(follower);
        self.print_new(follower);
        let mut ending = summary(follower, &row);
        if let Some(file) = out.map(|out| out.join("belief.jsonl")) {
            output::write_together(&[(&file, self.log.to_jsonl().as_bytes())])?;
            ending += &format!("\nwritten      {}", file.display());
        }
        self.printed?;
        if self.form == Form::Text { say_wrapped(&ending) } else { Ok(()) }
    }
}
