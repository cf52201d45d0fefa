//! What of a recording its marked views are made of. The rest stays in the file: memory grows with the views of a
//! recording, not with its hours.

use std::path::Path;

use crate::calib::views::conditions::{BACK_S, NEAR_S};
use armcal_core::log::{LogError, Recording, Stream, TopicMap, scan_recording};
use armcal_core::streams::{Mark, MarkKind, Message};
use armcal_core::time::Stamp;

/// Reads what a calibration uses of a recording, in two passes: its marks, then what lies about them.
///
/// # Errors
/// As [`armcal_core::log::read_recording`].
pub fn read_marked(path: &Path) -> Result<Recording, LogError> {
    let marks = TopicMap { only: Some([Stream::Marks, Stream::Touch].into()), ..TopicMap::default() };
    let (marked, _) = scan_recording(path, &marks, |_| {}, |_, _| true)?;
    let spans = MarkedSpans::of(&marked);
    let (recording, _) = scan_recording(path, &TopicMap::default(), |_| {}, |_, message| spans.hold(message))?;
    Ok(recording)
}

/// The spans in which the arm was at rest for something, by the joint sensors' clock.
#[derive(Clone, Debug)]
pub struct MarkedSpans {
    rests: Spans,
    /// With the motion before.
    approaches: Spans,
    /// With the readings of slow sensors nearest to them.
    conditions: Spans,
}

impl MarkedSpans {
    /// Those of the marks and touches of a recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let rests: Vec<(Stamp, Stamp)> = recording.messages.iter().filter_map(|(_, message)| rest(message)).collect();
        let widened = |before_s: f64, after_s: f64| {
            Spans::joined(rests.iter().map(|(start, end)| (start.plus_s(-before_s), end.plus_s(after_s))))
        };
        Self { rests: widened(0.0, 0.0), approaches: widened(BACK_S, 0.0), conditions: widened(NEAR_S, NEAR_S) }
    }

    /// Whether a calibration may use the message.
    #[must_use]
    pub fn hold(&self, message: &Message) -> bool {
        match message {
            Message::JointSensors(sample) => self.approaches.hold(sample.stamp),
            Message::Detections(detections) => self.rests.hold(detections.stamp),
            Message::Rejects(rejects) => self.rests.hold(rejects.stamp),
            Message::Temperature(sample) => self.conditions.hold(sample.stamp),
            Message::Pressure(sample) => self.conditions.hold(sample.stamp),
            Message::Task(_) | Message::Survey(_) | Message::Touch(_) | Message::Mark(_) => true,
            Message::JointCommand(_)
            | Message::JointStates(_)
            | Message::Image(_)
            | Message::Attitude(_)
            | Message::Gripper(_)
            | Message::GripperCommand(_)
            | Message::Log(_) => false,
        }
    }
}

/// The span of a mark or touch whose readings count.
fn rest(message: &Message) -> Option<(Stamp, Stamp)> {
    match message {
        Message::Touch(touch) => Some((touch.stamp, touch.stamp.plus_s(touch.duration_s))),
        Message::Mark(Mark { start, end, kind }) => match kind {
            MarkKind::Capture { .. } | MarkKind::Identify { .. } | MarkKind::Stop { .. } | MarkKind::Reach { .. } => {
                Some((*start, *end))
            }
            MarkKind::Failed(_) | MarkKind::Calibrate(_) | MarkKind::Touch { .. } | MarkKind::Phase(_) => None,
        },
        _ => None,
    }
}

/// Spans of time without overlap, in order.
#[derive(Clone, Debug)]
struct Spans(Vec<(Stamp, Stamp)>);

impl Spans {
    fn joined(spans: impl Iterator<Item = (Stamp, Stamp)>) -> Self {
        let mut all: Vec<(Stamp, Stamp)> = spans.collect();
        all.sort_unstable();
        let mut joined: Vec<(Stamp, Stamp)> = Vec::new();
        for (start, end) in all {
            match joined.last_mut() {
                Some(last) if start <= last.1 => last.1 = last.1.max(end),
                _ => joined.push((start, end)),
            }
        }
        Self(joined)
    }

    fn hold(&self, stamp: Stamp) -> bool {
        let after = self.0.partition_point(|(start, _)| *start <= stamp);
        after.checked_sub(1).is_some_and(|n| stamp <= self.0[n].1)
    }
}
