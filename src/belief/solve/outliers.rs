//! Tag observations and corners that do not fit the rest: rejected by their chi-square between two solutions, and
//! readmitted where they fit.
//!
//! One corner that does not belong (occluded, blurred, beside an edge) leaves the other three in use if these fit. Two
//! such corners, or chi-square of all without any, are a tag that is elsewhere or another one: all four go.

use crate::measure::{ObservationTerm, WeightedMeasurement};
use crate::solve::constants::outliers::{CORNER_LIMITS, LIMITS, MIN_CORNERS};
use crate::solve::levenberg_marquardt::Solved;
use crate::solve::linearize::NormalEquations;
use crate::solve::problem::BundleProblem;
use crate::views::view::View;

/// A tag observation, or a corner of one, that does not fit the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Index into the views of the input.
    pub view_idx: usize,
    /// Id of the tag, which may be that on the gripper.
    pub tag_id: u32,
    /// The corner, in the detector's order; `None` where all of the observation is rejected.
    pub corner: Option<usize>,
    /// Root mean square of the rejected coordinates' residuals in standard deviations.
    pub sigmas: f64,
}

/// Limit of each by its use so far: an observation is rejected beyond the one and comes back below the other.
fn limits_of<const N: usize>(used: [bool; N], [reject, readmit]: [f64; 2]) -> [f64; N] {
    used.map(|is_used| if is_used { reject } else { readmit })
}

/// Marks what does not belong; whether anything changed.
pub(crate) fn reject(problem: &mut BundleProblem<'_>, solved: &Solved) -> bool {
    reject_by(problem, &solved.normal)
}

/// Flags outliers by normal equations at the solution; returns true if any flag changed.
pub(crate) fn reject_by(problem: &mut BundleProblem<'_>, normal: &NormalEquations) -> bool {
    let mut changed = false;
    for (at, observation) in problem.observations.iter_mut().enumerate() {
        let before = observation.used();
        let used = match observation.data {
            WeightedMeasurement::Corners(_) => fitting_corners(before, &normal.corner_chi2[at]),
            _ => {
                let n = observation.data.n_coordinates() as f64;
                let excess = noise_excess(&observation.data);
                limits_of(before, LIMITS).map(|limit| normal.chi2[at] < limit * n * excess)
            }
        };
        changed |= used != before;
        observation.set_used(used);
    }
    changed
}

/// The corners that belong: all, three, or none.
fn fitting_corners(before: [bool; 4], chi2: &[f64; 4]) -> [bool; 4] {
    let limits = limits_of(before, CORNER_LIMITS);
    let used = [0, 1, 2, 3].map(|corner| chi2[corner] < limits[corner]);
    let n = used.iter().filter(|is_used| **is_used).count();
    let sum: f64 = chi2.iter().zip(used).filter(|(_, is_used)| *is_used).map(|(chi2, _)| chi2).sum();
    let [limit] = limits_of([before.contains(&true)], LIMITS);
    if n >= MIN_CORNERS && sum < limit * 2.0 * n as f64 { used } else { [false; 4] }
}

/// Rejected part of an observation.
pub(crate) struct Rejected {
    pub n_coordinates: usize,
    /// Chi-square at which it was rejected.
    pub chi2: f64,
}

pub(crate) fn rejected(observation: &ObservationTerm) -> Rejected {
    let data = &observation.data;
    let ([limit, _], [corner_limit, _]) = (LIMITS, CORNER_LIMITS);
    if !observation.is_used {
        let n_coordinates = data.n_coordinates();
        return Rejected { n_coordinates, chi2: limit * n_coordinates as f64 * noise_excess(data) };
    }
    let n_corners = observation.used().iter().filter(|is_used| !**is_used).count();
    Rejected { n_coordinates: 2 * n_corners, chi2: corner_limit * n_corners as f64 }
}

/// Positions and poses come with a standard deviation that is a guess until the scales are fitted.
fn noise_excess(seen: &WeightedMeasurement) -> f64 {
    match seen {
        WeightedMeasurement::Corners(_) | WeightedMeasurement::Board { .. } => 1.0,
        WeightedMeasurement::Position { .. } | WeightedMeasurement::Pose { .. } => 4.0,
    }
}

/// Those that the solution rejected.
pub(crate) fn outliers(problem: &BundleProblem<'_>, views: &[View], solved: &Solved) -> Vec<Outlier> {
    let mut out = Vec::new();
    for (view_idx, view) in problem.views.iter().enumerate() {
        for at in view.observations.clone().chain(view.gripper) {
            let observation = &problem.observations[at];
            let gripper = problem.robot.gripper_tag.map_or(0, |tag| tag.id);
            let tag_id = views[view_idx].tags.get(at - view.observations.start).map_or(gripper, |tag| tag.id);
            let mut add = |corner, chi2: f64, n: usize| {
                out.push(Outlier { view_idx, tag_id, corner, sigmas: (chi2 / n as f64).sqrt() });
            };
            if !observation.is_used {
                add(None, solved.normal.chi2[at], observation.data.n_coordinates());
                continue;
            }
            for (corner, is_used) in observation.used().into_iter().enumerate() {
                if !is_used {
                    add(Some(corner), solved.normal.corner_chi2[at][corner], 2);
                }
            }
        }
    }
    out
}
