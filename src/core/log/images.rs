//! Camera images of a recording, one at a time: they make up most of its bytes, and few readers need them.

use std::path::Path;

use super::error::LogError;
use super::message_codec::Stream;
use super::messages::joints::FirstJoints;
use super::raw::for_each_raw;
use crate::streams::{CameraImage, Message};
use crate::time::Stamp;

/// Calls `take` with every readable camera image of a recording and its log time, in the order of the file.
///
/// # Errors
/// The errors of [`super::read_recording`].
pub fn for_each_image(path: impl AsRef<Path>, mut take: impl FnMut(Stamp, CameraImage)) -> Result<(), LogError> {
    for_each_raw(path.as_ref(), |raw| {
        if raw.topic() == Stream::Images.topic()
            && let Ok(Message::Image(image)) = Stream::Images.decode(raw.data, &mut FirstJoints::default())
        {
            take(raw.log_time(), image);
        }
    })?;
    Ok(())
}
