//! Jacobians against differences, and the covariance of unobservable directions.

use std::path::Path;

use nalgebra::{Matrix3, Unit, Vector3};
use rand::RngExt;

use crate::methods::gripper_tag::*;
use armcal_core::robot::load;
use armcal_core::stats::stream_rng;
use armcal_core::time::SIMULATION_EPOCH;

fn titan() -> Robot {
    load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4-gripper-tag"))
        .expect("the robot reads")
}

/// Returns nominal corners without noise at these travels of the last joint.
fn views(robot: &Robot, travels_rad: &[f64]) -> Vec<View> {
    let tag = robot.gripper_tag.expect("a tag");
    let view = |&travel_rad: &f64| {
        let travel_rad = JointAngles::from_fn(6, |j| if j == 5 { travel_rad } else { 0.0 });
        let angles = JointAngles::from_fn(6, |j| robot.sensors[j].center_rad + travel_rad[j]);
        let poses = robot.chain.link_poses(&angles);
        let camera_from_tag = poses.frame(&robot.camera.mount).inverse() * poses.frame(&tag.mount);
        let project = |corner: &nalgebra::Point3<f64>| {
            robot.camera.lens.project(&(camera_from_tag * corner).coords).expect("in view").into()
        };
        let corners_px = square_corners(tag.size_m).map(|corner| project(&corner));
        let gripper_tag = Some(MeanCorners { corners_px, n_frames: 5, scatter_px2: 0.0 });
        View { gripper_tag, ..View::of_reading(0, SIMULATION_EPOCH, travel_rad) }
    };
    travels_rad.iter().map(view).collect()
}

#[test]
fn jacobians_agree_with_central_differences() {
    const STEP: f64 = 1e-6;
    /// Tolerance relative to the largest entry: the second difference of a projection over that step.
    const TOLERANCE: f64 = 1e-6;
    let robot = titan();
    let tag = robot.gripper_tag.expect("a tag");
    let mut rng = stream_rng(1, "jacobians");
    for travel_rad in [-1.2, 0.1, 0.7, 1.4] {
        let views = views(&robot, &[travel_rad]);
        let (travel_rad, seen) = (&views[0].travel_rad, views[0].gripper_tag.as_ref().expect("seen"));
        let problem = Problem { robot: &robot, tag: &tag, joints: 5..6, seen: vec![(travel_rad, seen)] };
        let mut off = || DVector::from_fn(14, |_, _| rng.random_range(-0.01..0.01));
        let state = problem.stepped(&problem.start(&JointParameters::default()), &off());
        let at = problem.linearized(&state, travel_rad, seen).expect("in view");
        for column in 0..14 {
            let analytic: SVector<f64, 8> = match column {
                0..12 => at.by_poses.column(column).into(),
                12 => at.by_angle[0] * travel_rad[5],
                _ => at.by_angle[0],
            };
            let [low, high] = [-STEP, STEP].map(|step| {
                let step = DVector::from_fn(14, |row, _| if row == column { step } else { 0.0 });
                problem.linearized(&problem.stepped(&state, &step), travel_rad, seen).expect("in view").residual_px
            });
            // The residual is measured minus predicted.
            let difference = (low - high) / (2.0 * STEP);
            let error = (difference - analytic).amax();
            assert!(error < TOLERANCE * analytic.amax().max(1.0), "column {column}: {error} of {}", analytic.amax());
        }
    }
}

/// A turn of the mount about the joint's axis looks like the joint's offset: only the sum of both is determined.
#[test]
fn what_cannot_be_parted_keeps_its_prior() {
    let robot = titan();
    let tag = robot.gripper_tag.expect("a tag");
    let travels: Vec<f64> = (0..30).map(|k| -1.5 + 0.1 * f64::from(k)).collect();
    let found = mount_by_gripper_tag(&robot, &tag, &views(&robot, &travels), &JointParameters::default());
    let found = found.expect("a mount");
    let (off, drawn) = (found.link_from_camera, robot.camera.mount.link_from_frame);
    assert!(log(&(drawn.inverse() * off)).norm() < 1e-6, "noise-free views of the drawing");
    let poses = robot.chain.link_poses(&JointAngles::zeros(6));
    let axis = Unit::new_normalize(poses.frame(&robot.camera.mount).rotation.inverse() * poses.axis(5));
    let rotation: Matrix3<f64> = found.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let std_about = |direction: &Vector3<f64>| direction.dot(&(rotation * direction)).sqrt();
    let prior = robot.camera.mount_std_rad;
    let across = axis.cross(&Vector3::x()).normalize();
    assert!(std_about(&axis) > 0.9 * prior, "{}", std_about(&axis));
    assert!(std_about(&across) < 0.25 * prior, "{}", std_about(&across));
    // Views at the same few angles do not determine the gain.
    let narrow = mount_by_gripper_tag(&robot, &tag, &views(&robot, &[0.3; 30]), &JointParameters::default());
    let gain = Parameter { joint: 5, kind: ParameterKind::Gain };
    assert!(found.determined(&robot).contains(&gain));
    assert!(!narrow.expect("a mount").determined(&robot).contains(&gain));
    let few = mount_by_gripper_tag(&robot, &tag, &views(&robot, &travels[..3]), &JointParameters::default());
    insta::assert_snapshot!("too_few_views", few.expect_err("too few"));
}
