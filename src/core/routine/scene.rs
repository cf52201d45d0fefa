//! What surrounds the vehicle, as the operator describes it.

use crate::robot::Part;

/// The site: a flat seafloor and obstacles, placed in the world frame (z up, origin at the vehicle's station).
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Height of the seafloor in the world frame; `None` in open water.
    pub seafloor_z_m: Option<f64>,
    pub obstacles: Vec<Part>,
}
