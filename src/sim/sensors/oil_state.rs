//! State of the oil about the joint sensors.

/// What lies about the joint sensors, in their oil.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OilState {
    pub oil_c: f64,
    /// Above the surface's.
    pub pressure_pa: f64,
}
