//! Images of a moving arm: the clock offset for any slopes of the sensors, and the backlash.

use rand::RngExt;

use crate::batch::tests::data::{normal, rng, titan};
use crate::follow::estimator::OnlineEstimator;
use crate::follow::settings::OnlineSettings;
use crate::follow::tests::drifting::Dive;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::Robot;

/// Delay of the images' stamps after the exposure, s.
const LATE_S: f64 = 0.035;

/// Returns the clock offset and its std, s, after rests and images in motion. All sensors have one slope, and each
/// image has its own time error.
fn found_clock_offset_s(robot: &Robot, seed: u64, slope: f64, jitter_s: f64) -> [f64; 2] {
    let mut dive = Dive::new(robot, seed);
    let (mut rates, mut jitter) = (rng(seed, "rates"), rng(seed, "jitter"));
    dive.befall(|truth, _| truth.parameters.gain = [slope; MAX_JOINTS]);
    let mut online = OnlineEstimator::new(robot.clone(), OnlineSettings::default());
    for k in 0..24 {
        dive.advance(&mut online, 12.0 * f64::from(k));
        online.add_view(&dive.view());
    }
    for k in 0..60 {
        dive.advance(&mut online, 300.0 + f64::from(k));
        let mut view = dive.view();
        let late_s = LATE_S + jitter_s * normal(&mut jitter);
        for joint in 0..robot.n_joints() {
            let rate_rad_s = rates.random_range(0.05..0.2) * if rates.random_bool(0.5) { 1.0 } else { -1.0 };
            view.rate_rad_s[joint] = rate_rad_s;
            view.travel_rad[joint] -= rate_rad_s * late_s;
        }
        online.add_view(&view);
    }
    online.clock_offset_s().expect("it runs")
}

/// A sensor with a smaller slope than the datasheet's moves by less during the delay of its stamps.
#[test]
fn a_clock_offset_is_found_by_sensors_of_any_slope() {
    let robot = titan();
    let mut found_s = Vec::new();
    for seed in 0..4 {
        let [offset_s, std_s] = found_clock_offset_s(&robot, seed, 0.95, 0.0);
        assert!((offset_s - LATE_S).abs() < 4.0 * std_s, "seed {seed}: {offset_s} +- {std_s}");
        found_s.push(offset_s);
    }
    println!("clock offsets, s: {found_s:?}");
    let mean_s = found_s.iter().sum::<f64>() / found_s.len() as f64;
    // With the datasheet's slope the offset would be 1.7 ms too small.
    assert!((mean_s - LATE_S).abs() < 0.8e-3, "{found_s:?}");
}

/// The images have their own time error, too.
#[test]
fn a_clock_offset_is_as_uncertain_as_it_says() {
    let robot = titan();
    let sigmas: Vec<f64> = (0..12)
        .map(|seed| {
            let [offset_s, std_s] = found_clock_offset_s(&robot, seed, 1.0, 0.005);
            (offset_s - LATE_S) / std_s
        })
        .collect();
    let rms = (sigmas.iter().map(|by| by * by).sum::<f64>() / sigmas.len() as f64).sqrt();
    println!("rms {rms:.2} of {sigmas:.2?}");
    assert!((0.5..1.5).contains(&rms), "{sigmas:?}");
}

/// Rests scatter by the backlash, because their sides are unknown, and images in motion determine its size. It is a
/// part of a rest's angle error, and is not added to it.
#[test]
fn a_backlash_that_motion_tells_counts_once_at_rest() {
    let robot = titan();
    let mut dive = Dive::new(&robot, 0);
    let mut online = OnlineEstimator::new(robot.clone(), OnlineSettings::default());
    for k in 0..40 {
        dive.advance(&mut online, 6.0 * f64::from(k));
        let mut view = dive.view();
        if k < 20 {
            view.approach = [0.0; MAX_JOINTS];
        } else {
            view.rate_rad_s.iter_mut().zip(view.approach).for_each(|(rate, side)| *rate = 0.05 * side);
        }
        online.add_view(&view);
    }
    let left =
        online.covariance(&dive.conditions()).and_then(|covariance| covariance.residual_std_rad).expect("it runs");
    let sensors = online.parameters().expect("it runs");
    let whole_rad = online.best_filter().expect("it runs").scales.joint_std_rad;
    let mut told = 0;
    for joint in 0..robot.n_seen_joints() {
        let half_rad = sensors.terms[joint].half_backlash_rad;
        told += usize::from(half_rad.abs() > 1e-5);
        let expected_rad = whole_rad[joint].max(half_rad.abs());
        assert!((left[joint].hypot(half_rad) - expected_rad).abs() < 1e-9, "joint {joint}: {half_rad}, {left:?}");
    }
    assert!(told >= 3, "{told} joints have a backlash");
}
