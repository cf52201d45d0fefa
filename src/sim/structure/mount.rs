//! Mount between vehicle and arm: springs and dampers along and about the base's axes, without mass.
//!
//! With `F` the wrench of base and arm on the vehicle, about the base's origin, `C` the compliances and `t` the damping
//! over the stiffness: `t dx/dt = C F - x`. The arm moves with the mount's deflection, not with its rate: the mount is
//! far stiffer than the arm moves fast.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::dynamics::Force;
use crate::spec::StructureSpec;

/// Deflection of the mount.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mount {
    rad_per_nm: Vector3<f64>,
    m_per_n: Vector3<f64>,
    damping_s: f64,
    turn_rad: Vector3<f64>,
    shift_m: Vector3<f64>,
}

impl Mount {
    pub(super) fn new(spec: &StructureSpec) -> Option<Self> {
        spec.mount_gives().then(|| Self {
            rad_per_nm: spec.mount_compliance_rad_per_nm.into(),
            m_per_n: spec.mount_compliance_m_per_n.into(),
            damping_s: spec.mount_damping_s,
            turn_rad: Vector3::zeros(),
            shift_m: Vector3::zeros(),
        })
    }

    /// Advances by `elapsed_s` under this wrench on the vehicle; returns the motion of the arm's base.
    pub(super) fn follow(&mut self, load: &Force, elapsed_s: f64) -> Isometry3<f64> {
        let share = elapsed_s / (elapsed_s + self.damping_s);
        self.turn_rad += (self.rad_per_nm.component_mul(&load.moment) - self.turn_rad) * share;
        self.shift_m += (self.m_per_n.component_mul(&load.force) - self.shift_m) * share;
        let turn = UnitQuaternion::from_scaled_axis(self.turn_rad);
        Isometry3::from_parts(Translation3::from(self.shift_m), turn)
    }
}
