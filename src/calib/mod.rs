//! BELIEF: from a recording and a nominal robot to calibrated joint sensors.
//!
//! `associate` turns recorded messages into views (of the `frames` that agree); `gripper_tag` finds where the camera hangs, `map` the tags where no survey does; `identify` measures the scale of a sensor of which nobody knows it;
//! `problem` is the geometry shared by all methods; one file per method solves it; `observability` names what the data
//! cannot determine before solving; `uncertainty` says how good the answer is and `verdict` whether to use it; `result` is
//! calibration.toml, `compact` its short form. Nothing here knows of a simulator.

mod associate;
mod camera_mount;
mod compact;
mod frames;
mod gripper_tag;
mod identify;
mod map;
mod minimum_distance;
mod observability;
mod problem;
mod result;
mod uncertainty;
mod valid_range;
mod verdict;

pub use associate::{CaptureData, Rejection, SeenCorners, TagView, View, associate, associate_within, surveyed};
pub use camera_mount::CameraMount;
pub use compact::{CompactCalibration, CompactError, CompactJoint, MAX_COMPACT_BYTES, PredictedToolError};
pub use gripper_tag::{MountEstimate, mount_by_gripper_tag};
pub use identify::{IdentifiedScale, identify_scales};
pub use map::{Known, MapResult, MapTag};
pub use minimum_distance::{Solution, SolveOutcome, minimum_distance};
pub use observability::{Unobservable, free_parameters};
pub use problem::{JointParameters, Parameter, ParameterKind, PositionProblem};
pub use result::{Calibration, CalibrationFileError, FitFigures, HeldOutFigures, JointResult, Status};
pub use uncertainty::{CommonErrors, ParameterCovariance, ToolErrorPrediction};
pub use valid_range::ValidRange;
pub use verdict::{MIN_HELD_OUT_VIEWS, MIN_VIEWS_PER_PARAMETER};

use crate::log::Recording;
use crate::robot::Robot;
use crate::routine::Method;
use crate::streams::{Mark, MarkKind, Message, Start};
use crate::time::Stamp;

/// Why no calibration came out at all; a poor one comes out refused instead.
#[derive(Debug, thiserror::Error)]
pub enum CalibError {
    #[error("{recording}: the joints {recorded:?} are not those of robot `{robot}`: {expected:?}")]
    JointNames { recording: String, robot: String, recorded: Vec<String>, expected: Vec<String> },
    #[error("{recording}: holds no captured views (no marks `capture_fit` on /marks), so there is nothing to fit")]
    NoCaptures { recording: String },
    #[error("{recording}: holds no view to fit; the arm came to rest for held-out views alone ({held_out})")]
    NoFitViews { recording: String, held_out: usize },
    #[error(
        "{recording}: no surveyed tag was seen in any view to fit; tags of robot `{robot}`: {known:?}, seen: {seen:?}"
    )]
    NoTags { recording: String, robot: String, known: Vec<u32>, seen: Vec<u32> },
    #[error("{recording}: only {views} captured views show a surveyed tag; at least {needed} are needed")]
    TooFewViews { recording: String, views: usize, needed: usize },
    #[error("{recording}: no joint lies between the base and the camera with a sensor that the views determine")]
    NothingObservable { recording: String },
    #[error("{recording}: no map of the tags can be made from its views: {problem}")]
    Map { recording: String, problem: String },
    #[error("the scale of joint `{joint}` cannot be measured: {problem}")]
    Identify { joint: String, problem: String },
}

/// The fewest views that may be fitted at all.
pub const MIN_VIEWS: usize = 3;

/// Calibrates `robot`'s joint sensors from the captured views of a recording, by the tags that it says were there.
///
/// A recording that marks its calibrations is worked through as it was marked, and the last one is the result: each uses the
/// views of its mark's span, a warm one starts from the last accepted one before it. Without such a mark all captured
/// views make one calibration. Sensors whose scale was measured on the way (`identify` marks) take it from there.
///
/// # Errors
/// [`CalibError`] when the recording holds nothing to fit. A doubtful fit is returned with [`Status::Refused`].
pub fn calibrate(recording: &Recording, robot: &Robot, method: Method) -> Result<Calibration, CalibError> {
    calibrate_among(recording, &surveyed(recording, robot), method)
}

/// The same, by the tags of `robot` whatever the recording says of them: a survey or a map that was made elsewhere.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_among(recording: &Recording, robot: &Robot, method: Method) -> Result<Calibration, CalibError> {
    check_joints(recording, robot)?;
    let mut accepted: Option<Calibration> = None;
    let mut used = Vec::new();
    let (last, earlier) = rounds(recording).split_last().map(|(last, rest)| (*last, rest.to_vec())).unwrap_or_default();
    for round in earlier {
        // One that came to nothing is in the way of nothing: the arm went on with what it believed in before.
        if let Ok(calibration) = one_round(recording, robot, method, &round, accepted.as_ref(), &mut used)
            && calibration.status == Status::Accepted
        {
            accepted = Some(calibration);
        }
    }
    one_round(recording, robot, method, &last, accepted.as_ref(), &mut used)
}

fn check_joints(recording: &Recording, robot: &Robot) -> Result<(), CalibError> {
    if recording.joint_names != robot.joint_names() {
        return Err(CalibError::JointNames {
            recording: recording.path.display().to_string(),
            robot: robot.name.clone(),
            recorded: recording.joint_names.clone(),
            expected: robot.joint_names(),
        });
    }
    Ok(())
}

/// One marked calibration; the default is the whole recording from the datasheet.
#[derive(Clone, Copy, Default)]
struct Round {
    message_idx: Option<usize>,
    span: Option<(Stamp, Stamp)>,
    is_warm: bool,
}

fn rounds(recording: &Recording) -> Vec<Round> {
    let mut rounds: Vec<(Stamp, Round)> = Vec::new();
    for (idx, (_, message)) in recording.messages.iter().enumerate() {
        let Message::Mark(Mark { start, end, kind: MarkKind::Calibrate(from) }) = message else { continue };
        let is_warm = *from == Start::Warm;
        rounds.push((*end, Round { message_idx: Some(idx), span: Some((*start, *end)), is_warm }));
    }
    rounds.sort_by_key(|(end, _)| *end);
    rounds.into_iter().map(|(_, round)| round).collect()
}

/// The views that tell of the camera's mount where these are more than the round's own: what the tag on the gripper said before
/// stays true for a warm start; a fresh one forgets it.
fn gripper_views(recording: &Recording, robot: &Robot, round: &Round) -> Option<CaptureData> {
    let (_, to) = round.span.filter(|_| round.is_warm && robot.gripper_tag.is_some())?;
    Some(associate_within(recording, robot, Some((Stamp { nanos: i64::MIN }, to))))
}

fn one_round(
    recording: &Recording,
    robot: &Robot,
    method: Method,
    round: &Round,
    accepted: Option<&Calibration>,
    used: &mut Vec<usize>,
) -> Result<Calibration, CalibError> {
    let name = || recording.path.display().to_string();
    let mut data = associate_within(recording, robot, round.span);
    let (robot, identified) = identify_scales(&data, robot)?;
    if !identified.is_empty() {
        // Travel is counted in the sensor's own scale.
        data = associate_within(recording, &robot, round.span);
    }
    let watched = gripper_views(recording, &robot, round);
    let of_watched = watched.iter().flat_map(|watched| &watched.used);
    used.extend(data.used.iter().chain(of_watched).chain(&round.message_idx));
    used.sort_unstable();
    used.dedup();
    data.used.clone_from(used);
    if data.n_marks == 0 {
        return Err(CalibError::NoCaptures { recording: name() });
    }
    if data.fit.is_empty() {
        return Err(CalibError::NoFitViews { recording: name(), held_out: data.held_out.len() });
    }
    let views = data.fit.iter().filter(|view| !view.tags.is_empty()).count();
    if views == 0 {
        let known = robot.tags.iter().map(|tag| tag.id).collect();
        return Err(CalibError::NoTags { recording: name(), robot: robot.name.clone(), known, seen: data.ids_seen });
    }
    if views < MIN_VIEWS {
        return Err(CalibError::TooFewViews { recording: name(), views, needed: MIN_VIEWS });
    }
    let mut robot = robot;
    let mut errors = CommonErrors::priors(&robot);
    let mut map = None;
    if robot.tags.iter().any(|tag| !tag.is_known()) {
        let mapped =
            map::map_tags(&mut data, &robot).map_err(|problem| CalibError::Map { recording: name(), problem })?;
        (robot, errors, map) = (mapped.robot, mapped.errors, Some(mapped.result));
    }
    let prior = accepted.filter(|_| round.is_warm);
    let mut guess = prior.map_or_else(JointParameters::default, |prior| prior.parameters(&robot));
    let mount = robot.gripper_tag.map(|tag| {
        let views = watched.as_ref().map_or(&data.fit, |watched| &watched.fit);
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
    let fit = PositionProblem::new(&robot, &data.fit);
    let (free, mut unobservable) = free_parameters(&fit, &guess);
    unobservable.retain(|left_out| !determined.contains(&left_out.parameter));
    if free.is_empty() {
        return Err(CalibError::NothingObservable { recording: name() });
    }
    let solution = match method {
        Method::MinimumDistance => minimum_distance(&fit, &free, &guess),
    };
    let (mut covariance, by_mount) = ParameterCovariance::estimate(&fit, &free, &solution.parameters, &errors);
    if let Ok(Some(mount)) = &mount {
        covariance = covariance.with_gripper_tag(mount, &determined, &by_mount);
    }
    let held_out = PositionProblem::new(&robot, &data.held_out);
    let linearity_scale = uncertainty::linearity_scale(&fit, &held_out, &solution.parameters, free.len());
    let as_found = robot.clone().with_linearity(linearity_scale);
    let task = uncertainty::predict_tool_error(&as_found, &solution.parameters, &covariance, data.task.as_ref());
    Ok(result::assemble(&result::Parts {
        recording,
        robot: &robot,
        method,
        data: &data,
        prior,
        identified: &identified,
        fit: &fit,
        held_out: &held_out,
        solution: &solution,
        covariance: &covariance,
        n_fitted: free.len(),
        mount: &mount,
        map,
        unobservable: &unobservable,
        linearity_scale,
        task,
    }))
}
