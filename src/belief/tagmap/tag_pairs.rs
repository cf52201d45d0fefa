//! Pairs of tags in the same images and the consensus on their relative poses.

use crate::tagmap::constants::tag_pairs::MIN_SHARE;
use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::tagmap::problem::{Observation, TagState};
use crate::tagmap::types::Body;
use crate::tagmap::vote;

/// Two tags in the same images.
pub(super) struct Pair {
    /// Indices of the observations.
    seen: Vec<(usize, usize)>,
    /// Sum over the images of the smaller square, px^2: a measure of the information on the relative pose of both tags.
    pub(super) weight: f64,
}

impl Pair {
    /// Number of images that show both.
    pub(super) fn n_views(&self) -> usize {
        self.seen.len()
    }
}

/// All pairs, keyed by the smaller index and the larger one.
pub(super) struct Pairs {
    pairs: BTreeMap<(usize, usize), Pair>,
    around: Vec<Vec<usize>>,
}

impl Pairs {
    /// Collects the pairs of tags that keep their relative pose.
    pub(super) fn of(observations: &[Observation], tags: &[TagState], bodies: &[Body]) -> Self {
        let mut pairs: BTreeMap<(usize, usize), Pair> = BTreeMap::new();
        for of_view in observations.chunk_by(|a, b| a.view == b.view) {
            let first = observations.partition_point(|seen| seen.view < of_view[0].view);
            for (i, a) in of_view.iter().enumerate() {
                for (k, b) in of_view.iter().enumerate().skip(i + 1) {
                    if !is_rigid(bodies, tags[a.tag].body, tags[b.tag].body) {
                        continue;
                    }
                    let pair = pairs.entry((a.tag, b.tag)).or_insert_with(|| Pair { seen: Vec::new(), weight: 0.0 });
                    pair.seen.push((first + i, first + k));
                    pair.weight += area_px2(a).min(area_px2(b));
                }
            }
        }
        let mut around = vec![Vec::new(); tags.len()];
        for (a, b) in pairs.keys() {
            around[*a].push(*b);
            around[*b].push(*a);
        }
        Self { pairs, around }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&(usize, usize), &Pair)> {
        self.pairs.iter()
    }

    /// Pairs that contain one tag.
    pub(super) fn around(&self, tag: usize) -> impl Iterator<Item = ((usize, usize), &Pair)> {
        self.around[tag].iter().filter_map(move |other| {
            let key = (tag.min(*other), tag.max(*other));
            self.pairs.get(&key).map(|pair| (key, pair))
        })
    }
}

/// Returns true if tags of the two bodies keep their relative pose.
pub(super) fn is_rigid(bodies: &[Body], a: usize, b: usize) -> bool {
    a == b || (bodies[a].is_static && bodies[b].is_static)
}

fn area_px2(seen: &Observation) -> f64 {
    let [a, b, c, d] = &seen.corners_px;
    0.5 * (c - a).perp(&(d - b)).abs()
}

pub(super) fn consensus(observations: &[Observation], pair: &Pair) -> Option<Isometry3<f64>> {
    let seen: Vec<_> = pair.seen.iter().map(|(a, b)| (&observations[*a], &observations[*b])).collect();
    let winner = vote::vote(&seen)?;
    let needed = (MIN_SHARE * winner.n_voters as f64).ceil().max(if winner.n_voters > 1 { 2.0 } else { 1.0 });
    (winner.n_agreeing as f64 >= needed).then_some(winner.first_from_second)
}
