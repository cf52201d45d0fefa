//! Twists of the camera by joint poses on the parent links, and by the arm's compliance.

use nalgebra::{Isometry3, Matrix6, SMatrix, Vector3, Vector6};

use crate::solve::body_motion::SagPoint;
use crate::solve::problem::BundleProblem;
use crate::solve::schur::{BodyTwists, Group};
use armcal_core::kinematics::{AboutAxes, LinkCorrections, LinkPoses};
use armcal_core::spatial::left_jacobian;

/// Returns the twists of the camera by the body's columns of the joints of `group`; zero for other joints.
pub(crate) fn body_twists(problem: &BundleProblem<'_>, group: &Group<'_>, corrections: &LinkCorrections) -> BodyTwists {
    let mut twists = BodyTwists::zeros();
    let layout = &problem.layout;
    let n_links = layout.links.len();
    let n_linked = n_links / 6;
    if !layout.sag.is_empty() {
        let at = SagPoint::new(&problem.loads(group.view_idx), &corrections.sag, group.poses);
        for (k, column) in layout.sag.clone().enumerate() {
            let twist = sag_twist(group, &at.turns(layout.parameters[column]));
            twists.set_column(n_links + k, &twist);
        }
    }
    for joint in group.joints.clone().take_while(|&joint| joint < n_linked) {
        let by_turn = left_jacobian(&corrections[joint].turn_rad);
        for axis in 0..3 {
            let shift = Vector3::ith(axis, group.sign);
            let turn = by_turn.column(axis) * group.sign;
            let [shift, turn] = link_twist(group.poses, &group.base_from_camera, joint, [shift, turn]);
            twists.set_column(6 * joint + axis, &shift);
            twists.set_column(6 * joint + 3 + axis, &turn);
        }
    }
    twists
}

/// Returns the camera's twist caused by rotations of the group's joints and of the base.
pub(crate) fn sag_twist(group: &Group<'_>, turns: &AboutAxes) -> Vector6<f64> {
    let center = group.base_from_camera.translation.vector;
    let to_camera = group.base_from_camera.rotation.inverse();
    let [moved, turned] =
        turns.motion(group.poses, group.joints.clone(), &center).map(|by| to_camera * by * group.sign);
    Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z)
}

/// Returns the twists of the camera by a shift and by a turn of a joint's frame, in its parent link's axes.
pub(crate) fn link_twist(
    poses: &LinkPoses,
    base_from_camera: &Isometry3<f64>,
    joint: usize,
    [shift, turn]: [Vector3<f64>; 2],
) -> [Vector6<f64>; 2] {
    let to_camera = base_from_camera.rotation.inverse();
    let lever = base_from_camera.translation.vector - poses.joint_origin(joint);
    let [shift, turn] = [shift, turn].map(|by| poses.link(joint).rotation * by);
    let (moved, swept, turned) = (to_camera * shift, to_camera * turn.cross(&lever), to_camera * turn);
    [
        Vector6::new(moved.x, moved.y, moved.z, 0.0, 0.0, 0.0),
        Vector6::new(swept.x, swept.y, swept.z, turned.x, turned.y, turned.z),
    ]
}

/// Sums of a group with its view-local parameters marginalised (module `linearize`), for the body's block.
pub(crate) struct BodySums {
    pub twists: BodyTwists,
    /// `G - G M G`.
    pub q: Matrix6<f64>,
    pub m: Matrix6<f64>,
    pub m_h_sum: Matrix6<f64>,
    pub h_sum: Matrix6<f64>,
    /// Gradient by the camera's twist, with the view-local parameters marginalised.
    pub g: Vector6<f64>,
    pub by_lens: SMatrix<f64, 6, 8>,
}
