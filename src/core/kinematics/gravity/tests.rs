//! Torques against the potential energy, bending against its derivatives.

use std::path::Path;

use super::*;
use crate::joints::JointAngles;
use crate::kinematics::{Chain, IkGoal, IkSettings, JointKind, JointLimits, LinkCorrections, solve_position};
use crate::robot::{Robot, load};
use rand::RngExt;

const G_M_S2: f64 = 9.80665;

fn titan() -> Robot {
    load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4")).expect("the robot reads")
}

/// Returns the titan arm with slides as first joint and as forearm joint.
fn sliding() -> Robot {
    let mut robot = titan();
    let mut joints = robot.chain.joints().to_vec();
    [0, 2].iter().for_each(|joint| joints[*joint].kind = JointKind::Prismatic);
    robot.chain = Chain::new(joints).with_loads(*robot.chain.loads());
    robot
}

fn drawn_angles(robot: &Robot, name: &str) -> Vec<JointAngles> {
    let mut rng = crate::stats::stream_rng(5, name);
    let mut one = || {
        JointAngles::from_fn(robot.n_joints(), |j| {
            robot.sensors[j].center_rad + rng.random_range(-0.9..0.9) * robot.sensors[j].half_range_rad
        })
    };
    (0..20).map(|_| one()).collect()
}

/// Potential energy of links in water and of a load at the tool, J, up to a constant. It is computed from the bodies,
/// not from their loads.
fn potential_j(robot: &Robot, poses: &LinkPoses, tool_load_n: f64) -> f64 {
    let mut sum = tool_load_n * poses.frame(&robot.tool.mount).translation.vector.z;
    for (k, body) in robot.bodies.iter().enumerate() {
        let height = |at_m: &Vector3<f64>| (poses.link(k).rotation * at_m + poses.link(k).translation.vector).z;
        let buoyant = body.volume_centroid_m().unwrap_or(body.com_m);
        sum += G_M_S2 * body.mass_kg * (height(&body.com_m) - robot.buoyancy_fraction * height(&buoyant));
    }
    sum
}

#[test]
fn torques_are_the_slope_of_the_potential_energy() {
    [titan(), sliding()].iter().for_each(torques_of);
}

fn torques_of(robot: &Robot) {
    const STEP_RAD: f64 = 1e-5;
    let loads = robot.chain.loads();
    assert!(loads.are_known());
    let mut largest = 0.0_f64;
    for angles in drawn_angles(robot, "torques") {
        let poses = robot.chain.link_poses(&angles);
        let torques = loads.torques(&poses, 300.0);
        for joint in 0..robot.n_joints() {
            let moved = |by_rad: f64| {
                let mut moved = angles;
                moved[joint] += by_rad;
                potential_j(robot, &robot.chain.link_poses(&moved), 300.0)
            };
            let slope = (moved(STEP_RAD) - moved(-STEP_RAD)) / (2.0 * STEP_RAD);
            assert!((torques.joints[joint] + slope).abs() < 1e-5 * (1.0 + slope.abs()), "joint {joint}: {slope}");
            largest = largest.max(slope.abs());
        }
        // The whole arm, turned about the base's origin.
        for axis in 0..3 {
            let moved = |by_rad: f64| {
                let turn = UnitQuaternion::from_scaled_axis(Vector3::ith(axis, by_rad));
                let height =
                    |body: usize, at: &Vector3<f64>| (turn * (poses.link(body) * nalgebra::Point3::from(*at))).z;
                let bodies = robot.bodies.iter().enumerate().map(|(k, body)| {
                    let buoyant = body.volume_centroid_m().unwrap_or(body.com_m);
                    let share = robot.buoyancy_fraction;
                    G_M_S2 * body.mass_kg * (height(k, &body.com_m) - share * height(k, &buoyant))
                });
                let tool = poses.frame(&robot.tool.mount).translation.vector;
                bodies.sum::<f64>() + 300.0 * (turn * tool).z
            };
            let slope = (moved(STEP_RAD) - moved(-STEP_RAD)) / (2.0 * STEP_RAD);
            assert!((torques.base[axis] + slope).abs() < 1e-5 * (1.0 + slope.abs()), "base, axis {axis}: {slope}");
        }
    }
    assert!(largest > 300.0, "{largest} N m");
}

#[test]
fn torque_derivatives_are_those_of_the_torques() {
    [titan(), sliding()].iter().for_each(derivatives_of);
}

fn derivatives_of(robot: &Robot) {
    const STEP_RAD: f64 = 1e-5;
    let loads = robot.chain.loads();
    for angles in drawn_angles(robot, "derivatives") {
        let poses = robot.chain.link_poses(&angles);
        let derivatives = loads.torque_derivatives(&poses, -120.0);
        for by in 0..robot.n_joints() {
            let at = |by_rad: f64| {
                let mut moved = angles;
                moved[by] += by_rad;
                loads.torques(&robot.chain.link_poses(&moved), -120.0)
            };
            let (above, below, found) = (at(STEP_RAD), at(-STEP_RAD), derivatives[by]);
            for joint in 0..robot.n_joints() {
                let slope = (above.joints[joint] - below.joints[joint]) / (2.0 * STEP_RAD);
                assert!((found.joints[joint] - slope).abs() < 1e-4 * (1.0 + slope.abs()), "{joint} by {by}");
            }
            let slope = (above.base - below.base) / (2.0 * STEP_RAD);
            assert!((found.base - slope).norm() < 1e-4 * (1.0 + slope.norm()), "base by {by}");
        }
    }
}

#[test]
fn an_arm_bends_by_its_compliances_and_no_other_way() {
    [titan(), sliding()].iter().for_each(bends_of);
}

fn bends_of(robot: &Robot) {
    let mut sag = Sag { tool_load_n: 200.0, mount_rad_per_nm: [2e-6, 3e-6, 0.0], ..Sag::default() };
    sag.joint_rad_per_nm[..3].copy_from_slice(&[1e-6, 5e-6, 1e-6]);
    let corrections = LinkCorrections { sag, ..LinkCorrections::default() };
    let bent = robot.chain.corrected(&corrections);
    for angles in drawn_angles(robot, "bends") {
        let straight = robot.chain.link_poses(&angles);
        let bend = sag.bend(&robot.chain.loads().torques(&straight, 200.0));
        let poses = bent.link_poses(&angles);
        assert_eq!(poses.frame(&robot.tool.mount), bent.frame(&angles, &robot.tool.mount));
        assert_eq!(
            poses.frame(&robot.tool.mount),
            robot.chain.corrected_link_poses(&angles, &corrections).frame(&robot.tool.mount)
        );
        let tool = |poses: &LinkPoses| poses.frame(&robot.tool.mount).translation.vector;
        let (there, moved) = (tool(&straight), tool(&poses) - tool(&straight));
        let [foretold, _] = bend.motion(&straight, 0..robot.tool.mount.n_joints, &there);
        assert!((moved - foretold).norm() < 0.01 * moved.norm() + 1e-9, "{moved} for {foretold}");
        // The arm yields downwards, to the weight.
        assert!(moved.z < 1e-6, "{moved}");
    }
}

/// The tool reaches its target although the arm bends on the way.
#[test]
fn a_bending_arm_reaches_its_targets() {
    let robot = titan();
    let mut sag = Sag { tool_load_n: 300.0, mount_rad_per_nm: [1e-5; 3], ..Sag::default() };
    sag.joint_rad_per_nm[..5].fill(2e-5);
    let bent = robot.chain.corrected(&LinkCorrections { sag, ..LinkCorrections::default() });
    let limit = |j: usize| JointLimits {
        lower_rad: robot.sensors[j].center_rad - robot.sensors[j].half_range_rad,
        upper_rad: robot.sensors[j].center_rad + robot.sensors[j].half_range_rad,
    };
    let settings = IkSettings {
        limits: (0..robot.n_joints()).map(limit).collect(),
        locked: vec![false; robot.n_joints()],
        tolerance_m: 1e-6,
        max_iterations: 200,
    };
    for seed in drawn_angles(&robot, "targets") {
        let tool = |chain: &Chain, at: &JointAngles| chain.frame(at, &robot.tool.mount).translation.vector;
        let goal = IkGoal { position_m: tool(&robot.chain, &seed) };
        let sag_m = (tool(&bent, &seed) - goal.position_m).norm();
        let most_m: f64 = bent.most_sag_m().iter().sum();
        assert!(sag_m < most_m, "{sag_m} m, at most {most_m} m");
        let Ok(found) = solve_position(&bent, &robot.tool.mount, &goal, &seed, &settings) else {
            panic!("{seed:?} is {sag_m} m off and stays so");
        };
        assert!((tool(&bent, &found) - goal.position_m).norm() < 1e-6);
    }
}
