//! Other readings of the tag map: another order of quaternions, other axes, other frames and units, exchanged ids.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::GOOD;
use super::pairs::{PosedTag, mismatch_at, posed_tags};
use super::recording::reordered;
use crate::explain::constants::wrong_input_map::PRINT_TOLERANCE;
use crate::say::wrong_input::WrongInputKind;
use crate::views::view::View;
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::robot::SurveyedTag;
use armcal_core::spatial::Pose;
use armcal_core::stats::quantile;

/// Possible meanings of the map.
pub(crate) fn readings(tags: &[SurveyedTag]) -> Vec<(WrongInputKind, Vec<SurveyedTag>)> {
    let changed = |change: &dyn Fn(&SurveyedTag) -> SurveyedTag| tags.iter().map(change).collect::<Vec<_>>();
    let mut found = vec![(WrongInputKind::MapQuaternions, changed(&in_other_order))];
    found.extend(
        other_axes().map(|(words, axes)| (WrongInputKind::MapAxes(words), changed(&|tag| with_axes(tag, axes)))),
    );
    found.extend(quarter_turns().map(|turn| {
        let input = WrongInputKind::TagFrames([turn.w, turn.i, turn.j, turn.k]);
        (input, changed(&|tag| turned_by(tag, &turn)))
    }));
    found
}

/// Hint that a size includes the print's margin, or lacks it: for tag36h11 the border square has 8 of the whole print's
/// 10 cells. `None` if `ratio`, of the true size over the stated one, suggests neither.
#[must_use]
pub(crate) fn margin_hint(family: TagFamily, ratio: f64) -> Option<String> {
    let (border, whole) = (family.n_cells(), family.n_cells() + 2 * family.n_margin_cells());
    let is = |of: usize, over: usize| (ratio / (of as f64 / over as f64) - 1.0).abs() < PRINT_TOLERANCE;
    let [print, beyond, square] = match family {
        TagFamily::Tag16h5 | TagFamily::Tag25h9 | TagFamily::Tag36h11 => {
            ["the whole print with its white margin", "the margin", "black square"]
        }
        _ => ["the whole print", "what lies beyond the border", "border square"],
    };
    if is(border, whole) {
        Some(format!("{border}/{whole}: the stated size is that of {print}; state the {square}'s"))
    } else if is(whole, border) {
        let was = format!("{beyond} was taken off a size that had none");
        Some(format!("{whole}/{border}: {was}; state the {square}'s side as measured"))
    } else {
        None
    }
}

/// Source axis and sign of each axis.
pub(crate) type SignedAxes = [(usize, f64); 3];

/// Left-handed readings of a position, with their text: one axis of the other sign, or two axes exchanged. Right-handed
/// ones turn the map as a whole, which affects the arm, too.
pub(crate) fn other_axes() -> impl Iterator<Item = (String, SignedAxes)> {
    let changed = |change: &dyn Fn(&mut SignedAxes)| {
        let mut axes = [0, 1, 2].map(|axis| (axis, 1.0));
        change(&mut axes);
        axes
    };
    let mirrored = [0, 1, 2].map(|axis| changed(&|axes| axes[axis].1 = -1.0));
    let exchanged = [(0, 1), (1, 2), (0, 2)].map(|(a, b)| changed(&|axes| axes.swap(a, b)));
    let word = |(axis, sign): (usize, f64)| format!("{}{}", if sign < 0.0 { "-" } else { "" }, ["x", "y", "z"][axis]);
    mirrored.into_iter().chain(exchanged).map(move |axes| (format!("({})", axes.map(word).join(", ")), axes))
}

/// Returns the tag with its position read by these axes; its rotation stays.
fn with_axes(tag: &SurveyedTag, axes: SignedAxes) -> SurveyedTag {
    let pose = tag.base_from_tag.isometry();
    let place = Vector3::from(axes.map(|(axis, sign)| sign * pose.translation.vector[axis]));
    let placed = Isometry3::from_parts(place.into(), pose.rotation);
    SurveyedTag { base_from_tag: Pose::from_isometry(placed), ..tag.clone() }
}

/// The 23 rotations that take a cube to itself and are not the identity, w at least 0. Conventions of tag frames differ
/// by one of them, in the first corner and in the direction of z.
pub(crate) fn quarter_turns() -> impl Iterator<Item = UnitQuaternion<f64>> {
    let about = |axis: Vector3<f64>, n: u8| UnitQuaternion::from_scaled_axis(axis * (f64::from(n) * FRAC_PI_2));
    let faces = (0..4).map(move |n| about(Vector3::x(), n)).chain([1, 3].map(|n| about(Vector3::y(), n)));
    let all = faces.flat_map(move |face| (0..4).map(move |n| face * about(Vector3::z(), n)));
    all.filter(|turn| turn.angle() > FRAC_PI_4)
        .map(|turn| if turn.w < 0.0 { UnitQuaternion::new_unchecked(-turn.into_inner()) } else { turn })
}

fn turned_by(tag: &SurveyedTag, turn: &UnitQuaternion<f64>) -> SurveyedTag {
    SurveyedTag { base_from_tag: Pose::from_isometry(tag.base_from_tag.isometry() * turn), ..tag.clone() }
}

/// Returns the tag with its quaternion read as x, y, z, w.
fn in_other_order(tag: &SurveyedTag) -> SurveyedTag {
    let pose = tag.base_from_tag.isometry();
    let turned = Isometry3::from_parts(pose.translation, reordered(&pose.rotation));
    SurveyedTag { base_from_tag: Pose::from_isometry(turned), ..tag.clone() }
}

/// Ids of tags in one another's places, by the other tags; and their mismatch as written and exchanged. The tag that
/// fits the others least is set aside, until the remaining ones fit one another.
pub(crate) fn exchanged_ids(views: &[&View], tags: &[SurveyedTag], lens: &CameraModel) -> Option<(Vec<u32>, f64, f64)> {
    let posed: Vec<Vec<PosedTag<'_>>> = views.iter().map(|view| posed_tags(view, tags, lens)).collect();
    let (mut sound, mut doubtful) = (tags.iter().filter(|tag| tag.is_known()).collect::<Vec<_>>(), Vec::new());
    loop {
        let mismatch = |tag: &SurveyedTag| mismatch_at(&posed, tag.id, tag, &sound).unwrap_or(0.0);
        let mismatches = sound.iter().map(|tag| mismatch(tag)).enumerate();
        let (worst, most) = mismatches.max_by(|a, b| a.1.total_cmp(&b.1))?;
        if most < GOOD {
            break;
        }
        doubtful.push(sound.remove(worst));
        if sound.len() < doubtful.len() {
            return None;
        }
    }
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for tag in &doubtful {
        let places = doubtful.iter().filter(|place| place.id != tag.id);
        let nearest = places.filter_map(|place| mismatch_at(&posed, tag.id, place, &sound)).reduce(f64::min)?;
        if nearest > GOOD {
            return None;
        }
        before.push(mismatch_at(&posed, tag.id, tag, &sound)?);
        after.push(nearest);
    }
    let mut ids: Vec<u32> = doubtful.iter().map(|tag| tag.id).collect();
    ids.sort_unstable();
    (ids.len() > 1).then_some((ids, quantile(&before, 0.5)?, quantile(&after, 0.5)?))
}
