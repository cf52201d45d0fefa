//! Errors of the nominal model: other explanations of the same views, compared by their evidence.
//!
//! Alternatives are tried if the score test prefers links, base or a mount to joint sensors, or if tags do not fit
//! their survey. The views are estimated again under each: link geometry with columns of its own, sag of the arm
//! (`sag_start`), a lens with columns, tags of another size. Further alternatives are two exchanged tags, and tags that
//! were moved together. The one of most evidence stays if it brings [`MIN_GAIN_NATS`] or more, and more than freeing a
//! moved tag (module `tags::freed`). The search then starts again, until nothing explains more.
//!
//! The score test predicts the gain of links: with the pull s and the information I of trial columns z under a prior of
//! variance a^2, Laplace's approximation is `ln Z(a) - ln Z(0) = s^T (I + a^-2)^-1 s / 2 - ln det(1 + a^2 I) / 2`. The
//! element and scale of the largest gain are the start for the scales of the links' errors.
//!
//! Alternatives reject different observations. In the comparison, a rejected one costs its rejection threshold (a
//! truncated square), so that explaining it counts.

pub(crate) use crate::explain::constants::drawing::MULTIPLES;
use crate::explain::constants::drawing::{GOLDEN_STEPS, LENS_SCALE, LOG_RATIO_RANGE, MIN_GAIN_NATS};
use nalgebra::{Cholesky, DMatrix, DVector, Matrix6};

use sag_start::SagStart;

use crate::explain::model_selection::log_evidence_of_all;
use crate::explain::score_test::Score;
use crate::explain::tags::group::moved_group;
use crate::explain::tags::identity::{TagFault, common_size_ratio};
use crate::model::blocks::Block;
use crate::model::constants::scales::{AS_STATED, MAX_CAMERAS};
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::evidence::SCALE_BOUNDS;
use crate::solve::input::BundleInput;
use crate::solve::schur::Group;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::Robot;

mod sag_start;

/// Departures from the nominal model that are assumed, or estimated together with the joint sensors.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Drawing {
    pub links: Option<LinkStart>,
    pub sag: Option<SagStart>,
    /// Numbers of the cameras whose lens is estimated.
    pub lenses: Vec<usize>,
    pub tags: Vec<TagFault>,
}

/// Start of the scales of the links' errors, and the number of joints with columns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LinkStart {
    n_links: usize,
    /// Ratio to robot.toml's standard deviations: shift, rotation.
    multiples: [[f64; 2]; MAX_JOINTS],
    mount_scale: [[f64; 2]; MAX_CAMERAS],
    /// Evidence gain of these scales over all links at their stated sigmas, nats.
    beyond_stated_nats: f64,
}

impl LinkStart {
    /// Returns true if the stated sigmas do not explain the links' departures.
    pub(crate) fn is_beyond_stated(&self) -> bool {
        self.beyond_stated_nats > MIN_GAIN_NATS
    }
}

impl Drawing {
    /// Adds the columns of these departures to `input`.
    pub(crate) fn apply(&self, input: &mut BundleInput<'_>) {
        if !self.lenses.is_empty() {
            input.model.blocks.extend(self.lenses.iter().copied().map(Block::Lens));
            input.scales.lens_scale = LENS_SCALE;
        }
        if let Some(start) = &self.sag {
            start.apply(input);
        }
        let Some(start) = &self.links else { return };
        input.model.n_links = input.model.n_links.max(start.n_links);
        let priors = &input.robot.geometry;
        for ([shift, turn], [by_shift, by_turn]) in input.scales.link_std.iter_mut().zip(&start.multiples) {
            *shift = by_shift * priors.link_position_std_m;
            *turn = by_turn * priors.link_rotation_std_rad;
        }
        input.scales.mount_scale = start.mount_scale;
    }

    /// Alternative of most evidence, if it explains the views much better than this one, and by more than `least_nats`.
    /// `input` has the columns and tags of this one; `found` is its estimate.
    pub(crate) fn better(&self, input: &BundleInput<'_>, found: &Estimate<'_>, least_nats: f64) -> Option<Self> {
        if input.joint_prior.is_some() {
            // A warm start has a prior of the links, and its own test of agreement.
            return None;
        }
        let before = log_evidence_of_all(found);
        let least_nats = least_nats.max(MIN_GAIN_NATS);
        let gain = |drawing: &Self| {
            let mut robot = input.robot.clone();
            self.apply_new_faults(drawing, &mut robot);
            let mut other = BundleInput { robot: &robot, ..input.clone() };
            drawing.apply(&mut other);
            let cost: f64 = drawing.tags[self.tags.len()..].iter().map(TagFault::cost_nats).sum();
            estimate(&other).map_or(f64::NEG_INFINITY, |found| log_evidence_of_all(&found) - before - cost)
        };
        let mut gains: Vec<(f64, Self)> =
            self.alternatives(input, found).into_iter().map(|drawing| (gain(&drawing), drawing)).collect();
        if let Some(ratio) = self.common_size_ratio(input) {
            let scaled = |ratio: f64| self.with_faults([TagFault::AllSizes { ratio }]);
            let ratio = best_ratio(ratio, |ratio| gain(&scaled(ratio)));
            gains.push((gain(&scaled(ratio)), scaled(ratio)));
        }
        let (gain, drawing) = gains.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        (gain > least_nats).then_some(drawing)
    }

    fn with_faults(&self, faults: impl IntoIterator<Item = TagFault>) -> Self {
        Self { tags: self.tags.iter().copied().chain(faults).collect(), ..self.clone() }
    }

    fn common_size_ratio(&self, input: &BundleInput<'_>) -> Option<f64> {
        let is_scaled = self.tags.iter().any(|fault| matches!(fault, TagFault::AllSizes { .. }));
        if is_scaled { None } else { common_size_ratio(input.views, input.robot) }
    }

    /// Alternatives with tags that were moved together, if none were found so far. Each tag moves freely (if several
    /// are doubtful), or all by one motion.
    fn moved_groups(&self, input: &BundleInput<'_>, found: &Estimate<'_>) -> Vec<Self> {
        if self.tags.iter().any(|fault| fault.moved_tag().is_some()) {
            return Vec::new();
        }
        let group = if found.doubtful_tags().len() < 2 { Vec::new() } else { moved_group(input) };
        let groups = [group, found.moved_alike(MIN_GAIN_NATS)].into_iter().filter(|group| !group.is_empty());
        groups.map(|group| self.with_faults(group)).collect()
    }

    /// Alternatives that may explain the views; none if nothing is suspicious.
    fn alternatives(&self, input: &BundleInput<'_>, found: &Estimate<'_>) -> Vec<Self> {
        let (links, gain) = found.link_start();
        let (sag, sag_gain) = found.sag_start();
        let faults = found.tag_faults(input.views);
        let is_suspicious =
            gain.max(sag_gain) > MIN_GAIN_NATS || !faults.is_empty() || !found.departed_tags().is_empty();
        let mut all = Vec::new();
        if self.links.is_none() && gain > MIN_GAIN_NATS {
            all.push(Self { links: Some(links), ..self.clone() });
        }
        if self.sag.is_none() && sag_gain > MIN_GAIN_NATS {
            all.push(Self { sag: Some(sag), ..self.clone() });
        }
        if is_suspicious && !found.has_positions() {
            let others = found.cameras().filter(|camera| !self.lenses.contains(camera));
            all.extend(others.map(|camera| Self { lenses: [&self.lenses[..], &[camera]].concat(), ..self.clone() }));
        }
        let new = faults.into_iter().filter(|fault| !self.tags.iter().any(|known| known.meets(fault)));
        all.extend(new.map(|fault| self.with_faults([fault])));
        all.extend(self.moved_groups(input, found));
        all
    }

    /// Applies to `robot` the tag faults that `next` has beyond this one.
    pub(crate) fn apply_new_faults(&self, next: &Self, robot: &mut Robot) {
        next.tags[self.tags.len()..].iter().for_each(|fault| fault.apply(robot));
    }
}

/// Ratio near `ratio` at which `gain` is largest, by golden sections of the logarithm.
fn best_ratio(ratio: f64, gain: impl Fn(f64) -> f64) -> f64 {
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let gain = |log: f64| gain(log.exp());
    let [mut low, mut high] = [-LOG_RATIO_RANGE, LOG_RATIO_RANGE].map(|by| ratio.ln() + by);
    let [mut a, mut b] = [high - golden * (high - low), low + golden * (high - low)];
    let [mut at_a, mut at_b] = [gain(a), gain(b)];
    for _ in 0..GOLDEN_STEPS {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - golden * (high - low);
            at_a = gain(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + golden * (high - low);
            at_b = gain(b);
        }
    }
    (0.5 * (low + high)).exp()
}

impl Estimate<'_> {
    /// Start of the links' scales, and its predicted evidence gain, nats.
    pub(crate) fn link_start(&self) -> (LinkStart, f64) {
        let robot = self.problem.robot;
        let score = self.score();
        let n_links = self.n_seen_joints();
        let priors = [robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad];
        let of_joints = (0..n_links).flat_map(|joint| [0, 1].map(|kind| (joint, kind)));
        let mut best = (0.0, Loosened::AllLinks, 1.0);
        let mut consider = |score: &Score, columns: &[(usize, f64)], element| {
            for multiple in MULTIPLES {
                let gain = gain_nats(&score.score, &score.information, columns, multiple);
                if gain > best.0 {
                    best = (gain, element, multiple);
                }
            }
        };
        let three = |first: usize, std: f64| (first..first + 3).map(move |column| (column, std));
        for (joint, kind) in of_joints {
            let columns: Vec<_> = three(6 * joint + 3 * kind, priors[kind]).collect();
            consider(&score, &columns, Loosened::Joint(joint, kind));
        }
        for number in (0..=robot.further_cameras.len()).filter(|&number| self.has(Block::Mount(number))) {
            let camera = robot.camera_at(number);
            let score = self.score_of(|group| by_mount_of(group, number));
            for (kind, std) in [camera.mount_std_m, camera.mount_std_rad].into_iter().enumerate() {
                let columns: Vec<_> = three(3 * kind, std).collect();
                consider(&score, &columns, Loosened::Mount(number, kind));
            }
        }
        let all = (0..n_links).flat_map(|joint| [0, 1].map(|kind| three(6 * joint + 3 * kind, priors[kind]))).flatten();
        let all: Vec<_> = all.collect();
        consider(&score, &all, Loosened::AllLinks);
        let by_stated = gain_nats(&score.score, &score.information, &all, 1.0);
        let (gain, element, multiple) = best;
        let mut start = LinkStart {
            n_links,
            multiples: [[1.0; 2]; MAX_JOINTS],
            mount_scale: [[AS_STATED; 2]; MAX_CAMERAS],
            beyond_stated_nats: gain - by_stated,
        };
        match element {
            Loosened::Joint(joint, kind) => start.multiples[joint][kind] = multiple,
            Loosened::Mount(number, kind) => start.mount_scale[number][kind] = multiple,
            Loosened::AllLinks => start.multiples = [[multiple; 2]; MAX_JOINTS],
        }
        (start, gain)
    }
}

/// Elements with wider priors than the nominal model's at the start.
#[derive(Clone, Copy)]
enum Loosened {
    /// Shift (0) or rotation (1) of a joint's pose.
    Joint(usize, usize),
    /// Shift (0) or rotation (1) of a camera's mount, by the camera's number.
    Mount(usize, usize),
    AllLinks,
}

/// Twists of camera `camera` by its mount; zero for another camera.
fn by_mount_of(group: &Group<'_>, camera: usize) -> Matrix6<f64> {
    if group.camera == camera { group.by_mount } else { Matrix6::zeros() }
}

/// Evidence gain of trial columns under priors of `multiple` times their (column, std), nats.
pub(crate) fn gain_nats(
    score: &DVector<f64>,
    information: &DMatrix<f64>,
    columns: &[(usize, f64)],
    multiple: f64,
) -> f64 {
    let n = columns.len();
    let unit = |k: usize| columns[k].1 * multiple;
    let scaled = DMatrix::from_fn(n, n, |i, k| {
        let prior = if i == k { 1.0 } else { 0.0 };
        prior + information[(columns[i].0, columns[k].0)] * unit(i) * unit(k)
    });
    let pull = DVector::from_fn(n, |k, _| score[columns[k].0] * unit(k));
    let Some(factor) = Cholesky::new(scaled) else { return 0.0 };
    let half_log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    0.5 * pull.dot(&factor.solve(&pull)) - half_log_det
}

/// The evidence may fit no larger multiple of robot.toml's sigmas.
const _: () = assert!(MULTIPLES[4] <= SCALE_BOUNDS[1]);
