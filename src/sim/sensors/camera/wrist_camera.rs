//! Camera on the wrist or fixed near the arm: one image when the shutter closes, by projection or by rendering.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Vector2};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::as_built::AsBuilt;
use crate::body_poses::BodyPoses;
use crate::error::SimError;
use crate::imaging::TagPlane;
use crate::sensors::camera::clock::CameraClock;
use crate::sensors::camera::exposure::{ArmMotion, Exposure};
use crate::sensors::camera::ported_lens::PortedLens;
use crate::sensors::camera::rendered_camera::{RenderInput, RenderScene, RenderedCamera};
use crate::sensors::camera::scenery::ScenePoses;
use crate::sensors::camera::tag_projection::{TagInBase, TagOnLink, TagProjector};
use crate::sensors::camera::tag_reading::TagReader;
use crate::solids::Solids;
use crate::spec::{CameraMode, CameraWorldSpec, CornerNoiseKind, WaterKind, WorldSpec};
use armcal_core::optics::CornerNoise;
use armcal_core::robot::Robot;
use armcal_core::stats::stream_rng;
use armcal_core::streams::{ImageDemand, LateMessages, TagDetection, TagDetections};
use armcal_core::time::Stamp;

#[derive(Debug)]
pub(crate) struct WristCamera {
    spec: CameraWorldSpec,
    lens: PortedLens,
    exposure: Exposure,
    /// Tags as built, by id: fixed near the arm, or all on one link in front of a fixed camera.
    tags: Vec<TagOnLink>,
    /// Body that carries the tags.
    tag_body: usize,
    gripper_tag: Option<TagOnLink>,
    /// Indices of the shapes that hold the camera: they hide no tag.
    housing: Vec<usize>,
    /// Ids of tags that fell off.
    lost: BTreeSet<u32>,
    reader: TagReader,
    /// Time before which no tag is detected.
    blind_until: Option<Stamp>,
    /// Fitted noise model, which replaces the standard noise.
    fitted: Option<CornerNoise>,
    random: TagRandom,
    /// Random streams of the gripper tag only, so that it does not change the noise of other tags.
    gripper_random: TagRandom,
    clock: CameraClock,
    /// Renderer, in a world with rendered images.
    rendered: Option<Box<RenderedCamera>>,
}

/// Random streams of the tags in an image.
#[derive(Clone, Debug)]
struct TagRandom {
    corner_noise: ChaCha8Rng,
    misses: ChaCha8Rng,
}

impl TagRandom {
    fn new(seed: u64, name: &str) -> Self {
        Self {
            corner_noise: stream_rng(seed, &format!("{name}/corners")),
            misses: stream_rng(seed, &format!("{name}/misses")),
        }
    }

    /// Returns a uniform number that decides on a missed detection, and the noise of the corners in standard
    /// deviations.
    fn draw(&mut self) -> (f64, [Vector2<f64>; 4]) {
        let uniform = self.misses.random_range(0.0..1.0);
        let noise = [(); 4].map(|()| Vector2::from_fn(|_, _| StandardNormal.sample(&mut self.corner_noise)));
        (uniform, noise)
    }
}

/// Parts of a world from which a wrist camera is built.
#[derive(Clone, Copy)]
pub(crate) struct CameraInput<'a> {
    pub robot: &'a Robot,
    pub built: &'a AsBuilt,
    pub solids: &'a Solids,
    pub spec: &'a WorldSpec,
    pub seed: u64,
}

/// Scene when the shutter closes.
#[derive(Clone, Copy)]
pub(crate) struct ShutterState<'a> {
    pub poses: ScenePoses<'a>,
    /// Solids, placed at `poses`.
    pub solids: &'a Solids,
    pub motion: ArmMotion<'a>,
    pub closed: Stamp,
    pub demand: ImageDemand,
}

/// Tags of an image, with its time of arrival.
#[derive(Debug)]
pub(crate) struct CameraShot {
    pub arrival: Stamp,
    pub tags: SeenTags,
}

/// Tags of an image.
#[derive(Debug)]
pub(crate) enum SeenTags {
    Projected(TagDetections),
    /// Results of the search in a rendered image: detections, rejects, and the image itself if it is to be recorded.
    Searched(LateMessages),
}

impl WristCamera {
    pub(crate) fn new(input: &CameraInput) -> Self {
        let CameraInput { robot, built, solids, spec, seed } = *input;
        let mut tags: Vec<TagOnLink> = built
            .tags
            .iter()
            .map(|tag| TagOnLink { id: tag.id, size_m: tag.size_m, mount: tag.attachment(robot) })
            .collect();
        tags.sort_by_key(|tag| tag.id);
        let gripper_tag = robot.gripper_tag.zip(built.gripper_tag_attachment(robot));
        Self {
            spec: spec.camera,
            lens: PortedLens::new(&robot.camera.lens, built, &spec.camera),
            exposure: Exposure { exposure_s: spec.camera.exposure_s, mount: built.camera_attachment(robot) },
            tags,
            tag_body: robot.tag_frame.n_joints,
            gripper_tag: gripper_tag.map(|(tag, mount)| TagOnLink { id: tag.id, size_m: tag.size_m, mount }),
            housing: solids.housing(robot),
            lost: BTreeSet::new(),
            reader: TagReader::new(spec.camera.wrong_id_probability, seed),
            blind_until: None,
            fitted: fitted_noise(spec),
            random: TagRandom::new(seed, "camera"),
            gripper_random: TagRandom::new(seed, "camera/gripper_tag"),
            clock: CameraClock::new(&spec.clock, seed),
            rendered: None,
        }
    }

    /// Renders images from now on, if the world asks for it.
    ///
    /// # Errors
    /// [`SimError`] where there is no light, or no detector.
    pub(crate) fn enable_rendering(&mut self, input: &RenderInput) -> Result<(), SimError> {
        if input.spec.camera.mode == CameraMode::Rendered {
            self.rendered = Some(Box::new(RenderedCamera::new(input, &self.lens)?));
        }
        Ok(())
    }

    /// Returns the true pose of the camera.
    pub(crate) fn base_from_camera(&self, links: &BodyPoses) -> Isometry3<f64> {
        links.frame(&self.exposure.mount)
    }

    /// Removes a tag that falls off.
    pub(crate) fn lose(&mut self, id: u32) {
        self.lost.insert(id);
    }

    /// Moves the camera on its mount by `motion`, in its own axes.
    pub(crate) fn slip(&mut self, motion: Isometry3<f64>) {
        self.exposure.mount.link_from_frame *= motion;
    }

    /// Moves a tag by `motion`, in its own axes.
    pub(crate) fn move_tag(&mut self, id: u32, motion: Isometry3<f64>) {
        for tag in self.tags.iter_mut().filter(|tag| tag.id == id) {
            tag.mount.link_from_frame *= motion;
        }
    }

    /// Makes the detector read another id on a tag from now on.
    pub(crate) fn misread(&mut self, id: u32, as_id: u32) {
        self.reader.misread(id, as_id);
    }

    /// Hides everything in silt until a time.
    pub(crate) fn blind(&mut self, until: Stamp) {
        self.blind_until = Some(until);
    }

    /// Takes an image; `None` if none is due.
    pub(crate) fn take_image(&mut self, shutter: &ShutterState) -> Option<CameraShot> {
        let closed = shutter.closed;
        let Some(mut rendered) = self.rendered.take() else {
            let (arrival, detections) = self.project_tags(shutter);
            return Some(CameraShot { arrival, tags: SeenTags::Projected(detections) });
        };
        let shot = rendered.is_due(shutter.demand, closed).then(|| {
            let (arrival, stamp) = self.clock.stamps(closed);
            CameraShot { arrival, tags: SeenTags::Searched(self.render_image(&mut rendered, shutter, stamp)) }
        });
        self.rendered = Some(rendered);
        shot
    }

    fn render_image(&self, rendered: &mut RenderedCamera, shutter: &ShutterState, stamp: Stamp) -> LateMessages {
        let ShutterState { poses, motion, closed, .. } = shutter;
        let at_end = self.base_from_camera(poses.links);
        let base_from_camera = self.exposure.poses(&at_end, motion, 0);
        // A camera on the path relative to a body sees the body's shapes at each instant as the actual camera does.
        let carried = |body: usize| {
            let seen_from = self.exposure.poses(&at_end, motion, body);
            std::array::from_fn(|k| base_from_camera[k] * seen_from[k].inverse())
        };
        let carried_by = |body: usize| if body == 0 { [Isometry3::identity(); 3] } else { carried(body) };
        let on_gripper = carried_by(self.gripper_tag.map_or(0, |tag| tag.mount.n_joints));
        let with_tags = carried_by(self.tag_body);
        let family = rendered.family();
        let plane = |(i, tag): (usize, TagInBase)| {
            let moved = if i < self.tags.len() { with_tags } else { on_gripper };
            let base_from_tag = moved.map(|moved| moved * tag.base_from_tag);
            let id = self.reader.usual_id(tag.id);
            (!self.lost.contains(&tag.id)).then_some(TagPlane { family, id, size_m: tag.size_m, base_from_tag })
        };
        let tags: Vec<TagPlane> = self.tags_at(poses.links).into_iter().enumerate().filter_map(plane).collect();
        let is_silty = self.blind_until.is_some_and(|until| *closed < until);
        let scene = RenderScene { base_from_camera, tags: &tags, poses: *poses, is_silty };
        rendered.take_image(&scene, &carried, *closed, stamp)
    }

    /// Detects tags by projection. Returns the arrival of the image, late with jitter, and its tags with the stamp of
    /// the camera's clock.
    pub(crate) fn project_tags(&mut self, shutter: &ShutterState) -> (Stamp, TagDetections) {
        let ShutterState { poses, solids, motion, closed, .. } = shutter;
        let base_from_camera = self.base_from_camera(poses.links);
        let earlier = self.exposure.earlier_poses(&base_from_camera, motion, self.tag_body);
        let earlier_by_gripper =
            self.gripper_tag.and_then(|tag| self.exposure.earlier_poses(&base_from_camera, motion, tag.mount.n_joints));
        let mut tags = Vec::new();
        let is_blind = self.blind_until.is_some_and(|until| *closed < until);
        let n_surveyed = self.tags.len();
        for (i, tag) in self.tags_at(poses.links).into_iter().enumerate() {
            // Every tag draws its random numbers, detected or not, so that one more tag in view does not change the
            // noise of another.
            let is_surveyed = i < n_surveyed;
            let random = if is_surveyed { &mut self.random } else { &mut self.gripper_random };
            let (uniform, noise) = random.draw();
            let is_missed = self.fitted.is_none() && uniform < self.spec.miss_probability;
            let id = if is_surveyed { self.reader.read_id(tag.id, &self.tags) } else { tag.id };
            let earlier = if is_surveyed { &earlier } else { &earlier_by_gripper };
            if is_missed || is_blind || self.lost.contains(&tag.id) {
                continue;
            }
            let fitted = self.fitted.as_ref();
            let projector = TagProjector { spec: &self.spec, lens: &self.lens, solids, housing: &self.housing, fitted };
            let at_end = projector.project(&tag, &base_from_camera);
            let Some(projection) = at_end.and_then(|p| projector.average_over_exposure(p, &tag, earlier.as_ref()))
            else {
                continue;
            };
            let Some(noisy) = projection.detected(&projector, uniform, &noise) else { continue };
            if noisy.iter().all(|pixel| self.lens.contains(pixel)) {
                let corners_px = noisy.map(Into::into);
                tags.push(TagDetection { id, corners_px, decision_margin: projection.decision_margin() });
            }
        }
        // A detector lists the ids that it read in order.
        tags.sort_by_key(|tag| tag.id);
        let (arrival, stamp) = self.clock.stamps(*closed);
        (arrival, TagDetections { stamp, tags })
    }

    /// Returns all tags in the base frame: those of the survey by id, including fallen ones, then the one on the
    /// gripper.
    fn tags_at(&self, links: &BodyPoses) -> Vec<TagInBase> {
        self.tags.iter().chain(&self.gripper_tag).map(|tag| tag.at(links)).collect()
    }
}

/// Returns the corner noise model for the world's kind of water, if the world asks for a fitted one.
fn fitted_noise(spec: &WorldSpec) -> Option<CornerNoise> {
    (spec.camera.noise == CornerNoiseKind::Fitted).then_some(match spec.image.water {
        WaterKind::Clear => CornerNoise::CLEAR,
        WaterKind::Coastal => CornerNoise::COASTAL,
        WaterKind::Turbid => CornerNoise::TURBID,
    })
}
