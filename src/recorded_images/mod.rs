//! Tags in the images of recordings that hold no detections.
//!
//! `grey` makes a grey picture of a message, `detector` looks for tags in it. The reader of `input` calls it with one
//! image at a time and knows neither.

mod detector;
mod grey;

pub use detector::RecordedImageDetector;
