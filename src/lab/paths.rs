//! Planning between random poses in the vehicles' sites.
//!
//! Queries are pairs of random poses that are free under the assumed joint errors; the planner knows nothing else of
//! them. There are three assumptions: exact joints on a vehicle at rest (for comparison with other planners),
//! calibrated joints, and the datasheet's joints. [`problem_json`] writes shapes and queries of the first for
//! tests/oracle/compare_ompl.py.

use nalgebra::Isometry3;
use serde_json::{Value, json};

use armcal_belief::plan::{ClearanceModel, JointErrorBounds, Path, PathPlanner, Timing};
use armcal_core::robot::{MotionSpec, PlacedShape, Robot, Shape, StationKeeping, Vehicle};
use armcal_core::routine::Scene;
use armcal_core::stats::{quantile, stream_rng};
use armcal_core::streams::JointAngles;

/// The planner's assumption on joint and motion errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Belief {
    /// No errors: the arm follows every line exactly, and the vehicle stands still.
    Alone,
    /// Errors after a calibration: gains to 0.4 %, offsets to 0.014 rad. Assumed.
    Calibrated,
    Datasheet,
}

impl Belief {
    pub const ALL: [Self; 3] = [Self::Alone, Self::Calibrated, Self::Datasheet];

    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Alone => "alone",
            Self::Calibrated => "calibrated",
            Self::Datasheet => "datasheet",
        }
    }
}

/// An arm on a vehicle in a scene.
#[derive(Clone, Debug)]
pub struct PathSite {
    pub name: String,
    pub robot: Robot,
    pub vehicle: Vehicle,
    pub scene: Scene,
}

/// Result of one query.
#[derive(Clone, Debug)]
pub struct PathRow {
    pub from: JointAngles,
    pub to: JointAngles,
    pub path: Option<Path>,
    /// Sum over the path's edges of the largest joint step, rad.
    pub length_rad: f64,
    pub duration_s: f64,
    /// Planning time by the caller's clock, s.
    pub plan_s: f64,
}

/// All queries at one site under one assumption.
#[derive(Clone, Debug)]
pub struct PathStudy {
    pub site: String,
    pub belief: Belief,
    pub rows: Vec<PathRow>,
}

impl PathSite {
    /// The site under one assumption, with the bounds on the joint errors.
    #[must_use]
    pub fn believed(&self, belief: Belief) -> (Self, JointErrorBounds) {
        let mut site = self.clone();
        match belief {
            Belief::Alone => {
                site.robot.drive.motion = MotionSpec { lag_spread_s: 0.0, overshoot_rad: 0.0, droop_rad: 0.0 };
                site.vehicle.station_keeping = StationKeeping { position_std_m: 0.0, attitude_std_rad: 0.0 };
                let bounds = JointErrorBounds::none(&site.robot);
                (site, bounds)
            }
            Belief::Calibrated => {
                let mut calibrated = self.robot.clone();
                for sensor in &mut calibrated.sensors {
                    (sensor.gain_bound, sensor.offset_bound_rad) = (0.004, 0.014);
                }
                (site, JointErrorBounds::datasheet(&calibrated))
            }
            Belief::Datasheet => {
                let bounds = JointErrorBounds::datasheet(&site.robot);
                (site, bounds)
            }
        }
    }
}

/// Random queries of a study.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathQueries {
    pub n: usize,
    pub margin_m: f64,
    pub seed: u64,
}

/// Plans random queries. `clock` returns seconds.
#[must_use]
pub fn path_study(site: &PathSite, belief: Belief, queries: PathQueries, clock: &dyn Fn() -> f64) -> PathStudy {
    let PathQueries { n, margin_m, seed } = queries;
    let (believed, bounds) = site.believed(belief);
    let clearance = ClearanceModel::new(&believed.robot, &believed.vehicle, &believed.scene);
    let limits = bounds.safe_limits(&believed.robot);
    let planner = PathPlanner { clearance: &clearance, bounds: &bounds, limits: &limits, margin_m };
    let timing = Timing::new(&believed.robot);
    let query = |k: usize| {
        let mut rng = stream_rng(seed, &format!("{} {} {k}", site.name, belief.name()));
        let mut free = || loop {
            use rand::RngExt;
            let at =
                JointAngles::from_fn(limits.len(), |j| rng.random_range(limits[j].lower_rad..=limits[j].upper_rad));
            if planner.is_free_to_arrive(&at) {
                return at;
            }
        };
        let (from, to) = (free(), free());
        let start_s = clock();
        let path = planner.plan(&from, &to, &mut rng).ok();
        let plan_s = clock() - start_s;
        let steps = |path: &Path| path.waypoints.windows(2).map(|edge| edge[0].max_abs_difference(&edge[1])).sum();
        let length_rad = path.as_ref().map_or(f64::NAN, steps);
        let duration_s = path.as_ref().map_or(f64::NAN, |path| timing.path_duration_s(path));
        PathRow { from, to, path, length_rad, duration_s, plan_s }
    };
    PathStudy { site: site.name.clone(), belief, rows: (0..n).map(query).collect() }
}

impl PathStudy {
    #[must_use]
    pub fn n_found(&self) -> usize {
        self.rows.iter().filter(|row| row.path.is_some()).count()
    }

    /// One row as text: successes, times, lengths.
    #[must_use]
    pub fn summary(&self) -> String {
        let times: Vec<f64> = self.rows.iter().map(|row| row.plan_s).collect();
        let found: Vec<&PathRow> = self.rows.iter().filter(|row| row.path.is_some()).collect();
        let ms = |share: f64| 1e3 * quantile(&times, share).unwrap_or(f64::NAN);
        let median = |of: fn(&PathRow) -> f64| {
            quantile(&found.iter().map(|row| of(row)).collect::<Vec<_>>(), 0.5).unwrap_or(f64::NAN)
        };
        let (n, n_found) = (self.rows.len(), self.n_found());
        let (length_rad, duration_s) = (median(|row| row.length_rad), median(|row| row.duration_s));
        format!(
            "{:<14} {:<11} {n:>7} {n_found:>6} {:>9.2} {:>9.1} {:>9.1} {length_rad:>10.2} {duration_s:>8.1}",
            self.site,
            self.belief.name(),
            ms(0.5),
            ms(0.99),
            ms(1.0)
        )
    }

    /// Column heads of [`PathStudy::summary`].
    #[must_use]
    pub fn heading() -> String {
        format!(
            "{:<14} {:<11} {:>7} {:>6} {:>9} {:>9} {:>9} {:>10} {:>8}",
            "site", "belief", "queries", "found", "median ms", "99 % ms", "max ms", "median rad", "median s"
        )
    }
}

/// paths.csv without times, so the same seed gives the same bytes.
#[must_use]
pub fn paths_csv(studies: &[PathStudy]) -> String {
    let mut text = "site,belief,query,found,waypoints,length_rad,duration_s\n".to_owned();
    for study in studies {
        for (k, row) in study.rows.iter().enumerate() {
            let n = row.path.as_ref().map_or(0, |path| path.waypoints.len());
            let (site, belief) = (&study.site, study.belief.name());
            text += &format!("{site},{belief},{k},{},{n},{:.4},{:.3}\n", n > 0, row.length_rad, row.duration_s);
        }
    }
    text
}

/// Shapes, joints and queries for third-party planners: everything in the base frame, quaternions as w, x, y, z.
#[must_use]
pub fn problem_json(site: &PathSite, queries: &[Value], margin_m: f64) -> Value {
    let (robot, vehicle) = (&site.robot, &site.vehicle);
    let base_from_vehicle = *vehicle.vehicle_from_base.inverse().isometry();
    let standing = vehicle.parts.iter().chain(&site.scene.obstacles);
    let joints = robot.chain.joints().iter().zip(&robot.sensors).map(|(joint, sensor)| {
        json!({
            "name": joint.name, "parent_from_joint": place(&joint.parent_from_joint), "axis": joint.axis.as_slice(),
            "limits_rad": joint.limits.map(|l| [l.lower_rad, l.upper_rad]), "max_rate_rad_s": sensor.max_rate_rad_s,
        })
    });
    let bodies = robot.bodies.iter().map(|body| {
        let shapes = body.collisions.iter().map(|s| shape(s, &Isometry3::identity())).collect::<Vec<_>>();
        json!({ "name": body.name, "shapes": shapes })
    });
    json!({
        "site": site.name, "arm": robot.name, "margin_m": margin_m,
        // Links against links need less margin: they neither sway nor are surveyed. Neighbours are not tested.
        "self_margin_m": margin_m - armcal_belief::plan::SELF_MARGIN_REDUCTION_M,
        "seafloor_z_m": site.scene.seafloor_z_m, "base_from_world": place(&base_from_vehicle),
        "joints": joints.collect::<Vec<_>>(), "bodies": bodies.collect::<Vec<_>>(),
        "standing": standing.map(|part| shape(&part.placed, &base_from_vehicle)).collect::<Vec<_>>(),
        "queries": queries,
    })
}

/// Queries of a study with their results.
#[must_use]
pub fn queries_json(study: &PathStudy) -> Vec<Value> {
    let query = |row: &PathRow| {
        json!({ "from_rad": row.from.to_vec(), "to_rad": row.to.to_vec(), "found": row.path.is_some(),
                "length_rad": row.path.is_some().then_some(row.length_rad), "plan_ms": 1e3 * row.plan_s })
    };
    study.rows.iter().map(query).collect()
}

fn place(isometry: &Isometry3<f64>) -> Value {
    let (t, q) = (isometry.translation.vector, isometry.rotation);
    json!({ "position_m": [t.x, t.y, t.z], "quaternion_wxyz": [q.w, q.i, q.j, q.k] })
}

fn shape(placed: &PlacedShape, frame_from_owner: &Isometry3<f64>) -> Value {
    let kind = match &placed.shape {
        Shape::Box { size_m } => json!({ "kind": "box", "size_m": size_m }),
        Shape::Cylinder { radius_m, length_m } => {
            json!({ "kind": "cylinder", "radius_m": radius_m, "length_m": length_m })
        }
        Shape::Capsule { radius_m, length_m } => {
            json!({ "kind": "capsule", "radius_m": radius_m, "length_m": length_m })
        }
        Shape::Sphere { radius_m } => json!({ "kind": "sphere", "radius_m": radius_m }),
        Shape::Hull(hull) => json!({ "kind": "hull", "corners_m": hull.corners_m(), "triangles": hull.triangles() }),
    };
    json!({ "shape": kind, "place": place(&(frame_from_owner * placed.owner_from_shape)) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::robot::{load, load_vehicle};

    #[test]
    fn queries_are_planned_and_written_with_the_scene() {
        let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
        let vehicle = load_vehicle(&root.join("vehicles/tight-basket.toml")).expect("the vehicle reads");
        let robot = load(&root.join("titan4")).expect("the robot reads").mounted_on(&vehicle).expect("it fits");
        let scene = Scene { seafloor_z_m: Some(-2.2), obstacles: vec![] };
        let site = PathSite { name: "tight-basket".to_owned(), robot, vehicle, scene };
        let study = |seed| path_study(&site, Belief::Alone, PathQueries { n: 12, margin_m: 0.05, seed }, &|| 0.0);
        let (first, again, other) = (study(1), study(1), study(2));
        let csv = |study: &PathStudy| paths_csv(std::slice::from_ref(study));
        assert_eq!(csv(&first), csv(&again), "the same seed gives the same bytes");
        assert_ne!(csv(&first), csv(&other));
        assert!(first.n_found() >= 10, "{}", first.n_found());
        let written = problem_json(&site, &queries_json(&first), 0.05);
        assert_eq!(written["queries"].as_array().map(Vec::len), Some(12));
        assert_eq!(written["standing"].as_array().map(Vec::len), Some(site.vehicle.parts.len()));
        assert_eq!(written["bodies"].as_array().map(Vec::len), Some(7));
        assert!((written["self_margin_m"].as_f64().expect("a number") - 0.02).abs() < 1e-12);
    }
}
