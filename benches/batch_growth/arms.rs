//! Calibrations of an arm: many views, and many tags.

use armcal::calib::TagMeasurement;
use armcal::calib::bundle::{HyperparameterMode, estimate, least_squares};
use armcal::joints::JointAngles;
use armcal::robot::Robot;
use armcal::sensor::ArmSensors;
use armcal::spatial::{Pose, exp};
use armcal::stats::stream_rng;
use armcal::streams::{CaptureSet, JointSensorSample, Mark, MarkKind, Message, TagDetection, TagDetections};
use armcal::{Method, Recording, Status, calibrate};
use nalgebra::Vector6;
use rand::RngExt;

use crate::measure::{Row, measured};
use crate::problems::{Problem, Sight, corners_of, robot};

const JOINT_STD_RAD: f64 = 2e-4;
/// Number of tags in a view, for any number of tags around the arm.
const TAGS_A_VIEW: usize = 8;
/// Largest distance of further tags from the robot's own, m.
const SPREAD_M: f64 = 0.4;
const TURN_RAD: f64 = 0.3;
const RELATIVE_GAIN: f64 = 1e-10;

fn problem(n_views: usize, n_tags: usize) -> Problem {
    let robot = with_tags(robot(), n_tags);
    let sight = Sight { joint_std_rad: JOINT_STD_RAD, n_tags: TAGS_A_VIEW.min(n_tags) };
    corners_of(robot, n_views as u32, sight)
}

/// The robot with `n_tags` tags: its own first ones, and as many further ones near them as needed.
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

/// Cost of least squares with the given scales.
pub fn solved(n_views: usize, n_tags: usize) -> Row {
    let problem = problem(n_views, n_tags);
    let (found, cost) = measured(|| least_squares(&problem.input(HyperparameterMode::Given), RELATIVE_GAIN));
    row(&problem, found.iterations, cost)
}

/// Cost of the whole estimate: robust start, outliers, scales by evidence.
pub fn estimated(n_views: usize, n_tags: usize) -> Row {
    let problem = problem(n_views, n_tags);
    let (steps, cost) = measured(|| {
        let found = estimate(&problem.input(HyperparameterMode::Fitted)).expect("the views determine the arm");
        assert!(found.is_consistent(), "the estimate does not fit the views that its own model drew");
        found.iterations
    });
    row(&problem, steps, cost)
}

/// Cost of `armcal calibrate` on a recording of the views after it was read: from messages to the verdict.
pub fn calibrated(n_views: usize, n_tags: usize) -> Row {
    let problem = problem(n_views, n_tags);
    let recording = recorded(&problem);
    let (steps, cost) = measured(|| {
        let found = calibrate(&recording, &problem.robot, Method::Bundle).expect("the recording can be calibrated");
        assert_eq!(found.status, Status::Accepted, "{:?}", found.refusal);
        found.fit.evaluations
    });
    row(&problem, steps, cost)
}

/// Recording of the views, every fifth of them held out.
fn recorded(problem: &Problem) -> Recording {
    let sensors = ArmSensors::nominal(&problem.robot);
    let mut messages = Vec::new();
    for view in &problem.views {
        let end = view.end;
        let (start, middle) = (end.plus_s(-1.0), end.plus_s(-0.5));
        let travel_rad = |j: usize| problem.robot.sensors[j].center_rad + view.travel_rad[j];
        let counts = sensors.counts(&JointAngles::from_fn(problem.robot.n_joints(), travel_rad));
        messages.push((middle, Message::JointSensors(JointSensorSample { stamp: middle, counts })));
        let tags = view.tags.iter().filter_map(|tag| match &tag.measured {
            TagMeasurement::Corners(seen) => {
                Some(TagDetection { id: tag.id, corners_px: seen.corners_px, decision_margin: 60.0 })
            }
            _ => None,
        });
        messages.push((middle, Message::Detections(TagDetections { stamp: middle, tags: tags.collect() })));
        let set = if view.pose_idx % 5 == 4 { CaptureSet::HeldOut } else { CaptureSet::Fit };
        let kind = MarkKind::Capture { set, pose_idx: view.pose_idx };
        messages.push((end, Message::Mark(Mark { start, end, kind })));
    }
    Recording { messages, joint_names: problem.robot.joint_names(), ..Recording::default() }
}

fn row(problem: &Problem, steps: usize, cost: crate::measure::Cost) -> Row {
    let n_detections = problem.views.iter().map(|view| view.tags.len()).sum();
    Row { n_detections, steps, cost, far_end: None }
}
