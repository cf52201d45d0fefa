//! Index of a recording's messages by their own stamps.

use armcal_core::streams::{Mark, Message};
use armcal_core::time::Stamp;

/// Messages of a recording, sorted by their own stamps.
pub(crate) struct MessageIndex<'a> {
    pub(crate) messages: &'a [(Stamp, Message)],
    pub(crate) by_stamp: Vec<(Stamp, usize)>,
}

impl<'a> MessageIndex<'a> {
    /// Returns the messages that were recorded by `until`. A calibration at that time could not know later ones, such
    /// as a delayed image.
    pub(crate) fn heard_until(messages: &'a [(Stamp, Message)], until: Stamp) -> Self {
        let mut by_stamp: Vec<(Stamp, usize)> = messages
            .iter()
            .enumerate()
            .filter(|(_, (log_time, _))| *log_time <= until)
            .filter_map(|(idx, (_, message))| {
                let stamp = match message {
                    Message::JointSensors(sample) => sample.stamp,
                    Message::Detections(detections) => detections.stamp,
                    Message::Rejects(rejects) => rejects.stamp,
                    Message::Temperature(sample) => sample.stamp,
                    Message::Pressure(sample) => sample.stamp,
                    _ => return None,
                };
                Some((stamp, idx))
            })
            .collect();
        by_stamp.sort_unstable();
        Self { messages, by_stamp }
    }

    pub(crate) fn span(&self, mark: &Mark) -> &[(Stamp, usize)] {
        let from = self.by_stamp.partition_point(|(stamp, _)| *stamp < mark.start);
        let to = self.by_stamp.partition_point(|(stamp, _)| *stamp <= mark.end);
        &self.by_stamp[from..to.max(from)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::streams::{CaptureSet, MarkKind, TagDetections};

    #[test]
    fn what_came_after_the_calibration_is_not_part_of_it() {
        let at = |nanos: i64| Stamp { nanos };
        let image = |stamp: i64| Message::Detections(TagDetections { stamp: at(stamp), tags: Vec::new() });
        let messages = [(at(12), image(10)), (at(20), image(11)), (at(21), image(12))];
        let mark = Mark { start: at(9), end: at(15), kind: MarkKind::Capture { set: CaptureSet::Fit, pose_idx: 0 } };
        let heard = |until: i64| MessageIndex::heard_until(&messages, at(until)).span(&mark).len();
        assert_eq!([heard(15), heard(20), heard(i64::MAX)], [1, 2, 3]);
    }
}
