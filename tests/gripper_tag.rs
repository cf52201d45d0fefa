//! A tag on the gripper relates tool to camera: the estimator's use of it, with known errors.

use armcal::calib::{Status, associate, calibrate, mount_by_gripper_tag};
use armcal::model::JointParameters;
use armcal::robot::{Robot, load};
use armcal::routine::Method;
use armcal::spatial::log;
use armcal::stats::{quantile, stream_rng};
use armcal::streams::CaptureSet;
use nalgebra::DVector;
use rand_chacha::ChaCha8Rng;

use crate::support::root;
use crate::support::synthetic::{Shot, ToolFigures, TrueArm, add_noise};

const NOISE_PX: f64 = 0.3;
/// Largest turn of the last joint either way, rad.
const TURNS_RAD: f64 = 1.5;

fn robot() -> Robot {
    let mut robot = load(&root().join("robots/titan4-gripper-tag")).expect("the robot reads");
    // The arm of these tests has straight sensors.
    robot.sensors.iter_mut().for_each(|sensor| sensor.linearity_std_rad = 1e-6);
    robot
}

fn arm_and_shots<'a>(robot: &'a Robot, rng: &mut ChaCha8Rng) -> (TrueArm<'a>, Vec<Shot>) {
    let mut arm = TrueArm::with_sensor_errors(robot, rng);
    arm.misplace(rng);
    let mut shots = arm.shots(CaptureSet::Fit, 30, rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, 8, rng));
    arm.see_gripper_tag(&mut shots, TURNS_RAD, rng);
    add_noise(&mut shots, NOISE_PX, rng);
    (arm, shots)
}

fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5).expect("some values")
}

fn expect_the_tool_to_be_known_better_with_a_tag(seeds: u64) {
    /// Largest ratio of the error to that without the tag, median over seeds.
    const SHARE: f64 = 0.75;
    let with_tag = robot();
    let without_tag = Robot { gripper_tag: None, ..with_tag.clone() };
    let [mut with, mut without, mut foretold, mut foretold_without, mut nees] = [const { Vec::new() }; 5];
    let mut n_better = 0;
    for seed in 1..=seeds {
        let (arm, shots) = arm_and_shots(&with_tag, &mut stream_rng(seed, "gripper tag"));
        let recording = arm.recording(&shots);
        let solve = |robot: &Robot| calibrate(&recording, robot, Method::MinimumDistance).expect("calibrated");
        let (tied, loose) = (solve(&with_tag), solve(&without_tag));
        assert_eq!(tied.status, Status::Accepted, "seed {seed}: {:?}", tied.refusal);
        assert!(tied.joint.iter().all(|joint| joint.gain_estimated && joint.offset_estimated), "seed {seed}");
        assert_eq!(tied.camera_mount.as_ref().map(|mount| mount.left_out.clone()), Some(None), "seed {seed}");
        assert!(loose.camera_mount.is_none() && !loose.joint[5].offset_estimated);
        let ToolFigures { error_m, predicted_m, nees: nees_of_seed } = arm.tool_figures(&tied);
        let ToolFigures { error_m: error_without_m, predicted_m: predicted_without_m, .. } = arm.tool_figures(&loose);
        n_better += usize::from(error_m < error_without_m);
        with.push(error_m);
        without.push(error_without_m);
        foretold.push(predicted_m);
        foretold_without.push(predicted_without_m);
        nees.push(nees_of_seed);
    }
    let [with, without, foretold, foretold_without, nees] =
        [&with, &without, &foretold, &foretold_without, &nees].map(|values| median(values));
    eprintln!(
        "tool {:.2} mm (predicted {:.2}) with, {:.2} mm (predicted {:.2}) without; better in {n_better} of {}; NEES \
         {nees:.2}",
        with * 1e3,
        foretold * 1e3,
        without * 1e3,
        foretold_without * 1e3,
        seeds
    );
    assert!(with < SHARE * without, "{with} {without}");
    assert!(foretold < foretold_without, "{foretold} {foretold_without}");
    assert!((1.0..6.0).contains(&nees), "{nees}");
}

#[test]
fn with_a_tag_on_the_gripper_the_tool_is_known_better_and_how_well() {
    expect_the_tool_to_be_known_better_with_a_tag(11);
}

#[test]
#[ignore = "second tier: 40 arms with and without the tag, 3 s"]
fn with_a_tag_on_the_gripper_the_tools_of_forty_arms_are_known_better() {
    expect_the_tool_to_be_known_better_with_a_tag(40);
}

#[test]
fn the_mount_is_off_by_as_much_as_its_covariance_says() {
    /// Range of the mean over seeds of six squared normalized errors and two of the last joint; its standard deviation
    /// over 40 seeds is 0.63.
    const NEES: std::ops::RangeInclusive<f64> = 6.1..=9.9;
    const SEEDS: u64 = 40;
    let robot = robot();
    let tag = robot.gripper_tag.expect("a tag on the gripper");
    let mut sum = 0.0;
    for seed in 1..=SEEDS {
        let (arm, shots) = arm_and_shots(&robot, &mut stream_rng(seed, "gripper tag"));
        let data = associate(&arm.recording(&shots), &robot);
        let found = mount_by_gripper_tag(&robot, &tag, &data.fit, &JointParameters::default()).expect("a mount");
        assert_eq!(found.views, 30);
        assert!(found.rms_px < 2.0 * NOISE_PX, "{}", found.rms_px);
        let off = log(&(found.link_from_camera.inverse() * arm.camera.link_from_frame));
        let joint = [arm.gain[5] - found.parameters.gain[5], arm.offset_rad[5] - found.parameters.offset_rad[5]];
        let off = DVector::from_iterator(8, off.iter().copied().chain(joint));
        sum += off.dot(&found.covariance.clone().cholesky().expect("a covariance").solve(&off));
    }
    let nees = sum / SEEDS as f64;
    eprintln!("NEES {nees:.2} of 8");
    assert!(NEES.contains(&nees), "{nees}");
}

/// The tag is 2 cm from its nominal pose: the views are calibrated without it, and the file gives the reason.
#[test]
fn a_tag_that_was_knocked_off_its_place_is_left_out_with_the_reason() {
    let robot = robot();
    let mut rng = stream_rng(1, "gripper tag");
    let mut arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let tag = arm.link_from_gripper_tag.as_mut().expect("a tag");
    tag.translation.vector.y += 0.02;
    let mut shots = arm.shots(CaptureSet::Fit, 30, &mut rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, 8, &mut rng));
    arm.see_gripper_tag(&mut shots, TURNS_RAD, &mut rng);
    let calibration = calibrate(&arm.recording(&shots), &robot, Method::MinimumDistance).expect("calibrated");
    let why = calibration.camera_mount.expect("a word of it").left_out.expect("a reason");
    assert!(why.contains("sigma"), "{why}");
    assert!(!calibration.joint[5].offset_estimated);
}
