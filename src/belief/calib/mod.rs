//! BELIEF: from a recording and a nominal robot to calibrated joint sensors.
//!
//! `associate` turns recorded messages into views (of the `frames` that agree); `gripper_tag` finds where the camera hangs, `map` the tags where no survey does; `identify` measures the scale of a sensor of which nobody knows it;
//! `problem` is the geometry shared by all methods; one file per method solves it; `observability` names what the data
//! cannot determine before solving; `uncertainty` says how good the answer is and `verdict` whether to use it; `result` is
//! calibration.toml, `compact` its short form. `foreign` makes views of recordings that mark none, `pooled` of several; `bad_data`
//! refuses what nobody can make sense of; `running` estimates between views. Nothing here knows of a simulator.

mod associate;
mod bad_data;
pub mod bundle;
mod bundle_round;
mod bundle_setup;
mod bundle_verdict;
mod by_stops;
mod camera_mount;
mod compact;
mod failed_joint;
mod file;
#[cfg(test)]
pub(crate) mod fixture;
mod foreign;
mod frames;
mod gripper_tag;
mod identify;
mod in_turn;
mod lookup;
mod map;
mod methods;
mod model_table;
mod observability;
mod pooled;
mod problem;
mod result;
mod running;
mod surroundings;
mod terms_table;
mod tool_error;
mod uncertainty;
mod valid_range;
mod verdict;
mod verdict_tables;

pub use associate::{
    CaptureData, MeanCorners, ObservationRejection, TagMeasurement, TagObservation, View, associate, associate_within,
    surveyed,
};
pub use camera_mount::CameraMount;
pub use compact::{CompactCalibration, CompactError, CompactJoint, MAX_COMPACT_BYTES, PredictedToolError};
pub use failed_joint::{FailedJointTable, PriorTable};
pub use file::CalibrationFileError;
pub use foreign::{ForeignContext, prepare_foreign};
pub use gripper_tag::{MountEstimate, mount_by_gripper_tag};
pub use identify::{IdentifiedScale, identify_scales};
pub use lookup::LookupTable;
pub use map::{MapResult, MapTag, SurveyCoverage};
pub use methods::{
    EndStopFit, EndStopReading, Gauge, Interpolation, PositionMethod, Scaling, SearchOptions, Solution, SolveOutcome,
    VarianceObjective, determined_by_variance, fisher_information, fit_stops, least_squares, minimum_distance,
};
pub use model_table::ModelTable;
pub use observability::{Unobservable, free_parameters};
pub use pooled::prepare_pooled;
pub use problem::{JointParameters, Parameter, ParameterKind, PositionProblem};
pub use result::{Calibration, FitMetrics, HeldOutMetrics, JointResult, Status};
pub use running::interim_estimate;
pub use surroundings::ConditionHistory;
pub use terms_table::{ReferenceTable, TermsTable};
pub use uncertainty::{CommonErrors, ParameterCovariance, ToolErrorPrediction};
pub use valid_range::ValidRange;
pub use verdict::{MIN_HELD_OUT_VIEWS, MIN_VIEWS_PER_PARAMETER, fewest_views};
pub use verdict_tables::{Check, ObservabilityTable, VerdictTable};

use armcal_core::log::{Recording, StampRegression, hash_messages};
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::streams::{Mark, MarkKind, Message, PriorSource};
use armcal_core::time::Stamp;
use associate::declared_failed;
use bad_data::{check_joints, check_order, check_pose_variation};
use bundle_round::{BundleCalibration, EstimatePurpose};

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
    #[error("{recording}: no joint can be calibrated by its end stops: {problem}")]
    NoStops { recording: String, problem: String },
    #[error("{recording}: no map of the tags can be made from its views: {problem}")]
    Map { recording: String, problem: String },
    #[error("the scale of joint `{joint}` cannot be measured: {problem}")]
    Identify { joint: String, problem: String },
    #[error(
        "{recording}: all {views} views are of one pose: no joint between base and camera moved by more than its noise \
         (the most: `{joint}`, {moved_deg:.3} deg), so nothing can be told of any"
    )]
    OnePose { recording: String, views: usize, joint: String, moved_deg: f64 },
    #[error("{recording}: no running estimate: {problem}")]
    NoRunningEstimate { recording: String, problem: String },
    #[error("{recording}: was given twice, or holds the messages of another one")]
    Twice { recording: String },
    #[error("{one} and {other} say different things of the tags; give a tag map that holds for both")]
    Surveys { one: String, other: String },
    #[error("{recording}: {n} of {of} messages rejected on {what}: too many to go on")]
    NotFinite { recording: String, what: String, n: u64, of: u64 },
    #[error("{recording}: no view is left: {reasons}")]
    AllRejected { recording: String, reasons: String },
    #[error("{recording}: topic {topic}: {disorder}")]
    Disorder { recording: String, topic: String, disorder: StampRegression },
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
    calibrate_with_survey(recording, &surveyed(recording, robot), method)
}

/// The same, by the tags of `robot` whatever the recording says of them: a survey or a map that was made elsewhere.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_with_survey(recording: &Recording, robot: &Robot, method: Method) -> Result<Calibration, CalibError> {
    check_joints(recording, robot)?;
    check_order(recording)?;
    let robot = &declared_failed(recording, robot);
    let mut accepted: Option<Calibration> = None;
    let mut used = Vec::new();
    let (last, earlier) = rounds(recording).split_last().map(|(last, rest)| (*last, rest.to_vec())).unwrap_or_default();
    for round in earlier {
        // One that came to nothing is in the way of nothing: the arm went on with what it believed in before.
        if let Ok(calibration) = run_marked(recording, robot, method, &round, accepted.as_ref(), &mut used)
            && calibration.status == Status::Accepted
        {
            accepted = Some(calibration);
        }
    }
    run_marked(recording, robot, method, &last, accepted.as_ref(), &mut used)
}

/// What `method` has used of a recording, ascending.
fn used_by(method: Method, used: &[usize], data: &CaptureData) -> Vec<usize> {
    let mut all = used.to_vec();
    if method == Method::Bundle {
        all.extend(&data.used_for_terms);
        all.sort_unstable();
        all.dedup();
    }
    all
}

fn hash_of(recording: &Recording, used: &[usize]) -> String {
    let messages = used.iter().map(|&idx| (recording.messages[idx].0, &recording.messages[idx].1));
    hash_messages(messages, &recording.joint_names).expect("what was read from a recording can be written to one")
}

/// One marked calibration; the default is the whole recording from the datasheet.
#[derive(Clone, Copy, Default)]
struct MarkedCalibration {
    message_idx: Option<usize>,
    span: Option<(Stamp, Stamp)>,
    is_warm: bool,
}

fn rounds(recording: &Recording) -> Vec<MarkedCalibration> {
    let mut rounds: Vec<(Stamp, MarkedCalibration)> = Vec::new();
    for (idx, (_, message)) in recording.messages.iter().enumerate() {
        let Message::Mark(Mark { start, end, kind: MarkKind::Calibrate(from) }) = message else { continue };
        let is_warm = *from == PriorSource::Warm;
        rounds.push((*end, MarkedCalibration { message_idx: Some(idx), span: Some((*start, *end)), is_warm }));
    }
    rounds.sort_by_key(|(end, _)| *end);
    rounds.into_iter().map(|(_, round)| round).collect()
}

/// The views that tell of the camera's mount where these are more than the round's own: what the tag on the gripper said before
/// stays true for a warm start; a fresh one forgets it.
fn gripper_views(recording: &Recording, robot: &Robot, round: &MarkedCalibration) -> Option<CaptureData> {
    let (_, to) = round.span.filter(|_| round.is_warm && robot.gripper_tag.is_some())?;
    Some(associate_within(recording, robot, Some((Stamp { nanos: i64::MIN }, to))))
}

fn run_marked(
    recording: &Recording,
    robot: &Robot,
    method: Method,
    round: &MarkedCalibration,
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
    if data.n_marks == 0 && method != Method::JointLimits {
        return Err(CalibError::NoCaptures { recording: name() });
    }
    let messages_hash = hash_of(recording, &used_by(method, used, &data));
    let prior = accepted.filter(|prior| round.is_warm && !(method == Method::Bundle && rests_on(prior, &data)));
    let held_out = HeldOut::AsMarked;
    let prepared =
        CalibrationData { name: name(), messages_hash, data, gripper_tag_data: watched, held_out, robot, identified };
    if method != Method::Bundle || prior.is_none() {
        return calibrate_data(prepared, method, prior);
    }
    let warm = calibrate_data(prepared.clone(), method, prior)?;
    let contradicted = warm.prior.as_ref().filter(|prior| !prior.agrees);
    let Some(contradicted) = contradicted.map(|table| table.clone().unused()) else { return Ok(warm) };
    // Something happened to the arm since: the new views alone tell how it is now, if they are enough.
    match calibrate_data(prepared, method, None)? {
        fresh if fresh.status == Status::Accepted => Ok(Calibration { prior: Some(contradicted), ..fresh }),
        _ => Ok(warm),
    }
}

/// Whether `prior` was made from views that are among these: they must not count twice.
fn rests_on(prior: &Calibration, data: &CaptureData) -> bool {
    data.fit.iter().chain(&data.held_out).any(|view| view.end.nanos <= prior.valid.time_nanos)
}

/// Which views the verdict rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeldOut {
    /// Those that the recording marks; the fit never sees them.
    AsMarked,
    /// All, each by what was learnt from the views of other folds; the answer is fitted to all.
    CrossValidation,
}

/// Views that are ready to be fitted, wherever they come from.
#[derive(Clone)]
pub struct CalibrationData {
    /// The recording or recordings, for messages.
    pub name: String,
    /// Of the messages that the views come from.
    pub messages_hash: String,
    pub data: CaptureData,
    /// The views that tell of the camera's mount, where they are others than `data`'s.
    pub gripper_tag_data: Option<CaptureData>,
    pub held_out: HeldOut,
    /// With the tags that were around it, and the scales of `identified`.
    pub robot: Robot,
    pub identified: Vec<IdentifiedScale>,
}

/// Calibrates from views; a `prior` is what to start from instead of the datasheet.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_data(
    prepared: CalibrationData,
    method: Method,
    prior: Option<&Calibration>,
) -> Result<Calibration, CalibError> {
    let CalibrationData {
        name,
        messages_hash,
        mut data,
        gripper_tag_data: watched,
        held_out: which_held_out,
        robot,
        identified,
    } = prepared;
    let name = || name.clone();
    if method == Method::JointLimits {
        return by_stops::calibrate(name(), messages_hash, &robot, data, prior, &identified);
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
    check_pose_variation(&name(), &data, &robot)?;
    let mut robot = robot;
    let mut errors = CommonErrors::priors(&robot);
    let mut map = None;
    if robot.tags.iter().any(|tag| !tag.is_known()) {
        let mapped =
            map::map_tags(&mut data, &robot).map_err(|problem| CalibError::Map { recording: name(), problem })?;
        // `bundle` moves the tags itself.
        let start = (method == Method::Bundle).then(|| mapped.start(&robot));
        (robot, errors, map) = (start.unwrap_or(mapped.robot), mapped.errors, Some(mapped.result));
    }
    if method == Method::Bundle {
        let (recording, robot) = (name(), &robot);
        let effort = EstimatePurpose::Judged;
        let round = BundleCalibration { recording, messages_hash, robot, identified: &identified, prior, map, effort };
        return round.calibrate(data);
    }
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
    let (mut free, mut unobservable) = free_parameters(&fit, &guess);
    let n_wanted = free.len() + unobservable.iter().filter(|u| u.parameter.joint < robot.camera.mount.n_joints).count();
    unobservable.retain(|left_out| !determined.contains(&left_out.parameter));
    if free.is_empty() {
        return Err(CalibError::NothingObservable { recording: name() });
    }
    let solved = solve(method, &fit, &mut free, &guess, &errors, &mut unobservable);
    let (solution, mut covariance, by_mount) =
        solved.ok_or_else(|| CalibError::NothingObservable { recording: name() })?;
    if let Ok(Some(mount)) = &mount {
        covariance = covariance.with_gripper_tag(mount, &determined, &by_mount);
    }
    let held_out = PositionProblem::new(&robot, &data.held_out);
    let linearity_scale = uncertainty::linearity_scale(&fit, &held_out, &solution.parameters, free.len());
    let cross_validated = (which_held_out == HeldOut::CrossValidation).then(|| {
        in_turn::held_out_figures(&robot, &data.fit, |views| {
            let (mut free, mut left_out) = (free.clone(), Vec::new());
            let part = PositionProblem::new(&robot, views);
            let solved = solve(method, &part, &mut free, &guess, &errors, &mut left_out);
            solved.map(|(solution, ..)| solution.parameters)
        })
    });
    let as_found = robot.clone().with_linearity(linearity_scale);
    let task = uncertainty::predict_tool_error(&as_found, &solution.parameters, &covariance, data.task.as_ref());
    Ok(result::assemble(&result::Parts {
        messages_hash,
        robot: &robot,
        method,
        data: &data,
        prior,
        identified: &identified,
        fit: &fit,
        held_out: &held_out,
        solution: &solution,
        covariance: &covariance,
        n_wanted,
        mount: &mount,
        map,
        unobservable: &unobservable,
        linearity_scale,
        task,
        cross_validated,
    }))
}

/// The answer of a method on positions, its covariance, and how it goes along with the mount. Takes out of `free` what the method
/// cannot determine; `None` if nothing is left.
fn solve(
    method: Method,
    fit: &PositionProblem<'_>,
    free: &mut Vec<Parameter>,
    guess: &JointParameters,
    errors: &CommonErrors,
    unobservable: &mut Vec<Unobservable>,
) -> Option<(Solution, ParameterCovariance, nalgebra::DMatrix<f64>)> {
    if method == Method::MinimumVariance {
        let (determined, blind) = determined_by_variance(fit, free, guess);
        *free = determined;
        unobservable.extend(blind);
        unobservable.sort_by_key(|left_out| left_out.parameter);
        if free.is_empty() {
            return None;
        }
        let solution = PositionMethod::MinimumVariance.solve(fit, free, guess, &SearchOptions::default());
        let (covariance, by_mount) = methods::variance_covariance(fit, free, &solution.parameters, errors);
        return Some((solution, covariance, by_mount));
    }
    let solution = minimum_distance(fit, free, guess);
    let (covariance, by_mount) = ParameterCovariance::estimate(fit, free, &solution.parameters, errors);
    Some((solution, covariance, by_mount))
}
