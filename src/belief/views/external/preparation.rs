//! Views of all recordings of an arm together, by their stamps; all are fitted, and cross-validated for the verdict.

use std::collections::BTreeMap;

use crate::views::calibration_data::{CalibrationData, HeldOut};
use crate::views::data_checks::{check_corner_order, no_views};
use crate::views::error::CalibError;
use crate::views::external::clock_shift::clock_shift;
use crate::views::external::landmarks::PlainLandmark;
use crate::views::external::pairing::TravelSeries;
use crate::views::external::views::RecordingViews;
use crate::views::view::{CaptureData, View};
use armcal_core::input::{ExternalRecording, InputMap, RawMeasurement};
use armcal_core::robot::Robot;
use armcal_core::streams::ReachTask;

/// Information in addition to the recordings.
#[derive(Clone, Debug, Default)]
pub struct ExternalContext {
    /// Task; without it no tool error is predicted.
    pub task: Option<ReachTask>,
    /// Names of landmarks that are no numbered tags, by the number that stands for them.
    pub landmark_names: BTreeMap<u32, String>,
    /// Landmark of a plain `child_frame`.
    pub plain: PlainLandmark,
}

/// Returns the views of recordings of one arm; `robot` has the landmarks around it.
///
/// # Errors
/// [`CalibError::Twice`] for a recording that is given twice, [`CalibError::Clocks`] where camera and joints moved at
/// different times. Without any view, [`CalibError::Clocks`] if the clocks cause it, else [`CalibError::NoTags`] or
/// [`CalibError::AllRejected`].
pub fn prepare_external(
    recordings: &[ExternalRecording],
    map: &InputMap,
    robot: &Robot,
    context: ExternalContext,
) -> Result<CalibrationData, CalibError> {
    let name = names_of(recordings);
    let mut data = CaptureData {
        task: context.task,
        tag_noise: map.tag_noise,
        landmark_names: context.landmark_names,
        ..CaptureData::default()
    };
    let mut views: Vec<(View, [u8; 32])> = Vec::new();
    let mut digests: Vec<[u8; 32]> = Vec::new();
    for recording in recordings {
        for seen in recording.frames.iter().flat_map(|frame| &frame.tags) {
            match &seen.seen {
                RawMeasurement::Corners(corners_px) => data.note_corners(corners_px),
                RawMeasurement::BoardCorner { pixel, .. } => data.note_corners(&[*pixel]),
                RawMeasurement::Position(_) | RawMeasurement::Pose(_) => {}
            }
        }
        let travels = TravelSeries::new(recording, robot, map.max_gap_s);
        if let Some(shift) = clock_shift(&travels, &recording.frames, robot) {
            let recording = recording.path.display().to_string();
            return Err(CalibError::Clocks { recording, problem: shift.to_string() });
        }
        let made = RecordingViews::of(recording, map, robot, context.plain);
        if made.views.iter().any(|made| views.iter().any(|(_, other)| *other == made.first)) {
            return Err(CalibError::Twice { recording: recording.path.display().to_string() });
        }
        views.extend(made.views.into_iter().map(|made| (made.view, made.first)));
        digests.extend(made.digests);
        data.ids_seen.extend(made.ids_seen);
        for (why, n) in made.rejected {
            *data.rejected.entry(why).or_default() += n;
        }
    }
    // Recordings may overlap in time. The message's hash settles the order of equal stamps, so that the order of the
    // arguments does not matter.
    views.sort_by(|(a, of_a), (b, of_b)| a.end.cmp(&b.end).then(of_a.cmp(of_b)));
    data.n_marks = views.len();
    let numbered = |(k, (view, _))| View { pose_idx: k as u32, ..view };
    data.fit = views.into_iter().enumerate().map(numbered).collect();
    data.ids_seen.sort_unstable();
    data.ids_seen.dedup();
    if data.fit.is_empty() {
        let of_clocks = recordings.iter().find_map(|recording| {
            let problem = recording.clock_doubt.clone()?;
            Some(CalibError::Clocks { recording: recording.path.display().to_string(), problem })
        });
        return Err(of_clocks.unwrap_or_else(|| no_views(name, robot, &data)));
    }
    check_corner_order(&name, &data)?;
    let messages_hash = hash(&mut digests);
    Ok(CalibrationData {
        name,
        messages_hash,
        data,
        gripper_tag_data: None,
        held_out: HeldOut::CrossValidation,
        robot: with_stated_angles(robot, map),
        identified: Vec::new(),
    })
}

/// Returns the arm with the form in which the input map states each sensor's readings.
fn with_stated_angles(robot: &Robot, map: &InputMap) -> Robot {
    let mut robot = robot.clone();
    robot.sensors.iter_mut().for_each(|spec| spec.stated = map.stated(spec));
    robot
}

fn names_of(recordings: &[ExternalRecording]) -> String {
    let mut names: Vec<String> = recordings.iter().map(|recording| recording.path.display().to_string()).collect();
    names.sort();
    names.join(", ")
}

/// Returns the hash of the messages that the views come from, independent of their order and files.
fn hash(digests: &mut Vec<[u8; 32]>) -> String {
    digests.sort_unstable();
    digests.dedup();
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"armcal foreign messages 1");
    for digest in digests.iter() {
        hasher.update(digest);
    }
    hasher.finalize().to_hex().to_string()
}
