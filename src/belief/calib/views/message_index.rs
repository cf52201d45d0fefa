//! The messages of a recording by their own stamps.

use armcal_core::streams::{Mark, Message};
use armcal_core::time::Stamp;

/// Messages of a recording sorted by their own stamps.
pub(crate) struct MessageIndex<'a> {
    pub(crate) messages: &'a [(Stamp, Message)],
    pub(crate) by_stamp: Vec<(Stamp, usize)>,
}

impl<'a> MessageIndex<'a> {
    pub(crate) fn new(messages: &'a [(Stamp, Message)]) -> Self {
        let mut by_stamp: Vec<(Stamp, usize)> = messages
            .iter()
            .enumerate()
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
