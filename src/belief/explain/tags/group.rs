//! Tags that were moved together: a panel that was knocked, a frame that was put back a little off.
//!
//! If several tags moved, the estimate under their survey is a compromise, and every tag seems to have moved. So all
//! tags are freed. Their departures d from the survey then have the covariance `V = C + S`, of the estimate and the
//! survey. The model is `d = J m + sum of E_i x_i`: m is one motion of all tags against the base, which no tag causes;
//! x_i is the own departure of each moved tag i. In generalized least squares, the tags that save most of `d^T V^-1 d`
//! were moved, while each saves enough. The evidence decides whether they stay.

use crate::explain::constants::tags_freed::MIN_TRUSTED;
use crate::explain::constants::tags_group::{LEAST_SAVING, LOOSE_STD_M, LOOSE_STD_RAD, MAX_TRIED_ALL};
use nalgebra::{Cholesky, DMatrix, DVector, Vector3};

use crate::explain::tags::identity::{NEARER, TagFault};
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::BundleInput;
use armcal_core::robot::Robot;
use armcal_core::spatial::{adjoint, log};

/// Tags that were moved together; none if fewer than two were, or too few would stay.
pub(crate) fn moved_group(input: &BundleInput<'_>) -> Vec<TagFault> {
    let mut robot = input.robot.clone();
    for tag in &mut robot.tags {
        (tag.position_std_m, tag.rotation_std_rad) =
            (tag.position_std_m.max(LOOSE_STD_M), tag.rotation_std_rad.max(LOOSE_STD_RAD));
    }
    let found = estimate(&BundleInput { robot: &robot, ..input.clone() });
    let Some(departures) = found.and_then(|found| Departures::new(input.robot, &found)) else { return Vec::new() };
    let moved = departures.moved();
    if moved.len() < 2 {
        return Vec::new();
    }
    let own = departures.own(&moved);
    let size = [0, 3].map(|first| {
        let squares: f64 = (0..moved.len()).map(|k| own.fixed_rows::<3>(6 * k + first).norm_squared()).sum();
        (squares / (3 * moved.len()) as f64).sqrt()
    });
    if let Some(exchanged) = departures.exchanged(&moved) {
        return vec![exchanged];
    }
    let fault = |&at: &usize| {
        let tag_idx = departures.tags[at];
        let tag = &input.robot.tags[tag_idx];
        TagFault::Moved { tag_idx, std: [size[0].max(tag.position_std_m), size[1].max(tag.rotation_std_rad)] }
    };
    moved.iter().map(fault).collect()
}

/// Departures of all seen tags from their survey (on the right, m and rad), whitened.
struct Departures {
    /// Indices into the robot's tags, six rows each.
    tags: Vec<usize>,
    /// Position of each tag by the survey, and by the views, base frame, m.
    places: Vec<[Vector3<f64>; 2]>,
    whitened: DVector<f64>,
    /// Factor of the covariance, which whitens departures.
    factor: Cholesky<f64, nalgebra::Dyn>,
    /// One motion of all tags, base frame, whitened.
    common: DMatrix<f64>,
}

impl Departures {
    fn new(robot: &Robot, found: &Estimate<'_>) -> Option<Self> {
        let seen: Vec<(usize, usize)> = found.problem.layout.tags().collect();
        let n = 6 * seen.len();
        let column = |row: usize| seen[row / 6].1 + row % 6;
        let mut covariance = DMatrix::from_fn(n, n, |i, k| found.posterior.covariance[(column(i), column(k))]);
        let mut by = DVector::zeros(n);
        let mut places = Vec::with_capacity(seen.len());
        let mut common = DMatrix::zeros(n, 6);
        for (k, &(tag_idx, _)) in seen.iter().enumerate() {
            let tag = &robot.tags[tag_idx];
            let surveyed = tag.base_from_tag.isometry();
            let (pose, _) = found.tag(tag_idx);
            places.push([surveyed.translation.vector, pose.translation.vector]);
            by.fixed_rows_mut::<6>(6 * k).copy_from(&log(&surveyed.inv_mul(&pose)));
            common.fixed_rows_mut::<6>(6 * k).copy_from(&adjoint(&surveyed.inverse()));
            for row in 0..6 {
                let std = if row < 3 { tag.position_std_m } else { tag.rotation_std_rad };
                covariance[(6 * k + row, 6 * k + row)] += std * std;
            }
        }
        let factor = Cholesky::new(covariance)?;
        let whitened = factor.l_dirty().solve_lower_triangular(&by)?;
        let common = factor.l_dirty().solve_lower_triangular(&common)?;
        Some(Self { tags: seen.into_iter().map(|(tag, _)| tag).collect(), places, whitened, factor, common })
    }

    /// Indices in `tags` of those that were moved.
    fn moved(&self) -> Vec<usize> {
        let n = self.tags.len();
        let most = most_moved(n);
        let priced = |moved: Vec<usize>| (self.fit(&moved).1 + LEAST_SAVING * moved.len() as f64, moved);
        let cheapest = |all: Vec<Vec<usize>>| all.into_iter().map(priced).min_by(|a, b| a.0.total_cmp(&b.0));
        // Adding one at a time finds the wrong ones if three of eight were moved.
        let mut best = cheapest(small_sets(n, most.min(3))).unwrap_or_default();
        while best.1.len() < most {
            let others = (0..n).filter(|at| !best.1.contains(at));
            let larger = others.map(|at| best.1.iter().copied().chain([at]).collect()).collect();
            match cheapest(larger) {
                Some(next) if next.0 < best.0 => best = next,
                _ => break,
            }
        }
        best.1
    }

    /// Two of `moved` that are each at the other's place: their ids are exchanged, they did not move.
    fn exchanged(&self, moved: &[usize]) -> Option<TagFault> {
        let is_at = |a: usize, b: usize| {
            let [[own, found], [other, _]] = [self.places[a], self.places[b]];
            (found - other).norm() < NEARER * (found - own).norm()
        };
        let mut pairs = moved.iter().enumerate().flat_map(|(k, &a)| moved[k + 1..].iter().map(move |&b| (a, b)));
        let (a, b) = pairs.find(|&(a, b)| is_at(a, b) && is_at(b, a))?;
        Some(TagFault::Swapped([self.tags[a].min(self.tags[b]), self.tags[a].max(self.tags[b])]))
    }

    /// Departure of each moved tag from the survey beyond the common motion, six numbers each.
    fn own(&self, moved: &[usize]) -> DVector<f64> {
        self.fit(moved).0.rows_range(6..).into_owned()
    }

    /// Common motion and departures of `moved`, and the remaining chi-square.
    fn fit(&self, moved: &[usize]) -> (DVector<f64>, f64) {
        let n = self.whitened.len();
        let mut columns = DMatrix::zeros(n, 6 + 6 * moved.len());
        columns.columns_mut(0, 6).copy_from(&self.common);
        let mut own = DMatrix::zeros(n, 6 * moved.len());
        for (k, at) in moved.iter().enumerate() {
            own.fixed_view_mut::<6, 6>(6 * at, 6 * k).fill_with_identity();
        }
        if self.factor.l_dirty().solve_lower_triangular_mut(&mut own) {
            columns.columns_mut(6, 6 * moved.len()).copy_from(&own);
        }
        let right = columns.tr_mul(&self.whitened);
        let Some(normal) = Cholesky::new(columns.tr_mul(&columns)) else {
            return (DVector::zeros(right.len()), self.whitened.norm_squared());
        };
        let fitted = normal.solve(&right);
        let left = self.whitened.norm_squared() - fitted.dot(&right);
        (fitted, left)
    }
}

/// Largest number of `n` tags that may have moved: more than half of them stay.
fn most_moved(n: usize) -> usize {
    n.saturating_sub(MIN_TRUSTED).min(n.saturating_sub(1) / 2)
}

/// All pairs and threes that may have moved together, of `n` tags.
pub(crate) fn candidate_sets(n: usize) -> Vec<Vec<usize>> {
    small_sets(n, most_moved(n).min(3)).into_iter().filter(|set| set.len() > 1).collect()
}

/// All sets of up to `most` of `n`; only the empty one if `n` is large.
fn small_sets(n: usize, most: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    let mut first = 0;
    for _ in 0..if n > MAX_TRIED_ALL { 0 } else { most } {
        let last = all.len();
        for set in first..last {
            let from = all[set].last().map_or(0, |last| last + 1);
            all.extend((from..n).map(|at| [&all[set][..], &[at]].concat()).collect::<Vec<_>>());
        }
        first = last;
    }
    all
}
