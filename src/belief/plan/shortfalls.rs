//! What a plan lacks for the calibration that it is made for.

use crate::checks::refusal_conditions::fewest_views;
use crate::plan::view_planning::PlannedPose;
use armcal_core::codes::{Code, Warning};
use armcal_core::robot::{FailedKind, Robot};
use armcal_core::routine::{Routine, Step};
use armcal_core::streams::CaptureSet;

/// Origin of the sensors that a plan begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KnownBefore {
    Datasheet,
    Calibration,
}

/// Returns warnings about poses that do not suffice for the task or for a calibration. There are none where other
/// captures add views to the same calibration.
pub(crate) fn shortfalls<'a>(
    poses: impl Iterator<Item = &'a PlannedPose>,
    routine: &Routine,
    robot: &Robot,
    known: KnownBefore,
) -> Vec<Warning> {
    if captures_before_calibration(routine) > 1 {
        return Vec::new();
    }
    let (mut n_fit, mut predicted_m) = (0, f64::INFINITY);
    for pose in poses {
        n_fit += usize::from(pose.set == CaptureSet::Fit);
        predicted_m = pose.predicted_tool_error_m;
    }
    let needed = fewest_views(robot).saturating_sub(n_without_sensor(robot));
    let mut found = Vec::new();
    if n_fit < needed && known == KnownBefore::Datasheet {
        let text = format!(
            "{n_fit} poses are planned for the fit, and a calibration from the datasheet needs {needed}: raise \
             capture.poses, or place tags where the camera reaches them"
        );
        found.push(Warning::new(Code::TooFewViews, text));
    }
    let tolerance_m = routine.task.tolerance_m;
    if predicted_m.is_finite() && predicted_m > tolerance_m {
        let text = format!(
            "the tool error predicted after the last pose, {:.2} mm, exceeds task.tolerance_m, {:.2} mm: raise \
             capture.poses, or place tags where the camera reaches them",
            1e3 * predicted_m,
            1e3 * tolerance_m
        );
        found.push(Warning::new(Code::BeyondTolerance, text));
    }
    found
}

fn captures_before_calibration(routine: &Routine) -> usize {
    let before = routine.steps.iter().take_while(|step| !matches!(step, Step::Calibrate(_)));
    before.filter(|step| matches!(step, Step::Capture(_))).count()
}

/// Returns the number of gains and offsets that no calibration estimates, because their joints failed.
fn n_without_sensor(robot: &Robot) -> usize {
    let is_lost = |kind: FailedKind| kind != FailedKind::Jumps;
    let lost = robot.failed.iter().filter(|failed| is_lost(failed.kind) && failed.joint < robot.n_seen_joints());
    2 * lost.count()
}
