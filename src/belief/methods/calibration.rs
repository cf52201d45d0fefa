//! One calibration by a method on tag positions.

use crate::checks::assemble::{Evidence, Fit, Provenance, assemble, held_out_metrics};
use crate::checks::cross_validation::{compared, cross_validate};
use crate::explain::baseline::Baseline;
use crate::file::calibration::Calibration;
use crate::file::camera_mount::CameraMount;
use crate::file::map_table::MapResult;
use crate::file::metrics::HeldOutMetrics;
use crate::methods::calibration_method::{PositionSolution, PositionSolver};
use crate::methods::gripper_tag::mount_by_gripper_tag;
use crate::methods::observability::free_parameters;
use crate::model::parameters::{JointParameters, Parameter};
use crate::positions::mount_estimate::MountEstimate;
use crate::positions::position_problem::PositionProblem;
use crate::positions::unobservable::grouped_names;
use crate::solve::covariance::{CommonErrors, linearity_scale, predict_tool_error};
use crate::tagmap::tag_mapping::map_unknown_tags;
use crate::views::calibration_data::{CalibrationData, HeldOut};
use crate::views::error::CalibError;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;

/// Start of the search, and the prior information.
struct Start {
    /// Robot with the map's tags, and with the camera mount from the tag on the gripper.
    robot: Robot,
    guess: JointParameters,
    errors: CommonErrors,
    map: Option<MapResult>,
    /// Camera mount from the tag on the gripper, or the reason why it failed; `None` if the robot has no such tag.
    mount: Result<Option<MountEstimate>, String>,
    /// Parameters that the tag on the gripper determines.
    determined: Vec<Parameter>,
}

/// # Errors
/// [`CalibError`] if the views make no map or determine no parameter.
pub(crate) fn calibrate_positions(
    mut data: CalibrationData,
    (method, solver): (Method, PositionSolver),
    prior: Option<&Calibration>,
) -> Result<Calibration, CalibError> {
    let start = start(&mut data, prior)?;
    let problem = PositionProblem::new(&start.robot, &data.data.fit);
    let (free, mut unobservable) = free_parameters(&problem, &start.guess);
    let n_camera_joints = start.robot.n_seen_joints();
    let n_parameters = free.len() + unobservable.iter().filter(|u| u.parameter.joint < n_camera_joints).count();
    unobservable.retain(|u| !start.determined.contains(&u.parameter));
    let nothing = || CalibError::nothing_observable(&data.name, &data.robot);
    if free.is_empty() {
        return Err(nothing());
    }
    let solved = solve(solver, &problem, &free, &start).ok_or_else(nothing)?;
    unobservable.extend(solved.unobservable);
    unobservable.sort_by_key(|u| u.parameter);
    let PositionSolution { determined, solution, covariance, .. } = solved;
    let held_out_problem = PositionProblem::new(&start.robot, &data.data.held_out);
    let linearity_scale = linearity_scale(&problem, &held_out_problem, &solution.parameters, determined.len());
    let held_out = held_out(&data, solver, &start, (&determined, &solution.parameters));
    let as_found = start.robot.clone().with_linearity(linearity_scale);
    let predicted = predict_tool_error(&as_found, &solution.parameters, &covariance, data.data.task_rests());
    let source = Provenance {
        messages_hash: &data.messages_hash,
        robot: &start.robot,
        method,
        data: &data.data,
        prior,
        identified: &data.identified,
    };
    let fit = Fit { problem: &problem, solution: &solution, covariance: &covariance, linearity_scale };
    let has_failed_joint = !start.robot.failed.is_empty();
    let calibration = assemble(&source, &fit, Evidence { held_out, predicted, n_parameters, has_failed_joint });
    Ok(Calibration {
        unobservable: grouped_names(&start.robot, &unobservable),
        camera_mount: CameraMount::of(&start.robot, &start.mount),
        map: start.map,
        ..calibration
    })
}

/// Returns the errors at held-out views: with `at`, the calibration of `free`, and with mount and map only.
fn held_out(
    data: &CalibrationData,
    solver: PositionSolver,
    start: &Start,
    (free, at): (&[Parameter], &JointParameters),
) -> HeldOutMetrics {
    let views = &data.data.fit;
    let baseline = Baseline::new(&start.robot, views);
    let by_baseline =
        |views: &[View]| baseline.as_ref().map(|baseline| baseline.fit(&start.robot, views)).unwrap_or_default();
    match data.held_out {
        HeldOut::AsMarked => {
            let held_out = &data.data.held_out;
            let problem = PositionProblem::new(&start.robot, held_out);
            HeldOutMetrics { baseline: compared(&problem, at, &by_baseline(views)), ..held_out_metrics(&problem, at) }
        }
        HeldOut::CrossValidation => {
            let fit = |views: &[View]| {
                let part = PositionProblem::new(&start.robot, views);
                solve(solver, &part, free, start).map(|solved| solved.solution.parameters)
            };
            cross_validate(&start.robot, views, fit, by_baseline)
        }
    }
}

fn start(data: &mut CalibrationData, prior: Option<&Calibration>) -> Result<Start, CalibError> {
    let mut robot = data.robot.clone();
    let mut errors = CommonErrors::priors(&robot);
    let mapped = map_unknown_tags(&data.name, &mut data.data, &robot)?;
    let map = mapped.map(|mapped| {
        (robot, errors) = (mapped.robot, mapped.errors);
        mapped.result
    });
    let mut guess = prior.map_or_else(JointParameters::default, |prior| prior.parameters(&robot));
    let mount = robot.gripper_tag.map(|tag| {
        let views = data.gripper_tag_data.as_ref().map_or(&data.data.fit, |data| &data.fit);
        mount_by_gripper_tag(&robot, &tag, views, &guess)
    });
    let mount = mount.transpose();
    let mut determined = Vec::new();
    if let Ok(Some(mount)) = &mount {
        determined = mount.determined(&robot);
        errors.mount = mount.mount_covariance();
        guess = mount.parameters;
        robot = robot.with_camera_at(mount.link_from_camera, &errors.mount);
    }
    Ok(Start { robot, guess, errors, map, mount, determined })
}

/// Returns the solver's result, its covariance including the parameters from the tag on the gripper; `None` if nothing
/// is left to solve for.
fn solve(
    solver: PositionSolver,
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    start: &Start,
) -> Option<PositionSolution> {
    let solved = solver(problem, free, &start.guess, &start.errors)?;
    let Ok(Some(mount)) = &start.mount else { return Some(solved) };
    let covariance = solved.covariance.with_gripper_tag(mount, &start.determined, &solved.by_mount);
    Some(PositionSolution { covariance, ..solved })
}
