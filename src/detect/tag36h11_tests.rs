//! The drawn patterns, read by the AprilTag library.

use apriltag::{DetectorBuilder, Family, Image};

use armcal_core::optics::tag36h11::{BOARD_CELLS, FAMILY_SIZE, cells};

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
