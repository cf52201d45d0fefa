//! Approval of each motion by an operator.

use crate::plan::Path;
use crate::session::constants::approval::{HOLD_S, TOLD_RAD};
use crate::session::motion::Driver;
use crate::session::{Approval, MotionAhead, SessionError};
use armcal_core::streams::LogLevel;

impl Driver<'_> {
    /// Returns when the motion may begin.
    ///
    /// # Errors
    /// [`SessionError::Interrupted`] if it may not.
    pub(crate) fn ask(&mut self, path: &Path, clearance_m: Option<f64>) -> Result<(), SessionError> {
        if !self.progress.wants_to_approve() {
            return Ok(());
        }
        let ahead = self.ahead(path, clearance_m);
        loop {
            match self.progress.approve(&ahead) {
                Approval::Approve => return self.log(LogLevel::Info, &format!("approved: {ahead}")),
                Approval::Hold => {
                    self.log(LogLevel::Info, &format!("held by the operator: {ahead}"))?;
                    self.hold(HOLD_S)?;
                }
                Approval::Abort(why) => {
                    self.log(LogLevel::Warn, &format!("aborted before a motion ({why}): {ahead}"))?;
                    return Err(self.interrupt()?);
                }
            }
        }
    }
}

impl std::fmt::Display for MotionAhead {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let moved = self.joints.iter().zip(self.from.iter().zip(self.to.iter()));
        let moved = moved.filter(|(_, (from, to))| (*to - *from).abs() > TOLD_RAD);
        let words: Vec<String> = moved
            .map(|(joint, (from, to))| format!("{joint} {:.1} to {:.1} deg", from.to_degrees(), to.to_degrees()))
            .collect();
        let what = if words.is_empty() { "nowhere".to_owned() } else { words.join(", ") };
        write!(f, "{what}; {:.1} s", self.duration_s)?;
        if self.edges > 1 {
            write!(f, " on {} edges", self.edges)?;
        }
        match self.clearance_m {
            Some(clearance_m) => write!(f, "; at least {clearance_m:.3} m clear"),
            None => Ok(()),
        }
    }
}
