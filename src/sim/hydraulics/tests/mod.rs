//! Drives compared with closed forms, on single joints that are inertias.

mod closed_loop;
mod dry_friction;
mod faults;
mod oil;

use crate::hydraulics::Hydraulics;
use crate::hydraulics::actuator::Actuator;
use crate::hydraulics::actuator_input::ActuatorInput;
use crate::spec::HydraulicsSpec;
use armcal_core::kinematics::JointLimits;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Joints without a body: each is an inertia under its drive and an outer torque. Linearly implicit, of second order
/// (ROS2 of Verwer, Spee, Blom and Hundsdorfer, SIAM J. Sci. Comput. 20, 1999).
pub(super) struct Rig {
    pub(super) hydraulics: Hydraulics,
    pub(super) inertia_kg_m2: f64,
    pub(super) angles: JointAngles,
    pub(super) rates: JointAngles,
}

/// Inertia whose oscillation on the oil decays within a tenth of a second, kg m2.
pub(super) const LIGHT: f64 = 5.0;

pub(super) const STEP_S: f64 = 0.002;

/// Actuator with two radians of range, 2000 N m, and 0.65 rad/s when fully open.
pub(super) const SHOULDER: ActuatorInput = ActuatorInput {
    limits: Some(JointLimits { lower_rad: -1.0, upper_rad: 1.0 }),
    torque_max_n_m: 2000.0,
    rate_limit_rad_s: 0.5,
};

/// Returns a spec without friction, for tests of the oil only.
pub(super) fn slippery() -> HydraulicsSpec {
    HydraulicsSpec { coulomb_friction_ratio: 0.0, stiction_ratio: 0.0, ..HydraulicsSpec::default() }
}

impl Rig {
    /// Starts with all joints at 0, carrying `-torque_n_m`.
    pub(super) fn new(spec: &HydraulicsSpec, inputs: &[ActuatorInput], inertia_kg_m2: f64, torque_n_m: f64) -> Self {
        Self::with_step(spec, inputs, inertia_kg_m2, torque_n_m, STEP_S)
    }

    pub(super) fn with_step(
        spec: &HydraulicsSpec,
        inputs: &[ActuatorInput],
        inertia_kg_m2: f64,
        torque_n_m: f64,
        step_s: f64,
    ) -> Self {
        let mut hydraulics = Hydraulics::new(spec, inputs, step_s);
        let angles = JointAngles::from_fn(inputs.len(), |_| 0.0);
        hydraulics.balance(&angles, &JointAngles::from_fn(inputs.len(), |_| torque_n_m));
        Self { hydraulics, inertia_kg_m2, angles, rates: angles }
    }

    /// Advances by one step; `torque_n_m` acts from outside on every joint.
    pub(super) fn step(&mut self, command: f64, torque_n_m: f64) {
        let (angles, rates) = (self.angles, self.rates);
        self.hydraulics.step(&[command; MAX_JOINTS], &angles, &rates);
        let next: Vec<(f64, f64)> =
            (0..angles.len()).map(|j| self.advanced(j, angles[j], rates[j], torque_n_m)).collect();
        self.angles = JointAngles::from_fn(angles.len(), |j| next[j].0);
        self.rates = JointAngles::from_fn(angles.len(), |j| next[j].1);
    }

    pub(super) fn run(&mut self, seconds: f64, command: f64, torque_n_m: f64) {
        for _ in 0..(seconds / self.hydraulics.step_s).round() as u32 {
            self.step(command, torque_n_m);
        }
    }

    /// Returns the mean rates over another 0.1 s.
    pub(super) fn mean_rates(&mut self, command: f64, torque_n_m: f64) -> JointAngles {
        let before = self.angles;
        self.run(0.1, command, torque_n_m);
        JointAngles::from_fn(before.len(), |j| (self.angles[j] - before[j]) / 0.1)
    }

    pub(super) fn drive(&self) -> &Actuator {
        &self.hydraulics.actuators[0]
    }

    fn advanced(&self, joint: usize, angle_rad: f64, rate_rad_s: f64, torque_n_m: f64) -> (f64, f64) {
        let (h, load, i) = (self.hydraulics.step_s, self.hydraulics.load(joint), self.inertia_kg_m2);
        let gamma_h = (1.0 - std::f64::consts::FRAC_1_SQRT_2) * h;
        let (k, c) = (load.stiffness_n_m_rad / i, load.damping_n_m_s_rad / i);
        let slope = |q: f64, v: f64| (v, (torque_n_m + load.torque_n_m(q, v)) / i);
        // (1 - gamma h J) x = b with J = [0 1; -k -c].
        let solve = |b: (f64, f64)| {
            let v = (b.1 - gamma_h * k * b.0) / (1.0 + gamma_h * c + gamma_h * gamma_h * k);
            (b.0 + gamma_h * v, v)
        };
        let k1 = solve(slope(angle_rad, rate_rad_s));
        let ahead = slope(angle_rad + h * k1.0, rate_rad_s + h * k1.1);
        let k2 = solve((ahead.0 - 2.0 * k1.0, ahead.1 - 2.0 * k1.1));
        (angle_rad + h * (1.5 * k1.0 + 0.5 * k2.0), rate_rad_s + h * (1.5 * k1.1 + 0.5 * k2.1))
    }
}
