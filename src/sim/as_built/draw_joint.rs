//! A joint sensor as built, by its kind.

use std::f64::consts::TAU;

use rand::RngExt;

use crate::as_built::joint::JointAsBuilt;
use crate::as_built::normal::effect_rng;
use crate::spec::WorldSpec;
use armcal_core::robot::{Robot, SensorKind};

/// Draws a joint sensor: the offset of every kind here, the rest with the kind's own function.
pub(super) fn draw_joint(robot: &Robot, joint: usize, spec: &WorldSpec, seed: u64) -> JointAsBuilt {
    let limits = robot.chain.joints()[joint].limits;
    let name = &robot.sensors[joint].joint;
    let sensors = &spec.joint_sensors;
    let [gain_max, offset_max_rad] = spec.sensor_errors_max(&robot.sensors[joint]);
    let mut built = JointAsBuilt {
        name: name.clone(),
        center_rad: robot.sensors[joint].center_rad,
        // A joint without stops is measured over one turn.
        range_rad: limits.map_or(TAU, |l| l.upper_rad - l.lower_rad),
        gain_error: 0.0,
        offset_error_rad: offset_max_rad * effect_rng(seed, "offset", name).random_range(-1.0..=1.0),
        temperature_offset_rad_per_k: 0.0,
        temperature_gain_per_k: 0.0,
        gear_ratio: spec.gear_ratio.get(name).copied().unwrap_or(1.0),
        pressure_offset_rad_per_mpa: 0.0,
        pressure_gain_per_mpa: 0.0,
        harmonics: Vec::new(),
        worn_spot: None,
        eccentricity: None,
        resolver: None,
    };
    match robot.sensors[joint].kind {
        SensorKind::Potentiometer => built.draw_potentiometer(sensors, gain_max, seed),
        SensorKind::Encoder => built.draw_encoder(sensors, seed),
        SensorKind::Resolver => built.draw_resolver(sensors, seed),
    }
    built
}
