//! Where to begin: groups of tags that images connect, each laid out from the relative poses that images vote for.
//!
//! Pairs of tags are joined in the order of how much is seen of both (a spanning tree, Kruskal 1956), so long as the vote
//! of their images carries; a pair whose images contradict each other is passed over. `grow` then lays the groups out anew.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

use crate::tagmap::incremental_layout::grow;
use crate::tagmap::problem::{Observation, TagState};
use crate::tagmap::types::{Body, MapSettings};
use crate::tagmap::vote;
use armcal_core::optics::CameraModel;

/// The least share of a pair's images that must agree.
const MIN_SHARE: f64 = 0.3;

/// For each tag: its group's number, and its pose in the group's provisional frame.
pub(super) struct Layout {
    pub(super) label: Vec<usize>,
    pub(super) pose: Vec<Isometry3<f64>>,
    pub(super) warnings: Vec<String>,
}

pub(super) fn lay_out(
    cameras: &[CameraModel],
    observations: &[Observation],
    tags: &[TagState],
    bodies: &[Body],
    settings: &MapSettings,
) -> Layout {
    let mut forest = Forest::new(tags.len());
    let pairs = pairs(observations, tags, bodies);
    let mut order: Vec<(&(usize, usize), &Pair)> = pairs.iter().collect();
    // Much seen of both first; ties by number.
    order.sort_by(|a, b| b.1.weight.total_cmp(&a.1.weight).then(a.0.cmp(b.0)));
    let mut single = Vec::new();
    for &((a, b), pair) in &order {
        if forest.label[*a] == forest.label[*b] {
            continue;
        }
        if pair.seen.len() < settings.min_link_views {
            single.push((*a, *b, pair));
        } else if let Some(relative) = consensus(observations, pair) {
            forest.join(*a, *b, &relative);
        }
    }
    let mut warnings = Vec::new();
    for (a, b, pair) in single {
        if forest.label[a] == forest.label[b] {
            continue;
        }
        // One wrong id would tie two whole groups together; a tag by itself harms nobody.
        if forest.size(a) > 1 && forest.size(b) > 1 {
            let (first, second, n) = (tags[a].id, tags[b].id, pair.seen.len());
            warnings.push(format!(
                "the groups of tags {first} and {second} were seen together in {n} view only: not joined"
            ));
        } else if let Some(relative) = consensus(observations, pair) {
            forest.join(a, b, &relative);
        }
    }
    warnings.sort();
    warnings.dedup();
    grow(cameras, observations, &forest.label, &pairs, &mut forest.pose);
    Layout { label: forest.label, pose: forest.pose, warnings }
}

/// Two tags in the same images.
pub(super) struct Pair {
    /// Indices of the observations.
    seen: Vec<(usize, usize)>,
    /// Sum over the images of the smaller square, px^2: about the information on their relative pose.
    pub(super) weight: f64,
}

/// All pairs, by the smaller index and the larger one.
pub(super) struct Pairs {
    pairs: BTreeMap<(usize, usize), Pair>,
    around: Vec<Vec<usize>>,
}

impl Pairs {
    pub(super) fn iter(&self) -> impl Iterator<Item = (&(usize, usize), &Pair)> {
        self.pairs.iter()
    }

    /// Those of one tag.
    pub(super) fn around(&self, tag: usize) -> impl Iterator<Item = ((usize, usize), &Pair)> {
        self.around[tag].iter().filter_map(move |other| {
            let key = (tag.min(*other), tag.max(*other));
            self.pairs.get(&key).map(|pair| (key, pair))
        })
    }
}

fn pairs(observations: &[Observation], tags: &[TagState], bodies: &[Body]) -> Pairs {
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
    Pairs { pairs, around }
}

/// Whether tags of the two bodies keep their relative pose.
pub(super) fn is_rigid(bodies: &[Body], a: usize, b: usize) -> bool {
    a == b || (bodies[a].is_static && bodies[b].is_static)
}

fn area_px2(seen: &Observation) -> f64 {
    let [a, b, c, d] = &seen.corners_px;
    0.5 * (c - a).perp(&(d - b)).abs()
}

pub(super) fn consensus(observations: &[Observation], pair: &Pair) -> Option<Isometry3<f64>> {
    let seen: Vec<_> = pair.seen.iter().map(|(a, b)| (&observations[*a], &observations[*b])).collect();
    let elected = vote::vote(&seen)?;
    let needed = (MIN_SHARE * elected.n_voters as f64).ceil().max(if elected.n_voters > 1 { 2.0 } else { 1.0 });
    (elected.n_agreeing as f64 >= needed).then_some(elected.first_from_second)
}

/// Trees of tags, each in the frame of one of them.
struct Forest {
    label: Vec<usize>,
    pose: Vec<Isometry3<f64>>,
}

impl Forest {
    fn new(n: usize) -> Self {
        Self { label: (0..n).collect(), pose: vec![Isometry3::identity(); n] }
    }

    fn size(&self, tag: usize) -> usize {
        self.label.iter().filter(|label| **label == self.label[tag]).count()
    }

    /// The tree of `b` moves into the frame of the tree of `a`.
    fn join(&mut self, a: usize, b: usize, a_from_b: &Isometry3<f64>) {
        let (to, from) = (self.label[a], self.label[b]);
        let mut carry = self.pose[a] * a_from_b * self.pose[b].inverse();
        // A tree's rounding would double with each that it joins.
        carry.rotation.renormalize();
        for (label, pose) in self.label.iter_mut().zip(&mut self.pose) {
            if *label == from {
                *label = to;
                *pose = carry * *pose;
                pose.rotation.renormalize();
            }
        }
    }
}
