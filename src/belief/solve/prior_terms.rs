//! Parts of the normal equations that come from no view: priors and measurements of blocks.

use nalgebra::{Dyn, Matrix6, OMatrix, U6, Vector6};

use crate::measure::right_jacobian_inverse;
use crate::model::prior::at_least;
use crate::model::state::State;
use crate::solve::linearize::NormalEquations;
use crate::solve::problem::BundleProblem;

impl NormalEquations {
    pub(crate) fn add_priors(&mut self, problem: &BundleProblem<'_>, state: &State) {
        let (layout, prior) = (&problem.layout, &problem.prior);
        let (n, matrix) = (prior.n_covered(), &prior.information.matrix);
        let off = prior.off(layout, state);
        let pull = matrix * &off;
        self.cost += off.dot(&pull);
        let mut covered = self.matrix.view_mut((0, 0), (n, n));
        covered += matrix;
        let mut right = self.right.rows_mut(0, n);
        right -= pull;
        for (block, at, std) in prior.by_std(layout) {
            let off = state.blocks[block].off(&prior.mean[block]);
            if block.is_pose() {
                self.add_pose_prior(at, &Vector6::from_fn(|k, _| off[k]), std);
            } else {
                std.iter().zip(off).enumerate().for_each(|(k, (std, off))| self.add_number_prior(at + k, off, *std));
            }
        }
    }

    /// One of all columns: with `d` how far a pose is off, a small motion of the pose changes it by the inverse of the
    /// right Jacobian at `d`. Taken as one it would let what is well known leak into what is not. The lower triangle.
    pub(crate) fn start_with_full_prior(&mut self, problem: &BundleProblem<'_>, state: &State) {
        let (layout, info) = (&problem.layout, &problem.prior.information.matrix);
        let off = problem.prior.off(layout, state);
        self.right.gemv(-1.0, info, &off, 0.0);
        self.cost = -off.dot(&self.right);
        self.matrix.copy_from(info);
        for (_, at) in layout.blocks().filter(|(block, _)| block.is_pose()) {
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

    pub(crate) fn add_block_measurements(&mut self, problem: &BundleProblem<'_>, state: &State) {
        for measurement in &problem.block_measurements {
            let of = measurement.predicted(&state.blocks);
            let (off_m, info) = (of.measured_m - of.predicted_m, of.std_m.powi(-2));
            self.cost += info * off_m * off_m;
            let rows = of.by.map(|(block, by)| problem.layout.at(block).map(|at| (at, by)));
            for (at, by) in rows.into_iter().flatten() {
                let mut right = self.right.fixed_rows_mut::<6>(at);
                right += by * (info * off_m);
                for (before, other) in rows.into_iter().flatten().filter(|(before, _)| *before <= at) {
                    self.add_block(at, before, &(by * other.transpose() * info));
                }
            }
        }
    }

    fn add_number_prior(&mut self, at: usize, off: f64, std: f64) {
        let info = at_least(std).powi(-2);
        self.matrix[(at, at)] += info;
        self.right[at] -= info * off;
        self.cost += info * off * off;
    }

    /// Prior of a pose that is `d` off its mean.
    fn add_pose_prior(&mut self, at: usize, d: &Vector6<f64>, std: &[f64]) {
        let info = Vector6::from_fn(|k, _| if std[k].is_finite() { at_least(std[k]).powi(-2) } else { 0.0 });
        let jacobian = right_jacobian_inverse(d);
        let weighted = jacobian.tr_mul(&Matrix6::from_diagonal(&info));
        self.add_block(at, at, &(weighted * jacobian));
        let mut right = self.right.fixed_rows_mut::<6>(at);
        right -= weighted * d;
        self.cost += d.component_mul(d).dot(&info);
    }
}
