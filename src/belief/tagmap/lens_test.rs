//! Test of the stated lenses against the corners.

use crate::checks::constants::drawing_report::MAX_REPAIR_SIGMAS;
use crate::explain::wrong_input::lens::readings;
use crate::say::map_refusal::{MapRefusal, MapRefusalCause};
use crate::say::refusal::Refusal;
use crate::say::wrong_input::WrongInputKind;
use crate::tagmap::blind::{Blind, Misfit};
use crate::tagmap::constants::lens_fit::PER_CAMERA;
use crate::tagmap::constants::lens_test::{
    AS_GOOD, FOCAL_STRIDE, LEFT_SHARE, MAX_ROUNDS, MAX_STARTS, MIN_GAIN_NATS, MIN_USED_SHARE, MUCH_BETTER, NOISY,
    SURE_SIGMAS, WORTH_A_ROUND,
};
use crate::tagmap::lens_fit::{fit_lenses, lens_errors};
use crate::tagmap::types::MapSettings;
use armcal_core::optics::CameraModel;

/// Lenses that fit better than the stated ones.
pub(super) struct OtherLenses {
    /// The reading, if the lenses are another reading of the stated ones; `None` if they are these with other figures.
    reading: Option<WrongInputKind>,
    pub(super) lenses: Vec<CameraModel>,
    misfit: Misfit,
    stated: Misfit,
    /// One sigma of the focal length of each lens, relative.
    pub(super) focal_std: Vec<f64>,
    /// Log evidence over the stated lenses.
    pub(super) gain_nats: f64,
}

/// Lenses fitted from one start.
struct Fitted {
    reading: Option<WrongInputKind>,
    lenses: Vec<CameraModel>,
    misfit: Misfit,
}

/// Returns the lenses that explain the corners significantly better than the stated ones; `None` if there are none.
pub(super) fn other_lenses(blind: &Blind, stated: &[CameraModel]) -> Option<OtherLenses> {
    let as_stated = Misfit::of(&blind.solved(stated)?);
    let mut best = fitted(blind, None, stated.to_vec())?;
    if as_stated.variance.sqrt() > NOISY {
        let starts = starts(blind, stated);
        for start in starts.iter().take(MAX_STARTS) {
            let other = fitted(blind, Some(start.reading.clone()), start.lenses.clone());
            best = other.filter(|other| other.is_much_better(&best)).unwrap_or(best);
        }
        // A reading without fitted figures is the simpler cause.
        if let Some(simple) = starts.into_iter().find(|start| start.rank < AS_GOOD * best.misfit.rank()) {
            best.reading = Some(simple.reading);
        }
    }
    let n = (PER_CAMERA * stated.len()) as f64;
    let gain_nats = best.misfit.gain_over(&as_stated) - 0.5 * n * (as_stated.freedom as f64).ln();
    let is_of_as_many = best.misfit.n_used as f64 >= MIN_USED_SHARE * as_stated.n_used as f64;
    let is_large = best.misfit.variance < LEFT_SHARE * as_stated.variance;
    if !(is_of_as_many && is_large && gain_nats > MIN_GAIN_NATS) {
        return None;
    }
    let errors = lens_errors(&blind.solved(&best.lenses)?.problem)?;
    let focal_std = best.lenses.iter().enumerate().map(|(idx, lens)| {
        let at = PER_CAMERA * idx;
        errors.covariance[(at, at)].max(0.0).sqrt() / lens.focal_px()[0]
    });
    let focal_std = focal_std.collect();
    Some(OtherLenses {
        reading: best.reading.filter(|reading| !matches!(reading, WrongInputKind::FocalLength(_))),
        lenses: best.lenses,
        misfit: best.misfit,
        stated: as_stated,
        focal_std,
        gain_nats,
    })
}

/// Another reading of the lenses, and its misfit without a fit of figures.
struct Start {
    rank: f64,
    reading: WrongInputKind,
    lenses: Vec<CameraModel>,
}

impl Fitted {
    fn is_much_better(&self, other: &Self) -> bool {
        self.misfit.rank() < MUCH_BETTER * other.misfit.rank()
    }
}

/// Other readings of the lenses, sorted by misfit without a fit of figures, best first.
fn starts(blind: &Blind, stated: &[CameraModel]) -> Vec<Start> {
    let mut of_each = stated.iter().map(readings);
    let Some(of_first) = of_each.next() else { return Vec::new() };
    let mut all: Vec<(WrongInputKind, Vec<CameraModel>)> =
        of_first.into_iter().map(|(reading, lens)| (reading, vec![lens])).collect();
    for of_other in of_each {
        all.iter_mut().zip(of_other).for_each(|((_, lenses), (_, lens))| lenses.push(lens));
    }
    let is_focal = |(reading, _): &(WrongInputKind, _)| matches!(reading, WrongInputKind::FocalLength(_));
    let (focal, mut all): (Vec<_>, Vec<_>) = all.into_iter().partition(is_focal);
    all.extend(focal.into_iter().step_by(FOCAL_STRIDE));
    all.retain(|(reading, _)| *reading != WrongInputKind::Distortion);
    let ranked = all.into_iter().filter_map(|(reading, lenses)| {
        let rank = Misfit::of(&blind.solved(&lenses)?).rank();
        Some(Start { rank, reading, lenses })
    });
    let mut ranked: Vec<Start> = ranked.collect();
    ranked.sort_by(|a, b| a.rank.total_cmp(&b.rank));
    ranked
}

/// Fits lenses from these, alternately with the map and the selection of detections.
fn fitted(blind: &Blind, reading: Option<WrongInputKind>, lenses: Vec<CameraModel>) -> Option<Fitted> {
    let at = |lenses: &[CameraModel]| {
        let solved = blind.solved(lenses)?;
        Some((Misfit::of(&solved), fit_lenses(&solved.problem)))
    };
    let (mut misfit, mut next) = at(&lenses)?;
    let mut best = lenses;
    for _ in 0..MAX_ROUNDS {
        let Some(lenses) = next else { break };
        let Some((of_next, after)) = at(&lenses) else { break };
        if of_next.rank() > WORTH_A_ROUND * misfit.rank() {
            // The present lenses may still be the minimum for this selection of detections.
            if of_next.rank() < misfit.rank() {
                (best, misfit) = (lenses, of_next);
            }
            break;
        }
        (best, misfit, next) = (lenses, of_next, after);
    }
    Some(Fitted { reading, lenses: best, misfit })
}

impl OtherLenses {
    /// Reason why no map is made with lenses that are not the stated ones.
    pub(super) fn refusal(&self, stated: &[CameraModel], settings: &MapSettings) -> Option<MapRefusal> {
        let of_reading = self.reading.clone().map(|reading| MapRefusalCause::OtherLens {
            reading,
            rms_px: self.misfit.rms_px(settings),
            stated_rms_px: self.stated.rms_px(settings),
        });
        let of_focal = || (0..stated.len()).find_map(|camera| self.far_focal(camera, stated, settings.focal_std));
        let cause = of_reading.or_else(|| of_focal().map(MapRefusalCause::OfCalibration))?;
        Some(MapRefusal { cause, lens_file: settings.lens_file.clone() })
    }

    /// Refusal of a focal length beyond the limit of a calibration's repair.
    fn far_focal(&self, number: usize, stated: &[CameraModel], stated_std: f64) -> Option<Refusal> {
        let (found, std) = (self.lenses[number].focal_px(), self.focal_std[number]);
        let of_axis = |axis: usize| found[axis] / stated[number].focal_px()[axis];
        let ratio = (of_axis(0) * of_axis(1)).sqrt();
        let most_sigmas = MAX_REPAIR_SIGMAS;
        ((ratio - 1.0).abs() > most_sigmas * stated_std + SURE_SIGMAS * std).then(|| Refusal::Lens {
            camera: (stated.len() > 1).then(|| (number + 1).to_string()),
            ratio,
            std,
            stated_std,
            most_sigmas,
            focal_px: found,
        })
    }
}

impl Misfit {
    /// Root mean square error of a corner in each direction, px.
    fn rms_px(&self, settings: &MapSettings) -> f64 {
        self.variance.sqrt() * settings.corner_std_px
    }
}
