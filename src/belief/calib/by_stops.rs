//! A calibration by end stops alone: no view is fitted, so that every view that shows a tag is evidence.

use super::associate::{CaptureData, View};
use super::identify::IdentifiedScale;
use super::methods::{EndStopReading, fit_stops};
use super::problem::{JointParameters, PositionProblem};
use super::result::{Parts, assemble};
use super::{CalibError, Calibration, uncertainty};
use armcal_core::robot::Robot;
use armcal_core::routine::Method;

pub(super) fn calibrate(
    recording: String,
    messages_hash: String,
    robot: &Robot,
    mut data: CaptureData,
    prior: Option<&Calibration>,
    identified: &[IdentifiedScale],
) -> Result<Calibration, CalibError> {
    let guess = prior.map_or_else(JointParameters::default, |prior| prior.parameters(robot));
    let readings: Vec<EndStopReading> = data.stops.iter().map(|(_, reading)| *reading).collect();
    let fitted = fit_stops(robot, &readings, &guess).map_err(|problem| CalibError::NoStops { recording, problem })?;
    // Only a tag whose place is known can bear witness.
    let of_known_tags = |view: &mut View| view.tags.retain(|tag| robot.tags[tag.tag_idx].is_known());
    data.fit.iter_mut().chain(&mut data.held_out).for_each(of_known_tags);
    let at = &fitted.solution.parameters;
    let (fit, held_out) = (PositionProblem::new(robot, &data.fit), PositionProblem::new(robot, &data.held_out));
    let linearity_scale = uncertainty::linearity_scale(&fit, &held_out, at, 0);
    let as_found = robot.clone().with_linearity(linearity_scale);
    let task = uncertainty::predict_tool_error(&as_found, at, &fitted.covariance, data.task.as_ref());
    Ok(assemble(&Parts {
        messages_hash,
        robot,
        method: Method::JointLimits,
        data: &data,
        prior,
        identified,
        fit: &fit,
        held_out: &held_out,
        solution: &fitted.solution,
        covariance: &fitted.covariance,
        n_wanted: 0,
        mount: &Ok(None),
        map: None,
        unobservable: &fitted.left_out,
        linearity_scale,
        task,
        cross_validated: None,
    }))
}
