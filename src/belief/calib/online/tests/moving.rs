//! Images of a moving arm: the clock offset, whatever the sensors' slopes are, and the backlash.

use rand::RngExt;

use crate::calib::bundle::tests::data::{normal, rng, titan};
use crate::calib::online::estimator::OnlineEstimator;
use crate::calib::online::settings::OnlineSettings;
use crate::calib::online::tests::drifting::Dive;
use armcal_core::joints::MAX_JOINTS;

/// A sensor whose angle turns by less than the datasheet has it moves by less in the time that its stamps are late.
#[test]
fn a_clock_offset_is_found_by_sensors_of_any_slope() {
    const LATE_S: f64 = 0.035;
    const SLOPE: f64 = 0.95;
    let robot = titan();
    let mut found_s = Vec::new();
    for seed in 0..4 {
        let mut dive = Dive::new(&robot, seed);
        let mut rates = rng(seed, "rates");
        dive.befall(|truth, _| truth.parameters.gain = [SLOPE; MAX_JOINTS]);
        let mut online = OnlineEstimator::new(robot.clone(), OnlineSettings::default());
        for k in 0..24 {
            dive.advance(&mut online, 12.0 * f64::from(k));
            online.add_view(&dive.view());
        }
        for k in 0..60 {
            dive.advance(&mut online, 300.0 + f64::from(k));
            let mut view = dive.view();
            for joint in 0..robot.n_joints() {
                let rate_rad_s = rates.random_range(0.05..0.2) * if rates.random_bool(0.5) { 1.0 } else { -1.0 };
                view.rate_rad_s[joint] = rate_rad_s;
                view.travel_rad[joint] -= rate_rad_s * LATE_S;
            }
            online.add_view(&view);
        }
        let [offset_s, std_s] = online.clock_offset_s().expect("it runs");
        assert!((offset_s - LATE_S).abs() < 4.0 * std_s, "seed {seed}: {offset_s} +- {std_s}");
        found_s.push(offset_s);
    }
    println!("clock offsets, s: {found_s:?}");
    let mean_s = found_s.iter().sum::<f64>() / found_s.len() as f64;
    // By the datasheet's slope it would be 1.7 ms short.
    assert!((mean_s - LATE_S).abs() < 0.8e-3, "{found_s:?}");
}

/// An image's time error moves all joints together: its share in the clock offset is that of the number of images, not
/// of joints.
#[test]
fn a_clock_offset_is_as_uncertain_as_it_says() {
    const LATE_S: f64 = 0.035;
    const JITTER_S: f64 = 0.005;
    let robot = titan();
    let mut sigmas = Vec::new();
    for seed in 0..12 {
        let mut dive = Dive::new(&robot, seed);
        let mut rates = rng(seed, "rates");
        let mut online = OnlineEstimator::new(robot.clone(), OnlineSettings::default());
        for k in 0..24 {
            dive.advance(&mut online, 12.0 * f64::from(k));
            online.add_view(&dive.view());
        }
        for k in 0..60 {
            dive.advance(&mut online, 300.0 + f64::from(k));
            let mut view = dive.view();
            let late_s = LATE_S + JITTER_S * normal(&mut rates);
            for joint in 0..robot.n_joints() {
                let rate_rad_s = rates.random_range(0.05..0.2) * if rates.random_bool(0.5) { 1.0 } else { -1.0 };
                view.rate_rad_s[joint] = rate_rad_s;
                view.travel_rad[joint] -= rate_rad_s * late_s;
            }
            online.add_view(&view);
        }
        let [offset_s, std_s] = online.clock_offset_s().expect("it runs");
        sigmas.push((offset_s - LATE_S) / std_s);
    }
    let rms = (sigmas.iter().map(|by| by * by).sum::<f64>() / sigmas.len() as f64).sqrt();
    println!("rms {rms:.2} of {sigmas:.2?}");
    assert!((0.5..1.5).contains(&rms), "{sigmas:?}");
}

/// Rests scatter by the backlash, for their sides are not known, and images in motion tell its size: of what a rest's
/// angle is off by, it is a part, and is not added to it.
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
