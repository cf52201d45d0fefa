//! One calibration by `bundle`: all views fitted, the verdict by views left out in turn.

use super::CalibError;
use super::associate::{CaptureData, ObservationRejection, View};
use super::bundle::{BundleInput, Estimate, HyperparameterMode, Innovations, Outlier, Selection, estimate};
use super::bundle_setup::{BundleSetup, declared};
use super::bundle_verdict::VerdictInput;
use super::camera_mount::CameraMount;
use super::failed_joint::FailureImpact;
use super::identify::IdentifiedScale;
use super::in_turn::{FOLDS, FoldSums, fold_of};
use super::map::MapResult;
use super::methods::Solution;
use super::model_table::ModelTable;
use super::observability::Unobservable;
use super::problem::{Parameter, ParameterKind, PositionProblem};
use super::result::{Calibration, HeldOutMetrics, Parts, assemble};
use super::uncertainty::{ParameterCovariance, ToolErrorPrediction};
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::routine::Method;

/// What a round of the script hands over.
pub(super) struct BundleCalibration<'a> {
    /// The recording's name, for messages.
    pub recording: String,
    pub messages_hash: String,
    pub robot: &'a Robot,
    pub identified: &'a [IdentifiedScale],
    pub prior: Option<&'a Calibration>,
    pub map: Option<MapResult>,
    pub effort: EstimatePurpose,
}

/// How much is done beside the estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EstimatePurpose {
    /// All that a verdict needs.
    Judged,
    /// The estimate and its covariance, to go on by while views are still being captured.
    Running,
}

/// Fewer views do not tell how large noise and nonlinearity are: the datasheet's figures stand.
const MIN_VIEWS_FOR_EVIDENCE: usize = 12;

impl BundleCalibration<'_> {
    pub(super) fn calibrate(self, mut data: CaptureData) -> Result<Calibration, CalibError> {
        let robot = self.robot;
        let name = || self.recording.clone();
        data.fit.append(&mut data.held_out);
        let declared = declared(robot, &data.fit);
        let first = BundleSetup::new(robot, &data.fit, &declared, self.prior);
        let seen = robot.camera.mount.n_joints;
        if first.input().model.joints.iter().take(seen).all(Vec::is_empty) && declared.is_empty() {
            return Err(CalibError::NothingObservable { recording: name() });
        }
        let found = self.first_estimate(&first, data.fit.len());
        let failures = match self.effort {
            EstimatePurpose::Judged => first.failures(robot, &data.fit, found.as_ref().map(|(found, _)| found)),
            EstimatePurpose::Running => declared.clone(),
        };
        let second;
        let (setup, found) = if failures == declared {
            (&first, found)
        } else {
            second = BundleSetup::new(robot, &data.fit, &failures, self.prior);
            (&second, second.estimate())
        };
        let (found, selections) = found.ok_or_else(|| CalibError::NothingObservable { recording: name() })?;
        let parameters = found.parameters();
        let sound = setup.without_failed(&parameters);
        data.fit = setup.with_estimated_angles(&found, &sound);
        // Left-out views of a freed joint are linearized where the camera saw it.
        let input = BundleInput { views: &data.fit, ..setup.input() };
        let (held_out, innovations) = match self.effort {
            EstimatePurpose::Judged => cross_validated(&input, &found),
            EstimatePurpose::Running => (FoldSums::default().figures(), Vec::new()),
        };
        let as_found = found.as_found(&setup.applied.robot);
        let parameters_found = found.joint_parameters().to_vec();
        let residual_std_rad = std::array::from_fn(|joint| match robot.sensors.get(joint) {
            // Nothing is known of a joint behind the camera but its datasheet.
            Some(spec) if parameters_found.iter().all(|p| p.joint != joint) => spec.linearity_std_rad,
            _ => found.scales().joint_std_rad[joint],
        });
        let covariance = ParameterCovariance {
            parameters: parameters_found,
            matrix: found.joint_covariance(),
            residual_std_rad: Some(residual_std_rad),
        };
        let agreement = setup.agreement(robot);
        let with = FailureImpact {
            datasheet: robot,
            robot: &as_found,
            views: &data.fit,
            failures: &failures,
            found: &found,
            parameters: &parameters,
            covariance: &covariance,
            task: data.task.as_ref(),
        };
        let task = with.tool_error_m().map(|error_m| ToolErrorPrediction { error_m });
        let sound_covariance = setup.sound_covariance(&covariance);
        let sound_robot = Robot { sensors: with_datasheets(&as_found, robot, setup), ..as_found.clone() };
        let fit = PositionProblem::new(&sound_robot, &data.fit);
        let none = PositionProblem::new(&sound_robot, &[]);
        let solution = Solution {
            parameters: sound,
            outcome: found.outcome(),
            evaluations: found.iterations,
            cost_initial: found.cost_initial,
            cost_final: found.cost_final,
        };
        let mut unobservable = behind_the_camera(robot, &found);
        unobservable.retain(|left_out| !setup.has_no_sensor(left_out.parameter.joint));
        unobservable.extend(setup.unobservable());
        for outlier in &found.outliers {
            *data.rejected.entry(ObservationRejection::Outlier).or_default() += 1;
            tracing::debug!("view {}: tag {} left out", outlier.view_idx, outlier.tag_id);
        }
        let outliers = found.outliers.iter().map(|outlier| named(outlier, &data)).collect();
        let map = self.map.map(|map| map.with_tags_of(robot, &found));
        let calibration = assemble(&Parts {
            messages_hash: self.messages_hash,
            robot: &sound_robot,
            method: Method::Bundle,
            data: &data,
            prior: self.prior,
            identified: self.identified,
            fit: &fit,
            held_out: &none,
            solution: &solution,
            covariance: &sound_covariance,
            n_wanted: setup.n_wanted(robot),
            mount: &Ok(None),
            map,
            unobservable: &unobservable,
            linearity_scale: 1.0,
            task,
            cross_validated: Some(held_out),
        });
        let mut calibration = Calibration {
            camera_mount: Some(CameraMount::found(robot, &found, &data.fit)),
            model: Some(ModelTable::of(robot, &found, &selections)),
            outliers,
            ..calibration
        };
        setup.complete(&mut calibration, &with, self.prior, agreement);
        if self.effort == EstimatePurpose::Running {
            if found.is_consistent() {
                return Ok(calibration);
            }
            let problem = "the views contradict each other or the prior".to_owned();
            return Err(CalibError::NoRunningEstimate { recording: self.recording, problem });
        }
        let (input, task) = (BundleInput { views: &data.fit, ..setup.input() }, data.task.as_ref());
        VerdictInput { input: &input, found: &found, innovations: &innovations, task }.complete(&mut calibration);
        Ok(calibration)
    }

    fn first_estimate<'b>(&self, setup: &'b BundleSetup, n_views: usize) -> Option<(Estimate<'b>, Vec<Selection>)> {
        if self.effort == EstimatePurpose::Judged {
            return setup.estimate();
        }
        let evidence =
            if n_views < MIN_VIEWS_FOR_EVIDENCE { HyperparameterMode::Given } else { HyperparameterMode::Fitted };
        estimate(&BundleInput { evidence, ..setup.input() }).map(|found| (found, Vec::new()))
    }
}

/// The sensors as found, those of joints without one as their datasheets say.
fn with_datasheets(found: &Robot, datasheet: &Robot, setup: &BundleSetup) -> Vec<JointSensorSpec> {
    let pairs = found.sensors.iter().zip(&datasheet.sensors).enumerate();
    pairs.map(|(joint, (found, drawn))| if setup.has_no_sensor(joint) { drawn } else { found }.clone()).collect()
}

/// `pose 12: tag 3: 45 sigma`.
fn named(outlier: &Outlier, data: &CaptureData) -> String {
    let pose_idx = data.fit.get(outlier.view_idx).map_or(0, |view| view.pose_idx);
    format!("pose {pose_idx}: tag {}: {:.0} sigma", outlier.tag_id, outlier.sigmas)
}

fn behind_the_camera(robot: &Robot, found: &Estimate<'_>) -> Vec<Unobservable> {
    let all = (0..robot.n_joints())
        .flat_map(|joint| [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Parameter { joint, kind }));
    let missing = all.filter(|p| p.prior_std(robot) > 0.0 && !found.joint_parameters().contains(p));
    let reason = "the camera hangs before this joint: nothing that it sees moves with it";
    missing.map(|parameter| Unobservable { parameter, reason: reason.to_owned() }).collect()
}

/// Views by what was learnt from the others, with the scales of all.
fn cross_validated(input: &BundleInput<'_>, all: &Estimate<'_>) -> (HeldOutMetrics, Vec<Innovations>) {
    let mut sum = FoldSums::default();
    let mut innovations = Vec::new();
    for fold in 0..FOLDS {
        let (fitted, left_out) = fold_of(input.views, fold);
        let part = BundleInput {
            views: &fitted,
            model: all.model.clone(),
            scales: all.scales().clone(),
            evidence: HyperparameterMode::Given,
            ..input.clone()
        };
        let Some(found) = estimate(&part) else { continue };
        let with_places: Vec<(usize, View)> =
            left_out.iter().enumerate().map(|(n, view)| (n * FOLDS + fold, view.clone())).collect();
        innovations.extend(found.innovations(&part, &with_places, &all.outliers));
        sum.add(&left_out, &found.as_found(input.robot), &found.parameters(), input.robot);
    }
    (sum.figures(), innovations)
}
