//! The wrist camera with its tag detector: detected tags and their corner pixels.
//!
//! A tag is detected within a largest incidence and range, with all corners in the image, sides long enough to decode,
//! and neither its centre nor a corner hidden (`tag_projection`). Lens and port as built project points (`ported_lens`,
//! `port`). Corners are means over the exposure (Simpson's rule along the joints' motion, `exposure`). Noise per
//! coordinate: `s (0.8 + 0.2 range / 1 m) / sqrt(cos(incidence)) (1 + k blur)`. `rendered_camera` detects tags in
//! rendered images instead.

mod clock;
mod exposure;
mod port;
mod ported_lens;
mod rendered_camera;
mod scenery;
mod tag_projection;
mod tag_reading;
#[cfg(feature = "images")]
mod tag_search;
#[cfg(not(feature = "images"))]
#[path = "no_tag_search.rs"]
mod tag_search;
mod wrist_camera;

pub(crate) use exposure::ArmMotion;
pub(crate) use rendered_camera::RenderInput;
pub(crate) use scenery::ScenePoses;
pub(crate) use wrist_camera::{CameraInput, CameraShot, SeenTags, ShutterState, WristCamera};

#[cfg(test)]
mod tests;
