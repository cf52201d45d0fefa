//! The reading of map or lens with which the tags of each view fit one another.

use super::pairs::{Pairs, mismatch};
use super::{BETTER, GOOD, SIZE_TOLERANCE, lens, map};
use crate::explain::constants::wrong_input_by_pairs::BAD;
use crate::say::wrong_input::{WrongInput, WrongInputKind};
use crate::views::view::View;
use armcal_core::robot::{Robot, SurveyedTag};

/// The first of these: a reading of map or lens that fits, exchanged ids, another map, a wrong scale.
pub(crate) fn by_pairs(views: &[&View], tags: &[SurveyedTag], robot: &Robot, as_written: &Pairs) -> Option<WrongInput> {
    let stated = &robot.camera.lens;
    let wrong = |input, otherwise| WrongInput {
        input,
        mismatch: as_written.mismatch,
        mismatch_otherwise: otherwise,
        size_hint: None,
    };
    let maps = map::readings(tags).into_iter().map(|(input, tags)| (input, mismatch(views, &tags, stated)));
    let lenses = lens::readings(stated).into_iter().map(|(input, lens)| (input, mismatch(views, tags, &lens)));
    let fitting = maps.chain(lenses).filter_map(|(input, pairs)| Some((input, pairs?.mismatch)));
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
    is_scaled.then(|| match map::unit_of(as_written.ratio) {
        Some(unit) => wrong(WrongInputKind::MapUnit(unit.to_owned()), None),
        None => WrongInput {
            size_hint: map::margin_hint(robot.tag_family, as_written.ratio),
            ..wrong(WrongInputKind::TagSize(as_written.ratio), None)
        },
    })
}
