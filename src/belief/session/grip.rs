//! Opens and closes the gripper, and keeps clearance for open jaws.

use crate::session::constants::grip::{ARRIVED_M, AS_AT_REST_M, PATIENCE_S};
use std::rc::Rc;

use crate::plan::{ClearanceModel, grips_at_first};
use crate::session::SessionError;
use crate::session::runner::ScriptRunner;
use armcal_core::streams::{GripperCommand, LogLevel, Mark, MarkKind, Message};

impl ScriptRunner<'_, '_> {
    /// Drives the jaws to `opening`, 0 (closed) to 1 (open), and waits until they arrive. From then on the arm keeps
    /// their width clear, until they are no wider than at rest.
    pub(crate) fn grip(&mut self, step: usize, opening: f64) -> Result<(), SessionError> {
        let wrong = |problem: String| SessionError::Step { step, problem };
        let gripper = self.robot.gripper.clone().ok_or_else(|| wrong("the arm has no gripper".to_owned()))?;
        let opening_m = opening * gripper.opening_max_m;
        let is_wide = opening_m > gripper.rest_opening_m + AS_AT_REST_M;
        let crowded = |run: &Self| run.jaws.open.find_violation(&run.driver.set_point(), &run.bounds, 0.0);
        let open = Rc::clone(&self.jaws.open);
        if is_wide && (crowded(self).is_some() || !self.can_leave(&open)) {
            // In a folded configuration the arm may block its own jaws; the stowed pose has had room on every vehicle
            // so far.
            let stowed = self.robot.stowed;
            self.go(&stowed)?;
            self.driver.settle()?;
        }
        if is_wide && let Some(nearest) = crowded(self) {
            return Err(wrong(format!("there is no room to open the jaws: {nearest} would come too close")));
        }
        // Opening jaws need their clearance at once, closing jaws until they are closed.
        if is_wide {
            self.clearance = Rc::clone(&self.jaws.open);
        }
        if !self.driver.grip(opening, opening_m, 2.0 * gripper.closing_time_s + PATIENCE_S)? {
            self.driver.log(LogLevel::Warn, &format!("the jaws did not come to {opening_m:.3} m"))?;
        } else if !is_wide {
            self.clearance = Rc::clone(&self.jaws.at_rest);
        }
        Ok(())
    }

    /// Closes the jaws on target number `target` from wide open, and opens them again.
    pub(crate) fn touch(&mut self, step: usize, target: usize) -> Result<(), SessionError> {
        let start = self.driver.now();
        self.grip(step, 0.0)?;
        let kind = MarkKind::Touch { target_idx: target as u32 };
        self.driver.record(&Message::Mark(Mark { start, end: self.driver.now(), kind }))?;
        self.grip(step, 1.0)
    }

    /// Moves the jaws to their rest opening.
    pub(crate) fn rest_jaws(&mut self, step: usize) -> Result<(), SessionError> {
        let rest = self.robot.gripper.as_ref().map(|gripper| gripper.rest_opening_m / gripper.opening_max_m);
        rest.map_or(Ok(()), |opening| self.grip(step, opening))
    }
}

impl<'a> ScriptRunner<'a, '_> {
    /// Returns the clearance model for the targets planned before any motion. It has open jaws if one of them is
    /// touched before a calibration; after that they are planned again.
    pub(crate) fn clearance_at_targets(&self) -> Rc<ClearanceModel<'a>> {
        if grips_at_first(&self.setup.routine.steps) { Rc::clone(&self.jaws.open) } else { Rc::clone(&self.clearance) }
    }
}

impl crate::session::motion::Driver<'_> {
    /// Commands the jaws and waits until they arrive; returns false if they do not within `limit_s`.
    fn grip(&mut self, opening: f64, opening_m: f64, limit_s: f64) -> Result<bool, SessionError> {
        self.arm.grip(opening)?;
        let stamp = self.now();
        self.record(&Message::GripperCommand(GripperCommand { stamp, opening_m }))?;
        let until = stamp.plus_s(limit_s);
        while self.now() < until {
            self.step()?;
            if self.recorder.opening_m.is_some_and(|measured_m| (measured_m - opening_m).abs() <= ARRIVED_M) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
