//! Initial poses of the tags of a group, one tag after the other.
//!
//! The tree of relative poses connects neighbours through long chains, along which errors add up. So each group is laid
//! out again from its most seen tag. The next tag is always the one that shares most with those already placed. All
//! placed tags in its images locate these images, and all images together place the tag. Neighbours then agree within a
//! few pixels in any length of chain, which the adjustment needs.

use crate::tagmap::constants::incremental_layout::MAX_IMAGES;
use nalgebra::Isometry3;

use crate::tagmap::localize::{localize, place_tag, refine_tag, tag_cost};
use crate::tagmap::problem::Observation;
use crate::tagmap::tag_pairs::{Pairs, consensus};
use crate::tagmap::vote::is_finite;
use armcal_core::optics::CameraModel;

/// Inputs of the layout.
struct Growing<'a> {
    cameras: &'a [CameraModel],
    observations: &'a [Observation],
    label: &'a [usize],
    pairs: &'a Pairs,
    /// Indices of each tag's observations.
    images: Vec<Vec<usize>>,
}

/// Tags that are already placed.
struct Placed<'a> {
    pose: &'a mut [Isometry3<f64>],
    is_placed: Vec<bool>,
    /// Weight that each tag shares with the placed ones of its group.
    shared: Vec<f64>,
}

/// Replaces the poses of the tags of each `label`; poses of the tree stay where no better one is found.
pub(super) fn grow(
    cameras: &[CameraModel],
    observations: &[Observation],
    label: &[usize],
    pairs: &Pairs,
    pose: &mut [Isometry3<f64>],
) {
    let n = label.len();
    let growing = Growing { cameras, observations, label, pairs, images: images_of(observations, n) };
    let mut placed = Placed { pose, is_placed: vec![false; n], shared: vec![0.0; n] };
    let mut in_all = vec![0.0; n];
    for ((a, b), pair) in pairs.iter().filter(|((a, b), _)| label[*a] == label[*b]) {
        in_all[*a] += pair.weight;
        in_all[*b] += pair.weight;
    }
    for _ in 0..n {
        // Any tag that shares something with the placed ones; otherwise the most seen tag of a new group.
        let best = |value: &[f64], least: f64| {
            let open = (0..n).filter(|tag| !placed.is_placed[*tag] && value[*tag] > least);
            open.max_by(|a, b| value[*a].total_cmp(&value[*b]).then(b.cmp(a)))
        };
        let by_others = best(&placed.shared, 0.0);
        let Some(next) = by_others.or_else(|| best(&in_all, -1.0)) else { break };
        if by_others.is_some()
            && let Some(found) = growing.place(&placed, next)
        {
            placed.pose[next] = found;
        }
        placed.is_placed[next] = true;
        for ((a, b), pair) in pairs.around(next) {
            let other = if a == next { b } else { a };
            if label[other] == label[next] {
                placed.shared[other] += pair.weight;
            }
        }
    }
}

/// Indices of each tag's observations.
fn images_of(observations: &[Observation], n: usize) -> Vec<Vec<usize>> {
    let mut of_tag = vec![Vec::new(); n];
    for (at, seen) in observations.iter().enumerate() {
        of_tag[seen.tag].push(at);
    }
    of_tag
}

impl Growing<'_> {
    /// Pose of `tag` that fits its images best, given the placed tags in them.
    fn place(&self, placed: &Placed<'_>, tag: usize) -> Option<Isometry3<f64>> {
        let by_vote = self.by_vote(placed, tag);
        let (chosen, most) = self.choose(placed, tag)?;
        let located = self.locate(placed, &chosen, None);
        let mut candidates: Vec<Isometry3<f64>> = by_vote.into_iter().collect();
        // A camera located by a single tag may be mirrored; then only the vote decides.
        if most > 1 || candidates.is_empty() {
            candidates.extend(place_tag(self.cameras, &located).map(|(found, _)| found));
        }
        let refined = candidates.iter().map(|candidate| {
            let located = if most > 1 { located.clone() } else { self.locate(placed, &chosen, Some(candidate)) };
            let found = refine_tag(self.cameras, &located, candidate);
            (tag_cost(self.cameras, &located, &found), found)
        });
        let finite = refined.filter(|(misfit, found)| misfit.is_finite() && is_finite(found));
        finite.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, found)| found)
    }

    fn is_known(&self, placed: &Placed<'_>, tag: usize, other: usize) -> bool {
        placed.is_placed[other] && self.label[other] == self.label[tag]
    }

    /// Pose by the placed tag that shares most, from both solutions of each square.
    fn by_vote(&self, placed: &Placed<'_>, tag: usize) -> Option<Isometry3<f64>> {
        let around = self.pairs.around(tag);
        let around = around.filter(|((a, b), _)| self.is_known(placed, tag, if *a == tag { *b } else { *a }));
        let ((a, b), pair) = around.max_by(|x, y| x.1.weight.total_cmp(&y.1.weight).then(y.0.cmp(&x.0)))?;
        let a_from_b = consensus(self.observations, pair)?;
        Some(if b == tag { placed.pose[a] * a_from_b } else { placed.pose[b] * a_from_b.inverse() })
    }

    /// The placed tags in the image of an observation.
    fn beside(&self, placed: &Placed<'_>, at: usize) -> impl Iterator<Item = &Observation> {
        let (view, tag) = (self.observations[at].view, self.observations[at].tag);
        let first = self.observations.partition_point(|seen| seen.view < view);
        let of_view = self.observations[first..].iter().take_while(move |seen| seen.view == view);
        of_view.filter(move |seen| self.is_known(placed, tag, seen.tag))
    }

    /// Images with placed tags, spread over all, preferably with two or more; and the largest number of placed tags in
    /// one.
    fn choose(&self, placed: &Placed<'_>, tag: usize) -> Option<(Vec<usize>, usize)> {
        let count = |at: &usize| (self.beside(placed, *at).count(), *at);
        let mut chosen: Vec<(usize, usize)> = self.images[tag].iter().map(count).collect();
        chosen.retain(|(n_known, _)| *n_known > 0);
        let most = chosen.iter().map(|(n_known, _)| *n_known).max()?;
        chosen.retain(|(n_known, _)| *n_known > 1 || most == 1);
        let step = chosen.len().div_ceil(MAX_IMAGES).max(1);
        Some((chosen.into_iter().step_by(step).map(|(_, at)| at).collect(), most))
    }

    /// Observations of images with their cameras' poses, from the placed tags and from the proposed pose of the tag
    /// itself.
    fn locate(
        &self,
        placed: &Placed<'_>,
        images: &[usize],
        with: Option<&Isometry3<f64>>,
    ) -> Vec<(&Observation, Isometry3<f64>)> {
        let one = |at: &usize| {
            let own = &self.observations[*at];
            let mut seen: Vec<_> = self.beside(placed, *at).map(|seen| (seen, placed.pose[seen.tag])).collect();
            seen.extend(with.map(|pose| (own, *pose)));
            localize(self.cameras, &seen).map(|(camera, _)| (own, camera))
        };
        images.iter().filter_map(one).collect()
    }
}
