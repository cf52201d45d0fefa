//! Corrections of the nominal model: poses of joints on their parent links, and sag of the arm.

use std::ops::{Index, IndexMut};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::joints::MAX_JOINTS;
use crate::kinematics::gravity::Sag;

/// Correction of one joint's pose in its parent link, along and about the parent link's axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkCorrection {
    /// Translation of the joint's origin, m.
    pub shift_m: Vector3<f64>,
    /// Rotation vector of the joint about its origin, rad.
    pub turn_rad: Vector3<f64>,
}

/// Corrections of a whole arm's nominal model, indexed by joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkCorrections {
    /// Pose correction of every joint, base first.
    pub places: [LinkCorrection; MAX_JOINTS],
    /// Compliance of the arm under its weight.
    pub sag: Sag,
}

impl Index<usize> for LinkCorrections {
    type Output = LinkCorrection;

    #[inline]
    fn index(&self, joint: usize) -> &LinkCorrection {
        &self.places[joint]
    }
}

impl IndexMut<usize> for LinkCorrections {
    fn index_mut(&mut self, joint: usize) -> &mut LinkCorrection {
        &mut self.places[joint]
    }
}

impl LinkCorrection {
    /// Returns the corrected `parent_from_joint`.
    #[inline]
    #[must_use]
    pub fn applied_to(&self, parent_from_joint: &Isometry3<f64>) -> Isometry3<f64> {
        let shift = Translation3::from(parent_from_joint.translation.vector + self.shift_m);
        Isometry3::from_parts(shift, UnitQuaternion::from_scaled_axis(self.turn_rad) * parent_from_joint.rotation)
    }
}
