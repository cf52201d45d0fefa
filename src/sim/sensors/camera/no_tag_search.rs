//! Build without `images`: it cannot search images for tags, and refuses worlds that render them.

use crate::error::SimError;
use crate::imaging::Frame;
use armcal_core::optics::{CameraModel, TagFamily};
use armcal_core::streams::LateMessages;
use armcal_core::time::Stamp;

/// Search that cannot be started.
#[derive(Debug)]
pub(super) enum TagSearch {}

/// Recorded parts of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kept {
    TagsAlone,
    TagsAndImage,
}

impl TagSearch {
    /// Refuses to start.
    ///
    /// # Errors
    /// [`SimError::ImagesNotBuilt`], always.
    pub(super) fn start(_: &CameraModel, _: TagFamily, _: u8) -> Result<Self, SimError> {
        Err(SimError::ImagesNotBuilt)
    }

    pub(super) fn search(&self, _: Frame, _: Stamp, _: Kept) -> LateMessages {
        match *self {}
    }
}
