//! Files about cameras and tags: TagSLAM's, Kalibr's and our own.
//!
//! `cameras` reads and writes cameras.yaml and camchain.yaml, which are of one form; `tagslam` tagslam.yaml, `kalibr` a target's
//! yaml, `own` our TOML. What they say of tags comes together in a [`TagFile`]; `landmarks` makes the survey of it that joints are
//! calibrated by.

mod cameras;
mod kalibr;
mod landmarks;
mod own;
mod tagslam;
mod yaml;

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{Isometry3, Matrix6};

pub use cameras::{NamedCamera, cameras_to_yaml, parse_cameras, read_cameras};
pub use landmarks::{FIRST_NAMED_ID, Landmark, LandmarkFile, NamedSurvey, UNKNOWN_ROTATION_STD_RAD, read_landmarks};

use crate::tagmap::check::SIZE_RANGE_M;
use crate::tagmap::result::{GroupFrame, TagMap};
use crate::tagmap::types::{Body, MapInput, TagPrior};
use armcal_core::robot::{FileIssue, RobotError, read_text};
use armcal_core::time::Stamp;

/// Detections of one tag that stand for another, in a span of time: a tag number that was hung up twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Remap {
    pub id: u32,
    pub as_id: u32,
    /// `None`: of every camera.
    pub camera: Option<String>,
    pub from: Stamp,
    pub to: Stamp,
}

/// What a file says of tags.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TagFile {
    /// The frame that the poses are in, as the file names it.
    pub frame: String,
    pub bodies: Vec<Body>,
    pub tags: Vec<TagPrior>,
    /// Size (m) and body of tags that are not named.
    pub default_tag: Option<(f64, usize)>,
    pub base_tag: Option<u32>,
    pub ignored: BTreeSet<u32>,
    /// Detections with more corrected bits are not used.
    pub max_hamming: Option<i32>,
    /// Single detections that shall not be used.
    pub squashed: Vec<(Stamp, BTreeSet<u32>)>,
    pub remaps: Vec<Remap>,
    /// What the file asks for that has no effect here.
    pub ignored_keys: Vec<String>,
}

/// Reads a tag map of ours (.toml), a tagslam.yaml or a Kalibr target (.yaml, .yml).
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_tags(file: &Path) -> Result<TagFile, RobotError> {
    let text = read_text(file)?;
    parse_tags(file, &text)
}

/// The same from a text; `file` names it in errors and decides the form by its extension.
///
/// # Errors
/// As [`read_tags`].
pub fn parse_tags(file: &Path, text: &str) -> Result<TagFile, RobotError> {
    let tags = match extension(file).as_str() {
        "toml" => own::parse(file, text)?,
        "yaml" | "yml" if kalibr::is_target(text) => kalibr::parse(file, text)?,
        "yaml" | "yml" => tagslam::parse(file, text)?,
        other => {
            let problem = format!("`.{other}` is no form of tag files; use .toml, or .yaml of TagSLAM or Kalibr");
            return Err(FileIssue::new(file, "extension", problem).into());
        }
    };
    check(file, &tags)?;
    Ok(tags)
}

fn check(file: &Path, tags: &TagFile) -> Result<(), RobotError> {
    let mut seen = BTreeSet::new();
    for tag in &tags.tags {
        if !seen.insert(tag.id) {
            return Err(FileIssue::new(file, format!("tag {}: id", tag.id), "stands twice").into());
        }
        FileIssue::check_range(file, &format!("tag {}: size", tag.id), tag.size_m, SIZE_RANGE_M)?;
    }
    if let Some((size_m, _)) = tags.default_tag {
        FileIssue::check_range(file, "default tag size", size_m, SIZE_RANGE_M)?;
    }
    Ok(())
}

fn extension(file: &Path) -> String {
    file.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// A tag of a map, as files write it.
#[derive(Clone, Debug)]
pub(super) struct Written {
    pub(super) id: u32,
    pub(super) size_m: f64,
    pub(super) pose: Isometry3<f64>,
    /// Along the axes of the frame, m.
    pub(super) position_std_m: [f64; 3],
    pub(super) covariance: Matrix6<f64>,
}

/// One group of a map, as files write it.
#[derive(Clone, Debug)]
pub(super) struct WrittenGroup {
    pub(super) frame: String,
    pub(super) is_static: bool,
    pub(super) tags: Vec<Written>,
}

/// The text of a map in the form of the extension: our TOML, or a tagslam.yaml.
///
/// # Errors
/// [`FileIssue`] for another extension.
pub fn map_to_text(file: &Path, map: &TagMap, input: &MapInput<'_>) -> Result<String, FileIssue> {
    let groups = written(map, input);
    match extension(file).as_str() {
        "toml" => Ok(own::to_text(&groups)),
        "yaml" | "yml" => Ok(tagslam::to_text(&groups)),
        other => {
            let problem = format!("`.{other}` is no form of tag maps; use .toml, or .yaml for TagSLAM's");
            Err(FileIssue::new(file, "extension", problem))
        }
    }
}

fn written(map: &TagMap, input: &MapInput<'_>) -> Vec<WrittenGroup> {
    let tag = |id: &u32| {
        let tag = map.tag(*id)?;
        Some(Written {
            id: tag.id,
            size_m: tag.size_m,
            pose: tag.frame_from_tag,
            position_std_m: tag.position_std_m(),
            covariance: tag.covariance,
        })
    };
    map.groups
        .iter()
        .map(|group| WrittenGroup {
            frame: match &group.frame {
                GroupFrame::Body(name) => name.clone(),
                GroupFrame::Tag(id) => format!("tag_{id}"),
            },
            is_static: group.bodies.iter().all(|body| input.bodies[*body].is_static),
            tags: group.tags.iter().filter_map(tag).collect(),
        })
        .collect()
}

#[cfg(test)]
mod tests;
