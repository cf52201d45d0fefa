//! The parts of a recording that its marked views are made of. The rest stays in the file, so that memory grows with
//! the views of a recording, not with its hours.

use std::collections::BTreeSet;
use std::path::Path;

use crate::views::conditions::{BACK_S, NEAR_S};
use armcal_core::log::{Choice, LogError, Recording, TopicMap, read_chosen};
use armcal_core::streams::{Mark, MarkKind, Message};
use armcal_core::time::Stamp;

/// Reads the parts of a recording that a calibration uses: scans all of it and keeps the messages near its marks.
///
/// # Errors
/// The errors of [`armcal_core::log::read_recording`].
pub fn read_marked(path: &Path) -> Result<Recording, LogError> {
    read_chosen(path, &TopicMap::default(), &mut Marked::default())
}

/// Choice of the messages of a recording near its marks.
#[derive(Default)]
struct Marked {
    rests: Vec<(Stamp, Stamp)>,
    /// Parts of the file, each with the earliest and latest stamp of its messages that may be used. `None` if a message
    /// is used in any case.
    parts: Vec<(u64, Option<(Stamp, Stamp)>)>,
    spans: MarkedSpans,
}

impl Choice for Marked {
    fn note(&mut self, part: u64, message: &Message) {
        let Some(of_message) = use_of(message) else { return };
        self.rests.extend(rest(message));
        let stamps = match of_message {
            Use::Always => None,
            Use::Approach(stamp) | Use::Rest(stamp) | Use::Condition(stamp) => Some((stamp, stamp)),
        };
        match self.parts.last_mut() {
            Some((last, of_part)) if *last == part => {
                *of_part = of_part.zip(stamps).map(|((first, last), (stamp, _))| (first.min(stamp), last.max(stamp)));
            }
            _ => self.parts.push((part, stamps)),
        }
    }

    fn parts(&mut self) -> BTreeSet<u64> {
        self.spans = MarkedSpans::of_rests(&self.rests);
        let is_used = |stamps: &Option<(Stamp, Stamp)>| stamps.is_none_or(|stamps| self.spans.meet(stamps));
        self.parts.iter().filter(|(_, stamps)| is_used(stamps)).map(|(part, _)| *part).collect()
    }

    fn keeps(&self, message: &Message) -> bool {
        self.spans.hold(message)
    }
}

/// Spans in which the arm was at rest for a measurement, by the joint sensors' clock.
#[derive(Clone, Debug, Default)]
pub struct MarkedSpans {
    rests: Spans,
    /// Spans with the motion before each rest.
    approaches: Spans,
    /// Spans with the nearest readings of slow sensors.
    conditions: Spans,
}

impl MarkedSpans {
    /// Returns the spans of the marks and touches of a recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let rests: Vec<(Stamp, Stamp)> = recording.messages.iter().filter_map(|(_, message)| rest(message)).collect();
        Self::of_rests(&rests)
    }

    fn of_rests(rests: &[(Stamp, Stamp)]) -> Self {
        let widened = |before_s: f64, after_s: f64| {
            Spans::joined(rests.iter().map(|(start, end)| (start.plus_s(-before_s), end.plus_s(after_s))))
        };
        Self { rests: widened(0.0, 0.0), approaches: widened(BACK_S, 0.0), conditions: widened(NEAR_S, NEAR_S) }
    }

    /// Returns true if a calibration may use the message.
    #[must_use]
    pub fn hold(&self, message: &Message) -> bool {
        match use_of(message) {
            Some(Use::Approach(stamp)) => self.approaches.meet(stamp, stamp),
            Some(Use::Rest(stamp)) => self.rests.meet(stamp, stamp),
            Some(Use::Condition(stamp)) => self.conditions.meet(stamp, stamp),
            Some(Use::Always) => true,
            None => false,
        }
    }

    /// Returns true if any span overlaps the time between these stamps.
    fn meet(&self, (first, last): (Stamp, Stamp)) -> bool {
        [&self.rests, &self.approaches, &self.conditions].iter().any(|spans| spans.meet(first, last))
    }
}

/// Use of a message in a calibration.
enum Use {
    Always,
    /// Motion of the arm to a rest and in it.
    Approach(Stamp),
    Rest(Stamp),
    Condition(Stamp),
}

fn use_of(message: &Message) -> Option<Use> {
    match message {
        Message::JointSensors(sample) => Some(Use::Approach(sample.stamp)),
        Message::Detections(detections) => Some(Use::Rest(detections.stamp)),
        Message::Rejects(rejects) => Some(Use::Rest(rejects.stamp)),
        Message::Temperature(sample) => Some(Use::Condition(sample.stamp)),
        Message::Pressure(sample) => Some(Use::Condition(sample.stamp)),
        Message::Task(_) | Message::Survey(_) | Message::Touch(_) | Message::Mark(_) => Some(Use::Always),
        Message::JointCommand(_)
        | Message::JointStates(_)
        | Message::Image(_)
        | Message::Attitude(_)
        | Message::Gripper(_)
        | Message::GripperCommand(_)
        | Message::Log(_) => None,
    }
}

/// Returns the span of a mark or touch whose readings count.
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
#[derive(Clone, Debug, Default)]
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

    /// Returns true if a span overlaps the time from `first` to `last`.
    fn meet(&self, first: Stamp, last: Stamp) -> bool {
        let after = self.0.partition_point(|(start, _)| *start <= last);
        after.checked_sub(1).is_some_and(|n| first <= self.0[n].1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::log::{Stream, scan_recording};

    /// Reads the same messages in two passes over the whole file, the marks first.
    fn read_all_twice(path: &Path) -> Recording {
        let marks = TopicMap { only: Some([Stream::Marks, Stream::Touch].into()), ..TopicMap::default() };
        let (marked, _) = scan_recording(path, &marks, |_| {}, |_, _| true).unwrap();
        let spans = MarkedSpans::of(&marked);
        scan_recording(path, &TopicMap::default(), |_| {}, |_, message| spans.hold(message)).unwrap().0
    }

    #[test]
    fn what_lies_about_the_marks_is_found_whole_cut_and_damaged() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("given.mcap");
        for name in ["recordings/sample/run.mcap", "fuzz/corpus/recording/views.mcap"] {
            let whole = std::fs::read(root.join(name)).unwrap();
            for (share, flip) in [(1.0, None), (0.7, None), (1.0, Some(0.3)), (0.9, Some(0.6))] {
                let at = |share: f64| (share * whole.len() as f64) as usize;
                let mut bytes = whole[..at(share)].to_vec();
                if let Some(share) = flip {
                    bytes[at(share)] ^= 0x55;
                }
                std::fs::write(&path, bytes).unwrap();
                let (expected, found) = (read_all_twice(&path), read_marked(&path).unwrap());
                assert!(!expected.messages.is_empty() && expected.left_in_file.len() > 2);
                assert!(found == expected, "{name}, {share}, {flip:?}");
            }
        }
    }
}
