//! Initial guess: groups of tags that images connect, each laid out from the relative poses that images vote for.
//!
//! Pairs of tags are joined in the order of their weight (a spanning tree, Kruskal 1956), provided the vote of their
//! images is clear. A pair whose images contradict each other is skipped. `grow` then lays the groups out again.

use armcal_core::codes::{Code, Warning};
use nalgebra::Isometry3;

use crate::tagmap::incremental_layout::grow;
use crate::tagmap::problem::{Observation, TagState};
use crate::tagmap::tag_pairs::{Pair, Pairs, consensus};
use crate::tagmap::types::{Body, MapSettings};
use armcal_core::optics::CameraModel;

/// Number of each tag's group, and its pose in the group's provisional frame.
pub(super) struct Layout {
    pub(super) label: Vec<usize>,
    pub(super) pose: Vec<Isometry3<f64>>,
    pub(super) warnings: Vec<Warning>,
}

pub(super) fn lay_out(
    cameras: &[CameraModel],
    observations: &[Observation],
    tags: &[TagState],
    bodies: &[Body],
    settings: &MapSettings,
) -> Layout {
    let mut forest = Forest::new(tags.len());
    let pairs = Pairs::of(observations, tags, bodies);
    let mut order: Vec<(&(usize, usize), &Pair)> = pairs.iter().collect();
    // Pairs with the largest weight come first; the number decides ties.
    order.sort_by(|a, b| b.1.weight.total_cmp(&a.1.weight).then(a.0.cmp(b.0)));
    let mut single = Vec::new();
    for &((a, b), pair) in &order {
        if forest.label[*a] == forest.label[*b] {
            continue;
        }
        if pair.n_views() < settings.min_link_views {
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
        // One wrong id would tie two whole groups together; a single tag does no harm.
        if forest.size(a) > 1 && forest.size(b) > 1 {
            let (first, second, n) = (tags[a].id, tags[b].id, pair.n_views());
            let text =
                format!("the groups of tags {first} and {second} were seen together in {n} view only: not joined");
            warnings.push(Warning::new(Code::MapGroupsApart, text));
        } else if let Some(relative) = consensus(observations, pair) {
            forest.join(a, b, &relative);
        }
    }
    warnings.sort();
    warnings.dedup();
    grow(cameras, observations, &forest.label, &pairs, &mut forest.pose);
    Layout { label: forest.label, pose: forest.pose, warnings }
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

    /// Moves the tree of `b` into the frame of the tree of `a`.
    fn join(&mut self, a: usize, b: usize, a_from_b: &Isometry3<f64>) {
        let (to, from) = (self.label[a], self.label[b]);
        let mut carry = self.pose[a] * a_from_b * self.pose[b].inverse();
        // Without this a tree's rounding error would double with each joined tree.
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
