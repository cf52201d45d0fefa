//! `[world.geometry]`.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, table};
use armcal_core::robot::FileIssue;

table!(
    /// Errors of the arm's geometry against its nominal model.
    #[derive(Copy)]
    GeometrySpec {
        /// Standard deviation of each error over its standard deviation in `[geometry]` of robot.toml; 0: as in the
        /// URDF.
        error_ratio = 0.0, in 0.0..=20.0;
    }
);

impl GeometrySpec {
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
