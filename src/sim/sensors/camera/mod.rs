//! The wrist camera with its tag detector: which tags it sees, and where their corners fall.
//!
//! A tag is seen if its front faces the camera at less than a largest incidence and range, all corners lie in the image, its
//! shortest side is long enough to decode, and neither its centre nor a corner is hidden (`view`). Lens and port as built
//! make pixels of points (`eye`, `port`). With the shutter open for a while a corner is its mean over it (Simpson's rule
//! along the joints' motion). Noise per coordinate: `s (0.8 + 0.2 range / 1 m) / sqrt(cos(incidence)) (1 + k blur)`.

mod eye;
mod port;
mod view;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::kinematics::{Attachment, Chain};
use crate::robot::Robot;
use crate::sim::as_built::AsBuilt;
use crate::sim::places::BodyPoses;
use crate::sim::solids::Solids;
use crate::sim::spec::{CameraWorldSpec, ClockSpec, WorldSpec};
use crate::stats::stream_rng;
use crate::streams::{JointAngles, TagDetection, TagDetections};
use crate::time::{SIMULATION_EPOCH, Stamp};
use eye::Eye;
use view::{Sight, TagInBase};

#[derive(Clone, Debug)]
pub(in crate::sim) struct WristCamera {
    spec: CameraWorldSpec,
    clock: ClockSpec,
    eye: Eye,
    /// As built.
    mount: Attachment,
    /// As built, by id.
    tags: Vec<TagInBase>,
    /// Shapes that cannot hide anything, for they hold the camera.
    housing: Vec<usize>,
    /// By id: those that fell off.
    lost: BTreeSet<u32>,
    /// By id: what the detector takes them for.
    misread: BTreeMap<u32, u32>,
    /// Nothing is seen before this.
    blind_until: Option<Stamp>,
    corner_noise: ChaCha8Rng,
    misses: ChaCha8Rng,
    jitter: ChaCha8Rng,
    wrong_ids: ChaCha8Rng,
}

/// What the camera is made from.
#[derive(Clone, Copy)]
pub(in crate::sim) struct CameraInput<'a> {
    pub robot: &'a Robot,
    pub built: &'a AsBuilt,
    pub solids: &'a Solids,
    pub spec: &'a WorldSpec,
    pub seed: u64,
}

/// How the joints move while the shutter is open.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct ArmMotion<'a> {
    pub chain: &'a Chain,
    pub angles: JointAngles,
    /// rad/s.
    pub rates: JointAngles,
}

impl WristCamera {
    pub(in crate::sim) fn new(input: &CameraInput) -> Self {
        let CameraInput { robot, built, solids, spec, seed } = *input;
        let mut tags: Vec<TagInBase> = built
            .tags
            .iter()
            .map(|tag| TagInBase { id: tag.id, size_m: tag.size_m, base_from_tag: *tag.base_from_tag().isometry() })
            .collect();
        tags.sort_by_key(|tag| tag.id);
        Self {
            spec: spec.camera,
            clock: spec.clock,
            eye: Eye::new(&robot.camera.lens, built, &spec.camera),
            mount: built.camera_attachment(robot),
            tags,
            housing: solids.housing(robot),
            lost: BTreeSet::new(),
            misread: BTreeMap::new(),
            blind_until: None,
            corner_noise: stream_rng(seed, "camera/corners"),
            misses: stream_rng(seed, "camera/misses"),
            jitter: stream_rng(seed, "camera/clock"),
            wrong_ids: stream_rng(seed, "camera/wrong_ids"),
        }
    }

    /// Where the camera truly is.
    pub(in crate::sim) fn base_from_camera(&self, links: &BodyPoses) -> Isometry3<f64> {
        links.frame(&self.mount)
    }

    /// A tag falls off.
    pub(in crate::sim) fn lose(&mut self, id: u32) {
        self.lost.insert(id);
    }

    /// A tag is knocked out of its place; `motion` in its own axes.
    pub(in crate::sim) fn move_tag(&mut self, id: u32, motion: Isometry3<f64>) {
        for tag in self.tags.iter_mut().filter(|tag| tag.id == id) {
            tag.base_from_tag *= motion;
        }
    }

    /// The detector takes a tag for another one from now on.
    pub(in crate::sim) fn misread(&mut self, id: u32, as_id: u32) {
        self.misread.insert(id, as_id);
    }

    /// Silt hides everything until then.
    pub(in crate::sim) fn blind(&mut self, until: Stamp) {
        self.blind_until = Some(until);
    }

    /// Takes an image whose shutter closes at `closed`; `solids` must be placed for `links`. Gives the time of its arrival,
    /// late with jitter, and the image, whose stamp is that by the camera's own clock.
    pub(in crate::sim) fn expose(
        &mut self,
        links: &BodyPoses,
        solids: &Solids,
        motion: &ArmMotion,
        closed: Stamp,
    ) -> (Stamp, TagDetections) {
        let base_from_camera = self.base_from_camera(links);
        let before = self.before(&base_from_camera, motion);
        let mut tags = Vec::new();
        let is_blind = self.blind_until.is_some_and(|until| closed < until);
        for i in 0..self.tags.len() {
            let tag = self.tags[i];
            // Every tag takes its share of the random streams, seen or not: one more tag in view moves no other's noise.
            let is_missed = self.misses.random_range(0.0..1.0) < self.spec.miss_probability;
            let noise: [Vector2<f64>; 4] = std::array::from_fn(|_| self.corner_normal());
            let id = self.read_id(tag.id);
            if is_missed || is_blind || self.lost.contains(&tag.id) {
                continue;
            }
            let sight = Sight { spec: &self.spec, eye: &self.eye, solids, housing: &self.housing };
            let seen = sight.view(&tag, &base_from_camera);
            let Some(view) = seen.and_then(|view| sight.smeared(view, &tag, before.as_ref())) else { continue };
            let std_px = view.corner_std_px(&self.spec);
            let noisy: [Vector2<f64>; 4] = std::array::from_fn(|k| view.corners_px[k] + std_px * noise[k]);
            if noisy.iter().all(|pixel| self.eye.contains(pixel)) {
                let corners_px = noisy.map(Into::into);
                tags.push(TagDetection { id, corners_px, decision_margin: view.decision_margin() });
            }
        }
        // A detector lists what it read.
        tags.sort_by_key(|tag| tag.id);
        let jitter: f64 = StandardNormal.sample(&mut self.jitter);
        let late_s = (self.clock.camera_latency_s + self.clock.camera_jitter_s * jitter).max(0.0);
        let gained_s = 1e-6 * self.clock.camera_clock_drift_ppm * closed.since_s(SIMULATION_EPOCH);
        (closed.plus_s(late_s), TagDetections { stamp: closed.plus_s(late_s + gained_s), tags })
    }

    /// Where the camera was when the shutter opened, and halfway, if it takes its time. The joints' rates hold meanwhile.
    fn before(&self, base_from_camera: &Isometry3<f64>, motion: &ArmMotion) -> Option<[Isometry3<f64>; 2]> {
        let exposure_s = self.spec.exposure_s;
        if exposure_s <= 0.0 {
            return None;
        }
        let ArmMotion { chain, angles, rates } = motion;
        // By the drawing, relative to the drawing's end: the camera itself is where the bodies are.
        let drawn = |earlier_s: f64| {
            let then = JointAngles::from_fn(angles.len(), |j| angles[j] - earlier_s * rates[j]);
            chain.link_poses(&then).frame(&self.mount)
        };
        let from_end = base_from_camera * drawn(0.0).inverse();
        Some([from_end * drawn(exposure_s), from_end * drawn(0.5 * exposure_s)])
    }

    /// What the detector reads on a tag.
    fn read_id(&mut self, id: u32) -> u32 {
        let known = self.misread.get(&id).copied().unwrap_or(id);
        let others = self.tags.len().saturating_sub(1);
        if self.spec.wrong_id_probability <= 0.0 || others == 0 {
            return known;
        }
        let is_wrong = self.wrong_ids.random_range(0.0..1.0) < self.spec.wrong_id_probability;
        let pick = self.wrong_ids.random_range(0..others);
        let other = self.tags.iter().map(|tag| tag.id).filter(|other| *other != id).nth(pick);
        if is_wrong { other.unwrap_or(known) } else { known }
    }

    fn corner_normal(&mut self) -> Vector2<f64> {
        Vector2::from_fn(|_, _| StandardNormal.sample(&mut self.corner_noise))
    }
}

#[cfg(test)]
mod tests;
