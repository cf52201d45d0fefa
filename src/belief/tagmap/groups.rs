//! Groups of tags with a frame each, and the unknowns of the adjustment, from tags and observations.

use crate::tagmap::constants::groups::LEAST_STD;
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Vector6};

use crate::tagmap::localize::localize;
use crate::tagmap::problem::{Block, Extra, MapProblem, Observation, PosePrior, TagState};
use crate::tagmap::result::GroupFrame;
use crate::tagmap::types::{Body, MapSettings};

/// A tag, its known place in the group's frame, and the standard deviations of that place.
type Place = (usize, Isometry3<f64>, Option<[f64; 6]>);

/// A group of connected tags in its present state.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Indices of the tags, ascending.
    pub(super) tags: Vec<usize>,
    pub(super) frame: GroupFrame,
}

/// Builds groups, frames, priors, nodes and blocks again for the observations in use. `problem.tags` hold provisional
/// poses that are right relative to each other among those of one `label`.
pub(super) fn build(
    problem: &mut MapProblem<'_>,
    label: &[usize],
    bodies: &[Body],
    settings: &MapSettings,
) -> Vec<Group> {
    let components = components(&problem.observations, label);
    let mut groups: Vec<Group> = components
        .into_iter()
        .map(|tags| {
            let frame_body = frame_body(&problem.tags, &tags, bodies, settings);
            let frame = match frame_body {
                Some(body) => GroupFrame::Body(bodies[body].name.clone()),
                None => GroupFrame::Tag(problem.tags[tags[0]].id),
            };
            Group { tags, frame }
        })
        .collect();
    // Anchored groups come first; then the first tag decides.
    groups.sort_by_key(|group| (matches!(group.frame, GroupFrame::Tag(_)), group.tags[0]));
    problem.extras.clear();
    problem.links.clear();
    problem.n_nodes = 0;
    for tag in &mut problem.tags {
        (tag.group, tag.node, tag.prior) = (usize::MAX, None, None);
    }
    for (idx, group) in groups.iter().enumerate() {
        anchor(problem, idx, group, bodies, settings);
    }
    make_blocks(problem);
    groups
}

/// Tags that the observations in use connect, by images and labels; each ascending.
fn components(observations: &[Observation], label: &[usize]) -> Vec<Vec<usize>> {
    let mut root: Vec<usize> = (0..label.len()).collect();
    let find = |root: &mut [usize], mut at: usize| {
        while root[at] != at {
            // Halves the way for the next search.
            root[at] = root[root[at]];
            at = root[at];
        }
        at
    };
    let mut by_image: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut used = BTreeSet::new();
    for seen in observations.iter().filter(|seen| seen.is_used) {
        used.insert(seen.tag);
        let first = *by_image.entry((seen.view, label[seen.tag])).or_insert(seen.tag);
        let (a, b) = (find(&mut root, first), find(&mut root, seen.tag));
        root[a.max(b)] = a.min(b);
    }
    let mut components: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for tag in used {
        components.entry(find(&mut root, tag)).or_default().push(tag);
    }
    components.into_values().collect()
}

/// The body whose frame is the group's: that of the base tag. Without it, the first body with a place counts, among
/// those with a tag of known place.
fn frame_body(tags: &[TagState], group: &[usize], bodies: &[Body], settings: &MapSettings) -> Option<usize> {
    let given = || group.iter().map(|tag| &tags[*tag]).filter(|tag| tag.given.is_some());
    let base = given().find(|tag| Some(tag.id) == settings.base_tag).map(|tag| tag.body);
    base.or_else(|| given().map(|tag| tag.body).min_by_key(|body| (bodies[*body].pose.is_none(), *body)))
}

/// Pose of a body in the frame of another; `None` if it is not known.
fn placed(bodies: &[Body], frame: usize, body: usize) -> Option<Isometry3<f64>> {
    if frame == body {
        return Some(Isometry3::identity());
    }
    Some(bodies[frame].pose?.inv_mul(&bodies[body].pose?))
}

/// Moves a group into its frame, holds exact places, and gives the other tags nodes and priors.
fn anchor(problem: &mut MapProblem<'_>, idx: usize, group: &Group, bodies: &[Body], settings: &MapSettings) {
    let frame = frame_body(&problem.tags, &group.tags, bodies, settings);
    let place_of = |tag: &TagState| {
        let (pose, std) = tag.given?;
        Some((placed(bodies, frame?, tag.body)? * pose, std))
    };
    let places: Vec<Place> = group
        .tags
        .iter()
        .filter_map(|tag| place_of(&problem.tags[*tag]).map(|(pose, std)| (*tag, pose, std)))
        .collect();
    let doubt = |std: &Option<[f64; 6]>| std.map_or(0.0, |std| std.into_iter().sum::<f64>());
    let surest = places.iter().min_by(|a, b| doubt(&a.2).total_cmp(&doubt(&b.2)).then(a.0.cmp(&b.0)));
    let (reference, target) = surest.map_or((group.tags[0], Isometry3::identity()), |(tag, pose, _)| (*tag, *pose));
    let carry = target * problem.tags[reference].pose.inverse();
    let is_only_one = places.len() <= 1;
    for &at in &group.tags {
        let tag = &mut problem.tags[at];
        tag.group = idx;
        tag.pose = carry * tag.pose;
        tag.pose.rotation.renormalize();
        let place = places.iter().find(|place| place.0 == at);
        match place {
            // A single tag of known place is the gauge; the uncertainty of its place is common to all tags.
            Some((_, pose, std)) if std.is_none() || is_only_one => tag.pose = *pose,
            None if places.is_empty() && at == reference => tag.pose = target,
            _ => {
                tag.node = Some(problem.n_nodes);
                problem.n_nodes += 1;
                tag.prior = place.and_then(|(_, pose, std)| {
                    Some(PosePrior { pose: *pose, information: information(&(*std)?), owner: None })
                });
            }
        }
    }
    if frame.is_some() {
        place_bodies(problem, group, &places);
    }
}

fn information(std: &[f64; 6]) -> Vector6<f64> {
    Vector6::from(*std).map(|std| 1.0 / std.max(LEAST_STD).powi(2))
}

/// Adds the places of bodies as unknowns: bodies without a known place, but with known places of two or more tags on
/// them.
fn place_bodies(problem: &mut MapProblem<'_>, group: &Group, places: &[Place]) {
    let mut by_body: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for &at in &group.tags {
        let is_open = problem.tags[at].given.is_some() && places.iter().all(|place| place.0 != at);
        if is_open {
            by_body.entry(problem.tags[at].body).or_default().push(at);
        }
    }
    for tags in by_body.into_values().filter(|tags| tags.len() > 1) {
        let owner = problem.extras.len();
        for (k, at) in tags.into_iter().enumerate() {
            let Some((pose, std)) = problem.tags[at].given else { continue };
            if k == 0 {
                let start = problem.tags[at].pose * pose.inverse();
                problem.extras.push(Extra { node: problem.n_nodes, pose: start });
                problem.n_nodes += 1;
            }
            let information = information(&std.unwrap_or([LEAST_STD; 6]));
            problem.tags[at].prior = Some(PosePrior { pose, information, owner: Some(owner) });
        }
    }
}

/// Makes one block for each image and group; the present tags place the cameras.
fn make_blocks(problem: &mut MapProblem<'_>) {
    let tags = &problem.tags;
    problem.observations.sort_by_key(|seen| (seen.view, tags[seen.tag].group, seen.tag));
    let mut blocks = Vec::new();
    let mut start = 0;
    while let Some(first) = problem.observations.get(start) {
        let (view, group) = (first.view, tags[first.tag].group);
        let same = |seen: &&Observation| seen.view == view && tags[seen.tag].group == group;
        let range = start..start + problem.observations[start..].iter().take_while(same).count();
        start = range.end;
        // A tag without any used detection has no group.
        if group != usize::MAX {
            let pose = locate(problem, &range).unwrap_or_else(Isometry3::identity);
            blocks.push(Block { view, group, range, node: None, pose });
        }
    }
    problem.blocks = blocks;
}

/// Pose of the camera from the used observations of a block, or from all of them if none is used.
fn locate(problem: &MapProblem<'_>, range: &std::ops::Range<usize>) -> Option<Isometry3<f64>> {
    let all = &problem.observations[range.clone()];
    let any_used = all.iter().any(|seen| seen.is_used);
    let seen: Vec<_> =
        all.iter().filter(|seen| seen.is_used || !any_used).map(|seen| (seen, problem.tags[seen.tag].pose)).collect();
    localize(&problem.cameras, &seen).map(|(pose, _)| pose)
}
