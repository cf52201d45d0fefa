//! Files about cameras and tags: TagSLAM's, Kalibr's and our own.
//!
//! `cameras` reads and writes cameras.yaml and camchain.yaml, which have one format. `tagslam` (tagslam.yaml), `kalibr`
//! (a target's yaml) and `own` (our TOML) read tags into a [`TagFile`]. `landmarks` reads the survey for a calibration
//! of joints. `read` and `write` choose the format by the extension.

mod cameras;
mod kalibr;
mod landmark;
mod landmarks;
mod own;
mod read;
mod tag_file;
mod tagslam;
#[cfg(test)]
mod tests;
mod write;
mod written;
mod yaml;

pub use cameras::{NamedCamera, cameras_to_yaml, parse_cameras, read_cameras};
pub use landmark::{FIRST_NAMED_ID, Landmark, LandmarkFile, NamedSurvey, UNKNOWN_ROTATION_STD_RAD, spoken_name};
pub use landmarks::read_landmarks;
pub use own::tag_map_schema;
pub use read::{parse_tags, read_tags};
pub use tag_file::{Remap, TagFile};
pub use write::map_to_text;
