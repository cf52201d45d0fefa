//! `[world]` tables: keys, ranges and text.

use std::path::Path;

use super::*;
use crate::error::SimError;

fn read(text: &str) -> Result<WorldSpec, SimError> {
    WorldSpec::from_table(&text.parse().expect("valid TOML"), Path::new("r.toml"))
}

fn problem(text: &str) -> String {
    read(text).expect_err("refused").to_string()
}

#[test]
fn an_empty_world_is_the_standard_one() {
    assert_eq!(read("").expect("valid"), WorldSpec::default());
    assert_eq!(WorldSpec::default().steps_per_period(), 5);
}

#[test]
fn errors_name_file_key_and_range() {
    let text = problem("[camera]\nrate_hz = 1000.0");
    assert!(text.contains("r.toml") && text.contains("world.camera.rate_hz") && text.contains("0.1 .. 100"), "{text}");
    assert!(problem("[clock]\ncamera_jitter_s = nan").contains("camera_jitter_s"));
    assert!(problem("[clock]\ncamera_jiter_s = 0.1").contains("camera_jiter_s"));
    assert!(problem("[clocks]").contains("world.clocks"));
    assert!(problem("[vehicle]\nperiod_min_s = 20.0").contains("period_max_s"));
    assert!(problem("[physics]\nstep_s = 0.003").contains("step_s"));
    assert!(problem("[camera]\nrate_hz = \"fast\"").contains("world.camera"));
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
    assert!(problem("[water]\nbuoyancy_fraction = 1.0").contains("world.water.buoyancy_fraction"));
    assert!(problem("[water]\ndrag = 1.0").contains("drag"));
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
    for (text, reason) in [
        (
            "dive_time_s = [0.0, 60.0]\ndive_depth_m = [4.0]",
            "world.water.dive_depth_m: has 1 figures for 2 of dive_time_s",
        ),
        ("dive_depth_m = [4.0]", "world.water.dive_depth_m: has 1 figures for 0"),
        ("dive_time_s = [9.0, 9.0]\ndive_depth_m = [4.0, 5.0]", "world.water.dive_time_s: 9 does not come before 9"),
        ("dive_time_s = [1.0]\ndive_depth_m = [-4.0]", "world.water.dive_depth_m: -4 is outside 0 .. 12000"),
        ("dive_time_s = [2e6]\ndive_depth_m = [4.0]", "world.water.dive_time_s: 2000000 is outside 0 .. 1000000"),
    ] {
        let problem = problem(&format!("[water]\n{text}"));
        assert!(problem.starts_with("r.toml: ") && problem.contains(reason), "{problem}");
    }
}

#[test]
fn what_lags_behind_oil_and_pressure_has_its_limits_and_is_written_where_it_is_set() {
    for (text, key) in [
        ("sensor_lag_s = -1.0", "world.joint_sensors.sensor_lag_s: -1 is outside 0 .. 36000"),
        ("pressure_hysteresis_mpa = 101.0", "pressure_hysteresis_mpa: 101 is outside 0 .. 100"),
        ("pressure_hysteresis_share = 0.0", "pressure_hysteresis_share: 0 is outside 0.05 .. 1"),
    ] {
        let problem = problem(&format!("[joint_sensors]\n{text}"));
        assert!(problem.contains(key), "{problem}");
    }
    let standard = WorldSpec::default().to_toml().expect("text");
    assert!(["sensor_lag_s", "pressure_hysteresis", "dive_"].iter().all(|key| !standard.contains(key)), "{standard}");
    let set = read("[joint_sensors]\nsensor_lag_s = 300.0\npressure_hysteresis_share = 0.4").expect("valid");
    assert_eq!(read(&set.to_toml().expect("text")).expect("valid"), set);
}

#[test]
fn images_have_their_keys_and_limits() {
    let spec = read("[camera]\nmode = \"rendered\"\n[image]\nwater = \"coastal\"\nsnow_per_m3 = 10.0").expect("valid");
    assert_eq!((spec.camera.mode, spec.image.water), (CameraMode::Rendered, WaterKind::Coastal));
    assert!(problem("[image]\nblur_px = 11.0").contains("world.image.blur_px"));
    assert!(problem("[image]\nwater = \"muddy\"").contains("world.image"));
    assert!(problem("[image]\ndirect_per_m = [0.1, -0.1, 0.1]").contains("world.image.direct_per_m"));
    for port in ["port = \"flat\"", "port = \"dome\"\ndome_decentre_std_m = 0.001"] {
        let text = problem(&format!("[camera]\nmode = \"rendered\"\n{port}"));
        assert!(text.contains("world.camera.port") && text.contains("no single point"), "{text}");
    }
    assert!(read("[camera]\nmode = \"rendered\"\nport = \"dome\"").is_ok());
    // Worlds without images are written as ever.
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
    let text = problem("[physics]\nengine = \"rapier\"\n[vehicle]\nmotion = \"free\"");
    assert!(text.contains("r.toml") && text.contains("world.physics.engine"), "{text}");
    let text = problem("[physics]\ncontact_stiffness_n_m = 1e6");
    assert!(text.contains("world.physics.contact_stiffness_n_m") && text.contains("featherstone"), "{text}");
    engine("[physics]\nengine = \"featherstone\"\ncontact_stiffness_n_m = 1e6");
    let text = problem("[physics]\nengine = \"bullet\"");
    assert!(text.contains("featherstone") && text.contains("rapier"), "{text}");
    let named = read("[physics]\nengine = \"rapier\"").expect("valid");
    assert_eq!(read(&named.to_toml().expect("text")).expect("valid"), named);
}
