//! Time stamps of external messages.

use super::map::StampSource;
use crate::log::ros::Time;
use crate::time::Stamp;

/// Stamps of one topic: the time of a message that is used, and the number of messages without a stamp.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TopicClock {
    source: StampSource,
    /// Offset added to every header's stamp, s.
    offset_s: f64,
    /// Messages without a valid stamp, whose log time was used.
    pub unstamped: u64,
    pub stamped: u64,
}

impl TopicClock {
    pub fn new(source: StampSource) -> Self {
        Self { source, ..Self::default() }
    }

    /// Returns this clock with `offset_s` added to its header stamps.
    pub fn with_offset(self, offset_s: f64) -> Self {
        Self { offset_s, ..self }
    }

    /// Returns the time that is used: the header's stamp, or the log time if that is zero or invalid, or requested.
    pub fn read(&mut self, stamp: Time, log_time: Stamp) -> Stamp {
        if self.source == StampSource::LogTime {
            return log_time;
        }
        match Stamp::try_from(stamp).ok().filter(|stamp| stamp.nanos != 0) {
            Some(stamp) => {
                self.stamped += 1;
                if self.offset_s == 0.0 { stamp } else { stamp.plus_s(self.offset_s) }
            }
            None => {
                self.unstamped += 1;
                log_time
            }
        }
    }

    /// Returns a sentence about messages without a stamp on `topic`; `None` if all had one.
    pub fn note(&self, topic: &str) -> Option<String> {
        let (n, of) = (self.unstamped, self.unstamped + self.stamped);
        (n > 0)
            .then(|| format!("{n} of {of} stamps on {topic} are zero or invalid; the messages' log times replace them"))
    }
}
