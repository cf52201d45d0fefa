//! Tags: boards without thickness, one side printed.

use crate::imaging::math::Rgb;
use armcal_core::optics::{MAX_PRINT_CELLS, TagFamily};

/// Diffuse reflectance of the white and the black of a board. Assumed: matt laminate.
pub(super) const WHITE: f32 = 0.85;
pub(super) const BLACK: f32 = 0.05;
/// Faces of a tag, to find edges.
pub(super) const FACE_WHITE: u16 = 0;
pub(super) const FACE_BLACK: u16 = 1;
pub(super) const FACE_BACK: u16 = 2;
/// Distance along the tag's normal by which other surfaces in front of it are ignored, as for the geometric camera. A
/// tag is glued to a surface, and neither pose is exact.
pub(super) const CLEAR_OF_BACKING_M: f32 = 0.006;

/// A tag's printed pattern and size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Board {
    /// Rows from the top of the board; the left cell is the highest of `n` bits, 1 is black.
    rows: [u16; MAX_PRINT_CELLS],
    /// Number of cells along a side of the whole tag.
    n: usize,
    pub half_m: f32,
    cells_per_m: f32,
}

impl Board {
    /// Builds the board of a tag; an id that the family does not have is a blank board.
    pub(super) fn new(family: TagFamily, id: u32, size_m: f64) -> Self {
        let mut rows = [0; MAX_PRINT_CELLS];
        if let Some(cells) = family.cells(id) {
            for (row, cells) in rows.iter_mut().zip(cells.rows()) {
                // The board is white where nothing is printed.
                *row = cells.iter().fold(0, |bits, cell| bits << 1 | u16::from(*cell == Some(false)));
            }
        }
        let n = family.n_cells() + 2 * family.n_margin_cells();
        let cell_m = size_m / family.n_cells() as f64;
        Self { rows, n, half_m: (0.5 * cell_m * n as f64) as f32, cells_per_m: (1.0 / cell_m) as f32 }
    }

    /// Returns the face at a position on the front, x right, y up, m.
    #[inline]
    pub(super) fn face(&self, x: f32, y: f32) -> u16 {
        let last = self.n - 1;
        let column = (((x + self.half_m) * self.cells_per_m) as usize).min(last);
        let row = (((self.half_m - y) * self.cells_per_m) as usize).min(last);
        if self.rows[row] >> (last - column) & 1 == 1 { FACE_BLACK } else { FACE_WHITE }
    }

    pub(super) fn cell_m(&self) -> f32 {
        1.0 / self.cells_per_m
    }
}

pub(super) fn albedo(face: u16) -> Rgb {
    [if face == FACE_BLACK { BLACK } else { WHITE }; 3]
}
