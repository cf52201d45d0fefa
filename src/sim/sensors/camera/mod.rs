//! The wrist camera with its tag detector: which tags it sees, and where their corners fall.
//!
//! A tag is seen if its front faces the camera at less than a largest incidence and range, all corners lie in the image, its
//! shortest side is long enough to decode, and neither its centre nor a corner is hidden (`view`). Lens and port as built
//! make pixels of points (`eye`, `port`). With the shutter open for a while a corner is its mean over it (Simpson's rule
//! along the joints' motion). Noise per coordinate: `s (0.8 + 0.2 range / 1 m) / sqrt(cos(incidence)) (1 + k blur)`.

mod clock;
mod exposure;
mod port;
mod ported_lens;
mod rendered_camera;
mod scenery;
mod tag_projection;
mod tag_reading;
mod wrist_camera;

pub(crate) use exposure::ArmMotion;
pub(crate) use rendered_camera::{ImageDemand, RenderInput};
pub(crate) use scenery::ScenePoses;
pub(crate) use wrist_camera::{CameraInput, CameraShot, ShutterState, WristCamera};

#[cfg(test)]
mod tests;
