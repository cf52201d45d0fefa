//! Grey pictures of recorded images.

use std::borrow::Cow;
use std::io::Cursor;

use armcal_core::input::{ImageProblem, RecordedImage};
use armcal_core::log::ros::{CompressedImage, Image};
use armcal_detect::grey_of_jpeg;
use image::{ImageFormat, ImageReader, Limits};

/// Encodings of `sensor_msgs/msg/Image` that are read.
const ENCODINGS: &str = "mono8, 8UC1, rgb8, bgr8, rgba8, bgra8 and bayer_*8";
/// Largest memory for decoding one picture, bytes: the largest picture that a lens allows, in 16 bits of four channels.
const MAX_DECODED_BYTES: u64 = 1 << 30;
/// Number of pixels that every compressed image may have; `MAX_PIXELS_PER_BYTE` is the number per byte beyond that.
/// JPEGs of dark water have 30 pixels per byte; the search for tags takes 13 bytes of memory for each pixel.
/// byte; the search for tags takes 13 bytes of memory for each pixel.
const ALWAYS_ALLOWED_PIXELS: u64 = 3_000_000;
const MAX_PIXELS_PER_BYTE: u64 = 32;
/// First bytes of a PNG; bytes of a chunk next to its data: length, name and checksum.
const PNG_MAGIC_BYTES: usize = 8;
const PNG_CHUNK_BYTES: usize = 12;
/// PNG chunks that affect pixels. Texts and profiles may unpack to any size.
const PNG_CHUNKS: [&[u8]; 5] = [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"];

/// Grey values row by row, one for each pixel of the camera's resolution.
pub(super) fn grey(image: &RecordedImage, resolution_px: [u32; 2]) -> Result<Vec<u8>, ImageProblem> {
    match image {
        RecordedImage::Raw(image) => raw(image, resolution_px),
        RecordedImage::Compressed(image) => compressed(image, resolution_px),
    }
}

fn check_resolution(found: [u32; 2], wanted: [u32; 2]) -> Result<(), ImageProblem> {
    if found == wanted {
        return Ok(());
    }
    let ([width, height], [lens_width, lens_height]) = (found, wanted);
    let todo = match factor(found, wanted) {
        Some(factor) => format!(
            "the images are {factor} times as large: in [camera] of robot.toml, set resolution_px = [{width}, \
             {height}], multiply focal_px by {factor} and make each number c of center_px (c + 0.5) * {factor} - \
             0.5; or name their own tags.camera_info"
        ),
        None => "state the lens of these images in robot.toml, or name their own tags.camera_info".to_owned(),
    };
    Err(ImageProblem::Unusable(format!(
        "the image has {width} x {height} pixels, the camera's lens {lens_width} x {lens_height}; {todo}"
    )))
}

/// The factor between two sizes of the same shape.
fn factor(found: [u32; 2], wanted: [u32; 2]) -> Option<f64> {
    let [a, b]: [f64; 2] = std::array::from_fn(|k| f64::from(found[k]) / f64::from(wanted[k].max(1)));
    // Rounded sizes may differ by a pixel.
    let rounding = 1.0 / f64::from(wanted[0].min(wanted[1]).max(1));
    ((a - b).abs() <= rounding).then(|| (1e4 * a).round() / 1e4)
}

fn raw(image: &Image, resolution_px: [u32; 2]) -> Result<Vec<u8>, ImageProblem> {
    check_resolution([image.width, image.height], resolution_px)?;
    let (width, height, step) = (image.width as usize, image.height as usize, image.step as usize);
    // Weights of the channels in 1/1000, as in OpenCV's cvtColor.
    let (n_channels, weights): (usize, &[u32]) = match image.encoding.as_str() {
        "rgb8" | "8UC3" => (3, &[299, 587, 114]),
        "bgr8" => (3, &[114, 587, 299]),
        "rgba8" => (4, &[299, 587, 114]),
        "bgra8" => (4, &[114, 587, 299]),
        "mono8" | "8UC1" | "bayer_rggb8" | "bayer_bggr8" | "bayer_gbrg8" | "bayer_grbg8" => (1, &[1000]),
        other => {
            return Err(ImageProblem::Unusable(format!("the image is encoded as {other:?}; armcal reads {ENCODINGS}")));
        }
    };
    if step < width * n_channels || step.checked_mul(height).is_none_or(|n| n > image.data.len()) {
        return Err(ImageProblem::Damaged);
    }
    let pixel = |channels: &[u8]| {
        let sum: u32 = channels.iter().zip(weights).map(|(value, weight)| u32::from(*value) * weight).sum();
        ((sum + 500) / 1000) as u8
    };
    let rows = image.data.chunks_exact(step).take(height);
    let grey: Vec<u8> = rows.flat_map(|row| row[..width * n_channels].chunks_exact(n_channels).map(pixel)).collect();
    Ok(if image.encoding.starts_with("bayer") { without_mosaic(&grey, width) } else { grey })
}

/// A Bayer mosaic as grey, by the binomial mean over 3 x 3 pixels. It has each colour with the same weight at every
/// place, one red, two green, one blue, and moves no edge. Rows and columns beyond the edge are mirrored.
fn without_mosaic(mosaic: &[u8], width: usize) -> Vec<u8> {
    let height = mosaic.len() / width;
    let mirrored = |at: isize, n: usize| {
        let last = n as isize - 1;
        (if at < 0 {
            -at
        } else if at > last {
            2 * last - at
        } else {
            at
        })
        .clamp(0, last) as usize
    };
    let mean = |x: usize, y: usize| {
        let mut sum = 8;
        for (dy, wy) in [(-1, 1), (0, 2), (1, 1)] {
            let row = mirrored(y as isize + dy, height) * width;
            for (dx, wx) in [(-1, 1), (0, 2), (1, 1)] {
                sum += wx * wy * u32::from(mosaic[row + mirrored(x as isize + dx, width)]);
            }
        }
        (sum / 16) as u8
    };
    (0..mosaic.len()).map(|k| mean(k % width, k / width)).collect()
}

/// Decodes a compressed image. Its bytes show whether it is PNG or JPEG, because `format` has many spellings.
fn compressed(image: &CompressedImage, resolution_px: [u32; 2]) -> Result<Vec<u8>, ImageProblem> {
    let format = match image::guess_format(&image.data) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => format,
        Err(_) if image.format.contains("jpeg") || image.format.contains("png") => return Err(ImageProblem::Damaged),
        _ => {
            let problem = format!("the image is compressed as {:?}; armcal reads png and jpeg", image.format);
            return Err(ImageProblem::Unusable(problem));
        }
    };
    let bytes =
        if format == ImageFormat::Png { Cow::Owned(png_pixels(&image.data)) } else { Cow::Borrowed(&image.data[..]) };
    let reader = || ImageReader::with_format(Cursor::new(&bytes), format);
    let (width, height) = reader().into_dimensions().map_err(|_| ImageProblem::Damaged)?;
    check_resolution([width, height], resolution_px)?;
    check_compression([width, height], bytes.len())?;
    // Grey as the simulator's camera has it; else (RGB, CMYK) from the colours.
    if format == ImageFormat::Jpeg
        && let Ok(picture) = grey_of_jpeg(&bytes, resolution_px)
    {
        return Ok(picture.data);
    }
    let mut reader = reader();
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(width), Some(height));
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    reader.limits(limits);
    Ok(reader.decode().map_err(|_| ImageProblem::Damaged)?.into_luma8().into_raw())
}

/// Rejects an image with too many pixels per byte. Only an image without content compresses so well, so skipping it
/// costs no tag.
fn check_compression([width, height]: [u32; 2], bytes: usize) -> Result<(), ImageProblem> {
    let allowed = (bytes as u64).saturating_mul(MAX_PIXELS_PER_BYTE).saturating_add(ALWAYS_ALLOWED_PIXELS);
    if u64::from(width) * u64::from(height) <= allowed { Ok(()) } else { Err(ImageProblem::TooFewBytes) }
}

/// The PNG without chunks that its pixels do not need.
fn png_pixels(data: &[u8]) -> Vec<u8> {
    let (magic, mut rest) = data.split_at(PNG_MAGIC_BYTES.min(data.len()));
    let mut kept = magic.to_vec();
    while let Some((length, _)) = rest.split_first_chunk::<4>() {
        let length = PNG_CHUNK_BYTES.saturating_add(u32::from_be_bytes(*length) as usize);
        let (chunk, after) = rest.split_at(length.min(rest.len()));
        if chunk.get(4..8).is_some_and(|name| PNG_CHUNKS.contains(&name)) {
            kept.extend_from_slice(chunk);
        }
        rest = after;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [6, 4];

    fn image(encoding: &str, n_channels: usize, fill: impl Fn(usize, usize) -> Vec<u8>) -> RecordedImage {
        // Rows are padded, as by some drivers.
        let step = 6 * n_channels + 2;
        let row = |y: usize| (0..6).flat_map(|x| fill(x, y)).chain([7, 7]).collect::<Vec<u8>>();
        let data = (0..4).flat_map(row).collect();
        let (encoding, step) = (encoding.to_owned(), step as u32);
        RecordedImage::Raw(Image { height: 4, width: 6, encoding, step, data, ..Image::default() })
    }

    #[test]
    fn encodings_become_grey() {
        let mono: Vec<u8> = (0..24).map(|k| (10 * k) as u8).collect();
        let plain = grey(&image("mono8", 1, |x, y| vec![(10 * (6 * y + x)) as u8]), SIZE).expect("mono8");
        assert_eq!(plain, mono);
        // 0.299 * 200 + 0.587 * 100 + 0.114 * 50 = 124.2
        let (rgb, bgr) = (vec![200, 100, 50], vec![50, 100, 200]);
        assert_eq!(grey(&image("rgb8", 3, |_, _| rgb.clone()), SIZE).expect("rgb8"), [124; 24]);
        assert_eq!(grey(&image("bgr8", 3, |_, _| bgr.clone()), SIZE).expect("bgr8"), [124; 24]);
        let bgra: Vec<u8> = [&bgr[..], &[9]].concat();
        assert_eq!(grey(&image("bgra8", 4, |_, _| bgra.clone()), SIZE).expect("bgra8"), [124; 24]);
    }

    #[test]
    fn a_mosaic_of_one_colour_is_even_and_an_edge_stays_where_it_is() {
        // Red 200, green 100, blue 40: the mean is (200 + 2 * 100 + 40) / 4.
        let colour = |x: usize, y: usize| match (x % 2, y % 2) {
            (0, 0) => 200,
            (1, 1) => 40,
            _ => 100,
        };
        let flat = grey(&image("bayer_rggb8", 1, |x, y| vec![colour(x, y)]), SIZE).expect("bayer");
        assert_eq!(flat, [110; 24]);
        let edge = grey(&image("bayer_bggr8", 1, |x, _| vec![if x < 3 { 0 } else { 160 }]), SIZE).expect("bayer");
        assert_eq!(edge[6..12], [0, 0, 40, 120, 160, 160]);
    }

    #[test]
    fn pictures_are_decoded_and_bad_ones_are_told_apart() {
        let pixels: Vec<u8> = (0..24).map(|k| (10 * k) as u8).collect();
        let mut png = Vec::new();
        image::GrayImage::from_raw(6, 4, pixels.clone())
            .expect("a picture")
            .write_to(&mut Cursor::new(&mut png), ImageFormat::Png)
            .expect("written");
        let compressed = |format: &str, data: &[u8]| {
            RecordedImage::Compressed(CompressedImage {
                format: format.to_owned(),
                data: data.to_vec(),
                ..CompressedImage::default()
            })
        };
        assert_eq!(grey(&compressed("mono8; png compressed ", &png), SIZE).expect("a png"), pixels);
        assert_eq!(grey(&compressed("png", &png[..png.len() / 2]), SIZE), Err(ImageProblem::Damaged));
        assert_eq!(grey(&compressed("png", &[1, 2, 3]), SIZE), Err(ImageProblem::Damaged));
        let unusable = |image: &RecordedImage, size| match grey(image, size) {
            Err(ImageProblem::Unusable(why)) => why,
            other => panic!("{other:?}"),
        };
        let told = [
            unusable(&compressed("png", &png), [6, 5]),
            unusable(&compressed("h264", &[1, 2, 3]), SIZE),
            unusable(&image("mono16", 2, |_, _| vec![0, 0]), SIZE),
        ];
        insta::assert_snapshot!("unusable_images", told.join("\n"));
        let RecordedImage::Raw(mut short) = image("mono8", 1, |_, _| vec![0]) else { panic!("raw") };
        short.data.pop();
        assert_eq!(grey(&RecordedImage::Raw(short), SIZE), Err(ImageProblem::Damaged));
    }

    fn flat_png(side: u32) -> Vec<u8> {
        let mut png = Vec::new();
        let picture = image::GrayImage::from_pixel(side, side, image::Luma([90]));
        picture.write_to(&mut Cursor::new(&mut png), ImageFormat::Png).expect("written");
        png
    }

    #[test]
    fn an_image_of_more_pixels_than_its_bytes_hold_is_not_decoded() {
        let mut image = CompressedImage { data: flat_png(2000), ..CompressedImage::default() };
        // A truncated image would fail to decode.
        image.data.truncate(200);
        assert_eq!(compressed(&image, [2000; 2]), Err(ImageProblem::TooFewBytes));
    }

    #[test]
    fn chunks_without_pixels_are_not_read() {
        let whole = flat_png(6);
        let head = PNG_MAGIC_BYTES + PNG_CHUNK_BYTES + 13;
        // Neither the checksum nor the data of these chunks would pass.
        let chunks = [b"iCCP", b"zTXt", b"iTXt", b"eXIf"].map(|name| [&[0, 0, 0, 3], &name[..], &[9; 7]].concat());
        let data = [&whole[..head], &chunks.concat(), &whole[head..]].concat();
        assert_eq!(png_pixels(&data), whole);
        let image = CompressedImage { data, ..CompressedImage::default() };
        assert_eq!(compressed(&image, [6; 2]).expect("a picture"), [90; 36]);
    }
}
