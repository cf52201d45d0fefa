//! The chain and its forward kinematics.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::joints::{JointAngles, MAX_JOINTS};
use crate::kinematics::gravity::{AboutAxes, ArmLoads, Sag};
use crate::kinematics::link_correction::LinkCorrections;
use crate::kinematics::link_poses::{Attachment, LinkPoses, Slides};
use crate::units::Unit;

/// Type of motion of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// Rotation about the joint's axis; the coordinate is an angle, rad.
    #[default]
    Revolute,
    /// Translation along the joint's axis (a slide); the coordinate is a distance, m. Names with `_rad` then mean m.
    Prismatic,
}

impl JointKind {
    /// Returns true for a slide.
    #[inline]
    #[must_use]
    pub fn is_slide(self) -> bool {
        self == Self::Prismatic
    }

    /// Returns true for a revolute joint. Files omit the kind of such a joint.
    #[must_use]
    pub fn is_turning(&self) -> bool {
        *self == Self::Revolute
    }

    /// Returns the unit of the coordinate, which decides how it is shown: as an angle or as a distance.
    #[must_use]
    pub fn unit(self) -> Unit {
        match self {
            Self::Revolute => Unit::Radians,
            Self::Prismatic => Unit::Metres,
        }
    }

    /// Returns the unit of the coordinate as stored: `rad` or `m`.
    #[must_use]
    pub fn si(self) -> &'static str {
        match self {
            Self::Revolute => "rad",
            Self::Prismatic => "m",
        }
    }
}

/// Joint range, rad; for a slide m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Smallest angle.
    pub lower_rad: f64,
    /// Largest angle.
    pub upper_rad: f64,
}

impl JointLimits {
    /// Returns true if the range has only one angle.
    #[must_use]
    pub fn are_locked(&self) -> bool {
        self.lower_rad == self.upper_rad
    }
}

/// One moving joint: a fixed transform from the parent joint's link frame, then a rotation about `axis` or a
/// translation along it.
#[derive(Clone, Debug)]
pub struct ChainJoint {
    /// Name of the joint in the URDF.
    pub name: String,
    /// Name of the link that it moves.
    pub child_link: String,
    /// Type of motion: rotation or translation.
    pub kind: JointKind,
    /// Pose of the joint's frame at angle zero in the frame of the parent link.
    pub parent_from_joint: Isometry3<f64>,
    /// Axis of rotation in the joint's frame; angles count by the right-hand rule. For a slide the direction of
    /// translation.
    pub axis: UnitVector3<f64>,
    /// Joint range; `None` for a continuous joint.
    pub limits: Option<JointLimits>,
}

impl ChainJoint {
    /// Returns the pose of the child link at `coordinate` (rad; m of a slide), for the joint's frame at
    /// `base_from_joint`.
    #[inline]
    fn moved(&self, base_from_joint: Isometry3<f64>, coordinate: f64) -> Isometry3<f64> {
        match self.kind {
            JointKind::Revolute => base_from_joint * UnitQuaternion::from_axis_angle(&self.axis, coordinate),
            JointKind::Prismatic => base_from_joint * Translation3::from(self.axis.into_inner() * coordinate),
        }
    }
}

/// A serial chain of revolute and prismatic joints, base first.
#[derive(Clone, Debug)]
pub struct Chain {
    joints: Vec<ChainJoint>,
    loads: ArmLoads,
    sag: Sag,
}

impl Chain {
    /// Builds the chain of these joints, base first; at most `MAX_JOINTS`.
    pub fn new(joints: Vec<ChainJoint>) -> Self {
        assert!(joints.len() <= MAX_JOINTS, "readers of files check the number of joints");
        Self { joints, loads: ArmLoads::default(), sag: Sag::default() }
    }

    /// Returns the chain with these loads.
    #[must_use]
    pub fn with_loads(self, loads: ArmLoads) -> Self {
        Self { loads, ..self }
    }

    /// Weights that the arm carries.
    #[must_use]
    pub fn loads(&self) -> &ArmLoads {
        &self.loads
    }

    /// Compliance of the arm.
    #[must_use]
    pub fn sag(&self) -> &Sag {
        &self.sag
    }

    /// Upper bound of the displacement of any distal point by the sag at the near end of each body, m. Base first; the
    /// base's near end is the mount. The bound assumes that every link is stretched out from each joint.
    #[must_use]
    pub fn most_sag_m(&self) -> [f64; MAX_JOINTS + 1] {
        let tool = &self.loads.tool;
        let length = |body: usize| match self.joints.get(body) {
            Some(next) => next.parent_from_joint.translation.vector.norm(),
            None => tool.link_from_frame.translation.vector.norm(),
        };
        let (mut reach_m, mut most_nm, mut weight_n, mut most_m) = (0.0, 0.0, 0.0, [0.0; MAX_JOINTS + 1]);
        for body in (0..=self.joints.len()).rev() {
            // Loads distal to the body's far end; the body's near end carries them.
            let load = &self.loads.links[body];
            let tool_n = if body == tool.n_joints { self.sag.tool_load_n.abs() } else { 0.0 };
            weight_n += tool_n;
            most_nm += weight_n * length(body) + load.moment_nm.norm();
            weight_n += load.weight_n.abs();
            reach_m += length(body);
            let compliance = match body.checked_sub(1) {
                Some(joint) => self.sag.joint_rad_per_nm[joint].abs(),
                None => self.sag.mount_rad_per_nm.iter().fold(0.0, |most: f64, by| most.max(by.abs())),
            };
            most_m[body] = compliance * most_nm * reach_m;
        }
        most_m
    }

    /// Returns the pose of the first joint on the base; the identity for a chain without joints.
    #[must_use]
    pub fn first_place(&self) -> Isometry3<f64> {
        self.joints.first().map_or_else(Isometry3::identity, |first| first.parent_from_joint)
    }

    /// Moves the first joint to this pose on the base.
    pub fn set_first_place(&mut self, base_from_joint: &Isometry3<f64>) {
        if let Some(first) = self.joints.first_mut() {
            first.parent_from_joint = *base_from_joint;
        }
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

    /// Returns the poses of all links at the angles `angles` of the sensors (rad; m of slides).
    #[must_use]
    pub fn link_poses(&self, angles: &JointAngles) -> LinkPoses {
        self.bent_poses(angles, (&self.sag, &self.loads), |_, joint| joint.parent_from_joint)
    }

    /// Returns the poses of all links with `corrections` of the nominal model; their sag replaces the chain's.
    #[must_use]
    pub fn corrected_link_poses(&self, angles: &JointAngles, corrections: &LinkCorrections) -> LinkPoses {
        self.corrected_link_poses_under(angles, corrections, &self.loads)
    }

    /// Returns the corrected poses under other loads, such as [`ArmLoads::with_up`] of a base that leans.
    #[must_use]
    pub fn corrected_link_poses_under(
        &self,
        angles: &JointAngles,
        corrections: &LinkCorrections,
        loads: &ArmLoads,
    ) -> LinkPoses {
        let mut places = [Isometry3::identity(); MAX_JOINTS];
        for ((place, joint), correction) in places.iter_mut().zip(&self.joints).zip(&corrections.places) {
            *place = correction.applied_to(&joint.parent_from_joint);
        }
        self.bent_poses(angles, (&corrections.sag, loads), |i, _| places[i])
    }

    /// Returns the chain with `corrections` of the nominal model.
    #[must_use]
    pub fn corrected(&self, corrections: &LinkCorrections) -> Self {
        let mut corrected = Self { sag: corrections.sag, ..self.clone() };
        for (joint, correction) in corrected.joints.iter_mut().zip(&corrections.places) {
            joint.parent_from_joint = correction.applied_to(&joint.parent_from_joint);
        }
        corrected
    }

    #[inline]
    fn bent_poses(
        &self,
        angles: &JointAngles,
        (sag, loads): (&Sag, &ArmLoads),
        parent_from_joint: impl Fn(usize, &ChainJoint) -> Isometry3<f64>,
    ) -> LinkPoses {
        let straight = self.link_poses_by(angles, &Isometry3::identity(), &parent_from_joint);
        if sag.is_rigid() {
            return straight;
        }
        // The load of the bent arm: the straight arm's load is wrong by as much as bending turns a link.
        let mut poses = straight;
        for _ in 0..2 {
            let bend: AboutAxes = sag.bend(&loads.torques(&poses, sag.tool_load_n));
            let bent = JointAngles::from_fn(angles.len(), |joint| angles[joint] + bend.joints[joint]);
            let base = Isometry3::from_parts(Translation3::identity(), bend.base_turn());
            poses = self.link_poses_by(&bent, &base, &parent_from_joint);
        }
        poses
    }

    /// Returns the chain in which joint number `joint` is locked at `angle_rad`.
    #[must_use]
    pub fn locked(&self, joint: usize, angle_rad: f64) -> Self {
        let mut joints = self.joints.clone();
        joints[joint].limits = Some(JointLimits { lower_rad: angle_rad, upper_rad: angle_rad });
        Self { joints, ..self.clone() }
    }

    #[inline]
    fn link_poses_by(
        &self,
        angles: &JointAngles,
        base: &Isometry3<f64>,
        parent_from_joint: &impl Fn(usize, &ChainJoint) -> Isometry3<f64>,
    ) -> LinkPoses {
        debug_assert_eq!(angles.len(), self.joints.len());
        let mut poses = LinkPoses {
            n_joints: self.joints.len(),
            base_from_link: [*base; MAX_JOINTS + 1],
            axes: [Vector3::zeros(); MAX_JOINTS],
            slides: Slides::default(),
        };
        for (i, (joint, &angle_rad)) in self.joints.iter().zip(angles.iter()).enumerate() {
            let base_from_joint = poses.base_from_link[i] * parent_from_joint(i, joint);
            poses.axes[i] = base_from_joint.rotation * joint.axis.into_inner();
            // The frames change inside the recursion, so it runs on raw isometries; callers name the frames.
            poses.base_from_link[i + 1] = joint.moved(base_from_joint, angle_rad);
            if joint.kind.is_slide() {
                poses.slides.add(i, angle_rad);
            }
        }
        poses
    }

    /// Returns the pose of one attached frame in the base frame at `angles` (rad; m of slides). It equals that of
    /// [`Self::link_poses`] to the bit.
    #[inline]
    #[must_use]
    pub fn frame(&self, angles: &JointAngles, attachment: &Attachment) -> Isometry3<f64> {
        if !self.sag.is_rigid() {
            return self.link_poses(angles).frame(attachment);
        }
        let mut base_from_link = Isometry3::identity();
        for (joint, &angle_rad) in self.joints[..attachment.n_joints].iter().zip(angles.iter()) {
            base_from_link = joint.moved(base_from_link * joint.parent_from_joint, angle_rad);
        }
        base_from_link * attachment.link_from_frame
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
            kind: JointKind::Revolute,
            parent_from_joint,
            axis: UnitVector3::new_normalize(parent_from_joint.translation.vector),
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
