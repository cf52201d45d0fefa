//! The full product of `[campaign.matrix]`.

use toml::Value;

use crate::campaign::CampaignError;
use armcal_core::routine::Override;

/// One point of the matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Number of the point, from 0; the last key varies fastest.
    pub index: u32,
    pub set: Vec<Override>,
    /// Probability that the setting occurs; all settings together have 1.
    pub weight: f64,
    /// Share of the seeds that are run under the setting: 1 for the most frequent setting, and without weights. For
    /// another it is the square root of its weight over the largest weight. With equally many runs, this allocation
    /// gives the tightest bound on the rate of an event that never occurred.
    pub share: f64,
}

impl Setting {
    /// The overrides as `key=value;key=value`; empty without a matrix.
    #[must_use]
    pub fn text(&self) -> String {
        self.set.iter().map(Override::to_string).collect::<Vec<_>>().join(";")
    }

    /// True if the seed at `place` in the range, from 0, is run under the setting: the first always, others at equal
    /// distances.
    #[must_use]
    pub fn takes(&self, place: u64) -> bool {
        let before = |place: u64| (place as f64 * self.share).ceil();
        before(place + 1) > before(place)
    }
}

/// Largest number of points; more indicate a mistake in the routine.
const MAX_SETTINGS: usize = 10_000;

/// All points; a single one without overrides where there is no matrix. `weights` are those of values of some keys.
///
/// # Errors
/// [`CampaignError::Usage`] for an unknown key, or too many points.
pub fn settings(
    matrix: &[(String, Vec<Value>)],
    weights: &[(String, Vec<f64>)],
) -> Result<Vec<Setting>, CampaignError> {
    let n = matrix.iter().try_fold(1_usize, |n, (_, values)| n.checked_mul(values.len()));
    if n.is_none_or(|n| n > MAX_SETTINGS) {
        return Err(CampaignError::Usage(format!("campaign.matrix has more than {MAX_SETTINGS} points")));
    }
    let mut points: Vec<(Vec<Override>, f64)> = vec![(Vec::new(), 1.0)];
    for (key, values) in matrix {
        let of_key = weights.iter().find(|(name, _)| name == key).map(|(_, weights)| weights);
        let mut longer = Vec::with_capacity(points.len() * values.len());
        for (point, weight) in &points {
            for (k, value) in values.iter().enumerate() {
                let one = Override::new(key, value.clone()).map_err(CampaignError::Usage)?.of_matrix();
                let its = of_key.and_then(|weights| weights.get(k)).copied().unwrap_or(1.0);
                longer.push((point.iter().cloned().chain([one]).collect(), weight * its));
            }
        }
        points = longer;
    }
    let total: f64 = points.iter().map(|(_, weight)| weight).sum();
    let most = points.iter().map(|(_, weight)| *weight).fold(0.0, f64::max);
    let setting = |(index, (set, weight)): (u32, (Vec<Override>, f64))| Setting {
        index,
        set,
        weight: weight / total,
        share: (weight / most).sqrt(),
    };
    Ok((0..).zip(points).map(setting).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_the_full_product_and_none_is_one_point() {
        let numbers = |values: &[i64]| values.iter().map(|v| Value::Integer(*v)).collect::<Vec<_>>();
        let matrix = [("a.b".to_owned(), numbers(&[1, 2])), ("c".to_owned(), numbers(&[3, 4, 5]))];
        let points = settings(&matrix, &[]).expect("good");
        let texts: Vec<String> = points.iter().map(Setting::text).collect();
        assert_eq!(texts, ["a.b=1;c=3", "a.b=1;c=4", "a.b=1;c=5", "a.b=2;c=3", "a.b=2;c=4", "a.b=2;c=5"]);
        assert_eq!(points.iter().map(|p| p.index).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
        let alone = settings(&[], &[]).expect("good");
        assert_eq!((alone.len(), alone[0].text()), (1, String::new()));
        let huge: Vec<_> = (0..64).map(|k| (format!("k{k}"), numbers(&[1, 2, 3]))).collect();
        assert!(settings(&huge, &[]).is_err());
    }

    /// With points of weights 1, 0.25 and 0.01, every seed is run under the first, every second under the next, every
    /// tenth under the last.
    #[test]
    fn rare_points_meet_fewer_seeds_but_more_than_their_weight() {
        let numbers = [1, 2, 3].map(Value::Integer).to_vec();
        let points = settings(&[("a".to_owned(), numbers)], &[("a".to_owned(), vec![1.0, 0.25, 0.01])]).expect("good");
        assert!((points.iter().map(|point| point.weight).sum::<f64>() - 1.0).abs() < 1e-15);
        let met = |k: usize| (0..100).filter(|place| points[k].takes(*place)).collect::<Vec<u64>>();
        assert_eq!(met(0).len(), 100);
        assert_eq!(met(1), (0..100).step_by(2).collect::<Vec<u64>>());
        assert_eq!(met(2).len(), 10);
        assert_eq!(met(2)[0], 0, "the first seed meets all");
    }
}
