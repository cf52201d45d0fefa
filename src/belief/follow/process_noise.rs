//! Rate of change of the sensors' offsets, and std of their residual errors, tuned by the likelihood of the views.
//!
//! Between two views an offset gains the variance `q^2 h + s^2 (t^2 dT^2 + p^2 dP^2)`. That is h hours of random walk,
//! and a share s of the datasheet's temperature and pressure effects. Sensors follow thermometer and depth gauge with a
//! lag. `ln` of each factor moves along the score of the views so far over its Fisher information (Fisher scoring). The
//! belief before a view counts as given. The prior is about the datasheet's value.

use crate::explain::calibration_prior::drift_std_rad_per_sqrt_h;
use crate::follow::constants::process_noise::{
    BEHIND_SHARE, ERROR_PRIOR_VIEWS, FORGETTING, LEAST_OF_FIRST, LN_BOUND, LN_STD,
};
use crate::follow::filter::{Filter, ViewUpdate};
use crate::model::scales::Hyperparameters;
use crate::solve::time_error::TimeErrorOfView;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::Robot;
use armcal_core::sensor::ConditionChange;

/// The factor of one variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogFactor {
    ln: f64,
    information: f64,
}

impl Default for LogFactor {
    fn default() -> Self {
        Self { ln: 0.0, information: LN_STD.powi(-2) }
    }
}

impl LogFactor {
    pub(crate) fn value(self) -> f64 {
        self.ln.exp()
    }

    /// Makes one step by the score and the information of a view for `ln` of the variance.
    fn learn(&mut self, score: f64, information: f64) {
        if !(score.is_finite() && information.is_finite()) {
            return;
        }
        let prior = LN_STD.powi(-2);
        self.information = prior + FORGETTING * (self.information - prior) + information;
        // The step moves towards the prior by the forgotten share.
        let by = (score - (1.0 - FORGETTING) * prior * self.ln) / self.information;
        self.ln = (self.ln + by.clamp(-0.5, 0.5)).clamp(-LN_BOUND, LN_BOUND);
    }
}

/// Rate of change of the offsets.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProcessNoise {
    /// Datasheet values, rad^2/h, rad/K, rad/MPa.
    walk_var_per_h: [f64; MAX_JOINTS],
    by_k: f64,
    by_mpa: f64,
    /// Factors that all joints share, because their sensors are of one kind.
    walk: LogFactor,
    behind: LogFactor,
    /// Variances added before the present view, by the two causes.
    added: [[f64; 2]; MAX_JOINTS],
}

impl ProcessNoise {
    /// Starts with the datasheet's values.
    pub(crate) fn datasheet(robot: &Robot, scales: &Hyperparameters) -> Self {
        let mut walk_var_per_h = [0.0; MAX_JOINTS];
        for (variance, spec) in walk_var_per_h.iter_mut().zip(&robot.sensors) {
            *variance = drift_std_rad_per_sqrt_h(spec).powi(2);
        }
        Self {
            walk_var_per_h,
            by_k: scales.offset_std_rad_per_k,
            by_mpa: scales.offset_std_rad_per_mpa,
            walk: LogFactor::default(),
            behind: LogFactor::default(),
            added: [[0.0; 2]; MAX_JOINTS],
        }
    }

    /// Returns the variance of each joint's offset after a change of conditions, by random walk and by lag.
    fn variances(&self, change: &ConditionChange) -> [[f64; 2]; MAX_JOINTS] {
        let share = BEHIND_SHARE * BEHIND_SHARE * self.behind.value();
        let effects = (self.by_k * change.oil_k).powi(2) + (self.by_mpa * change.pressure_mpa).powi(2);
        let hours = change.elapsed_h.abs() * self.walk.value();
        self.walk_var_per_h.map(|per_h| [per_h * hours, share * effects])
    }

    /// Returns columns of `filter` and the variances that they gain.
    pub(crate) fn widening(&self, filter: &Filter, change: &ConditionChange) -> Vec<(usize, f64)> {
        let variances = self.variances(change);
        filter.offsets().map(|(joint, column)| (column, variances[joint][0] + variances[joint][1])).collect()
    }

    /// Widens `filter` and keeps the added variances for [`Self::learn`].
    pub(crate) fn widen(&mut self, filter: &mut Filter, change: &ConditionChange) {
        self.added = self.variances(change);
        filter.widen(&self.widening(filter, change));
    }

    /// Tunes the factors by a view.
    pub(crate) fn learn(&mut self, update: &ViewUpdate) {
        let [mut walk, mut behind] = [[0.0; 2]; 2];
        for (added, score) in self.added.iter().zip(&update.scores.walk) {
            for (sums, variance) in [&mut walk, &mut behind].into_iter().zip(added) {
                sums[0] += 0.5 * variance * (score.a * score.a - score.b);
                sums[1] += 0.5 * (variance * score.b).powi(2);
            }
        }
        self.walk.learn(walk[0], walk[1]);
        self.behind.learn(behind[0], behind[1]);
    }

    /// Returns the factors of the random walk and of the lag over the first guess, as standard deviations.
    pub(crate) fn factors(&self) -> [f64; 2] {
        [self.walk.value().sqrt(), self.behind.value().sqrt()]
    }
}

/// Std of the sensors' residual errors between views, by the views so far.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointErrorSize {
    first: [f64; MAX_JOINTS],
    sum_var: [f64; MAX_JOINTS],
    n: [f64; MAX_JOINTS],
}

impl JointErrorSize {
    pub(crate) fn new(scales: &Hyperparameters) -> Self {
        Self {
            first: scales.joint_std_rad,
            sum_var: scales.joint_std_rad.map(|std| ERROR_PRIOR_VIEWS * std * std),
            n: [ERROR_PRIOR_VIEWS; MAX_JOINTS],
        }
    }

    /// Makes a step of MacKay's fixed point with one view of an arm at rest: the determined share of an error counts.
    pub(crate) fn learn(&mut self, update: &ViewUpdate, scales: &mut Hyperparameters) {
        for (joint, error) in update.joint_error.iter().enumerate().filter(|(_, error)| error.prior_var > 0.0) {
            let told = (1.0 - error.var / error.prior_var).clamp(0.0, 1.0);
            let reading_var = error.prior_var - scales.joint_std_rad[joint].powi(2);
            self.sum_var[joint] += error.error_rad.powi(2) - told * reading_var;
            self.n[joint] += told;
            let least = (LEAST_OF_FIRST * self.first[joint]).powi(2);
            scales.joint_std_rad[joint] = (self.sum_var[joint] / self.n[joint]).max(least).sqrt();
        }
    }
}

/// The time error of the images of a moving arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct JitterSize {
    first_s: f64,
    factor: LogFactor,
}

impl JitterSize {
    pub(crate) fn new(scales: &Hyperparameters) -> Self {
        Self { first_s: scales.time_jitter_std_s, factor: LogFactor::default() }
    }

    /// Learns from the time error of a view of a moving arm.
    pub(crate) fn learn(&mut self, update: &ViewUpdate, scales: &mut Hyperparameters) {
        let TimeErrorOfView { sigmas, var } = update.time_error;
        let told = (1.0 - var).clamp(0.0, 1.0);
        self.factor.learn(0.5 * (sigmas * sigmas - told), 0.5 * told * told);
        scales.time_jitter_std_s = self.first_s * self.factor.value().sqrt();
    }
}
