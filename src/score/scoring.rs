//! Figures of a run: estimates against the truth.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use crate::score::{JointScore, MarginSummary, ReachScore, Score, ScoreSide, TargetScore, TaskScore, margins, touch};
use armcal_belief::calib::{Calibration, TargetPrediction};
use armcal_belief::session::{AssertResult, Epoch, Outcome, ReachStep};
use armcal_belief::verify::{Belief, ReachRest, reaches};
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::routine::AssertFigure;
use armcal_core::stats::Summary;
use armcal_core::streams::ReachAttempt;
use armcal_sim::SimError;
use armcal_sim::truth::{Truth, read_truth};

/// Figures of a run that need the truth.
#[derive(Clone, Debug)]
pub struct Scored {
    pub score: Score,
    pub collisions: usize,
    pub min_clearance_m: Option<f64>,
    pub margins: Option<MarginSummary>,
    /// Limits of the script, including figures that need the truth.
    pub asserts: Vec<AssertResult>,
}

/// Inputs of the comparison.
pub struct ScoreInput<'a> {
    pub recording: &'a Recording,
    pub truth: &'a Path,
    pub robot: &'a Robot,
    pub outcome: &'a Outcome,
    pub tolerance_m: f64,
}

/// Scores a run.
///
/// # Errors
/// [`SimError::TruthFile`] when the truth cannot be read.
pub fn score(input: &ScoreInput<'_>) -> Result<Scored, SimError> {
    let mut truth = read_truth(input.truth)?;
    touch::leave_out_meant(&mut truth, input.recording, input.robot);
    let outcome = input.outcome;
    let beliefs: Vec<_> = outcome.epochs.iter().map(belief).collect();
    let rests = reaches(input.recording, input.robot, &beliefs);
    let compared: Vec<Compared> = rests.iter().filter_map(|rest| compare(rest, &truth)).collect();
    let sides: Vec<Side<'_>> = outcome.reaches.iter().map(|step| Side::of(step, &compared)).collect();
    let reaches = sides.iter().map(|side| reach_score(input, &truth, side)).collect();
    let first = sides.iter().find(|side| side.step.attempt == ReachAttempt::Before);
    let last = sides.iter().rev().find(|side| side.step.attempt == ReachAttempt::After);
    let last = last.filter(|side| !side.rests.is_empty());
    let common = common_targets(first, last);
    let before = first.map(|side| side.at(&common)).unwrap_or_default();
    let after = last.map(|side| side.at(&common)).unwrap_or_default();
    let figures = |side: Option<&Side<'_>>, rests: &[&Compared<'_>]| ScoreSide {
        hits: side.map_or(0, |side| side.hits(input.tolerance_m)),
        targets: side.map_or(0, |side| side.step.targets),
        ..side_figures(rests, input.tolerance_m)
    };
    let score = Score {
        before: figures(first, &before),
        after: last.is_some().then(|| figures(last, &after)),
        nees: nees(input, last.map_or(&[], |side| &side.rests)),
        joints: joint_scores(input, &before, &after),
        targets: target_scores(first, last, predictions(input, last)),
        compared_targets: common.into_iter().collect(),
        reaches,
        work: sides.iter().filter(|side| side.step.is_work).flat_map(|side| task_scores(input, side)).collect(),
    };
    let asserts = outcome.asserts.iter().map(|limit| completed(limit, &score, &truth)).collect();
    let margins = margins::margins(&outcome.visits, input.robot, &truth);
    Ok(Scored { score, collisions: truth.contacts.len(), min_clearance_m: truth.min_clearance_m(), margins, asserts })
}

/// The limit with its value, if the truth provides it.
fn completed(limit: &AssertResult, score: &Score, truth: &Truth) -> AssertResult {
    let reach = limit.last_reach.and_then(|reach| score.reaches.get(reach)).map(|reach| &reach.side);
    let value = limit.at.and_then(|at| match limit.figure {
        AssertFigure::ToolError => Some(reach?.tool_error_m?.median),
        AssertFigure::ReachError => Some(reach?.reach_error_m?.median),
        AssertFigure::WorstReachError => Some(reach?.reach_error_m?.max),
        AssertFigure::Hits => Some(reach?.hits as f64),
        AssertFigure::Contacts => Some(truth.contacts.iter().filter(|contact| contact.stamp <= at).count() as f64),
        AssertFigure::Clearance => {
            let until = truth.clearances.iter().filter(|clearance| clearance.stamp <= at);
            until.map(|clearance| clearance.distance_m).min_by(f64::total_cmp)
        }
        AssertFigure::HeldOutRms
        | AssertFigure::HeldOutReprojection
        | AssertFigure::PredictedToolError
        | AssertFigure::SimulatedTime
        | AssertFigure::TargetsSkipped
        | AssertFigure::Poses
        | AssertFigure::PosesSkipped => limit.value,
    });
    AssertResult { value, ..limit.clone() }
}

fn belief(epoch: &Epoch) -> Belief<'_> {
    Belief { from: epoch.from, sensors: &epoch.sensors, links: epoch.links() }
}

/// One `reach` step with its rests.
struct Side<'a> {
    step: &'a ReachStep,
    rests: Vec<&'a Compared<'a>>,
}

impl<'a> Side<'a> {
    fn of(step: &'a ReachStep, compared: &'a [Compared<'a>]) -> Self {
        let rests = compared.iter().filter(|c| (step.start..=step.end).contains(&c.rest.start)).collect();
        Self { step, rests }
    }

    fn targets(&self) -> BTreeSet<usize> {
        self.rests.iter().map(|c| c.rest.target_idx).collect()
    }

    /// The rests at these targets; all rests for an empty set.
    fn at(&self, targets: &BTreeSet<usize>) -> Vec<&'a Compared<'a>> {
        let is_wanted = |c: &&&Compared<'_>| targets.is_empty() || targets.contains(&c.rest.target_idx);
        self.rests.iter().filter(is_wanted).copied().collect()
    }

    fn hits(&self, tolerance_m: f64) -> usize {
        self.rests.iter().filter(|c| c.reach_error_m <= tolerance_m).count()
    }
}

/// Targets at which the arm came to rest on both sides. A target that one side skipped would bias the comparison.
fn common_targets(first: Option<&Side<'_>>, last: Option<&Side<'_>>) -> BTreeSet<usize> {
    let targets = |side: Option<&Side<'_>>| side.map(Side::targets).unwrap_or_default();
    targets(first).intersection(&targets(last)).copied().collect()
}

/// Every target at which the arm came to rest in the first or the last reach.
fn target_scores(
    first: Option<&Side<'_>>,
    last: Option<&Side<'_>>,
    predictions: &[TargetPrediction],
) -> Vec<TargetScore> {
    let rest = |side: Option<&Side<'_>>, target: usize| {
        let rests = side.into_iter().flat_map(|side| &side.rests);
        rests.copied().find(|c| c.rest.target_idx == target).map(|c| (c.tool_error_m, c.reach_error_m))
    };
    let targets = first.into_iter().chain(last).flat_map(Side::targets).collect::<BTreeSet<usize>>();
    let score = |target: usize| {
        let (before, after) = (rest(first, target), rest(last, target));
        let predicted = predictions.iter().find(|predicted| predicted.target_idx == target).zip(after);
        TargetScore {
            target,
            tool_error_before_m: before.map(|(tool_m, _)| tool_m.norm()),
            tool_error_after_m: after.map(|(tool_m, _)| tool_m.norm()),
            reach_error_before_m: before.map(|(_, reach_m)| reach_m),
            reach_error_after_m: after.map(|(_, reach_m)| reach_m),
            p_larger_error: predicted.and_then(|(at, (tool_m, _))| Some(at.distribution?.beyond(tool_m.norm()))),
            nees_with_priors: predicted.and_then(|(at, (tool_m, _))| normalized_square(&tool_m, &at.with_priors_m2?)),
        }
    };
    targets.into_iter().map(score).collect()
}

fn reach_score(input: &ScoreInput<'_>, truth: &Truth, side: &Side<'_>) -> ReachScore {
    let figures = side_figures(&side.rests, input.tolerance_m);
    ReachScore {
        step: side.step.step,
        calibrated: side.step.attempt == ReachAttempt::After,
        side: ScoreSide { targets: side.step.targets, ..figures },
        touches: touch::touches(input.recording, truth, input.robot, side.step, input.tolerance_m),
    }
}

fn task_scores(input: &ScoreInput<'_>, side: &Side<'_>) -> Vec<TaskScore> {
    let start = input.outcome.epochs.first().map(|epoch| epoch.from);
    let task_score = |c: &&Compared<'_>| TaskScore {
        step: side.step.step,
        time_s: start.map_or(0.0, |start| c.rest.start.since_s(start)),
        target: c.rest.target_idx,
        tool_error_m: c.tool_error_m.norm(),
        reach_error_m: c.reach_error_m,
    };
    side.rests.iter().map(task_score).collect()
}

/// One rest: estimated and true tool.
struct Compared<'a> {
    rest: &'a ReachRest,
    tool_error_m: Vector3<f64>,
    tool_error_rad: f64,
    reach_error_m: f64,
    joint_error_rad: Vec<f64>,
}

fn compare<'a>(rest: &'a ReachRest, truth: &Truth) -> Option<Compared<'a>> {
    // The middle of the mark; the arm stands during all of it.
    let stamp = rest.start.plus_s(0.5 * rest.end.since_s(rest.start));
    let state = truth.state_at(stamp)?;
    let true_tool = state.base_from_tool;
    Some(Compared {
        rest,
        tool_error_m: rest.believed_tool.origin().vector() - true_tool.origin().vector(),
        tool_error_rad: armcal_core::spatial::rotation_angle_between(&rest.believed_tool, &true_tool),
        reach_error_m: (Vector3::from(rest.target_m) - true_tool.origin().vector()).norm(),
        joint_error_rad: rest.believed.iter().zip(state.angles.iter()).map(|(b, t)| wrapped(b - t)).collect(),
    })
}

/// The angle wrapped to -pi .. pi, because a continuous joint may have turned once more.
fn wrapped(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle_rad + PI).rem_euclid(TAU) - PI
}

fn side_figures(compared: &[&Compared<'_>], tolerance_m: f64) -> ScoreSide {
    let summary = |f: fn(&Compared<'_>) -> f64| Summary::of(&compared.iter().map(|c| f(c)).collect::<Vec<_>>());
    ScoreSide {
        tool_error_m: summary(|c| c.tool_error_m.norm()),
        tool_error_rad: summary(|c| c.tool_error_rad),
        reach_error_m: summary(|c| c.reach_error_m),
        hits: compared.iter().filter(|c| c.reach_error_m <= tolerance_m).count(),
        targets: compared.len(),
    }
}

fn joint_scores(input: &ScoreInput<'_>, before: &[&Compared<'_>], after: &[&Compared<'_>]) -> Vec<JointScore> {
    let rms = |side: &[&Compared<'_>], joint: usize| {
        let mean_square = side.iter().map(|c| c.joint_error_rad[joint].powi(2)).sum::<f64>() / side.len() as f64;
        (!side.is_empty()).then(|| mean_square.sqrt())
    };
    let joint_score = |(joint, result): (usize, &armcal_belief::calib::JointResult)| JointScore {
        name: result.name.clone(),
        angle_error_before_rad: rms(before, joint),
        angle_error_after_rad: rms(after, joint),
        estimated: result.gain_estimated || result.offset_estimated,
    };
    input.outcome.calibration.joint.iter().enumerate().map(joint_score).collect()
}

/// The calibration that the arm used at these rests.
fn calibration_at<'a>(input: &ScoreInput<'a>, after: &[&Compared<'_>]) -> Option<&'a Calibration> {
    let first = after.first()?;
    let epoch = input.outcome.epochs.iter().rev().find(|epoch| epoch.from <= first.rest.start)?;
    epoch.calibration.as_ref()
}

/// Errors that the calibration of the last reach predicts at the task's targets.
fn predictions<'a>(input: &ScoreInput<'a>, last: Option<&Side<'_>>) -> &'a [TargetPrediction] {
    let calibration = last.and_then(|side| calibration_at(input, &side.rests));
    calibration.map_or(&[], |calibration| &calibration.details.targets)
}

/// `e^T P^-1 e`; `None` where `P` has no inverse.
fn normalized_square(error_m: &Vector3<f64>, covariance_m2: &Matrix3<f64>) -> Option<f64> {
    let inverse = covariance_m2.try_inverse().filter(|p| p.iter().all(|v| v.is_finite()))?;
    Some(error_m.dot(&(inverse * error_m)))
}

/// Mean of `e^T P^-1 e` over the targets; `None` when the prediction has no inverse.
fn nees(input: &ScoreInput<'_>, after: &[&Compared<'_>]) -> Option<f64> {
    let calibration = calibration_at(input, after)?;
    let robot = calibration.scaled_robot(input.robot);
    let covariance = calibration.parameter_covariance(&robot);
    let sensors = calibration.sensors(&robot).ok()?;
    let mut sum = 0.0;
    for compared in after {
        let rest = compared.rest;
        let predicted = covariance.tool_position_under_m2(&robot, &sensors, &rest.believed, &rest.conditions);
        sum += normalized_square(&compared.tool_error_m, &predicted)?;
    }
    Some(sum / after.len() as f64)
}
