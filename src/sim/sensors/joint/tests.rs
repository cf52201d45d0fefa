//! Each effect alone compared with its closed form.

use std::num::NonZeroU8;

use crate::as_built::{Harmonic, JointAsBuilt, ResolverAsBuilt, WornSpot};
use crate::sensors::OilState;
use crate::sensors::joint::*;
use crate::spec::JointSensorsSpec;
use armcal_core::robot::{JointSensorSpec, SensorKind};

pub(super) const COUNTS_PER_RAD: f64 = 46.0 * 180.0 / std::f64::consts::PI;
const OFFSET_COUNTS: f64 = 65322.0;
const WRAP_COUNTS: f64 = 65536.0;
/// Rounding of sums of numbers about 1e5, counts.
const TOLERANCE_COUNTS: f64 = 1e-8;
const MPA: f64 = 1e6;

pub(super) fn silent() -> JointSensorsSpec {
    JointSensorsSpec {
        drift_rad_per_sqrt_h: 0.0,
        backlash_rad: 0.0,
        noise_rms_counts: 0.0,
        resolution_counts: 0.0,
        ..JointSensorsSpec::default()
    }
}

pub(super) fn perfect() -> JointAsBuilt {
    JointAsBuilt {
        name: "j".into(),
        center_rad: -1.5,
        range_rad: 4.0,
        gain_error: 0.0,
        offset_error_rad: 0.0,
        temperature_offset_rad_per_k: 0.0,
        temperature_gain_per_k: 0.0,
        gear_ratio: 1.0,
        pressure_offset_rad_per_mpa: 0.0,
        pressure_gain_per_mpa: 0.0,
        harmonics: Vec::new(),
        worn_spot: None,
        eccentricity: None,
        resolver: None,
    }
}

fn sensor_of(kind: SensorKind, built: &JointAsBuilt, spec: &JointSensorsSpec, seed: u64) -> JointSensor {
    let nominal = JointSensorSpec {
        kind,
        offset_counts: OFFSET_COUNTS,
        wrap_counts: WRAP_COUNTS,
        center_rad: built.center_rad,
        ..crate::fixture::exact_sensor(COUNTS_PER_RAD, 1.0)
    };
    JointSensor::new(&nominal, built, spec, seed)
}

/// Returns a potentiometer.
pub(super) fn pot(built: &JointAsBuilt, spec: &JointSensorsSpec, seed: u64) -> JointSensor {
    sensor_of(SensorKind::Potentiometer, built, spec, seed)
}

/// Returns the input of an angle at the reference temperature and the surface.
pub(super) fn at(angle_rad: f64) -> JointInput {
    within(angle_rad, 10.0, 0.0)
}

fn within(angle_rad: f64, oil_c: f64, pressure_pa: f64) -> JointInput {
    JointInput { angle_rad, around: OilState { oil_c, pressure_pa }, elapsed_s: 0.01 }
}

fn word_of(reading_rad: f64) -> f64 {
    (OFFSET_COUNTS + COUNTS_PER_RAD * reading_rad).rem_euclid(WRAP_COUNTS)
}

/// Returns the reading for counts, rad; for angles within a quarter of the word about -1.5.
pub(super) fn reading_of(counts: f64) -> f64 {
    (counts - OFFSET_COUNTS) / COUNTS_PER_RAD
}

fn assert_word(what: &str, counts: f64, reading_rad: f64) {
    let expected = word_of(reading_rad);
    assert!((counts - expected).abs() < TOLERANCE_COUNTS, "{what}: {counts} against {expected}");
}

#[test]
fn each_static_effect_of_a_potentiometer_is_its_closed_form() {
    let harmonic = Harmonic { order: 2.0, amplitude_rad: 0.004, phase_rad: 0.3 };
    let spot = WornSpot { center_rad: -1.0, peak_rad: -0.02, width_rad: 0.05 };
    let gain = JointAsBuilt { gain_error: 0.05, ..perfect() };
    let offset = JointAsBuilt { offset_error_rad: 0.08, ..perfect() };
    let warm = JointAsBuilt { temperature_offset_rad_per_k: 3e-4, temperature_gain_per_k: 1e-4, ..perfect() };
    let deep = JointAsBuilt { pressure_offset_rad_per_mpa: 2e-4, pressure_gain_per_mpa: -5e-5, ..perfect() };
    let geared = JointAsBuilt { gear_ratio: -2.0, offset_error_rad: 0.1, ..perfect() };
    let bent = JointAsBuilt { harmonics: vec![harmonic], ..perfect() };
    let worn = JointAsBuilt { worn_spot: Some(spot), ..perfect() };
    let cases = [
        ("perfect", &perfect(), at(-0.7), -0.7),
        ("gain, in the middle of the range", &gain, at(-1.5), -1.5),
        ("gain, 2 rad from it", &gain, at(0.5), 0.5 + 0.05 * 2.0),
        ("offset", &offset, at(0.2), 0.28),
        ("temperature, at the reference", &warm, within(0.5, 10.0, 0.0), 0.5),
        ("temperature, 7 K above", &warm, within(0.5, 17.0, 0.0), 0.5 + 7.0 * 3e-4 + 7.0 * 1e-4 * 2.0),
        ("temperature, 12 K below", &warm, within(0.5, -2.0, 0.0), 0.5 - 12.0 * 3e-4 - 12.0 * 1e-4 * 2.0),
        ("pressure, at the surface", &deep, within(0.5, 10.0, 0.0), 0.5),
        ("pressure, 40 MPa", &deep, within(0.5, 10.0, 40.0 * MPA), 0.5 + 40.0 * 2e-4 - 40.0 * 5e-5 * 2.0),
        ("gears, in the middle", &geared, at(-1.5), -1.5 - 2.0 * 0.1),
        ("gears, aside", &geared, at(-1.2), -1.5 - 2.0 * 0.4),
        ("harmonic", &bent, at(-0.9), -0.9 + 0.004 * (2.0 * std::f64::consts::TAU * 0.6 / 4.0 + 0.3_f64).sin()),
        ("worn spot, its middle", &worn, at(-1.0), -1.0 - 0.02),
        ("worn spot, a width aside", &worn, at(-0.95), -0.95 - 0.02 * (-0.5_f64).exp()),
        ("worn spot, three widths aside", &worn, at(-1.15), -1.15 - 0.02 * (-4.5_f64).exp()),
    ];
    for (what, built, input, reading_rad) in cases {
        let mut sensor = pot(built, &silent(), 1);
        assert_word(what, sensor.sample(&input), reading_rad);
    }
}

/// Faults during a run: a spot wears, the sense is reversed about the middle of the joint's range, and the wiper loses
/// and finds contact.
#[test]
fn a_spot_wears_the_sense_turns_and_contact_is_lost_from_one_moment_on() {
    let mut sensor = pot(&perfect(), &silent(), 1);
    assert_word("new", sensor.sample(&at(-1.0)), -1.0);
    sensor.wear(WornSpot { center_rad: -1.05, peak_rad: 0.02, width_rad: 0.05 });
    assert_word("worn", sensor.sample(&at(-1.0)), -1.0 + 0.02 * (-0.5_f64).exp());
    assert_word("worn elsewhere", sensor.sample(&at(0.2)), 0.2);
    sensor.reverse();
    assert_word("reversed", sensor.sample(&at(0.2)), -3.2);
    sensor.reverse();
    assert_word("reversed twice", sensor.sample(&at(0.2)), 0.2);
    sensor.lose_contact(10.0);
    let open = (0..2000).filter(|_| sensor.sample(&at(0.2)) == 0.0).count();
    // Contact is lost for a third of the time: 0.1 s between drop-outs of 0.05 s.
    assert!((400..1000).contains(&open), "{open} of 2000");
}

/// Returns the error of a word, rad, across the wrap.
fn error_of(counts: f64, angle_rad: f64) -> f64 {
    let half = 0.5 * WRAP_COUNTS;
    ((counts - word_of(angle_rad) + half).rem_euclid(WRAP_COUNTS) - half) / COUNTS_PER_RAD
}

/// Error over angle, both in rad.
type ErrorByAngle<'a> = &'a dyn Fn(f64) -> f64;

#[test]
fn the_errors_over_the_range_are_their_closed_forms() {
    let harmonics = [(1.0, 0.004, 0.3), (3.0, -0.002, 1.0)].map(|(order, amplitude_rad, phase_rad)| Harmonic {
        order,
        amplitude_rad,
        phase_rad,
    });
    let spot = WornSpot { center_rad: -1.0, peak_rad: -0.02, width_rad: 0.05 };
    let gain = JointAsBuilt { gain_error: 0.01, ..perfect() };
    let warm = JointAsBuilt { temperature_offset_rad_per_k: 3e-4, temperature_gain_per_k: 1e-4, ..perfect() };
    let bent = JointAsBuilt { harmonics: harmonics.to_vec(), ..perfect() };
    let worn = JointAsBuilt { worn_spot: Some(spot), ..perfect() };
    let smooth = |x: f64| {
        let turn = std::f64::consts::TAU * (x + 1.5) / 4.0;
        0.004 * (turn + 0.3).sin() - 0.002 * (3.0 * turn + 1.0).sin()
    };
    let bump = |x: f64| -0.02 * (-0.5 * ((x + 1.0) / 0.05).powi(2)).exp();
    let cases: [(&str, &JointAsBuilt, f64, ErrorByAngle); 4] = [
        ("gain", &gain, 10.0, &|x| 0.01 * (x + 1.5)),
        ("temperature", &warm, 17.0, &|x| 7.0 * (3e-4 + 1e-4 * (x + 1.5))),
        ("nonlinearity", &bent, 10.0, &smooth),
        ("worn-spot", &worn, 10.0, &bump),
    ];
    for (what, built, oil_c, exact) in cases {
        for i in 0..=160 {
            let angle = -3.5 + 0.025 * f64::from(i);
            let error = error_of(pot(built, &silent(), 1).sample(&within(angle, oil_c, 0.0)), angle);
            eprintln!("plot pot/{what} {angle:.4} {error:e} {:e}", exact(angle));
            assert!((error - exact(angle)).abs() < 1e-9, "{what} at {angle}: {error} {}", exact(angle));
        }
    }
}

/// From rest, the contact lags by its share of the way, up to half the width. After each turn it lags by as much in the
/// other direction.
#[test]
fn the_loops_of_play_and_hysteresis_are_their_closed_forms() {
    let (width, step) = (0.01_f64, 0.0005);
    let play = JointSensorsSpec { backlash_rad: width, ..silent() };
    let dragged = JointSensorsSpec { hysteresis_rad: width, hysteresis_share: 0.5, ..silent() };
    for (what, spec, share) in [("play", play, 1.0), ("hysteresis", dragged, 0.5)] {
        let mut sensor = pot(&perfect(), &spec, 1);
        sensor.settle(-2.0);
        let mut lag = 0.0_f64;
        for i in 0..180 {
            let direction = if (i / 60) % 2 == 0 { 1.0 } else { -1.0 };
            let up = if direction > 0.0 { i % 60 + 1 } else { 59 - i % 60 };
            let angle = -2.0 + step * f64::from(up);
            let error = error_of(sensor.sample(&at(angle)), angle);
            lag = (lag - direction * share * step).clamp(-0.5 * width, 0.5 * width);
            eprintln!("plot pot/{what} {angle:.4} {error:e} {lag:e}");
            assert!((error - lag).abs() < 1e-9, "{what} at {angle}: {error} {lag}");
        }
    }
}

#[test]
fn a_slip_adds_a_stuck_sensor_keeps_its_word_and_a_dead_one_reads_an_open_input() {
    let mut sensor = pot(&perfect(), &silent(), 1);
    let before = sensor.sample(&at(-1.0));
    sensor.jump(0.05);
    let after = sensor.sample(&at(-1.0));
    assert!((after - before - 0.05 * COUNTS_PER_RAD).abs() < TOLERANCE_COUNTS);
    sensor.stick();
    assert_eq!(sensor.sample(&at(0.3)), after);
    sensor.die();
    assert_eq!(sensor.sample(&at(0.3)), 0.0);
    sensor.stick();
    assert_eq!(sensor.sample(&at(-0.4)), 0.0, "nothing left that could stick");
}

/// Noise about zero is limited at 0: half of the words are 0, and the mean of the others is that of half a normal
/// distribution.
#[test]
fn a_dead_sensor_shows_the_converters_noise() {
    let mut sensor = pot(&perfect(), &JointSensorsSpec { noise_rms_counts: 1.5, ..silent() }, 1);
    sensor.die();
    let n = 20_000;
    let words: Vec<f64> = (0..n).map(|_| sensor.sample(&at(0.3))).collect();
    let mean = words.iter().sum::<f64>() / f64::from(n);
    let expected = 1.5 / std::f64::consts::TAU.sqrt();
    // The standard deviation of the rectified normal distribution is 0.58 of the whole one's.
    let tolerance = 4.0 * 0.58 * 1.5 / f64::from(n).sqrt();
    assert!((mean - expected).abs() < tolerance, "{mean} against {expected}");
    assert!(words.iter().all(|word| (0.0..10.0).contains(word)));
}

/// Returns reading minus angle on the way up, on the way down, and `turned_rad` after the turn at the top.
fn sweep(spec: &JointSensorsSpec, turned_rad: f64) -> [f64; 3] {
    let mut sensor = pot(&perfect(), spec, 1);
    sensor.settle(-2.0);
    let error = |sensor: &mut JointSensor, angle_rad: f64| reading_of(sensor.sample(&at(angle_rad))) - angle_rad;
    let (mut up, mut turned) = (f64::NAN, f64::NAN);
    for i in 0..=100 {
        let angle_rad = -2.0 + 0.01 * f64::from(i);
        up = error(&mut sensor, angle_rad);
    }
    turned = if turned_rad > 0.0 { error(&mut sensor, -1.0 - turned_rad) } else { turned };
    error(&mut sensor, -1.5);
    [up, error(&mut sensor, -1.6), turned]
}

/// Both lag by half their width on either side. Just after a turn, the shaft has not moved at all under backlash, while
/// the wiper has moved by 1 - share of the turn.
#[test]
fn play_and_hysteresis_differ_by_their_width_between_the_directions() {
    let tolerance_rad = TOLERANCE_COUNTS / COUNTS_PER_RAD;
    let play = JointSensorsSpec { backlash_rad: 0.01, ..silent() };
    let [up, down, turned] = sweep(&play, 0.004);
    for (got, expected) in [(up, -0.005), (down, 0.005), (turned, -0.005 + 0.004)] {
        assert!((got - expected).abs() < tolerance_rad, "play: {got} against {expected}");
    }
    for share in [0.3, 0.5, 1.0] {
        let dragged = JointSensorsSpec { hysteresis_rad: 0.01, hysteresis_share: share, ..silent() };
        let [up, down, turned] = sweep(&dragged, 0.004);
        for (got, expected) in [(up, -0.005), (down, 0.005), (turned, -0.005 + share * 0.004)] {
            assert!((got - expected).abs() < tolerance_rad, "hysteresis, share {share}: {got} against {expected}");
        }
    }
}

/// Hysteresis depends on the path, not on its speed: the turning points are the same with 100 times as many samples.
#[test]
fn hysteresis_does_not_depend_on_the_rate() {
    let spec = JointSensorsSpec { hysteresis_rad: 0.01, ..silent() };
    let run = |steps: u32| {
        let mut sensor = pot(&perfect(), &spec, 1);
        sensor.settle(-2.0);
        let mut words = Vec::new();
        for [from, to] in [[-2.0, -1.0], [-1.0, -1.013], [-1.013, -1.004], [-1.004, -1.7]] {
            for i in 1..=steps {
                words.push(sensor.sample(&at(from + (to - from) * f64::from(i) / f64::from(steps))));
            }
        }
        (1..=4).map(|leg| words[(leg * steps - 1) as usize]).collect::<Vec<_>>()
    };
    for (slow, fast) in run(500).iter().zip(run(5)) {
        assert!((slow - fast).abs() < TOLERANCE_COUNTS, "{slow} {fast}");
    }
}

/// Each word is the multiple of the step nearest to the exact value, over three steps and across the wrap.
#[test]
fn the_converter_rounds_to_its_step_and_the_word_wraps() {
    for step_counts in [1.0, 16.0] {
        let spec = JointSensorsSpec { resolution_counts: step_counts, ..silent() };
        let mut sensor = pot(&perfect(), &spec, 1);
        for i in 0..=300 {
            // From 150 counts below the wrap to 150 above it.
            let exact = 65386.0 + f64::from(i) + 0.25;
            let counts = sensor.sample(&at(reading_of(exact)));
            let expected = ((exact / step_counts + 0.5).floor() * step_counts) % WRAP_COUNTS;
            assert_eq!(counts, expected, "{exact}, step {step_counts}");
            assert!((0.0..WRAP_COUNTS).contains(&counts));
        }
    }
    // 214 counts below 65536 at angle zero: 5 deg on.
    let counts = pot(&perfect(), &silent(), 1).sample(&at(5.0_f64.to_radians()));
    assert!((counts - (65322.0 + 230.0 - 65536.0)).abs() < TOLERANCE_COUNTS, "{counts}");
}

/// A count of a radian means that the driver reports angles.
#[test]
fn readings_that_are_angles_are_not_rounded_to_whole_counts() {
    let spec = JointSensorsSpec { resolution_counts: 1.0, ..silent() };
    for (counts_per_rad, rounded) in
        [(1.0, false), (1.0_f64.to_degrees(), false), (1024.0 / std::f64::consts::TAU, true)]
    {
        let nominal = crate::fixture::exact_sensor(counts_per_rad, 1.0);
        let mut sensor = JointSensor::new(&nominal, &perfect(), &spec, 1);
        let counts = sensor.sample(&at(0.3));
        assert_eq!(counts.fract() == 0.0, rounded, "{counts_per_rad} counts per rad: {counts}");
    }
}

#[test]
fn an_encoder_has_eccentricity_and_steps_and_nothing_of_a_potentiometer() {
    let eccentricity = Some(Harmonic { order: 1.0, amplitude_rad: 0.003, phase_rad: 0.4 });
    let built = JointAsBuilt { offset_error_rad: 0.02, eccentricity, ..perfect() };
    let sample = |spec: &JointSensorsSpec, built: &JointAsBuilt, input: &JointInput| {
        sensor_of(SensorKind::Encoder, built, spec, 1).sample(input)
    };
    for angle in [-3.0, -1.5, 0.2] {
        let expected = angle + 0.02 + 0.003 * (angle + 0.4_f64).sin();
        assert_word("eccentric", sample(&silent(), &built, &at(angle)), expected);
        let loud = JointSensorsSpec {
            noise_rms_counts: 50.0,
            drift_rad_per_sqrt_h: 0.1,
            hysteresis_rad: 0.05,
            dropout_per_s: 100.0,
            ..silent()
        };
        let soaked = JointInput { elapsed_s: 1e4, ..within(angle, 60.0, 60.0 * MPA) };
        assert_word("warm and deep", sample(&loud, &built, &soaked), expected);
        let stepped = JointSensorsSpec { encoder_steps_per_turn: 4096.0, ..silent() };
        let step = std::f64::consts::TAU / 4096.0;
        assert_word("stepped", sample(&stepped, &built, &at(angle)), (expected / step).round() * step);
    }
    // The backlash of the shaft precedes every element.
    let play = JointSensorsSpec { backlash_rad: 0.01, ..silent() };
    assert_word("play", sample(&play, &perfect(), &at(0.0)), -0.005);
}

/// The error agrees with the first-order one, with windings so good that the second order is negligible.
#[test]
fn a_resolver_errs_twice_an_electrical_turn() {
    let pole_pairs = NonZeroU8::new(3).expect("not 0");
    for (imbalance, quadrature_rad) in [(1e-4, 0.0), (0.0, 2e-4), (1e-4, -2e-4)] {
        let resolver = ResolverAsBuilt {
            pole_pairs,
            phase_rad: 0.7,
            imbalance,
            quadrature_rad,
            temperature_offset_rad_per_k: 1e-5,
        };
        let built = JointAsBuilt { offset_error_rad: 0.02, resolver: Some(resolver), ..perfect() };
        for i in 0..50 {
            let angle = -3.9 + 0.08 * f64::from(i);
            let mut sensor = sensor_of(SensorKind::Resolver, &built, &silent(), 1);
            let error = reading_of(sensor.sample(&within(angle, 20.0, MPA))) - angle - 0.02 - 1e-4;
            let twice = 2.0 * (3.0 * angle + 0.7);
            let expected = (imbalance * twice.sin() + quadrature_rad * (1.0 - twice.cos())) / 6.0;
            assert!((error - expected).abs() < 2.0 * 2e-4 * 2e-4, "{error} against {expected} at {angle}");
        }
    }
}

#[test]
fn the_angle_for_a_reading_is_the_inverse() {
    let harmonic = Harmonic { order: 3.0, amplitude_rad: 0.004, phase_rad: 0.3 };
    // Worn spot as steep as [world] allows: peak as high as wide.
    let spot = WornSpot { center_rad: -0.45, peak_rad: -0.05, width_rad: 0.05 };
    let bent = JointAsBuilt { harmonics: vec![harmonic], gain_error: -0.05, offset_error_rad: 0.08, ..perfect() };
    let worn = JointAsBuilt { worn_spot: Some(spot), ..bent.clone() };
    let around = OilState { oil_c: 12.0, pressure_pa: 5.0 * MPA };
    for built in [bent, worn] {
        let sensor = pot(&built, &silent(), 1);
        let angle = sensor.angle_for_reading(-0.4, &around);
        assert!((sensor.reading_rad(angle, &around) + 0.4).abs() < 1e-12);
    }
}
