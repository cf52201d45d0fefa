//! The wrist camera whose images are rendered and read by the detector.

use std::fmt;

use nalgebra::{Isometry3, Unit, Vector3};

use super::eye::PortedLens;
use super::scenery::{Places, Scenery};
use crate::error::SimError;
use crate::imaging::{Frame, Imager, Light, Shot, TagPlane};
use crate::spec::{ImageSpec, WorldSpec};
use armcal_core::robot::{FileIssue, Robot, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::streams::{DetectionReject, TagDetection};
use armcal_core::time::Stamp;
use armcal_detect::{DetectorSettings, GreyImage, TagDetector};

/// What a rendered camera is made from, besides the camera's own.
#[derive(Clone, Copy)]
pub(crate) struct RenderInput<'a> {
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
    pub scene: &'a Scene,
    pub spec: &'a WorldSpec,
    pub seed: u64,
}

pub(super) struct Rendered {
    imager: Imager,
    scenery: Scenery,
    detector: TagDetector,
    spec: ImageSpec,
    number: u64,
    last_taken: Option<Stamp>,
    last_logged: Option<Stamp>,
    grey: Vec<u8>,
    solids: Vec<[Isometry3<f64>; 3]>,
}

/// What one image is taken of, besides solids.
pub(super) struct Scenario<'a> {
    pub base_from_camera: [Isometry3<f64>; 3],
    pub tags: &'a [TagPlane],
    pub places: Places<'a>,
    pub is_silty: bool,
}

/// What the camera makes of one image.
#[derive(Clone, Debug, Default)]
pub(super) struct Read {
    pub tags: Vec<TagDetection>,
    pub rejects: Vec<DetectionReject>,
    /// The image itself, where it is to be kept.
    pub jpeg: Option<Vec<u8>>,
}

impl fmt::Debug for Rendered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Rendered").field("number", &self.number).finish_non_exhaustive()
    }
}

impl Rendered {
    /// # Errors
    /// [`SimError`] where there is no light, or no detector.
    pub(super) fn new(input: &RenderInput, eye: &PortedLens) -> Result<Self, SimError> {
        let RenderInput { robot, vehicle, scene, spec, seed } = *input;
        let image = spec.image;
        if vehicle.lights.is_empty() && image.ambient_lux <= 0.0 {
            let problem = "needs one or more lamps where images are rendered and world.image.ambient_lux is 0";
            return Err(FileIssue::new(&vehicle.file, "light", problem).into());
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
        let mut imager = Imager::new(&eye.lens, &image, &lights, seed);
        imager.set_solids(&scenery.shapes);
        // The detector knows the lens of the drawing.
        let detector = TagDetector::new(&robot.camera.lens, DetectorSettings::default())
            .map_err(|error| SimError::Detector(error.to_string()))?;
        Ok(Self {
            imager,
            scenery,
            detector,
            spec: image,
            number: 0,
            last_taken: None,
            last_logged: None,
            grey: Vec::new(),
            solids: Vec::new(),
        })
    }

    /// Whether an image is to be taken: all of them while the camera is wanted, now and then otherwise.
    pub(super) fn is_due(&self, is_wanted: bool, now: Stamp) -> bool {
        let preview_s = if self.spec.preview_hz > 0.0 { 1.0 / self.spec.preview_hz } else { f64::INFINITY };
        is_wanted || self.last_taken.map_or(preview_s.is_finite(), |last| now.since_s(last) >= preview_s - 1e-6)
    }

    pub(super) fn shoot(
        &mut self,
        scenario: &Scenario,
        carried: &dyn Fn(usize) -> [Isometry3<f64>; 3],
        now: Stamp,
    ) -> Result<Read, SimError> {
        self.scenery.place(&scenario.places, carried, &mut self.solids);
        let up = Unit::new_normalize(scenario.places.base_from_world.rotation * Vector3::z());
        let frame = self.imager.shoot(&Shot {
            base_from_camera: scenario.base_from_camera,
            tags: scenario.tags,
            solids: &self.solids,
            up,
            is_silty: scenario.is_silty,
            number: self.number,
        });
        self.number += 1;
        self.last_taken = Some(now);
        frame.grey(&mut self.grey);
        let image = GreyImage { width: frame.width, height: frame.height, data: &self.grey };
        let found = self.detector.detect(image).map_err(|error| SimError::Detector(error.to_string()))?;
        let is_kept = self.last_logged.is_none_or(|last| now.since_s(last) >= self.spec.log_period_s - 1e-6);
        if is_kept {
            self.last_logged = Some(now);
        }
        Ok(Read {
            tags: found.tags.into_iter().map(|tag| tag.detection).collect(),
            rejects: found.rejects,
            jpeg: is_kept.then(|| compressed(frame, self.spec.jpeg_quality)).transpose()?,
        })
    }
}

/// As JPEG; colours at half the resolution.
fn compressed(frame: &Frame, quality: f64) -> Result<Vec<u8>, SimError> {
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
    let side = |n: usize| u16::try_from(n).map_err(|_| SimError::Jpeg(format!("a side of {n} pixels is too long")));
    let mut out = Vec::with_capacity(frame.rgb.len() / 10);
    let mut encoder = Encoder::new(&mut out, quality.round() as u8);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    let (width, height) = (side(frame.width)?, side(frame.height)?);
    encoder.encode(&frame.rgb, width, height, ColorType::Rgb).map_err(|error| SimError::Jpeg(error.to_string()))?;
    Ok(out)
}
