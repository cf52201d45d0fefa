//! Cause of a map without the tags whose places are known: their sizes, or those of all tags, are not as stated.
//!
//! A map of the same views from the sizes only (`blind`) shows it. If two known tags are in it, their distance over the
//! known one is the factor of all sizes. A single known tag that fits nowhere is seen at `t + s R p` from each camera
//! (R, t) of that map. Here p is its place by the stated size, and its own factor s is where these positions meet.

use nalgebra::Vector3;

use crate::say::map_refusal::{MapRefusalCause, WrongSizes};
use crate::tagmap::blind::Blind;
use crate::tagmap::constants::lost_anchor::{LEAST_FACTOR, MIN_SIGHTINGS};
use crate::tagmap::result::{GroupFrame, TagMap};
use crate::tagmap::solve::Solved;
use crate::tagmap::types::{MapInput, MapSettings};
use armcal_core::stats::quantile;

/// Cause why no tag of known place is in the map; `None` if one is, or no place is known.
pub(super) fn lost_anchor(input: &MapInput<'_>, settings: &MapSettings, map: &TagMap) -> Option<MapRefusalCause> {
    let known = input.tags.iter().filter(|tag| tag.pose.is_some() || Some(tag.id) == settings.base_tag);
    let mut tags: Vec<u32> = known.map(|tag| tag.id).chain(settings.base_tag).collect();
    tags.sort_unstable();
    tags.dedup();
    let mut anchored = map.groups.iter().filter(|group| matches!(group.frame, GroupFrame::Body(_))).peekable();
    let is_lost = anchored.peek().is_none();
    // The tag is alone in its group, although images show it with others.
    let is_alone = map.is_contradicted && anchored.flat_map(|group| &group.tags).all(|id| tags.contains(id));
    let has_others = tags.len() < map.tags.len();
    if tags.is_empty() || !(is_lost || is_alone && has_others) {
        return None;
    }
    let blind = Blind::of(input, settings);
    let sizes = blind.solved(input.cameras).and_then(|solved| wrong_sizes(input, &solved, &tags));
    (is_lost || sizes.is_some()).then_some(MapRefusalCause::AnchorLost { tags, sizes })
}

/// Sizes that a map without known places contradicts.
pub(super) fn wrong_sizes(input: &MapInput<'_>, solved: &Solved<'_>, known: &[u32]) -> Option<WrongSizes> {
    let is_wrong = |factor: &f64| factor.is_finite() && *factor > 0.0 && factor.ln().abs() > LEAST_FACTOR.ln();
    let of_all = common_factor(input, solved).filter(is_wrong).map(|factor| WrongSizes { tag: None, factor });
    let of_one = || {
        let mut each = known.iter().filter_map(|id| Some((*id, own_factor(solved, *id)?)));
        each.find(|(_, factor)| is_wrong(factor)).map(|(id, factor)| WrongSizes { tag: Some(id), factor })
    };
    of_all.or_else(of_one)
}

/// True sizes over the stated ones: the median over the distances of known tags of one group.
fn common_factor(input: &MapInput<'_>, solved: &Solved<'_>) -> Option<f64> {
    let place = |id: u32| {
        let tag = solved.problem.tags.iter().find(|tag| tag.id == id && tag.group != usize::MAX)?;
        Some((tag.group, tag.pose.translation.vector))
    };
    let known: Vec<_> =
        input.tags.iter().filter_map(|tag| Some((tag.body, tag.pose?.translation.vector, place(tag.id)?))).collect();
    let mut factors = Vec::new();
    for (n, (body, at, found)) in known.iter().enumerate() {
        let of_body = known[n + 1..].iter().filter(|other| other.0 == *body && other.2.0 == found.0);
        factors.extend(of_body.map(|other| (at - other.1).norm() / (found.1 - other.2.1).norm()));
    }
    quantile(&factors, 0.5)
}

/// True size of a tag over the stated one, from its directions in cameras that other tags place.
fn own_factor(solved: &Solved<'_>, id: u32) -> Option<f64> {
    let problem = &solved.problem;
    let tag = problem.tags.iter().position(|tag| tag.id == id)?;
    let (main, _) = solved.groups.iter().enumerate().max_by_key(|(_, group)| group.tags.len())?;
    let mut seen: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
    for block in problem.blocks.iter().filter(|block| block.group == main) {
        let of_view = &problem.observations[problem.observations.partition_point(|seen| seen.view < block.view)..];
        let of_view = of_view.iter().take_while(|seen| seen.view == block.view);
        let is_placed = problem.observations[block.range.clone()].iter().any(|seen| seen.is_used && seen.tag != tag);
        let found = of_view.filter(|seen| seen.tag == tag && is_placed).map(|seen| {
            let at = seen.best.camera_from_tag.isometry().translation.vector;
            (block.pose.rotation * at, block.pose.translation.vector)
        });
        seen.extend(found);
    }
    if seen.len() < MIN_SIGHTINGS {
        return None;
    }
    let n = seen.len() as f64;
    let ray = seen.iter().map(|seen| seen.0).sum::<Vector3<f64>>() / n;
    let from = seen.iter().map(|seen| seen.1).sum::<Vector3<f64>>() / n;
    let along: f64 = seen.iter().map(|seen| (seen.0 - ray).dot(&(seen.1 - from))).sum();
    let spread: f64 = seen.iter().map(|seen| (seen.0 - ray).norm_squared()).sum();
    Some(-along / spread)
}
