//! The covariance without taking the fitted scales for known.
//!
//! Held-out cameras test it: their innovations' chi-square over its `n` degrees of freedom is one where scales and
//! model are right. Where it is more, two things are added. A scale's square has, of its `nu` degrees of freedom, an
//! inverse chi-square distribution: the fit takes `sum / nu`, its mean is `sum / (nu - 2)`, and what it scales is
//! Student's t with that mean for its variance (Gelman et al. 2013, Bayesian Data Analysis, 2.6 and 3.2); the
//! covariance is that of scales whose squares are at their means. And all variances are multiplied by the mean of what
//! is left to explain, `chi2 / (n - 2)` (Birge 1932, with the same mean).

use crate::checks::constants::consistency::NAMED_SIGMAS;
use crate::checks::innovations::Innovations;
use crate::model::estimated::Model;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::prior::steps_of;
use crate::model::scales::Hyperparameters;
use crate::solve::estimate::Estimate;
use crate::solve::evidence::{Marginal, Posterior, ScaleTarget, updated};
use crate::solve::linearize::NormalEquations;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::numeric::Loss;
use nalgebra::{DMatrix, DVector};

/// A gain or offset against its datasheet.
#[derive(Clone, Copy)]
pub(crate) struct FromDatasheet {
    pub parameter: Parameter,
    pub sigmas: f64,
    /// In the parameter's unit.
    pub off: f64,
}

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

    /// Gains and offsets of which the datasheet states a sigma, each as it was before its sensor slipped.
    pub(crate) fn from_datasheet(&self) -> Vec<FromDatasheet> {
        let (robot, sound) = (self.problem.robot, JointParameters::default());
        let linear = |kind| matches!(kind, ParameterKind::Gain | ParameterKind::Offset);
        let stated = self.joint_parameters().iter().filter(|p| linear(p.kind) && p.prior_std(robot) > 0.0);
        let apart = stated.map(|&parameter| {
            let off = self.before_slips(parameter) - sound.get(parameter);
            FromDatasheet { parameter, sigmas: off.abs() / parameter.prior_std(robot), off }
        });
        apart.collect()
    }

    /// Where a gain (an offset) is so many datasheet's sigmas off that few sensors are, the sigma of all gains (all
    /// offsets) is taken for as many times larger: those that the views do not tell are then as unsure.
    pub(crate) fn widen_unusual(&mut self) {
        if !self.has_own_priors {
            return;
        }
        let apart = self.from_datasheet();
        for kind in [ParameterKind::Gain, ParameterKind::Offset] {
            let alike: Vec<Parameter> =
                apart.iter().map(|of| of.parameter).filter(|parameter| parameter.kind == kind).collect();
            let sigmas = apart.iter().filter(|of| of.parameter.kind == kind).map(|of| of.sigmas).fold(0.0, f64::max);
            if sigmas > NAMED_SIGMAS {
                let factor = self.marginal.as_ref().map_or(1.0, |marginal| marginal.factor);
                let covariance = self.with_wider_priors(&alike, sigmas, self.wide_covariance() / factor) * factor;
                let joint_std_rad = std::array::from_fn(|joint| self.residual_std_rad(joint));
                self.marginal = Some(Marginal { covariance, joint_std_rad, factor });
            }
        }
    }

    /// `covariance` with the priors of `parameters` wider by `factor`. A variance `p^2` that becomes `f^2 p^2` changes
    /// the information by `-d e e^T`, `d = (1 - 1 / f^2) / p^2`, and the covariance by `C e d e^T C / (1 - d e^T C e)`
    /// (Sherman and Morrison 1950); e: the parameter's column, of an offset with its sensor's slips.
    fn with_wider_priors(&self, parameters: &[Parameter], factor: f64, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
        let layout = self.joint_parameters();
        for parameter in parameters {
            let mut unit = DVector::zeros(covariance.nrows());
            let steps =
                if parameter.kind == ParameterKind::Offset { steps_of(layout, parameter.joint) } else { vec![] };
            let own = layout.iter().position(|p| p == parameter);
            own.into_iter().chain(steps).for_each(|column| unit[column] = 1.0);
            let prior_var = parameter.prior_std(self.problem.robot).powi(2);
            let column = &covariance * &unit;
            // Of the prior's variance the views leave at most all.
            let left = (unit.dot(&column) / prior_var).min(1.0);
            let less = 1.0 - factor.powi(-2);
            covariance += &column * column.transpose() * (less / prior_var / (1.0 - less * left));
        }
        covariance
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
