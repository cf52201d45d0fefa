//! The full product of `[campaign.matrix]`.

use toml::Value;

use crate::campaign::CampaignError;
use armcal_core::routine::Override;

/// One point of the matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// From 0; the last key varies fastest.
    pub index: u32,
    pub set: Vec<Override>,
}

impl Setting {
    /// `key=value;key=value`; empty without a matrix.
    #[must_use]
    pub fn text(&self) -> String {
        self.set.iter().map(Override::to_string).collect::<Vec<_>>().join(";")
    }
}

/// More points than anybody would wait for: a slip in the routine.
const MAX_SETTINGS: usize = 10_000;

/// All points; one without settings where there is no matrix.
///
/// # Errors
/// [`CampaignError::Usage`] for a key that is none, or far too many points.
pub fn settings(matrix: &[(String, Vec<Value>)]) -> Result<Vec<Setting>, CampaignError> {
    let n = matrix.iter().try_fold(1_usize, |n, (_, values)| n.checked_mul(values.len()));
    if n.is_none_or(|n| n > MAX_SETTINGS) {
        return Err(CampaignError::Usage(format!("campaign.matrix has more than {MAX_SETTINGS} points")));
    }
    let mut points: Vec<Vec<Override>> = vec![Vec::new()];
    for (key, values) in matrix {
        let mut longer = Vec::with_capacity(points.len() * values.len());
        for point in &points {
            for value in values {
                let one = Override::new(key, value.clone()).map_err(CampaignError::Usage)?;
                longer.push(point.iter().cloned().chain([one]).collect());
            }
        }
        points = longer;
    }
    Ok((0..).zip(points).map(|(index, set)| Setting { index, set }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_is_the_full_product_and_none_is_one_point() {
        let numbers = |values: &[i64]| values.iter().map(|v| Value::Integer(*v)).collect::<Vec<_>>();
        let matrix = [("a.b".to_owned(), numbers(&[1, 2])), ("c".to_owned(), numbers(&[3, 4, 5]))];
        let points = settings(&matrix).expect("good");
        let texts: Vec<String> = points.iter().map(Setting::text).collect();
        assert_eq!(texts, ["a.b=1;c=3", "a.b=1;c=4", "a.b=1;c=5", "a.b=2;c=3", "a.b=2;c=4", "a.b=2;c=5"]);
        assert_eq!(points.iter().map(|p| p.index).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
        let alone = settings(&[]).expect("good");
        assert_eq!((alone.len(), alone[0].text()), (1, String::new()));
        let huge: Vec<_> = (0..64).map(|k| (format!("k{k}"), numbers(&[1, 2, 3]))).collect();
        assert!(settings(&huge).is_err());
    }
}
