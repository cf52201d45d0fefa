//! The chain and its forward kinematics.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};

use crate::joints::{JointAngles, MAX_JOINTS};

/// Joint range, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    pub lower_rad: f64,
    pub upper_rad: f64,
}

/// One moving joint: fixed transform from the parent joint's link frame, then a rotation about `axis`.
#[derive(Clone, Debug)]
pub struct ChainJoint {
    pub name: String,
    pub child_link: String,
    pub parent_from_joint: Isometry3<f64>,
    pub axis: Unit<Vector3<f64>>,
    /// `None` for a continuous joint.
    pub limits: Option<JointLimits>,
}

/// A frame fixed to the link behind the first `n_joints` joints (0: the base).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    pub n_joints: usize,
    pub link_from_frame: Isometry3<f64>,
}

/// A serial chain of revolute joints, base first.
#[derive(Clone, Debug)]
pub struct Chain {
    joints: Vec<ChainJoint>,
}

/// `base_from_link` for the base (index 0) and each joint's child link.
#[derive(Clone, Copy, Debug)]
pub struct LinkPoses {
    n_joints: usize,
    base_from_link: [Isometry3<f64>; MAX_JOINTS + 1],
    /// Unit axes of the joints in the base frame.
    axes: [Vector3<f64>; MAX_JOINTS],
}

impl Chain {
    pub(crate) fn new(joints: Vec<ChainJoint>) -> Self {
        assert!(joints.len() <= MAX_JOINTS, "readers of files check the number of joints");
        Self { joints }
    }

    #[must_use]
    pub fn joints(&self) -> &[ChainJoint] {
        &self.joints
    }

    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// Poses of all links at `angles` (rad).
    #[must_use]
    pub fn link_poses(&self, angles: &JointAngles) -> LinkPoses {
        debug_assert_eq!(angles.len(), self.joints.len());
        let mut poses = LinkPoses {
            n_joints: self.joints.len(),
            base_from_link: [Isometry3::identity(); MAX_JOINTS + 1],
            axes: [Vector3::zeros(); MAX_JOINTS],
        };
        for (i, (joint, &angle_rad)) in self.joints.iter().zip(angles.iter()).enumerate() {
            let base_from_joint = poses.base_from_link[i] * joint.parent_from_joint;
            poses.axes[i] = base_from_joint.rotation * joint.axis.into_inner();
            // The frames change inside the recursion, so it runs on raw isometries; callers name the frames.
            poses.base_from_link[i + 1] = base_from_joint * UnitQuaternion::from_axis_angle(&joint.axis, angle_rad);
        }
        poses
    }
}

impl LinkPoses {
    /// `base_from_link` of the base (0) or of the child link of joint `body - 1`.
    #[must_use]
    pub fn link(&self, body: usize) -> &Isometry3<f64> {
        &self.base_from_link[..=self.n_joints][body]
    }

    /// The pose of an attached frame in the base frame; the caller names it.
    #[must_use]
    pub fn frame(&self, attachment: &Attachment) -> Isometry3<f64> {
        self.link(attachment.n_joints) * attachment.link_from_frame
    }

    /// Axis of joint `joint` in the base frame, unit.
    #[must_use]
    pub fn axis(&self, joint: usize) -> &Vector3<f64> {
        &self.axes[..self.n_joints][joint]
    }

    /// Origin of joint `joint` in the base frame, m.
    #[must_use]
    pub fn joint_origin(&self, joint: usize) -> &Vector3<f64> {
        // A joint's rotation leaves its own origin where it is, so the child link's origin serves.
        &self.base_from_link[joint + 1].translation.vector
    }

    /// d(point)/d(angle of `joint`), m/rad, for a point (base frame) carried by that joint: `axis x (point - origin)`.
    #[must_use]
    pub fn point_jacobian(&self, joint: usize, point_m: &Vector3<f64>) -> Vector3<f64> {
        self.axis(joint).cross(&(point_m - self.joint_origin(joint)))
    }
}
