//! The contents of a file about tags.

use armcal_core::codes::Code;
use std::collections::BTreeSet;
use std::path::Path;

use crate::tagmap::types::{Body, TagPrior};
use armcal_core::robot::{FileIssue, MAX_TAGS};
use armcal_core::time::Stamp;

/// Detections of one tag that stand for another in a span of time: two tags with one number.
#[derive(Clone, Debug, PartialEq)]
pub struct Remap {
    /// Id as detected.
    pub id: u32,
    /// Id of the true tag.
    pub as_id: u32,
    /// Name of the camera; `None` for every camera.
    pub camera: Option<String>,
    /// First instant.
    pub from: Stamp,
    /// Last instant, inclusive.
    pub to: Stamp,
}

/// Contents of a file about tags.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TagFile {
    /// Name of the poses' frame in the file.
    pub frame: String,
    /// Bodies that carry tags, by first appearance in the file.
    pub bodies: Vec<Body>,
    /// Tags in the order of the file.
    pub tags: Vec<TagPrior>,
    /// Size (m) and body of tags without an entry.
    pub default_tag: Option<(f64, usize)>,
    /// Number of the base tag; `None` if the file names none.
    pub base_tag: Option<u32>,
    /// Ids whose detections are not used.
    pub ignored: BTreeSet<u32>,
    /// Largest number of corrected bits of a detection in use.
    pub max_hamming: Option<i32>,
    /// Single detections to ignore.
    pub squashed: Vec<(Stamp, BTreeSet<u32>)>,
    /// Replacements of ids; the first one that matches a detection applies.
    pub remaps: Vec<Remap>,
    /// Keys of the file that have no effect here.
    pub ignored_keys: Vec<String>,
}

/// Limits the number of tags: many make a map slow long before they fill the memory.
pub(super) fn check_number(file: &Path, n_tags: usize) -> Result<(), FileIssue> {
    if n_tags <= MAX_TAGS {
        return Ok(());
    }
    Err(FileIssue::new(Code::ValueCount, file, "tag", format!("{n_tags} tags, 0 .. {MAX_TAGS} allowed")))
}
