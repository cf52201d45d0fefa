//! `--confirm`: the operator confirms each motion on stdin.

use std::io::BufRead;

use crate::cli::progress::Bar;
use armcal_belief::session::{Approval, MotionAhead, Progress};
use armcal_core::streams::Phase;

/// A progress bar that asks for confirmation.
pub(super) struct Confirm<'a, R> {
    bar: &'a mut Bar,
    answers: R,
}

impl<'a, R: BufRead> Confirm<'a, R> {
    pub fn new(bar: &'a mut Bar, answers: R) -> Self {
        Self { bar, answers }
    }

    /// Reads one line of the operator; `None` at the end of the input.
    fn line(&mut self) -> Option<String> {
        let mut line = String::new();
        match self.answers.read_line(&mut line) {
            Ok(n) if n > 0 => Some(line.trim().to_lowercase()),
            Ok(_) | Err(_) => None,
        }
    }
}

/// Meaning of a line; `None` for no valid answer.
fn meant(line: &str) -> Option<Approval> {
    match line {
        "" | "y" | "yes" | "approve" => Some(Approval::Approve),
        "h" | "hold" => Some(Approval::Hold),
        "a" | "abort" => Some(Approval::Abort("the operator said so".to_owned())),
        _ => None,
    }
}

impl<R: BufRead> Progress for Confirm<'_, R> {
    fn update(&mut self, phase: Phase, done: usize, total: usize, simulated_s: f64) {
        self.bar.update(phase, done, total, simulated_s);
    }

    fn wall_s(&self) -> f64 {
        self.bar.wall_s()
    }

    fn stop_requested(&self) -> bool {
        self.bar.stop_requested()
    }

    fn wants_to_approve(&self) -> bool {
        true
    }

    fn approve(&mut self, ahead: &MotionAhead) -> Approval {
        self.bar.say(&format!("next: {ahead}"));
        loop {
            self.bar.say("y (or Enter) approve, h hold, a abort?");
            let Some(line) = self.line() else {
                self.bar.say("nobody answers on stdin: the session ends here");
                return Approval::Abort("nobody answers on stdin".to_owned());
            };
            match meant(&line) {
                Some(approval) => return approval,
                None => self.bar.say(&format!("`{line}` is none of y, h, a")),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_what_they_say() {
        for line in ["", "y", "yes", "approve"] {
            assert_eq!(meant(line), Some(Approval::Approve));
        }
        assert_eq!(meant("h"), Some(Approval::Hold));
        assert!(matches!(meant("a"), Some(Approval::Abort(_))));
        assert_eq!(meant("n"), None, "what is not understood is asked again, and moves nothing");
    }
}
