//! One calibration by end stops only: it fits no view, so that every view that shows a tag checks it.

use crate::checks::assemble::{Evidence, Fit, Provenance, assemble, held_out_metrics};
use crate::file::calibration::Calibration;
use crate::methods::joint_limits::fit_stops;
use crate::model::parameters::JointParameters;
use crate::positions::position_problem::PositionProblem;
use crate::positions::unobservable::grouped_names;
use crate::solve::covariance::{linearity_scale, predict_tool_error};
use crate::views::calibration_data::CalibrationData;
use crate::views::error::CalibError;
use crate::views::view::EndStopReading;
use crate::views::view::View;
use armcal_core::routine::Method;

/// # Errors
/// [`CalibError::NoStops`] if no joint can be calibrated by its end stops.
pub(crate) fn calibrate(data: CalibrationData, prior: Option<&Calibration>) -> Result<Calibration, CalibError> {
    let CalibrationData { name, messages_hash, mut data, robot, identified, .. } = data;
    let guess = prior.map_or_else(JointParameters::default, |prior| prior.parameters(&robot));
    let readings: Vec<EndStopReading> = data.stops.iter().map(|(_, reading)| *reading).collect();
    let fitted = fit_stops(&robot, &readings, &guess)
        .map_err(|problem| CalibError::NoStops { recording: name.clone(), problem })?;
    // Only tags of known pose can check the result.
    let of_known_tags = |view: &mut View| view.tags.retain(|tag| robot.tags[tag.tag_idx].is_known());
    data.fit.iter_mut().chain(&mut data.held_out).for_each(of_known_tags);
    let (at, covariance) = (&fitted.solution.parameters, &fitted.covariance);
    let (problem, held_out) = (PositionProblem::new(&robot, &data.fit), PositionProblem::new(&robot, &data.held_out));
    let linearity_scale = linearity_scale(&problem, &held_out, at, 0);
    let as_found = robot.clone().with_linearity(linearity_scale);
    let predicted = predict_tool_error(&as_found, at, covariance, data.task_rests());
    let source = Provenance {
        messages_hash: &messages_hash,
        robot: &robot,
        method: Method::JointLimits,
        data: &data,
        prior,
        identified: &identified,
    };
    let fit = Fit { problem: &problem, solution: &fitted.solution, covariance, linearity_scale };
    let (held_out, has_failed_joint) = (held_out_metrics(&held_out, at), !robot.failed.is_empty());
    let evidence = Evidence { held_out, predicted, n_parameters: 0, has_failed_joint };
    let unobservable = grouped_names(&robot, &fitted.left_out);
    Ok(Calibration { unobservable, ..assemble(&source, &fit, evidence) })
}
