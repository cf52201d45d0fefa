//! `armcal2`: round trips, their error at the tool, and errors for everything that is lost.

use rand::RngExt;

use crate::file::compact::precision::MAX_COMPACT_BYTES;
use crate::file::compact::*;
use crate::fixture::{estimate, sample, titan, with_terms};
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::sensor::Conditions;
use armcal_core::stats::{quantile, stream_rng};
use armcal_core::streams::JointAngles;
use armcal_core::time::SIMULATION_EPOCH;

/// Returns the largest distance between the tool's positions by `a` and by `b` over the arm's range, m.
fn worst_m(robot: &Robot, a: &ArmSensors, b: &ArmSensors, away: f64, seed: u64) -> f64 {
    let mut rng = stream_rng(seed, "poses");
    let tool_m = |angles: &JointAngles| robot.chain.link_poses(angles).frame(&robot.tool.mount).translation.vector;
    let distance_m = (0..400).map(|_| {
        let angles = JointAngles::from_fn(6, |j| {
            robot.sensors[j].center_rad + rng.random_range(-1.0..1.0) * robot.sensors[j].half_range_rad
        });
        let conditions = Conditions {
            oil_c: Some(17.2 + away * rng.random_range(-20.0..20.0)),
            pressure_pa: Some(3e7 + away * rng.random_range(-1e7..1e7)),
            stamp: Some(SIMULATION_EPOCH.plus_s(321.0 + away * rng.random_range(0.0..7200.0))),
        };
        let counts = a.counts_under(&angles, &conditions);
        (tool_m(&a.angles_under(&counts, &conditions)) - tool_m(&b.angles_under(&counts, &conditions))).norm()
    });
    distance_m.fold(0.0, f64::max)
}

/// Six joints have every term, with a nonlinearity of 0.1 % of the range and of 0.5 %.
#[test]
fn a_calibration_with_terms_fits_into_the_line_and_comes_back() {
    let robot = titan();
    for nonlinearity in [2e-3, 1e-2] {
        let (mut bytes, mut errors_m) = (Vec::new(), Vec::new());
        for seed in 0..50 {
            let mut rng = stream_rng(seed, "compact terms");
            let (parameters, covariance) = estimate(&robot, 6, nonlinearity, &mut rng);
            let mut full = with_terms(&robot, &parameters, &covariance);
            full.joint.iter_mut().for_each(|joint| (joint.gain_estimated, joint.offset_estimated) = (true, true));
            let compact = CompactCalibration::of(&full).expect("a compact form");
            let text = compact.to_text().expect("it fits");
            assert!(text.starts_with("armcal2 titan4 ") && text.bytes().all(|b| b == b' ' || b.is_ascii_graphic()));
            let read = CompactCalibration::from_text(&text).expect("it reads");
            assert_eq!(read, compact);
            assert_eq!(read.to_text().as_ref(), Ok(&text));
            let (exact, rounded) = (full.sensors(&robot).expect("fits"), read.sensors(&robot).expect("fits"));
            let here_m = worst_m(&robot, &exact, &rounded, 0.0, seed);
            let away_m = worst_m(&robot, &exact, &rounded, 1.0, seed);
            assert!(here_m < 5e-5 && away_m < 1e-4 && here_m > 0.0, "{seed}: {here_m} {away_m} {text}");
            bytes.push(text.len() as f64);
            errors_m.push(here_m);
        }
        let at = |values: &[f64], q| quantile(values, q).expect("values");
        eprintln!(
            "{nonlinearity}: {} .. {} bytes, the tool is off by {:.1e} m (median), {:.1e} at most",
            at(&bytes, 0.0),
            at(&bytes, 1.0),
            at(&errors_m, 0.5),
            at(&errors_m, 1.0)
        );
    }
}

#[test]
fn a_straight_one_is_as_before() {
    let text = CompactCalibration::of(&sample()).expect("a compact form").to_text().expect("it fits");
    assert!(text.starts_with("armcal1 ") && !text.contains('^'), "{text}");
}

#[test]
fn what_does_not_fit_is_refused_and_not_cut() {
    let robot = titan();
    let mut rng = stream_rng(1, "compact terms");
    let (parameters, covariance) = estimate(&robot, 6, 2e-3, &mut rng);
    let mut full = with_terms(&robot, &parameters, &covariance);
    let mut many = full.clone();
    let (seventh, eighth) = (full.joint[0].clone(), full.joint[1].clone());
    for joint in &mut many.joint {
        joint.terms.as_mut().expect("terms").nonlinearity_rad = Some(vec![0.2; 12]);
    }
    many.joint.extend([seventh, eighth]);
    let compact = CompactCalibration::of(&many).expect("within the range");
    assert!(matches!(compact.to_text(), Err(CompactError::TooLong { bytes }) if bytes >= MAX_COMPACT_BYTES));
    full.joint[2].terms.as_mut().expect("terms").drift_rad_per_h = Some(1.0 + 1e-3);
    assert!(matches!(CompactCalibration::of(&full), Err(CompactError::Range { .. })));
    full.joint[2].terms.as_mut().expect("terms").drift_rad_per_h = Some(f64::NAN);
    assert!(matches!(CompactCalibration::of(&full), Err(CompactError::Range { .. })));
    full.joint[2].terms.as_mut().expect("terms").drift_rad_per_h = None;
    full.joint[2].identified_ratio = Some(2.0);
    assert!(matches!(CompactCalibration::of(&full), Err(CompactError::MeasuredScale { .. })));
}

/// The shape refers to half of the range, so that another range means another robot.
#[test]
fn another_range_is_another_robot() {
    let mut robot = titan();
    let mut rng = stream_rng(5, "compact terms");
    let (parameters, covariance) = estimate(&robot, 2, 2e-3, &mut rng);
    let compact = CompactCalibration::of(&with_terms(&robot, &parameters, &covariance)).expect("a compact form");
    assert!(compact.fits(&robot));
    robot.sensors[4].half_range_rad += 0.1;
    assert!(compact.fits(&robot), "joint 4 has no shape");
    robot.sensors[1].half_range_rad += 0.1;
    assert!(!compact.fits(&robot));
}

#[test]
fn every_single_change_of_a_line_with_terms_is_noticed() {
    let robot = titan();
    let mut rng = stream_rng(6, "compact terms");
    let (parameters, covariance) = estimate(&robot, 5, 2e-3, &mut rng);
    let compact = CompactCalibration::of(&with_terms(&robot, &parameters, &covariance)).expect("a compact form");
    let text = compact.to_text().expect("it fits");
    for at in 0..text.len() {
        for bit in 0..7 {
            let mut bytes = text.clone().into_bytes();
            bytes[at] ^= 1 << bit;
            assert!(CompactCalibration::from_text(&String::from_utf8(bytes).expect("ASCII")).is_err());
        }
        assert!(CompactCalibration::from_text(&text[..at]).is_err());
    }
    // Fields that are no numbers are named even if the checksum is right.
    let body = &text[..text.len() - 10];
    let reference = body.split(' ').find(|word| word.starts_with('c')).expect("a reference");
    let last = body.split(' ').nth(9).expect("a joint");
    let cases = [
        (reference.to_owned(), "c1/2/3".to_owned(), "reference"),
        (reference.to_owned(), "c1/2/3/4".to_owned(), "reference"),
        (last.to_owned(), format!("{last}~"), "joint 0: terms"),
        (last.to_owned(), format!("{last}00000000000000"), "joint 0: terms"),
        (last.to_owned(), format!("{last}\""), "joint 0: terms"),
    ];
    for (from, to, field) in cases {
        let changed = body.replacen(&from, &to, 1);
        let sum = blake3::hash(changed.as_bytes()).to_hex()[..8].to_owned();
        let error = CompactCalibration::from_text(&format!("{changed} #{sum}")).expect_err("refused");
        let CompactError::Field { field: named, .. } = &error else { panic!("{from} -> {to}: {error}") };
        assert_eq!(named, field, "{from} -> {to}: {error}");
    }
}

proptest::proptest! {
    #[test]
    fn any_text_after_armcal2_is_read_or_refused(text in "[ -~]{0,200}") {
        let body = format!("armcal2 titan4 minimum_distance ok t1 e- h00 r00 c1/2/3/5 {text}");
        let body = body.split_ascii_whitespace().collect::<Vec<_>>().join(" ");
        let sum = blake3::hash(body.as_bytes()).to_hex()[..8].to_owned();
        let _ = CompactCalibration::from_text(&format!("{body} #{sum}"));
    }
}
