//! The printed pattern of the tag family 36h11 (Olson 2011; Wang and Olson 2016): 587 codes of 6 x 6 cells.
//!
//! `tag36h11.txt` comes from OpenCV's dictionary (tests/oracle/make_tag36h11.py), turned upright: OpenCV holds the
//! family turned by half a turn against the AprilTag project's images. The AprilTag library reads every tag back, id
//! and corners.

use std::sync::LazyLock;

/// How many tags the family has.
pub const FAMILY_SIZE: u32 = 587;
/// Cells along a side of a tag with its black border, which is where a tag's size is measured.
pub const TAG_CELLS: usize = 8;
/// Cells along a side of a printed board: the tag and a white ring of one cell around it.
pub const BOARD_CELLS: usize = 10;

/// Cells row by row from the top left, the first one the highest of 36 bits; 1 is white.
static CODES: LazyLock<Vec<u64>> = LazyLock::new(|| {
    include_str!("tag36h11.txt").lines().filter_map(|line| u64::from_str_radix(line.trim(), 16).ok()).collect()
});

/// The cells of tag `id` as printed, rows from the top, each from the left; true is white. The outer ring is the black
/// border. `None` for an id that the family does not have.
#[must_use]
pub fn cells(id: u32) -> Option<[[bool; TAG_CELLS]; TAG_CELLS]> {
    let code = *CODES.get(id as usize)?;
    let is_inner = |k: usize| (1..=6).contains(&k);
    Some(std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            is_inner(row) && is_inner(column) && code >> (35 - (6 * (row - 1) + column - 1)) & 1 == 1
        })
    }))
}
