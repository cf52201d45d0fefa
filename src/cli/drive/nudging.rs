//! `--nudge`: moves one joint by one degree, after the operator's confirmation.

use std::io::BufRead;

use anyhow::Result;

use crate::cli::interrupt::Interrupt;
use crate::cli::stdout::note;
use armcal_live::{LiveArm, NudgeProblem, Wire};

/// Asks, moves the joint out and back, and asks whether that looked right.
pub(super) fn nudge_one(
    arm: &mut LiveArm<impl Wire>,
    joint: usize,
    answers: &mut impl BufRead,
    interrupt: &Interrupt,
) -> Result<()> {
    let name = arm.joint_name(joint);
    ask(answers, &format!("next: {name} by one degree towards the middle of its range, and back. Move it?"))?;
    let nudge = arm.nudge(joint, &|| interrupt.is_requested())?;
    note(format_args!(
        "{name}: told {:+.2} deg, read {:+.2} deg, came back to {:+.2} deg",
        nudge.asked_rad.to_degrees(),
        nudge.moved_rad.to_degrees(),
        nudge.left_rad.to_degrees()
    ));
    ask(answers, &format!("Did {name}, and nothing else, turn by about one degree, + as its axis in the URDF says?"))
}

/// Asks a question; continues only after a yes.
fn ask(answers: &mut impl BufRead, question: &str) -> Result<()> {
    note(format_args!("{question} y (or yes) goes on, anything else ends here"));
    let mut line = String::new();
    let answer = answers.read_line(&mut line).map(|_| line.trim().to_lowercase());
    match answer.as_deref() {
        Ok("y" | "yes") => Ok(()),
        _ => Err(NudgeProblem::Declined.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_yes_goes_on() {
        for (answer, goes_on) in [("y\n", true), ("Yes\n", true), ("\n", false), ("n\n", false), ("", false)] {
            assert_eq!(ask(&mut answer.as_bytes(), "?").is_ok(), goes_on, "{answer:?}");
        }
    }
}
