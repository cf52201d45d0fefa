//! The unit that a length was written in, from its ratio to the true length.

use crate::say::constants::length_unit::{NEAR, UNITS};

/// Returns the unit of which `ratio` make a metre; `None` for the metre and for unknown units.
#[must_use]
pub(crate) fn unit_of(ratio: f64) -> Option<&'static str> {
    UNITS.iter().find(|(_, per_m)| (ratio / per_m - 1.0).abs() < NEAR).map(|(name, _)| *name)
}

#[cfg(test)]
mod tests {
    use super::unit_of;

    #[test]
    fn a_ratio_near_that_of_a_unit_names_it() {
        let units = [(1003.0, "mm"), (99.0, "cm"), (10.1, "dm"), (39.4, "inches"), (3.29, "feet")];
        assert!(units.into_iter().all(|(ratio, unit)| unit_of(ratio) == Some(unit)));
        assert!([1.0, 1.05, 0.001, 2.0, 25.0, 500.0].into_iter().all(|ratio| unit_of(ratio).is_none()));
    }
}
