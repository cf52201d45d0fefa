//! Impulse of a short force on the vehicle.

/// Impulse on the vehicle, in vehicle axes about the vehicle's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Impulse {
    pub impulse_n_s: [f64; 3],
    pub angular_impulse_n_m_s: [f64; 3],
}

impl Impulse {
    /// Returns the impulse of a force at a point, too short for the vehicle's motion to matter during it.
    pub(crate) fn new(force_n: [f64; 3], duration_s: f64, at_m: [f64; 3]) -> Self {
        let impulse_n_s = force_n.map(|force| force * duration_s);
        let ([x, y, z], [fx, fy, fz]) = (at_m, impulse_n_s);
        Self { impulse_n_s, angular_impulse_n_m_s: [y * fz - z * fy, z * fx - x * fz, x * fy - y * fx] }
    }
}
