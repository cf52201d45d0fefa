//! Touches of targets by the jaws, from the truth.

use nalgebra::Vector3;

use crate::score::TouchScore;
use armcal_belief::session::ReachStep;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::streams::{Mark, MarkKind, Message, ToolTouch};
use armcal_core::time::Stamp;
use armcal_sim::truth::Truth;

/// Time before a recorded touch of a surface in which contacts of tool and surface are intended, s; `AFTER_TOUCH_S` is
/// that after it.
const BEFORE_TOUCH_S: f64 = 100.0;
const AFTER_TOUCH_S: f64 = 40.0;

/// Removes the contacts and clearances that steps `touch` intend.
pub(super) fn leave_out_meant(truth: &mut Truth, recording: &Recording, robot: &Robot) {
    let tool = &robot.bodies[robot.tool.mount.n_joints].name;
    let touches: Vec<&ToolTouch> = recording
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::Touch(touch) => Some(touch),
            _ => None,
        })
        .collect();
    let is_meant = |at: Stamp, a: &String, b: &String| {
        touches.iter().any(|touch| {
            let is_near = (-BEFORE_TOUCH_S..=touch.duration_s + AFTER_TOUCH_S).contains(&at.since_s(touch.stamp));
            is_near && (a == tool && *b == touch.surface || b == tool && *a == touch.surface)
        })
    };
    truth.contacts.retain(|contact| !is_meant(contact.stamp, &contact.part_a, &contact.part_b));
    truth.clearances.retain(|clearance| !is_meant(clearance.stamp, &clearance.part_a, &clearance.part_b));
}

/// The touches of one `reach` step; `None` where none was asked for.
///
/// A target was touched if it lay between the jaws when they began to close. Across, in the direction in which they
/// close, it must be nearer to the tool point than half the measured gap. Along the jaws' faces it must be within the
/// task's tolerance.
pub(super) fn touches(
    recording: &Recording,
    truth: &Truth,
    robot: &Robot,
    step: &ReachStep,
    tolerance_m: f64,
) -> Option<TouchScore> {
    let gripper = robot.gripper.as_ref()?;
    let targets_m = recording.messages.iter().find_map(|(_, message)| match message {
        Message::Task(task) => Some(&task.targets_m),
        _ => None,
    })?;
    let gaps: Vec<_> = recording
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::Gripper(sample) => Some((sample.stamp, sample.opening_m)),
            _ => None,
        })
        .collect();
    let mut score = TouchScore { tried: 0, touched: 0 };
    for (_, message) in &recording.messages {
        let Message::Mark(Mark { start, kind: MarkKind::Touch { target_idx }, .. }) = message else { continue };
        if !(step.start..=step.end).contains(start) {
            continue;
        }
        score.tried += 1;
        let gap_m = gaps[..gaps.partition_point(|(stamp, _)| stamp <= start)].last().map(|(_, gap_m)| *gap_m);
        let target_m = targets_m.get(*target_idx as usize);
        let (Some(target_m), Some(state), Some(gap_m)) = (target_m, truth.state_at(*start), gap_m) else { continue };
        let tool = state.base_from_tool.isometry();
        let error_m = tool.inverse_transform_vector(&(Vector3::from(*target_m) - tool.translation.vector));
        score.touched += usize::from(is_between(&error_m, &gripper.opens_along, gap_m, tolerance_m));
    }
    (score.tried > 0).then_some(score)
}

/// True if the target is between the jaws. `error_m` is the target from the tool point, in the axes in which the jaws
/// open along `across`.
fn is_between(error_m: &Vector3<f64>, across: &Vector3<f64>, gap_m: f64, tolerance_m: f64) -> bool {
    let across_m = error_m.dot(across);
    let along_m = (error_m - across_m * across).norm();
    across_m.abs() < 0.5 * gap_m && along_m <= tolerance_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jaws_forgive_across_what_they_do_not_along() {
        let between = |x, y, z| is_between(&Vector3::new(x, y, z), &Vector3::x(), 0.1, 0.02);
        assert!(between(0.049, 0.0, 0.0) && between(-0.049, 0.0, 0.019) && between(0.0, 0.014, 0.014));
        assert!(!between(0.051, 0.0, 0.0) && !between(-0.051, 0.0, 0.0));
        assert!(!between(0.0, 0.021, 0.0) && !between(0.0, 0.015, 0.015));
    }
}
