//! The rendered camera: images are rendered, and the tags are read from them.

use armcal_core::codes::Code;
use std::fmt;

use nalgebra::{Isometry3, Unit, Vector3};

use crate::error::SimError;
use crate::imaging::{Imager, Light, Shot, TagPlane};
use crate::sensors::camera::ported_lens::PortedLens;
use crate::sensors::camera::scenery::{ScenePoses, Scenery};
use crate::sensors::camera::tag_search::{Kept, TagSearch};
use crate::spec::{ImageSpec, WorldSpec};
use armcal_core::optics::TagFamily;
use armcal_core::robot::{FileIssue, Robot, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::streams::{ImageDemand, LateMessages};
use armcal_core::time::Stamp;

/// Parts of a world from which a rendered camera is built.
#[derive(Clone, Copy)]
pub(crate) struct RenderInput<'a> {
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
    pub scene: &'a Scene,
    pub spec: &'a WorldSpec,
    pub seed: u64,
}

pub(super) struct RenderedCamera {
    imager: Imager,
    scenery: Scenery,
    search: TagSearch,
    family: TagFamily,
    spec: ImageSpec,
    number: u64,
    last_taken: Option<Stamp>,
    last_logged: Option<Stamp>,
    solids: Vec<[Isometry3<f64>; 3]>,
}

/// Camera poses, tags and poses of one image.
pub(super) struct RenderScene<'a> {
    pub base_from_camera: [Isometry3<f64>; 3],
    pub tags: &'a [TagPlane],
    pub poses: ScenePoses<'a>,
    pub is_silty: bool,
}

impl fmt::Debug for RenderedCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RenderedCamera").field("number", &self.number).finish_non_exhaustive()
    }
}

impl RenderedCamera {
    /// Builds the renderer and starts the search for tags.
    ///
    /// # Errors
    /// [`SimError`] where there is no light, or no detector.
    pub(super) fn new(input: &RenderInput, ported: &PortedLens) -> Result<Self, SimError> {
        let RenderInput { robot, vehicle, scene, spec, seed } = *input;
        let image = spec.image;
        if vehicle.lights.is_empty() && image.ambient_lux <= 0.0 {
            let problem = "needs one or more lights: images are rendered and world.image.ambient_lux is 0";
            return Err(FileIssue::new(Code::KeyMissing, &vehicle.file, "light", problem).into());
        }
        let base_from_vehicle = *vehicle.vehicle_from_base.inverse().isometry();
        let light = |light: &armcal_core::robot::VehicleLight| Light {
            position_m: base_from_vehicle * light.position_m,
            direction: Unit::new_normalize(base_from_vehicle * light.direction.into_inner()),
            flux_lm: light.flux_lm,
            half_angle_rad: light.half_angle_rad,
        };
        let lights: Vec<Light> = vehicle.lights.iter().map(light).collect();
        let scenery = Scenery::new(robot, vehicle, scene);
        let mut imager = Imager::new(&ported.lens, &image, &lights, seed);
        imager.set_solids(&scenery.shapes);
        // The detector knows only the nominal lens.
        let search = TagSearch::start(&robot.camera.lens, robot.tag_family, image.jpeg_quality.round() as u8)?;
        Ok(Self {
            imager,
            scenery,
            search,
            family: robot.tag_family,
            spec: image,
            number: 0,
            last_taken: None,
            last_logged: None,
            solids: Vec::new(),
        })
    }

    /// Returns the family of the printed tags.
    pub(super) fn family(&self) -> TagFamily {
        self.family
    }

    /// Returns true if an image is due.
    pub(super) fn is_due(&self, demand: ImageDemand, now: Stamp) -> bool {
        let preview_s = if self.spec.preview_hz > 0.0 { 1.0 / self.spec.preview_hz } else { f64::INFINITY };
        demand == ImageDemand::All
            || self.last_taken.map_or(preview_s.is_finite(), |last| now.since_s(last) >= preview_s - 1e-6)
    }

    /// Takes an image; `stamp` is the camera clock's, `now` the arm's.
    pub(super) fn take_image(
        &mut self,
        scene_state: &RenderScene,
        carried: &dyn Fn(usize) -> [Isometry3<f64>; 3],
        now: Stamp,
        stamp: Stamp,
    ) -> LateMessages {
        self.scenery.place(&scene_state.poses, carried, &mut self.solids);
        let up = Unit::new_normalize(scene_state.poses.base_from_world.rotation * Vector3::z());
        let frame = self.imager.take_image(&Shot {
            base_from_camera: scene_state.base_from_camera,
            tags: scene_state.tags,
            solids: &self.solids,
            up,
            is_silty: scene_state.is_silty,
            number: self.number,
        });
        self.number += 1;
        self.last_taken = Some(now);
        let is_logged = self.last_logged.is_none_or(|last| now.since_s(last) >= self.spec.log_period_s - 1e-6);
        if is_logged {
            self.last_logged = Some(now);
        }
        let kept = if is_logged { Kept::TagsAndImage } else { Kept::TagsAlone };
        self.search.search(frame.clone(), stamp, kept)
    }
}
