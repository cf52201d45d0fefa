//! Search for the reading of recording, map or lens under which the tags of each view fit one another.

use super::pairs::{Pairs, distances, mismatch};
use super::{BETTER, GOOD, SIZE_TOLERANCE, StatedCamera, lens, map, recording};
use crate::explain::constants::wrong_input_by_pairs::BAD;
use crate::say::length_unit::unit_of;
use crate::say::wrong_input::{MismatchMeasure, WrongInput, WrongInputKind};
use crate::views::view::{TagMeasurement, TagObservation, View};
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::robot::SurveyedTag;

/// Returns the first that fits of these: a reading of poses, map or lens, exchanged ids, another map, a wrong scale.
pub(crate) fn by_pairs(
    views: &[&View],
    tags: &[SurveyedTag],
    camera: StatedCamera<'_>,
    as_written: &Pairs,
) -> Option<WrongInput> {
    let stated = camera.lens;
    let wrong = |input, otherwise| wrong_by(as_written, input, otherwise);
    let maps = map::readings(tags).into_iter().map(|(input, tags)| (input, mismatch(views, &tags, stated)));
    let lenses = lens::readings(stated).into_iter().map(|(input, lens)| (input, mismatch(views, tags, &lens)));
    let all = poses_otherwise(views, tags, stated).into_iter().chain(maps).chain(lenses);
    let fitting = all.filter_map(|(input, pairs)| Some((input, pairs?.mismatch)));
    let fitting = fitting.filter(|(_, mismatch)| *mismatch < GOOD.min(BETTER * as_written.mismatch));
    if let Some((input, otherwise)) = fitting.min_by(|a, b| a.1.total_cmp(&b.1)) {
        return Some(wrong(input, Some(otherwise)));
    }
    if let Some((ids, before, after)) = map::exchanged_ids(views, tags, stated) {
        return Some(WrongInput { mismatch: before, ..wrong(WrongInputKind::ExchangedIds(ids), Some(after)) });
    }
    if as_written.mismatch > BAD {
        return Some(wrong(WrongInputKind::OtherMap, None));
    }
    let is_scaled = (as_written.ratio - 1.0).abs() > SIZE_TOLERANCE && as_written.mismatch < GOOD;
    is_scaled.then(|| of_scale(views, camera.tag_family, as_written))
}

/// Wrong scale of recorded positions, by their distances only: such landmarks have no rotation that could reveal more.
pub(crate) fn by_distances(views: &[&View], tags: &[SurveyedTag], family: TagFamily) -> Option<WrongInput> {
    let found = distances(views, tags)?;
    let is_scaled = (found.ratio - 1.0).abs() > SIZE_TOLERANCE;
    let is_sure = found.mismatch < GOOD.min(BETTER * found.ratio.ln().abs());
    (is_scaled && is_sure).then(|| of_scale(views, family, &found))
}

fn wrong_by(as_written: &Pairs, input: WrongInputKind, otherwise: Option<f64>) -> WrongInput {
    let (measure, mismatch) = (MismatchMeasure::Distances, as_written.mismatch);
    WrongInput { input, measure, mismatch, mismatch_otherwise: otherwise, size_hint: None }
}

/// Mismatch of recorded poses under each other reading; empty if there are no poses.
fn poses_otherwise(views: &[&View], tags: &[SurveyedTag], lens: &CameraModel) -> Vec<(WrongInputKind, Option<Pairs>)> {
    let is_pose = |seen: &TagObservation| matches!(seen.measured, TagMeasurement::Pose(_));
    if !views.iter().any(|view| view.tags.iter().any(is_pose)) {
        return Vec::new();
    }
    let with = |read: recording::Reading| {
        let read: Vec<View> = views.iter().map(|view| recording::read_by(view, read)).collect();
        mismatch(&read.iter().collect::<Vec<_>>(), tags, lens)
    };
    recording::readings().into_iter().map(|(input, read)| (input, with(read))).collect()
}

/// Meaning of a scale of all distances: the tags' size if they are seen in pixels; for positions, their unit or the
/// detector's size.
fn of_scale(views: &[&View], family: TagFamily, as_written: &Pairs) -> WrongInput {
    let ratio = as_written.ratio;
    let wrong = |input| wrong_by(as_written, input, None);
    let is_in_pixels = views.iter().any(|view| view.tags.iter().any(TagObservation::is_in_pixels));
    let hint = || map::margin_hint(family, ratio);
    match (unit_of(ratio), unit_of(1.0 / ratio)) {
        (Some(unit), _) => wrong(WrongInputKind::MapUnit(unit.to_owned())),
        (None, Some(unit)) if !is_in_pixels => wrong(WrongInputKind::RecordedUnit(unit.to_owned())),
        _ if is_in_pixels => WrongInput { size_hint: hint(), ..wrong(WrongInputKind::TagSize(ratio)) },
        _ => WrongInput { size_hint: hint(), ..wrong(WrongInputKind::RecordedScale(1.0 / ratio)) },
    }
}
