//! What is known before: the priors' part of the normal equations.

use nalgebra::{DVector, Isometry3, Matrix6, Vector6};

use crate::calib::bundle::linearize::NormalEquations;
use crate::calib::bundle::observation_term::right_jacobian_inverse;
use crate::calib::bundle::problem::{BundleProblem, State};
use armcal_core::spatial::log;

impl NormalEquations {
    pub(crate) fn add_priors(&mut self, problem: &BundleProblem<'_>, state: &State) {
        let (layout, prior) = (&problem.layout, &problem.prior);
        let n = prior.joint_info.nrows();
        let off = off_by(problem, state, n);
        let pull = &prior.joint_info * &off;
        self.cost += off.dot(&pull);
        let mut block = self.matrix.view_mut((0, 0), (n, n));
        block += &prior.joint_info;
        let mut right = self.right.rows_mut(0, n);
        right -= pull;
        if n == layout.n {
            return;
        }
        if let Some(at) = layout.mount.filter(|_| n == layout.n_joint()) {
            self.add_pose_prior(at, &prior.mount, &state.mount, &prior.mount_std);
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

/// How far the first `n` columns are from the means of a prior that has a full matrix. Deviations are small: their
/// derivative by a pose's column is taken as one.
pub(crate) fn off_by(problem: &BundleProblem<'_>, state: &State, n: usize) -> DVector<f64> {
    let (layout, prior) = (&problem.layout, &problem.prior);
    let n_joint = layout.n_joint();
    let mut off = (&state.joint - &prior.joint_mean).resize_vertically(n, 0.0);
    let mut set = |at: Option<usize>, mean: &Isometry3<f64>, pose: &Isometry3<f64>| {
        if let Some(at) = at.filter(|at| *at < n) {
            off.fixed_rows_mut::<6>(at).copy_from(&log(&mean.inv_mul(pose)));
        }
    };
    if n == n_joint {
        return off;
    }
    set(layout.mount, &prior.mount, &state.mount);
    for (tag, column) in layout.tags.iter().enumerate() {
        set(*column, &prior.tags[tag], &state.tags[tag]);
    }
    set(layout.gripper_tag, &prior.gripper_tag, &state.gripper_tag);
    if let Some(at) = layout.time.filter(|at| *at < n) {
        off[at] = state.time_s - prior.time_s;
    }
    if let Some(at) = layout.lens.filter(|at| *at < n) {
        for (k, (value, mean)) in state.lens.intrinsics().iter().zip(prior.lens.intrinsics()).enumerate() {
            off[at + k] = value - mean;
        }
    }
    off
}
