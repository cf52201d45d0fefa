//! Candidate tags from the AprilTag project's C library, in the image as it is and in its contrast-normalized copy.

use apriltag::{Detector, Family, Image};
use armcal_core::optics::TagFamily;

use crate::contrast::ContrastNormalizer;
use crate::error::DetectError;
use crate::image::GreyImage;

/// The library has pixel centres at halves.
const CENTER_SHIFT_PX: f64 = 0.5;
/// Fixed, so that the result does not depend on the machine. Two threads are no faster: the library starts them for
/// each image.
const LIBRARY_THREADS: u8 = 1;
/// Rows of the library's images are padded to a multiple of this many bytes.
const ALIGNMENT: usize = 96;

/// A decoded quadrilateral before it is fitted.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub id: u32,
    pub hamming: usize,
    pub decision_margin: f64,
    pub corners_px: [[f64; 2]; 4],
}

/// The library with its two images.
#[derive(Debug)]
pub(crate) struct QuadDecoder {
    library: Detector,
    image: Image,
    normalized: Image,
    normalizer: ContrastNormalizer,
}

impl QuadDecoder {
    /// Decodes tags of `family` with as many wrong bits as its codes can bear. The gates reject those with more than
    /// the settings allow.
    pub(crate) fn new(family: TagFamily, [width, height]: [usize; 2]) -> Result<Self, DetectError> {
        let library_error = |error: apriltag::Error| DetectError::Library(error.to_string());
        let mut library = Detector::builder()
            .add_family_bits(library_family(family), corrected_bits(family))
            .build()
            .map_err(library_error)?;
        library.set_thread_number(LIBRARY_THREADS);
        library.set_refine_edges(true);
        let blank = || Image::zeros_with_alignment(width, height, ALIGNMENT).map_err(library_error);
        Ok(Self { library, image: blank()?, normalized: blank()?, normalizer: ContrastNormalizer::default() })
    }

    /// Returns the candidates in the image without contrast normalization.
    pub(crate) fn decode(&mut self, image: &GreyImage, decimation: f32) -> Vec<Candidate> {
        self.load(image);
        decode(&mut self.library, &self.image, decimation)
    }

    /// Returns the candidates like [`Self::decode`]; a second thread normalizes the contrast meanwhile.
    pub(crate) fn decode_and_normalize(&mut self, image: &GreyImage, decimation: f32) -> Vec<Candidate> {
        self.load(image);
        let Self { library, image: buffer, normalized, normalizer } = self;
        let stride = normalized.stride();
        let normalized = normalized.as_slice_mut();
        std::thread::scope(|scope| {
            scope.spawn(|| normalizer.normalize(image.data, image.width, normalized, stride));
            decode(library, buffer, decimation)
        })
    }

    /// Returns the candidates in the normalized image of the last [`Self::decode_and_normalize`].
    pub(crate) fn decode_normalized(&mut self, decimation: f32) -> Vec<Candidate> {
        decode(&mut self.library, &self.normalized, decimation)
    }

    fn load(&mut self, image: &GreyImage) {
        let stride = self.image.stride();
        let rows = self.image.as_slice_mut().chunks_exact_mut(stride);
        for (row, line) in rows.zip(image.data.chunks_exact(image.width)) {
            row[..image.width].copy_from_slice(line);
        }
    }
}

pub(crate) fn library_family(family: TagFamily) -> Family {
    match family {
        TagFamily::Tag16h5 => Family::tag_16h5(),
        TagFamily::Tag25h9 => Family::tag_25h9(),
        TagFamily::Tag36h11 => Family::tag_36h11(),
        TagFamily::Circle21h7 => Family::tag_circle_21h7(),
        TagFamily::Circle49h12 => Family::tag_circle_49h12(),
        TagFamily::Custom48h12 => Family::tag_custom_48h12(),
        TagFamily::Standard41h12 => Family::tag_standard_41h12(),
        TagFamily::Standard52h13 => Family::tag_standard_52h13(),
    }
}

/// Number of wrong code bits that may be corrected. A random quadrilateral passes for a tag with the probability `4 *
/// tags * codes within reach / 2^bits`: 0.2 % for 16h5 (25 % with two bits), 0.1 % for 25h9, 0.002 % for 36h11, 0.2 %
/// for Circle21h7, below 1e-6 for the others. For each code within reach, the library's table has three entries of 16
/// bytes: for the large families about 150 MB with one bit, and gigabytes with two.
pub(crate) fn corrected_bits(family: TagFamily) -> usize {
    match family {
        TagFamily::Tag16h5 => 0,
        TagFamily::Tag25h9 | TagFamily::Tag36h11 => 2,
        TagFamily::Circle21h7
        | TagFamily::Circle49h12
        | TagFamily::Custom48h12
        | TagFamily::Standard41h12
        | TagFamily::Standard52h13 => 1,
    }
}

/// Candidates by id and position: the library's own order is that of its hash tables.
fn decode(library: &mut Detector, image: &Image, decimation: f32) -> Vec<Candidate> {
    library.set_decimation(decimation);
    let detections = library.detect(image);
    let mut candidates: Vec<Candidate> = detections
        .iter()
        .filter_map(|detection| {
            Some(Candidate {
                id: u32::try_from(detection.id()).ok()?,
                hamming: detection.hamming(),
                decision_margin: f64::from(detection.decision_margin()),
                corners_px: detection.corners().map(|corner| corner.map(|x| x - CENTER_SHIFT_PX)),
            })
        })
        .filter(|candidate| candidate.corners_px.iter().flatten().all(|x| x.is_finite()))
        .collect();
    candidates.sort_by(|a, b| {
        let by_position = a.corners_px[0].iter().zip(&b.corners_px[0]).map(|(x, y)| x.total_cmp(y));
        by_position.fold(a.id.cmp(&b.id), std::cmp::Ordering::then)
    });
    candidates
}
