//! BELIEF: from a recording and a nominal robot to calibrated joint sensors.
//!
//! `associate` turns recorded messages into views; `problem` is the geometry shared by all methods; one file per
//! method solves it; `observability` names what the data cannot determine before solving; `uncertainty` says how good
//! the answer is and `verdict` whether to use it; `result` is calibration.toml. Nothing here knows of a simulator.

mod associate;
mod minimum_distance;
mod observability;
mod problem;
mod result;
mod uncertainty;
mod verdict;

pub use associate::{CaptureData, Rejection, TagView, View, associate};
pub use minimum_distance::{Solution, SolveOutcome, minimum_distance};
pub use observability::{Unobservable, free_parameters};
pub use problem::{JointParameters, Parameter, ParameterKind, PositionProblem};
pub use result::{Calibration, CalibrationFileError, FitFigures, HeldOutFigures, JointResult, Status, ValidRange};
pub use uncertainty::{ParameterCovariance, ToolErrorPrediction};

use crate::log::Recording;
use crate::robot::Robot;
use crate::routine::Method;

/// Why no calibration came out at all; a poor one comes out refused instead.
#[derive(Debug, thiserror::Error)]
pub enum CalibError {
    #[error("{recording}: the joints {recorded:?} are not those of robot `{robot}`: {expected:?}")]
    JointNames { recording: String, robot: String, recorded: Vec<String>, expected: Vec<String> },
    #[error("{recording}: holds no captured views (no marks `capture_fit` on /marks), so there is nothing to fit")]
    NoCaptures { recording: String },
    #[error(
        "{recording}: no surveyed tag was seen in any captured view; tags of robot `{robot}`: {known:?}, seen: {seen:?}"
    )]
    NoTags { recording: String, robot: String, known: Vec<u32>, seen: Vec<u32> },
    #[error("{recording}: only {views} captured views show a surveyed tag; at least {needed} are needed")]
    TooFewViews { recording: String, views: usize, needed: usize },
    #[error("{recording}: no joint lies between the base and the camera with a sensor that the views determine")]
    NothingObservable { recording: String },
}

/// The fewest views that may be fitted at all.
pub const MIN_VIEWS: usize = 3;

/// Calibrates `robot`'s joint sensors from the captured views of a recording.
///
/// # Errors
/// [`CalibError`] when the recording holds nothing to fit. A doubtful fit is returned with [`Status::Refused`].
pub fn calibrate(recording: &Recording, robot: &Robot, method: Method) -> Result<Calibration, CalibError> {
    let name = recording.path.display().to_string();
    if recording.joint_names != robot.joint_names() {
        return Err(CalibError::JointNames {
            recording: name,
            robot: robot.name.clone(),
            recorded: recording.joint_names.clone(),
            expected: robot.joint_names(),
        });
    }
    let data = associate(recording, robot);
    if data.n_marks == 0 {
        return Err(CalibError::NoCaptures { recording: name });
    }
    let views = data.fit.iter().filter(|view| !view.tags.is_empty()).count();
    if views == 0 {
        let known = robot.tags.iter().map(|tag| tag.id).collect();
        return Err(CalibError::NoTags { recording: name, robot: robot.name.clone(), known, seen: data.ids_seen });
    }
    if views < MIN_VIEWS {
        return Err(CalibError::TooFewViews { recording: name, views, needed: MIN_VIEWS });
    }
    let fit = PositionProblem::new(robot, &data.fit);
    let (free, unobservable) = free_parameters(&fit);
    if free.is_empty() {
        return Err(CalibError::NothingObservable { recording: name });
    }
    let solution = match method {
        Method::MinimumDistance => minimum_distance(&fit, &free),
    };
    let covariance = ParameterCovariance::estimate(&fit, &free, &solution.parameters);
    let task = uncertainty::predict_tool_error(robot, &solution.parameters, &covariance, data.task.as_ref());
    let held_out = PositionProblem::new(robot, &data.held_out);
    Ok(result::assemble(&result::Parts {
        recording,
        robot,
        method,
        data: &data,
        fit: &fit,
        held_out: &held_out,
        solution: &solution,
        covariance: &covariance,
        unobservable: &unobservable,
        task,
    }))
}
