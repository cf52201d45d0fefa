//! Contents of calibration.toml that all methods share; each method adds its own tables.

use crate::checks::refusal_conditions::{AcceptanceData, HeldOutLimit, refusal};
use crate::file::calibration::{Calibration, JointResult, Status};
use crate::file::covariance_file::CovarianceTable;
use crate::file::link_table::LinkResult;
use crate::file::metrics::{FitMetrics, HeldOutMetrics};
use crate::file::sag_table::SagTable;
use crate::file::terms_table::{ReferenceTable, TermsTable};
use crate::file::valid_range::ValidRange;
use crate::judge::{TargetError, TargetU95, U95Table};
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::positions::position_problem::PositionProblem;
use crate::positions::solution::Solution;
use crate::say::refusal::Refusal;
use crate::solve::covariance::{ParameterCovariance, ToolErrorPrediction};
use crate::solve::details::FitDetails;
use crate::views::scale_identification::IdentifiedScale;
use crate::views::view::{CaptureData, EndStopReading, TagMeasurement, View};
use armcal_core::codes::Code;
use armcal_core::document::VERSION;
use armcal_core::input::TagNoise;
use armcal_core::kind::Kind;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::sensor::{ConditionChange, SensorModel};
use nalgebra::{Matrix3, Vector3};

/// Sources of a calibration.
pub(crate) struct Provenance<'a> {
    pub messages_hash: &'a str,
    pub robot: &'a Robot,
    pub method: Method,
    pub data: &'a CaptureData,
    /// Earlier calibration that a warm start uses as its prior.
    pub prior: Option<&'a Calibration>,
    pub identified: &'a [IdentifiedScale],
}

/// Result of a method's fit.
pub(crate) struct Fit<'a> {
    /// The fitted views.
    pub problem: &'a PositionProblem<'a>,
    pub solution: &'a Solution,
    pub covariance: &'a ParameterCovariance,
    pub linearity_scale: f64,
}

/// Evidence for accepting or refusing a calibration.
pub(crate) struct Evidence {
    pub held_out: HeldOutMetrics,
    /// Tool error predicted over the task's targets; `None` without a task.
    pub predicted: Option<ToolErrorPrediction>,
    /// Number of parameters of the sensors that move the camera, determined or not.
    pub n_parameters: usize,
    /// True if a joint or its sensor failed.
    pub has_failed_joint: bool,
}

/// Fills the tables that all methods share, and sets the verdict by criteria that they share.
pub(crate) fn assemble(source: &Provenance<'_>, fit: &Fit<'_>, evidence: Evidence) -> Calibration {
    let at = &fit.solution.parameters;
    let metrics = fit_metrics(source, fit);
    let Evidence { held_out, predicted, n_parameters, has_failed_joint } = evidence;
    let predicted_tool_error_m = predicted.as_ref().map(|predicted| predicted.error_m);
    let u95 = u95_by_data(source, fit, predicted.as_ref(), (n_parameters, has_failed_joint));
    let details = FitDetails::of(fit.problem, at, predicted.map_or_else(Vec::new, |predicted| predicted.targets));
    // `bundle` has the covariance of its parameters, and judges by it whether they must be better.
    let must_improve = source.method != Method::Bundle;
    let tolerance_m = source.data.task.as_ref().map(|task| task.tolerance_m);
    let by_conditions = refusal(&AcceptanceData {
        outcome: fit.solution.outcome,
        evaluations: fit.solution.evaluations,
        held_out_views: held_out.views,
        held_out_rms_m: held_out.rms_m,
        held_out_nominal_rms_m: held_out.nominal_rms_m.filter(|_| must_improve),
        baseline: held_out.baseline.filter(|_| must_improve),
        fit_rms_m: metrics.rms_m,
        n_parameters,
        fit_views: metrics.views,
        held_out_limit: held_out_limit(source, fit, tolerance_m, held_out.views),
    });
    let refusals: Vec<Refusal> = by_conditions.or_else(|| refusal_by_risk(&u95)).into_iter().collect();
    let names = fit.covariance.parameters.iter().map(|p| p.name(source.robot)).collect();
    let mut calibration = Calibration {
        version: VERSION,
        kind: Kind::Calibration,
        robot: source.robot.name.clone(),
        method: source.method,
        status: Status::Accepted,
        refusal: None,
        refusals: Vec::new(),
        reservations: Vec::new(),
        findings: Vec::new(),
        messages_hash: source.messages_hash.to_owned(),
        unobservable: Vec::new(),
        fit: metrics,
        held_out,
        predicted_tool_error_m,
        predicted_tool_error_with_priors_m: None,
        u95,
        valid: ValidRange::of(source.data),
        reference: ReferenceTable::of(at, fit.covariance),
        camera_mount: None,
        further_camera: Vec::new(),
        lens: Vec::new(),
        map: None,
        observability: None,
        verdict: None,
        model: None,
        outliers: Vec::new(),
        joint: joint_results(source, fit),
        link: LinkResult::all(source.robot, at, fit.covariance),
        sag: SagTable::of(source.robot, at, fit.covariance),
        failed_joint: Vec::new(),
        prior: None,
        covariance_hash: None,
        covariance: CovarianceTable::new(names, &fit.covariance.matrix),
        details,
    };
    calibration.refuse_for(refusals);
    calibration
}

/// Largest held-out error of positions and poses; corners have a stated noise in robot.toml, and checks of their own.
fn held_out_limit(
    source: &Provenance<'_>,
    fit: &Fit<'_>,
    tolerance_m: Option<f64>,
    n_views: usize,
) -> Option<HeldOutLimit> {
    let tags = || source.data.fit.iter().flat_map(|view| &view.tags);
    if tags().all(|tag| tag.is_in_pixels()) {
        return None;
    }
    let Some(TagNoise { position_std_m, rotation_std_rad }) = source.data.tag_noise else {
        return Some(HeldOutLimit::without_noise(source.robot, tolerance_m));
    };
    let n = tags().count().max(1) as f64;
    let distance_m2 = tags().map(|tag| tag.center_in_camera_m.norm_squared()).sum::<f64>() / n;
    // If the noise of rotations is not stated, only that of positions counts.
    let noise_m2 = 3.0 * position_std_m.powi(2) + 2.0 * distance_m2 * rotation_std_rad.unwrap_or(0.0).powi(2);
    let at = &fit.solution.parameters;
    let sensors = at.sensors(source.robot);
    let estimate_m2 = fit.problem.views.iter().map(|view| {
        let angles = fit.problem.angles(view, &view.conditions.departure_from(&at.reference), at);
        fit.covariance.tool_position_m2(source.robot, &sensors, &angles).trace().max(0.0)
    });
    let estimate_m2 = estimate_m2.sum::<f64>() / fit.problem.views.len().max(1) as f64;
    // The estimate's covariance grows with the residuals: it may excuse no more than the noise itself.
    Some(HeldOutLimit::by_noise((noise_m2 + estimate_m2.min(noise_m2)).sqrt(), n_views))
}

/// Degrees of freedom of a noise that is fitted to views together with `n_parameters`, at least 1. The camera's pose
/// has six coordinates in a view, regardless of the number of corners.
pub(crate) fn noise_dof(views: &[View], n_parameters: usize) -> f64 {
    let coordinates = |view: &View| {
        let of_tags = view.tags.iter().map(|tag| match tag.measured {
            TagMeasurement::Position => 3,
            TagMeasurement::Pose(_) | TagMeasurement::Corners(_) | TagMeasurement::Board(_) => 6,
        });
        of_tags.sum::<usize>().min(6)
    };
    let all: usize = views.iter().map(coordinates).sum();
    all.saturating_sub(n_parameters).max(1) as f64
}

/// U95 from the recording only; over the views' own configurations if there is no task.
fn u95_by_data(
    source: &Provenance<'_>,
    fit: &Fit<'_>,
    predicted: Option<&ToolErrorPrediction>,
    (n_parameters, has_failed_joint): (usize, bool),
) -> U95Table {
    let dof = noise_dof(fit.problem.views, n_parameters);
    let error = |index, by_data_m2| TargetError { index, by_data_m2, by_priors_m2: Matrix3::zeros() };
    if let Some(task) = &source.data.task {
        let targets = predicted.map_or(&[][..], |predicted| &predicted.targets);
        let errors: Vec<TargetError> =
            targets.iter().map(|target| error(target.target_idx, target.covariance_m2)).collect();
        return U95Table::of_task(task.targets_m.len(), task.tolerance_m, (&errors, dof), |index| {
            let is_kept = has_failed_joint && is_near(source.robot, &task.targets_m[index]);
            if is_kept { Code::SensorFailed } else { Code::TargetOutOfReach }
        });
    }
    let at = &fit.solution.parameters;
    let sensors = at.sensors(source.robot);
    let errors = fit.problem.views.iter().enumerate().map(|(view_idx, view)| {
        let angles = fit.problem.angles(view, &view.conditions.departure_from(&at.reference), at);
        error(view_idx, fit.covariance.tool_position_m2(source.robot, &sensors, &angles))
    });
    U95Table::of_configurations(&errors.collect::<Vec<_>>(), dof)
}

/// Returns true if the links in one line are long enough for a target. If a joint failed, the calibration is then not
/// the cause.
pub(crate) fn is_near(robot: &Robot, target_m: &[f64; 3]) -> bool {
    robot.is_long_enough_for(&Vector3::from(*target_m))
}

/// Refusal by the decision rule, from the recording only.
fn refusal_by_risk(u95: &U95Table) -> Option<Refusal> {
    let targets = u95.unjudged();
    if !targets.is_empty() {
        return Some(Refusal::TargetsNotJudged { targets });
    }
    let TargetU95 { index, u95_m, p_beyond_tolerance, .. } = *u95.beyond()?;
    let (u95_m, probability) = u95_m.zip(p_beyond_tolerance)?;
    let (target, tolerance_m, survey, is_watched) = (index + 1, u95.tolerance_m?, Vec::new(), false);
    Some(Refusal::BeyondTolerance { target, probability, u95_m, tolerance_m, survey, is_watched })
}

/// Refusal by the decision rule with stated sigmas included, if U95 from the recording only passes it. `most`: their
/// largest part.
pub(crate) fn refusal_by_priors(by_data: &U95Table, with_priors: &U95Table, most: Option<String>) -> Option<Refusal> {
    // A gate whose input is missing has not passed.
    let targets = with_priors.unjudged();
    if by_data.unjudged().is_empty() && !targets.is_empty() {
        return Some(Refusal::TargetsNotJudged { targets });
    }
    let beyond = with_priors.beyond().filter(|_| by_data.beyond().is_none())?;
    let (u95_m, probability) = beyond.u95_m.zip(beyond.p_beyond_tolerance)?;
    let (target, tolerance_m) = (beyond.index + 1, with_priors.tolerance_m?);
    Some(Refusal::PriorsBeyondTolerance { target, probability, u95_m, tolerance_m, most })
}

fn fit_metrics(source: &Provenance<'_>, fit: &Fit<'_>) -> FitMetrics {
    let at = &fit.solution.parameters;
    FitMetrics {
        outcome: fit.solution.outcome,
        evaluations: fit.solution.evaluations,
        cost_initial: fit.solution.cost_initial,
        cost_final: fit.solution.cost_final,
        views: source.data.fit.iter().filter(|view| !view.tags.is_empty()).count(),
        tags_seen: fit.problem.n_observations(),
        rejected: source.data.rejected.values().sum(),
        rejected_corners: None,
        rejected_by_reason: source.data.rejected_by_reason(),
        rms_m: fit.problem.rms_m(at).unwrap_or(f64::NAN),
        rms_px: fit.problem.reprojection_rms_px(at),
        linearity_scale: fit.linearity_scale,
    }
}

/// Held-out metrics of views that the fit did not use.
pub(crate) fn held_out_metrics(problem: &PositionProblem<'_>, at: &JointParameters) -> HeldOutMetrics {
    HeldOutMetrics {
        cross_validated: false,
        mean_m: None,
        camera_mean_m: None,
        views: problem.views.iter().filter(|view| !view.tags.is_empty()).count(),
        rms_m: problem.rms_m(at),
        rms_px: problem.reprojection_rms_px(at),
        nominal_rms_m: problem.rms_m(&JointParameters::default()),
        baseline: None,
        within_95: None,
    }
}

fn joint_results(source: &Provenance<'_>, fit: &Fit<'_>) -> Vec<JointResult> {
    let sensors = fit.solution.parameters.sensors(source.robot);
    sensors.models.iter().enumerate().map(|(joint, model)| joint_result(source, fit, joint, model)).collect()
}

fn joint_result(source: &Provenance<'_>, fit: &Fit<'_>, joint: usize, model: &SensorModel) -> JointResult {
    let spec = &model.spec;
    let std = |kind| fit.covariance.std(Parameter { joint, kind });
    let (gain_std, offset_std) = (std(ParameterKind::Gain), std(ParameterKind::Offset));
    // A parameter that the new views do not determine keeps its earlier standard deviation.
    let before = source.prior.map(|prior| &prior.joint[joint]);
    let datasheet = spec.with_scale(1.0 / ratio_of(source, joint));
    let gain_std_before = before.map_or(spec.gain_std / spec.counts_per_rad.abs(), |j| j.gain_std_rad_per_count);
    JointResult {
        name: spec.joint.clone(),
        moves: spec.moves,
        center_rad: spec.center_rad,
        gain_rad_per_count: model.correction.gain / spec.counts_per_rad,
        offset_rad: model.correction.offset_rad,
        gain_std_rad_per_count: gain_std.map_or(gain_std_before, |std| std / spec.counts_per_rad.abs()),
        offset_std_rad: offset_std.unwrap_or(before.map_or(spec.offset_std_rad, |j| j.offset_std_rad)),
        gain_estimated: gain_std.is_some() || before.is_some_and(|j| j.gain_estimated),
        offset_estimated: offset_std.is_some() || before.is_some_and(|j| j.offset_estimated),
        covered_rad: covered_rad(source, joint, model),
        offset_counts: Some(datasheet.offset_counts),
        counts_per_rad: Some(datasheet.counts_per_rad),
        gain_over_datasheet: Some(model.correction.gain / ratio_of(source, joint)),
        identified_ratio: source.identified.iter().find(|scale| scale.joint == joint).map(|scale| scale.ratio),
        residual_std_rad: fit.covariance.residual_std_rad.map(|std_rad| std_rad[joint]),
        terms: TermsTable::of(joint, model, fit.covariance),
    }
}

/// Range of angles that the views cover, rad; the middle of the joint's range twice if no view covers any.
fn covered_rad(source: &Provenance<'_>, joint: usize, model: &SensorModel) -> [f64; 2] {
    let travel = source.data.fit.iter().filter(|v| !v.tags.is_empty()).map(|view| view.travel_rad[joint]);
    let at_stop = |(_, stop): &&(_, EndStopReading)| source.method == Method::JointLimits && stop.joint == joint;
    let stops = source.data.stops.iter().filter(at_stop).map(|(_, stop)| stop.travel_rad);
    let (low, high) =
        travel.chain(stops).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)));
    let angle = |t: f64| model.correction.angle_rad(&model.spec, t, &ConditionChange::default(), 0.0);
    if low <= high { [angle(low), angle(high)] } else { [model.spec.center_rad; 2] }
}

/// Ratio of the counts per radian used in the fit to the datasheet's.
fn ratio_of(source: &Provenance<'_>, joint: usize) -> f64 {
    source.identified.iter().find(|scale| scale.joint == joint).map_or(1.0, |scale| scale.ratio)
}
