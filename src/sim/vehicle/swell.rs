//! Motion of a vehicle in a swell: prescribed, about its station, in closed form.
//!
//! Each of x, y, z, roll, pitch, yaw is a sum of sinusoids with random periods and phases, scaled to its RMS and
//! growing smoothly from rest. Position, velocity and acceleration are therefore exact and need no integration. The arm
//! does not move such a vehicle (4 t against 100 kg, and a pilot's station keeping).

use nalgebra::{UnitQuaternion, Vector3};

use crate::recorded_motion::VehicleKinematics;
use crate::spec::VehicleMotionSpec;
use crate::vehicle::sinusoids::{Derivatives, SinusoidSum, draw_sinusoids, evaluate};

const AXES: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// Sums of sinusoids over time.
#[derive(Clone, Debug)]
pub(super) struct Swell {
    axes: [SinusoidSum; 6],
    ramp_s: f64,
}

impl Swell {
    pub(super) fn new(spec: &VehicleMotionSpec, seed: u64) -> Self {
        let axes = std::array::from_fn(|k| {
            let rms = if k < 3 { spec.translation_rms_m } else { spec.rotation_rms_rad };
            draw_sinusoids(spec, rms, seed, AXES[k])
        });
        Self { axes, ramp_s: spec.ramp_s }
    }

    /// Returns the motion at `t_s` seconds after the start.
    pub(super) fn at(&self, t_s: f64) -> VehicleKinematics {
        let ramp = smooth_ramp(t_s, self.ramp_s);
        let mut jets = [[0.0; 3]; 6];
        for (jet, axis) in jets.iter_mut().zip(&self.axes) {
            *jet = ramped(&evaluate(axis, t_s), &ramp);
        }
        let vector = |order: usize| Vector3::new(jets[0][order], jets[1][order], jets[2][order]);
        let (rate, angular_acceleration) = body_rates(&jets[3], &jets[4], &jets[5]);
        VehicleKinematics {
            position: vector(0),
            velocity: vector(1),
            acceleration: vector(2),
            rotation: UnitQuaternion::from_euler_angles(jets[3][0], jets[4][0], jets[5][0]),
            rate,
            angular_acceleration,
        }
    }
}

/// Returns the ramp `10 s^3 - 15 s^4 + 6 s^5` of s = t/length, with zero velocity and acceleration at both ends.
fn smooth_ramp(t_s: f64, length_s: f64) -> Derivatives {
    if t_s >= length_s {
        return [1.0, 0.0, 0.0];
    }
    let s = t_s.max(0.0) / length_s;
    [
        s * s * s * (10.0 + s * (-15.0 + 6.0 * s)),
        s * s * (30.0 + s * (-60.0 + 30.0 * s)) / length_s,
        s * (60.0 + s * (-180.0 + 120.0 * s)) / (length_s * length_s),
    ]
}

/// Multiplies two functions with their derivatives, by the product rule.
fn ramped(f: &Derivatives, r: &Derivatives) -> Derivatives {
    [f[0] * r[0], f[1] * r[0] + f[0] * r[1], f[2] * r[0] + 2.0 * f[1] * r[1] + f[0] * r[2]]
}

/// Returns angular velocity and acceleration in body axes from roll, pitch, yaw of `R = Rz(yaw) Ry(pitch) Rx(roll)`.
fn body_rates(roll: &Derivatives, pitch: &Derivatives, yaw: &Derivatives) -> (Vector3<f64>, Vector3<f64>) {
    let (sr, cr) = roll[0].sin_cos();
    let (sp, cp) = pitch[0].sin_cos();
    let rate = Vector3::new(roll[1] - yaw[1] * sp, pitch[1] * cr + yaw[1] * sr * cp, -pitch[1] * sr + yaw[1] * cr * cp);
    let acceleration = Vector3::new(
        roll[2] - yaw[2] * sp - yaw[1] * pitch[1] * cp,
        pitch[2] * cr - pitch[1] * roll[1] * sr + yaw[2] * sr * cp + yaw[1] * (roll[1] * cr * cp - pitch[1] * sr * sp),
        -pitch[2] * sr - pitch[1] * roll[1] * cr + yaw[2] * cr * cp - yaw[1] * (roll[1] * sr * cp + pitch[1] * cr * sp),
    );
    (rate, acceleration)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rms_is_as_asked_over_a_long_time() {
        let spec = VehicleMotionSpec { rotation_rms_rad: 0.1, translation_rms_m: 0.3, ..VehicleMotionSpec::default() };
        let swell = Swell::new(&spec, 3);
        let n = 40_000;
        let mut squares = 0.0;
        for i in 0..n {
            let t = 10.0 + f64::from(i) * 0.25;
            squares += evaluate(&swell.axes[4], t)[0].powi(2);
        }
        let rms = (squares / f64::from(n)).sqrt();
        assert!((rms - 0.1).abs() < 2e-3, "rms {rms}");
    }
}
