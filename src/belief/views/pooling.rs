//! Several recordings of one arm as one: the captured views of all.

use crate::views::association::{associate_within, declared_failed, surveyed};
use crate::views::calibration_data::{CalibrationData, HeldOut};
use crate::views::calibration_data::{hash_of, used_by};
use crate::views::constants::pooling::POSES_PER_RECORDING;
use crate::views::data_checks::{check_joints, check_order};
use crate::views::error::CalibError;
use crate::views::scale_identification::identify_scales;
use crate::views::view::{CaptureData, View};
use armcal_core::log::Recording;
use armcal_core::robot::{Robot, TagSurvey};
use armcal_core::routine::Method;
use armcal_core::streams::{Message, ReachTask, RecordedSurvey};
use armcal_core::time::Stamp;

/// Prepares the captured views of all recordings, regardless of the calibrations that they mark. `survey` overrides
/// their statements about the tags, and `task` counts if no recording names one. The order of the recordings does not
/// matter.
///
/// # Errors
/// [`CalibError`] for other joints, stamps that go backwards, no views, one recording given twice, or different
/// surveys.
pub fn prepare_pooled(
    recordings: &[Recording],
    robot: &Robot,
    survey: Option<&TagSurvey>,
    task: Option<&ReachTask>,
    method: Method,
) -> Result<CalibrationData, CalibError> {
    for recording in recordings {
        check_joints(recording, robot)?;
        check_order(recording)?;
    }
    let robot = match survey {
        Some(survey) => robot.clone().with_survey(survey.clone()),
        None => common_survey(recordings, robot)?,
    };
    let robot = recordings.iter().fold(robot, |robot, recording| declared_failed(recording, &robot, None));
    let mut pooled = pool(recordings, &robot, method)?;
    let (robot, identified) = identify_scales(&pooled.data, &robot)?;
    if !identified.is_empty() {
        // Travel is counted in the sensor's own scale.
        pooled = pool(recordings, &robot, method)?;
    }
    let Pooled { name, messages_hash, mut data } = pooled;
    if data.n_marks == 0 {
        return Err(CalibError::NoCaptures { recording: name });
    }
    data.task = data.task.or_else(|| task.cloned());
    Ok(CalibrationData {
        name,
        messages_hash,
        data,
        gripper_tag_data: None,
        held_out: HeldOut::AsMarked,
        robot,
        identified,
    })
}

/// Returns `robot` with the survey that all recordings agree on, because the tags must not have moved.
fn common_survey(recordings: &[Recording], robot: &Robot) -> Result<Robot, CalibError> {
    let of = |recording: &Recording| {
        recording.messages.iter().find_map(|(_, message)| match message {
            Message::Survey(survey) => Some(RecordedSurvey { stamp: Stamp::default(), ..survey.clone() }),
            _ => None,
        })
    };
    let Some(first) = recordings.first() else { return Ok(robot.clone()) };
    for other in &recordings[1..] {
        if of(other) != of(first) {
            let name = |recording: &Recording| recording.path.display().to_string();
            return Err(CalibError::Surveys { one: name(first), other: name(other) });
        }
    }
    Ok(surveyed(first, robot).into_owned())
}

struct Pooled {
    name: String,
    messages_hash: String,
    data: CaptureData,
}

fn pool(recordings: &[Recording], robot: &Robot, method: Method) -> Result<Pooled, CalibError> {
    let mut parts: Vec<(String, &Recording, CaptureData)> = recordings
        .iter()
        .map(|recording| {
            let data = associate_within(recording, robot, None);
            (hash_of(recording, &used_by(method, &data.used, &data)), recording, data)
        })
        .collect();
    parts.sort_by(|a, b| a.0.cmp(&b.0));
    if let Some(twice) = parts.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(CalibError::Twice { recording: twice[1].1.path.display().to_string() });
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"armcal pooled messages 1");
    let mut names: Vec<String> = Vec::new();
    let mut data = CaptureData::default();
    for (k, (hash, recording, part)) in parts.into_iter().enumerate() {
        hasher.update(hash.as_bytes());
        names.push(recording.path.display().to_string());
        add(&mut data, part, k as u32 * POSES_PER_RECORDING);
    }
    names.sort();
    data.ids_seen.sort_unstable();
    data.ids_seen.dedup();
    Ok(Pooled { name: names.join(", "), messages_hash: hasher.finalize().to_hex().to_string(), data })
}

fn add(data: &mut CaptureData, part: CaptureData, first_pose_idx: u32) {
    let renumbered = |mut view: View| {
        view.pose_idx = view.pose_idx.saturating_add(first_pose_idx);
        view
    };
    data.fit.extend(part.fit.into_iter().map(renumbered));
    data.held_out.extend(part.held_out.into_iter().map(renumbered));
    for (joint, views) in part.identify {
        data.identify.entry(joint).or_default().extend(views);
    }
    if data.task.is_none() {
        (data.task, data.rests) = (part.task, part.rests);
    }
    data.stops.extend(part.stops);
    data.touches.extend(part.touches);
    data.n_marks += part.n_marks;
    for (why, n) in part.rejected {
        *data.rejected.entry(why).or_default() += n;
    }
    data.ids_seen.extend(part.ids_seen);
    data.smallest_px = [0, 1].map(|axis| data.smallest_px[axis].min(part.smallest_px[axis]));
    data.largest_px = [0, 1].map(|axis| data.largest_px[axis].max(part.largest_px[axis]));
    let ranges =
        [(&mut data.oil_c, part.oil_c), (&mut data.water_c, part.water_c), (&mut data.pressure_pa, part.pressure_pa)];
    for (range, other) in ranges {
        *range = match (*range, other) {
            (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
            (one, other) => one.or(other),
        };
    }
}
