//! Contradictions in the views that need no doubt about a single detection: groups that must be one map, and ids on two
//! tags.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point2, Vector2};

use crate::say::map_words::{apart_in_common_images, id_on_two_tags};
use crate::tagmap::constants::contradictions::{MIN_COMMON_IMAGES, MIN_TWICE};
use crate::tagmap::problem::MapProblem;
use crate::tagmap::tag_pairs::is_rigid;
use crate::tagmap::types::{Body, MapDetection, MapInput, MapSettings};
use armcal_core::codes::{Code, Warning};

/// Returns the warnings of all contradictions.
pub(super) fn contradictions(input: &MapInput<'_>, settings: &MapSettings, problem: &MapProblem<'_>) -> Vec<Warning> {
    let twins = ids_on_two_tags(input, settings);
    let twins = twins.into_iter().map(|(id, n)| Warning::new(Code::MapTagDisagrees, id_on_two_tags(id, n)));
    let apart = apart(problem, input.bodies);
    let apart = apart.map(|(tags, n)| Warning::new(Code::MapTagDisagrees, apart_in_common_images(tags, n)));
    twins.chain(apart).collect()
}

/// Ids that are at two places of one image, with the number of such images.
fn ids_on_two_tags(input: &MapInput<'_>, settings: &MapSettings) -> Vec<(u32, usize)> {
    let is_mapped = |id: u32| settings.default_tag.is_some() || input.tags.iter().any(|tag| tag.id == id);
    let mut n_images: BTreeMap<u32, usize> = BTreeMap::new();
    for view in input.views {
        let others = |at: usize| view.tags[at + 1..].iter().filter(move |other| other.id == view.tags[at].id);
        let twice = (0..view.tags.len()).filter(|&at| others(at).any(|other| are_apart(&view.tags[at], other)));
        let ids: BTreeSet<u32> = twice.map(|at| view.tags[at].id).filter(|id| is_mapped(*id)).collect();
        ids.into_iter().for_each(|id| *n_images.entry(id).or_default() += 1);
    }
    n_images.into_iter().filter(|(_, n)| *n >= MIN_TWICE).collect()
}

/// Returns true if two squares do not overlap: one tag detected twice is at one place.
fn are_apart(a: &MapDetection, b: &MapDetection) -> bool {
    let corner = |of: &MapDetection, k: usize| Point2::from(Vector2::from(of.corners_px[k]));
    let half =
        |of: &MapDetection| 0.5 * (corner(of, 0) - corner(of, 2)).norm().max((corner(of, 1) - corner(of, 3)).norm());
    let middle = |of: &MapDetection| nalgebra::center(&corner(of, 0), &corner(of, 2));
    (middle(a) - middle(b)).norm() > half(a) + half(b)
}

/// Two groups that many images show together: their pair of tags with the most common images, and the number of images
/// that show both groups. `None` where no groups have many in common.
fn apart(problem: &MapProblem<'_>, bodies: &[Body]) -> Option<([u32; 2], usize)> {
    let mut of_groups: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut of_tags: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for of_view in problem.observations.chunk_by(|a, b| a.view == b.view) {
        let mut groups = BTreeSet::new();
        for (n, a) in of_view.iter().enumerate() {
            for b in of_view[n + 1..].iter().filter(|b| is_contrary(problem, bodies, (a.tag, b.tag))) {
                groups.insert(groups_of(problem, (a.tag, b.tag)));
                *of_tags.entry((a.tag, b.tag)).or_default() += 1;
            }
        }
        groups.into_iter().for_each(|groups| *of_groups.entry(groups).or_default() += 1);
    }
    let (groups, n) = of_groups.into_iter().max_by_key(|(_, n)| *n).filter(|(_, n)| *n >= MIN_COMMON_IMAGES)?;
    let of_both = of_tags.into_iter().filter(|(tags, _)| groups_of(problem, *tags) == groups);
    let (tags, _) = of_both.max_by_key(|(_, n)| *n)?;
    Some(([problem.tags[tags.0].id, problem.tags[tags.1].id], n))
}

fn groups_of(problem: &MapProblem<'_>, (a, b): (usize, usize)) -> (usize, usize) {
    let (a, b) = (problem.tags[a].group, problem.tags[b].group);
    (a.min(b), a.max(b))
}

/// Returns true if tags that keep their relative place are in different groups.
fn is_contrary(problem: &MapProblem<'_>, bodies: &[Body], (a, b): (usize, usize)) -> bool {
    let (a, b) = (&problem.tags[a], &problem.tags[b]);
    let are_mapped = a.group != usize::MAX && b.group != usize::MAX;
    are_mapped && a.group != b.group && is_rigid(bodies, a.body, b.body)
}
