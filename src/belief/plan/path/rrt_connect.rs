//! RRT-Connect (Kuffner and LaValle 2000) over certified edges, and shortcuts.
//!
//! Two trees grow from start and goal. Samples are the stowed pose first, then draws about the straight edge (every
//! third) or over all joint ranges. Work is counted in regions that certification tests, so that a search ends after
//! the same work on every machine. The path found is then made faster. Waypoints are left out; then random points on it
//! are connected directly if both edges around the shortcut are certified too.

use crate::plan::constants::path_rrt_connect::{
    ABOUT_RAD, LEAST_GAIN, LEAST_WEIGHT, MAX_REGIONS, MAX_SAMPLES, MAX_SHORTCUTS, SHORTCUT_REGIONS, STEP_RAD,
};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::motion::edge::{Edge, Path, SLOWEST};
use crate::plan::path::edge_check::{PathPlanner, between};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// A search between two poses.
pub(crate) struct RrtConnect<'a, 'b> {
    planner: &'b PathPlanner<'a>,
    trees: [Tree; 2],
    weights: [f64; MAX_JOINTS],
    n_tried: usize,
    n_regions: usize,
}

struct Tree {
    /// Angles and parent index of each node.
    nodes: Vec<(JointAngles, usize)>,
}

impl<'a, 'b> RrtConnect<'a, 'b> {
    pub fn new(planner: &'b PathPlanner<'a>, from: &JointAngles, to: &JointAngles) -> Self {
        let mut weights = [LEAST_WEIGHT; MAX_JOINTS];
        let levers_m = planner.clearance.levers_m();
        let longest_m = levers_m.iter().fold(f64::MIN_POSITIVE, |longest, lever| lever.max(longest));
        for (weight, lever_m) in weights.iter_mut().zip(levers_m) {
            *weight = weight.max(lever_m / longest_m);
        }
        Self { planner, trees: [*from, *to].map(Tree::rooted), weights, n_tried: 0, n_regions: 0 }
    }

    pub fn n_tried(&self) -> usize {
        self.n_tried
    }

    /// True if no edge was found that leaves the start.
    pub fn is_stuck(&self) -> bool {
        self.trees[0].nodes.len() == 1
    }

    /// Returns waypoints from start to goal; `None` if none were found within the budget.
    pub fn search(&mut self, rng: &mut ChaCha8Rng) -> Option<Vec<JointAngles>> {
        while self.n_regions < MAX_REGIONS && self.n_tried < MAX_SAMPLES {
            let sample = self.sample(rng);
            let grow = self.n_tried % 2;
            self.n_tried += 1;
            let Some(new) = self.extend(grow, &sample) else { continue };
            let target = self.trees[grow].nodes[new].0;
            if let Some(other) = self.connect(1 - grow, &target) {
                let (first, second) = if grow == 0 { (new, other) } else { (other, new) };
                let mut waypoints = self.trees[0].branch(first);
                waypoints.reverse();
                waypoints.extend(self.trees[1].branch(second).into_iter().skip(1));
                return Some(waypoints);
            }
        }
        None
    }

    /// Returns a sample; joints that have the same angle at both ends stay there.
    fn sample(&self, rng: &mut ChaCha8Rng) -> JointAngles {
        let [from, to] = [0, 1].map(|tree| self.trees[tree].nodes[0].0);
        let stays = |j: usize| from[j] == to[j];
        if self.n_tried < 2 {
            let stowed = self.planner.clearance.stowed();
            return JointAngles::from_fn(from.len(), |j| if stays(j) { from[j] } else { stowed[j] });
        }
        let about = self.n_tried.is_multiple_of(3);
        let middle = between(&from, &to, rng.random_range(0.0..=1.0));
        JointAngles::from_fn(from.len(), |j| {
            let limits = self.planner.limits[j];
            let (lower_rad, upper_rad) = (limits.lower_rad, limits.upper_rad);
            if stays(j) || lower_rad >= upper_rad {
                from[j]
            } else if about {
                (middle[j] + rng.random_range(-ABOUT_RAD..=ABOUT_RAD)).max(lower_rad).min(upper_rad)
            } else {
                rng.random_range(lower_rad..=upper_rad)
            }
        })
    }

    /// True if the edge keeps the margin at the lowest speed.
    fn is_edge_free(&mut self, from: &JointAngles, to: &JointAngles) -> bool {
        self.planner.keeps_clear(&Edge { from: *from, to: *to, time_scale: SLOWEST }, &mut self.n_regions)
    }

    /// Grows a tree by a step towards `target`.
    fn extend(&mut self, tree: usize, target: &JointAngles) -> Option<usize> {
        let near = self.nearest(tree, target);
        self.extend_from(tree, near, target)
    }

    fn extend_from(&mut self, tree: usize, near: usize, target: &JointAngles) -> Option<usize> {
        let from = self.trees[tree].nodes[near].0;
        let way = |j: usize| self.weights[j] * (target[j] - from[j]).abs();
        let longest_rad = (0..from.len()).map(way).fold(0.0, f64::max);
        let to = if longest_rad <= STEP_RAD { *target } else { between(&from, target, STEP_RAD / longest_rad) };
        self.is_edge_free(&from, &to).then(|| self.trees[tree].add(to, near))
    }

    /// Grows a tree straight towards `target` until it arrives (its node) or is blocked (`None`).
    fn connect(&mut self, tree: usize, target: &JointAngles) -> Option<usize> {
        let mut at = self.nearest(tree, target);
        loop {
            at = self.extend_from(tree, at, target)?;
            if self.trees[tree].nodes[at].0 == *target {
                return Some(at);
            }
        }
    }

    fn nearest(&self, tree: usize, target: &JointAngles) -> usize {
        let mut nearest = (f64::INFINITY, 0);
        for (k, (angles, _)) in self.trees[tree].nodes.iter().enumerate() {
            let ways = angles.iter().zip(target.iter()).zip(&self.weights);
            let distance: f64 = ways.map(|((a, b), weight)| (weight * (a - b)).powi(2)).sum();
            if distance < nearest.0 {
                nearest = (distance, k);
            }
        }
        nearest.1
    }

    /// Returns a faster path through these waypoints, each edge at the highest speed that it allows.
    pub fn shortened(&mut self, waypoints: &[JointAngles], rng: &mut ChaCha8Rng) -> Path {
        self.n_regions = 0;
        let mut path = Path::at(waypoints[0]);
        for edge in waypoints.windows(2) {
            // The search has certified the lowest speed.
            path.push(edge[1], self.time_scale(&edge[0], &edge[1], SLOWEST).unwrap_or(SLOWEST));
        }
        path = self.thinned(path);
        for _ in 0..MAX_SHORTCUTS {
            if path.n_edges() < 2 || self.n_regions > SHORTCUT_REGIONS {
                break;
            }
            let [a, b] = [0, 1].map(|_| rng.random_range(0.0..path.n_edges() as f64));
            if let Some(shorter) = self.shortcut(&path, a.min(b), a.max(b)) {
                path = shorter;
            }
        }
        self.thinned(path)
    }

    fn time_scale(&mut self, from: &JointAngles, to: &JointAngles, at_most: f64) -> Option<f64> {
        self.planner.time_scale(from, to, at_most, &mut self.n_regions)
    }

    fn duration_s(&self, path: &Path) -> f64 {
        self.planner.clearance.timing().path_duration_s(path)
    }

    /// Leaves out waypoints if a straight edge across them is certified and takes no longer.
    fn thinned(&mut self, path: Path) -> Path {
        let mut short = Path::at(path.waypoints[0]);
        let mut at = 0;
        while at < path.n_edges() {
            let farther = (at + 2..path.waypoints.len()).rev();
            let across = farther.into_iter().find_map(|far| Some((far, self.across(&path, at, far)?)));
            let (next, slowness) = across.unwrap_or((at + 1, path.edge(at).time_scale));
            short.push(path.waypoints[next], slowness);
            at = next;
        }
        short
    }

    /// Returns the time scaling of the edge from one waypoint to a later one, if it is certified and saves time.
    fn across(&mut self, path: &Path, at: usize, far: usize) -> Option<f64> {
        let timing = self.planner.clearance.timing();
        let (from, to) = (&path.waypoints[at], &path.waypoints[far]);
        let along_s: f64 = (at..far).map(|k| timing.edge_duration_s(&path.edge(k))).sum();
        self.time_scale(from, to, along_s / timing.least_duration_s(from, to))
    }

    /// Returns the path with a straight edge from point `a` to point `b` on it (waypoint and share of the edge after
    /// it). `None` unless that saves time and all three new edges are certified: a part of an edge is driven at other
    /// rates than the whole.
    fn shortcut(&mut self, path: &Path, a: f64, b: f64) -> Option<Path> {
        let (before, after) = (a.floor() as usize, b.floor() as usize);
        if before == after {
            return None;
        }
        let place = |k: usize, at: f64| between(&path.waypoints[k], &path.waypoints[k + 1], at - at.floor());
        let (from, to) = (place(before, a), place(after, b));
        let enough_s = (1.0 - LEAST_GAIN) * self.duration_s(path);
        let shorter = |slowness: [f64; 3]| {
            let mut shorter = Path::at(path.waypoints[0]);
            (0..before).for_each(|k| shorter.push(path.edge(k).to, path.edge(k).time_scale));
            shorter.push(from, slowness[0]);
            shorter.push(to, slowness[1]);
            shorter.push(path.edge(after).to, slowness[2]);
            (after + 1..path.n_edges()).for_each(|k| shorter.push(path.edge(k).to, path.edge(k).time_scale));
            shorter
        };
        // Each edge may take the time that the other two leave at the highest speed.
        let spare_s = enough_s - self.duration_s(&shorter([1.0; 3]));
        if spare_s <= 0.0 {
            return None;
        }
        let ends = [(from, to), (path.waypoints[before], from), (to, path.waypoints[after + 1])];
        let mut slowness = [0.0; 3];
        for (slowness, (from, to)) in slowness.iter_mut().zip(&ends) {
            let least_s = self.planner.clearance.timing().least_duration_s(from, to);
            *slowness = self.time_scale(from, to, 1.0 + spare_s / least_s)?;
        }
        let [across, first, last] = slowness;
        let shorter = shorter([first, across, last]);
        (self.duration_s(&shorter) < enough_s).then_some(shorter)
    }
}

impl Tree {
    fn rooted(root: JointAngles) -> Self {
        Self { nodes: vec![(root, 0)] }
    }

    fn add(&mut self, angles: JointAngles, parent: usize) -> usize {
        self.nodes.push((angles, parent));
        self.nodes.len() - 1
    }

    /// Returns the angles from a node to the root.
    fn branch(&self, mut node: usize) -> Vec<JointAngles> {
        let mut branch = vec![self.nodes[node].0];
        while node != 0 {
            node = self.nodes[node].1;
            branch.push(self.nodes[node].0);
        }
        branch
    }
}
