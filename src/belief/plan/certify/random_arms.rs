//! Randomly drawn arms of 4 to 8 joints, with joints without stops anywhere: a certificate holds for every arm within
//! the bounds, regardless of which joint errs.

use std::fmt::Write as _;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::certify::tests::some_arm;
use crate::plan::{ClearanceModel, Edge, JointErrorBounds};
use armcal_core::robot::{Part, PlacedShape, Robot, Shape, Vehicle, load, load_vehicle};
use armcal_core::routine::Scene;
use armcal_core::spatial::Pose;
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointAngles;

const MARGIN_M: f64 = 0.03;
/// Supports are exact to rounding.
const ROUNDING_M: f64 = 1e-9;
const N_JOINTS: [usize; 4] = [4, 6, 7, 8];

/// Returns a box or a cylinder along most of the link, off its axis.
fn drawn_link(number: usize, length_m: f64, rng: &mut ChaCha8Rng) -> String {
    let (radius_m, beside_m): (f64, f64) = (rng.random_range(0.02..0.05), rng.random_range(-0.05..0.05));
    let shape = if rng.random_range(0.0..1.0) < 0.5 {
        format!("<box size=\"{} {} {}\"/>", 0.8 * length_m, 2.0 * radius_m, 3.0 * radius_m)
    } else {
        format!("<cylinder radius=\"{radius_m}\" length=\"{}\"/>", 0.8 * length_m)
    };
    format!(
        "<link name=\"l{number}\"><inertial><mass value=\"5\"/><inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" \
         iyy=\"0.1\" iyz=\"0\" izz=\"0.1\"/></inertial><collision>\
         <origin xyz=\"{} {beside_m} 0\" rpy=\"0 1.5708 0\"/><geometry>{shape}</geometry></collision></link>\n",
        0.5 * length_m
    )
}

/// Returns a serial arm. One joint (the first, a middle or the last one, by the arm's number) has no stops, and others
/// may have none.
fn drawn_arm(number: usize, rng: &mut ChaCha8Rng) -> Robot {
    let n = N_JOINTS[number % N_JOINTS.len()];
    let turns = [0, n / 2, n - 1][number / N_JOINTS.len() % 3];
    let (mut urdf, mut sensors) = (String::from("<robot name=\"drawn\"><link name=\"l0\"/>"), String::new());
    let mut length_m = 0.0;
    for j in 0..n {
        let without_stops = j == turns || rng.random_range(0.0..1.0) < 0.15;
        let (kind, range) = if without_stops {
            ("continuous", String::new())
        } else {
            let middle: f64 = rng.random_range(-0.8..0.8);
            let half: f64 = rng.random_range(0.7..1.9);
            ("revolute", format!("lower=\"{}\" upper=\"{}\" ", middle - half, middle + half))
        };
        let axis = ["1 0 0", "0 1 0", "0 0 1", "0.6 0 0.8"][rng.random_range(0..4)];
        let mut angle = || -> f64 { rng.random_range(-1.0..1.0) };
        let turn = [angle(), angle(), angle()];
        writeln!(
            urdf,
            "<joint name=\"j{j}\" type=\"{kind}\"><parent link=\"l{j}\"/><child link=\"l{}\"/>\
             <origin xyz=\"{length_m} 0 0\" rpy=\"{} {} {}\"/><axis xyz=\"{axis}\"/>\
             <limit {range}effort=\"500\" velocity=\"1\"/></joint>",
            j + 1,
            turn[0],
            turn[1],
            turn[2]
        )
        .expect("written");
        length_m = rng.random_range(0.15..0.5);
        urdf.push_str(&drawn_link(j + 1, length_m, rng));
        writeln!(
            sensors,
            "[[joint_sensor]]\njoint = \"j{j}\"\nkind = \"potentiometer\"\noffset_counts = 0.0\n\
             scale_counts_per_deg = 46.0\nwrap_counts = 65536.0\ngain_std = 0.02\noffset_std_rad = 0.01\n\
             gain_bound = {}\noffset_bound_rad = {}\nnoise_std_counts = 2.0\nlinearity_std_rad = 0.002\n\
             max_rate_rad_s = 0.5",
            rng.random_range(0.0..0.03),
            rng.random_range(0.0..0.06)
        )
        .expect("written");
    }
    urdf.push_str("</robot>");
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("drawn.urdf"), urdf).expect("written");
    let text = format!(
        "version = 1\nkind = \"robot\"\n\
         name = \"drawn\"\nurdf = \"drawn.urdf\"\nbase_link = \"l0\"\nbase_tag = 0\nstowed_rad = {:?}\n\
         [tool]\nlink = \"l{n}\"\npoint_m = [{length_m}, 0.0, 0.0]\n{sensors}\
         [camera]\nname = \"wrist\"\nlink = \"l{n}\"\nmodel = \"equidistant\"\nresolution_px = [1224, 1024]\n\
         focal_px = [387.0, 387.0]\ncenter_px = [612.0, 512.0]\ndistortion = [0.0, 0.0, 0.0, 0.0]\n\
         max_view_angle_rad = 1.4\ncorner_std_px = 0.3\nmount_std_m = 0.002\nmount_std_rad = 0.0035\n",
        vec![0.0; n]
    );
    std::fs::write(folder.path().join("robot.toml"), text).expect("written");
    load(folder.path()).expect("the drawn robot reads")
}

/// Returns a vehicle with a deck under the arm, and a post and a panel next to it at random positions.
fn drawn_vehicle(rng: &mut ChaCha8Rng) -> Vehicle {
    let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let mut vehicle = load_vehicle(&root.join("robots/vehicles/work-class-front.toml")).expect("the vehicle reads");
    let mut part = |name: &str, size_m: [f64; 3]| {
        let at = [rng.random_range(0.3..1.2), rng.random_range(-1.0..1.0), rng.random_range(-0.8..0.8)];
        let place = nalgebra::Isometry3::translation(at[0], at[1], at[2]);
        let placed = PlacedShape { owner_from_shape: place, shape: Shape::Box { size_m }, color_rgb: [0; 3] };
        Part { name: name.to_owned(), placed }
    };
    vehicle.parts = vec![part("post", [0.1, 0.1, 0.9]), part("panel", [0.04, 0.5, 0.6])];
    vehicle.vehicle_from_base = Pose::identity();
    vehicle
}

fn drawn_pose(robot: &Robot, bounds: &JointErrorBounds, rng: &mut ChaCha8Rng) -> JointAngles {
    let limits = bounds.safe_limits(robot);
    JointAngles::from_fn(robot.n_joints(), |j| rng.random_range(limits[j].lower_rad..=limits[j].upper_rad))
}

/// Returns the least clearance of 150 arms in the error box, with errors in every joint.
fn brute_m(clearance: &ClearanceModel<'_>, at: &JointAngles, bounds: &JointErrorBounds, rng: &mut ChaCha8Rng) -> f64 {
    let arms = (0..150).map(|_| some_arm(at, bounds, |_| true, rng));
    arms.map(|arm| clearance.nearest(&arm).distance_m).fold(clearance.nearest(at).distance_m, f64::min)
}

#[test]
fn certificates_of_drawn_arms_hold_for_every_joints_error() {
    let (mut poses, mut edges, mut tight) = (0, 0, 0);
    for number in 0..50 {
        let mut rng = stream_rng(number as u64, "drawn arm");
        let (robot, vehicle) = (drawn_arm(number, &mut rng), drawn_vehicle(&mut rng));
        let scene = Scene { seafloor_z_m: Some(-1.0), obstacles: Vec::new() };
        let clearance = ClearanceModel::new(&robot, &vehicle, &scene);
        let bounds = JointErrorBounds::datasheet(&robot);
        let mut clear = Vec::new();
        for _ in 0..400 {
            let at = drawn_pose(&robot, &bounds, &mut rng);
            // Far from all shapes any certificate holds.
            let is_near = clear.len() < 8 && clearance.nearest(&at).distance_m < 0.25;
            if is_near && clearance.find_violation(&at, &bounds, MARGIN_M).is_none() {
                clear.push(at);
            }
        }
        for at in &clear {
            let least_m = brute_m(&clearance, at, &bounds, &mut rng);
            assert!(least_m >= MARGIN_M - ROUNDING_M, "arm {number} at {at:?}: {least_m}");
            tight += i32::from(least_m < 2.0 * MARGIN_M);
            poses += 1;
        }
        for from in &clear {
            let other = drawn_pose(&robot, &bounds, &mut rng);
            let to = JointAngles::from_fn(from.len(), |j| from[j] + 0.2 * (other[j] - from[j]));
            if clearance.find_violation_along(&Edge::at_full_speed(*from, to), &bounds, MARGIN_M).is_some() {
                continue;
            }
            for step in 0..=6 {
                let share = f64::from(step) / 6.0;
                let at = JointAngles::from_fn(from.len(), |j| from[j] + share * (to[j] - from[j]));
                let least_m = brute_m(&clearance, &at, &bounds, &mut rng);
                assert!(least_m >= MARGIN_M - ROUNDING_M, "arm {number}, {from:?} to {to:?}: {least_m}");
            }
            edges += 1;
        }
    }
    eprintln!("{poses} poses ({tight} tight) and {edges} edges certified");
    assert!(poses > 200 && edges > 60 && tight > 40, "{poses} {edges} {tight}");
}

#[test]
fn the_error_of_a_joint_without_stops_counts_wherever_it_is() {
    for number in 0..12 {
        let mut rng = stream_rng(number as u64, "drawn arm");
        let robot = drawn_arm(number, &mut rng);
        let clearance = ClearanceModel::of_arm_alone(&robot);
        for (joint, spec) in robot.chain.joints().iter().enumerate() {
            let is_last = joint + 1 == robot.n_joints();
            assert!(clearance.has_error(joint) || (is_last && spec.limits.is_none()), "{number}: {joint}");
            assert_eq!(clearance.has_stops(joint), spec.limits.is_some());
        }
    }
}
