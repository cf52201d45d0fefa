//! Test for tags that are not where the survey has them.
//!
//! Each tag's pose is estimated under its survey's prior. If the survey holds, the estimate departs from it by d (on
//! the right, m and rad) with the covariance `S - C`. S is the prior's, C the posterior's: the difference is what the
//! data moved it by. In units of the prior, over the directions that the data determine, `d^T (S - C)^-1 d` is
//! chi-square. A tag beyond its limit is freed of its survey if that explains more than any other error of the geometry
//! does.

use crate::explain::constants::tags_departure::{TAILS, TOLD_SHARE};
use crate::judge::constants::FALSE_ALARM;
use nalgebra::{Matrix6, Vector6};

use crate::model::blocks::Block;
use crate::model::prior::at_least;
use crate::solve::estimate::Estimate;
use armcal_core::spatial::log;
use armcal_core::stats::chi_square_quantile;

/// Departure of one tag's estimated pose from its survey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TagDeparture {
    /// Index into the robot's tags.
    pub tag_idx: usize,
    /// Distance of the tag's centre from its survey, m.
    pub shift_m: f64,
    pub chi2: f64,
    pub dof: usize,
}

impl TagDeparture {
    /// Returns true if chance explains the departure, among `n` tags tested.
    fn is_by_chance(&self, n: usize) -> bool {
        self.chi2 <= TAILS * chi_square_quantile(1.0 - FALSE_ALARM / n.max(1) as f64, self.dof)
    }
}

impl Estimate<'_> {
    /// Tag with the most significant departure from its survey. `None` if chance explains it, or another link or mount
    /// explains more.
    pub(crate) fn moved_tag(&self) -> Option<TagDeparture> {
        let departures: Vec<TagDeparture> =
            (0..self.problem.robot.tags.len()).filter_map(|tag_idx| self.tag_departure(tag_idx)).collect();
        let worst = departures.iter().copied().max_by(|a, b| a.chi2.total_cmp(&b.chi2))?;
        if worst.is_by_chance(departures.len()) {
            return None;
        }
        let others = self.score_tests(&self.view_angles());
        let by_geometry = others.iter().map(|result| result.chi2).fold(0.0, f64::max);
        (worst.chi2 > by_geometry).then_some(worst)
    }

    /// Tags that the data displace from their survey by more than chance.
    pub(crate) fn departed_tags(&self) -> Vec<usize> {
        let all: Vec<TagDeparture> =
            (0..self.problem.robot.tags.len()).filter_map(|tag_idx| self.tag_departure(tag_idx)).collect();
        all.iter().filter(|departure| !departure.is_by_chance(all.len())).map(|departure| departure.tag_idx).collect()
    }

    /// Departure of one tag; `None` if the data determine nothing of it.
    pub(crate) fn tag_departure(&self, tag_idx: usize) -> Option<TagDeparture> {
        let (pose, covariance) = self.tag(tag_idx);
        let prior = &self.problem.prior;
        let block = Block::Tag(tag_idx);
        let by: Vector6<f64> = log(&prior.mean.pose(block).inv_mul(&pose));
        let std = Vector6::from_column_slice(&prior.std[block][..6]).map(at_least);
        let scaled = covariance?.component_div(&(std * std.transpose()));
        let told = (Matrix6::identity() - scaled).symmetric_eigen();
        let departure = by.component_div(&std);
        let (mut chi2, mut dof) = (0.0, 0);
        for (share, direction) in told.eigenvalues.iter().zip(told.eigenvectors.column_iter()) {
            if *share > TOLD_SHARE {
                chi2 += direction.dot(&departure).powi(2) / share;
                dof += 1;
            }
        }
        (dof > 0).then(|| TagDeparture { tag_idx, shift_m: by.fixed_rows::<3>(0).norm(), chi2, dof })
    }
}
