//! Continues with an arm some of whose joints have failed: belief, bounds and plans without them, and the targets that
//! are still reachable.

use crate::file::calibration::Calibration;
use crate::file::failed_joint::FailedJointTable;
use crate::plan::constants::bounds_estimate_bounds::AT_REST_RAD;
use crate::plan::constants::bounds_estimate_bounds::SIGMAS;
use crate::plan::{JointErrorBounds, PlanError, TargetRequest, plan_targets};
use crate::session::SessionError;
use crate::session::held_joint::{HeldJoint, hold_in, holding_bounds};
use crate::session::outcome::{Epoch, StillReachable};
use crate::session::runner::ScriptRunner;
use crate::session::tool_belief::Certainty;
use armcal_core::robot::FailedKind;
use armcal_core::streams::JointAngles;

impl ScriptRunner<'_, '_> {
    /// Takes account of joints held since the last call. Returns true if there are any.
    pub(crate) fn take_up_failures(&mut self) -> bool {
        let n_known = self.n_held;
        if self.driver.held.len() == n_known {
            return false;
        }
        self.n_held = self.driver.held.len();
        for held in &mut self.driver.held[n_known..] {
            held.bound_rad += self.bounds.error_rad(held.joint, held.angle_rad);
            // Earlier views are of an arm whose joint still moved.
            (self.began, self.views_since) = (held.since, held.since);
        }
        self.hold_failed();
        self.note_belief(Certainty::Unknown);
        true
    }

    /// Fixes the held joints at their believed angles, for all plans.
    pub(crate) fn hold_failed(&mut self) {
        hold_in(&self.driver.held, &mut self.robot);
        let bounds = std::mem::replace(&mut self.bounds, JointErrorBounds::none(&self.robot));
        self.bounds = self.kept_clear(holding_bounds(&self.driver.held, bounds));
    }

    /// Notes the sensors believed from now on.
    pub(crate) fn note_belief(&mut self, certainty: Certainty) {
        let calibration = self.epochs.last().and_then(|epoch| epoch.calibration.clone());
        self.begin_epoch(calibration, certainty);
    }

    /// Notes the sensors believed from now on by a calibration. With held joints the certainty of the tool is unknown.
    pub(crate) fn begin_epoch(&mut self, calibration: Option<Calibration>, certainty: Certainty) {
        let certainty = if self.driver.held.is_empty() { certainty } else { Certainty::Unknown };
        let (from, sensors) = (self.driver.now(), self.driver.sensors.clone());
        self.epochs.push(Epoch { from, sensors, calibration, certainty });
    }

    /// Locates the held joints at the angles that the camera gives by `calibration`.
    pub(crate) fn locate_held(&mut self, calibration: &Calibration) {
        let names = self.robot.joint_names();
        for held in &mut self.driver.held {
            let table = calibration.failed_joint.iter().find(|table| table.joint == names[held.joint]);
            if let Some((angle_rad, std_rad)) = table.and_then(|t| t.angle_rad.zip(t.angle_std_rad)) {
                (held.angle_rad, held.bound_rad) = (angle_rad, SIGMAS * std_rad + AT_REST_RAD);
                held.is_located = true;
            }
        }
    }

    /// Holds the joints proximal to the tool whose sensors failed according to a calibration.
    pub(crate) fn hold_found(&mut self, calibration: &Calibration) -> Result<(), SessionError> {
        let names = self.robot.joint_names();
        let found = |table: &FailedJointTable| {
            let joint = names.iter().position(|name| *name == table.joint)?;
            let is_lost = table.kind != FailedKind::Jumps;
            let is_needed = joint < self.robot.tool.mount.n_joints;
            let is_new = self.driver.held.iter().all(|held| held.joint != joint);
            (is_lost && is_needed && is_new).then_some((joint, table.kind))
        };
        let found: Vec<(usize, FailedKind)> = calibration.failed_joint.iter().filter_map(found).collect();
        for &(joint, kind) in &found {
            // The arm was commanded to move it.
            let kind = if kind.stands_still() { FailedKind::Locked } else { kind };
            self.driver.hold_joint(joint, kind)?;
            if kind != FailedKind::Locked
                && let Some(held) = self.driver.held.last_mut()
            {
                // The time since which its sensor has failed is unknown.
                held.bound_rad = self.robot.sensors[joint].half_range_rad;
            }
        }
        self.take_up_failures();
        self.locate_held(calibration);
        self.hold_failed();
        Ok(())
    }

    /// Returns a joint proximal to the tool whose angle is unknown, if any: with it, no target can be reached.
    pub(crate) fn unlocated(&self) -> Option<&HeldJoint> {
        let n = self.robot.tool.mount.n_joints;
        self.driver.held.iter().find(|held| !held.is_located && held.joint < n)
    }

    /// Notes which of `targets` stay reachable with the held joints; `plans` are those without these joints.
    pub(crate) fn note_reachable(&mut self, targets: &[usize], plans: &[Result<JointAngles, PlanError>]) {
        if self.driver.held.is_empty() {
            return;
        }
        let lost: Vec<usize> = targets.iter().zip(plans).filter(|(_, plan)| plan.is_err()).map(|(t, _)| *t).collect();
        let targets_m: Vec<[f64; 3]> = lost.iter().map(|&t| self.setup.routine.task.targets_m[t]).collect();
        let request = TargetRequest { targets_m: &targets_m, preferred: None, margin_m: self.margin_m() };
        // The plans of a sound arm show the targets that no arm reaches.
        let none = JointErrorBounds::none(self.setup.robot);
        let sound = plan_targets(self.setup.robot, &self.clearance, &none, &request, &mut self.rng);
        let needs = lost.iter().zip(&sound).filter(|(_, plan)| plan.is_ok()).map(|(target, _)| *target).collect();
        let names = self.robot.joint_names();
        let joints: Vec<String> = self.driver.held.iter().map(|held| names[held.joint].clone()).collect();
        let (reachable, of) = (targets.len() - lost.len(), targets.len());
        self.still_reachable = Some(StillReachable { joints, reachable, of, needs, no_path: Vec::new() });
    }
}
