//! The contents of a file about tags.

use armcal_core::codes::Code;
use std::collections::BTreeSet;
use std::path::Path;

use crate::tagmap::types::{Body, TagPrior};
use armcal_core::robot::{FileIssue, MAX_TAGS};
use armcal_core::time::Stamp;

/// Detections of one tag that stand for another, in a span of time: a tag number that was hung up twice.
#[derive(Clone, Debug, PartialEq)]
pub struct Remap {
    /// Id as detected.
    pub id: u32,
    /// Id of the tag that it is.
    pub as_id: u32,
    /// `None`: of every camera.
    pub camera: Option<String>,
    /// First instant.
    pub from: Stamp,
    /// Last instant, itself included.
    pub to: Stamp,
}

/// What a file says of tags.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TagFile {
    /// The frame that the poses are in, as the file names it.
    pub frame: String,
    /// Bodies that carry tags, by first appearance in the file.
    pub bodies: Vec<Body>,
    /// In the order of the file.
    pub tags: Vec<TagPrior>,
    /// Size (m) and body of tags that are not named.
    pub default_tag: Option<(f64, usize)>,
    /// `None` where the file names none.
    pub base_tag: Option<u32>,
    /// Ids whose detections are not used.
    pub ignored: BTreeSet<u32>,
    /// Detections with more corrected bits are not used.
    pub max_hamming: Option<i32>,
    /// Single detections that shall not be used.
    pub squashed: Vec<(Stamp, BTreeSet<u32>)>,
    /// The first one that fits a detection holds.
    pub remaps: Vec<Remap>,
    /// What the file asks for that has no effect here.
    pub ignored_keys: Vec<String>,
}

/// Many tags make a map slow long before they fill the memory.
pub(super) fn check_number(file: &Path, n_tags: usize) -> Result<(), FileIssue> {
    if n_tags <= MAX_TAGS {
        return Ok(());
    }
    Err(FileIssue::new(Code::ValueCount, file, "tag", format!("{n_tags} tags, 0 .. {MAX_TAGS} allowed")))
}
