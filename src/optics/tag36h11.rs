//! The printed pattern of the tag family 36h11 (Olson 2011; Wang and Olson 2016): 587 codes of 6 x 6 cells.
//!
//! `tag36h11.txt` comes from OpenCV's dictionary (tests/oracle/make_tag36h11.py), turned upright: OpenCV holds the family turned
//! by half a turn against the AprilTag project's images. The AprilTag library reads every tag back, id and corners.

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

/// The cells of tag `id` as printed, rows from the top, each from the left; true is white. The outer ring is the black border.
/// `None` for an id that the family does not have.
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

#[cfg(all(test, feature = "detect"))]
mod tests {
    use apriltag::{DetectorBuilder, Family, Image};

    use super::*;

    /// Pixels a cell.
    const CELL_PX: usize = 10;

    /// Each tag printed upright, the border's corners are found in the order of a message: bottom left, bottom right, top
    /// right, top left. The library has pixel (0, 0) cover 0..1.
    #[test]
    fn the_apriltag_library_reads_every_tag_upright() {
        let mut detector = DetectorBuilder::new().add_family_bits(Family::tag_36h11(), 0).build().expect("a detector");
        let side_px = (BOARD_CELLS + 4) * CELL_PX;
        let mut image = Image::zeros_with_stride(side_px, side_px, side_px).expect("an image");
        for id in 0..FAMILY_SIZE {
            let cells = cells(id).expect("in the family");
            for y in 0..side_px {
                for x in 0..side_px {
                    let (row, column) = ((y / CELL_PX).wrapping_sub(3), (x / CELL_PX).wrapping_sub(3));
                    let is_white = cells.get(row).and_then(|row| row.get(column)).is_none_or(|cell| *cell);
                    image[(x, y)] = if is_white { 220 } else { 20 };
                }
            }
            let found = detector.detect(&image);
            assert_eq!(found.len(), 1, "tag {id}");
            assert_eq!((found[0].id(), found[0].hamming()), (id as usize, 0), "tag {id}");
            let (low, high) = (3.0 * CELL_PX as f64, 11.0 * CELL_PX as f64);
            let expected = [[low, high], [high, high], [high, low], [low, low]];
            for (corner, expected) in found[0].corners().iter().zip(expected) {
                let off_px = (corner[0] - expected[0]).hypot(corner[1] - expected[1]);
                assert!(off_px < 0.25, "tag {id}: {corner:?} for {expected:?}");
            }
        }
        assert!(cells(FAMILY_SIZE).is_none());
    }
}
