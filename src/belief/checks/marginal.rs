//! Covariance that includes the uncertainty of the fitted scales.
//!
//! Held-out cameras test the covariance: their innovations' chi-square over its `n` degrees of freedom is one if scales
//! and model are right. If it is larger, two corrections widen the covariance.
//!
//! First, the square of a scale with `nu` degrees of freedom has an inverse chi-square distribution: the fit takes
//! `sum / nu`, but its mean is `sum / (nu - 2)`. The scaled quantity is Student's t with that mean as its variance
//! (Gelman et al. 2013, Bayesian Data Analysis, 2.6 and 3.2). So the covariance uses scales whose squares are at their
//! means. Second, all variances are multiplied by the mean of the remaining ratio, `chi2 / (n - 2)` (Birge 1932, with
//! the same mean).

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

/// Deviation of a gain or offset from its datasheet.
#[derive(Clone, Copy)]
pub(crate) struct FromDatasheet {
    pub parameter: Parameter,
    pub sigmas: f64,
    /// Deviation in the parameter's unit.
    pub off: f64,
}

impl Estimate<'_> {
    /// Widens the covariance if the `innovations` of the folds are larger than predicted. `first`: scales at the start
    /// of the fit.
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

    /// Deviations of gains and offsets from their datasheets, where these state a standard deviation; each as it was
    /// before its sensor slipped.
    pub(crate) fn apart_from_datasheet(&self) -> Vec<FromDatasheet> {
        let (robot, sound) = (self.problem.robot, JointParameters::default());
        let linear = |kind| matches!(kind, ParameterKind::Gain | ParameterKind::Offset);
        let stated = self.joint_parameters().iter().filter(|p| linear(p.kind) && p.prior_std(robot) > 0.0);
        let apart = stated.map(|&parameter| {
            let off = self.before_slips(parameter) - sound.get(parameter);
            FromDatasheet { parameter, sigmas: off.abs() / parameter.prior_std(robot), off }
        });
        apart.collect()
    }

    /// Widens the priors of all gains (or all offsets) if one is an unusual number of standard deviations from its
    /// datasheet. That number is the factor: gains or offsets that the views do not determine become as uncertain.
    pub(crate) fn widen_unusual(&mut self) {
        if !self.has_own_priors {
            return;
        }
        let apart = self.apart_from_datasheet();
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

    /// Returns `covariance` with the priors of `parameters` wider by `factor`.
    ///
    /// A variance `p^2` that becomes `f^2 p^2` changes the information by `-d e e^T`, `d = (1 - 1 / f^2) / p^2`. The
    /// covariance changes by `C e d e^T C / (1 - d e^T C e)` (Sherman and Morrison 1950). e: unit vector of the
    /// parameter's column; for an offset, also of its sensor's slips.
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
            // The views leave at most all of the prior's variance.
            let left = (unit.dot(&column) / prior_var).min(1.0);
            let less = 1.0 - factor.powi(-2);
            covariance += &column * column.transpose() * (less / prior_var / (1.0 - less * left));
        }
        covariance
    }

    /// Takes the scales whose squares are at their means under the data (see the module), and linearizes under them.
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

    /// Covariance of the common parameters, widened if the estimate was.
    pub(crate) fn wide_covariance(&self) -> &DMatrix<f64> {
        self.marginal.as_ref().map_or(&self.posterior.covariance, |marginal| &marginal.covariance)
    }

    /// Standard deviation of a joint's error at a new configuration beyond its sensor's model, rad. With walking
    /// offsets, it holds as long after the last view as the first view was before it.
    pub(crate) fn residual_std_rad(&self, joint: usize) -> f64 {
        let fitted = || error_std_rad(&self.model, &self.problem.scales);
        self.marginal.as_ref().map_or_else(fitted, |marginal| marginal.joint_std_rad)[joint]
    }
}

/// Standard deviation of each joint's error at a new configuration, rad. It combines the error new in each view and a
/// walk as long as that during the views.
fn error_std_rad(model: &Model, scales: &Hyperparameters) -> [f64; MAX_JOINTS] {
    let walked = |joint: usize| if model.walk.is_some() { scales.walk_std_rad[joint] } else { 0.0 };
    std::array::from_fn(|joint| scales.joint_std_rad[joint].hypot(walked(joint)))
}
