//! Jacobians of chains with both kinds of joints, against differences of their forward kinematics, which
//! tests/oracle.rs checks against Pinocchio.

use nalgebra::{Point3, Translation3, UnitQuaternion, UnitVector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::joints::JointAngles;
use crate::kinematics::{Chain, ChainJoint, IkGoal, IkSettings, JointKind, JointLimits, solve_position};

const N: usize = 6;
const STEP: f64 = 1e-6;

fn vector(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0))
}

fn pose(rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let place = Translation3::from(0.5 * vector(rng));
    Isometry3::from_parts(place, UnitQuaternion::from_scaled_axis(vector(rng)))
}

/// Every third joint slides, from number `first_slide` on.
fn chain(first_slide: usize, rng: &mut ChaCha8Rng) -> Chain {
    let mut joint = |k: usize| ChainJoint {
        name: format!("joint {k}"),
        child_link: format!("link {k}"),
        kind: if k % 3 == first_slide { JointKind::Prismatic } else { JointKind::Revolute },
        parent_from_joint: pose(rng),
        axis: UnitVector3::new_normalize(vector(rng)),
        limits: None,
    };
    Chain::new((0..N).map(&mut joint).collect())
}

fn angles(rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(N, |_| rng.random_range(-1.0..1.0))
}

fn moved(angles: &JointAngles, joint: usize, by: f64) -> JointAngles {
    let mut moved = *angles;
    moved[joint] += by;
    moved
}

#[test]
fn jacobians_are_the_slopes_of_the_poses() {
    let mut rng = crate::stats::stream_rng(1, "slides");
    for case in 0..30 {
        let chain = chain(case % 3, &mut rng);
        let (angles, tip) = (angles(&mut rng), Attachment { n_joints: N, link_from_frame: pose(&mut rng) });
        let poses = chain.link_poses(&angles);
        let at = poses.frame(&tip);
        assert_eq!(at, chain.frame(&angles, &tip));
        let in_frame = poses.in_frame(&Attachment { n_joints: 0, link_from_frame: pose(&mut rng) });
        for joint in 0..N {
            let [above, below] = [STEP, -STEP].map(|by| chain.frame(&moved(&angles, joint, by), &tip));
            let slope = (above.translation.vector - below.translation.vector) / (2.0 * STEP);
            let turn = (above.rotation * below.rotation.inverse()).scaled_axis() / (2.0 * STEP);
            assert!((poses.point_jacobian(joint, &at.translation.vector) - slope).amax() < 1e-8, "{joint}");
            assert!((poses.turn_jacobian(joint) - turn).amax() < 1e-8, "{joint}");
            // The frame of a slide stays on its parent link, at any travel.
            let place = chain.joints()[joint].parent_from_joint;
            let origin = (poses.link(joint) * place).translation.vector;
            assert!((poses.joint_origin(joint) - origin).amax() < 1e-12, "{joint}");
            let origin = (in_frame.link(joint) * place).translation.vector;
            assert!((in_frame.joint_origin(joint) - origin).amax() < 1e-12, "{joint}");
        }
    }
}

#[test]
fn slides_are_moved_to_reach_a_place_and_stay_within_their_limits() {
    let mut rng = crate::stats::stream_rng(2, "slides");
    let mut n_reached = 0;
    for case in 0..30 {
        let chain = chain(case % 3, &mut rng);
        let tip = Attachment { n_joints: N, link_from_frame: pose(&mut rng) };
        let limits = JointLimits { lower_rad: -1.0, upper_rad: 1.0 };
        let (locked, limits) = (chain.joints().iter().map(|j| !j.kind.is_slide()).collect(), vec![limits; N]);
        let settings = IkSettings { limits, locked, tolerance_m: 1e-6, max_iterations: 200 };
        // A chain of two slides reaches only a plane: test a point inside its range and a point beyond it.
        let seed = angles(&mut rng);
        let mut there = seed;
        (0..N).filter(|j| chain.joints()[*j].kind.is_slide()).for_each(|j| there[j] = rng.random_range(-1.0..1.0));
        let goal = |angles: &JointAngles| IkGoal { position_m: (chain.frame(angles, &tip) * Point3::origin()).coords };
        let found = solve_position(&chain, &tip, &goal(&there), &seed, &settings).expect("two slides reach it");
        assert!((goal(&found).position_m - goal(&there).position_m).norm() < 1e-6);
        assert!(found.iter().all(|at| at.abs() <= 1.0));
        n_reached += usize::from(found.max_abs_difference(&there) < 1e-3);
    }
    assert!(n_reached > 25, "two ways along different axes are found again: {n_reached} of 30");
}
