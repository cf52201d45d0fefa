//! What a real arm's sensors make of the truth: counts, pixels, temperatures, attitude, pressure.

pub(super) mod attitude;
pub(super) mod camera;
pub(super) mod joint;
pub(super) mod temperatures;
pub(super) mod thermometer;

/// What lies about the joint sensors, in their oil.
#[derive(Clone, Copy, Debug)]
pub(super) struct OilState {
    pub oil_c: f64,
    /// Above the surface's.
    pub pressure_pa: f64,
}

#[cfg(test)]
mod tests;
