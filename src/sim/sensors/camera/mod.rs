//! The wrist camera with its tag detector: which tags it sees, and where their corners fall.
//!
//! A tag is seen if its front faces the camera at less than a largest incidence and range, all corners lie in the image, its
//! shortest side is long enough to decode, and neither its centre nor a corner is hidden (`view`). Lens and port as built
//! make pixels of points (`eye`, `port`). With the shutter open for a while a corner is its mean over it (Simpson's rule
//! along the joints' motion). Noise per coordinate: `s (0.8 + 0.2 range / 1 m) / sqrt(cos(incidence)) (1 + k blur)`.

mod eye;
mod port;
mod rendered;
mod scenery;
mod view;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::as_built::AsBuilt;
use crate::error::SimError;
use crate::imaging::TagPlane;
use crate::places::BodyPoses;
use crate::solids::Solids;
use crate::spec::{CameraMode, CameraWorldSpec, ClockSpec, CornerNoiseKind, WaterKind, WorldSpec};
use armcal_core::kinematics::{Attachment, Chain};
use armcal_core::optics::CornerNoise;
use armcal_core::robot::Robot;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{DetectionReject, JointAngles, TagDetection, TagDetections};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};
use eye::PortedLens;
pub(crate) use rendered::RenderInput;
use rendered::{Read, Rendered, Scenario};
pub(crate) use scenery::Places;
use view::{TagInBase, TagOnLink, TagProjector};

#[derive(Debug)]
pub(crate) struct WristCamera {
    spec: CameraWorldSpec,
    clock: ClockSpec,
    eye: PortedLens,
    /// As built.
    mount: Attachment,
    /// As built, by id.
    tags: Vec<TagInBase>,
    gripper_tag: Option<TagOnLink>,
    /// Shapes that cannot hide anything, for they hold the camera.
    housing: Vec<usize>,
    /// By id: those that fell off.
    lost: BTreeSet<u32>,
    /// By id: what the detector takes them for.
    misread: BTreeMap<u32, u32>,
    /// Nothing is seen before this.
    blind_until: Option<Stamp>,
    /// In place of the standard noise.
    fitted: Option<CornerNoise>,
    draws: TagDraws,
    /// The tag on the gripper has streams of its own: it moves no other's noise.
    gripper_draws: TagDraws,
    jitter: ChaCha8Rng,
    wrong_ids: ChaCha8Rng,
    /// Where detections come from pixels.
    rendered: Option<Box<Rendered>>,
}

/// What happens to a tag in one image.
#[derive(Clone, Debug)]
struct TagDraws {
    corner_noise: ChaCha8Rng,
    misses: ChaCha8Rng,
}

impl TagDraws {
    /// A uniform number for whether the detector misses the tag, and the noise of its corners in standard deviations.
    fn draw(&mut self) -> (f64, [Vector2<f64>; 4]) {
        let luck = self.misses.random_range(0.0..1.0);
        let noise = [(); 4].map(|()| Vector2::from_fn(|_, _| StandardNormal.sample(&mut self.corner_noise)));
        (luck, noise)
    }
}

/// What the camera is made from.
#[derive(Clone, Copy)]
pub(crate) struct CameraInput<'a> {
    pub robot: &'a Robot,
    pub built: &'a AsBuilt,
    pub solids: &'a Solids,
    pub spec: &'a WorldSpec,
    pub seed: u64,
}

/// How the joints move while the shutter is open.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArmMotion<'a> {
    pub chain: &'a Chain,
    pub angles: JointAngles,
    /// rad/s.
    pub rates: JointAngles,
}

/// When the shutter closes.
#[derive(Clone, Copy)]
pub(crate) struct Moment<'a> {
    pub places: Places<'a>,
    /// Placed for it.
    pub solids: &'a Solids,
    pub motion: ArmMotion<'a>,
    pub closed: Stamp,
    /// Whether somebody waits for images.
    pub is_wanted: bool,
}

/// An image as it arrives.
#[derive(Clone, Debug)]
pub(crate) struct Exposed {
    pub arrival: Stamp,
    pub detections: TagDetections,
    pub rejects: Vec<DetectionReject>,
    pub jpeg: Option<Vec<u8>>,
}

impl WristCamera {
    pub(crate) fn new(input: &CameraInput) -> Self {
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
            eye: PortedLens::new(&robot.camera.lens, built, &spec.camera),
            mount: built.camera_attachment(robot),
            tags,
            gripper_tag: robot.gripper_tag.zip(built.gripper_tag_attachment(robot)).map(|(tag, mount)| TagOnLink {
                id: tag.id,
                size_m: tag.size_m,
                mount,
            }),
            housing: solids.housing(robot),
            lost: BTreeSet::new(),
            misread: BTreeMap::new(),
            blind_until: None,
            fitted: fitted_noise(spec),
            draws: TagDraws {
                corner_noise: stream_rng(seed, "camera/corners"),
                misses: stream_rng(seed, "camera/misses"),
            },
            gripper_draws: TagDraws {
                corner_noise: stream_rng(seed, "camera/gripper_tag/corners"),
                misses: stream_rng(seed, "camera/gripper_tag/misses"),
            },
            jitter: stream_rng(seed, "camera/clock"),
            wrong_ids: stream_rng(seed, "camera/wrong_ids"),
            rendered: None,
        }
    }

    /// Renders from now on if the world says so.
    ///
    /// # Errors
    /// [`SimError`] where there is no light, or no detector.
    pub(crate) fn render(&mut self, input: &RenderInput) -> Result<(), SimError> {
        if input.spec.camera.mode == CameraMode::Rendered {
            self.rendered = Some(Box::new(Rendered::new(input, &self.eye)?));
        }
        Ok(())
    }

    /// Where the camera truly is.
    pub(crate) fn base_from_camera(&self, links: &BodyPoses) -> Isometry3<f64> {
        links.frame(&self.mount)
    }

    /// A tag falls off.
    pub(crate) fn lose(&mut self, id: u32) {
        self.lost.insert(id);
    }

    /// A tag is knocked out of its place; `motion` in its own axes.
    pub(crate) fn move_tag(&mut self, id: u32, motion: Isometry3<f64>) {
        for tag in self.tags.iter_mut().filter(|tag| tag.id == id) {
            tag.base_from_tag *= motion;
        }
    }

    /// The detector takes a tag for another one from now on.
    pub(crate) fn misread(&mut self, id: u32, as_id: u32) {
        self.misread.insert(id, as_id);
    }

    /// Silt hides everything until then.
    pub(crate) fn blind(&mut self, until: Stamp) {
        self.blind_until = Some(until);
    }

    /// Takes an image; `None` where none is due.
    ///
    /// # Errors
    /// [`SimError`] when the detector or the compression fails.
    pub(crate) fn take(&mut self, moment: &Moment) -> Result<Option<Exposed>, SimError> {
        let Moment { places, solids, motion, closed, is_wanted } = *moment;
        let Some(mut rendered) = self.rendered.take() else {
            let (arrival, detections) = self.expose(places.links, solids, &motion, closed);
            return Ok(Some(Exposed { arrival, detections, rejects: Vec::new(), jpeg: None }));
        };
        let read = if rendered.is_due(is_wanted, closed) {
            self.shoot(&mut rendered, &places, &motion, closed).map(Some)
        } else {
            Ok(None)
        };
        self.rendered = Some(rendered);
        Ok(read?.map(|Read { tags, rejects, jpeg }| {
            let (arrival, stamp) = self.stamps(closed);
            Exposed { arrival, detections: TagDetections { stamp, tags }, rejects, jpeg }
        }))
    }

    fn shoot(
        &self,
        rendered: &mut Rendered,
        places: &Places,
        motion: &ArmMotion,
        closed: Stamp,
    ) -> Result<Read, SimError> {
        let now = self.base_from_camera(places.links);
        let path =
            |body: usize| self.before(&now, motion, body).map_or([now; 3], |[start, middle]| [start, middle, now]);
        let base_from_camera = path(0);
        // What is on a body stood to the camera at each instant as it would have stood to a camera on that path.
        let carried = |body: usize| {
            let seen_from = path(body);
            std::array::from_fn(|k| base_from_camera[k] * seen_from[k].inverse())
        };
        let on_gripper = self.gripper_tag.map_or([Isometry3::identity(); 3], |tag| carried(tag.mount.n_joints));
        let plane = |(i, tag): (usize, TagInBase)| {
            let id = self.misread.get(&tag.id).copied().unwrap_or(tag.id);
            let moved = if i < self.tags.len() { [Isometry3::identity(); 3] } else { on_gripper };
            let base_from_tag = moved.map(|moved| moved * tag.base_from_tag);
            (!self.lost.contains(&tag.id)).then_some(TagPlane { id, size_m: tag.size_m, base_from_tag })
        };
        let tags: Vec<TagPlane> = self.tags_at(places.links).into_iter().enumerate().filter_map(plane).collect();
        let is_silty = self.blind_until.is_some_and(|until| closed < until);
        rendered.shoot(&Scenario { base_from_camera, tags: &tags, places: *places, is_silty }, &carried, closed)
    }

    /// Takes an image whose shutter closes at `closed`; `solids` must be placed for `links`. Gives the time of its arrival,
    /// late with jitter, and the image, whose stamp is that by the camera's own clock.
    pub(crate) fn expose(
        &mut self,
        links: &BodyPoses,
        solids: &Solids,
        motion: &ArmMotion,
        closed: Stamp,
    ) -> (Stamp, TagDetections) {
        let base_from_camera = self.base_from_camera(links);
        let before = self.before(&base_from_camera, motion, 0);
        let before_gripper =
            self.gripper_tag.and_then(|tag| self.before(&base_from_camera, motion, tag.mount.n_joints));
        let mut tags = Vec::new();
        let is_blind = self.blind_until.is_some_and(|until| closed < until);
        let n_standing = self.tags.len();
        for (i, tag) in self.tags_at(links).into_iter().enumerate() {
            // Every tag takes its share of the random streams, seen or not: one more tag in view moves no other's noise.
            let is_standing = i < n_standing;
            let draws = if is_standing { &mut self.draws } else { &mut self.gripper_draws };
            let (luck, noise) = draws.draw();
            let is_missed = self.fitted.is_none() && luck < self.spec.miss_probability;
            let id = if is_standing { self.read_id(tag.id) } else { tag.id };
            let before = if is_standing { &before } else { &before_gripper };
            if is_missed || is_blind || self.lost.contains(&tag.id) {
                continue;
            }
            let fitted = self.fitted.as_ref();
            let sight = TagProjector { spec: &self.spec, eye: &self.eye, solids, housing: &self.housing, fitted };
            let seen = sight.view(&tag, &base_from_camera);
            let Some(view) = seen.and_then(|view| sight.smeared(view, &tag, before.as_ref())) else { continue };
            let Some(noisy) = view.detected(&sight, luck, &noise) else { continue };
            if noisy.iter().all(|pixel| self.eye.contains(pixel)) {
                let corners_px = noisy.map(Into::into);
                tags.push(TagDetection { id, corners_px, decision_margin: view.decision_margin() });
            }
        }
        // A detector lists what it read.
        tags.sort_by_key(|tag| tag.id);
        let (arrival, stamp) = self.stamps(closed);
        (arrival, TagDetections { stamp, tags })
    }

    /// When an image arrives, late with jitter, and its stamp by the camera's own clock.
    fn stamps(&mut self, closed: Stamp) -> (Stamp, Stamp) {
        let jitter: f64 = StandardNormal.sample(&mut self.jitter);
        let late_s = (self.clock.camera_latency_s + self.clock.camera_jitter_s * jitter).max(0.0);
        let gained_s = 1e-6 * self.clock.camera_clock_drift_ppm * closed.since_s(SIMULATION_EPOCH);
        (closed.plus_s(late_s), closed.plus_s(late_s + gained_s))
    }

    /// All tags in the base frame for links as they are now: those around the arm by id, fallen ones among them, then that on
    /// the gripper.
    fn tags_at(&self, links: &BodyPoses) -> Vec<TagInBase> {
        self.tags.iter().copied().chain(self.gripper_tag.map(|tag| tag.at(links))).collect()
    }

    /// Where the camera was when the shutter opened, and halfway, if it takes its time: as a tag on `body` (0: the base) saw it, by
    /// where that body is now. The joints' rates hold meanwhile.
    fn before(
        &self,
        base_from_camera: &Isometry3<f64>,
        motion: &ArmMotion,
        body: usize,
    ) -> Option<[Isometry3<f64>; 2]> {
        let exposure_s = self.spec.exposure_s;
        if exposure_s <= 0.0 {
            return None;
        }
        let ArmMotion { chain, angles, rates } = motion;
        // By the drawing, relative to the drawing's end: the camera itself is where the bodies are.
        let drawn = |earlier_s: f64| {
            let then = JointAngles::from_fn(angles.len(), |j| angles[j] - earlier_s * rates[j]);
            let poses = chain.link_poses(&then);
            poses.link(body).inverse() * poses.frame(&self.mount)
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
}

/// What detections in the world's kind of water were measured to be like, if the world asks for it.
fn fitted_noise(spec: &WorldSpec) -> Option<CornerNoise> {
    (spec.camera.noise == CornerNoiseKind::Fitted).then_some(match spec.image.water {
        WaterKind::Clear => CornerNoise::CLEAR,
        WaterKind::Coastal => CornerNoise::COASTAL,
        WaterKind::Turbid => CornerNoise::TURBID,
    })
}

#[cfg(test)]
mod tests;
