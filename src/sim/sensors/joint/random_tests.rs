//! Random effects of a potentiometer: histogram, walks, drop-outs. Seeds are fixed; limits are about 4 sigma.

use crate::as_built::{JointAsBuilt, WornSpot};
use crate::sensors::joint::tests::{COUNTS_PER_RAD, at, perfect, pot, reading_of, silent};
use crate::sensors::joint::*;
use crate::spec::JointSensorsSpec;

/// Returns the normal distribution function: a series without cancellation, exact to rounding within 6 sigma.
fn normal_cdf(x: f64) -> f64 {
    let (mut term, mut sum) = (x, x);
    for k in 1..200 {
        term *= x * x / f64::from(2 * k + 1);
        sum += term;
    }
    0.5 + sum * (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()
}

/// Returns the mean of squares over the expected one.
fn variance_ratio(samples: &[f64], expected: f64) -> f64 {
    samples.iter().map(|x| x * x).sum::<f64>() / samples.len() as f64 / expected
}

/// The words' histogram agrees with the normal distribution cut at the converter's steps, by chi-square.
#[test]
fn the_histogram_of_the_noise_is_the_normal_ones() {
    const N: u32 = 100_000;
    const EXACT: f64 = 30_000.3;
    /// Number of words on either side of the middle; words beyond are pooled.
    const REACH: i32 = 5;
    let spec = JointSensorsSpec { noise_rms_counts: 1.5, resolution_counts: 1.0, ..silent() };
    for seed in 1..=5 {
        let mut sensor = pot(&perfect(), &spec, seed);
        let mut seen = [0_u32; (2 * REACH + 1) as usize];
        let mut squares = 0.0;
        for _ in 0..N {
            let counts = sensor.sample(&at(reading_of(EXACT)));
            assert_eq!(counts.fract(), 0.0);
            squares += (counts - EXACT).powi(2);
            seen[((counts - 30_000.0) as i32).clamp(-REACH, REACH).abs_diff(-REACH) as usize] += 1;
        }
        let mut chi2 = 0.0;
        for (bin, &n) in seen.iter().enumerate() {
            let word = f64::from(bin as i32 - REACH) - 0.3;
            let below = if bin == 0 { 0.0 } else { normal_cdf((word - 0.5) / 1.5) };
            let upto = if bin + 1 == seen.len() { 1.0 } else { normal_cdf((word + 0.5) / 1.5) };
            let expected = f64::from(N) * (upto - below);
            chi2 += (f64::from(n) - expected).powi(2) / expected;
            if seed == 1 {
                eprintln!("plot noise {} {n} {expected:e}", bin as i32 - REACH);
            }
        }
        let variance = squares / f64::from(N);
        eprintln!("seed {seed}: chi2 {chi2:.1} of 10 degrees of freedom, variance {variance:.4}");
        // 0.01 % and 99.99 % quantiles of chi-square with 10 degrees of freedom.
        assert!((0.89..35.6).contains(&chi2), "{chi2}");
        // Rounding adds 1/12 count^2; 1e5 samples determine the variance to 0.45 %.
        assert!((variance / (2.25 + 1.0 / 12.0) - 1.0).abs() < 0.018, "{variance}");
    }
}

/// Returns the Allan variance of means over `m` consecutive samples.
fn allan_variance(samples: &[f64], m: usize) -> (f64, usize) {
    let means: Vec<f64> = samples.chunks_exact(m).map(|c| c.iter().sum::<f64>() / m as f64).collect();
    let squares: f64 = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    (0.5 * squares / (means.len() - 1) as f64, means.len() - 1)
}

/// White noise falls as sigma^2 / m. The walk grows as q (2 m^2 + 1) / 6 m, which tends to K^2 tau / 3 (Allan variance
/// of rate random walk, IEEE Std 952). The sensor is the standard world's: one reading a second for 36 h, 16 seeds.
#[test]
fn the_allan_variance_of_noise_and_drift_is_the_closed_one() {
    const N: usize = 1 << 17;
    const SEEDS: u64 = 16;
    let spec = JointSensorsSpec {
        drift_rad_per_sqrt_h: JointSensorsSpec::default().drift_rad_per_sqrt_h,
        noise_rms_counts: 1.5,
        resolution_counts: 1.0,
        ..silent()
    };
    let white = 2.25 + 1.0 / 12.0;
    let walk = (spec.drift_rad_per_sqrt_h * COUNTS_PER_RAD).powi(2) / 3600.0;
    let runs: Vec<Vec<f64>> = (1..=SEEDS)
        .map(|seed| {
            let mut sensor = pot(&perfect(), &spec, seed);
            (0..N).map(|_| sensor.sample(&JointInput { elapsed_s: 1.0, ..at(-1.5) })).collect()
        })
        .collect();
    let mut curve = Vec::new();
    for m in (0..=13).map(|k| 1_usize << k) {
        let each: Vec<(f64, usize)> = runs.iter().map(|run| allan_variance(run, m)).collect();
        let n: usize = each.iter().map(|(_, n)| n).sum();
        let measured = each.iter().map(|(variance, n)| variance * *n as f64).sum::<f64>() / n as f64;
        let tau = m as f64;
        let expected = white / tau + walk * (2.0 * tau * tau + 1.0) / (6.0 * tau);
        eprintln!("plot allan {m} {measured:e} {expected:e} {:e} {:e}", white / tau, walk * tau / 3.0);
        // Neighbouring differences share a mean: the estimate spreads by sqrt(3 / n) or less.
        let tolerance = 4.0 * (3.0 / n as f64).sqrt();
        assert!((measured / expected - 1.0).abs() < tolerance, "{m} s: {measured} against {expected}");
        curve.push((tau, measured));
    }
    let slope = |a: usize, b: usize| (curve[b].1 / curve[a].1).ln() / (curve[b].0 / curve[a].0).ln();
    let (falling, rising) = (slope(0, 4), slope(10, 13));
    eprintln!("slopes {falling:.3} and {rising:.3}");
    assert!((falling + 1.0).abs() < 0.05 && (rising - 1.0).abs() < 0.15, "{falling} {rising}");
}

/// In a quarter of an hour, the walk reaches half of the hourly figure, regardless of the number of readings.
#[test]
fn drift_walks_with_the_root_of_time() {
    let spec = JointSensorsSpec { drift_rad_per_sqrt_h: 1e-3, ..silent() };
    for (n, elapsed_s) in [(9, 100.0), (90, 10.0), (1, 900.0)] {
        let walked: Vec<f64> = (0..4000)
            .map(|seed| {
                let mut sensor = pot(&perfect(), &spec, seed);
                let words: Vec<f64> = (0..n).map(|_| sensor.sample(&JointInput { elapsed_s, ..at(-1.0) })).collect();
                reading_of(words[n - 1]) + 1.0
            })
            .collect();
        let ratio = variance_ratio(&walked, 5e-4 * 5e-4);
        // 4000 runs determine a variance to 2.2 %.
        assert!((ratio - 1.0).abs() < 0.09, "{n} times {elapsed_s} s: {ratio}");
    }
}

/// 40 sweeps of 1 rad to and fro are 80 rad of travel, for any time and steps.
#[test]
fn drift_walks_with_the_root_of_travel() {
    let spec = JointSensorsSpec { drift_rad_per_sqrt_turn: 1e-3, ..silent() };
    let expected = 1e-6 * 80.0 / std::f64::consts::TAU;
    for (steps, elapsed_s) in [(1, 0.01), (5, 0.01), (1, 100.0)] {
        let walked: Vec<f64> = (0..2000)
            .map(|seed| {
                let mut sensor = pot(&perfect(), &spec, seed);
                sensor.settle(-2.0);
                let mut word = f64::NAN;
                for sweep in 0..80 {
                    for step in 1..=steps {
                        let share = f64::from(step) / f64::from(steps);
                        let angle = if sweep % 2 == 0 { -2.0 + share } else { -1.0 - share };
                        word = sensor.sample(&JointInput { elapsed_s, ..at(angle) });
                    }
                }
                reading_of(word) + 2.0
            })
            .collect();
        let ratio = variance_ratio(&walked, expected);
        // 2000 runs determine a variance to 3.2 %.
        assert!((ratio - 1.0).abs() < 0.13, "{steps} steps a sweep, {elapsed_s} s: {ratio}");
    }
    let mut resting = pot(&perfect(), &spec, 1);
    resting.settle(-1.0);
    for _ in 0..100 {
        let reading = reading_of(resting.sample(&JointInput { elapsed_s: 100.0, ..at(-1.0) }));
        assert!((reading + 1.0).abs() < 1e-9, "at rest it stays: {reading}");
    }
}

/// Returns the share of samples that are lost, and the mean length of a drop-out, in samples.
fn dropouts(spec: &JointSensorsSpec, built: &JointAsBuilt, angle_rad: f64, elapsed_s: f64) -> (f64, f64) {
    const N: u32 = 400_000;
    let mut sensor = pot(built, spec, 3);
    sensor.settle(angle_rad);
    let (mut lost, mut runs, mut was_lost) = (0.0, 0.0, false);
    for _ in 0..N {
        let is_lost = sensor.sample(&JointInput { elapsed_s, ..at(angle_rad) }) == 0.0;
        lost += f64::from(u8::from(is_lost));
        runs += f64::from(u8::from(is_lost && !was_lost));
        was_lost = is_lost;
    }
    (lost / f64::from(N), lost / runs)
}

/// In the chain, a share `l / (l + f)` is lost. A drop-out that a sample met lasts `1 / P(found at the next)` samples
/// on average, `P = f / (l + f) (1 - exp(-(l + f) dt))`.
#[test]
fn dropouts_come_and_last_as_the_chain_says() {
    let spot = WornSpot { center_rad: -1.0, peak_rad: 0.0, width_rad: 0.05 };
    let worn = JointAsBuilt { worn_spot: Some(spot), ..perfect() };
    let found_per_s = 1.0 / 0.05;
    let anywhere = JointSensorsSpec { dropout_per_s: 2.0, dropout_mean_s: 0.05, ..silent() };
    let on_spot = JointSensorsSpec { worn_dropout_per_s: 5.0, dropout_mean_s: 0.05, ..silent() };
    let aside = 5.0 * (-0.5_f64).exp();
    for (spec, angle, elapsed_s, lost_per_s) in [
        (&anywhere, -2.0, 0.01, 2.0),
        (&anywhere, -2.0, 1.0, 2.0),
        (&on_spot, -1.0, 0.01, 5.0),
        (&on_spot, -0.95, 0.01, aside),
    ] {
        let both = lost_per_s + found_per_s;
        let expected_share = lost_per_s / both;
        let expected_length = both / (found_per_s * (1.0 - (-both * elapsed_s).exp()));
        let (share, length) = dropouts(spec, &worn, angle, elapsed_s);
        // About 10,000 drop-outs or more.
        assert!((share / expected_share - 1.0).abs() < 0.06, "{share} against {expected_share} lost at {angle}");
        assert!((length / expected_length - 1.0).abs() < 0.04, "{length} against {expected_length} samples");
    }
    let (share, _) = dropouts(&on_spot, &worn, -2.0, 0.01);
    assert_eq!(share, 0.0, "20 widths from the spot");
}

/// An effect that is switched on shifts no other random numbers: the noise of a sensor with drop-outs and drift by use
/// is that of one without.
#[test]
fn effects_have_random_streams_of_their_own() {
    let plain = JointSensorsSpec { noise_rms_counts: 1.5, drift_rad_per_sqrt_h: 1e-3, ..silent() };
    let rich = JointSensorsSpec { dropout_per_s: 1.0, drift_rad_per_sqrt_turn: 1e-9, ..plain };
    let (mut a, mut b) = (pot(&perfect(), &plain, 7), pot(&perfect(), &rich, 7));
    let mut lost = 0;
    for i in 0..2000 {
        let input = at(-1.5 + 0.3 * (f64::from(i) * 0.01).sin());
        let (a, b) = (a.sample(&input), b.sample(&input));
        if b < 100.0 {
            lost += 1;
        } else {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }
    assert!(lost > 0);
}
