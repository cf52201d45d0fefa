//! Stops at the ends of a joint's range: stiff, one-sided, without bounce.

use crate::dynamics::JointLoad;
use crate::spec::HydraulicsSpec;
use armcal_core::kinematics::JointLimits;

/// Spring and damper beyond the limits. The damping over the stiffness, [`CUSHION_S`], is long against the bounce
/// (`2 sqrt(I/k)`, 14 ms for 50 kg m2 on 1e6 N m/rad), so that the joint comes back no faster than the cushion fills;
/// the stop never pulls.
#[derive(Clone, Copy, Debug)]
pub(super) struct EndStop {
    limits: Option<JointLimits>,
    stiffness_n_m_rad: f64,
}

/// Time constant of the stop's recovery, s. Assumed.
const CUSHION_S: f64 = 0.02;

impl EndStop {
    pub(super) fn new(spec: &HydraulicsSpec, limits: Option<JointLimits>) -> Self {
        let stiffness_n_m_rad = spec.end_stop_stiffness_n_m_rad;
        Self { limits: limits.filter(|_| stiffness_n_m_rad > 0.0), stiffness_n_m_rad }
    }

    /// Returns true if the joint has stops.
    pub(super) fn is_on(&self) -> bool {
        self.limits.is_some()
    }

    /// Returns the load during a step that starts with this state.
    pub(super) fn load(&self, angle_rad: f64, rate_rad_s: f64) -> JointLoad {
        let Some(limits) = self.limits else { return JointLoad::default() };
        let limit_rad = angle_rad.clamp(limits.lower_rad, limits.upper_rad);
        let depth_rad = angle_rad - limit_rad;
        if depth_rad == 0.0 {
            return JointLoad::default();
        }
        // A joint that leaves faster than the cushion fills is released, not held back.
        let is_leaving = depth_rad * rate_rad_s < 0.0;
        let damping_s = if is_leaving { CUSHION_S.min(-depth_rad / rate_rad_s) } else { CUSHION_S };
        JointLoad::spring(self.stiffness_n_m_rad, damping_s * self.stiffness_n_m_rad, limit_rad, 0.0)
    }
}
