//! A finished image.

/// Image of 8 bits per channel, rows from the top; red, green, blue.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frame {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Pixel values, three bytes per pixel.
    pub rgb: Vec<u8>,
}

impl Frame {
    /// Writes the brightness, by the weights of ITU-R BT.601, into `out`, which is resized.
    pub fn grey(&self, out: &mut Vec<u8>) {
        out.clear();
        out.extend(self.rgb.as_chunks::<3>().0.iter().map(|&[red, green, blue]| {
            ((77 * u32::from(red) + 150 * u32::from(green) + 29 * u32::from(blue) + 128) >> 8) as u8
        }));
    }
}
