//! Order of the stamps of a topic, compared with the order of the file.

use crate::time::Stamp;

/// Largest step back of one sender's stamps, s; assumed. Threads of the sender may overtake each other by this. A
/// larger step means that a clock was set or that files were merged.
const JITTER_S: f64 = 0.1;

/// Position at which the stamps of a topic go backwards by more than its senders' jitter.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "time stamps go backwards at message {message}: {:.3} s before the latest one before it ({} ns against {} ns)",
    latest.since_s(*stamp), stamp.nanos, latest.nanos
)]
pub struct StampRegression {
    /// Number of the message within its topic, from 1, in the order of the file.
    pub message: u64,
    /// The stamp that is too early.
    pub stamp: Stamp,
    /// The latest stamp before it.
    pub latest: Stamp,
}

/// Checks the stamps of one topic in turn.
#[derive(Clone, Copy, Debug, Default)]
pub struct StampOrder {
    messages: u64,
    latest: Option<Stamp>,
    first: Option<StampRegression>,
}

impl StampOrder {
    /// Adds the next message of the topic.
    pub fn add(&mut self, stamp: Stamp) {
        self.add_of(self.messages + 1, stamp);
    }

    /// Adds a stamp of the topic's message of that number, from 1. A message may have several stamps.
    pub fn add_of(&mut self, message: u64, stamp: Stamp) {
        self.messages = message;
        let latest = self.latest.unwrap_or(stamp);
        if self.first.is_none() && latest.since_s(stamp) > JITTER_S {
            self.first = Some(StampRegression { message: self.messages, stamp, latest });
        }
        self.latest = Some(latest.max(stamp));
    }

    /// Returns the first position at which the stamps go backwards by more than the jitter.
    #[must_use]
    pub fn first_regression(&self) -> Option<StampRegression> {
        self.first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(stamps_s: &[f64]) -> Option<(u64, f64)> {
        let mut order = StampOrder::default();
        let start = Stamp { nanos: 0 };
        stamps_s.iter().for_each(|s| order.add(start.plus_s(*s)));
        order.first_regression().map(|r| (r.message, r.latest.since_s(r.stamp)))
    }

    #[test]
    fn steps_back_beyond_jitter_are_found_single_or_in_small_steps() {
        assert_eq!(first(&[0.0, 1.0, 1.0, 0.95, 2.0]), None);
        assert_eq!(first(&[0.0, 5.0, 3.0, 1.0]), Some((3, 2.0)));
        let (message, back_s) = first(&[0.0, 1.0, 0.96, 0.92, 0.88, 0.84]).expect("a slow clock backwards");
        assert!(message == 5 && (back_s - 0.12).abs() < 1e-9);
        assert_eq!(first(&[]), None);
    }
}
