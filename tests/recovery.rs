//! Known sensor errors are recovered by the estimator, with the right uncertainty.

use armcal::calib::{Calibration, Status, associate, calibrate, identify_scales};
use armcal::codes::{Code, Coded};
use armcal::log::{Recording, RecordingHeader, RecordingWriter, read_recording};
use armcal::robot::Robot;
use armcal::routine::Method;
use armcal::stats::{quantile, stream_rng};
use armcal::streams::{CaptureSet, JointAngles, MarkKind, Message, Sink};
use nalgebra::{DMatrix, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::support::synthetic::{N_SEEN, Shot, TrueArm, add_noise};
use crate::support::{temp, titan};

const N_FIT: usize = 30;
const N_HELD_OUT: usize = 8;
/// Number of seeds of the first tier and of the second.
const SEEDS: [u64; 2] = [12, 40];
/// px per corner coordinate, the standard world's.
const NOISE_PX: f64 = 0.3;

fn shots(arm: &TrueArm, rng: &mut ChaCha8Rng) -> Vec<Shot> {
    let mut shots = arm.shots(CaptureSet::Fit, N_FIT, rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, N_HELD_OUT, rng));
    shots
}

fn calibrated(arm: &TrueArm, shots: &[Shot]) -> Calibration {
    calibrate(&arm.recording(shots), arm.robot, Method::MinimumDistance).expect("calibrated")
}

fn tool_m(robot: &Robot, angles: &JointAngles) -> Vector3<f64> {
    robot.chain.link_poses(angles).frame(&robot.tool.mount).translation.vector
}

/// Poses at which the tool error is computed, over the whole range of the arm.
fn test_angles(arm: &TrueArm) -> Vec<JointAngles> {
    let mut rng = stream_rng(0, "test angles");
    (0..40).map(|_| arm.random_angles(&mut rng)).collect()
}

/// Distance between the estimated and the true tool at each test pose, m.
fn tool_errors_m(arm: &TrueArm, calibration: &Calibration) -> Vec<f64> {
    let sensors = calibration.sensors(arm.robot).expect("made for this robot");
    let error = |angles: &JointAngles| {
        let believed = sensors.angles(&arm.counts(angles));
        (tool_m(arm.robot, &believed) - tool_m(arm.robot, angles)).norm()
    };
    test_angles(arm).iter().map(error).collect()
}

fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5).expect("some values")
}

#[test]
fn noise_free_linear_sensors_are_recovered_through_a_file() {
    /// Tolerance at the tool, m. BOBYQA stops at a trust region of 1e-7 prior sigma, 5e-9 rad or 1e-8 m at 2 m. The sum
    /// of distances has a kink at its minimum, which leaves about ten times that.
    const TOLERANCE_M: f64 = 1e-6;
    let robot = titan();
    let mut rng = stream_rng(1, "noise-free");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let folder = temp();
    let path = folder.path().join("synthetic.mcap");
    let mut writer = RecordingWriter::create(&path, RecordingHeader::new(robot.joint_names())).expect("a file");
    for (log_time, message) in arm.messages(&shots(&arm, &mut rng)) {
        writer.record(log_time, &message).expect("recorded");
    }
    writer.finish().expect("finished");
    let recording = read_recording(&path).expect("it reads");
    let calibration = calibrate(&recording, &robot, Method::MinimumDistance).expect("calibrated");
    assert_eq!(calibration.status, Status::Accepted, "{:?}", calibration.refusal);
    let worst = tool_errors_m(&arm, &calibration).into_iter().fold(0.0, f64::max);
    eprintln!("worst tool error {:.1e} mm, {} evaluations", worst * 1e3, calibration.fit.evaluations);
    assert!(worst < TOLERANCE_M, "{worst}");
    assert!(calibration.joint[N_SEEN..].iter().all(|joint| !joint.gain_estimated && !joint.offset_estimated));
}

/// Error over sigma of every estimated parameter.
fn normalized_errors(arm: &TrueArm, calibration: &Calibration) -> Vec<f64> {
    let mut ratios = Vec::new();
    for (j, joint) in calibration.joint.iter().enumerate() {
        let counts_per_rad = arm.robot.sensors[j].counts_per_rad;
        if joint.gain_estimated {
            let error = joint.gain_rad_per_count * counts_per_rad - arm.gain[j];
            ratios.push(error / (joint.gain_std_rad_per_count * counts_per_rad.abs()));
        }
        if joint.offset_estimated {
            ratios.push((joint.offset_rad - arm.offset_rad[j]) / joint.offset_std_rad);
        }
    }
    ratios
}

/// Cramer-Rao bound of the tool error at each test pose, rms over the noise, m. Camera and tags are known; the
/// derivatives are differences of the generator's pixels.
fn bound_m(arm: &TrueArm, shots: &[Shot]) -> Vec<f64> {
    const STEP: f64 = 1e-6;
    // A sensor with `gain (1 + step)` or `offset + step` puts the arm at the angles of `turned`.
    let turned = |angles: &JointAngles, parameter: usize, step: f64| {
        let (joint, is_gain) = (parameter / 2, parameter.is_multiple_of(2));
        let travel = (angles[joint] - arm.robot.sensors[joint].center_rad - arm.offset_rad[joint]) / arm.gain[joint];
        let mut turned = *angles;
        turned[joint] += if is_gain { travel * step } else { step };
        turned
    };
    let n = 2 * N_SEEN;
    let mut information = DMatrix::<f64>::zeros(n, n);
    for shot in shots.iter().filter(|shot| shot.set == CaptureSet::Fit) {
        for (id, _) in &shot.tags {
            let tag_idx = arm.robot.tags.iter().position(|tag| tag.id == *id).expect("a surveyed tag");
            let mut jacobian = DMatrix::<f64>::zeros(8, n);
            let mut is_whole = true;
            for parameter in 0..n {
                let sides = [STEP, -STEP].map(|step| arm.corners(&turned(&shot.angles, parameter, step), tag_idx));
                let [Some(high), Some(low)] = sides else {
                    is_whole = false;
                    break;
                };
                for (row, (a, b)) in high.as_flattened().iter().zip(low.as_flattened()).enumerate() {
                    jacobian[(row, parameter)] = (a - b) / (2.0 * STEP * NOISE_PX);
                }
            }
            if is_whole {
                information += jacobian.transpose() * &jacobian;
            }
        }
    }
    let covariance = information.try_inverse().expect("the views determine every parameter");
    let at = |angles: &JointAngles| {
        let mut jacobian = DMatrix::<f64>::zeros(3, n);
        for parameter in 0..n {
            let [high, low] = [STEP, -STEP].map(|step| tool_m(arm.robot, &turned(angles, parameter, step)));
            jacobian.set_column(parameter, &((high - low) / (2.0 * STEP)));
        }
        (&jacobian * &covariance * jacobian.transpose()).trace().sqrt()
    };
    test_angles(arm).iter().map(at).collect()
}

/// Pixel noise is the only error, and robot.toml states no other.
fn expect_errors_of_pixel_noise_as_predicted(seeds: u64) {
    /// Share of errors within two sigma. It is 95 % if the sigmas are right. They come from 30 views, and 400
    /// parameters determine the share to 1 %.
    const SHARE_WITHIN_2_SIGMA: std::ops::RangeInclusive<f64> = 0.85..=0.99;
    /// Ratio of the error to the bound. The paper's estimator weighs near and far tags equally and uses each tag's
    /// depth, which pixels hardly determine; the bound uses right weights. 3.5 with these seeds.
    const TIMES_BOUND: f64 = 5.0;
    let mut robot = titan();
    (robot.camera.mount_std_m, robot.camera.mount_std_rad) = (0.0, 0.0);
    robot.tags.iter_mut().for_each(|tag| tag.position_std_m = 0.0);
    let (mut ratios, mut errors_m, mut bounds_m) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 1..=seeds {
        let mut rng = stream_rng(seed, "pixel noise");
        let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
        let mut shots = shots(&arm, &mut rng);
        bounds_m.push(median(&bound_m(&arm, &shots)));
        add_noise(&mut shots, NOISE_PX, &mut rng);
        let calibration = calibrated(&arm, &shots);
        ratios.extend(normalized_errors(&arm, &calibration));
        errors_m.push(median(&tool_errors_m(&arm, &calibration)));
    }
    let within = ratios.iter().filter(|ratio| ratio.abs() < 2.0).count() as f64 / ratios.len() as f64;
    let (error_m, bound_m) = (median(&errors_m), median(&bounds_m));
    eprintln!("{within:.3} of {} within 2 sigma", ratios.len());
    eprintln!("tool {:.3} mm, bound {:.3} mm, {:.1} times", error_m * 1e3, bound_m * 1e3, error_m / bound_m);
    assert_eq!(ratios.len(), seeds as usize * 2 * N_SEEN);
    assert!(SHARE_WITHIN_2_SIGMA.contains(&within), "{within}");
    assert!(error_m < TIMES_BOUND * bound_m, "{error_m} {bound_m}");
    // An estimator beats the bound only by chance, and a median over 40 seeds does not.
    assert!(error_m > 0.5 * bound_m, "{error_m} {bound_m}: too good to be true");
}

#[test]
fn with_pixel_noise_errors_are_as_large_as_their_sigmas_say() {
    expect_errors_of_pixel_noise_as_predicted(SEEDS[0]);
}

#[test]
#[ignore = "second tier: 40 arms, 2 s"]
fn with_pixel_noise_errors_of_forty_arms_are_as_large_as_their_sigmas_say() {
    expect_errors_of_pixel_noise_as_predicted(SEEDS[1]);
}

/// Camera and tags have the errors of robot.toml: sigmas must cover those, too.
fn expect_errors_of_mount_and_survey_as_predicted(seeds: u64) {
    /// Share of errors within two sigma. The ten parameters of a seed now share one camera mount: 40 of those determine
    /// the share to 3 %.
    const SHARE_WITHIN_2_SIGMA: std::ops::RangeInclusive<f64> = 0.85..=1.0;
    /// Tool error, m, median over seeds: 2 mm and 0.2 deg of the mount, 1 mm of each tag. 2.8 mm with these seeds.
    const TOOL_M: f64 = 0.004;
    let robot = titan();
    let (mut ratios, mut errors_m) = (Vec::new(), Vec::new());
    for seed in 1..=seeds {
        let mut rng = stream_rng(seed, "mount and survey");
        let mut arm = TrueArm::with_sensor_errors(&robot, &mut rng);
        arm.misplace(&mut rng);
        let mut shots = shots(&arm, &mut rng);
        add_noise(&mut shots, NOISE_PX, &mut rng);
        let calibration = calibrated(&arm, &shots);
        ratios.extend(normalized_errors(&arm, &calibration));
        errors_m.push(median(&tool_errors_m(&arm, &calibration)));
    }
    let within = ratios.iter().filter(|ratio| ratio.abs() < 2.0).count() as f64 / ratios.len() as f64;
    let error_m = median(&errors_m);
    eprintln!("{within:.3} of {} within 2 sigma, tool {:.2} mm", ratios.len(), error_m * 1e3);
    assert!(SHARE_WITHIN_2_SIGMA.contains(&within), "{within}");
    assert!(error_m < TOOL_M, "{error_m}");
}

#[test]
fn with_a_wrong_mount_and_survey_errors_are_as_large_as_their_sigmas_say() {
    expect_errors_of_mount_and_survey_as_predicted(SEEDS[0]);
}

#[test]
#[ignore = "second tier: 40 arms, 2 s"]
fn with_wrong_mounts_and_surveys_errors_of_forty_arms_are_as_large_as_their_sigmas_say() {
    expect_errors_of_mount_and_survey_as_predicted(SEEDS[1]);
}

/// In 5 % of the views one tag is shifted by a quarter of the image: it is still a square, but at the wrong place.
fn expect_far_outliers_to_change_little(seeds: u64) {
    /// Change at the tool, m. In a sum of distances an outlier has the same pull as any tag, at any distance. 0.1 mm
    /// here.
    const CHANGE_M: f64 = 0.0005;
    /// Shift of an outlier, px: least squares would respond to the distance, about 0.5 m.
    const SHIFT_PX: f64 = 250.0;
    let robot = titan();
    let mut changes_m = Vec::new();
    for seed in 1..=seeds {
        let mut rng = stream_rng(seed, "outliers");
        let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
        let mut clean = shots(&arm, &mut rng);
        add_noise(&mut clean, NOISE_PX, &mut rng);
        let mut spoiled = clean.clone();
        for k in 0..(0.05 * N_FIT as f64).ceil() as usize {
            let tags = &mut spoiled[7 * k + 3].tags;
            let (_, corners) = &mut tags[rng.random_range(0..2)];
            corners.iter_mut().for_each(|corner| corner[0] += if corner[0] > 612.0 { -SHIFT_PX } else { SHIFT_PX });
        }
        let [clean, spoiled] = [clean, spoiled].map(|shots| median(&tool_errors_m(&arm, &calibrated(&arm, &shots))));
        changes_m.push((spoiled - clean).abs());
    }
    let change_m = quantile(&changes_m, 0.9).expect("some");
    eprintln!("tool error changes by {:.2} mm in 9 of 10 seeds", change_m * 1e3);
    assert!(change_m < CHANGE_M, "{change_m}");
}

#[test]
fn a_few_far_outliers_change_little() {
    expect_far_outliers_to_change_little(6);
}

#[test]
#[ignore = "second tier: 20 arms with and without outliers, 2 s"]
fn a_few_far_outliers_change_little_for_twenty_arms() {
    expect_far_outliers_to_change_little(20);
}

/// Views with too little information are refused, always with a reason.
#[test]
fn too_few_views_are_refused_with_a_reason() {
    let robot = titan();
    let mut rng = stream_rng(1, "few");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let mut few = arm.shots(CaptureSet::Fit, 2, &mut rng);
    few.extend(arm.shots(CaptureSet::HeldOut, 4, &mut rng));
    let error = calibrate(&arm.recording(&few), &robot, Method::MinimumDistance).expect_err("two views");
    assert_eq!(error.code(), Code::ViewsMissing, "{error}");
    few.extend(arm.shots(CaptureSet::Fit, 4, &mut rng));
    let refused = calibrated(&arm, &few);
    assert_eq!(refused.status, Status::Refused);
    assert_eq!(refused.refusals[0].code(), Code::TooFewViews);
}

/// Views in which only one joint moves, of an arm whose other joints have errors, too.
fn identify_messages(arm: &TrueArm, joint: usize, rng: &mut ChaCha8Rng) -> Recording {
    let swing = [0.0, 0.03, -0.03, -0.12, -0.09, -0.06, -0.03, 0.0, 0.03, 0.06, 0.09, 0.12];
    let mut shots: Vec<Shot> = Vec::new();
    for turn in swing {
        let angles = JointAngles::from_fn(arm.robot.n_joints(), |j| {
            arm.robot.stowed[j] + arm.offset_rad[j] + if j == joint { turn } else { 0.0 }
        });
        let seen = |idx: usize| Some((arm.robot.tags[idx].id, arm.corners(&angles, idx)?));
        shots.push(Shot { set: CaptureSet::Fit, angles, tags: (0..arm.robot.tags.len()).filter_map(seen).collect() });
    }
    // A view has five frames.
    add_noise(&mut shots, NOISE_PX / 5.0_f64.sqrt(), rng);
    let mut recording = arm.recording(&shots);
    for (_, message) in &mut recording.messages {
        if let Message::Mark(mark) = message {
            mark.kind = MarkKind::Identify { joint_idx: joint as u32 };
        }
    }
    recording
}

/// The gain of one sensor has an error of any factor and either sign. The other sensors, the camera and the tags have
/// errors within their datasheets.
fn expect_unknown_scales_to_be_recovered(seeds: u64) {
    let robot = titan();
    let mut errors = Vec::new();
    let mut n_within = 0;
    for seed in 1..=seeds {
        let mut rng = stream_rng(seed, "identify");
        let mut arm = TrueArm::with_sensor_errors(&robot, &mut rng);
        arm.misplace(&mut rng);
        let joint = rng.random_range(0..N_SEEN);
        let sign = if rng.random_range(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
        arm.gain[joint] = sign * 4.0_f64.powf(rng.random_range(-1.0..1.0));
        let recording = identify_messages(&arm, joint, &mut rng);
        let (_, scales) = identify_scales(&associate(&recording, &robot), &robot).expect("measured");
        let error = scales[0].ratio * arm.gain[joint] - 1.0;
        n_within += usize::from(error.abs() < 2.0 * scales[0].relative_std);
        errors.push(error.abs());
    }
    let (median, worst) = (median(&errors), errors.iter().copied().fold(0.0, f64::max));
    let n = errors.len();
    eprintln!("relative error of the scale: median {median:.5}, worst {worst:.5}; {n_within} of {n} within 2 sigma");
    assert!(median < 0.004 && worst < 0.02, "{median} {worst}");
    assert!(n_within * 100 >= n * 85, "{n_within} of {n}");
}

#[test]
fn an_unknown_scale_is_recovered_with_its_sign() {
    expect_unknown_scales_to_be_recovered(SEEDS[0]);
}

#[test]
#[ignore = "second tier: 40 arms, 2 s"]
fn unknown_scales_of_forty_arms_are_recovered() {
    expect_unknown_scales_to_be_recovered(SEEDS[1]);
}

#[test]
fn a_scale_that_the_views_do_not_tell_is_refused_by_name() {
    let robot = titan();
    let mut rng = stream_rng(1, "identify");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let mut recording = identify_messages(&arm, 2, &mut rng);
    let first = recording.messages.iter().find_map(|(_, message)| match message {
        Message::JointSensors(sample) => Some(sample.counts),
        _ => None,
    });
    for (_, message) in &mut recording.messages {
        if let Message::JointSensors(sample) = message {
            sample.counts = first.expect("readings");
        }
    }
    let error = identify_scales(&associate(&recording, &robot), &robot).expect_err("a stuck sensor").to_string();
    assert!(error.contains("forearm_pitch"), "{error}");
    let behind = identify_messages(&arm, 5, &mut rng);
    let error = identify_scales(&associate(&behind, &robot), &robot).expect_err("behind the camera").to_string();
    assert!(error.contains("wrist_rotate"), "{error}");
}
