//! Halving of the joint errors where halving the edge does not help: one pair at a time, depth first.

use crate::plan::certify::motion_bound::{ArmRegion, Split, Trend};
use crate::plan::certify::sweep::{FINEST_M, Finding, OpenPair, Search, Sweep};
use crate::plan::clearance::pair::Pair;
use crate::plan::constants::certify_error_box::MAX_REGIONS;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// A stretch of the edge, as shares of its length, and a box of errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Region {
    along: [f64; 2],
    error_rad: [[f64; 2]; MAX_JOINTS],
}

impl Search<'_> {
    /// Tests one pair until every part of the stretch and of the errors on it is certified.
    pub(crate) fn search_pair(&mut self, open: &OpenPair, along: [f64; 2]) -> Option<(Pair, f64)> {
        let (sweep, model) = (self.sweep, self.sweep.model);
        let pair = model.pair(open.pair);
        let mut stack = vec![(sweep.region(along, None), open.direction)];
        for _ in 0..MAX_REGIONS {
            let (region, direction) = stack.pop()?;
            let spot = sweep.spot(&region);
            self.place_pair(pair, &spot);
            match sweep.test_pair(&OpenPair { direction, ..*open }, &spot, &self.moved) {
                Finding::Clear => {}
                Finding::TooNear(distance_m) => return Some((pair, distance_m)),
                Finding::Open(found) => {
                    let Some(open) = sweep.test_pair_exact(&found, &spot, &self.moved) else { continue };
                    let outer = &self.moved[pair.outer()];
                    if open.drift.total_m < FINEST_M {
                        return Some(sweep.least_m(&open, outer));
                    }
                    let trend = spot.trend(model.between(pair), outer, open.direction);
                    if open.has_near_corner()
                        && let Some(distance_m) = sweep.worst_corner(&open, &region, &trend)
                    {
                        return Some((pair, distance_m));
                    }
                    stack.extend(sweep.halves(&region, trend.split).map(|half| (half, open.direction)));
                }
            }
        }
        // Too many regions: the remaining ones may be too near.
        Some((pair, 0.0))
    }

    fn place_pair(&mut self, pair: Pair, spot: &ArmRegion) {
        self.n_regions += 1;
        spot.place(self.sweep.model, pair.outer(), &mut self.moved[pair.outer()]);
        if let Pair::Links { inner, .. } = pair {
            spot.place(self.sweep.model, inner, &mut self.moved[inner]);
        }
    }
}

impl Sweep<'_> {
    /// Returns the errors of a stretch: the largest on it, within those of the enclosing region.
    pub(crate) fn region(&self, along: [f64; 2], within: Option<&Region>) -> Region {
        let mut error_rad = [[0.0; 2]; MAX_JOINTS];
        for (joint, error) in error_rad.iter_mut().enumerate().filter(|(joint, _)| self.model.has_error(*joint)) {
            let most = self.error_rad(joint, along);
            let [low, high] = within.map_or([-most, most], |region| region.error_rad[joint]);
            *error = [low.max(-most), high.min(most)];
            if error[0] > error[1] {
                // The stretch has no error within this part; a point of it keeps the region simple.
                *error = [error[0].min(most).max(-most); 2];
            }
        }
        Region { along, error_rad }
    }

    fn spot(&self, region: &Region) -> ArmRegion {
        let [begin, end] = region.along;
        let (middle, half) = (0.5 * (begin + end), 0.5 * (end - begin));
        let [mut step_rad, mut error_half_rad] = [[0.0; MAX_JOINTS]; 2];
        let (mut angles, mut is_within) = (self.from, true);
        for joint in 0..angles.len() {
            let [low, high] = region.error_rad[joint];
            let offset = 0.5 * (low + high);
            angles[joint] = self.believed(joint, middle) + offset;
            step_rad[joint] = half * (self.to[joint] - self.from[joint]);
            error_half_rad[joint] = 0.5 * (high - low);
            is_within &= offset == 0.0 || offset.abs() <= self.error_rad(joint, [middle; 2]);
        }
        let poses = self.model.link_poses(&angles);
        let mut region = ArmRegion::new(&poses, angles.len(), step_rad, error_half_rad);
        region.is_within = is_within;
        region
    }

    fn halves(&self, region: &Region, split: Split) -> [Region; 2] {
        match split {
            Split::Along => {
                let middle = 0.5 * (region.along[0] + region.along[1]);
                [[region.along[0], middle], [middle, region.along[1]]].map(|along| self.region(along, Some(region)))
            }
            Split::Error(joint) => {
                let [low, high] = region.error_rad[joint];
                let middle = 0.5 * (low + high);
                [[low, middle], [middle, high]].map(|part| {
                    let mut half = *region;
                    half.error_rad[joint] = part;
                    half
                })
            }
        }
    }

    /// Returns the distance at the worst corner of the region, by the first order, if that is too near.
    pub(crate) fn worst_corner(&self, open: &OpenPair, region: &Region, trend: &Trend) -> Option<f64> {
        let share = if trend.along_m > 0.0 { region.along[0] } else { region.along[1] };
        let angles = JointAngles::from_fn(self.from.len(), |joint| {
            let believed = self.believed(joint, share);
            let [low, high] = region.error_rad[joint];
            if low == high && low == 0.0 {
                return believed;
            }
            let error_rad = self.error_rad(joint, [share; 2]);
            let offset = if trend.error_m[joint] > 0.0 { low } else { high };
            believed + offset.clamp(-error_rad, error_rad)
        });
        self.model.distance_below(open.pair, &angles, self.margin_m, open.direction)
    }
}
