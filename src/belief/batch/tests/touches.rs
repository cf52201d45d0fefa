//! Touches by arms within the priors of their nominal models, and by arms beyond them.

use nalgebra::{Matrix3, Translation3, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::batch::tests::data::{Noise, Truth, normal, reference, rng, titan, views};
use crate::batch::tests::score_test::input;
use crate::checks::touch_term::{MIN_TOUCHES, MOUNT_TURN, SURVEY_TURN, TOOL_POINT};
use crate::model::blocks::Block;
use crate::model::estimated::Model;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::scales::Hyperparameters;
use crate::say::refusal::Refusal;
use crate::say::reservation::Reservation;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::model_for_views::model_for;
use crate::views::view::{Touch, View};
use armcal_core::joints::JointAngles;
use armcal_core::kinematics::Chain;
use armcal_core::robot::Robot;
use armcal_core::sensor::ConditionChange;

const N_VIEWS: usize = 25;
const N_TOUCHES: usize = 5;
const STD_M: f64 = 1e-3;
const TIP_RADIUS_M: f64 = 0.04;
const LAST: usize = 5;

/// An arm drawn from its priors, views of it, and its tool against planes.
struct Case {
    real: Robot,
    truth: Truth,
    model: Model,
    views: Vec<View>,
    touches: Vec<Touch>,
}

/// `robot` with errors drawn from the priors of its nominal model.
fn built(robot: &Robot, rng: &mut ChaCha8Rng) -> Robot {
    let priors = &robot.geometry;
    let mut drawn = |std: f64| Vector3::from_fn(|_, _| std * normal(rng));
    let mut joints = robot.chain.joints().to_vec();
    for joint in &mut joints {
        let place = &mut joint.parent_from_joint;
        place.translation.vector += drawn(priors.link_position_std_m);
        place.rotation = UnitQuaternion::from_scaled_axis(drawn(priors.link_rotation_std_rad)) * place.rotation;
    }
    let mut real = Robot { chain: Chain::new(joints), ..robot.clone() };
    real.tool.mount.link_from_frame.translation.vector += drawn(priors.tool_position_std_m);
    real
}

fn case(robot: &Robot, seed: u64, change: impl FnOnce(&mut Robot, &mut Truth)) -> Case {
    let mut rng = rng(seed, "touches");
    let scales = Hyperparameters::datasheet(robot);
    let blocks = [Block::Mount(0)].into_iter().chain(Block::tags(robot));
    let mut model = Model::of_blocks(robot.n_joints(), blocks);
    let noise = Noise { corner_px: 0.3, n_frames: 8, joint_rad: scales.joint_std_rad };
    let mut real = built(robot, &mut rng);
    let first = Truth::draw(robot, &model, &scales, &mut rng);
    model.joints = model_for(robot, &views(robot, &first, &noise, 10, &mut rng)).joints;
    let mut truth = Truth::draw(robot, &model, &scales, &mut rng);
    // No view constrains the last joint.
    for kind in [ParameterKind::Gain, ParameterKind::Offset] {
        let parameter = Parameter { joint: LAST, kind };
        let value = truth.parameters.get(parameter) + parameter.prior_std(robot) * normal(&mut rng);
        truth.parameters.set(parameter, value);
    }
    change(&mut real, &mut truth);
    let mut seen = views(&real, &truth, &noise, N_VIEWS, &mut rng);
    seen.iter_mut().for_each(|view| view.n_readings = 1_000_000);
    let touches = views(&real, &truth, &noise, N_TOUCHES, &mut rng);
    let touches = touches.into_iter().map(|view| touch(&real, &truth, &noise, view, &mut rng)).collect();
    Case { real, truth, model, views: seen, touches }
}

/// The plane that the tool would have touched at a view's readings.
fn touch(real: &Robot, truth: &Truth, noise: &Noise, view: View, rng: &mut ChaCha8Rng) -> Touch {
    let mut angles = truth.angles(real, &view);
    for (angle, std) in angles.iter_mut().zip(noise.joint_rad) {
        *angle += std * normal(rng);
    }
    let tool_m = real.chain.link_poses(&angles).frame(&real.tool.mount).translation.vector;
    let normal_out = Vector3::from_fn(|_, _| normal(rng)).normalize();
    let aside = Vector3::from_fn(|_, _| 0.1 * normal(rng)).cross(&normal_out);
    let point_m = tool_m - (TIP_RADIUS_M + STD_M * normal(rng)) * normal_out + aside;
    let view = View { n_readings: 1_000_000, tags: Vec::new(), ..view };
    Touch {
        surface: format!("plane {}", view.pose_idx),
        point_m,
        normal: normal_out,
        tip_radius_m: TIP_RADIUS_M,
        std_m: STD_M,
        view,
    }
}

fn task(robot: &Robot) -> Vec<JointAngles> {
    let at = |k: usize| JointAngles::from_fn(robot.n_joints(), |j| 0.5 * ((k * 7 + j * 3) as f64).sin());
    (0..6).map(at).collect()
}

/// True minus estimated tool position at readings that a nominal arm has at `at`, base frame, m.
fn tool_error(robot: &Robot, case: &Case, found: &JointParameters, at: &JointAngles) -> Vector3<f64> {
    let still = ConditionChange::default();
    let tool_m = |robot: &Robot, parameters: &JointParameters| {
        let angles = JointAngles::from_fn(robot.n_joints(), |j| {
            let travel_rad = at[j] - robot.sensors[j].center_rad;
            parameters.correction(j).angle_rad(&robot.sensors[j], travel_rad, &still, 0.0)
        });
        robot.chain.link_poses(&angles).frame(&robot.tool.mount).translation.vector
    };
    tool_m(&case.real, &case.truth.parameters) - tool_m(robot, found)
}

/// Covariance of the tool from the estimate and the geometry priors, without the joint errors of each pose, m^2.
fn predicted_m2(found: &Estimate<'_>, beside: &[Matrix3<f64>], at: &[JointAngles]) -> Vec<Matrix3<f64>> {
    let n = found.joint_parameters().len();
    let covariance = found.joint_covariance();
    let of = |(tool, beside): (crate::explain::score_test::ToolJacobian, &Matrix3<f64>)| {
        let by = nalgebra::DMatrix::from_fn(3, n, |row, column| tool.by_parameters[column][row]);
        let told = &by * &covariance * by.transpose();
        Matrix3::from_fn(|i, k| told[(i, k)]) + beside
    };
    found.tool_jacobians(at).into_iter().zip(beside).map(of).collect()
}

#[test]
fn touches_of_a_good_arm_are_as_foretold_and_the_tool_is_better_known() {
    let robot = titan();
    let at = task(&robot);
    const SEEDS: u64 = 60;
    let (mut chi2, mut alarms, mut nees, mut squares) = (0.0, 0, 0.0, [0.0; 2]);
    for seed in 0..SEEDS {
        let case = case(&robot, seed, |_, _| {});
        let found = estimate(&input(&robot, &case.views, &case.model)).expect("solved");
        let update = found.touch_update(&case.touches).expect("touches");
        let touched = found.with_touches(&update);
        chi2 += update.chi2 / N_TOUCHES as f64;
        alarms += u32::from(update.chi2 > update.limit);
        let beside = found.prior_impact_with(Some(&update), &at, 0.0).covariances_m2;
        let predicted = predicted_m2(&touched, &beside, &at);
        for (at, predicted) in at.iter().zip(&predicted) {
            let errors = [&found, &touched].map(|found| tool_error(&robot, &case, &found.parameters(), at));
            for (sum, error) in squares.iter_mut().zip(&errors) {
                *sum += error.norm_squared() / (SEEDS as f64 * 6.0);
            }
            let inverse = predicted.try_inverse().expect("a covariance");
            nees += errors[1].dot(&(inverse * errors[1])) / (SEEDS as f64 * 6.0);
        }
    }
    let chi2 = chi2 / SEEDS as f64;
    let [before, after] = squares.map(f64::sqrt);
    println!("chi-square {chi2:.2} a touch, {alarms} alarms of {SEEDS}, NEES {nees:.2}");
    println!("rms tool error {:.2} mm before, {:.2} mm after", before * 1e3, after * 1e3);
    assert!((0.7..1.2).contains(&chi2) && alarms == 0, "{chi2}, {alarms} alarms");
    assert!((2.0..3.6).contains(&nees), "{nees}");
    assert!(after < before, "{before} m before, {after} m after");
}

/// Causes that a rejected update names, and the tool point that would explain it; `None` if it is not rejected.
fn refused_for(robot: &Robot, found: &Estimate<'_>, touches: &[Touch]) -> Option<(Vec<String>, Vector3<f64>)> {
    let update = found.touch_update(touches)?;
    (update.chi2 > update.limit).then(|| {
        let Refusal::Touch { causes, .. } = update.refusal(robot) else { panic!("of touches") };
        (causes, update.tool_point_m(robot))
    })
}

fn is_named(cause: &str, causes: &[String]) -> bool {
    causes.iter().any(|named| named == cause)
}

#[test]
fn a_tool_point_two_centimetres_off_is_refused_and_measured() {
    let robot = titan();
    const SEEDS: u64 = 30;
    let mut worst_m: f64 = 0.0;
    for seed in 0..SEEDS {
        let off_m = Vector3::ith(seed as usize % 3, 0.02);
        let case = case(&robot, seed, |real, _| real.tool.mount.link_from_frame.translation.vector += off_m);
        let found = estimate(&input(&robot, &case.views, &case.model)).expect("solved");
        let (causes, shift_m) = refused_for(&robot, &found, &case.touches).expect("refused");
        assert!(is_named(TOOL_POINT, &causes), "{causes:?}");
        worst_m = worst_m.max((shift_m - off_m).norm());
    }
    println!("tool point measured to {:.1} mm at worst", worst_m * 1e3);
    assert!(worst_m < 0.01, "{worst_m} m");
}

/// A wrong tool point is accepted only where the predicted error covers it.
#[test]
fn no_tool_point_is_accepted_far_beyond_its_prediction() {
    let robot = titan();
    let at = task(&robot);
    let (mut accepted, mut worst) = (0, 0.0_f64);
    for (k, size_m) in [0.003, 0.005, 0.007, 0.009, 0.012, 0.02].into_iter().enumerate() {
        for seed in 0..20 {
            let off_m = Vector3::ith(seed as usize % 3, size_m);
            let case = case(&robot, 100 * k as u64 + seed, |real, _| {
                real.tool.mount.link_from_frame.translation.vector += off_m;
            });
            let found = estimate(&input(&robot, &case.views, &case.model)).expect("solved");
            let update = found.touch_update(&case.touches).expect("touches");
            if update.chi2 > update.limit {
                continue;
            }
            accepted += 1;
            let touched = found.with_touches(&update);
            let beside = found.prior_impact_with(Some(&update), &at, 0.0).covariances_m2;
            let predicted: f64 = predicted_m2(&touched, &beside, &at).iter().map(Matrix3::trace).sum();
            let error = |at: &JointAngles| tool_error(&robot, &case, &touched.parameters(), at).norm_squared();
            worst = worst.max((at.iter().map(error).sum::<f64>() / predicted).sqrt());
        }
    }
    println!("{accepted} of 120 accepted, at most {worst:.1} times the prediction");
    assert!(worst < 3.0, "{worst}");
}

#[test]
fn a_camera_turned_about_the_last_joint_before_it_is_refused() {
    let robot = titan();
    let n = robot.n_seen_joints();
    const SEEDS: u64 = 30;
    let (mut refused, mut named) = (0, 0);
    for seed in 0..SEEDS {
        let case = case(&robot, seed, |real, truth| {
            // The turn is in the frame of the link that carries the camera.
            let axis = real.chain.joints()[n - 1].axis;
            let turn = UnitQuaternion::from_scaled_axis(axis.into_inner() * 5f64.to_radians());
            truth.mount = Translation3::identity() * turn * truth.mount;
        });
        let found = estimate(&input(&robot, &case.views, &case.model)).expect("solved");
        let Some((causes, _)) = refused_for(&robot, &found, &case.touches) else { continue };
        refused += 1;
        named += u32::from(is_named(MOUNT_TURN, &causes));
    }
    println!("{refused} refused, {named} named of {SEEDS}");
    assert!(refused == SEEDS && u64::from(named) >= SEEDS - 1, "{refused}, {named} of {SEEDS}");
}

/// The first joint's offset compensates in the views; only the touches show the base's place.
#[test]
fn a_survey_turned_about_the_first_axis_is_refused_with_that_among_the_causes() {
    let robot = titan();
    const SEEDS: u64 = 20;
    let (mut refused, mut named) = (0, 0);
    for seed in 0..SEEDS {
        let case = case(&robot, seed, |_, truth| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * 1.5f64.to_radians());
            truth.tags.iter_mut().for_each(|tag| *tag = Translation3::identity() * turn * *tag);
        });
        let found = estimate(&input(&robot, &case.views, &case.model)).expect("solved");
        let Some((causes, _)) = refused_for(&robot, &found, &case.touches) else { continue };
        refused += 1;
        named += u32::from(is_named(SURVEY_TURN, &causes));
    }
    println!("{refused} refused, {named} named of {SEEDS}");
    assert!(refused >= 18 && named == refused, "{refused}, {named} of {SEEDS}");
}

#[test]
fn reservations_of_what_touches_tell_vanish_with_three_of_them() {
    let robot = titan();
    let at = task(&robot);
    let case = case(&robot, 1, |_, _| {});
    let found = estimate(&input(&robot, &case.views, &case.model)).expect("solved");
    let names = |touches: &[Touch]| -> Vec<Reservation> {
        let update = found.touch_update(touches);
        found.prior_impact_with(update.as_ref(), &at, 5e-4).reservations
    };
    let is_of_tool = |reservation: &&Reservation| reservation.what.starts_with("tool point");
    let (without, too_few) = (names(&[]), names(&case.touches[..MIN_TOUCHES - 1]));
    assert_eq!(without.iter().filter(is_of_tool).count(), 1, "one line for all axes: {without:?}");
    assert_eq!(without, too_few);
    let with = names(&case.touches);
    with.iter().for_each(|reservation| println!("{reservation}"));
    assert!(with.is_empty(), "{with:?}");
}

#[test]
fn touches_that_say_nothing_do_no_harm() {
    let robot = titan();
    let mut case = case(&robot, 2, |_, _| {});
    let found = estimate(&input(&robot, &case.views, &case.model)).expect("solved");
    for touch in &mut case.touches {
        touch.std_m = 1e3;
    }
    let update = found.touch_update(&case.touches).expect("touches");
    let touched = found.with_touches(&update);
    assert_eq!(touched.parameters().reference, reference());
    for (a, b) in found.solved.state.joint.iter().zip(touched.solved.state.joint.iter()) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    let same = case.touches[0].clone();
    let update = found.touch_update(&[same.clone(), same.clone(), same]).expect("touches");
    assert!(update.chi2 < 1.0);
}
