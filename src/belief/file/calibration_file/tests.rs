//! Round trips, and error messages of broken files.

use rand::RngExt;

use crate::file::calibration_file::*;
use crate::fixture::{estimate, sample, titan, with_terms};
use armcal_core::sensor::Conditions;
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointAngles;
use armcal_core::time::SIMULATION_EPOCH;

fn parsed(text: &str) -> Result<Calibration, CalibrationFileError> {
    Calibration::parse(Path::new("calibration.toml"), text)
}

#[test]
fn a_calibration_without_terms_is_written_as_it_was_read() {
    let file = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/sample/calibration.toml");
    let before = std::fs::read_to_string(file).expect("the sample");
    assert_eq!(sample().to_toml(), before);
    assert_eq!(sample().parameter_covariance(&titan()).residual_std_rad, None);
    assert!(!sample().sensors(&titan()).expect("fits").have_terms());
}

#[test]
fn terms_come_back_as_they_were() {
    let robot = titan();
    for seed in 0..20 {
        let mut rng = stream_rng(seed, "file");
        let (parameters, covariance) = estimate(&robot, 5, 2e-3, &mut rng);
        let full = with_terms(&robot, &parameters, &covariance);
        let text = full.to_toml();
        let read = Calibration { covariance: full.covariance.clone(), ..parsed(&text).expect("it reads") };
        assert_eq!(Calibration { covariance_hash: None, ..read.clone() }, full);
        assert_eq!(read.to_toml(), text);
        assert!(text.contains("[joint.terms]") && text.contains("[reference]") && text.contains("phi_h(x) = sin"));
        // Joint 5 has no terms.
        assert_eq!(read.joint[5].terms, None);
        let back = read.parameters(&robot);
        assert_eq!((back.terms, back.reference), (parameters.terms, parameters.reference));

        let (exact, sensors) = (parameters.sensors(&robot), read.sensors(&robot).expect("fits"));
        for _ in 0..50 {
            let angles = JointAngles::from_fn(6, |j| robot.sensors[j].center_rad + rng.random_range(-1.0..1.0));
            let conditions = Conditions {
                oil_c: Some(rng.random_range(4.0..60.0)),
                pressure_pa: Some(rng.random_range(1e5..4e7)),
                stamp: Some(SIMULATION_EPOCH.plus_s(rng.random_range(0.0..1e4))),
            };
            let counts = exact.counts_under(&angles, &conditions);
            assert!(sensors.angles_under(&counts, &conditions).max_abs_difference(&angles) < 1e-9);
        }

        let again = read.parameter_covariance(&robot);
        assert_eq!(again.parameters, covariance.parameters);
        assert_eq!(again.parameters.len(), 5 * 19);
        let apart = (&again.matrix - &covariance.matrix).abs();
        assert!(apart.iter().zip(covariance.matrix.iter()).all(|(by, value)| *by <= 5.1e-7 * value.abs()));
        assert!(apart.max() > 0.0, "95 parameters are written with seven digits");
        let residuals = (again.residual_std_rad.expect("there"), covariance.residual_std_rad.expect("there"));
        assert_eq!(residuals.0[..6], residuals.1[..6]);
    }
}

/// With few parameters, the covariance keeps all digits.
#[test]
fn a_small_covariance_loses_nothing() {
    let robot = titan();
    let mut rng = stream_rng(1, "file");
    let (parameters, mut covariance) = estimate(&robot, 1, 2e-3, &mut rng);
    assert_eq!(covariance.parameters.len(), 19);
    covariance.residual_std_rad = None;
    let full = with_terms(&robot, &parameters, &covariance);
    let again = full.parameter_covariance(&robot);
    assert_eq!((again.matrix, again.residual_std_rad), (covariance.matrix, None));
}

/// Terms are in radians of the measured scale, regardless of the robot that the file is applied to.
#[test]
fn a_measured_scale_holds_for_the_terms_too() {
    let robot = titan();
    let mut rng = stream_rng(2, "file");
    let ratio = -2.3;
    let mut scaled = robot.clone();
    scaled.sensors[1] = scaled.sensors[1].with_scale(ratio);
    let (parameters, covariance) = estimate(&scaled, 3, 2e-3, &mut rng);
    let mut full = with_terms(&scaled, &parameters, &covariance);
    full.joint[1].identified_ratio = Some(ratio);
    full.joint[1].gain_over_datasheet = Some(parameters.gain[1] / ratio);
    let exact = parameters.sensors(&scaled);
    for robot in [&robot, &scaled] {
        let sensors = full.sensors(robot).expect("fits");
        let angles = JointAngles::from_fn(6, |j| robot.sensors[j].center_rad + 0.4);
        let counts = exact.counts(&angles);
        assert!(sensors.angles(&counts).max_abs_difference(&angles) < 1e-9);
    }
}

#[test]
fn what_is_wrong_with_terms_is_named() {
    let robot = titan();
    let mut rng = stream_rng(3, "file");
    let (parameters, covariance) = estimate(&robot, 1, 2e-3, &mut rng);
    let good = with_terms(&robot, &parameters, &covariance);
    let told = |change: &dyn Fn(&mut Calibration)| {
        let mut bad = good.clone();
        change(&mut bad);
        parsed(&bad.to_toml()).expect_err("refused").to_string()
    };
    fn terms(calibration: &mut Calibration) -> &mut TermsTable {
        calibration.joint[0].terms.as_mut().expect("terms")
    }
    let changes: [&dyn Fn(&mut Calibration); 7] = [
        &|c| c.reference = None,
        &|c| terms(c).nonlinearity_rad.as_mut().expect("a shape").truncate(11),
        &|c| terms(c).nonlinearity_rad.as_mut().expect("a shape")[3] = 1.5,
        &|c| terms(c).offset_rad_per_k = Some(0.5),
        &|c| terms(c).half_range_rad = 0.0,
        &|c| c.joint[0].residual_std_rad = Some(-1.0),
        &|c| c.reference.as_mut().expect("there").oil_c = Some(1e4),
    ];
    let mut words: Vec<String> = changes.into_iter().map(told).collect();
    let unknown = good.to_toml().replace("half_backlash_rad =", "half_backlash_m =");
    words.push(parsed(&unknown).expect_err("refused").to_string());
    // Older files name the keys so.
    let before = good.to_toml().replace("nonlinearity_rad", "shape_rad").replace("half_backlash_rad", "half_play_rad");
    assert_eq!(parsed(&before).expect("it reads").joint, good.joint);
    // A shape that doubles back has no inverse.
    let mut bent = good;
    terms(&mut bent).nonlinearity_rad.as_mut().expect("a shape")[5] = 0.8;
    words.push(bent.sensors(&robot).expect_err("refused").to_string());
    insta::assert_snapshot!("wrong_terms", words.join("\n"));
}

#[test]
fn what_lies_beyond_is_named_and_what_lies_within_is_not() {
    let mut calibration = sample();
    calibration.joint[0].covered_rad = [0.6, -0.4];
    calibration.valid.oil_c = Some([10.0, 20.0]);
    calibration.valid.pressure_pa = Some([1e6, 2e6]);
    let stamp = armcal_core::time::Stamp { nanos: calibration.valid.time_nanos };
    let mut angles =
        JointAngles::from_fn(6, |j| 0.5 * (calibration.joint[j].covered_rad[0] + calibration.joint[j].covered_rad[1]));
    // The last joint has no range because none of its parameters was estimated.
    angles[5] = 3.0;
    let within = Conditions { oil_c: Some(21.5), pressure_pa: Some(0.6e6), stamp: Some(stamp.plus_s(3600.0)) };
    assert_eq!(calibration.beyond(&angles, &within), [""; 0]);
    assert_eq!(calibration.beyond(&angles, &Conditions::default()), [""; 0]);
    angles[0] = 0.63;
    assert_eq!(calibration.beyond(&angles, &within), [""; 0]);
    angles[0] = -0.7;
    let beyond = Conditions { oil_c: Some(7.5), pressure_pa: Some(2.75e6), stamp: Some(stamp.plus_s(10.0 * 3600.0)) };
    let told = calibration.beyond(&angles, &beyond);
    assert_eq!(told.len(), 4);
    let words = [told.join("; "), calibration.valid_for().join(", ")];
    insta::assert_snapshot!("validity", words.join("\n"));
}

#[test]
fn ranges_of_slides_are_in_metres() {
    let mut calibration = sample();
    let in_rad = calibration.valid_for();
    assert!(in_rad[0].ends_with(" rad"), "{in_rad:?}");
    calibration.joint[0].moves = armcal_core::kinematics::JointKind::Prismatic;
    let in_metres = calibration.valid_for();
    assert_eq!(in_metres[0], in_rad[0].replace(" rad", " m"));
    assert_eq!(in_metres[1..], in_rad[1..]);
    let mut angles = JointAngles::from_fn(6, |j| calibration.joint[j].covered_rad[0]);
    angles[0] = calibration.joint[0].covered_rad[0].max(calibration.joint[0].covered_rad[1]) + 0.5;
    let told = calibration.beyond(&angles, &Conditions::default());
    assert!(told.len() == 1 && told[0].contains("0.50 m") && !told[0].contains("rad"), "{told:?}");
}

/// A refused result stays refused when its status alone is edited, and an accepted one with its reasons of none reads.
#[test]
fn a_refused_calibration_is_not_accepted_by_an_edited_status() {
    use crate::say::refusal::Refusal;
    use armcal_core::codes::Coded;
    for refusal in [Refusal::PriorUntested, Refusal::TooFewViews { views: 3, parameters: 9 }] {
        let mut refused = sample();
        refused.refuse_for([refusal]);
        parsed(&refused.to_toml()).expect("a refused result reads");
        let both = Calibration { status: Status::Accepted, ..refused };
        let sentence_alone = Calibration { refusals: Vec::new(), ..both.clone() };
        let reasons_alone = Calibration { refusal: None, ..both.clone() };
        for edited in [both, sentence_alone, reasons_alone] {
            assert_eq!(parsed(&edited.to_toml()).expect_err("contradictory").code(), Code::KeysConflict);
        }
    }
    parsed(&sample().to_toml()).expect("an accepted result reads");
}
