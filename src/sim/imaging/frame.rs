//! A finished image.

/// 8 bits a channel, rows from the top, red, green, blue.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Three bytes a pixel.
    pub rgb: Vec<u8>,
}

impl Frame {
    /// Brightness by the weights of ITU-R BT.601, into `out`, which is resized.
    pub fn grey(&self, out: &mut Vec<u8>) {
        out.clear();
        out.extend(self.rgb.as_chunks::<3>().0.iter().map(|&[red, green, blue]| {
            ((77 * u32::from(red) + 150 * u32::from(green) + 29 * u32::from(blue) + 128) >> 8) as u8
        }));
    }
}
