//! Calibrations from a recording: each one that the recording marks, in their order.

pub use crate::batch::constants::marked_calibrations::MIN_VIEWS;
use armcal_core::log::Recording;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::streams::{Mark, MarkKind, Message, PriorSource};
use armcal_core::time::Stamp;

use crate::batch::rounds::{BundleCalibration, EstimateListener, EstimatePurpose};
use crate::batch::slips_in_views::refuse_slips;
use crate::batch::slips_since::slips_since;
use crate::file::calibration::{Calibration, Status};
use crate::methods::calibration::calibrate_positions;
use crate::methods::calibration_method::CalibrationMethod;
use crate::methods::end_stops;
use crate::views::association::{associate_within, declared_failed, surveyed};
use crate::views::calibration_data::{CalibrationData, HeldOut, hash_of, used_by};
use crate::views::data_checks::{check_corner_order, check_joints, check_order, check_pose_variation, no_views};
use crate::views::error::CalibError;
use crate::views::scale_identification::identify_scales;
use crate::views::view::CaptureData;

/// Calibrates `robot`'s joint sensors from the captured views of a recording, with the tags that the recording states.
///
/// A recording with marked calibrations runs them as marked, and the last one is the result. Each uses the views of its
/// mark's span; a warm one starts from the last accepted one before it. Without such a mark all captured views make one
/// calibration. Sensors whose scale an `identify` mark measured use that scale.
///
/// # Errors
/// [`CalibError`] when the recording holds nothing to fit. A doubtful fit is returned with [`Status::Refused`].
pub fn calibrate(recording: &Recording, robot: &Robot, method: CalibrationMethod) -> Result<Calibration, CalibError> {
    calibrate_with_survey(recording, &surveyed(recording, robot), method)
}

/// Calibrates as [`calibrate`] does, but with the tags of `robot`, from a survey or map that was made elsewhere.
///
/// # Errors
/// Fails as [`calibrate`] does.
pub fn calibrate_with_survey(
    recording: &Recording,
    robot: &Robot,
    method: CalibrationMethod,
) -> Result<Calibration, CalibError> {
    check_joints(recording, robot)?;
    check_order(recording)?;
    let mut run = MarkedRun { recording, robot, method, used: Vec::new() };
    let marked = marked_calibrations(recording);
    let (last, earlier) = marked.split_last().map_or((MarkedCalibration::default(), &[][..]), |(l, e)| (*l, e));
    let mut accepted: Option<Calibration> = None;
    for marked in earlier {
        // A failed calibration leaves the previous estimate in use.
        if let Ok(calibration) = run.run_marked(marked, accepted.as_ref())
            && calibration.status == Status::Accepted
        {
            accepted = Some(calibration);
        }
    }
    run.run_marked(&last, accepted.as_ref())
}

/// One marked calibration; the default is the whole recording from the datasheet.
#[derive(Clone, Copy, Default)]
struct MarkedCalibration {
    message_idx: Option<usize>,
    span: Option<(Stamp, Stamp)>,
    is_warm: bool,
}

/// Returns the marked calibrations in the order of time.
fn marked_calibrations(recording: &Recording) -> Vec<MarkedCalibration> {
    let mut marked: Vec<(Stamp, MarkedCalibration)> = Vec::new();
    for (idx, (_, message)) in recording.messages.iter().enumerate() {
        let Message::Mark(Mark { start, end, kind: MarkKind::Calibrate(from) }) = message else { continue };
        let is_warm = *from == PriorSource::Warm;
        marked.push((*end, MarkedCalibration { message_idx: Some(idx), span: Some((*start, *end)), is_warm }));
    }
    marked.sort_by_key(|(end, _)| *end);
    marked.into_iter().map(|(_, marked)| marked).collect()
}

/// State of a recording while its marked calibrations run.
struct MarkedRun<'a> {
    recording: &'a Recording,
    robot: &'a Robot,
    method: CalibrationMethod,
    /// Messages used so far, ascending.
    used: Vec<usize>,
}

impl MarkedRun<'_> {
    fn run_marked(
        &mut self,
        marked: &MarkedCalibration,
        accepted: Option<&Calibration>,
    ) -> Result<Calibration, CalibError> {
        let data = self.data(marked)?;
        let is_reused = |prior: &&Calibration| self.method.method() == Method::Bundle && rests_on(prior, &data.data);
        let prior = accepted.filter(|prior| marked.is_warm && !is_reused(prior));
        if self.method.method() != Method::Bundle || prior.is_none() {
            return calibrate_data(data, self.method, prior);
        }
        let warm = calibrate_data(data.clone(), self.method, prior)?;
        let contradicted = warm.prior.as_ref().filter(|prior| !prior.agrees);
        let Some(contradicted) = contradicted.map(|table| table.clone().unused()) else { return Ok(warm) };
        // The arm has changed since the prior: the new views determine its state without it, if they are enough.
        match calibrate_data(data, self.method, None)? {
            mut fresh if fresh.status == Status::Accepted => {
                let slips: Vec<_> = prior.iter().flat_map(|prior| slips_since(prior, &fresh, self.robot)).collect();
                fresh.findings.extend(slips);
                Ok(Calibration { prior: Some(contradicted), ..fresh })
            }
            _ => Ok(warm),
        }
    }

    /// The views of a marked calibration, and the hash of all messages used up to it.
    fn data(&mut self, marked: &MarkedCalibration) -> Result<CalibrationData, CalibError> {
        let name = self.recording.path.display().to_string();
        let robot = declared_failed(self.recording, self.robot, marked.span);
        let mut data = associate_within(self.recording, &robot, marked.span);
        let (robot, identified) = identify_scales(&data, &robot)?;
        if !identified.is_empty() {
            // Travel is in the sensor's own scale.
            data = associate_within(self.recording, &robot, marked.span);
        }
        let gripper_tag_data = self.gripper_tag_data(&robot, marked);
        let of_gripper_tag = gripper_tag_data.iter().flat_map(|data| &data.used);
        self.used.extend(data.used.iter().chain(of_gripper_tag).chain(&marked.message_idx));
        self.used.sort_unstable();
        self.used.dedup();
        if data.n_marks == 0 && self.method.method() != Method::JointLimits {
            return Err(CalibError::NoCaptures { recording: name });
        }
        let messages_hash = hash_of(self.recording, &used_by(self.method.method(), &self.used, &data));
        let held_out = HeldOut::AsMarked;
        Ok(CalibrationData { name, messages_hash, data, gripper_tag_data, held_out, robot, identified })
    }

    /// The views that determine the camera mount, if there are more than the marked ones. Earlier views of the gripper
    /// tag stay valid for a warm start; a fresh one ignores them.
    fn gripper_tag_data(&self, robot: &Robot, marked: &MarkedCalibration) -> Option<CaptureData> {
        let (_, to) = marked.span.filter(|_| marked.is_warm && robot.gripper_tag.is_some())?;
        Some(associate_within(self.recording, robot, Some((Stamp { nanos: i64::MIN }, to))))
    }
}

/// Returns true if `prior` was made from views of `data`, which must not count twice.
fn rests_on(prior: &Calibration, data: &CaptureData) -> bool {
    data.fit.iter().chain(&data.held_out).any(|view| view.end.nanos <= prior.valid.time_nanos)
}

/// Calibrates from views. The search starts from `prior` instead of the datasheet, and under `bundle` the prior has
/// weight. Other methods use only the first camera's views.
///
/// # Errors
/// Fails as [`calibrate`] does.
pub fn calibrate_data(
    mut data: CalibrationData,
    method: CalibrationMethod,
    prior: Option<&Calibration>,
) -> Result<Calibration, CalibError> {
    if data.robot.is_watched() && prior.is_some_and(|prior| prior.sag.is_some()) {
        return Err(CalibError::PriorSag { recording: data.name });
    }
    data.data.leave_out_repeated();
    match method {
        CalibrationMethod::JointLimits => end_stops::calibrate(data, prior),
        CalibrationMethod::Bundle => {
            check_views(&data)?;
            BundleCalibration::new(data, prior, EstimatePurpose::Final)?.calibrate()
        }
        CalibrationMethod::Positions { method, solve } => {
            data.data.keep_first_camera();
            check_views(&data)?;
            let mut calibration = calibrate_positions(data.clone(), (method, solve), prior)?;
            refuse_slips(&mut calibration, data);
            Ok(calibration)
        }
    }
}

/// Calibrates by `bundle` from the datasheet; `listener` receives the estimate by the views.
///
/// # Errors
/// Fails as [`calibrate`] does.
pub(crate) fn calibrate_bundle(
    data: CalibrationData,
    listener: &mut EstimateListener<'_>,
) -> Result<Calibration, CalibError> {
    check_views(&data)?;
    BundleCalibration::new(data, None, EstimatePurpose::Final)?.with_listener(listener).calibrate()
}

/// Returns an error if the data hold too little for a fit.
fn check_views(data: &CalibrationData) -> Result<(), CalibError> {
    let CalibrationData { name, data, robot, .. } = data;
    if data.fit.is_empty() {
        return Err(CalibError::NoFitViews { recording: name.clone(), held_out: data.held_out.len() });
    }
    check_corner_order(name, data)?;
    let views = data.fit.iter().filter(|view| !view.tags.is_empty()).count();
    if views == 0 {
        return Err(no_views(name.clone(), robot, data));
    }
    if views < MIN_VIEWS {
        return Err(CalibError::TooFewViews { recording: name.clone(), views, needed: MIN_VIEWS });
    }
    check_pose_variation(name, data, robot)
}
