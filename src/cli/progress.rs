//! Progress on stderr.

use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::interrupt::Interrupt;
use crate::cli::stdout::note;
use armcal_belief::session::Progress;
use armcal_core::streams::Phase;

/// One line that says what the arm is doing.
pub(super) struct Bar {
    bar: ProgressBar,
    started: Instant,
    interrupt: Interrupt,
}

impl Bar {
    /// `started`: when the command began. Stops the run when `interrupt` says so.
    pub fn new(started: Instant, interrupt: Interrupt) -> Self {
        let bar = ProgressBar::new(1);
        let template = "{elapsed_precise} {msg:<44} {wide_bar} {pos}/{len}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar, started, interrupt }
    }

    /// A line above the bar, on stderr, whether that is a terminal or not.
    pub fn say(&self, line: &str) {
        self.bar.suspend(|| note(format_args!("{line}")));
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
