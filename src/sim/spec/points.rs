//! Short lists of numbers, and the lines through them.

use armcal_core::codes::Code;
use std::ops::RangeInclusive;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use armcal_core::robot::FileIssue;

/// Largest number of values in a list.
const MAX_POINTS: usize = 16;

/// Short list of numbers, written as a list.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct Points {
    n: usize,
    values: [f64; MAX_POINTS],
}

impl Points {
    /// Empty list.
    pub const NONE: Self = Self { n: 0, values: [0.0; MAX_POINTS] };

    /// Returns the values of the list.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.n]
    }

    pub(super) fn is_empty(&self) -> bool {
        self.n == 0
    }
}

impl Default for Points {
    fn default() -> Self {
        Self::NONE
    }
}

impl TryFrom<Vec<f64>> for Points {
    type Error = String;

    fn try_from(list: Vec<f64>) -> Result<Self, String> {
        let mut points = Self { n: list.len(), ..Self::default() };
        let slots = points.values.get_mut(..list.len());
        let too_long = || format!("a list of {} figures; {MAX_POINTS} at most", list.len());
        slots.ok_or_else(too_long)?.copy_from_slice(&list);
        Ok(points)
    }
}

impl From<Points> for Vec<f64> {
    fn from(points: Points) -> Self {
        points.as_slice().to_vec()
    }
}

/// Values over positions in ascending order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polyline<'a> {
    pub at: &'a Points,
    pub values: &'a Points,
}

impl Polyline<'_> {
    /// Checks the values and their positions.
    ///
    /// # Errors
    /// [`FileIssue`] naming the key of the places or that of the values, and what is allowed.
    pub(super) fn check(
        &self,
        file: &Path,
        [at_key, value_key]: [&str; 2],
        [at_range, value_range]: [RangeInclusive<f64>; 2],
    ) -> Result<(), FileIssue> {
        let (at, values) = (self.at.as_slice(), self.values.as_slice());
        at.iter().try_for_each(|place| FileIssue::check_range(file, at_key, *place, at_range.clone()).map(drop))?;
        let check = |value: &f64| FileIssue::check_range(file, value_key, *value, value_range.clone()).map(drop);
        values.iter().try_for_each(check)?;
        if let Some(pair) = at.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(FileIssue::new(
                Code::ValueInvalid,
                file,
                at_key,
                format!("{} does not come before {}", pair[0], pair[1]),
            ));
        }
        if at.len() != values.len() {
            let name = at_key.rsplit('.').next().unwrap_or(at_key);
            let problem = format!("has {} figures for {} of {name}", values.len(), at.len());
            return Err(FileIssue::new(Code::ValueCount, file, value_key, problem));
        }
        Ok(())
    }

    /// Returns the value at a position, linear between the given positions and constant beyond; `None` if there are
    /// none.
    pub(super) fn value_at(&self, place: f64) -> Option<f64> {
        let (at, values) = (self.at.as_slice(), self.values.as_slice());
        let last = *values.last()?;
        Some(match at.partition_point(|next| *next <= place) {
            0 => values[0],
            n if n == at.len() => last,
            n => {
                let share = (place - at[n - 1]) / (at[n] - at[n - 1]);
                values[n - 1] + share * (values[n] - values[n - 1])
            }
        })
    }
}
