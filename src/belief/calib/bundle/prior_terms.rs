//! What is known before: the priors' part of the normal equations.

use nalgebra::{DVector, Dyn, Isometry3, Matrix6, OMatrix, U6, Vector6};

use crate::calib::bundle::linearize::NormalEquations;
use crate::calib::bundle::observation_term::right_jacobian_inverse;
use crate::calib::bundle::problem::{BundleProblem, Layout, Prior, State};
use armcal_core::optics::CameraModel;
use armcal_core::spatial::log;

impl NormalEquations {
    pub(crate) fn add_priors(&mut self, problem: &BundleProblem<'_>, state: &State) {
        let (layout, prior) = (&problem.layout, &problem.prior);
        let n = prior.joint_info.nrows();
        let off = off_by(layout, &prior.means(), state, n);
        let pull = &prior.joint_info * &off;
        self.cost += off.dot(&pull);
        let mut block = self.matrix.view_mut((0, 0), (n, n));
        block += &prior.joint_info;
        let mut right = self.right.rows_mut(0, n);
        right -= pull;
        if let Some(at) = layout.mount.filter(|_| n == layout.n_joint()) {
            self.add_pose_prior(at, &prior.mount, &state.mount, &prior.mount_std);
        }
        for (at, (mean, std), mount) in further(layout, &prior.further_mounts, &state.further_mounts) {
            self.add_pose_prior(at, mean, mount, std);
        }
        if let Some(at) = layout.gripper_tag {
            self.add_pose_prior(at, &prior.gripper_tag, &state.gripper_tag, &prior.gripper_tag_std);
        }
        for (tag, column) in layout.tags.iter().enumerate() {
            if let Some(at) = column {
                self.add_pose_prior(*at, &prior.tags[tag], &state.tags[tag], &prior.tags_std[tag]);
            }
        }
        if let Some(at) = layout.time {
            self.add_number_prior(at, state.time_s - prior.time_s, prior.time_std_s);
        }
        if let Some(at) = layout.lens {
            for (k, (value, mean)) in state.lens.intrinsics().iter().zip(prior.lens.intrinsics()).enumerate() {
                self.add_number_prior(at + k, value - mean, prior.lens_std[k]);
            }
        }
    }

    /// One of all columns: with `d` how far a pose is off, a small motion of the pose changes it by the inverse of the
    /// right Jacobian at `d`. Taken as one it would let what is well known leak into what is not. The lower triangle.
    pub(crate) fn start_with_full_prior(&mut self, problem: &BundleProblem<'_>, state: &State) {
        let (layout, info) = (&problem.layout, &problem.prior.joint_info);
        let off = off_by(layout, &problem.prior.means(), state, layout.n);
        self.right.gemv(-1.0, info, &off, 0.0);
        self.cost = -off.dot(&self.right);
        self.matrix.copy_from(info);
        for at in layout.poses() {
            let d: Vector6<f64> = off.fixed_rows::<6>(at).into_owned();
            if d == Vector6::zeros() {
                continue;
            }
            let jacobian = right_jacobian_inverse(&d);
            for column in 0..at + 6 {
                let mut rows = self.matrix.fixed_view_mut::<6, 1>(at, column);
                let turned = jacobian.tr_mul(&rows);
                rows.copy_from(&turned);
            }
            let mut below = self.matrix.view_mut((at, at), (layout.n - at, 6));
            let turned: OMatrix<f64, Dyn, U6> = &below * jacobian;
            below.copy_from(&turned);
            let pulled = jacobian.tr_mul(&self.right.fixed_rows::<6>(at));
            self.right.fixed_rows_mut::<6>(at).copy_from(&pulled);
        }
    }

    fn add_number_prior(&mut self, at: usize, off: f64, std: f64) {
        let info = BundleProblem::at_least(std).powi(-2);
        self.matrix[(at, at)] += info;
        self.right[at] -= info * off;
        self.cost += info * off * off;
    }

    fn add_pose_prior(&mut self, at: usize, mean: &Isometry3<f64>, pose: &Isometry3<f64>, std: &[f64; 6]) {
        let d = log(&mean.inv_mul(pose));
        let info =
            Vector6::from_fn(|k, _| if std[k].is_finite() { BundleProblem::at_least(std[k]).powi(-2) } else { 0.0 });
        let jacobian = right_jacobian_inverse(&d);
        let weighted = jacobian.tr_mul(&Matrix6::from_diagonal(&info));
        self.add_block(at, at, &(weighted * jacobian));
        let mut right = self.right.fixed_rows_mut::<6>(at);
        right -= weighted * d;
        self.cost += d.component_mul(&d).dot(&info);
    }
}

/// Column, prior and place of each further camera's mount that has a column.
fn further<'a>(
    layout: &Layout,
    priors: &'a [(Isometry3<f64>, [f64; 6])],
    mounts: &'a [Isometry3<f64>],
) -> impl Iterator<Item = (usize, &'a (Isometry3<f64>, [f64; 6]), &'a Isometry3<f64>)> {
    let columns = layout.further_mounts.iter().zip(priors).zip(mounts);
    columns.filter_map(|((at, prior), mount)| Some(((*at)?, prior, mount)))
}

/// Where all columns have their means; a prior of all of them is of the first camera alone.
pub(crate) struct Means<'a> {
    joint: &'a DVector<f64>,
    mount: &'a Isometry3<f64>,
    time_s: f64,
    lens: &'a CameraModel,
    tags: &'a [Isometry3<f64>],
    gripper_tag: &'a Isometry3<f64>,
}

impl Prior {
    pub(crate) fn means(&self) -> Means<'_> {
        let Self { joint_mean: joint, mount, time_s, lens, tags, gripper_tag, .. } = self;
        Means { joint, mount, time_s: *time_s, lens, tags, gripper_tag }
    }
}

impl State {
    pub(crate) fn means(&self) -> Means<'_> {
        let Self { joint, mount, time_s, lens, tags, gripper_tag, .. } = self;
        Means { joint, mount, time_s: *time_s, lens, tags, gripper_tag }
    }
}

/// How far the first `n` columns of `state` are from `means`. Where `n` is not all, deviations are small, and their
/// derivative by a pose's column is taken as one.
pub(crate) fn off_by(layout: &Layout, means: &Means<'_>, state: &State, n: usize) -> DVector<f64> {
    let n_joint = layout.n_joint();
    let mut off = (&state.joint - means.joint).resize_vertically(n, 0.0);
    let mut set = |at: Option<usize>, mean: &Isometry3<f64>, pose: &Isometry3<f64>| {
        if let Some(at) = at.filter(|at| *at < n) {
            off.fixed_rows_mut::<6>(at).copy_from(&log(&mean.inv_mul(pose)));
        }
    };
    if n == n_joint {
        return off;
    }
    set(layout.mount, means.mount, &state.mount);
    for (tag, column) in layout.tags.iter().enumerate() {
        set(*column, &means.tags[tag], &state.tags[tag]);
    }
    set(layout.gripper_tag, means.gripper_tag, &state.gripper_tag);
    if let Some(at) = layout.time.filter(|at| *at < n) {
        off[at] = state.time_s - means.time_s;
    }
    if let Some(at) = layout.lens.filter(|at| *at < n) {
        for (k, (value, mean)) in state.lens.intrinsics().iter().zip(means.lens.intrinsics()).enumerate() {
            off[at + k] = value - mean;
        }
    }
    off
}
