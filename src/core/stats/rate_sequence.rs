//! Rate of an event over runs, with an interval that holds however often one looks.
//!
//! A confidence sequence: the chance that the interval ever misses the true rate is at most one minus its level. So a
//! campaign may stop as soon as the interval is narrow enough. It follows from Ville's inequality for the ratio of the
//! mixture's likelihood to the likelihood of one rate (Robbins 1970). The mixture is that of all rates under Jeffreys'
//! prior, Beta(1/2, 1/2); its predictions are those of Krichevsky and Trofimov 1981.

/// Counts of runs with and without an event.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RateSequence {
    n_events: u64,
    n_runs: u64,
    /// Log of the mixture's likelihood of the counts.
    ln_mixture: f64,
}

/// Number of bisections of an interval's end: to the last bits.
const BISECTIONS: usize = 60;

impl RateSequence {
    /// Returns the sequence after `n_runs` runs, `n_events` of them with the event; their order does not matter.
    #[must_use]
    pub fn of_counts(n_events: u64, n_runs: u64) -> Self {
        let mut sequence = Self::default();
        (0..n_events.min(n_runs)).for_each(|_| sequence.add_with());
        (n_events..n_runs).for_each(|_| sequence.add_without());
        sequence
    }

    /// Counts one more run that had the event.
    pub fn add_with(&mut self) {
        self.add(self.n_events);
        self.n_events += 1;
    }

    /// Counts one more run without the event.
    pub fn add_without(&mut self) {
        self.add(self.n_runs - self.n_events);
    }

    /// Counts one more run, of whose outcome there were `n_alike` before.
    fn add(&mut self, n_alike: u64) {
        self.ln_mixture += ((n_alike as f64 + 0.5) / (self.n_runs as f64 + 1.0)).ln();
        self.n_runs += 1;
    }

    /// Returns the number of runs with the event, and of all runs.
    #[must_use]
    pub fn counts(&self) -> [u64; 2] {
        [self.n_events, self.n_runs]
    }

    /// Returns the interval of the rate at `level`, 0.95 for 95 %.
    #[must_use]
    pub fn interval(&self, level: f64) -> [f64; 2] {
        let most = -(1.0 - level).ln();
        let [events, others] = [self.n_events as f64, (self.n_runs - self.n_events) as f64];
        let times_ln = |n: f64, x: f64| if n == 0.0 { 0.0 } else { n * x.ln() };
        let is_inside = |rate: f64| self.ln_mixture - times_ln(events, rate) - times_ln(others, 1.0 - rate) < most;
        let middle = if self.n_runs == 0 { 0.5 } else { events / self.n_runs as f64 };
        [0.0, 1.0].map(|bound| {
            let (mut inside, mut outside) = (middle, bound);
            if is_inside(bound) {
                return bound;
            }
            for _ in 0..BISECTIONS {
                let half = 0.5 * (inside + outside);
                *(if is_inside(half) { &mut inside } else { &mut outside }) = half;
            }
            outside
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use rand::RngExt;

    use super::*;
    use crate::stats::stream_rng;

    /// Looks after each of 2000 runs, 300 times over: at most 5 % of sequences may ever miss the truth. Sequences with
    /// equal counts share one interval.
    #[test]
    fn the_interval_holds_however_often_one_looks() {
        let mut intervals: HashMap<[u64; 2], [f64; 2]> = HashMap::new();
        for (number, rate) in [0.002, 0.05, 0.5].into_iter().enumerate() {
            let mut n_missed = 0;
            for seed in 0..300 {
                let mut rng = stream_rng(seed, &format!("rate sequence {number}"));
                let mut sequence = RateSequence::default();
                let is_missed = (0..2000).any(|_| {
                    if rng.random_range(0.0..1.0) < rate {
                        sequence.add_with();
                    } else {
                        sequence.add_without();
                    }
                    let counted = sequence.counts();
                    let [low, high] = *intervals.entry(counted).or_insert_with(|| sequence.interval(0.95));
                    !(low..=high).contains(&rate)
                });
                n_missed += u32::from(is_missed);
            }
            assert!(n_missed <= 15, "rate {rate}: {n_missed} of 300");
        }
    }

    /// The closed form of the mixture's likelihood of s events in n runs is B(s + 1/2, n - s + 1/2) / B(1/2, 1/2).
    #[test]
    fn its_ends_are_where_the_ratio_says() {
        // 1 event in 3 runs: B(1.5, 2.5) / B(0.5, 0.5) = (pi / 16) / pi.
        assert!((RateSequence::of_counts(1, 3).ln_mixture - (1.0_f64 / 16.0).ln()).abs() < 1e-12);
        let none = RateSequence::of_counts(0, 1000);
        let [low, high] = none.interval(0.95);
        assert_eq!(low, 0.0);
        assert!((none.ln_mixture - 1000.0 * (1.0 - high).ln() - 20.0_f64.ln()).abs() < 1e-9, "{high}");
        assert!((0.006..0.009).contains(&high), "{high}");
        assert_eq!(RateSequence::default().interval(0.95), [0.0, 1.0]);
        let [low, high] = RateSequence::of_counts(100, 1000).interval(0.95);
        assert!((0.06..0.08).contains(&low) && (0.12..0.14).contains(&high), "{low} {high}");
    }

    #[test]
    fn the_order_of_events_does_not_matter() {
        let mut other = RateSequence::default();
        for _ in 0..5 {
            (0..7).for_each(|_| other.add_without());
            other.add_with();
        }
        let (a, b) = (RateSequence::of_counts(5, 40).interval(0.9), other.interval(0.9));
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
    }
}
