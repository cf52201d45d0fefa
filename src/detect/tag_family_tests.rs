//! The drawn patterns, read by the AprilTag library.

use apriltag::{DetectorBuilder, Image};

use crate::decoder::library_family;
use armcal_core::optics::TagFamily;

/// Pixels a cell.
const CELL_PX: usize = 10;
/// Cells of white about the print.
const RIM: usize = 3;

/// Each tag printed upright, the border's corners are found in the order of a message: bottom left, bottom right, top
/// right, top left. The library has pixel (0, 0) cover 0..1. Of large families every 199th is read.
#[test]
fn the_apriltag_library_reads_every_tag_upright() {
    for family in TagFamily::ALL {
        let mut detector =
            DetectorBuilder::new().add_family_bits(library_family(family), 0).build().expect("a detector");
        let edge = RIM + family.n_margin_cells();
        let side_px = (family.n_cells() + 2 * edge) * CELL_PX;
        let mut image = Image::zeros_with_stride(side_px, side_px, side_px).expect("an image");
        for id in (0..family.n_tags()).step_by(if family.n_tags() > 1000 { 199 } else { 1 }) {
            let cells = family.cells(id as u32).expect("in the family");
            for y in 0..side_px {
                for x in 0..side_px {
                    let (row, column) = ((y / CELL_PX).wrapping_sub(RIM), (x / CELL_PX).wrapping_sub(RIM));
                    image[(x, y)] = if cells.get(row, column).unwrap_or(true) { 220 } else { 20 };
                }
            }
            let found = detector.detect(&image);
            assert_eq!(found.len(), 1, "tag {id} of {family}");
            assert_eq!((found[0].id(), found[0].hamming()), (id, 0), "{family}");
            let (low, high) = ((edge * CELL_PX) as f64, ((edge + family.n_cells()) * CELL_PX) as f64);
            let expected = [[low, high], [high, high], [high, low], [low, low]];
            for (corner, expected) in found[0].corners().iter().zip(expected) {
                let off_px = (corner[0] - expected[0]).hypot(corner[1] - expected[1]);
                assert!(off_px < 0.25, "tag {id} of {family}: {corner:?} for {expected:?}");
            }
        }
    }
}
