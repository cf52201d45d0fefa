//! Certifies that every arm within the joint errors keeps clear, at one pose or along an edge.
//!
//! A pair of convex shapes with `gap` between their shadows on a direction keeps the distance `gap - drift`. `drift`
//! bounds the relative motion that the joints cause along that direction: exact to first order in the joints' motion,
//! with a bound on the second. A region of arms is a stretch of the edge times a box of joint errors. A region whose
//! pairs do not all pass is halved, and its halves test only those pairs. Stretches are tested from coarse to fine,
//! over the whole edge, so that an arm that is too near ends the search early.

use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::pair::Pair;
use crate::plan::clearance::separation::{gap_m, separate};
use crate::plan::clearance::{ClearanceModel, ClosestPair};
pub(crate) use crate::plan::constants::certify_sweep::FINEST_M;
use crate::plan::constants::certify_sweep::{BREADTH, FINEST_ALONG_M, LONG_STRETCH_M, MAX_STRETCHES};
use crate::plan::motion::tracking_error::TrackingErrorBound;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

use crate::plan::certify::motion_bound::{ArmRegion, MotionBound, ShapeMotion, Split};
use parry3d::math::Vec3;

/// Believed angles on a straight line, and all errors that the bounds allow around them.
pub(crate) struct Sweep<'a> {
    pub model: &'a ClearanceModel<'a>,
    pub from: JointAngles,
    pub to: JointAngles,
    /// Joint error bounds; `None`: only the believed arm.
    pub bounds: Option<&'a JointErrorBounds>,
    /// Bound on the deviation of the arm from the line, in addition to the joint errors.
    pub tracking_error: TrackingErrorBound,
    /// Clearance to keep, m.
    pub margin_m: f64,
}

/// Result of a sweep.
pub(crate) struct Certificate {
    /// The pair that some arm brings, or may bring, too near, with the distance as the margin counts it. `None` proves
    /// that there is none.
    pub violation: Option<(Pair, f64)>,
    /// Number of tested regions, a measure of cost.
    pub n_regions: usize,
}

/// A pair that is not certified yet, by its index.
#[derive(Clone, Copy)]
pub(crate) struct OpenPair {
    pub(crate) pair: usize,
    /// Direction that served the enclosing region best, or zero.
    pub(crate) direction: Vec3,
    pub(crate) lacking_m: f64,
    pub(crate) drift: MotionBound,
    /// True if the direction is that of the closest points.
    pub(crate) is_exact: bool,
}

/// A stretch of the edge, as shares of its length, and the open pairs to test on it.
#[derive(Clone, Copy)]
pub(crate) struct EdgeInterval {
    along: [f64; 2],
    open: [usize; 2],
}

/// Result for one pair in a region.
pub(crate) enum Finding {
    Clear,
    /// An arm within the bounds is too near; the distance is as the margin counts it.
    TooNear(f64),
    Open(OpenPair),
}

/// State of a search.
pub(crate) struct Search<'a> {
    pub(crate) sweep: &'a Sweep<'a>,
    pub(crate) moved: Vec<ShapeMotion>,
    pub(crate) open: Vec<OpenPair>,
    pub(crate) stretches: Vec<EdgeInterval>,
    pub(crate) n_regions: usize,
}

impl OpenPair {
    /// Returns the pair with the distance that the joints can take from it; `None` if enough is left.
    pub(crate) fn drifting(self, drift: MotionBound) -> Option<Self> {
        let lacking_m = self.lacking_m + drift.total_m;
        (lacking_m > 0.0).then_some(Self { lacking_m, drift, ..self })
    }

    /// True if, to first order, an arm at a corner of the region is too near.
    pub(crate) fn has_near_corner(&self) -> bool {
        self.lacking_m - self.drift.total_m + self.drift.first_m > 0.0
    }
}

impl Sweep<'_> {
    /// Searches for an arm that is too near.
    pub(crate) fn verdict(&self) -> Certificate {
        let mut search = Search {
            sweep: self,
            moved: vec![ShapeMotion::default(); self.model.n_moving()],
            open: Vec::with_capacity(2 * self.model.pairs().len()),
            stretches: Vec::with_capacity(64),
            n_regions: 0,
        };
        let too_near = search.run();
        Certificate { violation: too_near, n_regions: search.n_regions }
    }

    /// Returns the violation with the names of its pair.
    pub(crate) fn first_too_near(&self) -> Option<ClosestPair> {
        self.verdict().violation.map(|(pair, distance_m)| self.model.named(pair, distance_m))
    }

    pub(crate) fn believed(&self, joint: usize, share: f64) -> f64 {
        self.from[joint] + share * (self.to[joint] - self.from[joint])
    }

    /// Returns the largest error of a joint on a stretch of the edge, rad. The sensor's error is convex in the angle,
    /// so that it is largest at an end.
    pub(crate) fn error_rad(&self, joint: usize, along: [f64; 2]) -> f64 {
        let Some(bounds) = self.bounds else { return 0.0 };
        let [begin, end] = along.map(|share| bounds.error_rad(joint, self.believed(joint, share)));
        // The sensor's error may be larger at the angle to which the joint strays.
        f64::max(begin, end) + (1.0 + bounds.slope(joint)) * self.tracking_error.most_rad(joint, along)
    }

    /// Returns the middle of a stretch with all errors on it.
    pub(crate) fn stretch_spot(&self, along: [f64; 2]) -> ArmRegion {
        let (middle, half) = (0.5 * (along[0] + along[1]), 0.5 * (along[1] - along[0]));
        let [mut step_rad, mut error_half_rad] = [[0.0; MAX_JOINTS]; 2];
        let mut angles = self.from;
        for joint in 0..angles.len() {
            angles[joint] = self.believed(joint, middle);
            step_rad[joint] = half * (self.to[joint] - self.from[joint]);
        }
        if self.bounds.is_some() {
            for joint in (0..angles.len()).filter(|&joint| self.model.has_error(joint)) {
                error_half_rad[joint] = self.error_rad(joint, along);
            }
        }
        ArmRegion::new(&self.model.link_poses(&angles), angles.len(), step_rad, error_half_rad)
    }

    /// Tests one pair, with its shapes placed for a region.
    pub(crate) fn test_pair(&self, open: &OpenPair, spot: &ArmRegion, moved: &[ShapeMotion]) -> Finding {
        let pair = self.model.pair(open.pair);
        let outer = &moved[pair.outer()];
        let other = self.model.other_at(pair, |inner| &moved[inner].placed);
        let between = self.model.between(pair);
        let (here_m, needed_m) = self.needed_m(pair, outer);
        // The distance between the shapes' boxes may already exceed any motion in the region.
        let apart_m = gap_m(&outer.placed.bounds, &other.bounds);
        if apart_m - outer.coarse_m(between.first_joint) >= needed_m {
            return Finding::Clear;
        }
        if apart_m >= here_m && outer.stretch_m > LONG_STRETCH_M {
            // The stretch will be halved regardless of the first order.
            let drift_m = outer.coarse_m(between.first_joint);
            let drift = MotionBound { total_m: drift_m, first_m: 0.0 };
            return Finding::Open(OpenPair { lacking_m: needed_m - apart_m + drift_m, drift, is_exact: true, ..*open });
        }
        let shapes = self.model.shapes(pair);
        let mut direction = open.direction;
        if direction == Vec3::ZERO {
            direction = outer.placed.rough_direction(other);
        }
        let mut gap_m = shapes.gap_along_m(&outer.placed, other, direction);
        let mut is_exact = false;
        if gap_m < here_m {
            let found = separate(&shapes, [&outer.placed, other], direction);
            if found.distance_m < here_m && spot.is_within {
                return Finding::TooNear(self.model.in_margin_m(pair, found.distance_m, outer.station_bound_m));
            }
            (direction, gap_m, is_exact) = (found.direction, found.gap_m, true);
        }
        if gap_m - outer.coarse_m(between.first_joint) >= needed_m {
            return Finding::Clear;
        }
        let open = OpenPair {
            pair: open.pair,
            direction,
            lacking_m: needed_m - gap_m,
            drift: MotionBound::default(),
            is_exact,
        };
        open.drifting(spot.drift(between, outer, direction)).map_or(Finding::Clear, Finding::Open)
    }

    /// Tests an open pair that is not too near again, along the direction of its closest points; `None`: it is clear.
    pub(crate) fn test_pair_exact(&self, open: &OpenPair, spot: &ArmRegion, moved: &[ShapeMotion]) -> Option<OpenPair> {
        let pair = self.model.pair(open.pair);
        let (outer, other) = (&moved[pair.outer()], self.model.other_at(pair, |inner| &moved[inner].placed));
        let found = separate(&self.model.shapes(pair), [&outer.placed, other], open.direction);
        let lacking_m = self.needed_m(pair, outer).1 - found.gap_m;
        let open = OpenPair { direction: found.direction, lacking_m, is_exact: true, ..*open };
        open.drifting(spot.drift(self.model.between(pair), outer, found.direction))
    }

    /// Returns the true distance that keeps the margin: at the middle of a region, and anywhere in it.
    pub(crate) fn needed_m(&self, pair: Pair, outer: &ShapeMotion) -> (f64, f64) {
        let needed_m = self.model.needed_m(pair, self.margin_m);
        if self.model.sways(pair) {
            (needed_m + outer.station_bound_m, needed_m + outer.most_sway_m)
        } else {
            (needed_m, needed_m)
        }
    }

    /// Returns the least distance of a pair in the region, as the margin counts it.
    pub(crate) fn least_m(&self, open: &OpenPair, outer: &ShapeMotion) -> (Pair, f64) {
        let pair = self.model.pair(open.pair);
        let (_, needed_m) = self.needed_m(pair, outer);
        let least_m = self.model.in_margin_m(pair, needed_m - open.lacking_m, outer.most_sway_m);
        (pair, least_m)
    }
}

impl Search<'_> {
    pub(crate) fn run(&mut self) -> Option<(Pair, f64)> {
        let (sweep, model) = (self.sweep, self.sweep.model);
        let is_edge = sweep.from != sweep.to;
        if is_edge && let Some(found) = [1.0, 0.0].into_iter().find_map(|share| self.probe(share)) {
            return Some(found);
        }
        let all = |pair| OpenPair {
            pair,
            direction: Vec3::ZERO,
            lacking_m: 0.0,
            drift: MotionBound::default(),
            is_exact: false,
        };
        let may_be = |pair: &usize| !model.never_within(*pair, model.needed_m(model.pair(*pair), sweep.margin_m));
        self.open.extend((0..model.pairs().len()).filter(may_be).map(all));
        self.stretches
            .push(EdgeInterval { along: if is_edge { [0.0, 1.0] } else { [0.0; 2] }, open: [0, self.open.len()] });
        // Open pairs whose errors must be split, with their stretch.
        let mut with_errors: Vec<([f64; 2], OpenPair)> = Vec::new();
        let mut next = 0;
        while let Some(stretch) = self.next_stretch(&mut next) {
            let spot = self.place(stretch.along, &stretch);
            let kept = match self.sift(&stretch, &spot) {
                Ok(kept) => kept,
                Err(found) => return Some(found),
            };
            let Some(worst) = self.worst(kept, &spot) else { continue };
            let outer = &self.moved[model.pair(worst.pair).outer()];
            if self.n_regions >= MAX_STRETCHES {
                return Some(sweep.least_m(&worst, outer));
            }
            let trend = spot.trend(model.between(model.pair(worst.pair)), outer, worst.direction);
            if sweep.bounds.is_some() && worst.has_near_corner() {
                let region = sweep.region(stretch.along, None);
                if let Some(distance_m) = sweep.worst_corner(&worst, &region, &trend) {
                    return Some((model.pair(worst.pair), distance_m));
                }
            }
            if trend.split == Split::Along {
                if worst.drift.total_m < FINEST_ALONG_M {
                    return Some(sweep.least_m(&worst, outer));
                }
                let middle = 0.5 * (stretch.along[0] + stretch.along[1]);
                let open = [kept, self.open.len()];
                self.stretches.push(EdgeInterval { along: [stretch.along[0], middle], open });
                self.stretches.push(EdgeInterval { along: [middle, stretch.along[1]], open });
            } else {
                with_errors.extend(self.open[kept..].iter().map(|open| (stretch.along, *open)));
                self.open.truncate(kept);
            }
        }
        // The pair most likely to fail comes first.
        with_errors.sort_by(|a, b| b.1.lacking_m.total_cmp(&a.1.lacking_m));
        with_errors.into_iter().find_map(|(along, open)| self.search_pair(&open, along))
    }

    pub(crate) fn next_stretch(&mut self, next: &mut usize) -> Option<EdgeInterval> {
        if *next >= BREADTH {
            return if self.stretches.len() > *next { self.stretches.pop() } else { None };
        }
        let stretch = self.stretches.get(*next).copied();
        *next += 1;
        stretch
    }

    /// Returns a pair that is too near for the believed arm at one point of the edge, if any.
    pub(crate) fn probe(&mut self, share: f64) -> Option<(Pair, f64)> {
        let model = self.sweep.model;
        let angles = JointAngles::from_fn(self.sweep.from.len(), |joint| self.sweep.believed(joint, share));
        let zero = [0.0; MAX_JOINTS];
        let spot = ArmRegion::new(&model.link_poses(&angles), angles.len(), zero, zero);
        self.n_regions += 1;
        for (shape, moved) in self.moved.iter_mut().enumerate() {
            spot.place(model, shape, moved);
        }
        (0..model.pairs().len()).find_map(|pair| {
            let pair = model.pair(pair);
            let (outer, other) = (&self.moved[pair.outer()], model.other_at(pair, |inner| &self.moved[inner].placed));
            let (needed_m, _) = self.sweep.needed_m(pair, outer);
            if gap_m(&outer.placed.bounds, &other.bounds) >= needed_m {
                return None;
            }
            let (shapes, direction) = (model.shapes(pair), outer.placed.rough_direction(other));
            if shapes.gap_along_m(&outer.placed, other, direction) >= needed_m {
                return None;
            }
            let found = separate(&shapes, [&outer.placed, other], direction);
            (found.distance_m < needed_m)
                .then(|| (pair, model.in_margin_m(pair, found.distance_m, outer.station_bound_m)))
        })
    }

    /// Places the shapes that a stretch tests at its middle.
    pub(crate) fn place(&mut self, along: [f64; 2], stretch: &EdgeInterval) -> ArmRegion {
        let spot = self.sweep.stretch_spot(along);
        let model = self.sweep.model;
        let pairs = self.open[stretch.open[0]..stretch.open[1]].iter();
        let mask = pairs.fold(0_u64, |mask, open| mask | model.pair(open.pair).mask());
        self.n_regions += 1;
        for (shape, moved) in self.moved.iter_mut().enumerate() {
            if mask >> shape & 1 == 1 {
                spot.place(model, shape, moved);
            }
        }
        spot
    }

    /// Returns the open pair that lacks most distance, unless its own best direction clears every one.
    pub(crate) fn worst(&mut self, kept: usize, spot: &ArmRegion) -> Option<OpenPair> {
        loop {
            let lacking = |k: &usize| self.open[*k].lacking_m;
            let k = (kept..self.open.len()).max_by(|a, b| lacking(a).total_cmp(&lacking(b)))?;
            if self.open[k].is_exact {
                return Some(self.open[k]);
            }
            match self.sweep.test_pair_exact(&self.open[k], spot, &self.moved) {
                Some(open) => {
                    self.open[k] = open;
                    return Some(open);
                }
                None => {
                    self.open.swap_remove(k);
                }
            }
        }
    }

    /// Tests the pairs of a stretch. Those that stay open are appended from the returned index on.
    pub(crate) fn sift(&mut self, stretch: &EdgeInterval, spot: &ArmRegion) -> Result<usize, (Pair, f64)> {
        let kept = self.open.len();
        for k in stretch.open[0]..stretch.open[1] {
            let open = self.open[k];
            match self.sweep.test_pair(&open, spot, &self.moved) {
                Finding::Clear => {}
                Finding::TooNear(distance_m) => return Err((self.sweep.model.pair(open.pair), distance_m)),
                Finding::Open(open) => self.open.push(open),
            }
        }
        Ok(kept)
    }
}
