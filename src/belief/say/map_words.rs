//! Warnings about a tag map that is written.

use crate::say::map_refusal::in_lens_file;
use armcal_core::optics::CameraModel;

/// Warning that the map uses an estimated lens instead of the stated one; `std`: relative sigma of the focal length.
pub(crate) fn estimated_lens(stated: &CameraModel, found: &CameraModel, std: f64, lens_file: &str) -> String {
    let ratio = found.focal_px()[0] / stated.focal_px()[0] - 1.0;
    let [right, down] = [0, 1].map(|axis| found.center_px()[axis] - stated.center_px()[axis]);
    let text = format!(
        "the lens differs from robot.toml: focal length {:+.2} % (sigma {:.2} %), centre {right:.1}, {down:.1} px; \
         the map uses the estimated lens. Measure the intrinsics again",
        100.0 * ratio,
        100.0 * std
    );
    in_lens_file(&text, lens_file)
}

/// Warning of a tag whose size differs from the others'; `factor`: its size over the stated one.
pub(crate) fn odd_size(id: u32, factor: f64) -> String {
    format!(
        "tag {id} has {factor:.3} times its size_m, by the other tags of its views: the map has the stated size. \
         Measure its border square and correct size_m"
    )
}

/// Warning of a tag at two places; `n_before` of `n` detections are at the first one.
pub(crate) fn moved_meanwhile(id: u32, (distance_m, angle_rad): (f64, f64), (n_before, n): (usize, usize)) -> String {
    format!(
        "tag {id} moved during the recording, by {:.1} mm and {:.2} deg after {n_before} of its {n} detections: the \
         map has neither place. Fasten it, and map the tags again",
        1e3 * distance_m,
        angle_rad.to_degrees()
    )
}

/// Warning of a tag with rejected detections.
pub(crate) fn disagreeing_detections(id: u32, n_rejected: usize, n: usize) -> String {
    format!("tag {id}: {n_rejected} of {n} detections disagree with the map; is it where and what it was said to be?")
}

/// Warning of tags whose corners are in the order of a mirror image.
pub(crate) fn mirrored_corners(n: usize, of: usize) -> String {
    format!(
        "the corners of {n} of {of} tags run the wrong way round, as in a mirror; correct the program that writes \
         them: counterclockwise as seen, u to the right and v down (calibrate reads other orders by tags.corner_order \
         of the input map)"
    )
}

/// Warning of two groups of tags that contradict each other; `n`: number of images that show both groups.
pub(crate) fn apart_in_common_images([first, second]: [u32; 2], n: usize) -> String {
    format!(
        "tags {first} and {second} and their groups are in {n} common images that contradict each other, so that they \
         are not one map: check the sizes of the tags and the lens"
    )
}

/// Warning of an id that is at two places in each of `n` images.
pub(crate) fn id_on_two_tags(id: u32, n: usize) -> String {
    format!("id {id} was seen at two places in one image, {n} times: one id on two tags. Replace one of them")
}
