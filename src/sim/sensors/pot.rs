//! A joint sensor: true angle to raw counts.
//!
//! `reading = center + (1 + g + cg (T - T0)) (shaft - center) + nl(shaft) + o + co (T - T0) + drift`, where the shaft
//! lags the joint by the play between them and T is the oil's temperature. The datasheet's scale then makes counts of
//! the reading, noise and rounding follow, and the word wraps.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::robot::JointSensorSpec;
use crate::sim::as_built::JointAsBuilt;
use crate::sim::spec::JointSensorsSpec;
use crate::stats::stream_rng;

/// One joint sensor as built.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Pot {
    nominal: JointSensorSpec,
    built: JointAsBuilt,
    spec: JointSensorsSpec,
    shaft_rad: f64,
    drift_rad: f64,
    /// What a slip on the shaft added.
    jump_rad: f64,
    /// The word of a sensor that is stuck.
    stuck_counts: Option<f64>,
    /// The last word.
    counts: f64,
    noise: ChaCha8Rng,
    walk: ChaCha8Rng,
}

/// What a sample depends on besides the sensor itself.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct PotInput {
    pub angle_rad: f64,
    pub oil_c: f64,
    /// Since the last sample, s.
    pub elapsed_s: f64,
}

impl Pot {
    pub(in crate::sim) fn new(
        nominal: &JointSensorSpec,
        built: &JointAsBuilt,
        spec: &JointSensorsSpec,
        seed: u64,
    ) -> Self {
        Self {
            nominal: nominal.clone(),
            built: built.clone(),
            spec: *spec,
            shaft_rad: built.center_rad,
            drift_rad: 0.0,
            jump_rad: 0.0,
            stuck_counts: None,
            counts: 0.0,
            noise: stream_rng(seed, &format!("pot/noise/{}", nominal.joint)),
            walk: stream_rng(seed, &format!("pot/drift/{}", nominal.joint)),
        }
    }

    /// Centres the play at `angle_rad`.
    pub(in crate::sim) fn settle(&mut self, angle_rad: f64) {
        self.shaft_rad = angle_rad;
    }

    /// The reading without noise and rounding at a shaft angle, rad.
    pub(in crate::sim) fn reading_rad(&self, shaft_rad: f64, oil_c: f64) -> f64 {
        let built = &self.built;
        let warm_k = oil_c - self.spec.reference_c;
        let gain = 1.0 + built.gain_error + built.temperature_gain_per_k * warm_k;
        built.center_rad
            + gain * (shaft_rad - built.center_rad)
            + built.nonlinearity_rad(shaft_rad)
            + built.offset_error_rad
            + built.temperature_offset_rad_per_k * warm_k
            + self.drift_rad
            + self.jump_rad
    }

    /// It slips: reads `by_rad` more from now on.
    pub(in crate::sim) fn jump(&mut self, by_rad: f64) {
        self.jump_rad += by_rad;
    }

    /// It keeps its last word from now on.
    pub(in crate::sim) fn stick(&mut self) {
        self.stuck_counts = Some(self.counts);
    }

    /// The shaft angle at which it reads `reading_rad`: fixed-point iteration, for the nonlinearity is slight.
    pub(in crate::sim) fn angle_for_reading(&self, reading_rad: f64, oil_c: f64) -> f64 {
        let mut angle = reading_rad;
        for _ in 0..200 {
            angle += (reading_rad - self.reading_rad(angle, oil_c)) / (1.0 + self.built.gain_error);
        }
        angle
    }

    /// Takes a sample, raw counts 0..wrap.
    pub(in crate::sim) fn sample(&mut self, input: &PotInput) -> f64 {
        let half_play = 0.5 * self.spec.backlash_rad;
        self.shaft_rad = self.shaft_rad.clamp(input.angle_rad - half_play, input.angle_rad + half_play);
        let step: f64 = StandardNormal.sample(&mut self.walk);
        self.drift_rad += self.spec.drift_rad_per_sqrt_h * (input.elapsed_s / 3600.0).sqrt() * step;
        let noise: f64 = StandardNormal.sample(&mut self.noise);
        // Gears between shaft and sensor turn about the middle of the range, where both agree.
        let center_rad = self.built.center_rad;
        let travel_rad = self.built.gear_ratio * (self.reading_rad(self.shaft_rad, input.oil_c) - center_rad);
        let exact = self.nominal.offset_counts + self.nominal.counts_per_rad * (center_rad + travel_rad);
        let noisy = exact + self.spec.noise_rms_counts * noise;
        let resolution = self.spec.resolution_counts;
        let rounded = if resolution > 0.0 { (noisy / resolution).round() * resolution } else { noisy };
        self.counts = self.stuck_counts.unwrap_or(rounded.rem_euclid(self.nominal.wrap_counts));
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::SensorKind;
    use crate::sim::as_built::Harmonic;

    const COUNTS_PER_RAD: f64 = 46.0 * 180.0 / std::f64::consts::PI;
    /// Rounding of sums of figures about 1e5.
    const TOLERANCE_COUNTS: f64 = 1e-8;

    fn silent() -> JointSensorsSpec {
        JointSensorsSpec {
            drift_rad_per_sqrt_h: 0.0,
            backlash_rad: 0.0,
            noise_rms_counts: 0.0,
            resolution_counts: 0.0,
            ..JointSensorsSpec::default()
        }
    }

    fn perfect() -> JointAsBuilt {
        JointAsBuilt {
            name: "j".into(),
            center_rad: -1.5,
            range_rad: 4.0,
            gain_error: 0.0,
            offset_error_rad: 0.0,
            temperature_offset_rad_per_k: 0.0,
            temperature_gain_per_k: 0.0,
            gear_ratio: 1.0,
            harmonics: Vec::new(),
        }
    }

    fn pot(built: &JointAsBuilt, spec: &JointSensorsSpec) -> Pot {
        let nominal = JointSensorSpec {
            joint: "j".into(),
            kind: SensorKind::Potentiometer,
            offset_counts: 65322.0,
            counts_per_rad: COUNTS_PER_RAD,
            wrap_counts: 65536.0,
            center_rad: built.center_rad,
            gain_std: 0.0,
            offset_std_rad: 0.0,
            gain_bound: 0.0,
            offset_bound_rad: 0.0,
            noise_std_counts: 0.0,
            linearity_std_rad: 0.0,
            temperature_std_rad_per_k: 0.0,
            drift_std_rad_per_sqrt_h: 0.0,
            max_rate_rad_s: 1.0,
        };
        Pot::new(&nominal, built, spec, 1)
    }

    fn at(angle_rad: f64, oil_c: f64) -> PotInput {
        PotInput { angle_rad, oil_c, elapsed_s: 0.01 }
    }

    fn assert_reads(built: &JointAsBuilt, input: PotInput, reading_rad: f64) {
        let counts = pot(built, &silent()).sample(&input);
        let expected = (65322.0 + COUNTS_PER_RAD * reading_rad).rem_euclid(65536.0);
        assert!((counts - expected).abs() < TOLERANCE_COUNTS, "{counts} against {expected}");
    }

    #[test]
    fn a_perfect_sensor_reads_the_datasheet() {
        assert_reads(&perfect(), at(-0.7, 10.0), -0.7);
    }

    #[test]
    fn gain_acts_about_the_middle_of_the_range() {
        let built = JointAsBuilt { gain_error: 0.05, ..perfect() };
        assert_reads(&built, at(-1.5, 10.0), -1.5);
        assert_reads(&built, at(0.5, 10.0), 0.5 + 0.05 * 2.0);
    }

    #[test]
    fn gears_multiply_the_travel_about_the_middle_and_may_reverse_it() {
        let built = JointAsBuilt { gear_ratio: -2.0, offset_error_rad: 0.1, ..perfect() };
        assert_reads(&built, at(-1.5, 10.0), -1.5 - 2.0 * 0.1);
        assert_reads(&built, at(-1.2, 10.0), -1.5 - 2.0 * 0.4);
    }

    #[test]
    fn a_slip_adds_and_a_stuck_sensor_keeps_its_word() {
        let mut pot = pot(&perfect(), &silent());
        let before = pot.sample(&at(-1.0, 10.0));
        pot.jump(0.05);
        let after = pot.sample(&at(-1.0, 10.0));
        assert!((after - before - 0.05 * COUNTS_PER_RAD).abs() < TOLERANCE_COUNTS);
        pot.stick();
        assert_eq!(pot.sample(&at(0.3, 10.0)), after);
    }

    #[test]
    fn offset_adds() {
        assert_reads(&JointAsBuilt { offset_error_rad: 0.08, ..perfect() }, at(0.2, 10.0), 0.28);
    }

    #[test]
    fn temperature_adds_an_offset_and_a_gain_from_the_reference_on() {
        let built = JointAsBuilt { temperature_offset_rad_per_k: 3e-4, temperature_gain_per_k: 1e-4, ..perfect() };
        assert_reads(&built, at(0.5, 10.0), 0.5);
        assert_reads(&built, at(0.5, 17.0), 0.5 + 7.0 * 3e-4 + 7.0 * 1e-4 * 2.0);
    }

    #[test]
    fn harmonics_add_their_sines() {
        let harmonic = Harmonic { order: 2.0, amplitude_rad: 0.004, phase_rad: 0.3 };
        let built = JointAsBuilt { harmonics: vec![harmonic], ..perfect() };
        let expected = -0.9 + 0.004 * (2.0 * std::f64::consts::TAU * 0.6 / 4.0 + 0.3_f64).sin();
        assert_reads(&built, at(-0.9, 10.0), expected);
    }

    #[test]
    fn play_makes_the_two_directions_differ_by_its_width() {
        let spec = JointSensorsSpec { backlash_rad: 0.01, ..silent() };
        let mut pot = pot(&perfect(), &spec);
        pot.settle(-2.0);
        pot.sample(&at(-2.0, 10.0));
        let up = (0..=100).map(|i| pot.sample(&at(-2.0 + 0.01 * f64::from(i), 10.0))).next_back().expect("samples");
        pot.sample(&at(-0.9, 10.0));
        let down = pot.sample(&at(-1.0, 10.0));
        assert!((down - up - 0.01 * COUNTS_PER_RAD).abs() < TOLERANCE_COUNTS, "{up} {down}");
    }

    #[test]
    fn drift_walks_with_the_root_of_time() {
        let spec = JointSensorsSpec { drift_rad_per_sqrt_h: 1e-3, ..silent() };
        let mut pot = pot(&perfect(), &spec);
        let mut squares = 0.0;
        let runs = 4000;
        for _ in 0..runs {
            let before = pot.drift_rad;
            for _ in 0..9 {
                pot.sample(&PotInput { elapsed_s: 100.0, ..at(0.0, 10.0) });
            }
            squares += (pot.drift_rad - before).powi(2);
        }
        // 900 s: half of the hourly figure. 4000 runs know a standard deviation to 1.1 %.
        let std = (squares / f64::from(runs)).sqrt();
        assert!((std / 5e-4 - 1.0).abs() < 0.04, "{std}");
    }

    #[test]
    fn noise_has_its_rms_and_readings_are_whole_counts() {
        let spec = JointSensorsSpec { noise_rms_counts: 1.5, resolution_counts: 1.0, ..silent() };
        let mut pot = pot(&perfect(), &spec);
        let samples: Vec<f64> = (0..20_000).map(|_| pot.sample(&at(-1.5, 10.0))).collect();
        assert!(samples.iter().all(|c| c.fract() == 0.0));
        let mean = samples.iter().sum::<f64>() / 20_000.0;
        let variance = samples.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / 20_000.0;
        // Rounding adds 1/12 count^2; 20,000 samples know the variance to 1 %.
        assert!((variance / (1.5 * 1.5 + 1.0 / 12.0) - 1.0).abs() < 0.04, "{variance}");
    }

    #[test]
    fn the_word_wraps() {
        let mut pot = pot(&perfect(), &silent());
        // 214 counts below 65536 at angle zero: 5 deg on.
        let counts = pot.sample(&at(5.0_f64.to_radians(), 10.0));
        assert!((counts - (65322.0 + 230.0 - 65536.0)).abs() < TOLERANCE_COUNTS, "{counts}");
    }

    #[test]
    fn the_angle_for_a_reading_is_the_inverse() {
        let harmonic = Harmonic { order: 3.0, amplitude_rad: 0.004, phase_rad: 0.3 };
        let built = JointAsBuilt { harmonics: vec![harmonic], gain_error: -0.05, offset_error_rad: 0.08, ..perfect() };
        let pot = pot(&built, &silent());
        let angle = pot.angle_for_reading(-0.4, 12.0);
        assert!((pot.reading_rad(angle, 12.0) + 0.4).abs() < 1e-12);
    }
}
