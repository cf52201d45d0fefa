//! What gives between a joint's sensor and its link: a shaft without mass, in series with the drive.
//!
//! The sensor sits on the shaft, `q = theta + e + c T` with `theta` the link's angle, `c` the shaft's compliance and
//! `e = +-p/2` the end of its play on the side where it carries. The drive is linear in the shaft's state over a step:
//!
//! ```text
//! T = a - k q - d dq/dt      hence      c d dT/dt = -(1 + c k) T + a - k (theta + e) - d dtheta/dt
//! T_inf = (a - k (theta + e) - d dtheta/dt) / (1 + c k)        lambda = (1 + c k) / (c d)
//! mean over h:  T = (1 - f) T_inf + f T_0        f = (1 - exp(-lambda h)) / (lambda h)
//! ```
//!
//! The mean is linear in the link's angle and rate, so that the integrator takes it as the load about the joint. Within
//! the play nothing is carried.

use crate::dynamics::JointLoad;

/// The shaft of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct JointShaft {
    compliance_rad_per_nm: f64,
    half_play_rad: f64,
    /// The shaft's angle less the link's.
    pub(super) twist_rad: f64,
    pub(super) twist_rate_rad_s: f64,
    /// What it carries at the step's start.
    torque_n_m: f64,
    /// On the shaft during the step.
    drive: JointLoad,
    /// During the step; none within the play.
    carrying: Option<Carrying>,
}

/// How the carried torque goes over a step.
#[derive(Clone, Copy, Debug)]
struct Carrying {
    /// End of the play where the shaft carries.
    edge_rad: f64,
    /// `T_inf`, of the link's angle and rate.
    settled: JointLoad,
    settled_at_start_n_m: f64,
    /// `exp(-lambda h)`.
    kept: f64,
    /// Its mean over the step.
    mean_kept: f64,
}

impl JointShaft {
    pub(super) fn new(compliance_rad_per_nm: f64, play_rad: f64) -> Self {
        Self { compliance_rad_per_nm, half_play_rad: 0.5 * play_rad, ..Self::default() }
    }

    pub(super) fn is_rigid(&self) -> bool {
        self.compliance_rad_per_nm == 0.0
    }

    /// At rest, with this torque on its link: gives the twist.
    pub(super) fn settle(&mut self, torque_n_m: f64) -> f64 {
        self.torque_n_m = torque_n_m;
        self.twist_rad = self.compliance_rad_per_nm * torque_n_m + self.half_play_rad.copysign(torque_n_m);
        self.twist_rate_rad_s = 0.0;
        self.twist_rad
    }

    /// What acts about the link during a step in which `drive` acts on the shaft; `link` is the link's angle and rate
    /// at the step's start.
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

    /// Within the play the drive moves the shaft until it gives no torque, or to the play's end.
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
