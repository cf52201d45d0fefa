//! Comparison with tools that share no code with ours; `tests/oracle` has the scripts that made the files of
//! `tests/golden`.

mod dynamics;
mod paths;
mod pendulum;
mod steps;
mod water;

use armcal::optics::Fisheye;
use armcal::streams::JointAngles;
use nalgebra::{Isometry3, Matrix3, Vector2, Vector3};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::support::{root, titan};

/// Robots, and the files that Pinocchio made from them.
const ARMS: [(&str, &str); 3] = [
    ("robots/titan4", "kinematics.json"),
    ("robots/kraft-predator", "kinematics-kraft-predator.json"),
    ("tests/golden/slides", "kinematics-slides.json"),
];

fn arms() -> impl Iterator<Item = (armcal::robot::Robot, Kinematics)> {
    ARMS.into_iter().map(|(name, file)| {
        let robot = armcal::robot::load(&root().join(name)).expect("the robot reads");
        let file: Kinematics = golden(file);
        assert_eq!(file.joint_names, robot.joint_names());
        assert!(file.cases.len() >= 50);
        (robot, file)
    })
}

fn golden<T: DeserializeOwned>(name: &str) -> T {
    let path = root().join("tests/golden").join(name);
    let text = std::fs::read_to_string(&path).expect("a golden file");
    serde_json::from_str(&text).expect("the golden file has the expected form")
}

#[derive(Deserialize)]
struct Kinematics {
    joint_names: Vec<String>,
    tool_link: String,
    cases: Vec<KinematicsCase>,
}

#[derive(Deserialize)]
struct KinematicsCase {
    joint_angles_rad: Vec<f64>,
    base_from_link: std::collections::BTreeMap<String, GoldenPose>,
    tool_point_in_base_m: [f64; 3],
    base_from_camera: GoldenPose,
    /// Rows of the Jacobian: vx vy vz wx wy wz.
    tool_point_jacobian_rows: [Vec<f64>; 6],
}

#[derive(Deserialize)]
struct GoldenPose {
    position_m: [f64; 3],
    rotation_matrix_rows: [[f64; 3]; 3],
}

impl GoldenPose {
    /// The largest difference of any position (m) or matrix entry.
    fn difference(&self, pose: &Isometry3<f64>) -> f64 {
        let rows = self.rotation_matrix_rows;
        let rotation = Matrix3::from_fn(|row, column| rows[row][column]);
        let position = (pose.translation.vector - Vector3::from(self.position_m)).amax();
        position.max((pose.rotation.to_rotation_matrix().matrix() - rotation).amax())
    }
}

/// Tolerance of positions (m) and directions: products of six rotations in double precision, with three digits to
/// spare.
const KINEMATICS_TOLERANCE: f64 = 1e-9;

#[test]
fn poses_are_those_of_pinocchio() {
    for (robot, file) in arms() {
        let mut worst: f64 = 0.0;
        for case in &file.cases {
            let poses = robot.chain.link_poses(&JointAngles::from_slice(&case.joint_angles_rad));
            for (body, link) in robot.bodies.iter().enumerate() {
                worst = worst.max(case.base_from_link[&link.name].difference(poses.link(body)));
            }
            worst = worst.max(case.base_from_camera.difference(&poses.frame(&robot.camera.mount)));
            let tool_m = poses.frame(&robot.tool.mount).translation.vector;
            worst = worst.max((tool_m - Vector3::from(case.tool_point_in_base_m)).amax());
        }
        assert_eq!(robot.bodies.last().map(|body| body.name.as_str()), Some(file.tool_link.as_str()));
        eprintln!("{}: largest difference from Pinocchio {worst:.1e}", robot.name);
        assert!(worst < KINEMATICS_TOLERANCE, "{}: {worst}", robot.name);
    }
}

#[test]
fn jacobians_are_those_of_pinocchio() {
    for (robot, file) in arms() {
        let mut worst: f64 = 0.0;
        for case in &file.cases {
            let poses = robot.chain.link_poses(&JointAngles::from_slice(&case.joint_angles_rad));
            let tool_m = poses.frame(&robot.tool.mount).translation.vector;
            for joint in 0..robot.n_joints() {
                let (linear, angular) = (poses.point_jacobian(joint, &tool_m), poses.turn_jacobian(joint));
                let golden = |row: usize| case.tool_point_jacobian_rows[row][joint];
                for row in 0..3 {
                    worst = worst.max((linear[row] - golden(row)).abs()).max((angular[row] - golden(row + 3)).abs());
                }
            }
        }
        eprintln!("{}: largest difference from Pinocchio {worst:.1e} m/rad", robot.name);
        assert!(worst < KINEMATICS_TOLERANCE, "{}: {worst}", robot.name);
    }
}

#[derive(Deserialize)]
struct Lenses {
    max_view_angle_rad: f64,
    cameras: Vec<Lens>,
}

#[derive(Deserialize)]
struct Lens {
    name: String,
    resolution_px: [u32; 2],
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: [f64; 4],
    cases: Vec<LensCase>,
}

#[derive(Deserialize)]
struct LensCase {
    point_in_camera_m: [f64; 3],
    pixel_px: [f64; 2],
    undistorted_xy_over_z: [f64; 2],
}

fn lenses() -> Vec<(Fisheye, Lens)> {
    let file: Lenses = golden("fisheye.json");
    let lens = |camera: &Lens| Fisheye {
        focal_px: camera.focal_px,
        center_px: camera.center_px,
        distortion: camera.distortion,
        resolution_px: camera.resolution_px,
        // OpenCV's points reach the limit angle; rounding must not put them beyond.
        max_view_angle_rad: file.max_view_angle_rad + 1e-9,
    };
    let lenses: Vec<_> = file.cameras.into_iter().map(|camera| (lens(&camera), camera)).collect();
    assert_eq!(lenses.len(), 2);
    lenses
}

#[test]
fn projection_is_opencvs() {
    /// Tolerance, px: double precision at 1e3 px, with the terms summed in another order.
    const TOLERANCE_PX: f64 = 1e-9;
    for (lens, camera) in lenses() {
        let mut worst: f64 = 0.0;
        for case in &camera.cases {
            let pixel = lens.project(&Vector3::from(case.point_in_camera_m)).expect("in view");
            worst = worst.max((pixel - Vector2::from(case.pixel_px)).amax());
        }
        eprintln!("{}: {} points, {worst:.1e} px", camera.name, camera.cases.len());
        assert!(camera.cases.len() >= 100 && worst < TOLERANCE_PX, "{worst}");
    }
}

#[test]
fn unprojection_is_opencvs_and_gives_the_point_back() {
    /// Tolerance, rad: OpenCV stops at 1e-15 rad; its file holds tangents, which lose digits towards 80 deg.
    const TOLERANCE_RAD: f64 = 1e-12;
    for (lens, camera) in lenses() {
        let mut worst: f64 = 0.0;
        for case in &camera.cases {
            let seen = lens.unproject(&Vector2::from(case.pixel_px)).expect("in view");
            let [x, y] = case.undistorted_xy_over_z;
            for direction in [Vector3::new(x, y, 1.0), Vector3::from(case.point_in_camera_m)] {
                // The angle comes from its sine: the cosine of a small angle has no digits left.
                worst = worst.max(seen.cross(&direction.normalize()).norm());
            }
        }
        eprintln!("{}: {} pixels, {worst:.1e} rad", camera.name, camera.cases.len());
        assert!(worst < TOLERANCE_RAD, "{worst}");
    }
}

/// The robot's camera is the one in OpenCV's file.
#[test]
fn the_golden_lens_is_the_robots() {
    let robot = titan();
    let (_, camera) = lenses().remove(0);
    let lens = &robot.camera.lens;
    assert_eq!((camera.focal_px, camera.center_px), (lens.focal_px(), lens.center_px()));
    assert_eq!((&camera.distortion[..], camera.resolution_px), (&lens.distortion()[..], lens.resolution_px()));
}
