//! Percentile bootstrap: the confidence interval of a median.

use rand::RngExt;

use super::{quantile, stream_rng};

/// Interval of a figure with the requested coverage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end, in the unit of the samples.
    pub low: f64,
    /// Upper end, in the unit of the samples.
    pub high: f64,
}

/// Number of resamples; the interval's ends then hold to about 1 % of its coverage.
const RESAMPLES: usize = 2000;

/// Returns the interval that holds the population's median with probability `coverage` (0..1), by the percentile
/// bootstrap. It takes the medians of samples drawn from `samples`. The draws are the same each time. `None` for no
/// samples.
#[must_use]
pub fn median_interval(samples: &[f64], coverage: f64) -> Option<Interval> {
    if samples.is_empty() {
        return None;
    }
    // Sorted, so that the order of the samples does not change the result.
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut rng = stream_rng(0, "bootstrap of the median");
    let mut resample = sorted.clone();
    let mut medians = Vec::with_capacity(RESAMPLES);
    for _ in 0..RESAMPLES {
        for value in &mut resample {
            *value = sorted[rng.random_range(0..sorted.len())];
        }
        medians.push(median(&mut resample));
    }
    let tail = 0.5 * (1.0 - coverage);
    Some(Interval { low: quantile(&medians, tail)?, high: quantile(&medians, 1.0 - tail)? })
}

/// Returns the median of one or more values, which it reorders; in linear time, for thousands of resamples.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    let is_even = values.len().is_multiple_of(2);
    let (below, upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    let upper = *upper;
    match below.iter().copied().reduce(f64::max) {
        Some(lower) if is_even => 0.5 * (lower + upper),
        _ => upper,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn the_quick_median_is_the_median() {
        let mut rng = stream_rng(1, "values");
        for n in 1..40 {
            let mut values: Vec<f64> = (0..n).map(|_| f64::from(rng.random_range(0..9))).collect();
            assert_eq!(Some(median(&mut values.clone())), quantile(&values, 0.5), "{values:?}");
            values.reverse();
            assert_eq!(Some(median(&mut values.clone())), quantile(&values, 0.5));
        }
    }

    #[test]
    fn equal_samples_leave_no_doubt_and_no_samples_no_answer() {
        assert_eq!(median_interval(&[2.5; 7], 0.95), Some(Interval { low: 2.5, high: 2.5 }));
        assert_eq!(median_interval(&[3.0], 0.95), Some(Interval { low: 3.0, high: 3.0 }));
        assert_eq!(median_interval(&[], 0.95), None);
    }

    /// For an odd number of samples the resampled median is an order statistic, whose distribution is binomial.
    /// P(median of the resample is at most the k-th of nine) = P(five or more of nine draws with p = k/9). That is
    /// 0.0015, 0.030, 0.145, 0.38 for k = 1 to 4. The low end is the first k that passes the tail.
    #[test]
    fn ends_are_the_order_statistics_that_the_binomial_gives() {
        let samples: Vec<f64> = (1..=9).map(f64::from).collect();
        let mut turned = samples.clone();
        turned.reverse();
        for (coverage, low) in [(0.999, 1.0), (0.95, 2.0), (0.90, 3.0), (0.50, 4.0)] {
            let expected = Some(Interval { low, high: 10.0 - low });
            assert_eq!(median_interval(&samples, coverage), expected, "{coverage}");
            assert_eq!(median_interval(&turned, coverage), expected, "order does not matter");
        }
    }

    /// About 95 % of intervals of normal samples hold the true median; the percentile bootstrap is known to come near.
    #[test]
    fn intervals_hold_the_true_median_about_as_often_as_asked() {
        let held = (0..400)
            .filter(|seed| {
                let mut rng = stream_rng(*seed, "normal samples");
                let samples: Vec<f64> = (0..25).map(|_| StandardNormal.sample(&mut rng)).collect();
                let interval = median_interval(&samples, 0.95).expect("samples");
                interval.low <= 0.0 && 0.0 <= interval.high
            })
            .count();
        assert!((368..=396).contains(&held), "{held} of 400");
    }
}
