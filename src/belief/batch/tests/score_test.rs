//! Arms that differ from the nominal model, and held-out views.

use nalgebra::{UnitQuaternion, Vector3};

use crate::batch::tests::arms::{Arm, Built, arm};
use crate::batch::tests::data::{Noise, Truth, reference, rng, titan, views};
use crate::checks::cross_validation::{FOLDS, fold_of};
use crate::checks::observability::{Observability, observability};
use crate::explain::angles_by_camera::set_by_camera;
use crate::explain::score_test::{GeometryElement, ScoreTestResult};
use crate::model::blocks::Block;
use crate::model::estimated::Model;
use crate::model::parameters::JointParameters;
use crate::model::scales::Hyperparameters;
use crate::say::geometry_error::ErrorKind;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::{BundleInput, HyperparameterMode};
use crate::solve::model_for_views::model_for;
use crate::views::view::View;
use armcal_core::kinematics::Chain;
use armcal_core::robot::Robot;
use armcal_core::stats::chi_square_quantile;

const N_VIEWS: usize = 30;
/// Probability of a false alarm of all tests of one arm together.
const ALPHA: f64 = 1e-3;

/// `robot` with the place of `joint` in its parent link changed.
pub(crate) fn with_link(robot: &Robot, joint: usize, longer_m: f64, twist: Vector3<f64>) -> Robot {
    let mut joints = robot.chain.joints().to_vec();
    let place = &mut joints[joint].parent_from_joint;
    let along = place.translation.vector.normalize();
    place.translation.vector += along * longer_m;
    place.rotation = UnitQuaternion::from_scaled_axis(twist) * place.rotation;
    Robot { chain: Chain::new(joints), ..robot.clone() }
}

/// Views of the arm `real` with sensors drawn from the priors of `robot`.
pub(crate) fn views_of(robot: &Robot, real: &Robot, seed: u64) -> (Vec<View>, Model) {
    views_of_changed(robot, real, seed, |_| {})
}

/// Views as [`views_of`] makes them, after `change` of the drawn truth.
pub(crate) fn views_of_changed(
    robot: &Robot,
    real: &Robot,
    seed: u64,
    change: impl FnOnce(&mut Truth),
) -> (Vec<View>, Model) {
    let mut rng = rng(seed, "alarm");
    let scales = Hyperparameters::datasheet(robot);
    let blocks = [Block::Mount(0)].into_iter().chain(Block::tags(robot));
    let mut model = Model::of_blocks(robot.n_joints(), blocks);
    let noise = Noise { corner_px: 0.3, n_frames: 8, joint_rad: scales.joint_std_rad };
    let first = Truth::draw(robot, &model, &scales, &mut rng);
    model.joints = model_for(robot, &views(robot, &first, &noise, 10, &mut rng)).joints;
    let mut truth = Truth::draw(robot, &model, &scales, &mut rng);
    change(&mut truth);
    let mut views = views(real, &truth, &noise, N_VIEWS, &mut rng);
    views.iter_mut().for_each(|view| view.n_readings = 1_000_000);
    (views, model)
}

pub(crate) fn input<'a>(robot: &'a Robot, views: &'a [View], model: &Model) -> BundleInput<'a> {
    BundleInput {
        robot,
        views,
        model: model.clone(),
        scales: Hyperparameters::datasheet(robot),
        guess: JointParameters { reference: reference(), ..JointParameters::default() },
        joint_prior: None,
        evidence: HyperparameterMode::Fitted,
    }
}

fn score_tests(found: &Estimate<'_>) -> Vec<ScoreTestResult> {
    found.score_tests(&found.view_angles())
}

fn is_alarm(result: &ScoreTestResult, of: usize) -> bool {
    result.probability < ALPHA / of as f64
}

#[test]
fn a_good_arm_is_suspected_no_more_often_than_by_chance() {
    let (mut alarms, mut low, mut high, mut all) = (0, 0, 0, 0);
    for seed in 0..50 {
        let results = score_tests(&arm(Built::AsDrawn, seed).found);
        alarms += usize::from(results.iter().any(|s| is_alarm(s, results.len())));
        low += results.iter().filter(|s| s.probability < 0.1).count();
        high += results.iter().filter(|s| s.probability > 0.9).count();
        all += results.len();
    }
    println!("good arms: {alarms} of 50 alarms; of {all} tests {low} below 0.1, {high} above 0.9");
    assert!(alarms <= 1, "{alarms} of 50 good arms are suspected");
    // Tests of one arm are correlated; a test that is never or always certain would be far outside.
    assert!((0.04..0.18).contains(&(low as f64 / all as f64)), "{low} of {all}");
    assert!((0.04..0.18).contains(&(high as f64 / all as f64)), "{high} of {all}");
}

#[test]
fn a_link_one_centimetre_longer_is_found_named_and_measured() {
    let robot = titan();
    for joint in 1..robot.n_seen_joints() {
        let change = robot.chain.joints()[joint].parent_from_joint.translation.vector.normalize() * 0.01;
        let (mut named, mut sizes) = (0, Vec::new());
        const SEEDS: u64 = 12;
        for seed in 0..SEEDS {
            let results = score_tests(&arm(Built::Longer(joint), seed).found);
            let first = &results[0];
            assert!(is_alarm(first, results.len()), "joint {joint}, seed {seed}: {first:?}");
            named += u64::from(first.element == GeometryElement::Joint(joint) && first.error == ErrorKind::Shift);
            let of_link =
                results.iter().find(|s| s.element == GeometryElement::Joint(joint) && s.error == ErrorKind::Shift);
            sizes.push(of_link.expect("tested").size.dot(&change) / change.norm_squared());
        }
        sizes.sort_by(f64::total_cmp);
        let median = sizes[sizes.len() / 2];
        println!("joint {joint}: named in {named} of {SEEDS}, {median:.2} of its size");
        assert!(named >= SEEDS * 3 / 4, "joint {joint}: named in {named} of {SEEDS}");
        assert!((0.6..1.4).contains(&median), "joint {joint}: {median} of its size");
    }
}

/// A shift of a link along the axis of the last joint that moves the camera has the same effect in all views.
#[test]
fn a_mount_that_is_off_along_the_last_axis_is_named_before_a_link() {
    let robot = titan();
    let axis = robot.chain.joints()[robot.camera.mount.n_joints - 1].axis.into_inner();
    for seed in 0..6 {
        let slid = |truth: &mut Truth| truth.mount.translation.vector += axis * (12.0 * robot.camera.mount_std_m);
        let (views, model) = views_of_changed(&robot, &robot, seed, slid);
        let results = score_tests(&estimate(&input(&robot, &views, &model)).expect("solved"));
        assert!(is_alarm(&results[0], results.len()), "seed {seed}: {:?}", results[0]);
        assert_eq!(results[0].element, GeometryElement::Mount, "seed {seed}: {:?}", &results[..3]);
    }
}

#[test]
fn a_link_twisted_by_one_degree_is_found() {
    let robot = titan();
    for joint in 1..4 {
        // The twist is across the joint's axis: about the axis it would be an offset.
        let place = &robot.chain.joints()[joint];
        let axis = place.parent_from_joint.rotation * place.axis.into_inner();
        let across = axis.cross(&if axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
        let real = with_link(&robot, joint, 0.0, across * 1f64.to_radians());
        for seed in 0..6 {
            let (views, model) = views_of(&robot, &real, seed);
            let found = estimate(&input(&robot, &views, &model)).expect("solved");
            let results = score_tests(&found);
            assert!(is_alarm(&results[0], results.len()), "joint {joint}, seed {seed}: {:?}", results[0]);
        }
    }
}

#[test]
fn views_that_were_left_out_are_as_far_off_as_foretold() {
    let robot = titan();
    const SEEDS: u64 = 20;
    let (mut camera, mut coordinates) = ((0.0, 0), (0.0, 0));
    let (mut squares, mut n_joints, mut beyond) = (0.0, 0, 0);
    let mut within = [0, 0];
    for seed in 0..SEEDS {
        let Arm { case, found: all } = arm(Built::AsDrawn, seed);
        for fold in 0..FOLDS {
            let (fitted, left_out) = fold_of(&case.views, fold);
            let part = BundleInput {
                scales: all.scales().clone(),
                evidence: HyperparameterMode::Given,
                ..input(&robot, &fitted, &case.model)
            };
            let found = estimate(&part).expect("solved");
            let places: Vec<(usize, View)> =
                left_out.into_iter().enumerate().map(|(n, view)| (n * FOLDS + fold, view)).collect();
            let off = found.innovations(&part, &places, &all.outliers).expect("a factor");
            within = [within[0] + off.within_95.within, within[1] + off.within_95.views];
            beyond += usize::from(off.camera_chi2 > chi_square_quantile(0.99, off.camera_dof));
            camera = (camera.0 + off.camera_chi2, camera.1 + off.camera_dof);
            coordinates = (coordinates.0 + off.chi2, coordinates.1 + off.dof);
            squares += off.joints.iter().map(|joint| joint.normalised * joint.normalised).sum::<f64>();
            n_joints += off.joints.len();
        }
    }
    let ratio = |(chi2, dof): (f64, usize)| chi2 / dof as f64;
    let joints = squares / n_joints as f64;
    println!(
        "innovations: cameras {:.3} of {}, coordinates {:.3} of {}, joints {joints:.3} of {n_joints}; {beyond} of 100 \
         folds beyond 99 %",
        ratio(camera),
        camera.1,
        ratio(coordinates),
        coordinates.1
    );
    let share = within[0] as f64 / within[1] as f64;
    println!("{share:.3} of {} views within their 95 % regions", within[1]);
    assert!((0.92..0.98).contains(&share), "{share:.3}");
    assert!((0.85..1.15).contains(&ratio(camera)), "{}", ratio(camera));
    assert!((0.97..1.03).contains(&ratio(coordinates)), "{}", ratio(coordinates));
    assert!((0.8..1.2).contains(&joints), "{joints}");
    assert!(beyond <= 8, "{beyond} of 100 folds are beyond their 99 % quantile");
}

/// A joint without a sensor uses one number of each view, which no innovation counts.
#[test]
fn views_that_were_left_out_do_not_tell_of_a_freed_joint() {
    let robot = titan();
    let mut camera = (0.0, 0);
    for seed in 0..16 {
        let joint = seed as usize % 5;
        let (mut views, mut model) = views_of(&robot, &robot, seed);
        model.joints[joint].clear();
        views.iter_mut().for_each(|view| view.is_free[joint] = true);
        let all = estimate(&input(&robot, &views, &model)).expect("solved");
        for fold in 0..FOLDS {
            let (fitted, mut left_out) = fold_of(&views, fold);
            let part = BundleInput {
                scales: all.scales().clone(),
                evidence: HyperparameterMode::Given,
                ..input(&robot, &fitted, &model)
            };
            let found = estimate(&part).expect("solved");
            for view in &mut left_out {
                set_by_camera(&found.as_found(&robot), view, &found.parameters());
            }
            let places: Vec<(usize, View)> =
                left_out.into_iter().enumerate().map(|(n, view)| (n * FOLDS + fold, view)).collect();
            let off = found.innovations(&part, &places, &all.outliers).expect("a factor");
            camera = (camera.0 + off.camera_chi2, camera.1 + off.camera_dof);
        }
    }
    let ratio = camera.0 / camera.1 as f64;
    println!("innovations with a freed joint: cameras {ratio:.3} of {}", camera.1);
    assert!((0.9..1.1).contains(&ratio), "{ratio}");
}

/// Observability under the model `believed` of views of an arm drawn from `real`.
fn observed(believed: &Robot, real: &Robot) -> Observability {
    let (views, model) = views_of(real, real, 3);
    observability(&input(believed, &views, &model)).expect("columns")
}

fn speaks_of(found: &Observability, words: &[&str]) -> bool {
    found.null_space.iter().any(|line| words.iter().all(|word| line.words.contains(word)))
}

#[test]
fn without_a_base_tag_the_first_offset_is_not_known() {
    let surveyed = titan();
    let mut robot = surveyed.clone();
    let known = observed(&robot, &surveyed);
    assert!(!speaks_of(&known, &["shoulder_yaw offset"]), "{:?}", known.null_space);
    for tag in &mut robot.tags {
        (tag.position_std_m, tag.rotation_std_rad) = (f64::INFINITY, f64::INFINITY);
    }
    let unknown = observed(&robot, &surveyed);
    println!("known {known:?}\nunknown {unknown:?}");
    assert!(speaks_of(&unknown, &["shoulder_yaw offset: not determined"]), "{:?}", unknown.null_space);
    assert!(unknown.rank < known.rank);
    assert!(speaks_of(&known, &["wrist_yaw offset", "camera mount turn", "only their"]), "{:?}", known.null_space);
}

#[test]
fn a_joint_that_did_not_move_has_no_gain_and_indices_order() {
    let robot = titan();
    let moved = observed(&robot, &robot);
    let mut real = robot.clone();
    // Views are drawn over the range of the sensor.
    real.sensors[2].half_range_rad = 1e-3;
    let still = observed(&robot, &real);
    assert!(speaks_of(&still, &["forearm_pitch gain"]), "{:?}", still.null_space);
    assert!(!speaks_of(&moved, &["forearm_pitch gain:"]), "{:?}", moved.null_space);
    let [_, o2, o3, o4, _] = moved.o;
    assert!((o2 * moved.condition_number - 1.0).abs() < 1e-9);
    assert!((o4 - o2 * o3).abs() <= 1e-9 * o4.abs());
    let warm = moved.null_space.iter().filter(|line| line.is_of_terms && line.words.contains("gain per K")).count();
    assert!(warm > 0, "a temperature that hardly changed tells no gain per K: {:?}", moved.null_space);
}
