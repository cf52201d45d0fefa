//! Detects tags in all PNG files of a folder: `image ms`, then ` id x0 y0 .. x3 y3` for each tag; pixel centres at
//! whole numbers.

use std::time::Instant;

use kornia_apriltag::family::TagFamilyKind;
use kornia_apriltag::{AprilTagDecoder, DecodeTagsConfig};
use kornia_image::{Image, ImageSize};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("a folder is missing")?;
    let factor: usize = std::env::args().nth(2).map_or(Ok(1), |text| text.parse())?;
    let mut files: Vec<_> = std::fs::read_dir(folder)?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "png"));
    files.sort();
    let mut decoder = None;
    for file in files {
        let grey = image::open(&file)?.to_luma8();
        let size = ImageSize { width: grey.width() as usize, height: grey.height() as usize };
        let image = Image::<u8, 1>::new(size, grey.into_raw())?;
        let decoder = match &mut decoder {
            Some(decoder) => decoder,
            empty => {
                let mut config = DecodeTagsConfig::new(vec![TagFamilyKind::Tag36H11])?;
                config.downscale_factor = factor;
                empty.insert(AprilTagDecoder::new(config, size)?)
            }
        };
        let start = Instant::now();
        let found = decoder.decode(&image)?;
        decoder.clear();
        let ms = 1e3 * start.elapsed().as_secs_f64();
        println!("{} {ms:.3}", file.file_name().ok_or("no name")?.to_string_lossy());
        for tag in found {
            print!(" {}", tag.id);
            for corner in tag.quad.corners {
                // It has pixel centres at halves, as the C library.
                print!(" {:.4} {:.4}", corner.x - 0.5, corner.y - 0.5);
            }
            println!();
        }
    }
    Ok(())
}
