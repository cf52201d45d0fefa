//! Images of the wrist camera, rendered on the CPU: tags, solids and seafloor through the lens, in water, on a noisy sensor.
//!
//! Each pixel's ray (`rays`) finds what it meets (`scene`, `shape`, `tag`); blocks of pixels that see one face share its shading
//! (`band`, `shade`, `light`, `water`), pixels on edges are averaged over 32 samples of place and time (`sampled`). Marine snow
//! (`snow`), the lens's blur and the sensor (`sensor`) follow. All arithmetic is in an order that no thread changes.

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

/// A vector in the camera's frame or an object's, single precision.
type Vec3 = nalgebra::Vector3<f32>;
/// Red, green, blue.
type Rgb = [f32; 3];

#[cfg(test)]
mod tests;
