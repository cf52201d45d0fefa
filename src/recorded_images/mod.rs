//! Tags in the images of recordings that hold no detections, and of live cameras without a detector node.
//!
//! `grey` makes a grey picture of a message, `detector` searches it for tags. The reader of `input` calls it with one
//! image at a time and depends on neither. `live` does the same for the images of a live arm.

mod detector;
mod grey;
#[cfg(feature = "live")]
mod live;

pub use detector::RecordedImageDetector;
#[cfg(feature = "live")]
pub use live::LiveTagFinder;
