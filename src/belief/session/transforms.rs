//! The believed arm as transforms, for viewers.

use crate::session::constants::transforms::{REST_SPACING_S, SPACING_S, STEP_RAD};
use nalgebra::{Isometry3, UnitQuaternion};

use armcal_core::kinematics::{Attachment, Chain, LinkPoses};
use armcal_core::log::ros::{TfMessage, TransformStamped};
use armcal_core::robot::{FrameTree, Robot};
use armcal_core::streams::{JointAngles, JointStateBelief};
use armcal_core::time::Stamp;

/// Poses of the moving links and the camera by the belief, at most ten times a second.
pub struct BelievedFrames {
    tree: FrameTree,
    chain: Chain,
    /// The camera's frame, its link and its mount on that link; `None` if the URDF has a link of that name.
    camera: Option<CameraFrame>,
    /// Time and angles of the last transforms.
    drawn: Option<(Stamp, JointAngles)>,
}

struct CameraFrame {
    parent: String,
    child: String,
    mount: Attachment,
}

impl BelievedFrames {
    /// Returns the frames of the nominal arm, with the camera in the frame named `camera_frame`.
    #[must_use]
    pub fn new(robot: &Robot, tree: FrameTree, camera_frame: &str) -> Self {
        let mount = robot.camera.mount;
        let parent = match mount.n_joints.checked_sub(1) {
            Some(joint) => robot.chain.joints()[joint].child_link.clone(),
            None => robot.base_link.clone(),
        };
        let is_free = !tree.names().contains(camera_frame);
        let camera = is_free.then(|| CameraFrame { parent, child: camera_frame.to_owned(), mount });
        Self { tree, chain: robot.chain.clone(), camera, drawn: None }
    }

    /// Adopts `robot` from now on: its calibrated links and camera mount.
    pub(crate) fn believe(&mut self, robot: &Robot) {
        self.chain = robot.chain.clone();
        if let Some(camera) = &mut self.camera {
            camera.mount = robot.camera.mount;
        }
        self.drawn = None;
    }

    /// Returns the transforms at these angles; `None` if the last ones are too recent, or the arm has not moved since.
    pub(crate) fn hear(&mut self, states: &JointStateBelief) -> Option<TfMessage> {
        let JointStateBelief { stamp, angles } = states;
        if let Some((drawn_at, drawn)) = &self.drawn {
            let since_s = stamp.since_s(*drawn_at);
            let is_at_rest = drawn.max_abs_difference(angles) < STEP_RAD;
            if since_s < SPACING_S || (is_at_rest && since_s < REST_SPACING_S) {
                return None;
            }
        }
        self.drawn = Some((*stamp, *angles));
        self.transforms(*stamp, &self.chain.link_poses(angles))
    }

    /// Returns `None` if the stamp has no ROS form: the message with that stamp is refused elsewhere.
    fn transforms(&self, stamp: Stamp, poses: &LinkPoses) -> Option<TfMessage> {
        let links = self.tree.moving.iter().map(|frame| {
            let place = single_precision(&frame.parent_from_child(poses));
            TransformStamped::new(stamp, [&frame.parent, &frame.child], &place).ok()
        });
        let camera = self.camera.iter().map(|camera| {
            TransformStamped::new(stamp, [&camera.parent, &camera.child], &camera.mount.link_from_frame).ok()
        });
        Some(TfMessage { transforms: links.chain(camera).collect::<Option<_>>()? })
    }
}

/// Rounds the pose to single precision: its bytes compress, and no viewer has more.
fn single_precision(pose: &Isometry3<f64>) -> Isometry3<f64> {
    let short = |value: f64| f64::from(value as f32);
    let turn = UnitQuaternion::new_unchecked(pose.rotation.coords.map(short).into());
    Isometry3::from_parts(pose.translation.vector.map(short).into(), turn)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use armcal_core::kinematics::LinkCorrections;
    use armcal_core::robot::load;
    use armcal_core::time::SIMULATION_EPOCH;
    use nalgebra::{Translation3, Vector3};

    fn frames() -> (Robot, BelievedFrames) {
        let robot = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/titan4")).expect("it reads");
        let tree = FrameTree::of(&robot).expect("a tree");
        let frames = BelievedFrames::new(&robot, tree, "camera_wrist");
        (robot, frames)
    }

    fn state(robot: &Robot, at_s: f64, angle_rad: f64) -> JointStateBelief {
        let angles = JointAngles::from_fn(robot.n_joints(), |_| angle_rad);
        JointStateBelief { stamp: SIMULATION_EPOCH.plus_s(at_s), angles }
    }

    /// Counts the messages of 20 s at 25 Hz.
    fn count(angle_rad: impl Fn(f64) -> f64) -> usize {
        let (robot, mut frames) = frames();
        (0..500).filter_map(|n| frames.hear(&state(&robot, f64::from(n) / 25.0, angle_rad(f64::from(n))))).count()
    }

    #[test]
    fn a_moving_arm_is_told_ten_times_a_second_at_most_and_a_resting_one_each_two_seconds() {
        assert_eq!(count(|_| 0.3), 10);
        assert_eq!(count(|n| 0.3 + 1e-4 * (n % 2.0)), 10, "noise at rest");
        let moving = count(|n| 1e-3 * n);
        assert!((160..=200).contains(&moving), "{moving}");
    }

    /// Returns the camera's pose by the transforms from the base.
    fn base_from_camera(message: &TfMessage) -> Isometry3<f64> {
        let mut at = "camera_wrist".to_owned();
        let mut from = Isometry3::identity();
        while let Some(step) = message.transforms.iter().find(|step| step.child_frame_id == at) {
            let (shift, turn) = (step.transform.translation, step.transform.rotation);
            let turn = nalgebra::Quaternion::new(turn.w, turn.x, turn.y, turn.z);
            from = Isometry3::from_parts(
                Translation3::new(shift.x, shift.y, shift.z),
                UnitQuaternion::new_normalize(turn),
            ) * from;
            at.clone_from(&step.header.frame_id);
        }
        assert_eq!(at, "base_link", "the chain of frames ends at the base");
        from
    }

    #[test]
    fn the_frames_are_those_of_the_drawing_and_then_of_the_calibration() {
        let (robot, mut frames) = frames();
        let mut corrections = LinkCorrections::default();
        corrections[2].turn_rad = Vector3::new(0.01, 0.0, -0.02);
        let mut calibrated = robot.clone();
        calibrated.chain = robot.chain.corrected(&corrections);
        calibrated.camera.mount.link_from_frame *= Translation3::new(0.0, 0.03, 0.0);
        for (step, angle_rad) in [-0.4, 0.1, 0.9].into_iter().enumerate() {
            let is_near = |message: &TfMessage, arm: &Robot| {
                let angles = JointAngles::from_fn(arm.n_joints(), |_| angle_rad);
                let off = base_from_camera(message).inv_mul(&arm.chain.frame(&angles, &arm.camera.mount));
                off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6
            };
            frames.believe(&robot);
            let message = frames.hear(&state(&robot, 10.0 * step as f64, angle_rad)).expect("told");
            assert!(is_near(&message, &robot) && !is_near(&message, &calibrated));
            // A new belief is published at once.
            frames.believe(&calibrated);
            let message = frames.hear(&state(&robot, 10.0 * step as f64 + 0.04, angle_rad)).expect("told");
            assert!(is_near(&message, &calibrated) && !is_near(&message, &robot));
        }
    }
}
