//! Marks: spans of a recording and their kinds.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::basic::Time;
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::schema::{RosMessage, RosSchema};
use crate::robot::{FailedJoint, FailedKind};
use crate::streams::{self, CaptureSet, MarkKind, Phase, PriorSource, ReachAttempt};

/// armcal_msgs/msg/Mark: purpose of the span `start..=end`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Start of the span by the joint sensors' clock.
    pub start: Time,
    /// End of the span, not before `start`.
    pub end: Time,
    /// Kind of the mark, such as `capture_fit`; an end stop's kind contains its angle, rad.
    pub kind: String,
    /// Number of a pose, joint or target, from 0; 0 for kinds without one.
    pub index: u32,
}

message!(
    Mark,
    "armcal_msgs/msg/Mark",
    "builtin_interfaces/Time start\nbuiltin_interfaces/Time end\nstring kind\nuint32 index\n",
    time!(),
);

/// Builds a kind from its index (of a pose, joint or target); 0 if it has none.
type KindOf = fn(u32) -> MarkKind;

/// Names of the kinds in a file.
const NAMES: [(&str, KindOf); 16] = [
    ("capture_fit", |pose_idx| MarkKind::Capture { set: CaptureSet::Fit, pose_idx }),
    ("capture_held_out", |pose_idx| MarkKind::Capture { set: CaptureSet::HeldOut, pose_idx }),
    ("identify", |joint_idx| MarkKind::Identify { joint_idx }),
    ("calibrate", |_| MarkKind::Calibrate(PriorSource::Fresh)),
    ("recalibrate", |_| MarkKind::Calibrate(PriorSource::Warm)),
    ("reach_before", |target_idx| MarkKind::Reach { attempt: ReachAttempt::Before, target_idx }),
    ("reach_after", |target_idx| MarkKind::Reach { attempt: ReachAttempt::After, target_idx }),
    ("touch", |target_idx| MarkKind::Touch { target_idx }),
    ("phase_plan", |_| MarkKind::Phase(Phase::Plan)),
    ("phase_move", |_| MarkKind::Phase(Phase::Move)),
    ("phase_settle", |_| MarkKind::Phase(Phase::Settle)),
    ("phase_capture", |_| MarkKind::Phase(Phase::Capture)),
    ("phase_calibrate", |_| MarkKind::Phase(Phase::Calibrate)),
    ("phase_reach", |_| MarkKind::Phase(Phase::Reach)),
    ("phase_wait", |_| MarkKind::Phase(Phase::Wait)),
    ("phase_done", |_| MarkKind::Phase(Phase::Done)),
];
/// Prefix of the name of a [`FailedKind`].
const FAILED: &str = "failed_";
/// Prefix of the angle of an end stop, rad: the only kind with a number that is no index.
const STOP: &str = "stop ";

pub(in crate::log) fn to_ros(m: &streams::Mark) -> Result<Mark, EncodeError> {
    let index = index(m.kind);
    let kind = name(m.kind, index).into_owned();
    Ok(Mark { start: m.start.try_into()?, end: m.end.try_into()?, kind, index })
}

fn index(kind: MarkKind) -> u32 {
    match kind {
        MarkKind::Capture { pose_idx: index, .. }
        | MarkKind::Identify { joint_idx: index }
        | MarkKind::Stop { joint_idx: index, .. }
        | MarkKind::Reach { target_idx: index, .. }
        | MarkKind::Touch { target_idx: index } => index,
        MarkKind::Failed(failed) => failed.joint as u32,
        MarkKind::Calibrate(_) | MarkKind::Phase(_) => 0,
    }
}

fn name(kind: MarkKind, index: u32) -> Cow<'static, str> {
    match kind {
        MarkKind::Stop { angle_rad, .. } => format!("{STOP}{angle_rad}").into(),
        MarkKind::Failed(failed) => format!("{FAILED}{}", failed.kind.name()).into(),
        _ => NAMES.iter().find(|(_, of)| of(index) == kind).expect("every other kind is in the table").0.into(),
    }
}

pub(in crate::log) fn from_ros(m: &Mark) -> Result<streams::Mark, DecodeRejection> {
    let kind = kind(&m.kind, m.index).ok_or(DecodeRejection::MarkKind)?;
    let mark = streams::Mark { start: m.start.try_into()?, end: m.end.try_into()?, kind };
    if mark.end < mark.start { Err(DecodeRejection::MarkSpan) } else { Ok(mark) }
}

fn kind(name: &str, index: u32) -> Option<MarkKind> {
    if let Some(kind) = name.strip_prefix(FAILED) {
        let kind = FailedKind::of_name(kind)?;
        return Some(MarkKind::Failed(FailedJoint { joint: index as usize, kind }));
    }
    if let Some(angle) = name.strip_prefix(STOP) {
        let angle_rad = angle.parse().ok().filter(|angle: &f64| angle.is_finite())?;
        return Some(MarkKind::Stop { joint_idx: index, angle_rad });
    }
    NAMES.iter().find(|(known, _)| *known == name).map(|(_, of)| of(index))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::Stamp;

    #[test]
    fn each_kind_of_mark_round_trips() {
        let failed = FailedKind::ALL.map(|kind| MarkKind::Failed(FailedJoint { joint: 5, kind }));
        let stop = MarkKind::Stop { joint_idx: 5, angle_rad: -2.064_400_000_000_1 };
        let kinds = NAMES.into_iter().map(|(_, of)| of(5)).chain(failed).chain([stop]);
        for kind in kinds {
            let mark = streams::Mark { start: Stamp { nanos: 1 }, end: Stamp { nanos: 2 }, kind };
            assert_eq!(from_ros(&to_ros(&mark).unwrap()), Ok(mark));
        }
    }

    #[test]
    fn unknown_kinds_and_spans_backwards_are_rejected() {
        for kind in ["nap", "stop", "stop ", "stop inf", "stop 1.0 rad", "failed_", "failed_nap"] {
            let mark = Mark { kind: kind.into(), ..Default::default() };
            assert_eq!(from_ros(&mark), Err(DecodeRejection::MarkKind));
        }
        let mut mark = Mark { kind: "stop -3.6296".into(), index: 4, ..Default::default() };
        assert_eq!(from_ros(&mark).map(|m| m.kind), Ok(MarkKind::Stop { joint_idx: 4, angle_rad: -3.6296 }));
        mark.start.sec = 1;
        assert_eq!(from_ros(&mark), Err(DecodeRejection::MarkSpan));
    }
}
