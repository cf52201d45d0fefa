//! Tags and groups of a map in the form of files.

use nalgebra::{Isometry3, Matrix6};

/// A tag of a map in the form of files.
#[derive(Clone, Debug)]
pub(super) struct WrittenTag {
    pub(super) id: u32,
    pub(super) size_m: f64,
    pub(super) pose: Isometry3<f64>,
    /// Standard deviations of the position along the axes of the frame, m.
    pub(super) position_std_m: [f64; 3],
    pub(super) covariance: Matrix6<f64>,
}

/// One group of a map in the form of files.
#[derive(Clone, Debug)]
pub(super) struct WrittenGroup {
    pub(super) frame: String,
    pub(super) is_static: bool,
    pub(super) tags: Vec<WrittenTag>,
}
