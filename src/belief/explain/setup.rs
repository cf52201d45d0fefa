//! Setup of `bundle`: adjusts for failed joints, and applies a prior.

use crate::explain::calibration_prior::CalibrationPrior;
use crate::explain::drawing::Drawing;
use crate::explain::failures::{Failure, FailureAdjusted, SensorUse};
use crate::explain::model_selection::{Selection, estimate_clock, select_model};
use crate::file::calibration::Calibration;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::positions::unobservable::Unobservable;
use crate::say::refusal::Refusal;
use crate::solve::covariance::ParameterCovariance;
use crate::solve::estimate::Estimate;
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::views::view::View;
use armcal_core::robot::{FailedJoint, FailedKind, Robot};

/// Views under one hypothesis of failed joints.
pub(crate) struct BundleSetup {
    pub applied: FailureAdjusted,
    prior: Option<Result<CalibrationPrior, Refusal>>,
    drawing: Drawing,
    clocks: Clocks,
}

/// Times of a view's joint readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Clocks {
    /// Stamps of the images, as they are.
    AsStamped,
    /// Images' own times, by the estimated offset between the clocks; its remainder is a column.
    Aligned,
}

/// Declared failures of `robot`, one a joint: a locked joint whose sensor is lost is held.
pub(crate) fn declared(robot: &Robot, views: &[View]) -> Vec<Failure> {
    let of_joint = |of_one: &[FailedJoint]| {
        let all = of_one.iter().filter(|failed| failed.joint < robot.n_seen_joints());
        let lost = all.clone().find(|failed| failed.kind != FailedKind::Locked);
        let failure = Failure::declared(*lost.or(all.clone().next())?, views.len());
        Some(Failure { is_held: lost.is_some() && robot.is_locked(failure.joint), ..failure })
    };
    robot.failed.chunk_by(|a, b| a.joint == b.joint).filter_map(of_joint).collect()
}

impl BundleSetup {
    pub(crate) fn new(robot: &Robot, views: &[View], failed: &[Failure], prior: Option<&Calibration>) -> Self {
        let at = prior.map_or_else(JointParameters::default, |prior| prior.parameters(robot));
        let mut applied = FailureAdjusted::new(robot, views, failed, &at);
        if let Some(prior) = prior.filter(|prior| !prior.lens.is_empty()) {
            let seen_by = prior.with_lenses(robot);
            applied.views.iter_mut().for_each(|view| view.see_through(&seen_by));
        }
        let prior = prior.map(|prior| CalibrationPrior::new(prior, &applied).ok_or(Refusal::PriorSingular));
        Self { applied, prior, drawing: Drawing::default(), clocks: Clocks::AsStamped }
    }

    /// Returns this setup with the departures in `drawing` estimated, too.
    pub(crate) fn with_drawing(self, drawing: &Drawing) -> Self {
        Self { drawing: drawing.clone(), ..self }
    }

    /// Returns this setup for views with these clocks.
    pub(crate) fn with_clocks(self, clocks: Clocks) -> Self {
        Self { clocks, ..self }
    }

    /// Prior, or the reason that it cannot be used.
    pub(crate) fn prior(&self) -> Option<&Result<CalibrationPrior, Refusal>> {
        self.prior.as_ref()
    }

    fn usable_prior(&self) -> Option<&CalibrationPrior> {
        self.prior.as_ref().and_then(|prior| prior.as_ref().ok())
    }

    pub(crate) fn input(&self) -> BundleInput<'_> {
        let of_prior =
            self.usable_prior().and_then(|prior| prior.input(&self.applied.views, HyperparameterMode::Fitted));
        let mut input = of_prior.unwrap_or_else(|| self.applied.input(HyperparameterMode::Fitted));
        self.drawing.apply(&mut input);
        if self.clocks == Clocks::Aligned {
            estimate_clock(&mut input);
        }
        input
    }

    pub(crate) fn estimate(&self) -> Option<(Estimate<'_>, Vec<Selection>)> {
        select_model(&self.input())
    }

    /// Number of gains and offsets that only the views can determine.
    pub(crate) fn n_wanted(&self, robot: &Robot) -> usize {
        let per_joint = 2 * robot.n_seen_joints();
        let lost = self
            .applied
            .failures
            .iter()
            .filter(|failure| failure.leaves_no_sensor())
            .map(|failure| if failure.stands_still() { 1 } else { 2 });
        let cold = per_joint.saturating_sub(lost.sum());
        self.usable_prior().map_or(cold, |prior| prior.n_unknown(robot).min(cold))
    }

    /// Time between the prior's last view and these, h.
    pub(crate) fn elapsed_h(&self) -> f64 {
        self.usable_prior().map_or(0.0, |prior| prior.elapsed_h)
    }

    /// Returns the views with the estimated angle of each joint that has no sensor reading; `parameters` lack joints
    /// without a sensor.
    pub(crate) fn with_estimated_angles(&self, found: &Estimate<'_>, parameters: &JointParameters) -> Vec<View> {
        let sensors = parameters.sensors(&self.applied.robot);
        let mut views = self.applied.views.clone();
        for (view_idx, view) in views.iter_mut().enumerate() {
            let departure = view.conditions.departure_from(&parameters.reference);
            for (joint, model) in sensors.models.iter().enumerate() {
                let is_locked = self.has_no_sensor(joint);
                if view.is_free[joint] || is_locked {
                    view.travel_rad[joint] = model.travel_under_rad(found.angle(view_idx, joint).0, &departure);
                }
            }
        }
        views
    }

    pub(crate) fn has_no_sensor(&self, joint: usize) -> bool {
        self.applied.failures.iter().any(|failure| failure.joint == joint && failure.leaves_no_sensor())
    }

    /// Returns `parameters` with the datasheet's for joints without a sensor.
    pub(crate) fn without_failed(&self, parameters: &JointParameters) -> JointParameters {
        let mut sound = *parameters;
        for joint in (0..self.applied.robot.n_joints()).filter(|&joint| self.has_no_sensor(joint)) {
            for kind in ParameterKind::all() {
                let parameter = Parameter { joint, kind };
                sound.set(parameter, JointParameters::default().get(parameter));
            }
        }
        sound
    }

    pub(crate) fn without_failed_rows(&self, covariance: &ParameterCovariance) -> ParameterCovariance {
        let joints = (0..self.applied.robot.n_joints()).filter(|&joint| self.has_no_sensor(joint));
        joints.fold(covariance.clone(), |covariance, joint| covariance.without_joint(joint))
    }

    /// Parameters that failed joints leave undetermined.
    pub(crate) fn unobservable(&self) -> Vec<Unobservable> {
        let of = |failure: &Failure| {
            let reason = match failure.kind {
                FailedKind::Locked => "the joint is locked: its sensor is not looked at",
                FailedKind::NotMoved => "the joint was not moved",
                FailedKind::Dead | FailedKind::Stuck | FailedKind::Jumps => "its sensor says nothing",
            };
            [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Unobservable {
                parameter: Parameter { joint: failure.joint, kind },
                reason: reason.to_owned(),
            })
        };
        self.applied.failures.iter().filter(|failure| failure.reading == SensorUse::Ignored).flat_map(of).collect()
    }

    /// Resets to the datasheet parameters that were never estimated, or only before the sensor failed.
    pub(crate) fn forget_failed(&self, calibration: &mut Calibration, datasheet: &Robot) {
        let pairs = calibration.joint.iter_mut().zip(&datasheet.sensors).enumerate();
        for (_, (joint, spec)) in pairs.filter(|(joint, _)| self.has_no_sensor(*joint)) {
            (joint.gain_estimated, joint.offset_estimated) = (false, false);
            joint.gain_std_rad_per_count = spec.gain_std / spec.counts_per_rad.abs();
            joint.offset_std_rad = spec.offset_std_rad;
        }
    }
}
