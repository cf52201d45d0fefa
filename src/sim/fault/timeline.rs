//! Timed faults in the order of their times.

use crate::fault::kinds::ScheduledFault;

/// Tolerance of times, s: whole periods are not exact in binary.
const SAME_TIME_S: f64 = 1e-9;

/// Timed faults in the order of their times.
#[derive(Clone, Debug)]
pub(crate) struct Timeline {
    /// Time and index in the spec's list, the next one last.
    ahead: Vec<(f64, usize)>,
    /// Time of the last fault, at a step or by the timeline.
    pub(crate) last_s: Option<f64>,
}

impl Timeline {
    pub(crate) fn new(faults: &[ScheduledFault]) -> Self {
        let timed = faults.iter().enumerate().filter_map(|(index, scheduled)| Some((scheduled.at_s?, index)));
        let mut ahead: Vec<(f64, usize)> = timed.collect();
        // The sort is stable: faults with the same time happen in the order of the list.
        ahead.sort_by(|a, b| a.0.total_cmp(&b.0));
        ahead.reverse();
        Self { ahead, last_s: None }
    }

    pub(crate) fn take_due(&mut self, time_s: f64) -> Option<usize> {
        let (_, index) = self.ahead.pop_if(|(at_s, _)| *at_s <= time_s + SAME_TIME_S)?;
        Some(index)
    }

    /// Returns true if no fault happened in the last `before_s` and none will in the next `after_s`.
    pub(crate) fn is_calm(&self, time_s: f64, before_s: f64, after_s: f64) -> bool {
        self.last_s.is_none_or(|last_s| time_s - last_s >= before_s)
            && self.ahead.last().is_none_or(|(at_s, _)| *at_s > time_s + after_s)
    }
}
