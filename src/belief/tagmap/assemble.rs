//! The map from the solved problem.

use crate::say::map_words::disagreeing_detections;
use crate::tagmap::constants::assemble::{FAR_FROM_KNOWN, MIN_REJECTED, REJECTED_SHARE};
use armcal_core::codes::{Code, Warning};
use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix6};

use crate::tagmap::adjust::{MAX_STEPS, degrees_of_freedom};
use crate::tagmap::groups::Group;
use crate::tagmap::linearize::cost;
use crate::tagmap::normal_equations::NormalEquations;
use crate::tagmap::problem::MapProblem;
use crate::tagmap::result::{MapGroup, MappedTag, RelativeBodyPose, TagMap};
use crate::tagmap::screen::Screened;
use crate::tagmap::sparse::{Factor, SelectedInverse};
use crate::tagmap::types::{MapInput, MapRejection, RejectedDetection};
use armcal_core::numeric::Loss;
use armcal_core::spatial::adjoint;
use armcal_core::spatial::log;
use armcal_core::stats::quantile;

pub(super) fn assemble(
    input: &MapInput<'_>,
    screened: &Screened,
    problem: &MapProblem<'_>,
    groups: &[Group],
    noise_scale: f64,
) -> TagMap {
    let quadratic = Loss::Square;
    let mut normal = NormalEquations::new(problem);
    normal.update(problem, quadratic);
    let (factor, inverses) = match normal.reduce(problem, 0.0) {
        Some(reduced) => (reduced.system.factorize(), reduced.inverses),
        None => (None, vec![Matrix6::zeros(); problem.blocks.len()]),
    };
    let inverse = factor.as_ref().map(Factor::selected_inverse);
    let mut warnings = Vec::new();
    if factor.is_none() {
        let text = "the views do not determine every tag: no covariances";
        warnings.push(Warning::new(Code::MapUndetermined, text));
    }
    warnings.extend(doubts(problem));
    let pixels = Pixels::of(problem);
    let mut views = vec![BTreeMap::new(); input.views.len()];
    for block in problem.blocks.iter().filter(|block| is_used(problem, block.range.clone())) {
        views[screened.views[block.view].input].insert(block.group, block.pose);
    }
    let mut rejected = screened.rejected.clone();
    let unused = problem.observations.iter().filter(|seen| !seen.is_used);
    rejected.extend(unused.map(|seen| RejectedDetection {
        view: screened.views[seen.view].input,
        id: problem.tags[seen.tag].id,
        reason: MapRejection::Inconsistent,
    }));
    rejected.sort_by_key(|rejected| (rejected.view, rejected.id, rejected.reason));
    TagMap {
        groups: groups.iter().enumerate().map(|(idx, group)| map_group(problem, idx, group)).collect(),
        tags: mapped(problem, &pixels, inverse.as_ref()),
        relative: relative(problem, screened, &normal, &inverses, inverse.as_ref()),
        views,
        n_detections: screened.n_detections,
        n_used: problem.observations.iter().filter(|seen| seen.is_used).count(),
        rms_px: rms(pixels.used.iter().flatten().copied()),
        rms_all_px: rms(pixels.used.iter().flatten().chain(&pixels.unused).copied()),
        median_px: quantile(&pixels.used.iter().flatten().copied().collect::<Vec<_>>(), 0.5).unwrap_or(0.0),
        chi_square: cost(problem, quadratic),
        degrees_of_freedom: degrees_of_freedom(problem),
        noise_scale,
        rejected,
        scale_warnings: Vec::new(),
        warnings,
        is_contradicted: false,
        has_converged: false,
        n_steps: MAX_STEPS - problem.steps_left,
        factor,
        lens_errors: None,
    }
}

/// Warnings of tags whose known place disagrees with the views, and of tags with many rejected detections.
fn doubts(problem: &MapProblem<'_>) -> Vec<Warning> {
    let mut out = Vec::new();
    let mut counts = vec![(0_usize, 0_usize); problem.tags.len()];
    for seen in &problem.observations {
        let (n, used) = &mut counts[seen.tag];
        *n += 1;
        *used += usize::from(seen.is_used);
    }
    for (tag, (n, used)) in problem.tags.iter().zip(counts) {
        let id = tag.id;
        if let (Some(prior), Some(_)) = (&tag.prior, tag.node) {
            let owner = prior.owner.map_or_else(Isometry3::identity, |owner| problem.extras[owner].pose);
            let off = log(&tag.pose.inv_mul(&(owner * prior.pose)));
            if off.component_mul(&prior.information).dot(&off) > FAR_FROM_KNOWN {
                let (mm, deg) = (off.fixed_rows::<3>(0).norm() * 1e3, off.fixed_rows::<3>(3).norm().to_degrees());
                let text = format!(
                    "tag {id}: its known place disagrees with the views by {mm:.1} mm and {deg:.2} deg, beyond its \
                     standard deviations"
                );
                out.push(Warning::new(Code::MapTagDisagrees, text));
            }
        }
        let rejected = n - used;
        let is_often = rejected >= MIN_REJECTED && rejected as f64 > REJECTED_SHARE * n as f64;
        if is_often || 2 * used < n {
            out.push(Warning::new(Code::MapTagDisagrees, disagreeing_detections(id, rejected, n)));
        }
    }
    out
}

fn is_used(problem: &MapProblem<'_>, range: std::ops::Range<usize>) -> bool {
    problem.observations[range].iter().any(|seen| seen.is_used)
}

/// Distances between measured and predicted corners, px.
struct Pixels {
    /// Distances for each tag.
    used: Vec<Vec<f64>>,
    unused: Vec<f64>,
}

impl Pixels {
    fn of(problem: &MapProblem<'_>) -> Self {
        let mut out = Self { used: vec![Vec::new(); problem.tags.len()], unused: Vec::new() };
        for block in &problem.blocks {
            for seen in &problem.observations[block.range.clone()] {
                let camera_from_tag = block.pose.inv_mul(&problem.tags[seen.tag].pose);
                for (corner, measured) in seen.corners_m.iter().zip(&seen.corners_px) {
                    let point = camera_from_tag * nalgebra::Point3::from(*corner);
                    let Some(pixel) = problem.cameras[seen.camera].project(&point.coords) else { continue };
                    let distance = (measured - pixel).norm();
                    if seen.is_used { out.used[seen.tag].push(distance) } else { out.unused.push(distance) }
                }
            }
        }
        out
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_usize), |(sum, n), value| (sum + value * value, n + 1));
    if n == 0 { 0.0 } else { (sum / n as f64).sqrt() }
}

fn map_group(problem: &MapProblem<'_>, idx: usize, group: &Group) -> MapGroup {
    let bodies: BTreeSet<usize> = group.tags.iter().map(|tag| problem.tags[*tag].body).collect();
    let of_group = problem.blocks.iter().filter(|block| block.group == idx);
    MapGroup {
        frame: group.frame.clone(),
        bodies: bodies.into_iter().collect(),
        tags: group.tags.iter().map(|tag| problem.tags[*tag].id).collect(),
        n_views: of_group.filter(|block| is_used(problem, block.range.clone())).count(),
    }
}

fn mapped(problem: &MapProblem<'_>, pixels: &Pixels, inverse: Option<&SelectedInverse>) -> Vec<MappedTag> {
    let with_group = problem.tags.iter().enumerate().filter(|(_, tag)| tag.group != usize::MAX);
    with_group
        .map(|(idx, tag)| {
            let covariance = match (inverse, tag.node) {
                (Some(inverse), Some(node)) => inverse.block(node, node),
                _ => Matrix6::zeros(),
            };
            MappedTag {
                id: tag.id,
                size_m: tag.size_m,
                group: tag.group,
                frame_from_tag: tag.pose,
                covariance: 0.5 * (covariance + covariance.transpose()),
                n_views: pixels.used[idx].len() / 4,
                rms_px: rms(pixels.used[idx].iter().copied()),
                is_fixed: tag.node.is_none(),
                node: tag.node,
            }
        })
        .collect()
}

/// Pose of each further group in the frame of the first, for each view of two or more groups.
fn relative(
    problem: &MapProblem<'_>,
    screened: &Screened,
    normal: &NormalEquations,
    inverses: &[Matrix6<f64>],
    inverse: Option<&SelectedInverse>,
) -> Vec<RelativeBodyPose> {
    let mut out = Vec::new();
    let Some(inverse) = inverse else { return out };
    let used: Vec<usize> =
        (0..problem.blocks.len()).filter(|idx| is_used(problem, problem.blocks[*idx].range.clone())).collect();
    for of_view in used.chunk_by(|a, b| problem.blocks[*a].view == problem.blocks[*b].view) {
        let Some((&first, others)) = of_view.split_first() else { continue };
        for &second in others {
            let (a, b) = (&problem.blocks[first], &problem.blocks[second]);
            let difference = match (a.node, b.node) {
                (Some(a), Some(b)) => {
                    let both = inverse.block(a, b);
                    inverse.block(a, a) + inverse.block(b, b) - both - both.transpose()
                }
                _ => [first, second]
                    .map(|idx| block_covariance(problem, normal, &inverses[idx], idx, inverse))
                    .into_iter()
                    .sum(),
            };
            let carry = adjoint(&b.pose);
            out.push(RelativeBodyPose {
                view: screened.views[a.view].input,
                first: a.group,
                second: b.group,
                first_from_second: a.pose * b.pose.inverse(),
                covariance: carry * difference * carry.transpose(),
            });
        }
    }
    out.sort_by_key(|relative| (relative.view, relative.first, relative.second));
    out
}

/// Covariance of a camera's pose: its own part plus that of its tags.
fn block_covariance(
    problem: &MapProblem<'_>,
    normal: &NormalEquations,
    own: &Matrix6<f64>,
    idx: usize,
    inverse: &SelectedInverse,
) -> Matrix6<f64> {
    let block = &problem.blocks[idx];
    if let Some(node) = block.node {
        return inverse.block(node, node);
    }
    let nodes: Vec<(usize, usize)> = block
        .range
        .clone()
        .filter(|at| problem.observations[*at].is_used)
        .filter_map(|at| problem.tags[problem.observations[at].tag].node.map(|node| (at, node)))
        .collect();
    let mut covariance = *own;
    for (at, node) in &nodes {
        let right = normal.cross[*at].transpose() * own;
        for (other, other_node) in &nodes {
            covariance += own * normal.cross[*other] * inverse.block(*other_node, *node) * right;
        }
    }
    covariance
}
