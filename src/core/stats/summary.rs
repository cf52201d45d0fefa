//! Summaries of samples.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Count, median, 95th percentile and maximum, the form of every statistic in summary.json.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Number of samples, one or more.
    pub n: usize,
    /// Median; the mean of the middle two for an even number.
    pub median: f64,
    /// 95th percentile, interpolated.
    pub p95: f64,
    /// Largest sample.
    pub max: f64,
}

impl Summary {
    /// Returns the summary of `samples`; `None` if there are none.
    #[must_use]
    pub fn of(samples: &[f64]) -> Option<Self> {
        let max = samples.iter().copied().reduce(f64::max)?;
        Some(Self { n: samples.len(), median: quantile(samples, 0.5)?, p95: quantile(samples, 0.95)?, max })
    }
}

/// Returns the `q`-quantile (0..=1) by linear interpolation between order statistics; `None` for no samples.
#[must_use]
pub fn quantile(samples: &[f64], q: f64) -> Option<f64> {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let place = q.clamp(0.0, 1.0) * last as f64;
    let low = place.floor() as usize;
    let high = (low + 1).min(last);
    Some(sorted[low] + (sorted[high] - sorted[low]) * (place - low as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_between_order_statistics() {
        let samples = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(quantile(&samples, 0.5), Some(2.5));
        assert_eq!(quantile(&samples, 1.0), Some(4.0));
        assert_eq!(quantile(&[], 0.5), None);
    }
}
