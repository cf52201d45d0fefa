//! A grey image as the detector takes it.

/// A grey image, row by row from the top, `width` bytes a row.
#[derive(Clone, Copy, Debug)]
pub struct GreyImage<'a> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` bytes, 0 is black.
    pub data: &'a [u8],
}
