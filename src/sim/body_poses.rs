//! True poses of the arm's bodies.

use nalgebra::Isometry3;

use armcal_core::kinematics::{Attachment, LinkPoses};
use armcal_core::streams::MAX_JOINTS;

/// Pose `base_from_link` of the base (0) and of each link, in base axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct BodyPoses {
    base_from_link: [Isometry3<f64>; MAX_JOINTS + 1],
}

impl BodyPoses {
    /// Builds the poses from a function of the body's index, 0..=n_joints.
    pub(super) fn from_fn(n_joints: usize, pose: impl Fn(usize) -> Isometry3<f64>) -> Self {
        let mut base_from_link = [Isometry3::identity(); MAX_JOINTS + 1];
        for (body, slot) in base_from_link.iter_mut().enumerate().take(n_joints + 1).skip(1) {
            *slot = pose(body);
        }
        Self { base_from_link }
    }

    /// Returns the nominal model's poses, for decisions before anything moves.
    pub(super) fn drawn(n_joints: usize, poses: &LinkPoses) -> Self {
        Self::from_fn(n_joints, |body| *poses.link(body))
    }

    pub(super) fn link(&self, body: usize) -> &Isometry3<f64> {
        &self.base_from_link[body]
    }

    pub(super) fn frame(&self, attachment: &Attachment) -> Isometry3<f64> {
        self.link(attachment.n_joints) * attachment.link_from_frame
    }
}
