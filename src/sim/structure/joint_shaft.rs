//! Compliance between a joint's sensor and its link: a shaft without mass, in series with the drive.
//!
//! The sensor is on the shaft: `q = theta + e + c T` with `theta` the link's angle and `c` the shaft's compliance. `e =
//! +-p/2` is the end of its backlash on the side where it carries. The drive is linear in the shaft's state over a
//! step:
//!
//! ```text
//! T = a - k q - d dq/dt      hence      c d dT/dt = -(1 + c k) T + a - k (theta + e) - d dtheta/dt
//! T_inf = (a - k (theta + e) - d dtheta/dt) / (1 + c k)        lambda = (1 + c k) / (c d)
//! mean over h:  T = (1 - f) T_inf + f T_0        f = (1 - exp(-lambda h)) / (lambda h)
//! ```
//!
//! The mean is linear in the link's angle and rate, so that the integrator takes it as the load about the joint. Within
//! the backlash the shaft carries no torque.

use crate::dynamics::JointLoad;

/// Shaft of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct JointShaft {
    compliance_rad_per_nm: f64,
    half_play_rad: f64,
    /// Shaft's angle less the link's.
    pub(super) twist_rad: f64,
    pub(super) twist_rate_rad_s: f64,
    /// Torque of the shaft at the step's start.
    torque_n_m: f64,
    /// Load of the drive on the shaft during the step.
    drive: JointLoad,
    /// State of a shaft that carries during the step; `None` within the backlash.
    carrying: Option<Carrying>,
}

/// Course of the carried torque over a step.
#[derive(Clone, Copy, Debug)]
struct Carrying {
    /// End of the backlash at which the shaft carries.
    edge_rad: f64,
    /// Torque `T_inf`, from the link's angle and rate.
    settled: JointLoad,
    settled_at_start_n_m: f64,
    /// Factor `exp(-lambda h)`.
    kept: f64,
    /// Mean of the factor over the step.
    mean_kept: f64,
}

impl JointShaft {
    pub(super) fn new(compliance_rad_per_nm: f64, play_rad: f64) -> Self {
        Self { compliance_rad_per_nm, half_play_rad: 0.5 * play_rad, ..Self::default() }
    }

    pub(super) fn is_rigid(&self) -> bool {
        self.compliance_rad_per_nm == 0.0
    }

    /// Sets the shaft to rest with this torque on its link; returns the twist.
    pub(super) fn settle(&mut self, torque_n_m: f64) -> f64 {
        self.torque_n_m = torque_n_m;
        self.twist_rad = self.compliance_rad_per_nm * torque_n_m + self.half_play_rad.copysign(torque_n_m);
        self.twist_rate_rad_s = 0.0;
        self.twist_rad
    }

    /// Returns the load about the link during a step in which `drive` acts on the shaft; `link` is the link's angle and
    /// rate at the step's start.
    pub(super) fn load(&mut self, drive: JointLoad, link: [f64; 2], step_s: f64) -> JointLoad {
        self.drive = drive;
        self.carrying = None;
        if self.twist_rad.abs() < self.half_play_rad {
            return JointLoad::default();
        }
        let JointLoad { constant_n_m, stiffness_n_m_rad: k, damping_n_m_s_rad: d } = drive;
        let edge_rad = self.twist_rad.clamp(-self.half_play_rad, self.half_play_rad);
        let given = 1.0 + self.compliance_rad_per_nm * k;
        let settled = scaled(JointLoad { constant_n_m: constant_n_m - k * edge_rad, ..drive }, 1.0 / given);
        let relaxed = given * step_s / (self.compliance_rad_per_nm * d);
        let (kept, mean_kept) =
            if relaxed.is_finite() { ((-relaxed).exp(), -(-relaxed).exp_m1() / relaxed) } else { (0.0, 0.0) };
        let settled_at_start_n_m = settled.torque_n_m(link[0], link[1]);
        self.carrying = Some(Carrying { edge_rad, settled, settled_at_start_n_m, kept, mean_kept });
        let mut load = scaled(settled, 1.0 - mean_kept);
        load.constant_n_m += mean_kept * self.torque_n_m;
        load
    }

    /// Takes the link's state at the step's end.
    pub(super) fn follow(&mut self, angle_rad: f64, rate_rad_s: f64, step_s: f64) {
        let before_rad = self.twist_rad;
        (self.torque_n_m, self.twist_rad) = match &self.carrying {
            Some(Carrying { edge_rad, settled, settled_at_start_n_m, kept, mean_kept }) => {
                let settled_n_m = settled.torque_n_m(angle_rad, rate_rad_s);
                let risen_n_m = settled_n_m - settled_at_start_n_m;
                let torque_n_m = settled_n_m - mean_kept * risen_n_m + kept * (self.torque_n_m - settled_at_start_n_m);
                (torque_n_m, edge_rad + self.compliance_rad_per_nm * torque_n_m)
            }
            None => (0.0, self.free_twist_rad(angle_rad, rate_rad_s, step_s)),
        };
        self.twist_rate_rad_s = (self.twist_rad - before_rad) / step_s;
    }

    /// Returns the twist within the backlash: the drive moves the shaft until its torque is zero, or to the backlash's
    /// end.
    fn free_twist_rad(&self, angle_rad: f64, rate_rad_s: f64, step_s: f64) -> f64 {
        let damping = self.drive.damping_n_m_s_rad / step_s;
        let stiffness = self.drive.stiffness_n_m_rad + damping;
        let torque_n_m = self.drive.torque_n_m(angle_rad, rate_rad_s) + damping * self.twist_rad;
        let free_rad = if stiffness > 0.0 { torque_n_m / stiffness } else { torque_n_m.signum() };
        free_rad.clamp(-self.half_play_rad, self.half_play_rad)
    }
}

fn scaled(load: JointLoad, by: f64) -> JointLoad {
    JointLoad {
        constant_n_m: by * load.constant_n_m,
        stiffness_n_m_rad: by * load.stiffness_n_m_rad,
        damping_n_m_s_rad: by * load.damping_n_m_s_rad,
    }
}
