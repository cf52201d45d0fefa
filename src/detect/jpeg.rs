//! Grey pictures out of JPEG.

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::error::DetectError;

/// Scans of a progressive JPEG, each of which passes over all of the picture; encoders write about ten.
const MAX_SCANS: usize = 100;

/// A grey picture of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GreyPicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` bytes, row by row from the top, 0 is black.
    pub data: Vec<u8>,
}

/// Decodes the brightness of a JPEG of brightness and colours (YCbCr, as cameras write it) or of brightness only. It
/// ignores the colours, which are coarser and would blur the edges. A picture larger than `size_px` is not decoded.
///
/// # Errors
/// [`DetectError::Jpeg`] where it is damaged, larger, or has no brightness of its own (RGB, CMYK).
pub fn grey_of_jpeg(bytes: &[u8], size_px: [u32; 2]) -> Result<GreyPicture, DetectError> {
    let [max_width, max_height] = size_px.map(|n| n as usize);
    let options = DecoderOptions::default()
        .set_strict_mode(false)
        .set_max_width(max_width)
        .set_max_height(max_height)
        .jpeg_set_max_scans(MAX_SCANS)
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let failed = |error: zune_jpeg::errors::DecodeErrors| DetectError::Jpeg(format!("{error:?}"));
    decoder.decode_headers().map_err(failed)?;
    let has_brightness = matches!(decoder.input_colorspace(), Some(ColorSpace::YCbCr | ColorSpace::Luma));
    let Some((width, height)) = decoder.dimensions().filter(|_| has_brightness) else {
        return Err(DetectError::Jpeg("it has no brightness of its own".to_owned()));
    };
    let data = decoder.decode().map_err(failed)?;
    if data.len() != width * height {
        return Err(DetectError::Jpeg(format!("{} bytes for {width} x {height} pixels", data.len())));
    }
    Ok(GreyPicture { width, height, data })
}

#[cfg(test)]
mod tests {
    use super::*;
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};

    const SIDE: usize = 32;
    const SIZE: [u32; 2] = [SIDE as u32; 2];

    fn encoded(rgb: &[u8], quality: u8) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = Encoder::new(&mut out, quality);
        encoder.set_sampling_factor(SamplingFactor::F_2_2);
        encoder.encode(rgb, SIDE as u16, SIDE as u16, ColorType::Rgb).expect("encoded");
        out
    }

    /// Red on the left of `edge`, a blue of the same brightness on its right.
    fn two_colours(edge: usize, right: [u8; 3]) -> Vec<u8> {
        (0..SIDE * SIDE).flat_map(|k| if k % SIDE < edge { [200, 0, 0] } else { right }).collect()
    }

    #[test]
    fn brightness_is_that_of_the_pixels_and_colours_do_not_count() {
        // 0.299 * 200 = 59.8; 0.114 * 255 + 0.587 * 52 = 59.6
        let picture = grey_of_jpeg(&encoded(&two_colours(15, [0, 52, 255]), 100), SIZE).expect("a picture");
        assert_eq!((picture.width, picture.height), (SIDE, SIDE));
        assert!(picture.data.iter().all(|value| value.abs_diff(60) <= 1), "{:?}", &picture.data[..SIDE]);
        let picture = grey_of_jpeg(&encoded(&two_colours(15, [255; 3]), 100), SIZE).expect("a picture");
        for (k, value) in picture.data.iter().enumerate() {
            let wanted: u8 = if k % SIDE < 15 { 60 } else { 255 };
            assert!(value.abs_diff(wanted) <= 2, "{k}: {value}");
        }
    }

    #[test]
    fn what_is_no_such_picture_is_an_error() {
        let good = encoded(&two_colours(9, [0; 3]), 80);
        assert!(grey_of_jpeg(&good, SIZE).is_ok());
        assert!(grey_of_jpeg(&good, [SIDE as u32, SIDE as u32 - 1]).is_err(), "larger than it may be");
        assert!(grey_of_jpeg(&good[..20], SIZE).is_err());
        assert!(grey_of_jpeg(&[], SIZE).is_err());
        let mut cmyk = Vec::new();
        let pixels = vec![90; 4 * SIDE * SIDE];
        Encoder::new(&mut cmyk, 80).encode(&pixels, SIDE as u16, SIDE as u16, ColorType::Cmyk).expect("encoded");
        insta::assert_snapshot!("no_brightness", grey_of_jpeg(&cmyk, SIZE).expect_err("refused"));
    }
}
