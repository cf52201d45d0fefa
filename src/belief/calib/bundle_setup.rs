//! What `bundle` is started from: failed joints taken care of, a prior taken up.

use super::associate::View;
use super::bundle::{
    BundleInput, CalibrationPrior, Estimate, Failure, FailureAdjusted, HyperparameterMode, PriorConsistency, Selection,
    SensorUse, failures, select_model,
};
use super::failed_joint::{FailureImpact, PriorTable};
use super::observability::Unobservable;
use super::problem::{JointParameters, Parameter, ParameterKind};
use super::result::{Calibration, CovarianceTable, Status, shortened_rows};
use super::uncertainty::ParameterCovariance;
use armcal_core::robot::{FailedKind, Robot};

/// One way to see the views.
pub(super) struct BundleSetup {
    pub applied: FailureAdjusted,
    warm: Option<Result<CalibrationPrior, String>>,
}

/// The declared failures of `robot`.
pub(super) fn declared(robot: &Robot, views: &[View]) -> Vec<Failure> {
    let before_camera = robot.failed.iter().filter(|failed| failed.joint < robot.camera.mount.n_joints);
    before_camera.map(|&failed| Failure::declared(failed, views.len())).collect()
}

impl BundleSetup {
    pub(super) fn new(robot: &Robot, views: &[View], failed: &[Failure], prior: Option<&Calibration>) -> Self {
        let at = prior.map_or_else(JointParameters::default, |prior| prior.parameters(robot));
        let applied = FailureAdjusted::new(robot, views, failed, &at);
        let warm = prior.map(|prior| {
            CalibrationPrior::new(prior, &applied)
                .ok_or_else(|| "the prior's covariance is none: it has no inverse".to_owned())
        });
        Self { applied, warm }
    }

    fn warm(&self) -> Option<&CalibrationPrior> {
        self.warm.as_ref().and_then(|warm| warm.as_ref().ok())
    }

    pub(super) fn input(&self) -> BundleInput<'_> {
        let warm = self.warm().and_then(|warm| warm.input(&self.applied.views, HyperparameterMode::Fitted));
        warm.unwrap_or_else(|| self.applied.input(HyperparameterMode::Fitted))
    }

    pub(super) fn estimate(&self) -> Option<(Estimate<'_>, Vec<Selection>)> {
        select_model(&self.input())
    }

    /// This setup's failures, and those that the views show beside them.
    pub(super) fn failures(&self, robot: &Robot, views: &[View], found: Option<&Estimate<'_>>) -> Vec<Failure> {
        failures(robot, views, &self.applied.failures, found)
    }

    /// Gains and offsets that the views alone must tell.
    pub(super) fn n_wanted(&self, robot: &Robot) -> usize {
        let per_joint = 2 * robot.camera.mount.n_joints;
        let lost = self
            .applied
            .failures
            .iter()
            .filter(|failure| failure.leaves_no_sensor())
            .map(|failure| if failure.kind == FailedKind::Locked { 1 } else { 2 });
        let cold = per_joint.saturating_sub(lost.sum());
        self.warm().map_or(cold, |warm| warm.n_unknown(robot).min(cold))
    }

    /// Whether the views agree with the prior, and why the result must be refused if they do not.
    pub(super) fn agreement(&self, robot: &Robot) -> (Option<PriorConsistency>, Option<String>) {
        match &self.warm {
            None => (None, None),
            Some(Err(problem)) => (None, Some(problem.clone())),
            Some(Ok(warm)) => match warm.agreement(&self.applied.views) {
                None => (None, Some("the views determine too little to be held against the prior".to_owned())),
                Some(agreement) => {
                    let why = agreement.is_beyond_chance().then(|| agreement.in_words(robot));
                    (Some(agreement), why)
                }
            },
        }
    }

    fn elapsed_h(&self) -> f64 {
        self.warm().map_or(0.0, |warm| warm.elapsed_h)
    }

    /// The views with the angles that were found where no sensor tells them; `parameters` without those of joints that have none.
    pub(super) fn with_estimated_angles(&self, found: &Estimate<'_>, parameters: &JointParameters) -> Vec<View> {
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

    pub(super) fn has_no_sensor(&self, joint: usize) -> bool {
        self.applied.failures.iter().any(|failure| failure.joint == joint && failure.leaves_no_sensor())
    }

    /// `parameters` with the datasheet's for joints without a sensor.
    pub(super) fn without_failed(&self, parameters: &JointParameters) -> JointParameters {
        let mut sound = *parameters;
        for joint in (0..self.applied.robot.n_joints()).filter(|&joint| self.has_no_sensor(joint)) {
            for kind in ParameterKind::all() {
                let parameter = Parameter { joint, kind };
                sound.set(parameter, JointParameters::default().get(parameter));
            }
        }
        sound
    }

    pub(super) fn sound_covariance(&self, covariance: &ParameterCovariance) -> ParameterCovariance {
        let joints = (0..self.applied.robot.n_joints()).filter(|&joint| self.has_no_sensor(joint));
        joints.fold(covariance.clone(), |covariance, joint| covariance.without_joint(joint))
    }

    /// What failed joints leave undetermined.
    pub(super) fn unobservable(&self) -> Vec<Unobservable> {
        let of = |failure: &Failure| {
            let reason = match failure.kind {
                FailedKind::Locked => "the joint is locked: its sensor is not looked at",
                FailedKind::Dead | FailedKind::Stuck | FailedKind::Jumps => "its sensor says nothing",
            };
            [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Unobservable {
                parameter: Parameter { joint: failure.joint, kind },
                reason: reason.to_owned(),
            })
        };
        self.applied.failures.iter().filter(|failure| failure.reading == SensorUse::Ignored).flat_map(of).collect()
    }

    /// What was never estimated, or only before the sensor failed, is the datasheet's.
    fn forget_failed(&self, calibration: &mut Calibration, datasheet: &Robot) {
        let pairs = calibration.joint.iter_mut().zip(&datasheet.sensors).enumerate();
        for (_, (joint, spec)) in pairs.filter(|(joint, _)| self.has_no_sensor(*joint)) {
            (joint.gain_estimated, joint.offset_estimated) = (false, false);
            joint.gain_std_rad_per_count = spec.gain_std / spec.counts_per_rad.abs();
            joint.offset_std_rad = spec.offset_std_rad;
        }
    }

    /// Writes failures, prior and the camera's mount to the result, and refuses it where they ask for it.
    pub(super) fn complete(
        &self,
        calibration: &mut Calibration,
        with: &FailureImpact<'_>,
        prior: Option<&Calibration>,
        agreement: (Option<PriorConsistency>, Option<String>),
    ) {
        let (agreement, contradiction) = agreement;
        calibration.failed_joint = with.tables();
        calibration.prior = prior.zip(agreement).map(|(prior, agreement)| {
            PriorTable::of(&prior.messages_hash, self.elapsed_h(), &agreement, with.datasheet)
        });
        add_mount(calibration, with);
        self.forget_failed(calibration, with.datasheet);
        let failed = with.refusal(&calibration.failed_joint);
        let twice = prior
            .filter(|prior| prior.messages_hash == calibration.messages_hash)
            .map(|_| "the prior rests on these very messages, which must not count twice".to_owned());
        let reasons: Vec<String> =
            [twice, contradiction, failed, calibration.refusal.take()].into_iter().flatten().collect();
        if !reasons.is_empty() {
            calibration.status = Status::Refused;
            calibration.refusal = Some(reasons.join("; "));
        }
    }
}

/// The camera's mount with its covariance, so that a warm start knows it together with the joints.
fn add_mount(calibration: &mut Calibration, with: &FailureImpact<'_>) {
    let Some(full) = super::bundle::with_mount_rows(with.found) else { return };
    let all = with.found.joint_parameters();
    let kept: Vec<usize> = (0..full.nrows())
        .filter(|&k| all.get(k).is_none_or(|p| calibration.covariance.parameters.contains(&p.name(with.robot))))
        .collect();
    let name = |&k: &usize| match all.get(k) {
        Some(parameter) => parameter.name(with.robot),
        None => super::bundle::MOUNT_ROWS[k - all.len()].to_owned(),
    };
    let matrix = nalgebra::DMatrix::from_fn(kept.len(), kept.len(), |i, k| full[(kept[i], kept[k])]);
    calibration.covariance =
        CovarianceTable { parameters: kept.iter().map(name).collect(), rows: shortened_rows(&matrix) };
}
