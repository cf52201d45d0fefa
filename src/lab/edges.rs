//! Certified edges against brute force.
//!
//! Random edges of the nominal arm with exact joints, over the whole of its joint ranges, in a scene. Each edge is
//! certified, then scanned by distance queries at joint steps of [`SCAN_RAD`]. The scan covers all of an edge that is
//! certified free, and a blocked edge until an arm is too near. A violation on an edge certified free is missed. An
//! edge that is called blocked but has no violation is refused though free.

use rand::RngExt;
use rayon::prelude::*;
use serde_json::{Value, json};

use armcal_belief::plan::{ClearanceModel, JointErrorBounds};
use armcal_core::robot::Robot;
use armcal_core::stats::{quantile, stream_rng};
use armcal_core::streams::JointAngles;

/// Largest joint step between two configurations of a scan, rad.
pub const SCAN_RAD: f64 = 0.0005;
/// Supports and distances are exact to rounding, m.
const ROUNDING_M: f64 = 1e-9;
/// Number of places at which a blocked edge is scanned first: a violation is usually wide.
const COARSE: u32 = 64;

/// A straight edge between two configurations.
pub type Edge = [JointAngles; 2];

/// Results of certificate and scan for one edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeRow {
    pub longest_step_rad: f64,
    pub is_certified: bool,
    /// Share of the edge at which an arm is too near; `None` if the scan found none.
    pub violation_at: Option<f64>,
}

/// Rows in the order of the edges, and the time of each certificate by the caller's clock, s.
#[derive(Clone, Debug)]
pub struct EdgeStudy {
    pub arm: String,
    pub rows: Vec<EdgeRow>,
    pub certify_s: Vec<f64>,
}

/// Draws `n` edges, with ends uniform over the joint ranges. Edge `k` has its own stream of random numbers.
#[must_use]
pub fn random_edges(robot: &Robot, n: usize, seed: u64) -> Vec<Edge> {
    let edge = |k: usize| {
        let mut rng = stream_rng(seed, &format!("edge {k}"));
        let mut end = || {
            JointAngles::from_fn(robot.n_joints(), |j| {
                let range = robot.chain.joints()[j]
                    .limits
                    .map_or([-1.0, 1.0].map(|turn| turn * std::f64::consts::PI), |l| [l.lower_rad, l.upper_rad]);
                rng.random_range(range[0]..=range[1])
            })
        };
        [end(), end()]
    };
    (0..n).map(edge).collect()
}

/// Certifies the edges one by one, then scans them on all cores. `clock` returns seconds.
#[must_use]
pub fn edge_study(
    robot: &Robot,
    clearance: &ClearanceModel<'_>,
    edges: &[Edge],
    margin_m: f64,
    clock: &dyn Fn() -> f64,
) -> EdgeStudy {
    let mut certify_s = Vec::with_capacity(edges.len());
    let mut certified = Vec::with_capacity(edges.len());
    for [from, to] in edges {
        let start_s = clock();
        certified.push(clearance.find_violation_exact(from, to, margin_m).is_none());
        certify_s.push(clock() - start_s);
    }
    let judged = edges.par_iter().zip(&certified).map(|(edge, &is_certified)| {
        let longest_step_rad = edge[0].max_abs_difference(&edge[1]);
        let fine = (longest_step_rad / SCAN_RAD).ceil().max(1.0) as u32;
        let coarse_violation = if is_certified { None } else { scan(clearance, edge, margin_m, COARSE) };
        let violation_at = coarse_violation.or_else(|| scan(clearance, edge, margin_m, fine));
        EdgeRow { longest_step_rad, is_certified, violation_at }
    });
    EdgeStudy { arm: robot.name.clone(), rows: judged.collect(), certify_s }
}

/// Mean time to certify an edge for every arm within the bounds, s.
#[must_use]
pub fn mean_time_under_s(
    clearance: &ClearanceModel<'_>,
    edges: &[Edge],
    bounds: &JointErrorBounds,
    margin_m: f64,
    clock: &dyn Fn() -> f64,
) -> f64 {
    let keeps_clear = |&[from, to]: &Edge| {
        clearance.find_violation_along(&armcal_belief::plan::Edge::at_full_speed(from, to), bounds, margin_m).is_none()
    };
    let start_s = clock();
    let n_free = edges.iter().filter(|edge| keeps_clear(edge)).count();
    std::hint::black_box(n_free);
    (clock() - start_s) / edges.len().max(1) as f64
}

/// Share of the edge at the first of `n_steps` equal steps where the arm is nearer than the margin; `None` if nowhere.
fn scan(clearance: &ClearanceModel<'_>, [from, to]: &Edge, margin_m: f64, n_steps: u32) -> Option<f64> {
    let is_too_near = |share: &f64| {
        let at = JointAngles::from_fn(from.len(), |j| from[j] + share * (to[j] - from[j]));
        clearance.is_nearer_than(&at, margin_m - ROUNDING_M)
    };
    (0..=n_steps).map(|k| f64::from(k) / f64::from(n_steps)).find(is_too_near)
}

impl EdgeStudy {
    fn count(&self, holds: impl Fn(&EdgeRow) -> bool) -> usize {
        self.rows.iter().filter(|row| holds(row)).count()
    }

    /// Number of edges certified free on which the scan finds an arm too near.
    #[must_use]
    pub fn n_missed(&self) -> usize {
        self.count(|row| row.is_certified && row.violation_at.is_some())
    }

    /// Number of edges called blocked on which the scan finds no arm too near.
    #[must_use]
    pub fn n_refused_though_free(&self) -> usize {
        self.count(|row| !row.is_certified && row.violation_at.is_none())
    }

    #[must_use]
    pub fn n_free(&self) -> usize {
        self.count(|row| row.is_certified)
    }

    /// One row as text: counts and times.
    #[must_use]
    pub fn summary(&self) -> String {
        let n = self.rows.len();
        let us = |share: f64| 1e6 * quantile(&self.certify_s, share).unwrap_or(f64::NAN);
        let mean_us = 1e6 * self.certify_s.iter().sum::<f64>() / n.max(1) as f64;
        format!(
            "{:<16} {n:>7} {:>7} {:>8} {:>7} {:>20} {mean_us:>9.1} {:>9.1} {:>9.1}",
            self.arm,
            self.n_free(),
            n - self.n_free(),
            self.n_missed(),
            self.n_refused_though_free(),
            us(0.5),
            us(0.99),
        )
    }

    /// Column heads of [`EdgeStudy::summary`].
    #[must_use]
    pub fn heading() -> String {
        format!(
            "{:<16} {:>7} {:>7} {:>8} {:>7} {:>20} {:>9} {:>9} {:>9}",
            "arm", "edges", "free", "blocked", "missed", "refused though free", "mean us", "median us", "99 % us"
        )
    }
}

/// edges.csv without times, so the same seed gives the same bytes.
#[must_use]
pub fn edges_csv(studies: &[EdgeStudy]) -> String {
    let mut text = "arm,edge,longest_step_rad,certified,scanned,too_near_at_share\n".to_owned();
    let word = |is_free: bool| if is_free { "free" } else { "blocked" };
    for study in studies {
        for (k, row) in study.rows.iter().enumerate() {
            let at = row.violation_at.map_or_else(String::new, |share| format!("{share:.6}"));
            let (certified, scanned) = (word(row.is_certified), word(row.violation_at.is_none()));
            text += &format!("{},{k},{:.6},{certified},{scanned},{at}\n", study.arm, row.longest_step_rad);
        }
    }
    text
}

/// Edges with the results of certificate and scan, for other checkers.
#[must_use]
pub fn edges_json(edges: &[Edge], study: &EdgeStudy) -> Vec<Value> {
    let edge = |(([from, to], row), certify_s): ((&Edge, &EdgeRow), &f64)| {
        json!({ "from_rad": from.to_vec(), "to_rad": to.to_vec(), "certified_free": row.is_certified,
                "scanned_free": row.violation_at.is_none(), "certify_us": 1e6 * certify_s })
    };
    edges.iter().zip(&study.rows).zip(&study.certify_s).map(edge).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::robot::{load, load_vehicle};
    use armcal_core::routine::Scene;

    #[test]
    fn no_certified_edge_is_blocked_and_few_free_ones_are_refused() {
        let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("the vehicle reads");
        for name in ["titan4", "kraft-predator"] {
            let robot = load(&root.join(name)).expect("the robot reads");
            let clearance = ClearanceModel::new(&robot, &vehicle, &Scene::default());
            let edges = random_edges(&robot, 300, 1);
            let study = edge_study(&robot, &clearance, &edges, 0.05, &|| 0.0);
            eprintln!("{}\n{}", EdgeStudy::heading(), study.summary());
            assert_eq!(study.n_missed(), 0);
            assert!(study.n_free() > 50 && study.rows.len() - study.n_free() > 50, "{}", study.n_free());
            assert!(study.n_refused_though_free() <= 3, "{}", study.n_refused_though_free());
        }
    }
}
