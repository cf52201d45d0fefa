//! The detector: quadrilaterals from the C library, corners from the fit, and the two judged.

use nalgebra::Matrix2;

use super::bearings::BearingTable;
use super::fit::{Fit, Fitter};
use super::judge::{Candidate, DetectorSettings, are_nested, gate_fit, judge_candidate};
use super::look::QuadDecoder;
use super::pattern::Cells;
use super::{Detected, DetectedTag, GreyImage};
use armcal_core::optics::{Fisheye, tag36h11};
use armcal_core::streams::{DetectionReject, RejectReason, TagDetection};

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DetectError {
    #[error("the image holds {bytes} bytes, not {width} x {height}")]
    Size { bytes: usize, width: usize, height: usize },
    #[error("the image is {width} x {height} pixels, the lens's is {lens_width} x {lens_height}")]
    Resolution { width: usize, height: usize, lens_width: usize, lens_height: usize },
    #[error("the library that looks for tags: {0}")]
    Library(String),
}

/// Finds tags in images of one camera. The same image gives the same result.
#[derive(Debug)]
pub struct TagDetector {
    looker: QuadDecoder,
    refiner: Refiner,
}

/// Corners of what was decoded.
#[derive(Debug)]
struct Refiner {
    lens: Fisheye,
    settings: DetectorSettings,
    table: BearingTable,
    fitter: Fitter,
}

/// A tag, or why not, and the corners that it was started from.
type Refined = Result<DetectedTag, (RejectReason, [[f64; 2]; 4])>;

impl TagDetector {
    /// `lens` as belief knows it.
    ///
    /// # Errors
    /// [`DetectError::Library`] if the C library cannot start.
    pub fn new(lens: &Fisheye, settings: DetectorSettings) -> Result<Self, DetectError> {
        let looker = QuadDecoder::new(lens.resolution_px.map(|n| n as usize))?;
        let refiner = Refiner { lens: *lens, settings, table: BearingTable::new(lens), fitter: Fitter::new() };
        Ok(Self { looker, refiner })
    }

    /// Looks for tags in an image. While the library takes its second look, what the first one found is fitted.
    ///
    /// # Errors
    /// [`DetectError`] for an image that is not of the lens's resolution.
    pub fn detect(&mut self, image: GreyImage) -> Result<Detected, DetectError> {
        self.check(&image)?;
        let Self { looker, refiner } = self;
        let (decimation, second) = (refiner.settings.decimation, refiner.settings.second_decimation);
        let first = looker.first(&image, decimation, second > 0.0);
        let mut refined: Vec<Refined> = Vec::with_capacity(first.len());
        let second = if second > 0.0 {
            std::thread::scope(|scope| {
                scope.spawn(|| refined.extend(first.iter().map(|candidate| refiner.refine(&image, candidate))));
                looker.second(second)
            })
        } else {
            refined.extend(first.iter().map(|candidate| refiner.refine(&image, candidate)));
            Vec::new()
        };
        let mut out = Detected::default();
        for (candidate, result) in first.iter().zip(refined) {
            take(&mut out, candidate, result);
        }
        for candidate in &second {
            // A second look sees most tags again.
            if !out.tags.iter().any(|tag| is_same(candidate, tag.detection.id, &tag.detection.corners_px)) {
                take(&mut out, candidate, refiner.refine(&image, candidate));
            }
        }
        reject_doubles(&mut out);
        Ok(out)
    }

    fn check(&self, image: &GreyImage) -> Result<(), DetectError> {
        let GreyImage { width, height, data } = *image;
        if Some(data.len()) != width.checked_mul(height) {
            return Err(DetectError::Size { bytes: data.len(), width, height });
        }
        let [lens_width, lens_height] = self.refiner.lens.resolution_px.map(|n| n as usize);
        if [width, height] != [lens_width, lens_height] {
            return Err(DetectError::Resolution { width, height, lens_width, lens_height });
        }
        Ok(())
    }
}

impl Refiner {
    fn refine(&mut self, image: &GreyImage, candidate: &Candidate) -> Refined {
        let start_px = candidate.corners_px;
        judge_candidate(&self.settings, &self.lens, candidate).map_err(|reason| (reason, start_px))?;
        let cells =
            tag36h11::cells(candidate.id).map(|cells| Cells::new(&cells)).ok_or((RejectReason::UnknownId, start_px))?;
        let fit = self.fitter.fit(image, &self.table, &cells, &start_px).ok_or((RejectReason::PoorEdges, start_px))?;
        gate_fit(&self.settings, &self.lens, &start_px, &fit).map_err(|reason| (reason, start_px))?;
        let detection =
            TagDetection { id: candidate.id, corners_px: fit.corners_px, decision_margin: candidate.decision_margin };
        Ok(DetectedTag { detection, covariances_px2: covariances_px2(&fit) })
    }
}

/// Whether a candidate is another reading of what stands at `corners_px`.
fn is_same(candidate: &Candidate, id: u32, corners_px: &[[f64; 2]; 4]) -> bool {
    id == candidate.id && are_nested(corners_px, &candidate.corners_px)
}

/// A reading that was believed replaces one that was not; of two that were not, the first is named.
fn take(out: &mut Detected, candidate: &Candidate, refined: Refined) {
    let rejected_before = out.rejects.iter().position(|r| is_same(candidate, r.id, &r.corners_px));
    match (refined, rejected_before) {
        (Ok(tag), before) => {
            before.map(|k| out.rejects.remove(k));
            out.tags.push(tag);
        }
        (Err((reason, corners_px)), None) => {
            out.rejects.push(DetectionReject { id: candidate.id, corners_px, reason });
        }
        (Err(_), Some(_)) => {}
    }
}

/// Residuals of snow, of light's shadows and of the model's own faults are alike in neighbouring pixels, which the normal matrix
/// takes for independent. Measured by `study detection`.
const CORRELATION: f64 = 1.5;
/// Variance of a corner that no image improves on, px2: what the pattern's model leaves out.
const FLOOR_PX2: f64 = 0.01 * 0.01;
/// The same for each px2 by which the blur is longer than wide: motion is no Gaussian. Measured.
const MOTION_FLOOR: f64 = 7e-4;

/// The fit's covariances with what it does not know of.
fn covariances_px2(fit: &Fit) -> [Matrix2<f64>; 4] {
    let floor = Matrix2::identity() * (FLOOR_PX2 + MOTION_FLOOR * fit.motion_px2);
    fit.covariances_px2.map(|c| c * CORRELATION + floor)
}

/// An id at two places: both go, unless one is a second reading of the same tag; then the surer one stays.
fn reject_doubles(out: &mut Detected) {
    let mut kept: Vec<DetectedTag> = Vec::with_capacity(out.tags.len());
    let mut twice: Vec<u32> = Vec::new();
    for tag in out.tags.drain(..) {
        let corners_px = tag.detection.corners_px;
        let other = kept.iter_mut().find(|other| other.detection.id == tag.detection.id);
        match other {
            None => kept.push(tag),
            Some(other) if are_nested(&other.detection.corners_px, &corners_px) => {
                if tag.detection.decision_margin > other.detection.decision_margin {
                    *other = tag;
                }
            }
            Some(_) => {
                let id = tag.detection.id;
                twice.push(id);
                out.rejects.push(DetectionReject { id, corners_px, reason: RejectReason::SeenTwice });
            }
        }
    }
    for tag in kept {
        let TagDetection { id, corners_px, .. } = tag.detection;
        if twice.contains(&id) {
            out.rejects.push(DetectionReject { id, corners_px, reason: RejectReason::SeenTwice });
        } else {
            out.tags.push(tag);
        }
    }
    out.tags.sort_by_key(|tag| tag.detection.id);
    out.rejects.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners_px[0][0].total_cmp(&b.corners_px[0][0])));
}
