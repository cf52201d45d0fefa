//! Poses of an arm's links and of the frames on them.

use nalgebra::{Isometry3, Vector3};

use crate::joints::MAX_JOINTS;

/// A frame fixed to the link distal to the first `n_joints` joints (0: the base).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Number of joints proximal to the link.
    pub n_joints: usize,
    /// Pose of the frame in the link's frame.
    pub link_from_frame: Isometry3<f64>,
}

impl Attachment {
    /// Returns the attachment that is the base frame.
    #[must_use]
    pub fn base() -> Self {
        Self { n_joints: 0, link_from_frame: Isometry3::identity() }
    }
}

/// Poses `base_from_link` of the base (index 0) and of each joint's child link.
#[derive(Clone, Copy, Debug)]
pub struct LinkPoses {
    pub(super) n_joints: usize,
    pub(super) base_from_link: [Isometry3<f64>; MAX_JOINTS + 1],
    /// Unit vectors of the joints' axes in the base frame.
    pub(super) axes: [Vector3<f64>; MAX_JOINTS],
    pub(super) slides: Slides,
}

/// Flags of the joints that slide, and their travel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slides {
    are_slides: [bool; MAX_JOINTS],
    out_m: [f64; MAX_JOINTS],
}

impl Slides {
    #[inline]
    pub fn add(&mut self, joint: usize, out_m: f64) {
        (self.are_slides[joint], self.out_m[joint]) = (true, out_m);
    }
}

impl LinkPoses {
    /// Number of moving joints.
    #[inline]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.n_joints
    }

    /// Returns `base_from_link` of the base (0) or of the child link of joint `body - 1`.
    #[inline]
    #[must_use]
    pub fn link(&self, body: usize) -> &Isometry3<f64> {
        &self.base_from_link[..=self.n_joints][body]
    }

    /// Returns these poses and axes in an attached frame instead of the base frame.
    #[must_use]
    pub fn in_frame(&self, attachment: &Attachment) -> Self {
        if *attachment == Attachment::base() {
            return *self;
        }
        let frame_from_base = self.frame(attachment).inverse();
        let mut moved = *self;
        for pose in &mut moved.base_from_link[..=self.n_joints] {
            *pose = frame_from_base * *pose;
        }
        for axis in &mut moved.axes[..self.n_joints] {
            *axis = frame_from_base.rotation * *axis;
        }
        moved
    }

    /// Returns the pose of an attached frame in the base frame; the caller names the frame.
    #[inline]
    #[must_use]
    pub fn frame(&self, attachment: &Attachment) -> Isometry3<f64> {
        self.link(attachment.n_joints) * attachment.link_from_frame
    }

    /// Returns true if joint `joint` slides along its axis.
    #[inline]
    #[must_use]
    pub fn is_slide(&self, joint: usize) -> bool {
        self.slides.are_slides[joint]
    }

    /// Returns the unit axis of joint `joint` in the base frame, about which it turns or along which it slides.
    #[inline]
    #[must_use]
    pub fn axis(&self, joint: usize) -> &Vector3<f64> {
        &self.axes[..self.n_joints][joint]
    }

    /// Returns the origin of the frame of joint `joint` on the parent link, in the base frame, m.
    #[inline]
    #[must_use]
    pub fn joint_origin(&self, joint: usize) -> Vector3<f64> {
        let child_m = self.base_from_link[joint + 1].translation.vector;
        // A rotation leaves the joint's own origin in place, so the child link's origin serves.
        if self.is_slide(joint) { child_m - self.axis(joint) * self.slides.out_m[joint] } else { child_m }
    }

    /// Returns d(point)/d(angle of `joint`), m/rad, for a point (base frame) that the joint carries:
    /// `axis x (point - origin)`. For a slide it is the axis, m/m.
    #[inline]
    #[must_use]
    pub fn point_jacobian(&self, joint: usize, point_m: &Vector3<f64>) -> Vector3<f64> {
        if self.is_slide(joint) {
            return *self.axis(joint);
        }
        self.axis(joint).cross(&(point_m - self.joint_origin(joint)))
    }

    /// Returns d(attitude)/d(angle of `joint`) of the bodies that the joint carries, about the base's axes, rad/rad:
    /// the axis. For a slide it is zero, rad/m.
    #[inline]
    #[must_use]
    pub fn turn_jacobian(&self, joint: usize) -> Vector3<f64> {
        if self.is_slide(joint) { Vector3::zeros() } else { *self.axis(joint) }
    }
}

#[cfg(test)]
mod tests;
