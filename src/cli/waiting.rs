//! Signs of life on a terminal while something takes its time; nothing in a pipe, and nothing with `--quiet`.

use std::fmt::Write;
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

use crate::cli::stdout::is_quiet;

/// A line that says what is done, for how long already and, where the amount is known, for how long still. It goes away
/// with this.
pub struct Waiting {
    bar: ProgressBar,
}

/// The style of a template, which may have `{left}`: the time left, and nothing where nobody knows it yet.
pub(super) fn bar_style(template: &str) -> Option<ProgressStyle> {
    let style = ProgressStyle::with_template(template).ok()?;
    Some(style.with_key("left", |state: &ProgressState, out: &mut dyn Write| {
        let left_s = state.eta().as_secs();
        // What is said here reaches a terminal at most.
        if left_s > 0 {
            let _ = write!(out, ", {:#} left", HumanDuration(Duration::from_secs(left_s)));
        }
    }))
}

const TICK: Duration = Duration::from_millis(500);

impl Waiting {
    /// For work whose amount nobody knows beforehand.
    pub fn on(what: &str) -> Self {
        let bar = if is_quiet() { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        Self::with(bar, "{elapsed_precise} {msg} {spinner}", what)
    }

    /// For `total` pieces.
    pub fn for_each_of(total: u64, what: &str) -> Self {
        let bar = if is_quiet() { ProgressBar::hidden() } else { ProgressBar::new(total) };
        Self::with(bar, "{elapsed_precise} {msg} {wide_bar} {pos}/{len}{left}", what)
    }

    fn with(bar: ProgressBar, template: &str, what: &str) -> Self {
        if let Some(style) = bar_style(template) {
            bar.set_style(style);
        }
        bar.set_message(what.to_owned());
        bar.enable_steady_tick(TICK);
        Self { bar }
    }

    /// One more is done.
    pub fn one_more(&self) {
        self.bar.inc(1);
    }

    /// Whether anybody sees it.
    pub fn is_seen(&self) -> bool {
        !self.bar.is_hidden()
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
