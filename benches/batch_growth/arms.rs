//! Calibrations of an arm: many views, and many tags.

use armcal::calib::bundle::{HyperparameterMode, estimate, least_squares};
use armcal::robot::Robot;
use armcal::spatial::{Pose, exp};
use armcal::stats::stream_rng;
use nalgebra::Vector6;
use rand::RngExt;

use crate::measure::{Row, measured};
use crate::problems::{Problem, Sight, corners_of, robot};

const JOINT_STD_RAD: f64 = 2e-4;
/// Tags of a view, whatever the number there is.
const TAGS_A_VIEW: usize = 8;
/// How far about the robot's own tags further ones are put.
const SPREAD_M: f64 = 0.4;
const TURN_RAD: f64 = 0.3;
const RELATIVE_GAIN: f64 = 1e-10;

fn problem(n_views: usize, n_tags: usize) -> Problem {
    let robot = with_tags(robot(), n_tags);
    let sight = Sight { joint_std_rad: JOINT_STD_RAD, n_tags: TAGS_A_VIEW.min(n_tags) };
    corners_of(robot, n_views as u32, sight)
}

/// The first of the robot's tags, and as many more about them as are wanted.
fn with_tags(mut robot: Robot, n_tags: usize) -> Robot {
    let mut rng = stream_rng(1, "tags of the growth");
    let own = robot.tags.clone();
    for k in own.len()..n_tags {
        let mut tag = own[k % own.len()].clone();
        tag.id = k as u32;
        let step = Vector6::from_fn(|row, _| {
            let most = if row < 3 { SPREAD_M } else { TURN_RAD };
            rng.random_range(-most..most)
        });
        tag.base_from_tag = Pose::from_isometry(tag.base_from_tag.isometry() * exp(&step));
        robot.tags.push(tag);
    }
    robot.tags.truncate(n_tags);
    robot
}

/// Least squares with the scales given.
pub fn solved(n_views: usize, n_tags: usize) -> Row {
    let problem = problem(n_views, n_tags);
    let (found, cost) = measured(|| least_squares(&problem.input(HyperparameterMode::Given), RELATIVE_GAIN));
    row(&problem, found.iterations, cost)
}

/// The whole estimate: robust start, outliers, scales by evidence.
pub fn estimated(n_views: usize, n_tags: usize) -> Row {
    let problem = problem(n_views, n_tags);
    let (steps, cost) = measured(|| {
        let found = estimate(&problem.input(HyperparameterMode::Fitted)).expect("the views determine the arm");
        assert!(found.is_consistent(), "the estimate does not fit the views that its own model drew");
        found.iterations
    });
    row(&problem, steps, cost)
}

fn row(problem: &Problem, steps: usize, cost: crate::measure::Cost) -> Row {
    let n_detections = problem.views.iter().map(|view| view.tags.len()).sum();
    Row { n_detections, steps, cost, far_end: None }
}
