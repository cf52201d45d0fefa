//! Load about one joint during a step: a torque, linear in the joint's angle and rate.

/// Torque about a joint: `torque = constant - stiffness angle - damping rate`. The integrator takes the linear part
/// implicitly, so that it may be as stiff as oil.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointLoad {
    /// Torque at angle and rate zero.
    pub constant_n_m: f64,
    /// Stiffness of the spring towards angle zero.
    pub stiffness_n_m_rad: f64,
    /// Damping of the damper.
    pub damping_n_m_s_rad: f64,
}

impl JointLoad {
    /// Returns the load of a spring and a damper towards `rest_rad`, which moves at `rest_rate_rad_s`.
    #[must_use]
    pub fn spring(stiffness_n_m_rad: f64, damping_n_m_s_rad: f64, rest_rad: f64, rest_rate_rad_s: f64) -> Self {
        let constant_n_m = stiffness_n_m_rad * rest_rad + damping_n_m_s_rad * rest_rate_rad_s;
        Self { constant_n_m, stiffness_n_m_rad, damping_n_m_s_rad }
    }

    /// Returns the torque at an angle and a rate, N m.
    #[must_use]
    pub fn torque_n_m(&self, angle_rad: f64, rate_rad_s: f64) -> f64 {
        self.constant_n_m - self.stiffness_n_m_rad * angle_rad - self.damping_n_m_s_rad * rate_rad_s
    }
}

impl std::ops::Add for JointLoad {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            constant_n_m: self.constant_n_m + other.constant_n_m,
            stiffness_n_m_rad: self.stiffness_n_m_rad + other.stiffness_n_m_rad,
            damping_n_m_s_rad: self.damping_n_m_s_rad + other.damping_n_m_s_rad,
        }
    }
}
