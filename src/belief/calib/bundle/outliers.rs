//! Tag observations that do not fit the rest: rejected by their chi-square between two solutions, and readmitted where
//! they fit.

use crate::calib::bundle::problem::{BundleProblem, WeightedMeasurement};
use crate::calib::bundle::solve::Solved;
use crate::calib::views::view::View;

/// A tag observation that does not fit the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outlier {
    /// Index into the views of the input.
    pub view_idx: usize,
    /// Id of the tag, which may be that on the gripper.
    pub tag_id: u32,
    /// Root mean square of its coordinates' residuals in standard deviations.
    pub sigmas: f64,
}

/// An observation whose chi-square is this many times its number of coordinates belongs elsewhere; one below `READMIT`
/// belongs here.
pub(crate) const REJECT: f64 = 7.5;
const READMIT: f64 = 5.0;

/// Marks what does not belong; whether anything changed.
pub(crate) fn reject(problem: &mut BundleProblem<'_>, solved: &Solved) -> bool {
    let mut changed = false;
    for (observation, chi2) in problem.observations.iter_mut().zip(&solved.normal.chi2) {
        let n = observation.data.n_coordinates() as f64;
        let limit = if observation.is_used { REJECT } else { READMIT };
        let belongs = *chi2 < limit * n * noise_excess(&observation.data);
        changed |= belongs != observation.is_used;
        observation.is_used = belongs;
    }
    changed
}

/// Chi-square above which an observation is rejected.
pub(crate) fn rejection_chi2(seen: &WeightedMeasurement) -> f64 {
    REJECT * seen.n_coordinates() as f64 * noise_excess(seen)
}

/// Positions and poses come with a standard deviation that is a guess until the scales are fitted.
fn noise_excess(seen: &WeightedMeasurement) -> f64 {
    match seen {
        WeightedMeasurement::Corners { .. } => 1.0,
        WeightedMeasurement::Position { .. } | WeightedMeasurement::Pose { .. } => 4.0,
    }
}

/// Those that the solution rejected.
pub(crate) fn outliers(problem: &BundleProblem<'_>, views: &[View], solved: &Solved) -> Vec<Outlier> {
    let mut out = Vec::new();
    for (view_idx, view) in problem.views.iter().enumerate() {
        for at in view.observations.clone().chain(view.gripper) {
            let observation = &problem.observations[at];
            if observation.is_used {
                continue;
            }
            let gripper = problem.robot.gripper_tag.map_or(0, |tag| tag.id);
            let tag_id = views[view_idx].tags.get(at - view.observations.start).map_or(gripper, |tag| tag.id);
            let sigmas = (solved.normal.chi2[at] / observation.data.n_coordinates() as f64).sqrt();
            out.push(Outlier { view_idx, tag_id, sigmas });
        }
    }
    out
}
