//! BELIEF: what the reach task showed, as far as the arm itself can tell.
//!
//! From the recording's reach marks: the readings at rest, and where the arm believed its tool to be under the sensors
//! it used then. Whether that was true is for `score`, which alone may ask the truth.

use nalgebra::Vector3;

use crate::log::Recording;
use crate::robot::Robot;
use crate::sensor::ArmSensors;
use crate::streams::{JointAngles, MarkKind, Message, ReachAttempt};
use crate::time::Stamp;

/// The arm at rest for one target.
#[derive(Clone, Debug)]
pub struct ReachRest {
    pub attempt: ReachAttempt,
    pub target_idx: usize,
    pub target_m: [f64; 3],
    pub start: Stamp,
    pub end: Stamp,
    /// Joint angles as believed under the sensors of that moment.
    pub believed: JointAngles,
    /// The tool as believed, base frame, m.
    pub believed_tool_m: Vector3<f64>,
}

/// The sensors that the arm believed in, each from its stamp on; in the order of time, and not empty.
pub type Beliefs<'a> = [(Stamp, &'a ArmSensors)];

/// Those believed in at `stamp`: the first of all before the first stamp.
fn believed_at<'a>(beliefs: &Beliefs<'a>, stamp: Stamp) -> Option<&'a ArmSensors> {
    let later = beliefs.partition_point(|(from, _)| *from <= stamp);
    beliefs.get(later.saturating_sub(1)).map(|(_, sensors)| *sensors)
}

/// Every reach of a recording, in the order of its marks. Marks without readings or without a target are left out.
#[must_use]
pub fn reaches(recording: &Recording, robot: &Robot, beliefs: &Beliefs<'_>) -> Vec<ReachRest> {
    let task = recording.messages.iter().find_map(|(_, message)| match message {
        Message::Task(task) => Some(task),
        _ => None,
    });
    let Some(task) = task else { return Vec::new() };
    let readings: Vec<_> = recording
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::JointSensors(sample) => Some(sample),
            _ => None,
        })
        .collect();
    let marks = recording.messages.iter().filter_map(|(_, message)| match message {
        Message::Mark(mark) => Some(mark),
        _ => None,
    });
    marks
        .filter_map(|mark| {
            let MarkKind::Reach { attempt, target_idx } = mark.kind else { return None };
            let target_m = *task.targets_m.get(target_idx as usize)?;
            let sensors = believed_at(beliefs, mark.start)?;
            let from = readings.partition_point(|sample| sample.stamp < mark.start);
            let to = readings.partition_point(|sample| sample.stamp <= mark.end);
            let span = readings.get(from..to).filter(|span| !span.is_empty())?;
            // Angles, not raw words, are averaged: the words wrap.
            let mut believed = JointAngles::zeros(robot.n_joints());
            for sample in span {
                for (sum, angle) in believed.iter_mut().zip(sensors.angles(&sample.counts).iter()) {
                    *sum += angle / span.len() as f64;
                }
            }
            let tool = robot.chain.link_poses(&believed).frame(&robot.tool.mount).translation.vector;
            Some(ReachRest {
                attempt,
                target_idx: target_idx as usize,
                target_m,
                start: mark.start,
                end: mark.end,
                believed,
                believed_tool_m: tool,
            })
        })
        .collect()
}
