//! Plans a path for your own arm, certifies it for every arm within the sensors' error bounds, and computes its timing.
//!
//! Run `cargo run --release --example certify_path -- ROBOT_FOLDER VEHICLE_FILE`; without arguments it uses a Titan 4
//! class arm on a work-class vehicle. Start and goal are random configurations that are clear themselves.

#![allow(clippy::print_stdout, reason = "a small program, for a terminal")]

use std::env::args;
use std::error::Error;
use std::path::{Path, PathBuf};

use armcal::plan::LeastClearance;
use armcal::routine::Scene;
use armcal::stats::stream_rng;
use armcal::{ClearanceModel, JointAngles, JointErrorBounds, PathPlanner, Timing, load_robot, load_vehicle};
use rand::RngExt;

/// Clearance required beyond the error bounds, m.
const MARGIN_M: f64 = 0.05;
const N_QUERIES: usize = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let file = |number, default: &str| {
        args().nth(number).map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join(default), PathBuf::from)
    };
    let vehicle = load_vehicle(&file(2, "robots/vehicles/work-class-front.toml"))?;
    let robot = load_robot(&file(1, "robots/titan4"))?.mounted_on(&vehicle)?;

    let clearance = ClearanceModel::new(&robot, &vehicle, &Scene::default());
    let bounds = JointErrorBounds::datasheet(&robot);
    let limits = bounds.safe_limits(&robot);
    let planner = PathPlanner { clearance: &clearance, bounds: &bounds, limits: &limits, margin_m: MARGIN_M };
    let timing = Timing::new(&robot);
    let mut rng = stream_rng(1, "queries");
    let mut free_configuration = || loop {
        let angles =
            JointAngles::from_fn(limits.len(), |j| rng.random_range(limits[j].lower_rad..=limits[j].upper_rad));
        if planner.is_free_to_arrive(&angles) {
            return angles;
        }
    };
    let queries: Vec<[JointAngles; 2]> = (0..N_QUERIES).map(|_| [free_configuration(), free_configuration()]).collect();
    for (number, [from, to]) in queries.iter().enumerate() {
        println!("{} query {number}: {:.2?} to {:.2?} rad", robot.name, from.to_vec(), to.to_vec());
        match planner.plan(from, to, &mut rng) {
            Ok(path) => {
                let least = LeastClearance::along(&clearance, &bounds, &path, MARGIN_M);
                println!(
                    "  {} edges, {:.1} s; clearance of the nominal arm {:.3} m, of every arm within the bounds {:.3} m",
                    path.n_edges(),
                    timing.path_duration_s(&path),
                    least.believed_m,
                    least.proven_m
                );
            }
            Err(why) => println!("  no path: {why}"),
        }
    }
    Ok(())
}
