//! The chain and its forward kinematics.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};

use crate::joints::{JointAngles, MAX_JOINTS};
use crate::kinematics::link_correction::LinkCorrections;

/// Joint range, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Smallest angle.
    pub lower_rad: f64,
    /// Largest angle.
    pub upper_rad: f64,
}

impl JointLimits {
    /// Whether there is but one angle.
    #[must_use]
    pub fn are_locked(&self) -> bool {
        self.lower_rad == self.upper_rad
    }
}

/// One moving joint: fixed transform from the parent joint's link frame, then a rotation about `axis`.
#[derive(Clone, Debug)]
pub struct ChainJoint {
    /// Name of the joint in the URDF.
    pub name: String,
    /// Name of the link that it moves.
    pub child_link: String,
    /// Pose of the joint's frame at angle zero in the frame of the parent link.
    pub parent_from_joint: Isometry3<f64>,
    /// Axis of rotation in the joint's frame; angles count by the right-hand rule.
    pub axis: Unit<Vector3<f64>>,
    /// `None` for a continuous joint.
    pub limits: Option<JointLimits>,
}

/// A frame fixed to the link behind the first `n_joints` joints (0: the base).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Number of joints proximal to the link.
    pub n_joints: usize,
    /// Pose of the frame in the link's frame.
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
    /// A chain of these joints, base first; at most `MAX_JOINTS`.
    pub fn new(joints: Vec<ChainJoint>) -> Self {
        assert!(joints.len() <= MAX_JOINTS, "readers of files check the number of joints");
        Self { joints }
    }

    /// The joints, base first.
    #[inline]
    #[must_use]
    pub fn joints(&self) -> &[ChainJoint] {
        &self.joints
    }

    /// Number of moving joints.
    #[inline]
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.joints.len()
    }

    /// Poses of all links at `angles` (rad).
    #[must_use]
    pub fn link_poses(&self, angles: &JointAngles) -> LinkPoses {
        self.link_poses_by(angles, |_, joint| joint.parent_from_joint)
    }

    /// The same for the arm with `corrections` of its drawing.
    #[must_use]
    pub fn corrected_link_poses(&self, angles: &JointAngles, corrections: &LinkCorrections) -> LinkPoses {
        self.link_poses_by(angles, |i, joint| corrections[i].applied_to(&joint.parent_from_joint))
    }

    /// The chain with `corrections` of its drawing.
    #[must_use]
    pub fn corrected(&self, corrections: &LinkCorrections) -> Self {
        let mut joints = self.joints.clone();
        for (joint, correction) in joints.iter_mut().zip(corrections) {
            joint.parent_from_joint = correction.applied_to(&joint.parent_from_joint);
        }
        Self { joints }
    }

    /// The chain whose joint number `joint` has the range of one angle, `angle_rad`.
    #[must_use]
    pub fn locked(&self, joint: usize, angle_rad: f64) -> Self {
        let mut joints = self.joints.clone();
        joints[joint].limits = Some(JointLimits { lower_rad: angle_rad, upper_rad: angle_rad });
        Self { joints }
    }

    #[inline]
    fn link_poses_by(
        &self,
        angles: &JointAngles,
        parent_from_joint: impl Fn(usize, &ChainJoint) -> Isometry3<f64>,
    ) -> LinkPoses {
        debug_assert_eq!(angles.len(), self.joints.len());
        let mut poses = LinkPoses {
            n_joints: self.joints.len(),
            base_from_link: [Isometry3::identity(); MAX_JOINTS + 1],
            axes: [Vector3::zeros(); MAX_JOINTS],
        };
        for (i, (joint, &angle_rad)) in self.joints.iter().zip(angles.iter()).enumerate() {
            let base_from_joint = poses.base_from_link[i] * parent_from_joint(i, joint);
            poses.axes[i] = base_from_joint.rotation * joint.axis.into_inner();
            // The frames change inside the recursion, so it runs on raw isometries; callers name the frames.
            poses.base_from_link[i + 1] = base_from_joint * UnitQuaternion::from_axis_angle(&joint.axis, angle_rad);
        }
        poses
    }

    /// The pose of one attached frame in the base frame at `angles` (rad), to the bit that of [`Self::link_poses`].
    #[inline]
    #[must_use]
    pub fn frame(&self, angles: &JointAngles, attachment: &Attachment) -> Isometry3<f64> {
        let mut base_from_link = Isometry3::identity();
        for (joint, &angle_rad) in self.joints[..attachment.n_joints].iter().zip(angles.iter()) {
            let turn = UnitQuaternion::from_axis_angle(&joint.axis, angle_rad);
            base_from_link = base_from_link * joint.parent_from_joint * turn;
        }
        base_from_link * attachment.link_from_frame
    }
}

impl LinkPoses {
    /// `base_from_link` of the base (0) or of the child link of joint `body - 1`.
    #[inline]
    #[must_use]
    pub fn link(&self, body: usize) -> &Isometry3<f64> {
        &self.base_from_link[..=self.n_joints][body]
    }

    /// The pose of an attached frame in the base frame; the caller names it.
    #[inline]
    #[must_use]
    pub fn frame(&self, attachment: &Attachment) -> Isometry3<f64> {
        self.link(attachment.n_joints) * attachment.link_from_frame
    }

    /// Axis of joint `joint` in the base frame, unit.
    #[inline]
    #[must_use]
    pub fn axis(&self, joint: usize) -> &Vector3<f64> {
        &self.axes[..self.n_joints][joint]
    }

    /// Origin of joint `joint` in the base frame, m.
    #[inline]
    #[must_use]
    pub fn joint_origin(&self, joint: usize) -> &Vector3<f64> {
        // A joint's rotation leaves its own origin where it is, so the child link's origin serves.
        &self.base_from_link[joint + 1].translation.vector
    }

    /// d(point)/d(angle of `joint`), m/rad, for a point (base frame) carried by that joint: `axis x (point - origin)`.
    #[inline]
    #[must_use]
    pub fn point_jacobian(&self, joint: usize, point_m: &Vector3<f64>) -> Vector3<f64> {
        self.axis(joint).cross(&(point_m - self.joint_origin(joint)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Translation3;
    use rand::RngExt;

    #[test]
    fn a_frame_alone_is_to_the_bit_that_of_all_links() {
        let mut rng = crate::stats::stream_rng(1, "chain");
        let mut draw = || std::array::from_fn::<f64, 3, _>(|_| rng.random_range(-1.0..1.0));
        let mut pose = || {
            let (place, turn) = (draw(), draw());
            Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_scaled_axis(Vector3::from(turn)))
        };
        let joint = |k: usize, parent_from_joint: Isometry3<f64>| ChainJoint {
            name: format!("joint {k}"),
            child_link: format!("link {k}"),
            parent_from_joint,
            axis: Unit::new_normalize(parent_from_joint.translation.vector),
            limits: None,
        };
        let chain = Chain::new((0..6).map(|k| joint(k, pose())).collect());
        for n_joints in 0..=6 {
            let attachment = Attachment { n_joints, link_from_frame: pose() };
            let angles = JointAngles::from_fn(6, |j| pose().translation.vector[j % 3]);
            assert_eq!(chain.frame(&angles, &attachment), chain.link_poses(&angles).frame(&attachment));
        }
    }
}
