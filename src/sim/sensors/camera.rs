//! The wrist camera with its tag detector: which tags it sees, and where their corners fall.
//!
//! A tag is seen if its front faces the camera at less than a largest incidence and range, all corners lie in the
//! image, its shortest side is long enough to decode, and neither its centre nor a corner is hidden by the arm or the
//! vehicle. Corner noise per coordinate: `s (0.8 + 0.2 range / 1 m) / sqrt(cos(incidence))`.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::kinematics::Attachment;
use crate::optics::Fisheye;
use crate::robot::Robot;
use crate::sim::as_built::AsBuilt;
use crate::sim::places::BodyPoses;
use crate::sim::solids::Solids;
use crate::sim::spec::{CameraWorldSpec, ClockSpec, WorldSpec};
use crate::stats::stream_rng;
use crate::streams::{TagDetection, TagDetections};
use crate::time::Stamp;

/// Sight lines end this far before the tag: it is glued to something, and its place is not exact.
const CLEAR_OF_BACKING_M: f64 = 0.006;

#[derive(Clone, Debug)]
pub(in crate::sim) struct WristCamera {
    spec: CameraWorldSpec,
    clock: ClockSpec,
    lens: Fisheye,
    /// As built.
    mount: Attachment,
    /// As built, by id.
    tags: Vec<TagInBase>,
    /// Shapes that cannot hide anything, for they hold the camera.
    housing: Vec<usize>,
    /// By id: those that fell off.
    lost: BTreeSet<u32>,
    /// Nothing is seen before this.
    blind_until: Option<Stamp>,
    corner_noise: ChaCha8Rng,
    misses: ChaCha8Rng,
    jitter: ChaCha8Rng,
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

#[derive(Clone, Copy, Debug)]
struct TagInBase {
    id: u32,
    size_m: f64,
    base_from_tag: Isometry3<f64>,
}

/// How a tag is seen.
#[derive(Clone, Copy, Debug)]
struct View {
    corners_px: [Vector2<f64>; 4],
    range_m: f64,
    cos_incidence: f64,
    side_px: f64,
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
            lens: robot.camera.lens,
            mount: built.camera_attachment(robot),
            tags,
            housing: solids.housing(robot),
            lost: BTreeSet::new(),
            blind_until: None,
            corner_noise: stream_rng(seed, "camera/corners"),
            misses: stream_rng(seed, "camera/misses"),
            jitter: stream_rng(seed, "camera/clock"),
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

    /// Silt hides everything until then.
    pub(in crate::sim) fn blind(&mut self, until: Stamp) {
        self.blind_until = Some(until);
    }

    /// Takes an image; `solids` must be placed for `links`. The stamp is late and jitters.
    pub(in crate::sim) fn expose(&mut self, links: &BodyPoses, solids: &Solids, exposure: Stamp) -> TagDetections {
        let base_from_camera = self.base_from_camera(links);
        let mut tags = Vec::new();
        let is_blind = self.blind_until.is_some_and(|until| exposure < until);
        for i in 0..self.tags.len() {
            let tag = self.tags[i];
            // Every tag takes its share of the random stream, seen or not: one more tag in view moves no other's noise.
            let is_missed = self.misses.random_range(0.0..1.0) < self.spec.miss_probability;
            let noise: [Vector2<f64>; 4] = std::array::from_fn(|_| self.corner_normal());
            if is_missed || is_blind || self.lost.contains(&tag.id) {
                continue;
            }
            let Some(view) = self.view(&tag, &base_from_camera, solids) else { continue };
            let std_px = self.corner_std_px(&view);
            let noisy: [Vector2<f64>; 4] = std::array::from_fn(|k| view.corners_px[k] + std_px * noise[k]);
            if noisy.iter().all(|pixel| self.lens.contains(pixel)) {
                let corners_px = noisy.map(Into::into);
                tags.push(TagDetection { id: tag.id, corners_px, decision_margin: decision_margin(&view) });
            }
        }
        let jitter: f64 = StandardNormal.sample(&mut self.jitter);
        let late_s = (self.clock.camera_latency_s + self.clock.camera_jitter_s * jitter).max(0.0);
        TagDetections { stamp: exposure.plus_s(late_s), tags }
    }

    fn corner_normal(&mut self) -> Vector2<f64> {
        Vector2::from_fn(|_, _| StandardNormal.sample(&mut self.corner_noise))
    }

    fn corner_std_px(&self, view: &View) -> f64 {
        self.spec.corner_noise_px * (0.8 + 0.2 * view.range_m) / view.cos_incidence.sqrt()
    }

    fn view(&self, tag: &TagInBase, base_from_camera: &Isometry3<f64>, solids: &Solids) -> Option<View> {
        let camera_from_tag = base_from_camera.inverse() * tag.base_from_tag;
        let center = camera_from_tag.translation.vector;
        let range_m = center.norm();
        let normal = camera_from_tag.rotation * Vector3::z();
        let cos_incidence = -normal.dot(&center) / range_m;
        if range_m > self.spec.max_range_m || cos_incidence < self.spec.max_incidence_rad.cos() {
            return None;
        }
        let corners = crate::optics::square_corners(tag.size_m);
        let mut corners_px = [Vector2::zeros(); 4];
        for (pixel, corner) in corners_px.iter_mut().zip(&corners) {
            *pixel = self.lens.project(&(camera_from_tag * corner).coords).filter(|p| self.lens.contains(p))?;
        }
        let side_px = (0..4).map(|k| (corners_px[k] - corners_px[(k + 1) % 4]).norm()).fold(f64::INFINITY, f64::min);
        let eye = Point3::from(base_from_camera.translation.vector);
        let lifted = |p: &Point3<f64>| tag.base_from_tag * (p + Vector3::z() * CLEAR_OF_BACKING_M);
        let hidden = |p: &Point3<f64>| solids.hides(&eye, &lifted(p), &self.housing);
        if side_px < self.spec.min_side_px || hidden(&Point3::origin()) || corners.iter().any(hidden) {
            return None;
        }
        Some(View { corners_px, range_m, cos_incidence, side_px })
    }
}

/// Plausible figures for a reader who filters by margin: large and frontal tags near 100.
fn decision_margin(view: &View) -> f64 {
    100.0 * view.cos_incidence * (1.0 - (-view.side_px / 40.0).exp())
}
