//! `[world.ground]`.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, table};
use armcal_core::robot::FileIssue;

table!(
    /// Soft ground under a vehicle that is parked on it or descends to it.
    #[derive(Copy)]
    GroundSpec {
        /// Weight less buoyancy of vehicle and arm: 0 for a vehicle that floats level with the arm stowed.
        vehicle_weight_n = 0.0, in 0.0..=1e5;
        /// Stiffness of each corner of a part that stands in it. Assumed: 1500 N on the eight corners of two skids sink
        /// in by 4 mm.
        stiffness_n_m = 5e4, in 1e3..=1e7;
        /// Damping over the stiffness. Assumed: mud does not let a vehicle rebound.
        damping_s = 0.1, in 0.0..=1.0;
        /// Sideways friction over the load of a corner. Assumed.
        friction = 0.5, in 0.0..=2.0;
    }
);

impl GroundSpec {
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
