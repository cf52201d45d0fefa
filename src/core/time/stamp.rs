//! Time stamps in nanoseconds.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A point in time, nanoseconds since the Unix epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
pub struct Stamp {
    /// Nanoseconds since the Unix epoch; negative before 1970.
    pub nanos: i64,
}

/// Start of simulated time: 2026-01-01T00:00:00Z. It is fixed, so that recordings repeat byte for byte.
pub const SIMULATION_EPOCH: Stamp = Stamp { nanos: 1_767_225_600_000_000_000 };

impl Stamp {
    /// Returns the stamp that lies `seconds` after `self` (before, if negative), rounded to whole nanoseconds.
    #[must_use]
    pub fn plus_s(self, seconds: f64) -> Self {
        Self { nanos: self.nanos.saturating_add((seconds * 1e9).round() as i64) }
    }

    /// Returns the seconds from `earlier` to `self`; negative if `self` comes first.
    #[must_use]
    pub fn since_s(self, earlier: Self) -> f64 {
        // i128: the difference of two arbitrary recorded stamps may not fit an i64.
        (i128::from(self.nanos) - i128::from(earlier.nanos)) as f64 * 1e-9
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adding_and_subtracting_seconds_round_trips() {
        let later = SIMULATION_EPOCH.plus_s(12.345_678_9);
        assert!((later.since_s(SIMULATION_EPOCH) - 12.345_678_9).abs() < 1e-9);
        assert!((SIMULATION_EPOCH.since_s(later) + 12.345_678_9).abs() < 1e-9);
    }
}
