//! The links' columns of the normal equations: where joints sit on their parent links.
//!
//! Six columns a joint: shift along and turn about the parent link's axes. A turn phi acts as a rotation vector, so that
//! a change of it turns the link by `J(phi)`, the left Jacobian of SO(3). They are one dense block, present only where
//! links are estimated.

use nalgebra::{Isometry3, Matrix6, SMatrix, Vector3, Vector6};

use crate::calib::bundle::linearize::NormalEquations;
use crate::calib::bundle::problem::Layout;
use crate::calib::bundle::schur::{Columns, Directions, Group, SchurBlock};
use armcal_core::joints::MAX_JOINTS;
use armcal_core::kinematics::{LinkCorrections, LinkPoses};
use armcal_core::spatial::left_jacobian;

/// Columns of all links that an arm may have.
pub(crate) const N_LINK_COLUMNS: usize = 6 * MAX_JOINTS;
/// Twists of the camera (right, camera frame) by each link column.
pub(crate) type LinkTwists = SMatrix<f64, 6, N_LINK_COLUMNS>;

/// Of the joints of `group`; zero elsewhere.
pub(crate) fn link_twists(group: &Group<'_>, corrections: &LinkCorrections) -> LinkTwists {
    let mut twists = LinkTwists::zeros();
    for joint in group.joints.clone() {
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

/// Twists of the camera by a shift and by a turn of a joint's place, in its parent link's axes.
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

/// What the links' block takes from a group whose own parameters are eliminated (module `linearize`).
pub(crate) struct LinkSums {
    pub twists: LinkTwists,
    /// `G - G M G`.
    pub q: Matrix6<f64>,
    pub m: Matrix6<f64>,
    pub m_h_sum: Matrix6<f64>,
    pub h_sum: Matrix6<f64>,
    /// Gradient by the camera's twist, the own parameters eliminated.
    pub g: Vector6<f64>,
    pub by_lens: SMatrix<f64, 6, 8>,
}

impl NormalEquations {
    /// The links' own block, and what ties it to the other columns of the group.
    pub(crate) fn add_links(
        &mut self,
        columns: &Columns<'_>,
        sums: &LinkSums,
        own: &SchurBlock,
        directions: &Directions,
    ) {
        let layout = columns.layout();
        let by_q = sums.q * sums.twists;
        for (a, at) in link_range(columns, layout) {
            let (twist, pushed) = (sums.twists.column(a), by_q.column(a));
            self.right[at] += twist.dot(&sums.g);
            for (b, other) in link_range(columns, layout).take_while(|(b, _)| *b <= a) {
                self.matrix[(at, other)] += sums.twists.column(b).dot(&pushed);
            }
            for direction in columns.directions() {
                let value = directions.column(direction).dot(&pushed);
                columns.each(direction, |column, by| self.matrix[(at.max(column), at.min(column))] += value * by);
            }
        }
        for observation in own.range.clone() {
            let (u, Some(tag)) = self.by_tag[observation] else { continue };
            let cross = if own.has_any { u - sums.m_h_sum.tr_mul(&u) } else { u };
            for (a, at) in link_range(columns, layout) {
                let mut cells = self.matrix.fixed_view_mut::<6, 1>(tag, at);
                cells -= cross.tr_mul(&sums.twists.column(a));
            }
        }
        if let Some(lens) = layout.lens {
            let by_lens = sums.by_lens - sums.h_sum * (sums.m * sums.by_lens);
            for (a, at) in link_range(columns, layout) {
                let mut cells = self.matrix.fixed_view_mut::<8, 1>(lens, at);
                cells += by_lens.tr_mul(&sums.twists.column(a));
            }
        }
    }
}

/// (column among the links', column of the matrix) of the group's joints.
fn link_range(columns: &Columns<'_>, layout: &Layout) -> impl Iterator<Item = (usize, usize)> + use<> {
    let (joints, first, n) = (columns.joints(), layout.links.start, layout.links.len());
    (6 * joints.start..(6 * joints.end).min(n)).map(move |k| (k, first + k))
}
