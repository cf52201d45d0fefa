//! Rates over settings of unequal frequency: the sum of each setting's rate times its weight.

use std::collections::BTreeMap;

use armcal_core::stats::RateSequence;

/// Weight of each setting, by its number; the sum is 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights(BTreeMap<u32, f64>);

/// A rate over all settings, with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixedRate {
    /// Estimated rate; `None` while a setting has no run.
    pub rate: Option<f64>,
    pub low: f64,
    pub high: f64,
}

impl Weights {
    pub(super) fn new(by_setting: BTreeMap<u32, f64>) -> Self {
        Self(by_setting)
    }

    /// Union of both, because shards know of different settings.
    pub(super) fn joined(mut self, other: Self) -> Self {
        self.0.extend(other.0);
        self
    }

    /// Weight of the setting; 0 for an unknown one.
    #[must_use]
    pub fn of(&self, setting: u32) -> f64 {
        self.0.get(&setting).copied().unwrap_or(0.0)
    }

    /// Rate over all settings from the counts under each. The interval is valid however often it is evaluated, as each
    /// setting's own. It holds for all settings together: they share the allowed probability of error.
    #[must_use]
    pub fn mixed(&self, counted: impl Fn(u32) -> RateSequence, level: f64) -> MixedRate {
        let each = 1.0 - (1.0 - level) / self.0.len().max(1) as f64;
        let mut mixed = MixedRate { rate: Some(0.0), low: 0.0, high: 0.0 };
        for (setting, weight) in &self.0 {
            let sequence = counted(*setting);
            let [events, runs] = sequence.counts();
            let [low, high] = sequence.interval(each);
            mixed.rate = mixed.rate.filter(|_| runs > 0).map(|rate| rate + weight * events as f64 / runs as f64);
            mixed.low += weight * low;
            mixed.high += weight * high;
        }
        mixed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weights() -> Weights {
        Weights::new([(0, 0.99), (1, 0.01)].into())
    }

    #[test]
    fn a_rare_setting_counts_by_its_weight() {
        let mixed = weights().mixed(|setting| RateSequence::of_counts(u64::from(setting) * 50, 100), 0.95);
        assert!((mixed.rate.expect("runs of both") - 0.005).abs() < 1e-15, "half of one in a hundred");
        assert!(mixed.low < 0.005 && mixed.high > 0.005 && mixed.high < 0.1, "{mixed:?}");
        let unmet = weights().mixed(|setting| RateSequence::of_counts(0, u64::from(1 - setting) * 100), 0.95);
        assert!(unmet.rate.is_none() && unmet.high > 0.01, "what was not tried may always happen: {unmet:?}");
    }

    /// With equally many runs, none with the event, shares by the square root of the weight give the smallest
    /// uncertainty.
    #[test]
    fn the_share_of_runs_leaves_the_least_doubt() {
        let high = |rare: u64| {
            let runs = move |setting: u32| if setting == 1 { rare } else { 1100 - rare };
            weights().mixed(|setting| RateSequence::of_counts(0, runs(setting)), 0.95).high
        };
        assert!(high(100) < high(11) && high(100) < high(550), "{} {} {}", high(11), high(100), high(550));
    }
}
