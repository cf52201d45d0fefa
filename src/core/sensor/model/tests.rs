use super::*;
use crate::robot::SensorKind;
use proptest::prelude::*;

fn spec() -> JointSensorSpec {
    JointSensorSpec {
        joint: "j".into(),
        moves: Default::default(),
        kind: SensorKind::Potentiometer,
        offset_counts: 65322.0,
        counts_per_rad: 46.0 * 180.0 / std::f64::consts::PI,
        wrap_counts: 65536.0,
        center_rad: -1.5352,
        half_range_rad: 2.0944,
        gain_std: 0.03,
        offset_std_rad: 0.05,
        gain_bound: 0.05,
        offset_bound_rad: 0.0873,
        noise_std_counts: 2.0,
        linearity_std_rad: 0.002,
        temperature_std_rad_per_k: 0.0,
        drift_std_rad_per_sqrt_h: 0.0,
        max_rate_rad_s: 0.5,
        stated: None,
    }
}

proptest! {
    #[test]
    fn counts_and_angles_round_trip_over_the_full_range(
        angle in -3.7f64..0.6, gain in 0.9f64..1.1, offset_rad in -0.1f64..0.1
    ) {
        let model = SensorModel { spec: spec(), correction: Correction { gain, offset_rad, ..Correction::default() } };
        let counts = model.counts(angle);
        prop_assert!((0.0..65536.0).contains(&counts));
        prop_assert!((model.angle_rad(counts) - angle).abs() < 1e-9);
    }
}

fn any_terms() -> impl Strategy<Value = Terms> {
    let shape = proptest::collection::vec(-1.0f64..1.0, N_SHAPE);
    (shape, -5e-4f64..5e-4, -1e-4f64..1e-4, -1e-4f64..1e-4, -1e-3f64..1e-3).prop_map(
        |(shape, offset_rad_per_k, gain_per_k, offset_rad_per_mpa, drift_rad_per_h)| Terms {
            // The slow terms reach about 0.7 % of the range.
            nonlinearity_rad: std::array::from_fn(|h| 0.02 * shape[h] / (1 + h * h) as f64),
            offset_rad_per_k,
            gain_per_k,
            offset_rad_per_mpa,
            drift_rad_per_h,
            half_backlash_rad: 0.0,
            // A worn spot with a slope of at most a tenth.
            bump: Bump { at_rad: 0.4 * shape[0], width_rad: 0.05, height_rad: 0.005 * shape[1] },
        },
    )
}

proptest! {
    #[test]
    fn counts_and_angles_round_trip_with_terms_under_any_conditions(
        share in -1.0f64..1.0, gain in 0.95f64..1.05, offset_rad in -0.1f64..0.1, terms in any_terms(),
        oil_k in -30.0f64..30.0, pressure_mpa in -10.0f64..30.0, elapsed_h in -5.0f64..5.0,
    ) {
        let model = SensorModel { spec: spec(), correction: Correction { gain, offset_rad, terms } };
        let departure = ConditionChange { oil_k, pressure_mpa, elapsed_h };
        let angle = model.spec.center_rad + share * model.spec.half_range_rad;
        let counts = model.counts_under(angle, &departure);
        prop_assert!((model.angle_under_rad(counts, &departure) - angle).abs() < 1e-9);
        let (low, high) = model.slope_over_gain();
        prop_assert!(low > 0.6 && high < 1.4 && low <= 1.0 && high >= 1.0, "{low} {high}");
    }

    /// Without terms the arithmetic is as before the terms were added, under all conditions.
    #[test]
    fn a_straight_sensor_does_not_feel_the_conditions(
        counts in 0.0f64..65536.0, gain in 0.95f64..1.05, offset_rad in -0.1f64..0.1, oil_k in -30.0f64..30.0
    ) {
        let model = SensorModel { spec: spec(), correction: Correction { gain, offset_rad, ..Correction::default() } };
        let departure = ConditionChange { oil_k, pressure_mpa: 3.0, elapsed_h: 1.0 };
        let angle = model.angle_under_rad(counts, &departure);
        let travel = model.nominal_travel_rad(counts);
        prop_assert_eq!(angle.to_bits(), (spec().center_rad + gain * travel + offset_rad).to_bits());
        let back = ((angle - spec().center_rad - offset_rad) / gain + spec().center_rad) * spec().counts_per_rad;
        prop_assert_eq!(
            model.counts_under(angle, &departure).to_bits(),
            model.counts(angle).to_bits(), "{}", back
        );
    }
}

#[test]
fn each_term_moves_the_angle_by_what_its_name_says() {
    let departure = ConditionChange { oil_k: 10.0, pressure_mpa: 2.0, elapsed_h: 0.5 };
    let moved = |terms: Terms, approach: f64| {
        let with = Correction { terms, ..Correction::default() };
        let at = |correction: &Correction| correction.angle_rad(&spec(), 0.7, &departure, approach);
        at(&with) - at(&Correction::default())
    };
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    near(moved(Terms { offset_rad_per_k: 1e-3, ..Terms::default() }, 1.0), 1e-2);
    near(moved(Terms { gain_per_k: 1e-4, ..Terms::default() }, 1.0), 7e-4);
    near(moved(Terms { offset_rad_per_mpa: 1e-3, ..Terms::default() }, 1.0), 2e-3);
    near(moved(Terms { drift_rad_per_h: 1e-3, ..Terms::default() }, 1.0), 5e-4);
    near(moved(Terms { half_backlash_rad: 1e-3, ..Terms::default() }, -1.0), -1e-3);
    near(moved(Terms { half_backlash_rad: 1e-3, ..Terms::default() }, 0.0), 0.0);
    for h in 0..N_SHAPE {
        let mut terms = Terms::default();
        terms.nonlinearity_rad[h] = 1e-3;
        // phi_h(x) = sin(pi h (x + L) / 2 L) / sqrt(L), L = 1.25, h from 1.
        let turn = std::f64::consts::PI * (h + 1) as f64 * (0.7 / spec().half_range_rad + 1.25) / 2.5;
        near(moved(terms, 0.0), 1e-3 * turn.sin() / 1.25_f64.sqrt());
    }
}

/// With the standard deviations of `shape_prior` the functions are a process of unit variance and its covariance.
#[test]
fn the_shape_prior_is_a_squared_exponential_process() {
    for length in [0.25, 0.35] {
        let std = shape_prior(length);
        // Not at the very ends: the functions vanish a quarter of a half range beyond.
        for (x, y) in [(0.0, 0.0), (-0.6, -0.6), (0.3, -0.2), (0.6, 0.4)] {
            let terms = nonlinearity_basis(x).into_iter().zip(nonlinearity_basis(y)).zip(std);
            let found: f64 = terms.map(|((a, b), s)| a * b * s * s).sum();
            let expected = (-0.5 * ((x - y) / length).powi(2)).exp();
            assert!((found - expected).abs() < 0.06, "{length} {x} {y}: {found} {expected}");
        }
    }
}

/// A word of radians keeps its sign; one of a few turns lies in 0..wrap.
#[test]
fn readings_that_never_repeat_are_not_wrapped() {
    let centered = JointSensorSpec { offset_counts: 0.0, center_rad: 0.0, ..spec() };
    let radians = JointSensorSpec { counts_per_rad: 1.0, wrap_counts: 1e6, ..centered.clone() };
    let model = SensorModel::nominal(&radians);
    assert!((model.counts(-0.781) + 0.781).abs() < 1e-12, "{}", model.counts(-0.781));
    assert!((model.angle_rad(model.counts(-0.781)) + 0.781).abs() < 1e-9);
    let word = SensorModel::nominal(&centered);
    assert!((word.counts(-0.781) - (65536.0 - 0.781 * centered.counts_per_rad)).abs() < 1e-6);
}

#[test]
fn the_nominal_model_is_the_datasheet_formula() {
    let model = SensorModel::nominal(&spec());
    // theta_deg = (raw - offset) / scale, with the raw word wrapped: -20 deg.
    let raw = 65322.0 - 46.0 * 20.0;
    assert!((model.angle_rad(raw).to_degrees() + 20.0).abs() < 1e-9);
    // +20 deg has wrapped past 65536.
    let raw = 65322.0 + 46.0 * 20.0 - 65536.0;
    assert!((model.angle_rad(raw).to_degrees() - 20.0).abs() < 1e-9);
}
