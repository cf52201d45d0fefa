//! The camera's motion during the exposure.
//!
//! The joints' rates are constant while the shutter is open. `tag_projection` and the renderer average over these
//! poses.

use nalgebra::Isometry3;

use armcal_core::kinematics::{Attachment, Chain};
use armcal_core::streams::JointAngles;

/// Joint angles when the shutter closes, and rates while it is open.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArmMotion<'a> {
    pub chain: &'a Chain,
    pub angles: JointAngles,
    /// Joint rates, rad/s.
    pub rates: JointAngles,
}

/// Exposure time of a camera on its mount.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exposure {
    pub exposure_s: f64,
    /// Mount of the camera as built.
    pub mount: Attachment,
}

impl Exposure {
    /// Returns `base_from_camera` when the shutter opened and halfway, relative to a tag on `body` (0: the base) at its
    /// pose when the shutter closes. `None` without exposure time.
    pub(super) fn earlier_poses(
        &self,
        base_from_camera: &Isometry3<f64>,
        motion: &ArmMotion,
        body: usize,
    ) -> Option<[Isometry3<f64>; 2]> {
        if self.exposure_s <= 0.0 {
            return None;
        }
        let ArmMotion { chain, angles, rates } = motion;
        // The nominal model gives the motion relative to its end; the pose at the end is that of the actual bodies.
        let body_from_camera = |earlier_s: f64| {
            let then = JointAngles::from_fn(angles.len(), |j| angles[j] - earlier_s * rates[j]);
            let poses = chain.link_poses(&then);
            poses.link(body).inverse() * poses.frame(&self.mount)
        };
        let from_end = base_from_camera * body_from_camera(0.0).inverse();
        Some([from_end * body_from_camera(self.exposure_s), from_end * body_from_camera(0.5 * self.exposure_s)])
    }

    /// Returns `base_from_camera` when the shutter opened, halfway, and when it closes; the three are equal without
    /// exposure time.
    pub(super) fn poses(
        &self,
        base_from_camera: &Isometry3<f64>,
        motion: &ArmMotion,
        body: usize,
    ) -> [Isometry3<f64>; 3] {
        let earlier = self.earlier_poses(base_from_camera, motion, body);
        earlier.map_or([*base_from_camera; 3], |[start, middle]| [start, middle, *base_from_camera])
    }
}
