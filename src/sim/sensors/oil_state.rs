//! State of the oil about the joint sensors.

/// Oil temperature and pressure at the joint sensors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OilState {
    pub oil_c: f64,
    /// Above the surface's.
    pub pressure_pa: f64,
}
