//! `[world]` tables: keys, ranges and text.

use std::path::Path;

use super::*;
use crate::error::SimError;

fn read(text: &str) -> Result<WorldSpec, SimError> {
    WorldSpec::from_table(&text.parse().expect("valid TOML"), Path::new("r.toml"))
}

/// Returns the messages about refused tables.
fn told<const N: usize>(texts: [&str; N]) -> String {
    texts.map(|text| format!("{text:?}\n  {}\n", read(text).expect_err(text))).concat()
}

#[test]
fn an_empty_world_is_the_standard_one() {
    assert_eq!(read("").expect("valid"), WorldSpec::default());
    assert_eq!(WorldSpec::default().steps_per_period(), 5);
}

#[test]
fn errors_name_file_key_and_range() {
    let texts = [
        "[camera]\nrate_hz = 1000.0",
        "[clock]\ncamera_jitter_s = nan",
        "[clock]\ncamera_jiter_s = 0.1",
        "[clocks]",
        "[vehicle]\nperiod_min_s = 20.0",
        "[physics]\nstep_s = 0.003",
        "[camera]\nrate_hz = \"fast\"",
    ];
    insta::assert_snapshot!("world", told(texts));
}

#[test]
fn what_the_water_carries_is_the_arms_own_figure_unless_the_world_has_one() {
    for (arm, fraction) in [("titan4", 0.22), ("kraft-predator", 0.3625)] {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots").join(arm);
        let robot = armcal_core::robot::load(&folder).expect("the robot reads");
        let spec = |text: &str| read(text).expect("valid").completed(&robot);
        assert_eq!(spec("").water.buoyancy(), fraction);
        assert_eq!(spec("[water]\nbuoyancy_fraction = 0.5").water.buoyancy(), 0.5);
        assert!(spec("").to_toml().expect("text").contains(&format!("buoyancy_fraction = {fraction}")));
    }
    insta::assert_snapshot!("water", told(["[water]\nbuoyancy_fraction = 1.0", "[water]\ndrag = 1.0"]));
}

#[test]
fn a_dive_has_a_depth_for_each_time() {
    let text = "[water]\ndive_time_s = [600, 3000, 3600]\ndive_depth_m = [0.0, 4000.0, 1000.0]";
    let spec = read(text).expect("valid");
    for (t_s, depth_m) in [(0.0, 0.0), (600.0, 0.0), (1800.0, 2000.0), (3300.0, 2500.0), (9e4, 1000.0)] {
        assert!((spec.water.station_depth_m(t_s) - depth_m).abs() < 1e-9, "{t_s} s");
    }
    assert_eq!(read(&spec.to_toml().expect("text")).expect("valid"), spec);
    assert_eq!(WorldSpec::default().water.station_depth_m(77.0), 500.0);
    let texts = [
        "[water]\ndive_time_s = [0.0, 60.0]\ndive_depth_m = [4.0]",
        "[water]\ndive_depth_m = [4.0]",
        "[water]\ndive_time_s = [9.0, 9.0]\ndive_depth_m = [4.0, 5.0]",
        "[water]\ndive_time_s = [1.0]\ndive_depth_m = [-4.0]",
        "[water]\ndive_time_s = [2e6]\ndive_depth_m = [4.0]",
    ];
    insta::assert_snapshot!("dives", told(texts));
}

#[test]
fn what_lags_behind_oil_and_pressure_has_its_limits_and_is_written_where_it_is_set() {
    let texts = [
        "[joint_sensors]\nsensor_lag_s = -1.0",
        "[joint_sensors]\npressure_hysteresis_mpa = 101.0",
        "[joint_sensors]\npressure_hysteresis_share = 0.0",
    ];
    insta::assert_snapshot!("joint_sensors", told(texts));
    let standard = WorldSpec::default().to_toml().expect("text");
    assert!(["sensor_lag_s", "pressure_hysteresis", "dive_"].iter().all(|key| !standard.contains(key)), "{standard}");
    let set = read("[joint_sensors]\nsensor_lag_s = 300.0\npressure_hysteresis_share = 0.4").expect("valid");
    assert_eq!(read(&set.to_toml().expect("text")).expect("valid"), set);
}

#[test]
fn images_have_their_keys_and_limits() {
    let spec = read("[camera]\nmode = \"rendered\"\n[image]\nwater = \"coastal\"\nsnow_per_m3 = 10.0").expect("valid");
    assert_eq!((spec.camera.mode, spec.image.water), (CameraMode::Rendered, WaterKind::Coastal));
    let texts = [
        "[image]\nblur_px = 11.0",
        "[image]\nwater = \"muddy\"",
        "[image]\ndirect_per_m = [0.1, -0.1, 0.1]",
        "[camera]\nmode = \"rendered\"\nport = \"flat\"",
        "[camera]\nmode = \"rendered\"\nport = \"dome\"\ndome_decentre_std_m = 0.001",
    ];
    insta::assert_snapshot!("images", told(texts));
    assert!(read("[camera]\nmode = \"rendered\"\nport = \"dome\"").is_ok());
    // Worlds without image settings are written without them.
    let text = WorldSpec::default().to_toml().expect("text");
    assert!(!text.contains("image") && !text.contains("mode"), "{text}");
    let rendered = read("[camera]\nmode = \"rendered\"").expect("valid").to_toml().expect("text");
    assert!(rendered.contains("turbidity = 1.0") && rendered.contains("mode = \"rendered\""), "{rendered}");
    assert_eq!(read(&rendered).expect("valid").to_toml().expect("text"), rendered);
}

#[test]
fn the_text_of_a_spec_reads_back() {
    let spec = read("[camera]\nrate_hz = 10.0").expect("valid");
    assert_eq!(read(&spec.to_toml().expect("text")).expect("valid"), spec);
}

#[test]
fn an_engine_that_is_named_is_never_replaced() {
    let engine = |text: &str| read(text).expect("valid").engine();
    assert_eq!(engine(""), EngineKind::Rapier);
    assert_eq!(engine("[physics]\nengine = \"rapier\""), EngineKind::Rapier);
    assert_eq!(engine("[physics]\nengine = \"featherstone\""), EngineKind::Featherstone);
    for motion in ["free", "parked"] {
        let text = format!("[vehicle]\nmotion = \"{motion}\"\n[ground]\nvehicle_weight_n = 1500");
        assert_eq!(engine(&text), EngineKind::Featherstone);
    }
    engine("[physics]\nengine = \"featherstone\"\ncontact_stiffness_n_m = 1e6");
    let texts = [
        "[physics]\nengine = \"rapier\"\n[vehicle]\nmotion = \"free\"",
        "[physics]\ncontact_stiffness_n_m = 1e6",
        "[physics]\nengine = \"bullet\"",
    ];
    insta::assert_snapshot!("engines", told(texts));
    let named = read("[physics]\nengine = \"rapier\"").expect("valid");
    assert_eq!(read(&named.to_toml().expect("text")).expect("valid"), named);
}
