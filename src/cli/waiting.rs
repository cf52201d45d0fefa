//! Progress display on a terminal during long work; none in a pipe, and none with `--quiet`.

use std::fmt::Write;
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

use crate::cli::stdout::is_quiet;

/// A line with the current work, the elapsed time and, where the amount is known, the remaining time. The line
/// disappears when the value is dropped.
pub struct Waiting {
    bar: ProgressBar,
}

/// The style of a template, which may have `{left}`: the remaining time, empty while it is unknown.
pub(super) fn bar_style(template: &str) -> Option<ProgressStyle> {
    let style = ProgressStyle::with_template(template).ok()?;
    Some(style.with_key("left", |state: &ProgressState, out: &mut dyn Write| {
        let left_s = state.eta().as_secs();
        // This text only reaches a terminal.
        if left_s > 0 {
            let _ = write!(out, ", {:#} left", HumanDuration(Duration::from_secs(left_s)));
        }
    }))
}

const TICK: Duration = Duration::from_millis(500);

impl Waiting {
    /// A display for work of unknown amount.
    pub fn on(what: &str) -> Self {
        let bar = if is_quiet() { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        Self::with(bar, "{elapsed_precise} {msg} {spinner}", what)
    }

    /// A display for `total` pieces.
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

    /// Counts one more piece as done.
    pub fn one_more(&self) {
        self.bar.inc(1);
    }

    /// True if the display is visible.
    pub fn is_seen(&self) -> bool {
        !self.bar.is_hidden()
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
