//! The covariance without taking the fitted scales for known.
//!
//! A scale's square has, of its `nu` degrees of freedom, an inverse chi-square distribution: the fit takes `sum / nu`,
//! its mean is `sum / (nu - 2)`, and what it scales is Student's t with that mean for its variance (Gelman et al. 2013,
//! Bayesian Data Analysis, 2.6 and 3.2). So the covariance at the end is that of scales whose squares are at their
//! means: `nu / (nu - 2)` times the fitted ones, group by group.

use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::evidence::{Posterior, ScaleTarget, joint_info, updated};
use crate::calib::bundle::linearize::NormalEquations;
use crate::calib::bundle::model::Hyperparameters;
use crate::calib::bundle::priors::mount_std;
use armcal_core::numeric::Loss;

/// The posterior with the scales' squares at their means, and these scales.
pub(crate) struct Marginal {
    pub posterior: Posterior,
    pub scales: Hyperparameters,
}

impl Estimate<'_> {
    /// Lets covariances count what the scales' own uncertainty adds; `first` are the scales that the fit began with.
    pub(crate) fn marginalize(&mut self, first: &Hyperparameters) {
        let mut problem = self.problem.clone();
        let target = ScaleTarget::mean(first);
        problem.set_scales(updated(&problem, &self.solved.state, &self.solved.normal, &self.posterior, &target));
        if self.has_own_priors {
            problem.prior.joint_info = joint_info(&problem, &problem.scales);
            problem.prior.mount_std = mount_std(problem.robot, &problem.scales);
        }
        let mut normal = NormalEquations::new(&problem);
        normal.update(&problem, &self.solved.state, Loss::Square);
        self.marginal =
            Posterior::of(&problem, &normal).map(|posterior| Marginal { posterior, scales: problem.scales });
    }

    /// The posterior of covariances that leave this estimate.
    pub(crate) fn wide_posterior(&self) -> &Posterior {
        self.marginal.as_ref().map_or(&self.posterior, |marginal| &marginal.posterior)
    }

    /// The scales of [`Self::wide_posterior`].
    pub(crate) fn wide_scales(&self) -> &Hyperparameters {
        self.marginal.as_ref().map_or(&self.problem.scales, |marginal| &marginal.scales)
    }
}
