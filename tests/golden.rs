//! Published figures: the paper's kinematics of the Titan 4, and the makers' datasheets of both arms.

use armcal::kinematics::LinkPoses;
use armcal::robot::{Robot, load};
use armcal::streams::JointAngles;
use nalgebra::Vector3;

use crate::support::{root, titan};

/// Tolerance of origins, m: the published ones have four digits.
const PUBLISHED_ORIGIN_M: f64 = 6e-5;
/// Tolerance of axes: the published ones have four digits.
const PUBLISHED_AXIS: f64 = 6e-5;

/// Joint origins (m) and axes in the base at the zero pose.
const ZERO_POSE: [([f64; 3], [f64; 3]); 6] = [
    ([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
    ([0.0043, 0.1211, -0.0016], [0.9994, -0.0356, 0.0]),
    ([0.0115, 0.3228, 0.8250], [0.9994, -0.0356, 0.0]),
    ([0.0258, 0.7253, 0.5591], [0.9994, -0.0356, 0.0]),
    ([0.0288, 0.8033, 0.4510], [-0.0289, -0.8101, -0.5856]),
    ([0.0314, 0.8506, 0.3858], [-0.0328, -0.5848, 0.8105]),
];

#[test]
fn joints_lie_where_the_paper_has_them_at_zero() {
    let robot = titan();
    let poses = robot.chain.link_poses(&JointAngles::zeros(6));
    for (joint, (origin_m, axis)) in ZERO_POSE.iter().enumerate() {
        let off_m = (poses.joint_origin(joint) - Vector3::from(*origin_m)).amax();
        let off_axis = (poses.axis(joint) - Vector3::from(*axis)).amax();
        assert!(off_m < PUBLISHED_ORIGIN_M, "joint {joint}: origin {:?}", poses.joint_origin(joint));
        assert!(off_axis < PUBLISHED_AXIS, "joint {joint}: axis {:?}", poses.axis(joint));
    }
}

fn tool_m(robot: &Robot, poses: &LinkPoses) -> Vector3<f64> {
    poses.frame(&robot.tool.mount).translation.vector
}

/// Largest reach found from `start`, joint by joint with shrinking steps, without limits.
fn largest_reach_from(robot: &Robot, start: JointAngles) -> f64 {
    let reach = |angles: &JointAngles| tool_m(robot, &robot.chain.link_poses(angles)).norm();
    let (mut at, mut best, mut step_rad) = (start, reach(&start), 1.0);
    while step_rad > 1e-7 {
        let mut has_gained = false;
        for joint in 0..at.len() {
            for turn in [step_rad, -step_rad] {
                let mut trial = at;
                trial[joint] += turn;
                let length = reach(&trial);
                if length > best {
                    (at, best, has_gained) = (trial, length, true);
                }
            }
        }
        step_rad = if has_gained { step_rad } else { 0.5 * step_rad };
    }
    best
}

/// The datasheet says 1922 mm; these kinematics give 1.9216 m.
#[test]
fn the_largest_reach_is_the_datasheets() {
    /// Tolerance, m: the figure has four decimals, and the search ends within micrometres of a maximum.
    const TOLERANCE_M: f64 = 2e-4;
    let robot = titan();
    let starts = [
        [0.0; 6],
        [0.0, -1.0, 1.4, -0.4, 0.0, 0.0],
        [-1.5, -0.5, 2.5, 0.5, -0.5, 1.0],
        [-3.0, -2.0, -0.8, 1.2, 1.5, 0.0],
    ];
    let largest = starts
        .iter()
        .map(|start| largest_reach_from(&robot, JointAngles::from_slice(start)))
        .inspect(|reach| eprintln!("reach {reach:.5} m"))
        .fold(0.0, f64::max);
    assert!((largest - 1.9216).abs() < TOLERANCE_M, "{largest}");
}

#[test]
fn joint_ranges_and_weight_are_the_datasheets() {
    /// Tolerance, deg: the datasheet has whole degrees.
    const RANGE_DEG: f64 = 0.1;
    /// Tolerance, kg: the datasheet has whole kilograms, and the static bracket is not among the links.
    const MASS_KG: f64 = 0.5;
    let robot = titan();
    let ranges = robot.chain.joints().iter().map(|j| j.limits.map(|l| (l.upper_rad - l.lower_rad).to_degrees()));
    let ranges: Vec<Option<f64>> = ranges.collect();
    for (found, published) in ranges.iter().zip([240.0, 120.0, 260.0, 180.0, 180.0]) {
        assert!(found.is_some_and(|range| (range - published).abs() < RANGE_DEG), "{ranges:?}");
    }
    assert_eq!(ranges[5], None, "the wrist turns without end");
    let mass_kg: f64 = robot.bodies.iter().map(|body| body.mass_kg).sum();
    assert!((mass_kg - 100.0).abs() < MASS_KG, "{mass_kg} kg");
}

/// The tool point lies on the last joint's axis, so no tool position depends on that joint's error.
#[test]
fn the_last_joint_does_not_move_the_tool_point() {
    let robot = titan();
    let poses = robot.chain.link_poses(&robot.stowed);
    assert!(poses.point_jacobian(5, &tool_m(&robot, &poses)).norm() < 1e-12);
    assert_eq!(robot.camera.mount.n_joints, 5, "the camera hangs before the last joint");
}

fn kraft() -> Robot {
    load(&root().join("robots/kraft-predator")).expect("the robot reads")
}

/// The datasheet has 875, 566, 121 and 359 mm from axis to axis to tip, 2013 mm of reach; the arm is straight at zero.
#[test]
fn the_second_arm_has_the_lengths_and_the_reach_of_its_datasheet() {
    /// Tolerance, m, for sums of three-digit figures.
    const TOLERANCE_M: f64 = 1e-9;
    let robot = kraft();
    let zero = JointAngles::zeros(6);
    let poses = robot.chain.link_poses(&zero);
    let tool = tool_m(&robot, &poses);
    let axes: Vec<Vector3<f64>> = (1..5).map(|joint| poses.joint_origin(joint)).collect();
    let lengths = [axes[1] - axes[0], axes[2] - axes[1], axes[3] - axes[2], tool - axes[3]].map(|d| d.norm());
    for (length_m, published_m) in lengths.iter().zip([0.875, 0.566, 0.121, 0.359]) {
        assert!((length_m - published_m).abs() < TOLERANCE_M, "{lengths:?}");
    }
    let within =
        robot.chain.joints().iter().all(|j| j.limits.is_some_and(|l| l.lower_rad <= 0.0 && l.upper_rad >= 0.0));
    assert!(within, "the straight arm is one that its joints allow");
    assert!((tool.norm() - 2.013).abs() < TOLERANCE_M, "{}", tool.norm());
    for start in [[0.3; 6], [1.0, 0.5, -1.5, 1.0, -1.0, 0.0]] {
        let largest = largest_reach_from(&robot, JointAngles::from_slice(&start));
        eprintln!("reach {largest:.6} m");
        // The search ends within micrometres of a maximum, and never above it.
        assert!((largest - 2.013).abs() < 1e-5, "{largest}");
    }
}

#[test]
fn the_second_arms_ranges_and_weights_are_its_datasheets() {
    let robot = kraft();
    let ranges = robot.chain.joints().iter().map(|j| j.limits.map(|l| (l.upper_rad - l.lower_rad).to_degrees()));
    let ranges: Vec<Option<f64>> = ranges.collect();
    for (found, published) in ranges.iter().zip([270.0, 120.0, 125.0, 200.0, 200.0, 340.0]) {
        assert!(found.is_some_and(|range| (range - published).abs() < 1e-3), "{ranges:?}");
    }
    let mass_kg: f64 = robot.bodies.iter().map(|body| body.mass_kg).sum();
    assert!((mass_kg - 80.0).abs() < 1e-9, "{mass_kg} kg");
    assert!((mass_kg * (1.0 - robot.buoyancy_fraction) - 51.0).abs() < 1e-9, "in sea water");
    assert_eq!(titan().buoyancy_fraction, 0.22, "78 of 100 kg");
    // The flange of either arm is bolted 0.325 m below its base frame.
    for robot in [kraft(), titan()] {
        let base = &robot.bodies[0].collisions[0];
        let lowest_m = base.owner_from_shape.translation.z - 0.5 * base.shape.box_m()[2];
        assert!((lowest_m + 0.325).abs() < 1e-9, "{}: {lowest_m}", robot.name);
    }
    let poses = robot.chain.link_poses(&robot.stowed);
    assert!(poses.point_jacobian(5, &tool_m(&robot, &poses)).norm() < 1e-12);
    assert_eq!(robot.camera.mount.n_joints, 5, "the camera hangs before the last joint");
}
