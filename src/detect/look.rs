//! What the C library decodes: once in the image as it is, once with its contrast evened out.

use apriltag::{Detector, Family, Image};

use super::GreyImage;
use super::contrast::ContrastNormalizer;
use super::detector::DetectError;
use super::judge::Candidate;

/// The library decodes with up to so many wrong bits, so that those with too many are rejected by name.
const DECODED_WRONG_BITS: usize = 2;
/// Its pixel centres are at halves.
const CENTER_SHIFT_PX: f64 = 0.5;
/// A fixed number: what it finds must not depend on the machine. Two are no faster: it starts them anew for each image.
const LIBRARY_THREADS: u8 = 1;
/// Rows of its images are padded to this many bytes.
const ALIGNMENT: usize = 96;

/// The library with its two images.
#[derive(Debug)]
pub(super) struct QuadDecoder {
    library: Detector,
    image: Image,
    evened: Image,
    evener: ContrastNormalizer,
}

impl QuadDecoder {
    pub(super) fn new([width, height]: [usize; 2]) -> Result<Self, DetectError> {
        let library_error = |error: apriltag::Error| DetectError::Library(error.to_string());
        let mut library = Detector::builder()
            .add_family_bits(Family::tag_36h11(), DECODED_WRONG_BITS)
            .build()
            .map_err(library_error)?;
        library.set_thread_number(LIBRARY_THREADS);
        library.set_refine_edges(true);
        let blank = || Image::zeros_with_alignment(width, height, ALIGNMENT).map_err(library_error);
        Ok(Self { library, image: blank()?, evened: blank()?, evener: ContrastNormalizer::default() })
    }

    /// At the image as it is. Where a second look follows, the contrast is evened meanwhile.
    pub(super) fn first(&mut self, image: &GreyImage, decimation: f32, is_second_wanted: bool) -> Vec<Candidate> {
        let stride = self.image.stride();
        let rows = self.image.as_slice_mut().chunks_exact_mut(stride);
        for (row, line) in rows.zip(image.data.chunks_exact(image.width)) {
            row[..image.width].copy_from_slice(line);
        }
        let Self { library, image: buffer, evened, evener } = self;
        let stride = evened.stride();
        let evened = evened.as_slice_mut();
        std::thread::scope(|scope| {
            if is_second_wanted {
                scope.spawn(|| evener.even(image.data, image.width, evened, stride));
            }
            decode(library, buffer, decimation)
        })
    }

    /// At the evened image, after [`Self::first`] with `is_second_wanted`.
    pub(super) fn second(&mut self, decimation: f32) -> Vec<Candidate> {
        decode(&mut self.library, &self.evened, decimation)
    }
}

/// By id and place: the library's own order is that of its hash tables.
fn decode(library: &mut Detector, image: &Image, decimation: f32) -> Vec<Candidate> {
    library.set_decimation(decimation);
    let found = library.detect(image);
    let mut candidates: Vec<Candidate> = found
        .iter()
        .filter_map(|found| {
            Some(Candidate {
                id: u32::try_from(found.id()).ok()?,
                hamming: found.hamming(),
                decision_margin: f64::from(found.decision_margin()),
                corners_px: found.corners().map(|corner| corner.map(|x| x - CENTER_SHIFT_PX)),
            })
        })
        .filter(|candidate| candidate.corners_px.iter().flatten().all(|x| x.is_finite()))
        .collect();
    candidates.sort_by(|a, b| {
        let by_place = a.corners_px[0].iter().zip(&b.corners_px[0]).map(|(x, y)| x.total_cmp(y));
        by_place.fold(a.id.cmp(&b.id), std::cmp::Ordering::then)
    });
    candidates
}
