//! Warm starts on the estimator's own model: the prior's chi-square is one, a slip is detected, few views suffice.

use nalgebra::{Vector3, Vector6};

use crate::batch::tables::{camera_mount_table, lens_tables};
use crate::batch::tests::data::{Noise, Truth, normal, rng, titan, views};
use crate::explain::calibration_prior::{CalibrationPrior, MOUNT_ROWS, PriorConsistency, with_mount_rows};
use crate::explain::failures::FailureAdjusted;
use crate::explain::setup::BundleSetup;
use crate::file::bare::bare;
use crate::file::calibration::{Calibration, JointResult};
use crate::file::covariance_file::CovarianceTable;
use crate::file::lens_table::LensResult;
use crate::file::terms_table::{ReferenceTable, TermsTable};
use crate::file::valid_range::ValidRange;
use crate::model::parameters::JointParameters;
use crate::model::scales::Hyperparameters;
use crate::say::refusal::Refusal;
use crate::solve::covariance::ParameterCovariance;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::HyperparameterMode;
use crate::solve::model_for_views::{model_for, reference};
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::routine::Method;
use armcal_core::sensor::ConditionChange;
use armcal_core::spatial::exp;
use armcal_core::stats::quantile;

const FULL_VIEWS: usize = 30;
const WARM_VIEWS: usize = 5;
const HOURS: f64 = 4.0;
/// Drift that the estimator assumes for sensors without a stated drift.
const DRIFT_RAD_PER_SQRT_H: f64 = 0.02 * std::f64::consts::PI / 180.0;

/// One calibrated arm, and later views of it with oil that is 5 K warmer.
struct Case {
    robot: Robot,
    /// The arm at the time of the later views.
    truth: Truth,
    prior: Calibration,
    later: Vec<View>,
}

fn case(seed: u64, slip: Option<(usize, f64)>, n_later: usize) -> Case {
    case_with(seed, n_later, |truth| {
        if let Some((joint, by_rad)) = slip {
            truth.parameters.offset_rad[joint] += by_rad;
        }
    })
}

/// Returns an arm that `happens` changes after its calibration.
fn case_with(seed: u64, n_later: usize, happens: impl Fn(&mut Truth)) -> Case {
    let robot = titan();
    let mut rng = rng(seed, "warm");
    let scales = Hyperparameters::datasheet(&robot);
    let noise = Noise { corner_px: 0.3, n_frames: 5, joint_rad: scales.joint_std_rad };
    let mut model = model_for(&robot, &[]);
    let drawn = Truth::draw(&robot, &model, &scales, &mut rng);
    model.joints = model_for(&robot, &views(&robot, &drawn, &noise, 6, &mut rng)).joints;
    let mut truth = Truth::draw(&robot, &model, &scales, &mut rng);
    let first = still_readings(views(&robot, &truth, &noise, FULL_VIEWS, &mut rng));
    let applied = FailureAdjusted::new(&robot, &first, &[], &JointParameters::default());
    let found = estimate(&applied.input(HyperparameterMode::Given)).expect("solved");
    let prior = calibration(&robot, &found, &first);
    for joint in 0..robot.n_seen_joints() {
        truth.parameters.offset_rad[joint] += DRIFT_RAD_PER_SQRT_H * HOURS.sqrt() * normal(&mut rng);
    }
    happens(&mut truth);
    let later = still_readings(later(&robot, &truth, &noise, n_later, &mut rng));
    Case { robot, truth, prior, later }
}

/// Removes the readings' own noise: the joint errors are drawn already.
fn still_readings(mut views: Vec<View>) -> Vec<View> {
    for view in &mut views {
        view.n_readings = 1_000_000;
    }
    views
}

/// Views at other conditions; the angles of `truth` hold under them.
fn later(robot: &Robot, truth: &Truth, noise: &Noise, n: usize, rng: &mut rand_chacha::ChaCha8Rng) -> Vec<View> {
    // `views` sets conditions of its own: another reference is the same as other conditions.
    let mut shifted = truth.clone();
    shifted.parameters.reference.oil_c = truth.parameters.reference.oil_c.map(|c| c - 5.0);
    let mut out = views(robot, &shifted, noise, n, rng);
    for view in &mut out {
        view.conditions.oil_c = view.conditions.oil_c.map(|c| c + 5.0);
        view.end = view.end.plus_s(3600.0 * HOURS);
        view.conditions.stamp = Some(view.end);
    }
    out
}

/// The calibration as calibration.toml has it, including rounding.
fn calibration(robot: &Robot, found: &Estimate<'_>, views: &[View]) -> Calibration {
    let parameters = found.parameters();
    let covariance = ParameterCovariance {
        parameters: found.joint_parameters().to_vec(),
        matrix: found.joint_covariance(),
        residual_std_rad: Some(found.scales().joint_std_rad),
    };
    let full = with_mount_rows(found).expect("a mount");
    let names = covariance.parameters.iter().map(|p| p.name(robot)).chain(MOUNT_ROWS.map(str::to_owned));
    let sensors = parameters.sensors(robot);
    let joint = sensors.models.iter().enumerate().map(|(joint, model)| JointResult {
        name: model.spec.joint.clone(),
        moves: model.spec.moves,
        center_rad: model.spec.center_rad,
        gain_rad_per_count: model.correction.gain / model.spec.counts_per_rad,
        offset_rad: model.correction.offset_rad,
        gain_std_rad_per_count: 0.0,
        offset_std_rad: 0.0,
        gain_estimated: true,
        offset_estimated: true,
        covered_rad: [-1.0, 1.0],
        offset_counts: None,
        counts_per_rad: None,
        gain_over_datasheet: None,
        identified_ratio: None,
        residual_std_rad: covariance.residual_std_rad.map(|std| std[joint]),
        terms: TermsTable::of(joint, model, &covariance),
    });
    let last = views.iter().map(|view| view.end).max().expect("views");
    Calibration {
        valid: ValidRange { time_nanos: last.nanos, oil_c: None, water_c: None, pressure_pa: None },
        reference: ReferenceTable::of(&parameters, &covariance),
        camera_mount: Some(camera_mount_table(robot, found, views)),
        joint: joint.collect(),
        covariance: CovarianceTable::new(names.collect(), &full),
        ..bare(&robot.name, Method::Bundle)
    }
}

fn agreement(case: &Case) -> PriorConsistency {
    let applied = FailureAdjusted::new(&case.robot, &case.later, &[], &JointParameters::default());
    CalibrationPrior::new(&case.prior, &applied).expect("a covariance").consistency(&case.later).expect("solved")
}

/// The earlier calibration found another lens than robot.toml states: the warm start begins with that lens and keeps
/// it.
#[test]
fn the_lens_of_the_prior_is_taken_up() {
    const STD: [f64; 8] = [0.5, 0.5, 0.5, 0.5, 5e-4, 5e-4, 5e-4, 5e-4];
    for seed in 0..10 {
        let Case { robot, mut prior, later, .. } = case(seed, None, 12);
        let mut rng = rng(seed, "lens");
        let real = robot.camera.lens.intrinsics();
        let found = std::array::from_fn(|k| real[k] + STD[k] * normal(&mut rng));
        prior.lens = vec![LensResult::new(None, &robot.camera.lens.with_intrinsics(found), STD)];
        let mut drawn = robot;
        let [fx, fy, cx, cy, a, b, c, d] = real;
        drawn.camera.lens = drawn.camera.lens.with_intrinsics([1.03 * fx, 1.03 * fy, cx, cy, a, b, c, d]);
        let setup = BundleSetup::new(&drawn, &later, &[], Some(&prior));
        let with_lens = setup.prior().expect("a prior").as_ref().expect("a covariance");
        assert!(!with_lens.consistency(&later).expect("solved").is_beyond_chance(), "seed {seed}");
        let (warm, _) = setup.estimate().expect("solved");
        let table = &lens_tables(&drawn, &warm)[0];
        for ((found_px, std_px), real_px) in table.focal_px.iter().zip(&table.focal_std_px).zip(&real) {
            assert!((found_px - real_px).abs() < 4.0 * std_px && *std_px <= 0.5, "seed {seed}: {table:?}");
        }
        prior.lens.clear();
        let applied = FailureAdjusted::new(&drawn, &later, &[], &JointParameters::default());
        let without = CalibrationPrior::new(&prior, &applied).expect("a covariance").consistency(&later);
        assert!(without.is_none_or(|of| of.is_beyond_chance()), "seed {seed}: 3 % are no chance");
    }
}

#[test]
fn an_honest_prior_has_its_chi_square_and_is_not_refused() {
    const SEEDS: u64 = 100;
    let (mut share, mut refused) = (Vec::new(), 0);
    for seed in 0..SEEDS {
        let agreement = agreement(&case(seed, None, WARM_VIEWS));
        assert!(agreement.degrees_of_freedom >= 10, "{agreement:?}");
        share.push(agreement.chi2 / agreement.degrees_of_freedom as f64);
        refused += usize::from(agreement.is_beyond_chance());
    }
    let mean = share.iter().sum::<f64>() / SEEDS as f64;
    eprintln!("chi-square over its degrees of freedom: {mean:.3}; {refused} of {SEEDS} refused");
    // The survey's errors are the same in both calibrations, so the two agree a little better than two independent
    // ones.
    assert!((0.75..1.15).contains(&mean), "chi-square over its degrees of freedom: {mean:.3}");
    assert!(refused <= 1, "{refused} of {SEEDS} refused");
}

#[test]
fn a_slip_of_one_degree_is_refused_and_named() {
    for seed in 0..20 {
        let joint = (seed % 5) as usize;
        let by_rad = if seed % 2 == 0 { 1.0_f64 } else { -1.0 }.to_radians();
        let case = case(seed, Some((joint, by_rad)), WARM_VIEWS);
        let agreement = agreement(&case);
        assert!(agreement.is_beyond_chance(), "seed {seed}: {agreement:?}");
        assert_eq!((agreement.joint, agreement.camera_moved), (joint, None), "seed {seed}: {agreement:?}");
        let off = agreement.off_rad - by_rad;
        assert!(off.abs() < 0.4_f64.to_radians(), "seed {seed}: {agreement:?}");
        let refusal = agreement.refusal(&case.robot).expect("beyond chance");
        let Refusal::PriorContradicted { joint: named, off_rad, .. } = &refusal else { panic!("{refusal}") };
        assert_eq!((named, *off_rad), (&case.robot.sensors[joint].joint, agreement.off_rad));
    }
}

/// The sensors are unchanged, so no sensor may be blamed.
#[test]
fn a_camera_that_was_mounted_anew_is_named_with_its_motion() {
    for seed in 0..6 {
        let moved = exp(&Vector6::new(0.02, 0.01, -0.015, 0.05, -0.08, 0.04));
        let case = case_with(seed, 12, |truth| truth.mount *= moved);
        let agreement = agreement(&case);
        let [shift_m, turn_rad] = agreement.camera_moved.expect("the camera");
        let off = [shift_m - moved.translation.vector.norm(), turn_rad - moved.rotation.angle()];
        assert!(off[0].abs() < 0.01 && off[1].abs() < 0.02, "seed {seed}: {agreement:?}");
        let Some(Refusal::PriorContradicted { camera_moved: Some(of_refusal), .. }) = agreement.refusal(&case.robot)
        else {
            panic!("seed {seed}: {agreement:?}")
        };
        assert_eq!([of_refusal.shift_m, of_refusal.turn_rad], [shift_m, turn_rad]);
    }
}

/// Slips of the joint at the camera look like a turn of the mount.
#[test]
fn a_large_slip_is_not_blamed_on_the_camera() {
    for seed in 0..5 {
        let joint = seed as usize;
        let agreement = agreement(&case(seed, Some((joint, 6.0_f64.to_radians())), 12));
        assert!(agreement.is_beyond_chance() && agreement.camera_moved.is_none(), "seed {seed}: {agreement:?}");
    }
}

/// Tool errors over the middle of the range under the later views' conditions, root mean square, m.
fn tool_error_m(case: &Case, parameters: &JointParameters) -> f64 {
    let at = |p: &JointParameters, view: &View| -> Vector3<f64> {
        let departure: ConditionChange = view.conditions.departure_from(&p.reference);
        let angles = armcal_core::joints::JointAngles::from_fn(case.robot.n_joints(), |j| {
            p.correction(j).angle_rad(&case.robot.sensors[j], view.travel_rad[j], &departure, 0.0)
        });
        case.robot.chain.link_poses(&angles).frame(&case.robot.tool.mount).translation.vector
    };
    let squares: f64 =
        case.later.iter().map(|v| (at(parameters, v) - at(&case.truth.parameters, v)).norm_squared()).sum();
    (squares / case.later.len() as f64).sqrt()
}

#[test]
fn five_warm_views_are_as_good_as_a_full_calibration() {
    let (mut warm_m, mut cold_m, mut full_m) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 200..220 {
        // Errors are evaluated in all later views; the warm start uses the first five of them.
        let case = case(seed, None, FULL_VIEWS);
        let few: Vec<View> = case.later[..WARM_VIEWS].to_vec();
        let applied = FailureAdjusted::new(&case.robot, &few, &[], &JointParameters::default());
        let start = CalibrationPrior::new(&case.prior, &applied).expect("a covariance");
        let warm = estimate(&start.input(&few, HyperparameterMode::Fitted).expect("regular")).expect("solved");
        let cold = estimate(&applied.input(HyperparameterMode::Fitted)).expect("solved");
        let all = FailureAdjusted::new(&case.robot, &case.later, &[], &JointParameters::default());
        let full = estimate(&all.input(HyperparameterMode::Fitted)).expect("solved");
        for (errors, found) in [(&mut warm_m, &warm), (&mut cold_m, &cold), (&mut full_m, &full)] {
            errors.push(tool_error_m(&case, &found.parameters()));
        }
        assert_eq!(start.n_unknown(&case.robot), 0);
        assert_eq!(reference(&case.later).oil_c.map(|c| c > 15.0), Some(true));
    }
    let median = |errors: &[f64]| quantile(errors, 0.5).expect("some") * 1e3;
    let (warm, cold, full) = (median(&warm_m), median(&cold_m), median(&full_m));
    eprintln!("warm {warm:.2} mm, cold {cold:.2} mm, full {full:.2} mm");
    assert!(warm < 1.5 * full, "warm {warm:.2} mm, cold {cold:.2} mm, full {full:.2} mm");
    assert!(cold > 1.5 * warm, "warm {warm:.2} mm, cold {cold:.2} mm, full {full:.2} mm");
}
