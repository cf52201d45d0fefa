//! The vehicle's prescribed motion about its station, in closed form.
//!
//! Each of x, y, z, roll, pitch, yaw is a sum of sinusoids with random periods and phases, scaled to its rms and
//! swelling smoothly from rest, so that position, velocity and acceleration are exact and need no integration. The arm
//! does not push the vehicle back (4 t against 100 kg, and a pilot's station keeping).

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;

use super::spec::VehicleMotionSpec;
use crate::spatial::{Base, Pose, Vehicle, World};
use crate::stats::stream_rng;

/// Standard gravity, m/s2.
pub(super) const GRAVITY_M_S2: f64 = 9.806_65;

const N_SINUSOIDS: usize = 6;
const AXES: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// Motion of the vehicle over time.
#[derive(Clone, Debug)]
pub(super) struct VehicleMotion {
    vehicle_from_base: Pose<Vehicle, Base>,
    axes: [[Sinusoid; N_SINUSOIDS]; 6],
    ramp_s: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sinusoid {
    amplitude: f64,
    rate_rad_s: f64,
    phase_rad: f64,
}

/// The base frame's motion at one instant, in base axes unless named otherwise.
#[derive(Clone, Copy, Debug)]
pub(super) struct BaseState {
    pub world_from_vehicle: Pose<World, Vehicle>,
    pub world_from_base: Pose<World, Base>,
    /// Of the base's origin against the world, m/s.
    pub velocity: Vector3<f64>,
    /// Of the base's origin against the world, m/s2.
    pub acceleration: Vector3<f64>,
    /// rad/s.
    pub angular_velocity: Vector3<f64>,
    /// rad/s2.
    pub angular_acceleration: Vector3<f64>,
    /// m/s2.
    pub gravity: Vector3<f64>,
    /// Angular velocity in vehicle axes, rad/s.
    pub vehicle_rate: Vector3<f64>,
    /// Acceleration minus gravity at the vehicle's origin in vehicle axes, m/s2.
    pub vehicle_specific_force: Vector3<f64>,
}

/// Value, first and second derivative.
type Jet = [f64; 3];

impl VehicleMotion {
    pub(super) fn new(spec: &VehicleMotionSpec, vehicle_from_base: Pose<Vehicle, Base>, seed: u64) -> Self {
        let mut axes = [[Sinusoid::default(); N_SINUSOIDS]; 6];
        for (k, axis) in axes.iter_mut().enumerate() {
            let rms = if k < 3 { spec.translation_rms_m } else { spec.rotation_rms_rad };
            *axis = draw_axis(spec, rms, seed, AXES[k]);
        }
        Self { vehicle_from_base, axes, ramp_s: spec.ramp_s }
    }

    /// The state at `t_s` seconds after the start.
    pub(super) fn at(&self, t_s: f64) -> BaseState {
        let ramp = smooth_ramp(t_s, self.ramp_s);
        let mut jets = [[0.0; 3]; 6];
        for (jet, axis) in jets.iter_mut().zip(&self.axes) {
            *jet = ramped(&sum(axis, t_s), &ramp);
        }
        let vector = |order: usize| Vector3::new(jets[0][order], jets[1][order], jets[2][order]);
        let rotation = UnitQuaternion::from_euler_angles(jets[3][0], jets[4][0], jets[5][0]);
        let (rate, angular_acceleration) = body_rates(&jets[3], &jets[4], &jets[5]);
        let world_from_vehicle = Isometry3::from_parts(Translation3::from(vector(0)), rotation);
        let mount = self.vehicle_from_base.isometry();
        let lever = mount.translation.vector;
        let to_vehicle = rotation.inverse();
        let to_base = mount.rotation.inverse();
        // Rigid body: a_base = a + alpha x r + w x (w x r), v_base = v + w x r, all in vehicle axes.
        let velocity = to_vehicle * vector(1) + rate.cross(&lever);
        let origin_acceleration = to_vehicle * vector(2);
        let acceleration = origin_acceleration + angular_acceleration.cross(&lever) + rate.cross(&rate.cross(&lever));
        let gravity = to_vehicle * Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        let world_from_vehicle = Pose::from_isometry(world_from_vehicle);
        BaseState {
            world_from_vehicle,
            world_from_base: world_from_vehicle * self.vehicle_from_base,
            velocity: to_base * velocity,
            acceleration: to_base * acceleration,
            angular_velocity: to_base * rate,
            angular_acceleration: to_base * angular_acceleration,
            gravity: to_base * gravity,
            vehicle_rate: rate,
            vehicle_specific_force: origin_acceleration - gravity,
        }
    }
}

/// Random shares and phases, periods spread evenly in their logarithm; the rms of the sum of sinusoids is exact.
fn draw_axis(spec: &VehicleMotionSpec, rms: f64, seed: u64, name: &str) -> [Sinusoid; N_SINUSOIDS] {
    let mut rng = stream_rng(seed, &format!("vehicle/{name}"));
    let (low, high) = (spec.period_min_s.ln(), spec.period_max_s.ln());
    let mut axis = [Sinusoid::default(); N_SINUSOIDS];
    for (k, sinusoid) in axis.iter_mut().enumerate() {
        // One period from each sixth of the band: no two alike, for beats would change the rms of a short run.
        let place = (k as f64 + rng.random_range(0.0..1.0)) / N_SINUSOIDS as f64;
        sinusoid.rate_rad_s = std::f64::consts::TAU / (low + place * (high - low)).exp();
        sinusoid.amplitude = rng.random_range(0.5..1.0);
        sinusoid.phase_rad = rng.random_range(0.0..std::f64::consts::TAU);
    }
    let norm = axis.iter().map(|s| 0.5 * s.amplitude * s.amplitude).sum::<f64>().sqrt();
    for sinusoid in &mut axis {
        sinusoid.amplitude *= rms / norm;
    }
    axis
}

fn sum(axis: &[Sinusoid; N_SINUSOIDS], t_s: f64) -> Jet {
    let mut jet = [0.0; 3];
    for s in axis {
        let (sin, cos) = (s.rate_rad_s * t_s + s.phase_rad).sin_cos();
        jet[0] += s.amplitude * sin;
        jet[1] += s.amplitude * s.rate_rad_s * cos;
        jet[2] -= s.amplitude * s.rate_rad_s * s.rate_rad_s * sin;
    }
    jet
}

/// `10 s^3 - 15 s^4 + 6 s^5` of s = t/length: rest, velocity and acceleration zero at both ends.
fn smooth_ramp(t_s: f64, length_s: f64) -> Jet {
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

/// The product rule.
fn ramped(f: &Jet, r: &Jet) -> Jet {
    [f[0] * r[0], f[1] * r[0] + f[0] * r[1], f[2] * r[0] + 2.0 * f[1] * r[1] + f[0] * r[2]]
}

/// Angular velocity and acceleration in body axes from roll, pitch, yaw of `R = Rz(yaw) Ry(pitch) Rx(roll)`.
fn body_rates(roll: &Jet, pitch: &Jet, yaw: &Jet) -> (Vector3<f64>, Vector3<f64>) {
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

    fn motion() -> VehicleMotion {
        let spec = VehicleMotionSpec { rotation_rms_rad: 0.1, translation_rms_m: 0.3, ..VehicleMotionSpec::default() };
        VehicleMotion::new(&spec, Pose::from_position_rpy([1.7, -0.6, 0.1], [0.1, 0.2, -0.4]), 3)
    }

    /// Central differences of the pose against the closed forms, during the swell and after it.
    #[test]
    fn derivatives_agree_with_central_differences() {
        // Truncation of second differences at h = 1e-3 s for periods of 5 s, and rounding 1e-16/h^2.
        const TOLERANCE: f64 = 2e-6;
        let (motion, h) = (motion(), 1e-3);
        for t in [1.3, 4.0, 17.0, 321.0] {
            let [before, now, after] = [t - h, t, t + h].map(|t| motion.at(t));
            let to_base = now.world_from_base.rotation().inverse();
            let [p0, p1, p2] = [before, now, after].map(|s| s.world_from_base.origin().vector());
            assert!((to_base * (p2 - p0) / (2.0 * h) - now.velocity).norm() < TOLERANCE);
            assert!((to_base * (p2 - p1 * 2.0 + p0) / (h * h) - now.acceleration).norm() < TOLERANCE);
            let turn = before.world_from_base.rotation().inverse() * after.world_from_base.rotation();
            assert!((turn.scaled_axis() / (2.0 * h) - now.angular_velocity).norm() < TOLERANCE);
            // The components' derivative in body axes is the angular acceleration.
            let slope = (after.angular_velocity - before.angular_velocity) / (2.0 * h);
            assert!((slope - now.angular_acceleration).norm() < TOLERANCE);
        }
    }

    #[test]
    fn rms_is_as_asked_over_a_long_time() {
        let motion = motion();
        let n = 40_000;
        let mut squares = 0.0;
        for i in 0..n {
            let t = 10.0 + f64::from(i) * 0.25;
            squares += sum(&motion.axes[4], t)[0].powi(2);
        }
        let rms = (squares / f64::from(n)).sqrt();
        assert!((rms - 0.1).abs() < 2e-3, "rms {rms}");
    }

    #[test]
    fn it_starts_at_rest_on_station() {
        let state = motion().at(0.0);
        assert!(state.velocity.norm() < 1e-12 && state.acceleration.norm() < 1e-12);
        assert!(state.world_from_vehicle.origin().vector().norm() < 1e-12);
    }
}
