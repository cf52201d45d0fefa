//! Effect of failed joints on the tool error, and whether the task tolerates it.

use crate::batch::constants::failure_impact::{MIN_VIEWS_SINCE, UNIT_SHARE};
use crate::explain::failure_detection::is_suspicious;
use crate::explain::failures::{Failure, FailureSource, slip_in_words};
use crate::file::failed_joint::FailedJointTable;
use crate::judge::{TargetError, U95Table};
use crate::model::parameters::JointParameters;
use crate::positions::position_problem::PositionProblem;
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use crate::say::reading_error::{MisreadReadings, ReadingError};
use crate::say::refusal::Refusal;
use crate::solve::covariance::{ParameterCovariance, ToolErrorPrediction, predict_tool_error};
use crate::solve::details::TargetPrediction;
use crate::solve::estimate::Estimate;
use crate::views::data_checks::joint_with_same_readings;
use crate::views::view::{TaskRests, View};
use armcal_core::codes::Code;
use armcal_core::kinematics::JointKind;
use armcal_core::robot::{FailedJoint, FailedKind, Robot};
use armcal_core::stats::Summary;
use armcal_core::streams::ReachTask;
use nalgebra::Matrix3;

/// An estimate with failed joints, as input for the predicted tool error.
pub(crate) struct FailureImpact<'a> {
    pub datasheet: &'a Robot,
    /// The arm as estimated, with camera and tags at their estimated poses.
    pub robot: &'a Robot,
    pub views: &'a [View],
    /// The views with the readings as they were read.
    pub as_read: &'a [View],
    pub failures: &'a [Failure],
    pub found: &'a Estimate<'a>,
    pub parameters: &'a JointParameters,
    /// Covariance of the parameters, including the rows of locked joints.
    pub covariance: &'a ParameterCovariance,
    pub task: Option<TaskRests<'a>>,
}

/// Source of a failed joint's angle.
#[derive(Clone, Copy, PartialEq, Eq)]
enum AngleSource {
    AsItIs,
    ByCamera,
    ByDatasheet,
}

impl FailureImpact<'_> {
    /// Predicted tool error over the task with the failures as they are.
    pub(crate) fn tool_error_m(&self) -> Option<Summary> {
        self.prediction().map(|predicted| predicted.error_m)
    }

    /// Predicted tool error at each target with the failures as they are.
    pub(crate) fn prediction(&self) -> Option<ToolErrorPrediction> {
        self.prediction_where(usize::MAX, AngleSource::AsItIs)
    }

    /// Tables of the failed joints; reversed sensors and other scales are only findings, and have no table.
    pub(crate) fn tables(&self) -> Vec<FailedJointTable> {
        let tabled = self.of_sensors().filter(|failure| failure.line.is_none());
        tabled.map(|failure| self.table(failure)).collect()
    }

    /// The failures of sensors, without those of joints that have another joint's readings.
    fn of_sensors(&self) -> impl Iterator<Item = &Failure> {
        self.failures.iter().filter(|failure| self.joint_read(failure).is_none())
    }

    /// The joint whose readings a failed one has.
    fn joint_read(&self, failure: &Failure) -> Option<usize> {
        let is_detected = failure.found == FailureSource::Detected && !failure.is_step();
        is_detected.then(|| joint_with_same_readings(self.as_read, self.robot, failure.joint)).flatten()
    }

    fn table(&self, failure: &Failure) -> FailedJointTable {
        let joint = failure.joint;
        let pose = |&view_idx: &usize| self.views[view_idx].pose_idx;
        let is_locked = failure.stands_still();
        let has_no_sensor = failure.has_no_sensor_now();
        let angle = self.locked_angle(failure);
        FailedJointTable {
            joint: self.robot.sensors[joint].joint.clone(),
            kind: failure.kind,
            found: match failure.found {
                FailureSource::Declared => "declared",
                FailureSource::Detected => "detected",
            }
            .to_owned(),
            evidence: self.evidence(failure),
            poses: failure.views.iter().map(pose).collect(),
            since_pose: failure.since.as_ref().map(pose),
            angle_rad: angle.map(|(angle_rad, _)| angle_rad),
            angle_std_rad: angle.map(|(_, std_rad)| std_rad),
            camera_std_rad: self.camera_std_rad(failure),
            tool_error_m: self.tool_error_m(),
            tool_error_by_camera_m: (has_no_sensor && !is_locked)
                .then(|| self.tool_error_where(joint, AngleSource::ByCamera))
                .flatten(),
            tool_error_by_datasheet_m: has_no_sensor
                .then(|| self.tool_error_where(joint, AngleSource::ByDatasheet))
                .flatten(),
        }
    }

    /// Evidence of the failure; a slip has the size that the complete estimate gives it.
    fn evidence(&self, failure: &Failure) -> String {
        let step =
            failure.since.and_then(|since| Some((since, self.found.step(failure.joint, self.views[since].end)?)));
        let unit = self.robot.sensors[failure.joint].unit();
        match step {
            Some((since, (step_rad, _))) => slip_in_words(unit.shown(step_rad, 2), self.views, since),
            None => match self.locked_angle(failure).filter(|_| failure.is_held) {
                Some((angle_rad, _)) => format!("the joint is held at {}", unit.shown(angle_rad, 1)),
                None => failure.evidence.clone(),
            },
        }
    }

    /// Mean angle of a locked joint over the views and its sigma, rad; all views show the same angle.
    fn locked_angle(&self, failure: &Failure) -> Option<(f64, f64)> {
        if !failure.stands_still() {
            return None;
        }
        let joint = failure.joint;
        let seen: Vec<usize> = (0..self.views.len()).filter(|&k| self.found.uses(k)).collect();
        let n = seen.len().max(1) as f64;
        let angle_rad = seen.iter().map(|&k| self.found.angle(k, joint).0).sum::<f64>() / n;
        let std_rad = self.found.mean_angle_std_rad(joint);
        Some((angle_rad, std_rad))
    }

    /// Standard deviation of the angle, root mean square over the views where only the camera determines it.
    fn camera_std_rad(&self, failure: &Failure) -> Option<f64> {
        let freed: Vec<f64> = failure
            .views
            .iter()
            .filter(|&&k| !failure.stands_still() && self.found.uses(k))
            .map(|&k| self.found.angle(k, failure.joint).1.powi(2))
            .collect();
        (!freed.is_empty()).then(|| (freed.iter().sum::<f64>() / freed.len() as f64).sqrt())
    }

    /// Tool error with the angle of `joint` from the source `known`, and the other failed joints as they are.
    fn tool_error_where(&self, joint: usize, known: AngleSource) -> Option<Summary> {
        self.prediction_where(joint, known).map(|predicted| predicted.error_m)
    }

    fn prediction_where(&self, joint: usize, known: AngleSource) -> Option<ToolErrorPrediction> {
        self.prediction_by(|failure| if failure.joint == joint { known } else { AngleSource::AsItIs })
    }

    /// Prediction with the angle of each failed joint from the source that `source` returns for it.
    fn prediction_by(&self, source: impl Fn(&Failure) -> AngleSource) -> Option<ToolErrorPrediction> {
        let mut robot = self.robot.clone();
        let mut covariance = self.covariance.clone();
        let mut residual_std_rad = covariance.residual_std_rad?;
        for failure in self.failures {
            let (j, known) = (failure.joint, source(failure));
            let spec = &mut robot.sensors[j];
            match known {
                AngleSource::AsItIs if failure.stands_still() => {
                    let declared = FailedJoint { joint: j, kind: FailedKind::Locked };
                    if let Some((angle_rad, _)) = self.locked_angle(failure) {
                        robot.stowed[j] = angle_rad;
                    }
                    robot = robot.with_failed(&[declared]);
                }
                AngleSource::AsItIs if failure.has_no_sensor_now() => {
                    // Uniform distribution over the range.
                    (spec.offset_std_rad, spec.gain_std) = (0.0, 0.0);
                    residual_std_rad[j] = spec.half_range_rad / 3.0_f64.sqrt();
                }
                AngleSource::AsItIs => {}
                AngleSource::ByCamera => {
                    (spec.offset_std_rad, spec.gain_std) = (0.0, 0.0);
                    residual_std_rad[j] = self.camera_std_rad(failure)?;
                }
                AngleSource::ByDatasheet => {
                    *spec = self.datasheet.sensors[j].clone();
                    residual_std_rad[j] = spec.linearity_std_rad;
                    covariance = covariance.without_joint(j);
                    robot.failed.retain(|declared| declared.joint != j);
                }
            }
        }
        covariance.residual_std_rad = Some(residual_std_rad);
        predict_tool_error(&robot, self.parameters, &covariance, self.task)
    }

    /// Finding for each failed sensor: the estimate takes account of it.
    pub(crate) fn findings(&self) -> Vec<Finding> {
        self.of_sensors().map(|failure| self.finding(failure)).collect()
    }

    fn finding(&self, failure: &Failure) -> Finding {
        let joint = failure.joint;
        let step = failure.since.and_then(|since| self.found.step(joint, self.views[since].end));
        let (kind, size, unit) = match (failure.line, step) {
            (Some(line), _) if failure.leaves_no_sensor() => {
                (FindingKind::SensorReversed, Some(line.slope), Some(FindingUnit::One))
            }
            (Some(_), _) => (FindingKind::SensorScale, Some(self.parameters.gain[joint]), Some(FindingUnit::One)),
            (None, Some((size_rad, _))) => {
                let unit = FindingUnit::of_joint(self.robot.sensors[joint].moves);
                (FindingKind::SensorSlip, Some(size_rad), Some(unit))
            }
            (None, None) => (FindingKind::SensorFailed, None, None),
        };
        let is_repaired = failure.line.is_none() || self.is_calibrated_anew(failure);
        Finding {
            kind,
            name: self.robot.sensors[joint].joint.clone(),
            size,
            unit,
            tool_error_m: None,
            time_s: failure.since.or(failure.lost_since).and_then(|view_idx| self.since_first_view_s(view_idx)),
            repaired: is_repaired,
        }
    }

    /// Returns true if a sensor of another scale is estimated with the other parameters, and the data fit.
    fn is_calibrated_anew(&self, failure: &Failure) -> bool {
        !failure.leaves_no_sensor() && !is_suspicious(self.found)
    }

    fn since_first_view_s(&self, view_idx: usize) -> Option<f64> {
        let first = self.views.iter().map(|view| view.end).min()?;
        Some(self.views[view_idx].end.since_s(first))
    }

    /// Reasons why the calibration must not be used for its task, or at all.
    pub(crate) fn refusals(&self) -> Vec<Refusal> {
        self.failures.iter().filter_map(|failure| self.refusal(failure)).collect()
    }

    fn refusal(&self, failure: &Failure) -> Option<Refusal> {
        let spec = &self.robot.sensors[failure.joint];
        let (joint, moves) = (spec.joint.clone(), spec.moves);
        if let Some(with) = self.joint_read(failure) {
            return Some(Refusal::MisreadReadings(self.alike(joint, with)));
        }
        let input_factor = |slope: f64| Some(slope * spec.stated?.factor);
        if let Some(line) = failure.line.filter(|_| !self.is_calibrated_anew(failure)) {
            return Some(Refusal::SensorLine { joint, slope: line.slope, input_factor: input_factor(line.slope) });
        }
        let gain = self.parameters.gain[failure.joint];
        if failure.line.is_some() && is_of_another_unit(moves, gain) {
            return Some(Refusal::SensorUnit { joint, gain, moves, input_factor: input_factor(gain) });
        }
        if failure.line.is_some() {
            return Some(Refusal::SensorLine { joint, slope: gain, input_factor: input_factor(gain) });
        }
        if let Some(views) = failure.n_views_since(self.views)
            && views < MIN_VIEWS_SINCE
        {
            return Some(Refusal::TooFewViewsSinceSlip { joint, evidence: self.evidence(failure), views });
        }
        let is_needed = failure.joint < self.robot.tool.mount.n_joints;
        if !failure.has_no_sensor_now() || failure.stands_still() || !is_needed {
            return None;
        }
        let tolerance_m = self.task.map(|task| task.task.tolerance_m);
        if self.is_within_tolerance_without(failure) {
            return None;
        }
        // Without a task every joint is needed, except those that the user declares to have no sensor.
        let is_known = failure.found == FailureSource::Declared && failure.lost_since.is_none();
        if tolerance_m.is_none() && is_known {
            return None;
        }
        let table = self.table(failure);
        Some(Refusal::SensorFailed {
            joint,
            kind: failure.kind,
            since_view: failure.lost_since.map(|view_idx| self.views[view_idx].pose_idx + 1),
            tool_error_m: table.tool_error_m.map(|s| s.p95),
            tool_error_by_camera_m: table.tool_error_by_camera_m.map(|s| s.p95),
            tolerance_m,
        })
    }
}

impl FailureImpact<'_> {
    /// Returns the refusal for a joint of that name with the readings of `with`.
    fn alike(&self, joint: String, with: usize) -> MisreadReadings {
        let as_drawn = PositionProblem::new(self.datasheet, self.as_read).rms_m(&JointParameters::default());
        let (with, views) = (self.robot.sensors[with].joint.clone(), self.as_read.len());
        MisreadReadings {
            found: ReadingError::Alike { joint, with, views },
            alternatives: Vec::new(),
            tag_error_m: as_drawn.unwrap_or(0.0),
            corrected_m: None,
        }
    }

    /// Returns true if the decision rule accepts all targets that can be judged without that sensor. The camera
    /// determines the angles of other joints without a sensor.
    fn is_within_tolerance_without(&self, failure: &Failure) -> bool {
        let is_told = |other: &Failure| other.has_no_sensor_now() && !other.stands_still();
        let source = |other: &Failure| {
            if other.joint != failure.joint && is_told(other) { AngleSource::ByCamera } else { AngleSource::AsItIs }
        };
        let Some((task, predicted)) = self.task.zip(self.prediction_by(source)) else { return false };
        let error = |target: &TargetPrediction| TargetError {
            index: target.target_idx,
            by_data_m2: target.covariance_m2,
            by_priors_m2: Matrix3::zeros(),
        };
        let errors: Vec<TargetError> = predicted.targets.iter().map(error).collect();
        let ReachTask { targets_m, tolerance_m, .. } = task.task;
        let decided =
            U95Table::of_task(targets_m.len(), *tolerance_m, (&errors, f64::INFINITY), |_| Code::TargetOutOfReach);
        decided.p_beyond_tolerance.is_some() && decided.beyond().is_none()
    }
}

/// Returns true where the gain is the ratio of degrees and radians, or of millimetres and metres.
fn is_of_another_unit(moves: JointKind, gain: f64) -> bool {
    let ratio = if moves.is_slide() { 1e-3 } else { 1f64.to_radians() };
    [ratio, ratio.recip()].iter().any(|unit| (gain / unit - 1.0).abs() < UNIT_SHARE)
}
