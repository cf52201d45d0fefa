//! As-built values: distributions, and their record in the truth.

use std::path::Path;

use crate::as_built::*;
use crate::spec::WorldSpec;
use armcal_core::robot::{Robot, SensorKind, load, load_vehicle};

pub(super) fn robot() -> Robot {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
    let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("it reads");
    load(&root.join("titan4")).expect("it reads").mounted_on(&vehicle).expect("it fits")
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

/// Asserts mean and standard deviation of normal samples, to 4 sigma.
pub(super) fn assert_normal(what: &str, samples: &[f64], std: f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let spread = (samples.iter().map(|x| x * x).sum::<f64>() / n).sqrt();
    assert!(mean.abs() < 4.0 * std / n.sqrt(), "{what}: mean {mean}");
    assert!((spread / std - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{what}: {spread} against {std}");
}

/// Effects that are off leave no trace in the truth, and truths without them can be read.
#[test]
fn the_standard_world_writes_down_what_it_always_did() {
    let built = AsBuilt::draw(&robot(), &WorldSpec::default(), 5);
    let text = toml::to_string(&built).expect("text");
    for key in ["worn_spot", "pressure", "eccentricity", "resolver", "gauges", "attitude", "lens", "dome", "geometry"] {
        assert!(!text.contains(key), "{key} in {text}");
    }
    assert_eq!(toml::from_str::<AsBuilt>(&text).expect("it reads"), built);
}

#[test]
fn a_rich_world_reads_back() {
    let mut spec = WorldSpec::default();
    spec.joint_sensors.worn_spot_peak_rad = 0.01;
    spec.joint_sensors.pressure_offset_std_rad_per_mpa = 1e-4;
    spec.joint_sensors.encoder_eccentricity_rad = 1e-3;
    spec.joint_sensors.resolver_imbalance_std = 1e-3;
    spec.temperature.thermometer_bias_std_k = 0.2;
    spec.vehicle.gyro_bias_std_rad_s = 1e-4;
    spec.camera.focal_std = 1e-3;
    spec.camera.port = crate::spec::PortKind::Dome;
    spec.camera.dome_decentre_std_m = 1e-3;
    let mut robot = robot();
    robot.sensors[1].kind = SensorKind::Encoder;
    robot.sensors[2].kind = SensorKind::Resolver;
    let built = AsBuilt::draw(&robot, &spec, 5);
    let text = toml::to_string(&built).expect("text");
    assert_eq!(toml::from_str::<AsBuilt>(&text).expect("it reads"), built);
    let [pot, encoder, resolver] = [0, 1, 2].map(|j| &built.joints[j]);
    assert!(pot.worn_spot.is_some() && pot.eccentricity.is_none() && pot.resolver.is_none());
    assert!(encoder.eccentricity.is_some() && encoder.worn_spot.is_none() && encoder.harmonics.is_empty());
    assert!(resolver.resolver.is_some() && resolver.eccentricity.is_none());
    for other in [encoder, resolver] {
        let of_a_track = [
            other.gain_error,
            other.temperature_offset_rad_per_k,
            other.temperature_gain_per_k,
            other.pressure_offset_rad_per_mpa,
        ];
        assert_eq!(of_a_track, [0.0; 4]);
        assert!(other.offset_error_rad != 0.0);
    }
    // One more effect changes no other.
    let plain = AsBuilt::draw(&robot, &WorldSpec::default(), 5);
    assert_eq!(plain.joints[0].harmonics, pot.harmonics);
    assert_eq!(plain.joints[0].gain_error, pot.gain_error);
    assert_eq!((plain.camera_mount, plain.tags), (built.camera_mount, built.tags));
}

#[test]
fn joints_differ_as_the_world_asks() {
    let mut spec = WorldSpec::default();
    spec.joint_sensors.worn_spot_peak_rad = 0.01;
    spec.joint_sensors.pressure_offset_std_rad_per_mpa = 1e-4;
    spec.joint_sensors.pressure_gain_std_per_mpa = 2e-5;
    let robot = robot();
    let joints: Vec<JointAsBuilt> = (0..400).flat_map(|seed| AsBuilt::draw(&robot, &spec, seed).joints).collect();
    let n = joints.len() as f64;
    // Standard deviations are known to 1 / sqrt(2 n), 1.4 %.
    let offsets: Vec<f64> = joints.iter().map(|j| j.pressure_offset_rad_per_mpa).collect();
    let gains: Vec<f64> = joints.iter().map(|j| j.pressure_gain_per_mpa).collect();
    assert!((rms(&offsets) / 1e-4 - 1.0).abs() < 0.06 && (rms(&gains) / 2e-5 - 1.0).abs() < 0.06);
    let spots: Vec<WornSpot> = joints.iter().map(|j| j.worn_spot.expect("a spot")).collect();
    let places: Vec<f64> =
        spots.iter().zip(&joints).map(|(s, j)| (s.center_rad - j.center_rad) / j.range_rad).collect();
    assert!(places.iter().all(|place| place.abs() <= 0.4), "within the middle 80 %");
    // Uniform: rms 0.4 / sqrt(3), known to 0.45 / sqrt(n).
    assert!((rms(&places) * 3.0_f64.sqrt() / 0.4 - 1.0).abs() < 4.0 * 0.45 / n.sqrt(), "{}", rms(&places));
    let up = spots.iter().filter(|spot| spot.peak_rad > 0.0).count() as f64 / n;
    assert!((up - 0.5).abs() < 4.0 * 0.5 / n.sqrt(), "{up}");
    assert!(spots.iter().all(|spot| spot.peak_rad.abs() == 0.01));
}

/// A joint with a narrow datasheet, in a world that states the sensors' errors and in one that does not.
#[test]
fn a_world_that_does_not_say_keeps_to_each_joints_bounds() {
    let mut robot = robot();
    (robot.sensors[2].gain_bound, robot.sensors[2].offset_bound_rad) = (0.01, 0.02);
    let said = WorldSpec::default();
    let unsaid = WorldSpec { by_datasheet: [true; 2], ..WorldSpec::default() };
    let mut beyond = 0;
    for seed in 0..40 {
        let [said, unsaid] = [&said, &unsaid].map(|spec| AsBuilt::draw(&robot, spec, seed));
        let joint = &unsaid.joints[2];
        assert!(joint.gain_error.abs() <= 0.01 && joint.offset_error_rad.abs() <= 0.02, "{joint:?}");
        beyond += u32::from(said.joints[2].offset_error_rad.abs() > 0.02);
        assert_eq!(said.joints[1], unsaid.joints[1]);
    }
    assert!(beyond > 20, "{beyond}");
    assert!(unsaid.beyond_datasheet(&robot).is_empty());
    let warnings = said.beyond_datasheet(&robot);
    assert!(warnings.len() == 2 && warnings[1].contains("offset_error_max_rad"), "{warnings:?}");
}
