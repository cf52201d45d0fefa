//! Checks for input that makes no sense.

use std::collections::BTreeSet;

use crate::views::association::turns_right;
use armcal_core::robot::MAX_TAGS;

pub(super) use crate::tagmap::constants::check::SIZE_RANGE_M;
use crate::tagmap::types::{MapInput, MapSettings, TagMapError};

pub(super) fn check(input: &MapInput<'_>, settings: &MapSettings) -> Result<(), TagMapError> {
    let positive = [
        ("corner_std_px", settings.corner_std_px),
        ("max_square_rms_px", settings.max_square_rms_px),
        ("reject_beyond_sigmas", settings.reject_beyond_sigmas),
        ("attitude_std_rad", settings.attitude_std_rad),
    ];
    for (what, value) in positive {
        if !(value.is_finite() && value > 0.0) {
            return Err(TagMapError::Setting { what, value });
        }
    }
    let n_bodies = input.bodies.len();
    let mut ids = BTreeSet::new();
    for tag in input.tags {
        size(tag.id, tag.size_m)?;
        if tag.body >= n_bodies {
            return Err(TagMapError::NoSuchBody { id: tag.id, body: tag.body, n_bodies });
        }
        if !ids.insert(tag.id) {
            return Err(TagMapError::TagTwice { id: tag.id });
        }
    }
    for (idx, view) in input.views.iter().enumerate() {
        if view.camera >= input.cameras.len() {
            let n_cameras = input.cameras.len();
            return Err(TagMapError::NoSuchCamera { view: idx, camera: view.camera, n_cameras });
        }
        if let (Some((size_m, body)), Some(tag)) = (settings.default_tag, view.tags.first()) {
            size(tag.id, size_m)?;
            if body >= n_bodies {
                return Err(TagMapError::NoSuchBody { id: tag.id, body, n_bodies });
            }
        }
    }
    corner_order(input)?;
    anchor(input, settings)
}

/// Refuses input whose corners mostly run the wrong way round.
fn corner_order(input: &MapInput<'_>) -> Result<(), TagMapError> {
    let all = || input.views.iter().flat_map(|view| &view.tags);
    let (n, of) = (all().filter(|tag| turns_right(&tag.corners_px)).count(), all().count());
    if 2 * n > of { Err(TagMapError::CornerOrder { n, of }) } else { Ok(()) }
}

fn size(id: u32, size_m: f64) -> Result<(), TagMapError> {
    if SIZE_RANGE_M.contains(&size_m) { Ok(()) } else { Err(TagMapError::TagSize { id, size_m }) }
}

/// A map needs one of the tags whose places are known.
fn anchor(input: &MapInput<'_>, settings: &MapSettings) -> Result<(), TagMapError> {
    let seen: BTreeSet<u32> = input.views.iter().flat_map(|view| view.tags.iter().map(|tag| tag.id)).collect();
    if seen.is_empty() {
        return Err(TagMapError::NoDetections);
    }
    if seen.len() > MAX_TAGS {
        return Err(TagMapError::ManyTags { n: seen.len() });
    }
    let all = || seen.iter().copied().collect::<Vec<_>>();
    if let Some(base_tag) = settings.base_tag
        && !seen.contains(&base_tag)
    {
        return Err(TagMapError::NoBaseTag { base_tag, seen: all() });
    }
    let known: Vec<u32> = input.tags.iter().filter(|tag| tag.pose.is_some()).map(|tag| tag.id).collect();
    if settings.base_tag.is_none() && !known.is_empty() && !known.iter().any(|id| seen.contains(id)) {
        return Err(TagMapError::NoKnownTag { known, seen: all() });
    }
    Ok(())
}
