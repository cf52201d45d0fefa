//! Progress on stderr.

use std::time::Instant;

use indicatif::ProgressBar;

use crate::cli::interrupt::Interrupt;
use crate::cli::stdout::{complain, is_quiet};
use crate::cli::waiting::bar_style;
use armcal_belief::session::Progress;
use armcal_core::streams::Phase;

/// One line with the arm's current activity.
pub(super) struct Bar {
    bar: ProgressBar,
    started: Instant,
    interrupt: Interrupt,
    /// Current phase, to which the remaining time applies.
    phase: &'static str,
}

impl Bar {
    /// Makes the bar; `started` is the start of the command. The bar stops the run when `interrupt` asks for it.
    pub fn new(started: Instant, interrupt: Interrupt) -> Self {
        let bar = if is_quiet() { ProgressBar::hidden() } else { ProgressBar::new(1) };
        if let Some(style) = bar_style("{elapsed_precise} {msg:<46} {wide_bar} {pos}/{len}{left}") {
            bar.set_style(style);
        }
        Self { bar, started, interrupt, phase: "" }
    }

    /// Prints a question above the bar, on stderr, whether that is a terminal or not.
    pub fn say(&self, line: &str) {
        self.bar.suspend(|| complain(format_args!("{line}")));
    }

    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for Bar {
    fn update(&mut self, phase: Phase, done: usize, total: usize, simulated_s: f64) {
        let what = match phase {
            Phase::Plan => "planning",
            Phase::Move | Phase::Settle | Phase::Capture => "capturing views",
            Phase::Calibrate => "calibrating",
            Phase::Reach => "reaching for targets",
            Phase::Wait => "waiting",
            Phase::Done => "done",
        };
        if std::mem::replace(&mut self.phase, what) != what {
            self.bar.reset_eta();
        }
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
        self.bar.set_message(format!("{what}, {simulated_s:.0} s of simulated time"));
    }

    fn wall_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    fn stop_requested(&self) -> bool {
        self.interrupt.is_requested()
    }
}
