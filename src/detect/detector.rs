//! The detector: candidates from the decoder, corners from the fit, gates on both, duplicates removed.

use nalgebra::Matrix2;

use crate::bearings::BearingTable;
use crate::decoder::{Candidate, QuadDecoder};
use crate::detection::{DetectedTag, ImageDetections};
use crate::duplicates::{Refined, add_or_replace, is_same_tag, reject_duplicate_ids};
use crate::error::DetectError;
use crate::fit::{Fit, Fitter};
use crate::gates::{gate_candidate, gate_fit};
use crate::image::GreyImage;
use crate::pattern::Cells;
use crate::settings::DetectorSettings;
use armcal_core::optics::CameraModel;
use armcal_core::streams::{RejectReason, TagDetection};

/// Finds tags in images of one camera. The same image gives the same result.
#[derive(Debug)]
pub struct TagDetector {
    decoder: QuadDecoder,
    refiner: Refiner,
}

/// Fits and gates candidates.
#[derive(Debug)]
struct Refiner {
    lens: CameraModel,
    settings: DetectorSettings,
    table: BearingTable,
    fitter: Fitter,
}

impl TagDetector {
    /// A detector for images of `lens`, as belief knows it.
    ///
    /// # Errors
    /// [`DetectError::Library`] if the C library cannot start.
    pub fn new(lens: &CameraModel, settings: DetectorSettings) -> Result<Self, DetectError> {
        let decoder = QuadDecoder::new(settings.family, lens.resolution_px().map(|n| n as usize))?;
        let refiner = Refiner { lens: *lens, settings, table: BearingTable::new(lens), fitter: Fitter::new() };
        Ok(Self { decoder, refiner })
    }

    /// Tags and rejected candidates of an image. A second thread fits the first pass's candidates during the second
    /// pass.
    ///
    /// # Errors
    /// [`DetectError`] for an image that is not of the lens's resolution.
    pub fn detect(&mut self, image: GreyImage) -> Result<ImageDetections, DetectError> {
        self.check(&image)?;
        let Self { decoder, refiner } = self;
        let (decimation, second_decimation) = (refiner.settings.decimation, refiner.settings.second_decimation);
        let has_second_pass = second_decimation > 0.0;
        let candidates = if has_second_pass {
            decoder.decode_and_normalize(&image, decimation)
        } else {
            decoder.decode(&image, decimation)
        };
        let mut refined: Vec<Refined> = Vec::with_capacity(candidates.len());
        let mut refine = || refined.extend(candidates.iter().map(|candidate| refiner.refine(&image, candidate)));
        let second_candidates = if has_second_pass {
            std::thread::scope(|scope| {
                scope.spawn(refine);
                decoder.decode_normalized(second_decimation)
            })
        } else {
            refine();
            Vec::new()
        };
        let mut out = ImageDetections::default();
        for (candidate, result) in candidates.iter().zip(refined) {
            add_or_replace(&mut out, candidate, result);
        }
        for candidate in &second_candidates {
            // The second pass finds most tags again.
            if !out.tags.iter().any(|tag| is_same_tag(candidate, tag.detection.id, &tag.detection.corners_px)) {
                add_or_replace(&mut out, candidate, refiner.refine(&image, candidate));
            }
        }
        reject_duplicate_ids(&mut out);
        Ok(out)
    }

    fn check(&self, image: &GreyImage) -> Result<(), DetectError> {
        let GreyImage { width, height, data } = *image;
        if Some(data.len()) != width.checked_mul(height) {
            return Err(DetectError::Size { bytes: data.len(), width, height });
        }
        let [lens_width, lens_height] = self.refiner.lens.resolution_px().map(|n| n as usize);
        if [width, height] != [lens_width, lens_height] {
            return Err(DetectError::Resolution { width, height, lens_width, lens_height });
        }
        Ok(())
    }
}

impl Refiner {
    fn refine(&mut self, image: &GreyImage, candidate: &Candidate) -> Refined {
        let start_px = candidate.corners_px;
        gate_candidate(&self.settings, &self.lens, candidate).map_err(|reason| (reason, start_px))?;
        let family = self.settings.family;
        let cells = family.cells(candidate.id).ok_or((RejectReason::UnknownId, start_px))?;
        let cells = Cells::new(family, &cells);
        let fit = self.fitter.fit(image, &self.table, &cells, &start_px).ok_or((RejectReason::PoorEdges, start_px))?;
        gate_fit(&self.settings, &self.lens, &start_px, &fit).map_err(|reason| (reason, start_px))?;
        let detection =
            TagDetection { id: candidate.id, corners_px: fit.corners_px, decision_margin: candidate.decision_margin };
        Ok(DetectedTag { detection, covariances_px2: covariances_px2(&fit) })
    }
}

/// Factor on the fit's covariances. Marine snow, shadows and model errors correlate the residuals of neighbouring
/// pixels, which the normal matrix assumes to be independent. Measured by `armcal-lab detection`.
const CORRELATION: f64 = 1.5;
/// Smallest variance of a corner, px2: errors of the pattern model.
const FLOOR_PX2: f64 = 0.01 * 0.01;
/// Increase of this variance per px2 of motion blur, because motion blur is not Gaussian. Measured.
const MOTION_FLOOR: f64 = 7e-4;

/// Corner covariances of the fit, inflated for model errors.
fn covariances_px2(fit: &Fit) -> [Matrix2<f64>; 4] {
    let floor = Matrix2::identity() * (FLOOR_PX2 + MOTION_FLOOR * fit.motion_px2);
    fit.covariances_px2.map(|c| c * CORRELATION + floor)
}
