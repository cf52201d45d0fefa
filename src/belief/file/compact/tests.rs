//! Round trips, the limit of the text's length, and texts that a bad link changed.

use proptest::prelude::*;

use crate::file::bare::bare;
use crate::file::calibration::{Calibration, JointResult, Status};
use crate::file::compact::precision::{MAX_COMPACT_BYTES, STEPS};
use crate::file::compact::*;
use crate::file::covariance_file::CovarianceTable;
use crate::file::metrics::HeldOutMetrics;
use crate::file::valid_range::ValidRange;
use crate::say::refusal::Refusal;
use armcal_core::numeric::Outcome;
use armcal_core::routine::Method;
use armcal_core::stats::Summary;

/// Gain and offset corrections with standard deviations; `None` where the datasheet's value stays.
#[derive(Clone, Debug)]
struct Joint {
    name: String,
    gain: Option<(f64, f64)>,
    offset: Option<(f64, f64)>,
}

const COUNTS_PER_RAD: f64 = -2_635.6;

fn calibration(robot: &str, joints: &[Joint], refusal: Option<Refusal>) -> Calibration {
    let mut parameters = Vec::new();
    let mut variances = Vec::new();
    let mut estimated = |name: String, std: f64| {
        parameters.push(name);
        variances.push(std * std);
    };
    let one = |joint: &Joint| {
        let (gain, gain_std) = joint.gain.unwrap_or((0.0, 0.03));
        let (offset_rad, offset_std_rad) = joint.offset.unwrap_or((0.0, 0.05));
        if joint.gain.is_some() {
            estimated(format!("{} gain", joint.name), gain_std);
        }
        if joint.offset.is_some() {
            estimated(format!("{} offset", joint.name), offset_std_rad);
        }
        JointResult {
            name: joint.name.clone(),
            moves: Default::default(),
            center_rad: 0.3,
            gain_rad_per_count: (1.0 + gain) / COUNTS_PER_RAD,
            offset_rad,
            gain_std_rad_per_count: gain_std / COUNTS_PER_RAD.abs(),
            offset_std_rad,
            gain_estimated: joint.gain.is_some(),
            offset_estimated: joint.offset.is_some(),
            covered_rad: [-1.0, 1.0],
            offset_counts: None,
            counts_per_rad: None,
            identified_ratio: None,
            gain_over_datasheet: None,
            residual_std_rad: None,
            terms: None,
        }
    };
    let joint = joints.iter().map(one).collect();
    let n = variances.len();
    let rows = (0..n).map(|i| (0..n).map(|j| if i == j { variances[i] } else { 0.0 }).collect()).collect();
    Calibration {
        status: if refusal.is_some() { Status::Refused } else { Status::Accepted },
        refusal: refusal.as_ref().map(ToString::to_string),
        refusals: refusal.into_iter().collect(),
        messages_hash: "24a1c0689a592055e463ff1910220527f15c7d657fa0e8a41a4710f107b1b963".to_owned(),
        held_out: HeldOutMetrics {
            views: 4,
            cross_validated: false,
            mean_m: None,
            camera_mean_m: None,
            rms_m: Some(0.01),
            rms_px: Some(2.6),
            nominal_rms_m: Some(0.2),
            baseline: None,
            within_95: None,
        },
        predicted_tool_error_m: Some(Summary { n: 4, median: 0.005_879_45, p95: 0.006_070_3, max: 0.006_085 }),
        valid: ValidRange { time_nanos: 1_767_225_749_230_000_000, oil_c: None, water_c: None, pressure_pa: None },
        joint,
        covariance: CovarianceTable { parameters, rows },
        ..bare(robot, Method::MinimumDistance)
    }
}

fn joint(name: &str, gain: (f64, f64), offset: (f64, f64)) -> Joint {
    Joint { name: name.to_owned(), gain: Some(gain), offset: Some(offset) }
}

fn six() -> Vec<Joint> {
    let mut joints: Vec<Joint> =
        (0..5).map(|n| joint(&format!("j{n}"), (0.0481 - 0.02 * n as f64, 0.001), (-0.0242, 0.0012))).collect();
    joints.push(Joint { name: "wrist_rotate".to_owned(), gain: None, offset: None });
    joints
}

fn text_of(calibration: &Calibration) -> String {
    CompactCalibration::of(calibration).unwrap().to_text().unwrap()
}

#[test]
fn a_usual_one_is_short_printable_and_comes_back() {
    let full = calibration("titan4", &six(), None);
    let text = text_of(&full);
    assert!(text.len() < 320, "{}: {text}", text.len());
    assert!(text.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic()), "{text}");
    assert!(text.starts_with("armcal1 titan4 minimum_distance ok t1767225749 e5880/6071 h24a1c0689a59 r"), "{text}");
    assert!(text.contains(" +481000~10000,-242000~12000 ") && text.contains(" =0~300000,=0~500000 #"), "{text}");
    let read = CompactCalibration::from_text(&format!("  {}\r\n", text.replace(" e", "\n e"))).unwrap();
    assert_eq!(read, CompactCalibration::of(&full).unwrap());
    assert_eq!(read.to_text().unwrap(), text);
}

#[test]
fn the_largest_stays_below_the_limit() {
    let joints: Vec<Joint> = (0..8)
        .map(|n| joint(&format!("{n}{}", "x".repeat(200)), (9.999_999_9, 9.999_999_9), (-9.999_999_9, 9.999_999_9)))
        .collect();
    let mut full =
        calibration(&"Ä long name ".repeat(20), &joints, Some(Refusal::TooFewViews { views: 39, parameters: 40 }));
    full.valid.time_nanos = i64::MIN;
    full.predicted_tool_error_m = Some(Summary { n: 1, median: 99.999_999, p95: 99.999_999, max: 99.999_999 });
    let text = text_of(&full);
    assert!(text.len() < MAX_COMPACT_BYTES, "{} bytes", text.len());
    assert_eq!(CompactCalibration::from_text(&text).unwrap(), CompactCalibration::of(&full).unwrap());
}

#[test]
fn what_is_not_finite_is_unknown_or_refused() {
    let mut full = calibration("titan4", &six(), None);
    full.joint[0].offset_std_rad = f64::INFINITY;
    full.predicted_tool_error_m = Some(Summary { n: 1, median: f64::NAN, p95: f64::NAN, max: f64::NAN });
    let read = CompactCalibration::from_text(&text_of(&full)).unwrap();
    assert_eq!((read.joint[0].offset_std_rad, read.predicted_tool_error_m), (None, None));
    full.joint[0].offset_rad = f64::NAN;
    assert!(matches!(CompactCalibration::of(&full), Err(CompactError::Range { .. })));
    full.joint[0].offset_rad = 0.0;
    full.covariance.rows[0][0] = f64::NAN;
    assert!(matches!(CompactCalibration::of(&full), Err(CompactError::NoRelativeGain { .. })));
}

/// Each reason of the verdict has its own code.
#[test]
fn every_refusal_has_a_code() {
    use crate::checks::refusal_conditions::{AcceptanceData, HeldOutLimit, refusal};
    use crate::judge::baseline_comparison::BaselineComparison;
    use crate::say::refusal::HeldOutLimitSource;
    let by_chance = |p_value| BaselineComparison { rms_m: 0.05, ratio: 0.08, p_value };
    let good = AcceptanceData {
        outcome: Outcome::Converged,
        evaluations: 120,
        held_out_views: 8,
        held_out_rms_m: Some(0.004),
        held_out_nominal_rms_m: Some(0.08),
        baseline: Some(by_chance(1e-4)),
        fit_rms_m: 0.004,
        n_parameters: 10,
        fit_views: 30,
        held_out_limit: Some(HeldOutLimit { limit_m: 0.012, source: HeldOutLimitSource::Tolerance }),
    };
    let faults = [
        (AcceptanceData { outcome: Outcome::Stalled, ..good }, "not_solved"),
        (AcceptanceData { fit_views: 8, ..good }, "too_few_views"),
        (AcceptanceData { held_out_views: 2, ..good }, "too_few_held_out_views"),
        (AcceptanceData { held_out_rms_m: None, ..good }, "no_held_out_tag"),
        (AcceptanceData { held_out_rms_m: Some(0.09), ..good }, "no_better_than_datasheet"),
        (AcceptanceData { baseline: Some(by_chance(0.2)), ..good }, "no_better_than_baseline"),
        (AcceptanceData { held_out_rms_m: Some(0.011), ..good }, "overfitted"),
        (AcceptanceData { held_out_rms_m: Some(0.013), fit_rms_m: 0.013, ..good }, "held_out_error"),
    ];
    for (fault, code) in faults {
        let full = calibration("titan4", &six(), refusal(&fault));
        let text = text_of(&full);
        assert!(text.contains(&format!(" no:{code} ")), "{text}");
        let read = CompactCalibration::from_text(&text).unwrap();
        assert_eq!((read.status, read.refusal_code.as_deref()), (Status::Refused, Some(code)));
    }
}

/// Any one character changed, lost, doubled or swapped, and any cut, is detected.
#[test]
fn every_single_change_is_noticed() {
    let text = text_of(&calibration("titan4", &six(), None));
    let refused = |changed: String| {
        let read = CompactCalibration::from_text(&changed);
        assert!(read.is_err(), "{changed}");
    };
    for at in 0..text.len() {
        for bit in 0..7 {
            let mut bytes = text.clone().into_bytes();
            bytes[at] ^= 1 << bit;
            refused(String::from_utf8(bytes).unwrap());
        }
        refused(text[..at].to_owned());
        refused(format!("{}{}", &text[..at], &text[at + 1..]));
    }
    for other in ["", " ", "armcal2 titan4", "robot = \"titan4\"", "#", "armcal1", "armcal1 #00000000"] {
        refused(other.to_owned());
    }
}

/// Wrong fields are rejected without a panic, even if the checksum is right.
#[test]
fn wrong_fields_are_named() {
    let text = text_of(&calibration("titan4", &six(), None));
    let body = &text[..text.len() - 10];
    let cases = [
        (" ok ", " yes ", "verdict"),
        ("minimum_distance", "guess", "method"),
        (" t1767225749", " t17.5", "time"),
        ("e5880/6071", "e5880", "predicted tool error"),
        (" h24a1", " h24g1", "messages hash"),
        ("+481000~10000,", "+481000~10000", "joint 0"),
        ("+481000~", "+999999999~", "joint 0"),
        ("+481000~", "++481000~", "joint 0"),
        ("+481000~", "~", "joint 0"),
    ];
    for (from, to, field) in cases {
        let changed = body.replacen(from, to, 1);
        assert_ne!(changed, body);
        let sum = blake3::hash(changed.as_bytes()).to_hex()[..8].to_owned();
        let error = CompactCalibration::from_text(&format!("{changed} #{sum}")).unwrap_err();
        let CompactError::Field { field: named, .. } = &error else { panic!("{from} -> {to}: {error}") };
        assert_eq!(named, field, "{from} -> {to}: {error}");
    }
}

fn any_joint(n: usize) -> impl Strategy<Value = Joint> {
    let parameter = |size: f64| proptest::option::of((-size..size, 1e-6..1.0f64));
    (parameter(0.9), parameter(3.0)).prop_map(move |(gain, offset)| Joint { name: format!("joint {n}"), gain, offset })
}

proptest! {
    #[test]
    fn any_calibration_comes_back_within_half_a_step(
        joints in (1usize..=8).prop_flat_map(|n| (0..n).map(any_joint).collect::<Vec<_>>()), is_refused: bool
    ) {
        let refusal = is_refused.then_some(Refusal::Overfitted { held_out_m: 0.011, fit_m: 0.004 });
        let full = calibration("arm 7", &joints, refusal);
        let text = text_of(&full);
        prop_assert!(text.len() < MAX_COMPACT_BYTES);
        let read = CompactCalibration::from_text(&text).unwrap();
        prop_assert_eq!(&read, &CompactCalibration::of(&full).unwrap());
        for (joint, given) in read.joint.iter().zip(&joints) {
            let (gain, offset) = (given.gain.unwrap_or((0.0, 0.03)), given.offset.unwrap_or((0.0, 0.05)));
            prop_assert!((joint.gain_correction - gain.0).abs() <= 0.51 / STEPS);
            prop_assert!((joint.offset_rad - offset.0).abs() <= 0.51 / STEPS);
            let slack = 1.01 / STEPS;
            prop_assert!((-1e-12..slack).contains(&(joint.gain_std.unwrap() - gain.1)));
            prop_assert!((-1e-12..slack).contains(&(joint.offset_std_rad.unwrap() - offset.1)));
            let estimated = (joint.gain_estimated, joint.offset_estimated);
            prop_assert_eq!(estimated, (given.gain.is_some(), given.offset.is_some()));
        }
    }

    #[test]
    fn any_text_is_read_or_refused(text in "(armcal1 )?[ -~]{0,200}") {
        let _ = CompactCalibration::from_text(&text);
    }
}
