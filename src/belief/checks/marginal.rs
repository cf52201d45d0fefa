//! The covariance without taking the fitted scales for known.
//!
//! Held-out cameras test it: their innovations' chi-square over its `n` degrees of freedom is one where scales and
//! model are right. Where it is more, two things are added. A scale's square has, of its `nu` degrees of freedom, an
//! inverse chi-square distribution: the fit takes `sum / nu`, its mean is `sum / (nu - 2)`, and what it scales is
//! Student's t with that mean for its variance (Gelman et al. 2013, Bayesian Data Analysis, 2.6 and 3.2); the
//! covariance is that of scales whose squares are at their means. And all variances are multiplied by the mean of what
//! is left to explain, `chi2 / (n - 2)` (Birge 1932, with the same mean).

use crate::checks::innovations::Innovations;
use crate::model::estimated::Model;
use crate::model::scales::Hyperparameters;
use crate::solve::estimate::Estimate;
use crate::solve::evidence::{Marginal, Posterior, ScaleTarget, updated};
use crate::solve::linearize::NormalEquations;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::Loss;
use nalgebra::DMatrix;

impl Estimate<'_> {
    /// Widens the covariance where `innovations` of the folds are larger than they should be; `first` are the scales
    /// that the fit began with.
    pub(crate) fn widen(&mut self, innovations: &[Innovations], first: &Hyperparameters) {
        let chi2: f64 = innovations.iter().map(|fold| fold.camera_chi2).sum();
        let n = innovations.iter().map(|fold| fold.camera_dof).sum::<usize>() as f64;
        if chi2 <= n || n <= 2.0 {
            return;
        }
        let mut problem = self.problem.clone();
        let target = ScaleTarget::mean(first);
        let scales = updated(&problem, &self.solved.state, &self.solved.normal, &self.posterior, &target);
        problem.set_scales(scales);
        if self.has_own_priors {
            problem.rescale_priors();
        }
        let mut normal = NormalEquations::new(&problem);
        normal.update(&problem, &self.solved.state, Loss::Square);
        let factor = chi2 / (n - 2.0);
        self.marginal = Posterior::of(&problem, &normal).map(|posterior| Marginal {
            covariance: posterior.covariance * factor,
            joint_std_rad: error_std_rad(&self.model, &problem.scales).map(|std_rad| std_rad * factor.sqrt()),
            factor,
        });
    }

    /// Takes the scales whose squares are the means of what the data leave possible, see the module, and linearizes
    /// under them.
    pub(crate) fn take_mean_scales(&mut self, first: &Hyperparameters) {
        let problem = &mut self.problem;
        let target = ScaleTarget::mean(first);
        let scales = updated(problem, &self.solved.state, &self.solved.normal, &self.posterior, &target);
        problem.set_scales(scales);
        if self.has_own_priors {
            problem.rescale_priors();
        }
        self.solved.normal.update(problem, &self.solved.state, Loss::Square);
    }

    /// Covariance of the common parameters as it leaves this estimate.
    pub(crate) fn wide_covariance(&self) -> &DMatrix<f64> {
        self.marginal.as_ref().map_or(&self.posterior.covariance, |marginal| &marginal.covariance)
    }

    /// What a joint is off at a new pose beyond its sensor's model, one sigma; where offsets walk, as long after the
    /// last view as the first one was before it.
    pub(crate) fn residual_std_rad(&self, joint: usize) -> f64 {
        let fitted = || error_std_rad(&self.model, &self.problem.scales);
        self.marginal.as_ref().map_or_else(fitted, |marginal| marginal.joint_std_rad)[joint]
    }
}

/// Of each joint at a new pose: what is new in each view, and a walk as long as that during the views.
fn error_std_rad(model: &Model, scales: &Hyperparameters) -> [f64; MAX_JOINTS] {
    let walked = |joint: usize| if model.walk.is_some() { scales.walk_std_rad[joint] } else { 0.0 };
    std::array::from_fn(|joint| scales.joint_std_rad[joint].hypot(walked(joint)))
}
