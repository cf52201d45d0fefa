//! Innovations of held-out views, predicted from the other views, with their predicted covariance.
//!
//! All held-out views of a fold are used at once. `N` are the fold's normal equations with its priors. `N_o y = r_o`
//! are those of the held-out views, with the views' own parameters marginalised. Then
//! `chi2 = sum |r|^2 - own - r_o^T (N + N_o)^-1 r_o` is the innovations' square under measurement noise, joint errors
//! and the parameters' covariance together. If the camera of each view is free, only the noise within the views
//! remains. The difference is chi-square with six degrees of freedom per view: it tests the predicted camera poses.

use crate::checks::constants::innovations::{FREE_CAMERA, TOLD};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::file::metrics::ViewContainment;
use crate::judge::coverage::COVERAGE;
use crate::measure::{ObservationTerm, WeightedMeasurement};
use crate::model::state::State;
use crate::solve::estimate::Estimate;
use crate::solve::input::BundleInput;
use crate::solve::linearize::NormalEquations;
use crate::solve::outliers::Outlier;
use crate::solve::problem::BundleProblem;
use crate::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::Loss;
use armcal_core::stats::chi_square_quantile;

/// Innovations of one fold's held-out views.
#[derive(Clone, Debug)]
pub struct Innovations {
    /// Chi-square of all coordinates.
    pub chi2: f64,
    /// Number of those coordinates, less one per view for each joint without a sensor reading.
    pub dof: usize,
    /// Chi-square of the camera poses only.
    pub camera_chi2: f64,
    /// Six per view that shows enough, less one for each joint without a sensor reading.
    pub camera_dof: usize,
    /// Number of views, and of those whose own chi-square is within its 95 % quantile.
    pub within_95: ViewContainment,
    /// Innovations of joints on which the views have enough information.
    pub joints: Vec<JointInnovation>,
}

/// Error of a joint in a held-out view.
#[derive(Clone, Copy, Debug)]
pub struct JointInnovation {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Index among all views.
    pub view_idx: usize,
    /// Travel from mid-range by the datasheet, rad.
    pub travel_rad: f64,
    /// Error over its predicted standard deviation: of unit variance under the model.
    pub normalised: f64,
}

impl Estimate<'_> {
    /// Innovations of the views in `left_out`, each with its index among all views; `outliers` of all views do not
    /// count. `None` if the normal equations have no Cholesky factor.
    #[must_use]
    pub fn innovations(
        &self,
        input: &BundleInput<'_>,
        left_out: &[(usize, View)],
        outliers: &[Outlier],
    ) -> Option<Innovations> {
        let views: Vec<View> = left_out.iter().map(|(_, view)| view.clone()).collect();
        let mut problem = self.data_only(input, &views);
        for (at, (view_idx, view)) in left_out.iter().enumerate() {
            let observations = problem.views[at].observations.clone();
            for (observation, tag) in problem.observations[observations].iter_mut().zip(&view.tags) {
                let layout = &problem.layout;
                let is_known = layout.tags().next().is_none() || layout.at(observation.block).is_some();
                let mut used = [is_known; 4];
                for out in outliers.iter().filter(|out| out.view_idx == *view_idx && out.tag_id == tag.id) {
                    match out.corner {
                        Some(corner) => used[corner] = false,
                        None => used = [false; 4],
                    }
                }
                observation.set_used(used);
            }
        }
        let state = self.solved.state.with_views(views.len());
        // A tag at the border of an image may be predicted beyond it.
        let mut normal = NormalEquations::new(&problem);
        normal.update(&problem, &state, Loss::Square);
        for (observation, chi2) in problem.observations.iter_mut().zip(&normal.chi2) {
            observation.is_used &= *chi2 < observation.data.unseen_chi2();
        }
        let (foretold, chi2) = self.with_data(&problem, &state)?;
        let joints = foretold.joints(&problem, left_out);
        // A joint without a sensor takes up one degree of freedom of its view.
        let taken = |view_idx: usize| problem.views[view_idx].is_free.iter().filter(|is_free| **is_free).count();
        let told = |view_idx: usize| {
            let used = observations_of(&problem, view_idx).filter(|s| s.is_used);
            used.map(|s| s.data.n_coordinates()).sum::<usize>()
        };
        let numbers = |of: &dyn Fn(usize) -> usize| -> usize {
            (0..views.len()).map(|view_idx| of(view_idx).saturating_sub(taken(view_idx))).sum()
        };
        let dof = numbers(&told);
        let camera_dof = numbers(&|view_idx| camera_numbers(&problem, view_idx));
        let mut within_95 = ViewContainment::default();
        for view_idx in 0..views.len() {
            let dof = told(view_idx).saturating_sub(taken(view_idx));
            if dof > 0 {
                within_95.views += 1;
                let observations = observations_of(&problem, view_idx).cloned().collect();
                let chi2 = self.chi2_of_view(input, &views[view_idx..=view_idx], observations)?;
                within_95.within += usize::from(chi2 <= chi_square_quantile(COVERAGE, dof));
            }
        }
        problem.scales.camera_error_std = Some([FREE_CAMERA; 2]);
        let (_, free_chi2) = self.with_data(&problem, &state)?;
        Some(Innovations { chi2, dof, camera_chi2: (chi2 - free_chi2).max(0.0), camera_dof, within_95, joints })
    }

    /// Chi-square of one view's innovations. `observations`: the view's, as they are used, the gripper tag's last.
    fn chi2_of_view(&self, input: &BundleInput<'_>, view: &[View], observations: Vec<ObservationTerm>) -> Option<f64> {
        let mut problem = self.data_only(input, view);
        problem.observations = observations;
        let state = self.solved.state.with_views(1);
        self.with_data(&problem, &state).map(|(_, chi2)| chi2)
    }

    /// Problem with `views` in this estimate's columns, without any prior except the views' own.
    fn data_only<'a>(&self, input: &BundleInput<'a>, views: &'a [View]) -> BundleProblem<'a> {
        let mut prior = self.problem.prior.clone();
        prior.information.matrix.fill(0.0);
        prior.forget(|_| true);
        let scales = self.problem.scales.clone();
        let input = BundleInput { views, scales, ..input.clone() };
        BundleProblem::with_layout(&input, self.problem.layout.clone(), prior)
    }

    /// Joins the data of `problem`, linearized at `state`, to this estimate. Also returns the chi-square of their
    /// innovations.
    fn with_data(&self, problem: &BundleProblem<'_>, state: &State) -> Option<(Joined, f64)> {
        let mut normal = NormalEquations::new(problem);
        normal.update(problem, state, Loss::Square);
        let factor = Cholesky::new(&self.solved.normal.matrix + &normal.matrix)?;
        let step = factor.solve(&normal.right);
        let own: f64 = normal.eliminated.iter().map(|own| own.gradient.dot(&(own.inverse * own.gradient))).sum();
        let chi2 = normal.cost - own - step.dot(&normal.right);
        Some((Joined { normal, factor, step }, chi2))
    }
}

/// Held-out data joined to an estimate.
struct Joined {
    normal: NormalEquations,
    factor: Cholesky<f64, Dyn>,
    /// Step of the common parameters.
    step: DVector<f64>,
}

impl Joined {
    fn joints(&self, problem: &BundleProblem<'_>, left_out: &[(usize, View)]) -> Vec<JointInnovation> {
        let mut out = Vec::new();
        let mut groups = self.normal.eliminated.iter();
        for (at, view) in problem.views.iter().enumerate() {
            for own in groups.by_ref().take(1 + usize::from(view.gripper.is_some())) {
                let by_columns = own.own_by_columns(problem, &self.normal.by_tag, at);
                let value = own.inverse * (own.gradient - &by_columns * &self.step);
                let followed = own.inverse * by_columns;
                for joint in (0..MAX_JOINTS).filter(|&j| !view.is_free[j] && own.twists.column(j).norm() > 0.0) {
                    let mut row = DMatrix::from_fn(problem.layout.n, 1, |k, _| followed[(joint, k)]);
                    self.factor.l_dirty().solve_lower_triangular_mut(&mut row);
                    let prior_var = problem.joint_error_var(view, joint);
                    let told_var = prior_var - own.inverse[(joint, joint)] - row.norm_squared();
                    if told_var > TOLD * prior_var {
                        out.push(JointInnovation {
                            joint,
                            view_idx: left_out[at].0,
                            travel_rad: left_out[at].1.travel_rad[joint],
                            normalised: value[joint] / told_var.sqrt(),
                        });
                    }
                }
            }
        }
        out
    }
}

/// Observations of a view, the gripper tag's last.
fn observations_of<'p>(problem: &'p BundleProblem<'_>, view_idx: usize) -> impl Iterator<Item = &'p ObservationTerm> {
    let view = &problem.views[view_idx];
    problem.observations[view.observations.clone()].iter().chain(view.gripper.map(|at| &problem.observations[at]))
}

/// Number of coordinates of the camera's pose that a view determines.
fn camera_numbers(problem: &BundleProblem<'_>, view_idx: usize) -> usize {
    let used = problem.observations[problem.views[view_idx].observations.clone()].iter().filter(|s| s.is_used);
    let (mut points, mut poses) = (0, 0);
    for observation in used {
        match observation.data {
            WeightedMeasurement::Position { .. } => points += 1,
            WeightedMeasurement::Corners(_) | WeightedMeasurement::Pose { .. } | WeightedMeasurement::Board { .. } => {
                poses += 1
            }
        }
    }
    match (poses, points) {
        (0, 0) => 0,
        (0, 1) => 3,
        (0, 2) => 5,
        _ => 6,
    }
}
