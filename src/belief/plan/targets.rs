//! Joint angles for the reach task's targets, clear for every arm within the joint errors.

use crate::plan::constants::targets::{IK_TOLERANCE_M, RANDOM_SEEDS, SPARE_TRIES};
use std::collections::BTreeSet;

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;

use crate::plan::PlanError;
use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::{ClearanceModel, ClosestPair};
use crate::solve::task_angles::random_start;
use armcal_core::kinematics::{IkError, IkGoal, IkSettings, solve_position};
use armcal_core::robot::Robot;
use armcal_core::routine::{ReachSettings, Routine, Step};
use armcal_core::streams::JointAngles;

/// Solves every target under one belief, near `preferred` configurations if given.
///
/// Returns the believed joint angles of each target, [`PlanError::TargetOutOfReach`] with the remaining distance, or
/// [`PlanError::TargetTooClose`] with the nearest parts.
pub fn plan_targets(
    robot: &Robot,
    clearance: &ClearanceModel<'_>,
    bounds: &JointErrorBounds,
    request: &TargetRequest<'_>,
    rng: &mut ChaCha8Rng,
) -> Vec<Result<JointAngles, PlanError>> {
    let limits = bounds.safe_limits(robot);
    let is_locked = |j: usize| limits[j].are_locked() || (j + 1 == robot.tool.mount.n_joints && on_tool_axis(robot));
    let settings = IkSettings {
        locked: (0..robot.n_joints()).map(is_locked).collect(),
        limits,
        tolerance_m: IK_TOLERANCE_M,
        max_iterations: 200,
    };
    let solver = TargetSolver { robot, clearance, bounds, settings, margin_m: request.margin_m };
    (0..request.targets_m.len())
        .map(|target| {
            let preferred = request.preferred.and_then(|postures| postures.get(target)).copied();
            solver.solve(target, request.targets_m[target], preferred, rng)
        })
        .collect()
}

/// Targets to reach, with preferences and margin.
pub struct TargetRequest<'a> {
    /// Tool positions, base frame.
    pub targets_m: &'a [[f64; 3]],
    /// Configurations to stay near, one per target.
    pub preferred: Option<&'a [JointAngles]>,
    /// Clearance to keep, m.
    pub margin_m: f64,
}

/// Returns the believed angles at the task's targets. Targets that are reached before any calibration must be clear for
/// every arm within the bounds. For the others it is enough that the believed arm is clear.
pub fn plan_task(
    robot: &Robot,
    clearance: &ClearanceModel<'_>,
    bounds: &JointErrorBounds,
    routine: &Routine,
    rng: &mut ChaCha8Rng,
) -> Vec<Result<JointAngles, PlanError>> {
    let margin_m = routine.capture.clearance_m;
    let request = TargetRequest { targets_m: &routine.task.targets_m, preferred: None, margin_m };
    let mut planned = plan_targets(robot, clearance, bounds, &request, rng);
    let (at_first, believed) = (reached_at_first(&routine.steps), JointErrorBounds::none(robot));
    if planned.iter().enumerate().any(|(target, planned)| planned.is_err() && !at_first.contains(&target)) {
        let later = plan_targets(robot, clearance, &believed, &request, rng);
        let either = planned.into_iter().zip(later).enumerate();
        let of = |(target, (now, later)): (usize, (Result<_, _>, _))| {
            if at_first.contains(&target) { now } else { now.or(later) }
        };
        planned = either.map(of).collect();
    }
    let mut spare = rng.clone();
    for (target, planned) in planned.iter_mut().enumerate().filter(|(_, planned)| planned.is_err()) {
        let one = TargetRequest { targets_m: &routine.task.targets_m[target..=target], ..request };
        let bounds = if at_first.contains(&target) { bounds } else { &believed };
        let mut tries = (0..SPARE_TRIES).flat_map(|_| plan_targets(robot, clearance, bounds, &one, &mut spare));
        if let Some(found) = tries.find(Result::is_ok) {
            *planned = found;
        }
    }
    planned
}

/// True if the jaws close on a target before any calibration, so that the task is planned for open jaws. After a
/// calibration, targets are planned again.
#[must_use]
pub fn grips_at_first(steps: &[Step]) -> bool {
    first_reaches(steps).any(|reach| reach.touch)
}

/// Returns the targets that are reached before any calibration.
fn reached_at_first(steps: &[Step]) -> BTreeSet<usize> {
    first_reaches(steps).flat_map(|reach| reach.targets.iter().copied()).collect()
}

fn first_reaches(steps: &[Step]) -> impl Iterator<Item = &ReachSettings> {
    let before = steps.iter().take_while(|step| !matches!(step, Step::Calibrate(_)));
    before.filter_map(|step| match step {
        Step::Reach(reach) => Some(reach),
        _ => None,
    })
}

struct TargetSolver<'a> {
    robot: &'a Robot,
    clearance: &'a ClearanceModel<'a>,
    bounds: &'a JointErrorBounds,
    settings: IkSettings,
    margin_m: f64,
}

impl TargetSolver<'_> {
    /// Returns the clear solution nearest to the preferred configuration, or to the stowed one.
    fn solve(
        &self,
        target: usize,
        at_m: [f64; 3],
        preferred: Option<JointAngles>,
        rng: &mut ChaCha8Rng,
    ) -> Result<JointAngles, PlanError> {
        let goal = IkGoal { position_m: Vector3::from(at_m) };
        let home = preferred.unwrap_or(self.robot.stowed);
        let mut unreached: Option<IkError> = None;
        let mut closest: Option<ClosestPair> = None;
        let mut best: Option<(f64, JointAngles)> = None;
        for attempt in 0..=RANDOM_SEEDS {
            let seed = if attempt == 0 { home } else { random_start(self.robot, &self.settings, rng) };
            match solve_position(&self.robot.chain, &self.robot.tool.mount, &goal, &seed, &self.settings) {
                Err(error) => unreached = Some(unreached.map_or(error, |before| nearer(before, error))),
                Ok(angles) => {
                    let travel_rad = angles.max_abs_difference(&home);
                    if let Some(nearest) = self.clearance.find_violation_arriving(&angles, self.bounds, self.margin_m) {
                        if closest.as_ref().is_none_or(|c| nearest.distance_m > c.distance_m) {
                            closest = Some(nearest);
                        }
                    } else if best.as_ref().is_none_or(|(least, _)| travel_rad < *least) {
                        best = Some((travel_rad, angles));
                    }
                }
            }
            // A solution next to the preferred configuration is what the request asked for.
            if attempt == 0 && preferred.is_some() && best.is_some() {
                break;
            }
        }
        match (best, closest, unreached) {
            (Some((_, angles)), _, _) => Ok(angles),
            (None, Some(nearest), _) => Err(PlanError::TargetTooClose {
                target,
                at_m,
                clearance_m: nearest.true_distance_m(),
                needed_m: nearest.needed_m(self.margin_m),
                nearest: nearest.to_string(),
            }),
            (None, None, Some(source)) => Err(PlanError::TargetOutOfReach { target, at_m, source }),
            (None, None, None) => unreachable!("an attempt either fails or gives angles"),
        }
    }
}

fn nearer(a: IkError, b: IkError) -> IkError {
    let (IkError::OutOfReach { error_m: a_m }, IkError::OutOfReach { error_m: b_m }) = (a, b);
    if a_m < b_m { a } else { b }
}

/// True if the tool point lies on the last joint's axis, so that this joint cannot move it.
fn on_tool_axis(robot: &Robot) -> bool {
    let last = &robot.chain.joints()[robot.tool.mount.n_joints - 1];
    let point = robot.tool.mount.link_from_frame.translation.vector;
    last.axis.cross(&point).norm() < IK_TOLERANCE_M
}
