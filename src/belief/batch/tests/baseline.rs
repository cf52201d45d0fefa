//! Calibrations compared with a fit of mount and map only.

use rand::seq::SliceRandom;

use crate::batch::marked_calibrations::calibrate_data;
use crate::batch::tests::data::{Noise, Truth, rng, titan, views};
use crate::file::calibration::{Calibration, Status};
use crate::methods::{CalibrationMethod, PositionSolution};
use crate::model::parameters::{JointParameters, Parameter};
use crate::model::scales::Hyperparameters;
use crate::positions::{PositionProblem, Solution};
use crate::say::refusal::Refusal;
use crate::shared::Shared;
use crate::solve::covariance::{CommonErrors, ParameterCovariance};
use crate::solve::model_for_views::model_for;
use crate::views::calibration_data::{CalibrationData, HeldOut};
use crate::views::view::{CaptureData, View};
use armcal_core::numeric::Outcome;
use armcal_core::routine::Method;

const SEEDS: std::ops::Range<u64> = 7000..7020;
/// A seed of `SEEDS` with shuffled readings whose estimate passes all other tests.
const SHUFFLED_SEED: u64 = 7013;
const N_VIEWS: usize = 25;
/// The simplest method.
const BY_POSITIONS: CalibrationMethod =
    CalibrationMethod::Positions { method: Method::MinimumDistance, solve: least_squares };

fn least_squares(
    problem: &PositionProblem<'_>,
    free: &[Parameter],
    guess: &JointParameters,
    errors: &CommonErrors,
) -> Option<PositionSolution> {
    let mut parameters = *guess;
    let cost = |at: &JointParameters| problem.linearize(at, free).0.norm_squared();
    for _ in 0..10 {
        let (off, by) = problem.linearize(&parameters, free);
        let step = by.tr_mul(&by).cholesky()?.solve(&by.tr_mul(&off));
        free.iter().zip(step.iter()).for_each(|(p, step)| parameters.set(*p, parameters.get(*p) - step));
    }
    let (cost_initial, cost_final) = (cost(guess), cost(&parameters));
    let solution = Solution { parameters, outcome: Outcome::Converged, evaluations: 10, cost_initial, cost_final };
    let (covariance, by_mount) = ParameterCovariance::estimate(problem, free, &parameters, errors);
    Some(PositionSolution { determined: free.to_vec(), solution, covariance, by_mount, unobservable: Vec::new() })
}

/// State of an arm's sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Sensors {
    AsDrawn,
    /// Errors within the datasheet's sigmas.
    OutOfCalibration,
    /// The readings belong to other views.
    Shuffled,
    /// Errors within the datasheet's sigmas; in two views one tag has another tag's id.
    TagsMisread,
}

fn calibrated(sensors: Sensors, method: CalibrationMethod, seed: u64) -> &'static Calibration {
    static CALIBRATED: Shared<(Sensors, u8, u64), Calibration> = Shared::new();
    CALIBRATED.get((sensors, method.method() as u8, seed), || calibrate_views(sensors, method, seed))
}

fn calibrate_views(sensors: Sensors, method: CalibrationMethod, seed: u64) -> Calibration {
    let robot = titan();
    let mut rng = rng(seed, "baseline");
    let scales = Hyperparameters::datasheet(&robot);
    let noise = Noise { corner_px: 0.3, n_frames: 8, joint_rad: scales.joint_std_rad };
    let mut model = model_for(&robot, &[]);
    model.joints.iter_mut().for_each(|kinds| kinds.truncate(2));
    let mut truth = Truth::draw(&robot, &model, &scales, &mut rng);
    if !matches!(sensors, Sensors::OutOfCalibration | Sensors::TagsMisread) {
        truth.parameters = JointParameters { reference: truth.parameters.reference, ..JointParameters::default() };
    }
    let mut views = views(&robot, &truth, &noise, N_VIEWS, &mut rng);
    if sensors == Sensors::Shuffled {
        let mut readings: Vec<_> = views.iter().map(|view| view.travel_rad).collect();
        readings.shuffle(&mut rng);
        views.iter_mut().zip(readings).for_each(|(view, reading)| view.travel_rad = reading);
    }
    if sensors == Sensors::TagsMisread {
        for view in views.iter_mut().skip(4).step_by(7).take(2) {
            misread_a_tag(view, robot.tags.len());
        }
    }
    let data = CalibrationData {
        name: "synthetic".to_owned(),
        messages_hash: String::new(),
        data: CaptureData { fit: views, n_marks: N_VIEWS, ..CaptureData::default() },
        gripper_tag_data: None,
        held_out: HeldOut::CrossValidation,
        robot,
        identified: Vec::new(),
    };
    calibrate_data(data, method, None).expect("a result")
}

/// Gives the first tag of `view` the id of a tag that the view does not show.
fn misread_a_tag(view: &mut View, n_tags: usize) {
    let unseen = (0..n_tags).find(|tag_idx| view.tags.iter().all(|tag| tag.tag_idx != *tag_idx));
    let tag_idx = unseen.expect("a tag that is not in view");
    (view.tags[0].tag_idx, view.tags[0].id) = (tag_idx, titan().tags[tag_idx].id);
}

#[derive(Debug, Default)]
struct Counts {
    beaten: usize,
    refused: usize,
    /// Number of refusals because the result is no better than the datasheet's sensors.
    no_better: usize,
}

fn counts(sensors: Sensors, method: CalibrationMethod) -> Counts {
    let mut counts = Counts::default();
    for seed in SEEDS {
        let found = calibrated(sensors, method, seed);
        let baseline = found.held_out.baseline.expect("compared");
        let is_no_better = |refusal: &Refusal| {
            matches!(refusal, Refusal::NoBetterThanDatasheet { .. } | Refusal::NoBetterThanBaseline { .. })
        };
        counts.beaten += usize::from(baseline.is_beaten());
        counts.refused += usize::from(found.status == Status::Refused);
        counts.no_better += usize::from(found.refusals.iter().any(is_no_better));
        if found.status == Status::Refused {
            println!("seed {seed}: {} ({baseline:?})", found.refusal.as_deref().unwrap_or_default());
        }
    }
    println!("{sensors:?}, {method:?}: {counts:?} of {}", SEEDS.count());
    counts
}

#[test]
fn sensors_that_need_nothing_are_no_reason_to_refuse_bundle() {
    let counts = counts(Sensors::AsDrawn, CalibrationMethod::Bundle);
    assert!(counts.beaten <= 2 && counts.refused == 0, "{counts:?}");
}

#[test]
fn sensors_out_of_calibration_beat_mount_and_map_alone() {
    for method in [CalibrationMethod::Bundle, BY_POSITIONS] {
        let counts = counts(Sensors::OutOfCalibration, method);
        assert!(counts.beaten == SEEDS.count() && counts.refused == 0, "{method:?}: {counts:?}");
    }
}

#[test]
fn a_method_on_positions_is_refused_where_it_beats_nothing() {
    let counts = counts(Sensors::AsDrawn, BY_POSITIONS);
    assert!(counts.no_better + 1 >= SEEDS.count(), "{counts:?}");
}

#[test]
fn misread_tags_are_in_no_held_out_figure() {
    for seed in SEEDS.take(5) {
        let clean = calibrated(Sensors::OutOfCalibration, CalibrationMethod::Bundle, seed);
        let misread = calibrated(Sensors::TagsMisread, CalibrationMethod::Bundle, seed);
        let [clean_m, misread_m] = [clean, misread].map(|found| found.held_out.rms_m.expect("held-out tags"));
        println!("seed {seed}: held out {:.2} mm, with misread tags {:.2} mm", 1e3 * clean_m, 1e3 * misread_m);
        assert!(misread.outliers.len() >= 2, "{:?}", misread.outliers);
        assert!((0.8..1.25).contains(&(misread_m / clean_m)), "{misread_m} m against {clean_m} m");
    }
}

#[test]
fn readings_of_other_views_confirm_nothing() {
    let found = calibrated(Sensors::Shuffled, CalibrationMethod::Bundle, SHUFFLED_SEED);
    let is_no_better = |refusal: &Refusal| matches!(refusal, Refusal::NoBetterThanBaseline { .. });
    assert!(found.refusals.iter().any(is_no_better), "{:?}", found.refusal);
}
