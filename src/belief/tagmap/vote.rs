//! Relative pose of two tags, by a vote of the images that show both.
//!
//! A square seen nearly head-on has two poses (Collins and Bartoli 2014). So each image of two tags yields up to four
//! relative poses, one of them right. Wrong ones differ from image to image, right ones agree. Each pose is rated by
//! truncated squared Mahalanobis distances to the nearest pose of each other image. The pose with the least sum wins,
//! and is refined on its voters.

use crate::tagmap::constants::vote::{AGREES, MAX_VOTERS, VOTE_STD_PX};
use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::tagmap::problem::Observation;
use armcal_core::optics::SquarePose;
use armcal_core::spatial::adjoint;
use armcal_core::spatial::{exp, log};

struct Hypothesis {
    first_from_second: Isometry3<f64>,
    covariance: Matrix6<f64>,
}

/// Result of a vote.
pub(super) struct Consensus {
    pub(super) first_from_second: Isometry3<f64>,
    pub(super) n_agreeing: usize,
    pub(super) n_voters: usize,
}

/// Returns the relative pose that most of `pairs` agree on; each pair is of one image.
pub(super) fn vote(pairs: &[(&Observation, &Observation)]) -> Option<Consensus> {
    let mut voters: Vec<Vec<Hypothesis>> = chosen(pairs).into_iter().map(|(a, b)| hypotheses(a, b)).collect();
    voters.retain(|voter| !voter.is_empty());
    let mut best: Option<(f64, Isometry3<f64>)> = None;
    for (i, voter) in voters.iter().enumerate() {
        for candidate in voter {
            let mut loss = 0.0;
            for (k, other) in voters.iter().enumerate() {
                if k != i {
                    loss += nearest(candidate, other).map_or(AGREES, |(_, distance)| distance.min(AGREES));
                }
                if best.as_ref().is_some_and(|(least, _)| loss >= *least) {
                    break;
                }
            }
            if best.as_ref().is_none_or(|(least, _)| loss < *least) {
                best = Some((loss, candidate.first_from_second));
            }
        }
    }
    let (_, start) = best?;
    let (first_from_second, n_agreeing) = refined(start, &voters);
    if !is_finite(&first_from_second) {
        return None;
    }
    Some(Consensus { first_from_second, n_agreeing, n_voters: voters.len() })
}

/// The images that determine the relative pose best, spread over all in their order.
fn chosen<'a>(pairs: &[(&'a Observation, &'a Observation)]) -> Vec<(&'a Observation, &'a Observation)> {
    if pairs.len() <= MAX_VOTERS {
        return pairs.to_vec();
    }
    let doubt = |(a, b): &(&Observation, &Observation)| {
        let tilt = |seen: &Observation| seen.best.covariance_unit_px.fixed_view::<3, 3>(3, 3).trace();
        tilt(a) + tilt(b)
    };
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    order.sort_by(|a, b| doubt(&pairs[*a]).total_cmp(&doubt(&pairs[*b])).then(a.cmp(b)));
    order.truncate((pairs.len() / 2).max(MAX_VOTERS));
    order.sort_unstable();
    (0..MAX_VOTERS).map(|k| pairs[order[k * order.len() / MAX_VOTERS]]).collect()
}

fn hypotheses(first: &Observation, second: &Observation) -> Vec<Hypothesis> {
    let of = |a: &SquarePose, b: &SquarePose| {
        let first_from_second = a.camera_from_tag.isometry().inv_mul(b.camera_from_tag.isometry());
        let carry = adjoint(&first_from_second.inverse());
        let covariance = carry * a.covariance_unit_px * carry.transpose() + b.covariance_unit_px;
        Hypothesis { first_from_second, covariance: covariance * (VOTE_STD_PX * VOTE_STD_PX) }
    };
    let all = first.solutions().flat_map(|a| second.solutions().map(move |b| of(a, b)));
    // A square that its corners hardly determine has no valid covariance.
    all.filter(|one| is_finite(&one.first_from_second) && one.covariance.cholesky().is_some()).collect()
}

/// The nearest hypothesis of a voter, and its squared distance from the candidate.
fn nearest<'a>(candidate: &Hypothesis, voter: &'a [Hypothesis]) -> Option<(&'a Hypothesis, f64)> {
    let measured = voter.iter().filter_map(|other| {
        let step = log(&candidate.first_from_second.inv_mul(&other.first_from_second));
        let together = (candidate.covariance + other.covariance).cholesky()?;
        Some((other, step.dot(&together.solve(&step))))
    });
    measured.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Weighted mean of the agreeing voters, and their number.
fn refined(start: Isometry3<f64>, voters: &[Vec<Hypothesis>]) -> (Isometry3<f64>, usize) {
    let mut at = start;
    let mut n_agreeing = 0;
    for _ in 0..3 {
        let mut normal = Matrix6::zeros();
        let mut right = Vector6::zeros();
        n_agreeing = 0;
        let here = Hypothesis { first_from_second: at, covariance: Matrix6::zeros() };
        for voter in voters {
            let Some((other, distance)) = nearest(&here, voter) else { continue };
            let Some(information) = other.covariance.try_inverse().filter(|_| distance <= AGREES) else { continue };
            n_agreeing += 1;
            normal += information;
            right += information * log(&at.inv_mul(&other.first_from_second));
        }
        let step = normal.cholesky().map(|normal| normal.solve(&right));
        let Some(step) = step.filter(|step| step.iter().all(|value| value.is_finite())) else { break };
        at *= exp(&step);
    }
    (at, n_agreeing)
}

pub(super) fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|value| value.is_finite())
}
