//! Truth against belief: the only place that opens truth.mcap, after belief has finished.
//!
//! At each reach mark the tool as believed (from the recording, under the sensors of that attempt) is compared with
//! the tool as it was, and the target with where the tool came to rest.

use std::path::Path;

use nalgebra::Vector3;

use crate::calib::Calibration;
use crate::log::Recording;
use crate::report::{JointScore, Score, ScoreSide};
use crate::robot::Robot;
use crate::sensor::ArmSensors;
use crate::sim::SimError;
use crate::sim::truth::{Truth, read_truth};
use crate::spatial::{Base, Pose, Tool};
use crate::stats::Summary;
use crate::streams::ReachAttempt;
use crate::verify::{Beliefs, ReachRest, reaches};

/// What truth adds to a run's figures.
#[derive(Clone, Debug)]
pub struct Scored {
    pub score: Score,
    pub collisions: usize,
    pub min_clearance_m: Option<f64>,
}

/// What is compared.
pub struct ScoreInput<'a> {
    pub recording: &'a Recording,
    pub truth: &'a Path,
    pub robot: &'a Robot,
    pub calibration: &'a Calibration,
    /// The sensors that the arm believed in after calibration (the datasheet's if it was refused).
    pub after: &'a ArmSensors,
    pub tolerance_m: f64,
}

/// Scores a run.
///
/// # Errors
/// [`SimError::TruthFile`] when the truth cannot be read.
pub fn score(input: &ScoreInput<'_>) -> Result<Scored, SimError> {
    let truth = read_truth(input.truth)?;
    let before = ArmSensors::nominal(input.robot);
    let beliefs = Beliefs { before: &before, after: input.after };
    let rests = reaches(input.recording, input.robot, beliefs);
    let side = |attempt: ReachAttempt| -> Vec<Compared> {
        rests.iter().filter(|r| r.attempt == attempt).filter_map(|rest| compare(rest, input.robot, &truth)).collect()
    };
    let (before, after) = (side(ReachAttempt::Before), side(ReachAttempt::After));
    let joints = joint_scores(input, &before, &after);
    let score = Score {
        before: side_figures(&before, input.tolerance_m),
        after: (!after.is_empty()).then(|| side_figures(&after, input.tolerance_m)),
        nees: nees(input, &after),
        joints,
    };
    Ok(Scored { score, collisions: truth.contacts.len(), min_clearance_m: truth.min_clearance_m() })
}

/// One rest, believed and true.
struct Compared<'a> {
    rest: &'a ReachRest,
    tool_error_m: Vector3<f64>,
    tool_error_rad: f64,
    reach_error_m: f64,
    joint_error_rad: Vec<f64>,
}

fn compare<'a>(rest: &'a ReachRest, robot: &Robot, truth: &Truth) -> Option<Compared<'a>> {
    // The middle of the mark: the arm stands over all of it.
    let stamp = rest.start.plus_s(0.5 * rest.end.since_s(rest.start));
    let state = truth.state_at(stamp)?;
    let true_tool = state.base_from_tool;
    let believed_tool: Pose<Base, Tool> =
        Pose::from_isometry(robot.chain.link_poses(&rest.believed).frame(&robot.tool.mount));
    Some(Compared {
        rest,
        tool_error_m: rest.believed_tool_m - true_tool.origin().vector(),
        tool_error_rad: crate::spatial::rotation_angle_between(&believed_tool, &true_tool),
        reach_error_m: (Vector3::from(rest.target_m) - true_tool.origin().vector()).norm(),
        joint_error_rad: rest.believed.iter().zip(state.angles.iter()).map(|(b, t)| wrapped(b - t)).collect(),
    })
}

/// To -pi .. pi: a continuous joint may have turned once more.
fn wrapped(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle_rad + PI).rem_euclid(TAU) - PI
}

fn side_figures(compared: &[Compared<'_>], tolerance_m: f64) -> ScoreSide {
    let summary = |f: fn(&Compared<'_>) -> f64| Summary::of(&compared.iter().map(f).collect::<Vec<_>>());
    ScoreSide {
        tool_error_m: summary(|c| c.tool_error_m.norm()),
        tool_error_rad: summary(|c| c.tool_error_rad),
        reach_error_m: summary(|c| c.reach_error_m),
        hits: compared.iter().filter(|c| c.reach_error_m <= tolerance_m).count(),
    }
}

fn joint_scores(input: &ScoreInput<'_>, before: &[Compared<'_>], after: &[Compared<'_>]) -> Vec<JointScore> {
    let rms = |side: &[Compared<'_>], joint: usize| {
        let mean_square = side.iter().map(|c| c.joint_error_rad[joint].powi(2)).sum::<f64>() / side.len() as f64;
        (!side.is_empty()).then(|| mean_square.sqrt())
    };
    let joint_score = |(joint, result): (usize, &crate::calib::JointResult)| JointScore {
        name: result.name.clone(),
        angle_error_before_rad: rms(before, joint),
        angle_error_after_rad: rms(after, joint),
        estimated: result.gain_estimated || result.offset_estimated,
    };
    input.calibration.joint.iter().enumerate().map(joint_score).collect()
}

/// Mean of `e^T P^-1 e` over the targets; `None` when the prediction has no inverse.
fn nees(input: &ScoreInput<'_>, after: &[Compared<'_>]) -> Option<f64> {
    let covariance = input.calibration.parameter_covariance(input.robot);
    let mut sum = 0.0;
    for compared in after {
        let predicted = covariance.tool_position_m2(input.robot, input.after, &compared.rest.believed);
        let inverse = predicted.try_inverse().filter(|p| p.iter().all(|v| v.is_finite()))?;
        sum += compared.tool_error_m.dot(&(inverse * compared.tool_error_m));
    }
    (!after.is_empty()).then(|| sum / after.len() as f64)
}
