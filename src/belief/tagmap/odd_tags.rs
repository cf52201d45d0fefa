//! Tags that contradict the others: of another size than stated, or moved during the recording.
//!
//! Each of these faults is a further unknown of the map (`columns`); the one with the largest gain is named.

use nalgebra::{DVector, Vector3};

use crate::say::map_words::{moved_meanwhile, odd_size};
use crate::tagmap::blind::{Misfit, loss_of};
use crate::tagmap::columns::{ByUnknown, Columns, Linearized};
use crate::tagmap::constants::odd_tags::{LEAST_MOVE_M, LEAST_SIZE, LEAST_TURN_RAD, MIN_GAIN_NATS, MIN_SIDE, PARTS};
use crate::tagmap::problem::Observation;
use crate::tagmap::solve::Solved;
use armcal_core::codes::{Code, Warning};
use armcal_core::spatial::adjoint;

/// Fault of an odd tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Oddity {
    /// Another size: true size over the stated one.
    Size(f64),
    /// A move: its distance and angle, and the number of all detections `n` that are before it.
    Moved { distance_m: f64, angle_rad: f64, n_before: usize, n: usize },
}

/// An odd tag, and its gain in evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OddTag {
    pub(super) id: u32,
    pub(super) oddity: Oddity,
    /// Log evidence over a map without it.
    pub(super) gain_nats: f64,
}

impl OddTag {
    pub(super) fn warning(&self) -> Warning {
        match self.oddity {
            Oddity::Size(factor) => Warning::new(Code::MapTagSize, odd_size(self.id, factor)),
            Oddity::Moved { distance_m, angle_rad, n_before, n } => {
                let text = moved_meanwhile(self.id, (distance_m, angle_rad), (n_before, n));
                Warning::new(Code::MapTagDisagrees, text)
            }
        }
    }

    /// Returns true if the fault is large enough to matter; smaller ones belong to any print and board.
    fn is_large(&self) -> bool {
        match self.oddity {
            Oddity::Size(factor) => (factor - 1.0).abs() > LEAST_SIZE,
            Oddity::Moved { distance_m, angle_rad, .. } => distance_m > LEAST_MOVE_M || angle_rad > LEAST_TURN_RAD,
        }
    }
}

/// Returns the odd tag with the largest gain, if one is significant.
pub(super) fn odd_tag(solved: &Solved<'_>) -> Option<OddTag> {
    let linearized = Linearized::of(&solved.problem, loss_of(solved))?;
    let misfit = Misfit::of(solved);
    let search = Search { solved, linearized, misfit };
    let of_tag = |tag: usize| search.of_size(tag).into_iter().chain(search.of_moves(tag));
    let all: Vec<OddTag> = (0..solved.problem.tags.len()).flat_map(of_tag).collect();
    let cost_of_choice = (all.len().max(1) as f64).ln();
    let best = all.into_iter().max_by(|a, b| a.gain_nats.total_cmp(&b.gain_nats))?;
    (best.gain_nats > MIN_GAIN_NATS + cost_of_choice && best.is_large()).then_some(best)
}

struct Search<'p, 'a> {
    solved: &'p Solved<'a>,
    linearized: Linearized<'p, 'a>,
    misfit: Misfit,
}

impl Search<'_, '_> {
    fn of_size(&self, tag: usize) -> Option<OddTag> {
        let by_size = Columns {
            n: 1,
            concerns: &|seen| seen.tag == tag,
            by_unknown: &|corner, k| {
                let arm = corner.camera_from_tag.rotation * corner.seen.corners_m[k];
                let moved = corner.image.by_point * arm;
                Some(ByUnknown::from_column_slice(moved.as_slice()))
            },
        };
        let (step, gain_nats) = self.explained(&by_size)?;
        let id = self.solved.problem.tags[tag].id;
        Some(OddTag { id, oddity: Oddity::Size(step[0].exp()), gain_nats })
    }

    /// Candidates for a move of the tag, after some parts of its detections.
    fn of_moves(&self, tag: usize) -> Vec<OddTag> {
        let seen = self.solved.problem.observations.iter().filter(|seen| seen.tag == tag && seen.is_used);
        let mut views: Vec<usize> = seen.map(|seen| seen.view).collect();
        views.sort_unstable();
        let n = views.len();
        let places = (1..PARTS).map(|part| part * n / PARTS).filter(|at| *at >= MIN_SIDE && n - at >= MIN_SIDE);
        places.filter_map(|at| self.of_move(tag, views[at], (at, n))).collect()
    }

    fn of_move(&self, tag: usize, from_view: usize, (n_before, n): (usize, usize)) -> Option<OddTag> {
        let by_move = Columns {
            n: 6,
            concerns: &|seen: &Observation| seen.tag == tag && seen.view >= from_view,
            by_unknown: &|corner, _| {
                let moved = corner.image.jacobian() * -adjoint(&corner.camera_from_tag);
                Some(ByUnknown::from_column_slice(moved.as_slice()))
            },
        };
        let (step, gain_nats) = self.explained(&by_move)?;
        let part = |first: usize| Vector3::new(step[first], step[first + 1], step[first + 2]).norm();
        let oddity = Oddity::Moved { distance_m: part(0), angle_rad: part(3), n_before, n };
        Some(OddTag { id: self.solved.problem.tags[tag].id, oddity, gain_nats })
    }

    /// Step and gain in log evidence (Schwarz 1978).
    fn explained(&self, columns: &Columns<'_>) -> Option<(DVector<f64>, f64)> {
        let (step, gain) = self.linearized.information(columns).step()?;
        let freedom = self.misfit.freedom as f64;
        let share = (gain / freedom).min(1.0 - 1e-9);
        Some((step, -0.5 * freedom * (1.0 - share).ln() - 0.5 * columns.n as f64 * freedom.ln()))
    }
}
