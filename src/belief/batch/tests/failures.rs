//! Sensors that fail in views of the estimator's own model: the failure is found and named, and the other joints are
//! calibrated.

use nalgebra::{Isometry3, Vector3};
use rand::RngExt;

use crate::batch::marked_calibrations::calibrate_data;
use crate::batch::tests::data::{Noise, Truth, rng, titan, views};
use crate::batch::tests::score_test::with_link;
use crate::explain::drawing::Drawing;
use crate::explain::failure_detection::{FailureSearch, is_suspicious};
use crate::explain::failures::{Failure, FailureAdjusted, FailureSource, SensorUse};
use crate::file::calibration::Calibration;
use crate::methods::CalibrationMethod;
use crate::model::parameters::JointParameters;
use crate::model::scales::Hyperparameters;
use crate::say::reading_error::ReadingError;
use crate::say::refusal::Refusal;
use crate::solve::estimate::Estimate;
use crate::solve::input::HyperparameterMode;
use crate::solve::model_for_views::model_for;
use crate::views::calibration_data::{CalibrationData, HeldOut};
use crate::views::error::CalibError;
use crate::views::view::{CaptureData, View};
use armcal_core::codes::{Code, Coded};
use armcal_core::input::TagNoise;
use armcal_core::kinematics::Attachment;
use armcal_core::robot::{FailedJoint, FailedKind, Robot};
use armcal_core::spatial::Pose;
use armcal_core::streams::ReachTask;

const N_VIEWS: usize = 20;

#[derive(Clone)]
pub(crate) struct Case {
    pub(crate) robot: Robot,
    truth: Truth,
    pub(crate) views: Vec<View>,
}

impl Case {
    pub(crate) fn calibrated(self) -> Calibration {
        self.calibrated_with(None)
    }

    /// Calibrates with this stated noise of positions and poses.
    pub(crate) fn calibrated_with(self, tag_noise: Option<TagNoise>) -> Calibration {
        calibrated_by(self.robot, CaptureData { fit: self.views, tag_noise, ..CaptureData::default() })
    }
}

/// The result of `views` without a task.
pub(crate) fn calibrated(robot: Robot, views: Vec<View>) -> Calibration {
    calibrated_for(robot, views, None)
}

fn calibrated_for(robot: Robot, views: Vec<View>, task: Option<ReachTask>) -> Calibration {
    calibrated_by(robot, CaptureData { fit: views, task, ..CaptureData::default() })
}

fn calibrated_by(robot: Robot, data: CaptureData) -> Calibration {
    tried_by(robot, data).expect("a result")
}

fn tried_by(robot: Robot, data: CaptureData) -> Result<Calibration, CalibError> {
    let data = CalibrationData {
        name: "synthetic".to_owned(),
        messages_hash: String::new(),
        data: CaptureData { n_marks: data.fit.len(), ..data },
        gripper_tag_data: None,
        held_out: HeldOut::CrossValidation,
        robot,
        identified: Vec::new(),
    };
    calibrate_data(data, CalibrationMethod::Bundle, None)
}

/// An arm without faults; `locked`: a joint that stands still.
pub(crate) fn case(seed: u64, locked: Option<usize>) -> Case {
    case_with_range(seed, locked.map(|joint| (joint, 1e-12)))
}

/// An arm without faults, one joint of which moves only within this half range, rad.
pub(crate) fn case_with_range(seed: u64, narrow: Option<(usize, f64)>) -> Case {
    let robot = titan();
    let mut rng = rng(seed, "failed joints");
    let scales = Hyperparameters::datasheet(&robot);
    let noise = Noise { corner_px: 0.3, n_frames: 5, joint_rad: scales.joint_std_rad };
    let mut model = model_for(&robot, &[]);
    let drawn = Truth::draw(&robot, &model, &scales, &mut rng);
    model.joints = model_for(&robot, &views(&robot, &drawn, &noise, 6, &mut rng)).joints;
    let mut moving = robot.clone();
    if let Some((joint, half_range_rad)) = narrow {
        // The joint stands in the middle; its sensor has no nonlinearity, so that this is one angle.
        moving.sensors[joint].half_range_rad = half_range_rad;
        model.joints[joint].retain(|kind| matches!(kind, crate::model::parameters::ParameterKind::Offset));
    }
    let truth = Truth::draw(&robot, &model, &scales, &mut rng);
    let views = views(&moving, &truth, &noise, N_VIEWS, &mut rng);
    Case { robot, truth, views }
}

fn found_failures(case: &Case, declared: &[Failure]) -> Vec<Failure> {
    let applied = FailureAdjusted::new(&case.robot, &case.views, declared, &JointParameters::default());
    let found = applied.estimate(HyperparameterMode::Fitted);
    let search = FailureSearch { robot: &case.robot, views: &case.views, prior: None, drawing: &Drawing::default() };
    search.failures(declared, found.as_ref())
}

/// Angle that a broken wire reads: noise about zero counts.
fn zero_counts_rad(robot: &Robot, joint: usize) -> f64 {
    let spec = &robot.sensors[joint];
    let center_counts = spec.offset_counts + spec.counts_per_rad * spec.center_rad;
    let half = 0.5 * spec.wrap_counts;
    ((-center_counts + half).rem_euclid(spec.wrap_counts) - half) / spec.counts_per_rad
}

/// Offset errors of all joints except `without`, in their own sigma.
fn off_sigmas(case: &Case, found: &Estimate<'_>, without: usize) -> Vec<f64> {
    let covariance = found.joint_covariance();
    let parameters = found.parameters();
    let mut out = Vec::new();
    for joint in (0..case.robot.n_seen_joints()).filter(|&joint| joint != without) {
        // The error in the middle of the range holds offset and nonlinearity together.
        let columns = found.joint_parameters().iter().enumerate().filter(|(_, p)| p.joint == joint);
        let spec = &case.robot.sensors[joint];
        let by: Vec<(usize, f64)> =
            columns.map(|(k, p)| (k, p.kind.angle_derivative(spec, 0.0, &Default::default(), 0.0))).collect();
        let variance: f64 = by
            .iter()
            .flat_map(|(i, a)| by.iter().map(move |(k, b)| (i, k, a * b)))
            .map(|(i, k, ab)| ab * covariance[(*i, *k)])
            .sum();
        let angle = |p: &JointParameters| p.correction(joint).angle_rad(spec, 0.0, &Default::default(), 0.0);
        out.push((angle(&parameters) - angle(&case.truth.parameters)) / variance.sqrt());
    }
    out
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn a_sound_arm_has_no_failed_joint() {
    for seed in 0..16 {
        let case = case(seed, None);
        assert_eq!(found_failures(&case, &[]), Vec::new(), "seed {seed}");
    }
}

/// Breaks a sensor in each arm and fits; pools the other joints' errors.
fn check(kind: FailedKind, seeds: std::ops::Range<u64>, break_it: impl Fn(&mut Case, usize, u64) -> Vec<usize>) {
    let (mut sigmas, mut missed) = (Vec::new(), 0);
    for seed in seeds {
        let joint = (seed % 5) as usize;
        let mut case = case(seed, (kind == FailedKind::Locked).then_some(joint));
        let expected = break_it(&mut case, joint, seed);
        let failures = found_failures(&case, &[]);
        // A gain near zero imitates a locked joint; the verdict then refuses it, because no sensor departs so far from
        // its datasheet.
        if kind == FailedKind::Locked && failures.is_empty() {
            missed += 1;
            continue;
        }
        let named: Vec<(usize, FailedKind)> = failures.iter().map(|f| (f.joint, f.kind)).collect();
        assert_eq!(named, [(joint, kind)], "seed {seed}: {failures:?}");
        assert_eq!(failures[0].found, FailureSource::Detected);
        assert_eq!(failures[0].views, expected, "seed {seed}: {failures:?}");
        let applied = FailureAdjusted::new(&case.robot, &case.views, &failures, &JointParameters::default());
        let found = applied.estimate(HyperparameterMode::Fitted).expect("the rest is determined");
        assert!(found.outliers.len() <= 2, "seed {seed}: {:?}", found.outliers);
        sigmas.extend(off_sigmas(&case, &found, joint));
    }
    assert!(missed <= 1, "{missed} not found");
    let spread = rms(&sigmas);
    eprintln!("{}: errors of the other joints are {spread:.2} of their sigma", kind.name());
    // The spread has 16 to 20 values.
    assert!((0.45..1.5).contains(&spread), "errors of the other joints are {spread:.2} of their sigma: {sigmas:.2?}");
}

#[test]
fn a_broken_wire_is_found_and_the_angle_comes_from_the_camera() {
    check(FailedKind::Dead, 0..5, |case, joint, _| {
        let zero_rad = zero_counts_rad(&case.robot, joint);
        for (k, view) in case.views.iter_mut().enumerate() {
            view.travel_rad[joint] = zero_rad + 1e-5 * (k % 3) as f64;
        }
        (0..N_VIEWS).collect()
    });
}

#[test]
fn a_sensor_that_reads_anything_is_dead() {
    check(FailedKind::Dead, 10..15, |case, joint, seed| {
        let mut rng = rng(seed, "words");
        for view in &mut case.views {
            view.travel_rad[joint] = rng.random_range(-2.0..2.0);
        }
        (0..N_VIEWS).collect()
    });
}

#[test]
fn a_word_that_stays_is_stuck_and_not_locked() {
    check(FailedKind::Stuck, 20..25, |case, joint, _| {
        let word_rad = case.views[0].travel_rad[joint];
        for view in &mut case.views {
            view.travel_rad[joint] = word_rad;
        }
        (0..N_VIEWS).collect()
    });
}

#[test]
fn a_word_that_stays_from_some_view_on_is_stuck() {
    for since in [10, 15] {
        check(FailedKind::Stuck, 60..65, |case, joint, _| {
            let word_rad = case.views[since].travel_rad[joint];
            for (k, view) in case.views[since..].iter_mut().enumerate() {
                view.travel_rad[joint] = word_rad + 1e-5 * (k % 3) as f64;
            }
            (0..N_VIEWS).collect()
        });
    }
}

#[test]
fn a_joint_that_is_left_where_it_is_for_some_views_is_sound() {
    for seed in 0..5 {
        let joint = (seed % 5) as usize;
        // The joint stands still, so that its model has only an offset.
        let mut case = case(seed, Some(joint));
        let moving = case.robot.clone();
        let noise = Noise { corner_px: 0.3, n_frames: 5, joint_rad: Hyperparameters::datasheet(&moving).joint_std_rad };
        let first = views(&moving, &case.truth, &noise, N_VIEWS - 5, &mut rng(seed, "moving"));
        case.views.splice(..N_VIEWS - 5, first);
        assert_eq!(found_failures(&case, &[]), Vec::new(), "seed {seed}");
    }
}

#[test]
fn a_joint_that_stays_is_locked_whatever_its_sensor_reads() {
    check(FailedKind::Locked, 30..35, |case, joint, seed| {
        let mut rng = rng(seed, "words");
        for view in &mut case.views {
            view.travel_rad[joint] = rng.random_range(-1.0..1.0);
        }
        (0..N_VIEWS).collect()
    });
}

#[test]
fn a_joint_that_was_not_moved_keeps_its_sensor() {
    for seed in 0..5 {
        let joint = (seed % 5) as usize;
        let case = case(seed, Some(joint));
        let failures = found_failures(&case, &[]);
        assert_eq!(failures.len(), 1, "seed {seed}: {failures:?}");
        let Failure { kind, reading, views, .. } = &failures[0];
        assert_eq!((*kind, *reading, views.len()), (FailedKind::NotMoved, SensorUse::Used, 0), "seed {seed}");
    }
}

#[test]
fn single_views_in_which_a_sensor_jumped_are_freed() {
    check(FailedKind::Jumps, 40..45, |case, joint, _| {
        let slipped = vec![2, 9, 15];
        for &k in &slipped {
            case.views[k].travel_rad[joint] += 0.06;
        }
        slipped
    });
}

/// Reverses the sensor of `joint` in some views.
fn reverse_in(case: &mut Case, joint: usize, views: std::ops::Range<usize>) {
    for view in &mut case.views[views] {
        view.travel_rad[joint] *= -1.0;
    }
}

#[test]
fn a_sensor_that_reads_wrongly_up_to_the_end_is_refused() {
    let mut n_since = 0;
    for seed in 110..115 {
        let joint = (seed % 5) as usize;
        let mut case = case(seed, None);
        reverse_in(&mut case, joint, 14..N_VIEWS);
        let failures = found_failures(&case, &[]);
        let [Failure { joint: found, kind: FailedKind::Dead, lost_since, .. }] = failures[..] else {
            panic!("seed {seed}: {failures:?}")
        };
        // In a few arms the six wrong readings of twenty look like a sensor that never followed.
        let is_near = lost_since.is_none_or(|since| (13..17).contains(&since));
        assert!(found == joint && is_near, "seed {seed}: {found} since {lost_since:?}");
        n_since += usize::from(lost_since.is_some());
        let name = case.robot.sensors[joint].joint.clone();
        let result = case.calibrated();
        let is_named = |refusal: &Refusal| matches!(refusal, Refusal::SensorFailed { joint, .. } if *joint == name);
        assert!(result.refusals.iter().any(is_named), "seed {seed}: {:?}", result.refusals);
    }
    assert!(n_since >= 4, "the view is found in {n_since} of 5");
}

#[test]
fn a_sensor_that_reads_right_again_is_repaired() {
    for seed in 115..120 {
        let joint = (seed % 5) as usize;
        let mut case = case(seed, None);
        reverse_in(&mut case, joint, 6..12);
        let failures = found_failures(&case, &[]);
        assert!(
            matches!(&failures[..], [only] if only.joint == joint && only.kind == FailedKind::Jumps),
            "seed {seed}: {failures:?}"
        );
        let result = case.calibrated();
        let is_needed = |refusal: &Refusal| matches!(refusal, Refusal::SensorFailed { .. });
        assert!(!result.refusals.iter().any(is_needed), "seed {seed}: {:?}", result.refusals);
    }
}

#[test]
fn since_a_lasting_slip_the_sensor_is_calibrated_as_it_is_now() {
    check(FailedKind::Jumps, 50..55, |case, joint, _| {
        for view in &mut case.views[..9] {
            view.travel_rad[joint] -= 0.03;
        }
        // All readings are used, those before the slip with another offset.
        Vec::new()
    });
}

#[test]
fn what_is_declared_is_believed_and_not_looked_for() {
    let mut case = case(3, None);
    let mut rng = rng(3, "words");
    for view in &mut case.views {
        view.travel_rad[2] = rng.random_range(-2.0..2.0);
    }
    let declared = [Failure::without_sensor(2, FailedKind::Dead, FailureSource::Declared, N_VIEWS)];
    assert_eq!(found_failures(&case, &declared), declared);
}

/// A joint is held because its sensor is dead: the sensor is named, and the joint's one angle is estimated.
#[test]
fn a_dead_sensor_of_a_held_joint_is_dead_and_not_locked() {
    for seed in [30, 32] {
        let joint = (seed % 5) as usize;
        let mut case = case(seed, Some(joint));
        let at_rad = case.truth.angles(&case.robot, &case.views[0])[joint];
        random_words(&mut case, joint, seed);
        let marks = [FailedKind::Dead, FailedKind::Locked].map(|kind| FailedJoint { joint, kind });
        let result = calibrated(case.robot.with_failed(&marks), case.views);
        let [failed] = &result.failed_joint[..] else { panic!("seed {seed}: {:?}", result.failed_joint) };
        assert_eq!((failed.kind, failed.found.as_str()), (FailedKind::Dead, "declared"), "seed {seed}");
        let (angle_rad, std_rad) = failed.angle_rad.zip(failed.angle_std_rad).expect("one angle");
        assert!((angle_rad - at_rad).abs() < 5.0 * std_rad + 1e-3, "seed {seed}: {angle_rad} {at_rad} {std_rad}");
        let told = failed.told();
        assert!(told.held && told.evidence.contains(" deg") && !told.remedy().contains("free"), "{}", told.remedy());
        let is_needed = |refusal: &Refusal| matches!(refusal, Refusal::SensorFailed { .. });
        assert!(!result.refusals.iter().any(is_needed), "seed {seed}: {:?}", result.refusals);
    }
}

#[test]
fn a_joint_that_moves_is_not_locked_by_declaration() {
    for seed in [31, 33] {
        let joint = (seed % 5) as usize;
        let locked = |robot: &Robot| robot.clone().with_failed(&[FailedJoint { joint, kind: FailedKind::Locked }]);
        let of = |fit: Vec<View>| CaptureData { fit, ..CaptureData::default() };
        let moving = case(seed, None);
        let name = moving.robot.sensors[joint].joint.clone();
        let error = tried_by(locked(&moving.robot), of(moving.views)).expect_err("it moves");
        assert!(matches!(&error, CalibError::DeclaredLocked { joint, .. } if *joint == name), "seed {seed}: {error}");
        assert_eq!(error.code(), Code::ValueInvalid);
        // The readings of a locked joint mean nothing.
        let mut still = case(seed, Some(joint));
        random_words(&mut still, joint, seed);
        let result = tried_by(locked(&still.robot), of(still.views)).expect("it is locked");
        assert_eq!(result.failed_joint[0].kind, FailedKind::Locked, "seed {seed}");
    }
}

#[test]
fn sensors_that_robot_toml_holds_are_the_reason_why_nothing_is_calibrated() {
    let mut case = case(34, None);
    for sensor in &mut case.robot.sensors {
        (sensor.gain_std, sensor.offset_std_rad) = (0.0, 0.0);
    }
    let fit = |views: &[View]| CaptureData { fit: views.to_vec(), ..CaptureData::default() };
    let error = tried_by(case.robot.clone(), fit(&case.views)).expect_err("nothing is left");
    assert!(matches!(error, CalibError::AllHeld { .. }), "{error}");
    assert_eq!(error.code(), Code::NothingObservable);
    assert!(
        ["gain_std", "offset_std_rad", "robot.toml"].iter().all(|word| error.to_string().contains(word)),
        "{error}"
    );
    case.robot.sensors[0].offset_std_rad = 0.01;
    let with_one = tried_by(case.robot, fit(&case.views));
    assert!(!matches!(with_one, Err(CalibError::AllHeld { .. })), "one offset is left");
}

/// The tool point lies on the last axis before the camera, so that a task of positions does not need this joint's
/// sensor. It needs the second joint's.
#[test]
fn a_dead_sensor_is_refused_where_the_task_needs_it() {
    for seed in 120..124 {
        let mut case = case(seed, None);
        let last = case.robot.n_seen_joints() - 1;
        let on_axis = case.robot.chain.joints()[last].axis.into_inner() * 0.2;
        let link_from_frame = Isometry3::from_parts(on_axis.into(), nalgebra::UnitQuaternion::identity());
        case.robot.tool.mount = Attachment { n_joints: last + 1, link_from_frame };
        let tool_m = |view: &View| {
            let angles = case.truth.angles(&case.robot, view);
            case.robot.chain.link_poses(&angles).frame(&case.robot.tool.mount).translation.vector.into()
        };
        let targets_m = case.views[..4].iter().map(tool_m).collect();
        let task = ReachTask { stamp: Default::default(), targets_m, tolerance_m: 0.03, poses: Vec::new() };
        for (joint, declared, is_needed) in [(last, false, false), (last, true, false), (1, false, true)] {
            let mut broken = Case { robot: case.robot.clone(), truth: case.truth.clone(), views: case.views.clone() };
            random_words(&mut broken, joint, seed);
            if declared {
                broken.robot = broken.robot.with_failed(&[FailedJoint { joint, kind: FailedKind::Dead }]);
            }
            let name = broken.robot.sensors[joint].joint.clone();
            let result = calibrated_for(broken.robot, broken.views, Some(task.clone()));
            let rows: Vec<&String> = result.failed_joint.iter().map(|row| &row.joint).collect();
            assert_eq!(rows, [&name], "seed {seed}");
            let is_refused = result.refusals.iter().any(|refusal| matches!(refusal, Refusal::SensorFailed { .. }));
            assert_eq!(is_refused, is_needed, "seed {seed}, {name}: {:?}", result.refusals);
        }
    }
}

#[test]
fn a_joint_with_the_readings_of_another_one_is_no_dead_sensor() {
    for seed in 130..134 {
        let (joint, with) = ((seed % 5) as usize, ((seed + 2) % 5) as usize);
        let mut case = case(seed, None);
        for view in &mut case.views {
            view.travel_rad[joint] = view.travel_rad[with];
        }
        let [name, other] = [joint, with].map(|joint| case.robot.sensors[joint].joint.clone());
        let result = case.calibrated();
        let Some(Refusal::MisreadReadings(misread)) = result.refusals.first() else {
            panic!("seed {seed}: {:?}", result.refusals)
        };
        let expected = ReadingError::Alike { joint: name, with: other, views: N_VIEWS };
        assert_eq!(misread.found, expected, "seed {seed}");
        assert!(result.failed_joint.is_empty(), "seed {seed}: {:?}", result.failed_joint);
    }
}

/// Scales the readings of `joint`.
fn rescale(case: &mut Case, joint: usize, factor: f64) {
    for view in &mut case.views {
        view.travel_rad[joint] *= factor;
    }
}

fn random_words(case: &mut Case, joint: usize, seed: u64) {
    let mut rng = rng(seed, "words");
    for view in &mut case.views {
        view.travel_rad[joint] = rng.random_range(-1.5..1.5);
    }
}

#[test]
fn reversed_and_rescaled_sensors_are_told_by_their_slope() {
    slopes_are_told(60..63);
}

#[test]
#[ignore = "second tier: 45 arms, 10 s"]
fn reversed_and_rescaled_sensors_are_told_by_their_slope_over_45_arms() {
    slopes_are_told(60..75);
}

fn slopes_are_told(seeds: std::ops::Range<u64>) {
    for seed in seeds {
        let joint = (seed % 5) as usize;
        for factor in [-1.0, 0.5, 1.5] {
            let mut case = case(seed, None);
            rescale(&mut case, joint, factor);
            let failures = found_failures(&case, &[]);
            let [Failure { joint: found, line: Some(line), reading, .. }] = &failures[..] else {
                panic!("seed {seed}, factor {factor}: {failures:?}")
            };
            let expected = case.truth.parameters.gain[joint] / factor;
            assert_eq!(*found, joint, "seed {seed}, factor {factor}");
            assert!((line.slope / expected - 1.0).abs() < 0.03, "seed {seed}, factor {factor}: {line:?} {expected}");
            assert_eq!(*reading == SensorUse::Ignored, factor < 0.0, "a reversed sensor is not used");
            if factor > 0.0 {
                let applied = FailureAdjusted::new(&case.robot, &case.views, &failures, &JointParameters::default());
                let found = applied.estimate(HyperparameterMode::Fitted).expect("solved");
                assert!((found.parameters().gain[joint] / expected - 1.0).abs() < 0.01, "seed {seed}");
                assert!(!is_suspicious(&found), "seed {seed}, factor {factor}: the rest fits");
            }
        }
    }
}

/// One joint reads degrees among others in radians. In the reverse case its readings hardly change, and its gain is
/// refused.
#[test]
fn readings_in_another_unit_refuse_and_are_named() {
    for (seed, factor) in [(60, 1f64.to_degrees()), (62, 1f64.to_degrees()), (61, 1f64.to_radians())] {
        let joint = (seed % 5) as usize;
        let mut case = case(seed, None);
        rescale(&mut case, joint, factor);
        let found = case.calibrated();
        let refused = found.refusals.first().expect("refused");
        match refused {
            Refusal::SensorUnit { gain, .. } => assert!((gain * factor - 1.0).abs() < 0.15, "{gain}"),
            _ => assert!(factor < 1.0, "seed {seed}: {refused:?}"),
        }
    }
}

#[test]
fn two_failed_sensors_are_told_apart() {
    assert_eq!(told_apart(80..86), 6);
}

#[test]
#[ignore = "second tier: 20 arms, 9 s"]
fn two_failed_sensors_are_told_apart_over_20_arms() {
    assert!(told_apart(80..100) >= 19);
}

/// Only a few pairs get an estimate, and the pair that failed is among them.
#[test]
fn the_pair_that_failed_is_among_the_likely_ones() {
    for seed in 80..90 {
        let (a, b) = ((seed % 5) as usize, ((seed + 1 + seed / 5 % 4) % 5) as usize);
        let mut case = case(seed, None);
        random_words(&mut case, a, seed);
        random_words(&mut case, b, seed + 1000);
        let drawing = Drawing::default();
        let search = FailureSearch { robot: &case.robot, views: &case.views, prior: None, drawing: &drawing };
        let likely = search.likely_pairs(&[]);
        assert_eq!(likely.len(), 6, "seed {seed}");
        assert!(likely.contains(&[a.min(b), a.max(b)]), "seed {seed}: {likely:?} without {a} and {b}");
    }
}

/// Counts the arms whose two failed sensors are both named.
fn told_apart(seeds: std::ops::Range<u64>) -> usize {
    let mut told = 0;
    let all: Vec<u64> = seeds.collect();
    for &seed in &all {
        let (a, b) = ((seed % 5) as usize, ((seed + 1 + seed / 5 % 4) % 5) as usize);
        let mut case = case(seed, None);
        random_words(&mut case, a, seed);
        let second = match seed % 3 {
            0 => {
                random_words(&mut case, b, seed + 1000);
                FailedKind::Dead
            }
            1 => {
                rescale(&mut case, b, -1.0);
                FailedKind::Dead
            }
            _ => {
                for view in &mut case.views[11..] {
                    view.travel_rad[b] += 0.03;
                }
                FailedKind::Jumps
            }
        };
        let mut named: Vec<(usize, FailedKind)> =
            found_failures(&case, &[]).iter().map(|f| (f.joint, f.kind)).collect();
        named.sort_by_key(|(joint, _)| *joint);
        let mut expected = [(a, FailedKind::Dead), (b, second)];
        expected.sort_by_key(|(joint, _)| *joint);
        if named == expected {
            told += 1;
        } else {
            println!("seed {seed}: {named:?}, not {expected:?}");
        }
    }
    println!("two failed sensors: told apart in {told} of {}", all.len());
    told
}

#[test]
fn a_drawing_that_is_wrong_fails_no_sensor() {
    for seed in 0..12 {
        let mut case = case(seed, None);
        match seed % 3 {
            0 => case.robot = with_link(&case.robot, 1 + seed as usize % 4, 0.01, Vector3::zeros()),
            1 => {
                let tag = &mut case.robot.tags[seed as usize % 8];
                let aside = Isometry3::translation(0.04, 0.0, 0.0) * tag.base_from_tag.isometry();
                tag.base_from_tag = Pose::from_isometry(aside);
            }
            _ => {
                let [fx, fy, rest @ ..] = case.robot.camera.lens.intrinsics();
                let mut longer = [1.02 * fx, 1.02 * fy, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                longer[2..].copy_from_slice(&rest);
                case.robot.camera.lens = case.robot.camera.lens.with_intrinsics(longer);
            }
        }
        assert_eq!(found_failures(&case, &[]), Vec::new(), "seed {seed}");
    }
}
