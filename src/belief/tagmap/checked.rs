//! A map that is only returned if the views do not contradict its input files.

use nalgebra::Vector3;

use crate::say::map_refusal::{MapRefusal, MapRefusalCause};
use crate::say::map_words::estimated_lens;
use crate::say::refusal::Refusal;
use crate::tagmap::blind::Blind;
use crate::tagmap::constants::checked::OTHER_SIGMAS;
use crate::tagmap::constants::lens_test::NOISY;
use crate::tagmap::known_places::{Doubt, wrong_input};
use crate::tagmap::lens_fit::lens_errors;
use crate::tagmap::lens_test::{OtherLenses, other_lenses};
use crate::tagmap::lost_anchor::lost_anchor;
use crate::tagmap::odd_tags::odd_tag;
use crate::tagmap::result::{MappedTag, TagMap};
use crate::tagmap::solve::{Solved, solve};
use crate::tagmap::types::{MapInput, MapSettings, TagMapError};
use armcal_core::codes::{Code, Warning};

/// Solves as [`solve`] does, and tests the input as a calibration does, but without an arm. The tests search for other
/// readings of the known places, another lens, and tags of another size or that moved.
///
/// # Errors
/// [`TagMapError`] as [`solve`] returns it, and [`TagMapError::Refused`] if the views contradict a file.
pub fn checked_map(input: &MapInput<'_>, settings: &MapSettings) -> Result<TagMap, TagMapError> {
    let map = solve(input, settings);
    if let Err(TagMapError::CornerOrder { .. }) = map {
        return map;
    }
    let doubt = map.as_ref().map_or(Doubt::NO_MAP, Doubt::of);
    let is_of_input = matches!(map, Ok(_) | Err(TagMapError::NothingLeft { .. }));
    if let Some(wrong) = is_of_input.then(|| wrong_input(input, settings, doubt)).flatten() {
        let cause = MapRefusalCause::OfCalibration(Refusal::WrongInput(wrong));
        return Err(refused(MapRefusal { cause, lens_file: settings.lens_file.clone() }));
    }
    let map = of_right_lens(input, settings, map?)?;
    match lost_anchor(input, settings, &map) {
        Some(cause) => Err(refused(MapRefusal { cause, lens_file: settings.lens_file.clone() })),
        None => Ok(map),
    }
}

fn refused(refusal: MapRefusal) -> TagMapError {
    TagMapError::Refused(Box::new(refusal))
}

/// Returns the map with the lenses that fit the views, if they change `map`; adds warnings of odd tags.
fn of_right_lens(input: &MapInput<'_>, settings: &MapSettings, mut map: TagMap) -> Result<TagMap, TagMapError> {
    let blind = Blind::of(input, settings);
    let other = other_lenses(&blind, input.cameras);
    let odd = blind.solved(input.cameras).and_then(|solved| odd_tag(&solved));
    let is_of_lens = |other: &OtherLenses| odd.is_none_or(|odd| other.gain_nats > odd.gain_nats);
    let Some(other) = other.filter(is_of_lens) else {
        map.warnings.extend(odd.map(|odd| odd.warning()));
        return Ok(map);
    };
    let Some(with_lens) = mapped_with(input, settings, &other) else { return Ok(map) };
    if !(map.noise_scale > NOISY || is_another(&map, &with_lens)) {
        return Ok(map);
    }
    match other.refusal(input.cameras, settings) {
        Some(refusal) => Err(refused(refusal)),
        None => Ok(with_lens),
    }
}

fn mapped_with(input: &MapInput<'_>, settings: &MapSettings, other: &OtherLenses) -> Option<TagMap> {
    let solved = Solved::of(&MapInput { cameras: &other.lenses, ..*input }, settings).ok()?;
    let mut map = solved.map().with_lens_errors(lens_errors(&solved.problem)?);
    for (idx, (stated, found)) in input.cameras.iter().zip(&other.lenses).enumerate() {
        let text = estimated_lens(stated, found, other.focal_std[idx], &settings.lens_file);
        map.warnings.push(Warning::new(Code::Lens, text));
    }
    Some(map)
}

/// Returns true if a tag's position differs by more than its standard deviations allow.
fn is_another(stated: &TagMap, found: &TagMap) -> bool {
    let is_elsewhere = |tag: &MappedTag| {
        let Some(other) = found.tag(tag.id).filter(|other| other.group == tag.group) else { return true };
        let off: Vector3<f64> = other.frame_from_tag.translation.vector - tag.frame_from_tag.translation.vector;
        let std = tag.position_std_m();
        (0..3).any(|axis| off[axis].abs() > OTHER_SIGMAS * std[axis])
    };
    stated.groups.len() != found.groups.len() || stated.tags.iter().filter(|tag| !tag.is_fixed).any(is_elsewhere)
}
