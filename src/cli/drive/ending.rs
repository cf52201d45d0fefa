//! Forced end of the program, where the middleware prevents a normal one.

use crate::cli::exit::Exit;
use crate::cli::stdout::complain;
use armcal_core::codes::Coded;
use armcal_core::optics::CameraModel;
use armcal_live::{LiveError, MemoryWatch};

/// Memory for each pixel of an image that is decoded and searched, or rendered, bytes.
const BYTES_PER_PIXEL: u64 = 32;

/// Watches memory from now on; `camera` is that of the processed images.
pub(in crate::cli) fn watch_memory(camera: Option<&CameraModel>) -> Result<MemoryWatch, LiveError> {
    let pixels = camera.map_or(0, |camera| camera.resolution_px().map(u64::from).iter().product());
    MemoryWatch::start(BYTES_PER_PIXEL * pixels, end_at_once)
}

/// Prints the reason and ends the program. A middleware that is busy with its peers can neither be waited for nor asked
/// to send a stop.
fn end_at_once(error: LiveError) {
    let ending = "The program ended before the middleware did; an arm that moves may not have been told to stop";
    complain(format_args!("error: {error}. {ending} [{}]", error.code()));
    std::process::exit(i32::from(Exit::Failure.code()));
}
