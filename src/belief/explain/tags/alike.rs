//! Tags that one motion displaced, by the score of their survey.
//!
//! The module `group` gives each tag of a group six numbers of its own. A small motion of several tags does not pay for
//! them, and a possible base error leads to other groups. Tags on one frame have six numbers together. S is the
//! survey's covariance, C the posterior's, and d the estimate's departures from the survey (all tags, on the right). A
//! motion g of the tags of a set G, `survey_i' = exp(g) survey_i`, has the score and information
//!
//! ```text
//! s = sum over G of J_i^T (S^-1 d)_i                               J_i = Ad(survey_i^-1)
//! I = sum over G, G of J_i^T (S^-1 (S - C) S^-1)_ik J_k
//! ```
//!
//! with all other parameters following (Rao 1948). It promises the evidence of `drawing::gain_nats` under a prior of g,
//! less the logarithm of the number of sets.

use crate::explain::constants::tags_alike::LEAST_STD;
use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, Translation3, Vector3, Vector6};

use crate::explain::drawing::{MULTIPLES, gain_nats};
use crate::explain::tags::group::candidate_sets;
use crate::explain::tags::identity::TagFault;
use crate::model::blocks::Block;
use crate::solve::estimate::Estimate;
use armcal_core::spatial::{adjoint, exp, log};

/// Score and information of each tag's own motion about the base's origin.
struct SurveyScore {
    /// Indices into the robot's tags.
    tags: Vec<usize>,
    places: Vec<Vector3<f64>>,
    score: Vec<Vector6<f64>>,
    information: Vec<Vec<Matrix6<f64>>>,
    /// Standard deviations of the survey, m and rad.
    std: [f64; 2],
}

/// One motion of some tags.
struct Motion {
    gain_nats: f64,
    moved: Vec<usize>,
    base_motion: Isometry3<f64>,
    cost_nats: f64,
}

impl Estimate<'_> {
    /// Tags that one motion displaced, for the set of the largest predicted gain, if that is `least_nats` or more.
    pub(crate) fn moved_alike(&self, least_nats: f64) -> Vec<TagFault> {
        let Some(score) = SurveyScore::new(self) else { return Vec::new() };
        let Some(best) = score.best().filter(|best| best.gain_nats > least_nats) else { return Vec::new() };
        let cost_nats = best.cost_nats / best.moved.len() as f64;
        let fault = |&at: &usize| TagFault::Alike { tag_idx: score.tags[at], base_motion: best.base_motion, cost_nats };
        best.moved.iter().map(fault).collect()
    }
}

impl SurveyScore {
    /// Score of the survey; `None` if fewer than two tags are seen.
    fn new(found: &Estimate<'_>) -> Option<Self> {
        let prior = &found.problem.prior;
        let std = |tag: usize| &prior.std[Block::Tag(tag)][..6];
        let drawn = |tag: usize| prior.mean.pose(Block::Tag(tag));
        let is_suspect = |tag: usize| std(tag).iter().all(|std| *std > LEAST_STD);
        let seen: Vec<(usize, usize)> = found.problem.layout.tags().filter(|(tag, _)| is_suspect(*tag)).collect();
        let first = seen.get(1).map(|_| std(seen[0].0))?;
        let by_std = |tag: usize| Vector6::from_column_slice(std(tag)).map(f64::recip);
        let motion = |tag: usize| adjoint(&drawn(tag).inverse());
        let score = seen.iter().map(|&(tag, _)| {
            let departure = log(&drawn(tag).inv_mul(found.solved.state.pose(Block::Tag(tag))));
            let weight = by_std(tag);
            motion(tag).tr_mul(&departure.component_mul(&weight).component_mul(&weight))
        });
        let information = |&(tag, at): &(usize, usize), &(other, other_at): &(usize, usize)| {
            let covariance = found.posterior.covariance.fixed_view::<6, 6>(at, other_at);
            let [one, two] = [tag, other].map(|tag| Matrix6::from_diagonal(&by_std(tag)));
            let own = if tag == other { Matrix6::identity() } else { Matrix6::zeros() };
            motion(tag).tr_mul(&(one * (own - one * covariance * two) * two)) * motion(other)
        };
        Some(Self {
            score: score.collect(),
            information: seen.iter().map(|a| seen.iter().map(|b| information(a, b)).collect()).collect(),
            places: seen.iter().map(|(tag, _)| drawn(*tag).translation.vector).collect(),
            tags: seen.into_iter().map(|(tag, _)| tag).collect(),
            std: [first[0], first[3]],
        })
    }

    fn best(&self) -> Option<Motion> {
        let sets = candidate_sets(self.tags.len());
        let n_sets = sets.len() as f64;
        let each = sets.into_iter().filter_map(|moved| self.motion(moved, n_sets));
        each.max_by(|a, b| a.gain_nats.total_cmp(&b.gain_nats))
    }

    /// Motion of one set under the prior of the largest predicted gain.
    fn motion(&self, moved: Vec<usize>, n_sets: f64) -> Option<Motion> {
        let center: Vector3<f64> = moved.iter().map(|&at| self.places[at]).sum::<Vector3<f64>>() / moved.len() as f64;
        let about = Isometry3::from_parts(Translation3::from(center), nalgebra::UnitQuaternion::identity());
        let to_base = adjoint(&about);
        let score: Vector6<f64> = to_base.tr_mul(&moved.iter().map(|&at| self.score[at]).sum::<Vector6<f64>>());
        let pairs = moved.iter().flat_map(|&a| moved.iter().map(move |&b| (a, b)));
        let information: Matrix6<f64> =
            to_base.tr_mul(&pairs.map(|(a, b)| self.information[a][b]).sum::<Matrix6<f64>>()) * to_base;
        let columns: Vec<(usize, f64)> = (0..6).map(|k| (k, self.std[k / 3])).collect();
        let pull = DVector::from_column_slice(score.as_slice());
        let told = DMatrix::from_column_slice(6, 6, information.as_slice());
        let gain = |multiple: f64| gain_nats(&pull, &told, &columns, multiple);
        let multiple = MULTIPLES.into_iter().max_by(|a, b| gain(*a).total_cmp(&gain(*b)))?;
        let std = Vector6::from_fn(|k, _| self.std[k / 3] * multiple);
        let scaled = Matrix6::identity() + Matrix6::from_diagonal(&std) * information * Matrix6::from_diagonal(&std);
        let scaled = scaled.cholesky()?;
        let sigmas = scaled.solve(&score.component_mul(&std));
        let half_log_det: f64 = scaled.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let size = sigmas.component_mul(&std);
        Some(Motion {
            gain_nats: gain(multiple) - n_sets.ln(),
            base_motion: about * exp(&size) * about.inverse(),
            cost_nats: 0.5 * sigmas.norm_squared() + half_log_det + n_sets.ln(),
            moved,
        })
    }
}
