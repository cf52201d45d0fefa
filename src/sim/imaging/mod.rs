//! Images of the wrist camera, rendered on the CPU: tags, solids and seafloor through the lens, in water, on a noisy
//! sensor.
//!
//! Rays (`rays`) are intersected with objects (`tracer`, `scene`, `shape`, `tag_board`). Blocks of pixels on one face
//! share its shading (`shading`, `shader`, `light`, `water`); pixels on `edges` are means over 32 samples
//! (`supersampling`). `marine_snow`, `auto_exposure` and the `sensor` follow. Loops over `Lanes` become vector
//! instructions. Neither these nor threads change the order of the arithmetic.

mod auto_exposure;
mod canvas;
mod edges;
mod frame;
mod imager;
mod light;
mod marine_snow;
mod math;
mod rays;
mod scene;
mod seafloor_texture;
mod sensor;
mod shader;
mod shading;
mod shape;
mod supersampling;
mod tag_board;
mod tracer;
mod water;

pub use frame::Frame;
pub use imager::{Imager, Shot, SolidShape, TagPlane};
pub use light::Light;

pub use crate::spec::{CameraMode, ImageSpec, WaterKind};

#[cfg(test)]
mod tests;
