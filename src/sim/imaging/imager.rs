//! The imager: lens, lights and solids of a scene, and one image at a time.

use nalgebra::{Isometry3, Unit, Vector3};
use rayon::prelude::*;

use crate::imaging::auto_exposure::AutoExposure;
use crate::imaging::canvas::Canvas;
use crate::imaging::frame::Frame;
use crate::imaging::light::Light;
use crate::imaging::marine_snow::{self, Flake};
use crate::imaging::math::image_key;
use crate::imaging::rays::Rays;
use crate::imaging::scene::{Appearance, Object};
use crate::imaging::seafloor_texture::Texture;
use crate::imaging::sensor::{BAND_ROWS, Sensor};
use crate::imaging::shader::Shader;
use crate::imaging::shape::Form;
use crate::imaging::tag_board::Board;
use crate::imaging::tracer::Tracer;
use crate::spec::ImageSpec;
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::robot::Shape;
use armcal_core::stats::stream_rng;

/// Printed tag; its frame has x right and y up as printed, z out of the print.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TagPlane {
    /// Family of the printed tag.
    pub family: TagFamily,
    /// Number of the tag in the family.
    pub id: u32,
    /// Side of its border square, as [`TagFamily`] has it.
    pub size_m: f64,
    /// Poses when the shutter opens, halfway through the exposure, and when it closes.
    pub base_from_tag: [Isometry3<f64>; 3],
}

impl TagPlane {
    /// Returns a tag of family 36h11 at rest relative to the base.
    #[must_use]
    pub fn fixed(id: u32, size_m: f64, base_from_tag: Isometry3<f64>) -> Self {
        Self { family: TagFamily::Tag36h11, id, size_m, base_from_tag: [base_from_tag; 3] }
    }
}

/// Solid shape of the scene, without its pose.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidShape {
    /// Shape about its own centre; its pose is in [`Shot::solids`].
    pub shape: Shape,
    /// Colour on a screen: red, green, blue.
    pub color_rgb: [u8; 3],
    /// True if it has the seafloor's texture instead of its colour.
    pub is_ground: bool,
}

/// Camera and scene of one image.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// Poses when the shutter opens, halfway through the exposure, and when it closes. The camera's frame has x right,
    /// y down, z along its axis.
    pub base_from_camera: [Isometry3<f64>; 3],
    /// Printed tags of the scene.
    pub tags: &'a [TagPlane],
    /// Pose `base_from_shape` of each of the imager's solids, or empty, at the same instants.
    pub solids: &'a [[Isometry3<f64>; 3]],
    /// Direction to the surface of the sea, base frame.
    pub up: Unit<Vector3<f64>>,
    /// True if stirred up sediment hides everything.
    pub is_silty: bool,
    /// Number of the image, from which its noise and snow are drawn.
    pub number: u64,
}

impl<'a> Shot<'a> {
    /// Returns a scene of tags only, in front of a camera at rest, up along z of the base.
    #[must_use]
    pub fn of_tags(base_from_camera: Isometry3<f64>, tags: &'a [TagPlane], number: u64) -> Self {
        let base_from_camera = [base_from_camera; 3];
        Self { base_from_camera, tags, solids: &[], up: Vector3::z_axis(), is_silty: false, number }
    }
}

/// Renderer of images with one lens in one water.
#[derive(Clone, Debug)]
pub struct Imager {
    lens: CameraModel,
    spec: ImageSpec,
    lights: Vec<Light>,
    solids: Vec<(Form, Appearance)>,
    rays: Rays,
    texture: Texture,
    canvas: Canvas,
    flakes: Vec<Flake>,
    auto_exposure: AutoExposure,
    sensor: Sensor,
    seed: u64,
    frame: Frame,
}

/// Radiance of silt, cd/m2: grey brown. Assumed.
const SILT_CD_M2: [f32; 3] = [9.0, 8.0, 6.0];

impl Imager {
    /// Builds the imager; noise and snow are drawn for `seed`.
    #[must_use]
    pub fn new(lens: &CameraModel, spec: &ImageSpec, lights: &[Light], seed: u64) -> Self {
        use rand::Rng;
        let rays = Rays::new(lens);
        let n_pixels = rays.width * rays.height;
        let key = |name: &str| stream_rng(seed, name).next_u64();
        Self {
            lens: *lens,
            spec: *spec,
            lights: lights.to_vec(),
            solids: Vec::new(),
            texture: Texture::new(),
            canvas: Canvas::new(n_pixels),
            flakes: Vec::new(),
            auto_exposure: AutoExposure::new(),
            sensor: Sensor::new(spec, key("image/noise")),
            seed: key("image/snow"),
            frame: Frame { width: rays.width, height: rays.height, rgb: vec![0; 3 * n_pixels] },
            rays,
        }
    }

    /// Sets the solids of the scene.
    pub fn set_solids(&mut self, solids: &[SolidShape]) {
        let look = |solid: &SolidShape| {
            let linear = |value: u8| (f32::from(value) / 255.0).powf(2.2);
            if solid.is_ground { Appearance::Ground } else { Appearance::Plain(solid.color_rgb.map(linear)) }
        };
        self.solids = solids.iter().map(|solid| (Form::of_shape(&solid.shape), look(solid))).collect();
    }

    /// Renders an image.
    pub fn take_image(&mut self, shot: &Shot) -> &Frame {
        let camera_from_base = shot.base_from_camera[1].inverse();
        let shader = Shader::new(&self.spec, &self.lights, &camera_from_base, &shot.up, &self.rays);
        if shot.is_silty {
            self.canvas.planes.iter_mut().zip(SILT_CD_M2).for_each(|(plane, value)| plane.fill(value));
        } else {
            self.draw(shot, &shader);
        }
        let planes = &mut self.canvas.planes;
        self.sensor.blur(planes, self.rays.width);
        let exposure = self.auto_exposure.choose(&self.spec, planes, &self.rays);
        let readout = self.sensor.readout(&self.spec, exposure, &self.rays, shot.number);
        readout.write(planes, self.rays.width, &mut self.frame.rgb);
        &self.frame
    }

    fn draw(&mut self, shot: &Shot, shader: &Shader) {
        let focal_px = self.rays.focal_px;
        let boards: Vec<Form> =
            shot.tags.iter().map(|tag| Form::Tag(Board::new(tag.family, tag.id, tag.size_m))).collect();
        let tags = boards.iter().zip(shot.tags).map(|(board, tag)| {
            Object::new(board, Appearance::Tag, &tag.base_from_tag, &shot.base_from_camera, focal_px)
        });
        let solids = self.solids.iter().zip(shot.solids).map(|((form, look), base_from_solid)| {
            Object::new(form, *look, base_from_solid, &shot.base_from_camera, focal_px)
        });
        let objects: Vec<Object> = tags.chain(solids).collect();
        let (rays, texture) = (&self.rays, &self.texture);
        self.canvas.trace(&Tracer { rays, objects: &objects, shader, texture });
        if self.spec.snow_per_m3 > 0.0 {
            marine_snow::fall(&self.spec, &self.lens, shader, image_key(self.seed, shot.number), &mut self.flakes);
            let flakes = &self.flakes;
            let Canvas { ranges, planes: [red, green, blue], .. } = &mut self.canvas;
            let ranges = &*ranges;
            let band = rays.width * BAND_ROWS;
            let bands = red.par_chunks_mut(band).zip(green.par_chunks_mut(band)).zip(blue.par_chunks_mut(band));
            bands.enumerate().for_each(|(n, ((red, green), blue))| {
                marine_snow::draw(flakes, rays, ranges, n * BAND_ROWS, &mut [red, green, blue]);
            });
        }
    }

    /// Returns the lens with which it renders.
    #[must_use]
    pub fn lens(&self) -> &CameraModel {
        &self.lens
    }
}
