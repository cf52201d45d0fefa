//! The links of a URDF as a tree of frames, for viewers: their parents, and which of them move.

use std::collections::BTreeSet;

use nalgebra::Isometry3;

use super::error::RobotError;
use super::nominal::Robot;
use super::urdf::UrdfModel;
use crate::kinematics::{Attachment, LinkPoses};

/// Tree of the links of an arm's URDF; each link except the root is a child once.
#[derive(Clone, Debug)]
pub struct FrameTree {
    /// Name of the root link, the ancestor of all others.
    pub root: String,
    /// Pose of the root in the base frame, with other joints between them at zero.
    pub base_from_root: Isometry3<f64>,
    /// Links that are fixed to their parents: on fixed joints, or at zero of joints that are not the arm's.
    pub fixed: Vec<FixedFrame>,
    /// Links that the arm's joints move, base first.
    pub moving: Vec<MovingFrame>,
}

/// A frame that is fixed to its parent.
#[derive(Clone, Debug)]
pub struct FixedFrame {
    /// Name of the parent link.
    pub parent: String,
    /// Name of the link itself.
    pub child: String,
    /// Pose of the child in the parent's frame.
    pub parent_from_child: Isometry3<f64>,
}

/// A link that a joint of the arm moves.
#[derive(Clone, Debug)]
pub struct MovingFrame {
    /// Name of the parent link in the URDF.
    pub parent: String,
    /// Name of the link itself.
    pub child: String,
    /// Attachment of the parent link to the chain.
    parent_place: Attachment,
    /// Number of joints from the base to the child.
    body: usize,
}

impl MovingFrame {
    /// Pose of the child in its parent's frame, with the arm's links at `poses`.
    #[must_use]
    pub fn parent_from_child(&self, poses: &LinkPoses) -> Isometry3<f64> {
        poses.frame(&self.parent_place).inv_mul(poses.link(self.body))
    }
}

impl FrameTree {
    /// Builds the tree of an arm's URDF.
    ///
    /// # Errors
    /// [`RobotError`] if the URDF is invalid; that of a loaded robot is valid.
    pub fn of(robot: &Robot) -> Result<Self, RobotError> {
        let urdf = UrdfModel::parse(&robot.folder.join(&robot.urdf_name), robot.urdf_text.clone())?;
        let (mut root, mut base_from_root) = (robot.base_link.as_str(), Isometry3::identity());
        while let Some(&joint) = urdf.joint_of_child.get(root) {
            let joint = &urdf.robot.joints[joint];
            base_from_root *= joint.origin.isometry().inverse();
            root = &joint.parent;
        }
        let (mut fixed, mut moving) = (Vec::new(), Vec::new());
        for joint in &urdf.robot.joints {
            let (parent, child) = (joint.parent.clone(), joint.child.clone());
            let body = robot.chain.joints().iter().position(|moved| moved.name == joint.name).map(|at| at + 1);
            match body.zip(robot.links.get(&parent)) {
                Some((body, &parent_place)) => moving.push(MovingFrame { parent, child, parent_place, body }),
                None => fixed.push(FixedFrame { parent, child, parent_from_child: joint.origin.isometry() }),
            }
        }
        moving.sort_by_key(|frame| frame.body);
        Ok(Self { root: root.to_owned(), base_from_root, fixed, moving })
    }

    /// Names of all links.
    #[must_use]
    pub fn names(&self) -> BTreeSet<&str> {
        let children = self.fixed.iter().map(|frame| frame.child.as_str());
        children.chain(self.moving.iter().map(|frame| frame.child.as_str())).chain([self.root.as_str()]).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;
    use crate::joints::JointAngles;
    use crate::robot::load;

    /// The tree leads from the base to the pose of each link that the kinematics give.
    #[test]
    fn frames_lead_to_every_link_of_every_robot() {
        for name in ["titan4", "kraft-predator"] {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(name);
            let robot = load(&folder).expect("it reads");
            let tree = FrameTree::of(&robot).expect("a tree");
            assert_eq!(tree.names().len(), tree.fixed.len() + tree.moving.len() + 1, "each link has one parent");
            assert_eq!(tree.moving.len(), robot.n_joints());
            for seed in 0..20 {
                let angles =
                    JointAngles::from_fn(robot.n_joints(), |joint| (f64::from(seed) * 1.7 + joint as f64).sin());
                let poses = robot.chain.link_poses(&angles);
                let mut base_from = BTreeMap::from([(tree.root.as_str(), tree.base_from_root)]);
                let fixed = tree.fixed.iter().map(|f| (f.parent.as_str(), f.child.as_str(), f.parent_from_child));
                let moving = tree.moving.iter();
                let moving = moving.map(|f| (f.parent.as_str(), f.child.as_str(), f.parent_from_child(&poses)));
                let all: Vec<_> = fixed.chain(moving).collect();
                for _ in 0..all.len() {
                    for (parent, child, parent_from_child) in &all {
                        if let Some(base_from_parent) = base_from.get(parent).copied() {
                            base_from.insert(child, base_from_parent * parent_from_child);
                        }
                    }
                }
                for (link, place) in &robot.links {
                    let off = base_from[link.as_str()].inv_mul(&poses.frame(place));
                    assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-7, "{link}: {off}");
                }
            }
        }
    }
}
