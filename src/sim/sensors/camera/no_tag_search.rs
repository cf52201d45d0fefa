//! A build without `images` finds no tags in images: a world that would render them is refused.

use crate::error::SimError;
use crate::imaging::Frame;
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::streams::LateMessages;
use armcal_core::time::Stamp;

/// There is none.
#[derive(Debug)]
pub(super) enum TagSearch {}

/// What of an image is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    TagsAlone,
    TagsAndImage,
}

impl TagSearch {
    /// # Errors
    /// [`SimError::ImagesNotBuilt`], always.
    pub(super) fn start(_: &CameraModel, _: TagFamily, _: u8) -> Result<Self, SimError> {
        Err(SimError::ImagesNotBuilt)
    }

    pub(super) fn search(&self, _: Frame, _: Stamp, _: Kept) -> LateMessages {
        match *self {}
    }
}
