//! A view with its own parameters marginalised (Schur complement), and the map from directions to columns.

use std::ops::Range;

use nalgebra::{Const, DMatrix, DVector, Isometry3, Matrix6, Matrix6xX, SMatrix, SVector, Vector6};

use crate::model::blocks::Block;
use crate::model::layout::Layout;
use crate::model::state::State;
pub(crate) use crate::solve::constants::schur::{MOUNT, N_BODY_COLUMNS, N_DIRECTIONS, TIME};
use crate::solve::problem::{BundleProblem, N_VIEW_PARAMETERS, Own, ViewData};
use crate::solve::time_error::TimeError;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::kinematics::LinkPoses;
use armcal_core::spatial::adjoint;

pub(crate) type Directions = SMatrix<f64, 6, N_DIRECTIONS>;

/// Twists of the camera (right, camera frame) by each column of links and sag, in the order of [`Layout::body`].
pub(crate) type BodyTwists = SMatrix<f64, 6, N_BODY_COLUMNS>;

/// Recovers a view's own parameters and their covariance after the common step.
#[derive(Clone, Debug)]
pub(crate) struct SchurBlock {
    /// `S`, and the inverse of `S^T G S + L`.
    pub twists: SMatrix<f64, 6, N_VIEW_PARAMETERS>,
    pub inverse: Own,
    pub gradient: SVector<f64, N_VIEW_PARAMETERS>,
    /// Rows of own parameters by common columns: `S^T sum H_i A`; filled where it is asked for.
    pub by_common: SMatrix<f64, 6, N_DIRECTIONS>,
    /// Observations of the group, as indices into the problem's list.
    pub range: Range<usize>,
    /// `ln|L| - ln|S^T G S + L|`: how much the prior's volume shrank.
    pub log_ratio: f64,
    /// The lens's part, `sum H_ic`.
    pub by_lens: SMatrix<f64, 6, 8>,
    /// `sum H_i T` of the columns of links and sag, as many as there are.
    pub by_body: Matrix6xX<f64>,
    /// Time error of the view's image.
    pub time_error: TimeError,
    /// True if the group has parameters of its own.
    pub has_any: bool,
}

/// Observations of one view by one camera or of the gripper's tag, with the frames that carry them.
pub(crate) struct Group<'a> {
    pub view_idx: usize,
    /// Number of the camera.
    pub camera: usize,
    /// The joints whose motion the observations see, and how.
    pub joints: Range<usize>,
    pub sign: f64,
    /// Twist of the camera by that of the mount.
    pub by_mount: Matrix6<f64>,
    pub camera_error: Option<&'a Isometry3<f64>>,
    pub observations: Range<usize>,
    pub poses: &'a LinkPoses,
    pub base_from_camera: Isometry3<f64>,
    /// Carrier of the tags; `None`: they stand in the frame of the poses.
    pub carrier: Option<Isometry3<f64>>,
}

impl<'a> Group<'a> {
    /// The groups of a view: the tags about the arm, then the tag on the gripper where it is seen.
    pub(crate) fn of_view(
        problem: &BundleProblem<'_>,
        state: &'a State,
        view_idx: usize,
        poses: &'a LinkPoses,
    ) -> impl Iterator<Item = Self> + use<'a> {
        let view = &problem.views[view_idx];
        let error = &state.camera_error[view_idx];
        let camera = problem.robot.camera_at(view.camera);
        let before = poses.link(camera.mount.n_joints) * state.pose(Block::Mount(view.camera));
        let of_tags = Self {
            view_idx,
            camera: view.camera,
            joints: 0..view.n_seen_joints,
            // Before a camera that stands still the joints move the tags.
            sign: if problem.robot.is_watched() { -1.0 } else { 1.0 },
            by_mount: adjoint(&error.inverse()),
            camera_error: problem.scales.camera_error_std.is_some().then_some(error),
            observations: view.observations.clone(),
            poses,
            base_from_camera: before * error,
            carrier: None,
        };
        let of_gripper = view.gripper.zip(problem.robot.gripper_tag).map(|(observation, tag)| Self {
            view_idx,
            camera: 0,
            joints: problem.n_seen_joints..tag.mount.n_joints,
            // Joints distal to the camera move the tag, not the camera.
            sign: -1.0,
            by_mount: Matrix6::identity(),
            camera_error: None,
            observations: observation..observation + 1,
            poses,
            base_from_camera: before,
            carrier: Some(*poses.link(tag.mount.n_joints)),
        });
        std::iter::once(of_tags).chain(of_gripper)
    }
}

impl Group<'_> {
    /// A tag of the group in the camera's frame.
    pub(crate) fn camera_from_tag(&self, state: &State, tag: Block) -> Isometry3<f64> {
        let pose = state.pose(tag);
        match &self.carrier {
            None => self.base_from_camera.inv_mul(pose),
            Some(carrier) => self.base_from_camera.inv_mul(&(carrier * pose)),
        }
    }
}

/// `H_i Ad_i` and column of the tag of each observation.
pub(crate) type ByTag = [(Matrix6<f64>, Option<usize>)];

/// From directions to columns.
pub(crate) struct Columns<'a> {
    layout: &'a Layout,
    view: &'a ViewData,
    joints: Range<usize>,
    /// First columns of mount and lens of the camera that the view is of, and of the clock.
    mount: Option<usize>,
    pub lens: Option<usize>,
    clock: Option<usize>,
}

impl<'a> Columns<'a> {
    pub(crate) fn new(problem: &'a BundleProblem<'_>, group: &Group<'_>) -> Self {
        Self::of_view(&problem.layout, &problem.views[group.view_idx], group.joints.clone())
    }

    fn of_view(layout: &'a Layout, view: &'a ViewData, joints: Range<usize>) -> Self {
        let [mount, lens] = [Block::Mount(view.camera), Block::Lens(view.camera)].map(|block| layout.at(block));
        Self { layout, view, joints, mount, lens, clock: layout.at(Block::Clock) }
    }

    pub(crate) fn layout(&self) -> &'a Layout {
        self.layout
    }

    /// The directions that have columns.
    pub(crate) fn directions(&self) -> impl Iterator<Item = usize> + use<> {
        let mount = if self.mount.is_some() { MOUNT..MOUNT + 6 } else { 0..0 };
        let time = if self.clock.is_some() { TIME..TIME + 1 } else { 0..0 };
        self.joints.clone().chain(mount).chain(time)
    }

    /// The columns of a direction, which lie side by side: the first of them, and the direction's derivative by each.
    #[inline]
    pub(crate) fn of(&self, direction: usize) -> (usize, &'a [f64]) {
        let one = |at: Option<usize>, k: usize| at.map_or((0, &[][..]), |at| (at + k, &[1.0][..]));
        match direction {
            TIME => one(self.clock, 0),
            MOUNT..TIME => one(self.mount, direction - MOUNT),
            joint => {
                let columns = self.layout.of_joint[joint].clone();
                (columns.start, &self.view.basis[columns])
            }
        }
    }

    /// Calls `f` with each column of a direction and the direction's derivative by it.
    #[inline]
    pub(crate) fn each(&self, direction: usize, mut f: impl FnMut(usize, f64)) {
        let (first, derivatives) = self.of(direction);
        derivatives.iter().enumerate().for_each(|(k, by)| f(first + k, *by));
    }
}

impl SchurBlock {
    /// Creates the block of a group before its first linearization, with room for `n_body` columns.
    pub(crate) fn new(n_body: usize) -> Self {
        Self {
            twists: SMatrix::zeros(),
            inverse: Own::identity(),
            gradient: SVector::zeros(),
            by_common: SMatrix::zeros(),
            range: 0..0,
            log_ratio: 0.0,
            by_lens: SMatrix::zeros(),
            by_body: Matrix6xX::zeros(n_body),
            time_error: TimeError::none(),
            has_any: false,
        }
    }

    /// Resets the block to that of a group without parameters of its own.
    pub(crate) fn set_none(&mut self) {
        if !self.has_any {
            return;
        }
        self.twists.fill(0.0);
        self.inverse.fill_with_identity();
        self.gradient.fill(0.0);
        self.log_ratio = 0.0;
        self.time_error = TimeError::none();
        self.has_any = false;
    }

    /// Inverts `S^T G S + L` of the first `N` own parameters, where `info` is the diagonal of L but for the time error;
    /// the logarithm of its determinant.
    pub(crate) fn invert<const N: usize>(&mut self, g: &Matrix6<f64>, info: &SVector<f64, N_VIEW_PARAMETERS>) -> f64 {
        let twists = self.twists.fixed_columns::<N>(0);
        let mut normal = twists.tr_mul(&(g * twists));
        for k in 0..N {
            normal[(k, k)] += info[k];
        }
        self.time_error.loosen(&mut normal);
        // Positive definite: its diagonal has the priors. Only overflow makes it fail.
        let factor = normal.cholesky();
        let log_det = factor.as_ref().map_or(0.0, |f| 2.0 * f.l_dirty().diagonal().map(f64::ln).sum());
        match factor {
            Some(factor) => self.inverse.fixed_view_mut::<N, N>(0, 0).copy_from(&factor.inverse()),
            None => self.inverse.fill(0.0),
        }
        log_det
    }

    /// True if the camera's own pose error is among the parameters.
    pub(crate) fn moves_camera(&self) -> bool {
        self.twists[(0, MAX_JOINTS)] != 0.0
    }

    /// `M`, and how far the own parameters alone would move the camera.
    pub(crate) fn reach(&self) -> (Matrix6<f64>, Vector6<f64>) {
        if !self.has_any {
            return (Matrix6::zeros(), Vector6::zeros());
        }
        if self.moves_camera() {
            let weighted = self.twists * self.inverse;
            return (weighted * self.twists.transpose(), weighted * self.gradient);
        }
        let twists = self.twists.fixed_columns::<MAX_JOINTS>(0);
        let weighted = twists * self.inverse.fixed_view::<MAX_JOINTS, MAX_JOINTS>(0, 0);
        (weighted * twists.transpose(), weighted * self.gradient.fixed_rows::<MAX_JOINTS>(0))
    }

    /// `sum H_i A step`: what a step of the common parameters adds to the observations' pull on the camera's twist.
    pub(crate) fn push(
        &self,
        problem: &BundleProblem<'_>,
        by_tag: &ByTag,
        view_idx: usize,
        step: &DVector<f64>,
    ) -> Vector6<f64> {
        let columns = self.columns(problem, view_idx);
        let mut along = SVector::<f64, N_DIRECTIONS>::zeros();
        for a in columns.directions() {
            columns.each(a, |column, by| along[a] += by * step[column]);
        }
        let mut pushed = self.by_common * along;
        for at in self.range.clone() {
            if let (u, Some(column)) = &by_tag[at] {
                pushed -= u * step.fixed_rows::<6>(*column);
            }
        }
        if let Some(at) = columns.lens {
            pushed += self.by_lens * step.fixed_rows::<8>(at);
        }
        for (k, column) in problem.layout.body().enumerate() {
            pushed += self.by_body.column(k) * step[column];
        }
        pushed
    }

    fn columns<'a>(&self, problem: &'a BundleProblem<'_>, view_idx: usize) -> Columns<'a> {
        let view = &problem.views[view_idx];
        let joints = match &problem.robot.gripper_tag {
            Some(tag) if view.gripper == Some(self.range.start) => problem.n_seen_joints..tag.mount.n_joints,
            _ => 0..view.n_seen_joints,
        };
        Columns::of_view(&problem.layout, view, joints)
    }

    /// `sum H_i A`: the observations' pull on the camera's twist by the common columns.
    pub(crate) fn twist_by_columns(
        &self,
        problem: &BundleProblem<'_>,
        by_tag: &ByTag,
        view_idx: usize,
    ) -> DMatrix<f64> {
        let layout = &problem.layout;
        let mut out = DMatrix::zeros(6, layout.n);
        let columns = self.columns(problem, view_idx);
        for a in columns.directions() {
            columns.each(a, |column, by| {
                let mut view = out.fixed_view_mut::<6, 1>(0, column);
                view += self.by_common.column(a) * by;
            });
        }
        for at in self.range.clone() {
            if let (u, Some(column)) = &by_tag[at] {
                let mut view = out.fixed_view_mut::<6, 6>(0, *column);
                view -= u;
            }
        }
        if let Some(at) = columns.lens {
            let mut view = out.fixed_view_mut::<6, 8>(0, at);
            view += self.by_lens;
        }
        for (k, column) in layout.body().enumerate() {
            out.column_mut(column).copy_from(&self.by_body.column(k));
        }
        out
    }

    /// `S^T sum H_i A`: own parameters by the common columns; multiplied by a step it is what the step adds to the
    /// gradient.
    pub(crate) fn own_by_columns(&self, problem: &BundleProblem<'_>, by_tag: &ByTag, view_idx: usize) -> DMatrix<f64> {
        let layout = &problem.layout;
        let mut out = DMatrix::zeros(N_VIEW_PARAMETERS, layout.n);
        let columns = self.columns(problem, view_idx);
        let by_directions = self.twists.transpose() * self.by_common;
        for a in columns.directions() {
            columns.each(a, |column, by| {
                for row in 0..N_VIEW_PARAMETERS {
                    out[(row, column)] += by_directions[(row, a)] * by;
                }
            });
        }
        for at in self.range.clone() {
            if let (u, Some(column)) = &by_tag[at] {
                let mut view = out.fixed_view_mut::<N_VIEW_PARAMETERS, 6>(0, *column);
                view -= self.twists.transpose() * u;
            }
        }
        if let Some(at) = columns.lens {
            let mut view = out.generic_view_mut((0, at), (Const::<N_VIEW_PARAMETERS>, Const::<8>));
            view += self.twists.transpose() * self.by_lens;
        }
        for (k, column) in layout.body().enumerate() {
            out.column_mut(column).copy_from(&self.twists.tr_mul(&self.by_body.column(k)));
        }
        out
    }
}
