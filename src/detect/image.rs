//! A grey image as the detector takes it.

/// A grey image, row by row from the top, `width` bytes a row.
#[derive(Clone, Copy, Debug)]
pub struct GreyImage<'a> {
    pub width: usize,
    pub height: usize,
    pub data: &'a [u8],
}
