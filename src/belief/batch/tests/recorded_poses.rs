//! Recordings that hold poses of tags instead of corners, with a stated noise or without.

use nalgebra::Isometry3;

use crate::batch::tests::failures::{Case, case};
use crate::say::refusal::Refusal;
use crate::views::view::TagMeasurement;
use armcal_core::input::TagNoise;
use armcal_core::joints::JointAngles;
use armcal_core::optics::solve_square_both;

/// Stated noise of positions, m.
const POSITION_STD_M: f64 = 0.003;

/// The case with poses that a detector computes from its corners: of a square's two solutions, the one near the survey.
fn with_poses(mut case: Case) -> Case {
    let robot = &case.robot;
    for view in &mut case.views {
        let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
        let base_from_camera = robot.tags_from_camera(&JointAngles::from_fn(robot.n_joints(), angle_rad));
        for seen in &mut view.tags {
            let tag = &robot.tags[seen.tag_idx];
            let corners_px = seen.corners().expect("corners").corners_px;
            let (best, other) = solve_square_both(&robot.camera.lens, tag.size_m, &corners_px).expect("a pose");
            let poses = [Some(best), other].into_iter().flatten().map(|pose| *pose.camera_from_tag.isometry());
            let surveyed = base_from_camera.inv_mul(tag.base_from_tag.isometry()).rotation;
            let off_rad = |pose: &Isometry3<f64>| surveyed.angle_to(&pose.rotation);
            let pose = poses.min_by(|a, b| off_rad(a).total_cmp(&off_rad(b))).expect("a pose");
            seen.center_in_camera_m = pose.translation.vector;
            seen.measured = TagMeasurement::Pose(pose);
        }
    }
    case
}

/// Returns true if the rotations are refused for their noise.
fn has_rotation_noise(seed: u64, rotation_std_rad: Option<f64>) -> bool {
    let noise = TagNoise { position_std_m: POSITION_STD_M, rotation_std_rad };
    let calibration = with_poses(case(seed, None)).calibrated_with(Some(noise));
    calibration.refusals.iter().any(|refusal| matches!(refusal, Refusal::RotationNoise { .. }))
}

#[test]
fn a_noise_of_rotations_that_is_not_stated_is_not_tested_as_none() {
    for seed in 40..44 {
        assert!(!has_rotation_noise(seed, None), "seed {seed}");
    }
    // A stated noise is tested.
    assert!(has_rotation_noise(40, Some(1e-6)));
}
