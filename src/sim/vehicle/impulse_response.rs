//! Response of a vehicle with prescribed motion to an impulse.

use nalgebra::{UnitQuaternion, Vector3};

use crate::fault::Impulse;
use crate::recorded_motion::VehicleKinematics;

/// Response of a vehicle with prescribed motion to an impulse: `x = c t2 exp(-t/T)`. Its largest velocity is that which
/// the impulse gives to the vehicle without the arm. Assumed; a free vehicle responds by its equations of motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct ImpulseResponse {
    start_s: f64,
    /// Coefficient of the translation, world axes, m/s2.
    linear: Vector3<f64>,
    /// Coefficient of the rotation, vehicle axes, rad/s2.
    angular: Vector3<f64>,
}

/// Time constant of the pilot's response, s.
const RESPONSE_TIME_S: f64 = 1.5;

impl ImpulseResponse {
    pub(super) fn new(
        start_s: f64,
        impulse: &Impulse,
        mass_kg: f64,
        inertia_kg_m2: &Vector3<f64>,
        world_from_vehicle: &UnitQuaternion<f64>,
    ) -> Self {
        // The rate c (2 t - t2/T) exp(-t/T) is largest at t = (2 - sqrt 2) T.
        let u = 2.0 - std::f64::consts::SQRT_2;
        let largest = (2.0 * u - u * u) * (-u).exp() * RESPONSE_TIME_S;
        Self {
            start_s,
            linear: world_from_vehicle * Vector3::from(impulse.impulse_n_s) / mass_kg / largest,
            angular: Vector3::from(impulse.angular_impulse_n_m_s).component_div(inertia_kg_m2) / largest,
        }
    }

    pub(super) fn add_to(&self, jet: &mut VehicleKinematics, t_s: f64) {
        let t = t_s - self.start_s;
        if t <= 0.0 {
            return;
        }
        let (u, fade) = (t / RESPONSE_TIME_S, (-t / RESPONSE_TIME_S).exp());
        let shape = [t * t * fade, t * (2.0 - u) * fade, (2.0 - 4.0 * u + u * u) * fade];
        jet.position += self.linear * shape[0];
        jet.velocity += self.linear * shape[1];
        jet.acceleration += self.linear * shape[2];
        // Rotation `R exp(a s)`: the rate in the axes of the turned vehicle, and its derivative.
        let turn = UnitQuaternion::from_scaled_axis(self.angular * shape[0]);
        let (spin, seen) = (self.angular * shape[1], turn.inverse() * jet.rate);
        jet.rate = seen + spin;
        jet.angular_acceleration =
            turn.inverse() * jet.angular_acceleration + self.angular * shape[2] - spin.cross(&seen);
        jet.rotation *= turn;
    }
}
