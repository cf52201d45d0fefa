//! All sensors together, without a world.

use std::path::Path;

use crate::spec::WorldSpec;
use crate::world::{World, WorldInput};
use armcal_core::robot::{SensorKind, load, load_vehicle};
use armcal_core::routine::Scene;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{Arm, JointAngles, Message, Sink, SinkError, Thermometer};
use armcal_core::time::Stamp;

#[derive(Default)]
struct Tape(Vec<Message>);

impl Sink for Tape {
    fn record(&mut self, _: Stamp, message: &Message) -> Result<(), SinkError> {
        self.0.push(message.clone());
        Ok(())
    }
}

/// Simulates ten seconds of an arm that swings or stands, in the world of a text; `kinds` are those of its first
/// sensors.
fn run(world: &str, kinds: &[SensorKind], swing_rad: f64) -> Vec<Message> {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots");
    let vehicle = load_vehicle(&root.join("vehicles/work-class-front.toml")).expect("it reads");
    let mut robot = load(&root.join("titan4")).expect("it reads").mounted_on(&vehicle).expect("it fits");
    for (sensor, kind) in robot.sensors.iter_mut().zip(kinds) {
        sensor.kind = *kind;
    }
    let spec = WorldSpec::from_table(&world.parse().expect("TOML"), Path::new("r.toml")).expect("valid");
    let scene = Scene::default();
    let input = WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec, seed: 3 };
    let mut world = World::new(input).expect("a world");
    let mut tape = Tape::default();
    let (sensors, stowed) = (ArmSensors::nominal(&robot), robot.stowed);
    for period in 0..1000 {
        let share = swing_rad * (f64::from(period) * 0.01).sin();
        let set_point = JointAngles::from_fn(stowed.len(), |j| stowed[j] + if j == 0 { share } else { 0.0 });
        world.command(&sensors.counts(&set_point)).expect("accepted");
        world.step(&mut tape).expect("it steps");
    }
    tape.0
}

const RICH: &str = "
    [joint_sensors]
    worn_spot_peak_rad = 0.005
    pressure_offset_std_rad_per_mpa = 1e-4
    pressure_gain_std_per_mpa = 1e-5
    drift_rad_per_sqrt_turn = 1e-4
    hysteresis_rad = 5e-4
    encoder_steps_per_turn = 16384
    encoder_eccentricity_rad = 1e-3
    resolver_pole_pairs = 2
    resolver_imbalance_std = 2e-3
    resolver_quadrature_std_rad = 2e-3
    [temperature]
    profile_depth_m = [0.0, 1000.0]
    profile_c = [20.0, 4.0]
    oil_heat_capacity_j_per_k = 3.3e4
    thermometer_bias_std_k = 0.2
    thermometer_lag_s = 5.0
    thermometer_resolution_k = 0.1
    [camera]
    exposure_s = 0.02
    blur_noise_per_px = 0.1
    focal_std = 1e-3
    center_std_px = 1.0
    port = \"dome\"
    dome_decentre_std_m = 5e-4
    wrong_id_probability = 0.01
    [clock]
    camera_clock_drift_ppm = 20.0
    [vehicle]
    attitude_misalignment_std_rad = 0.01
    gyro_bias_std_rad_s = 1e-4
    gyro_drift_rad_s_per_sqrt_h = 1e-4
    accelerometer_bias_std_m_s2 = 0.01
    [water]
    pressure_bias_std_pa = 500.0
    pressure_scale_std = 1e-3
";

#[test]
fn a_world_with_every_effect_runs_and_repeats() {
    let kinds = [SensorKind::Potentiometer, SensorKind::Encoder, SensorKind::Resolver];
    let messages = run(RICH, &kinds, 0.1);
    let (mut images, mut tags) = (0, 0);
    for message in &messages {
        match message {
            Message::JointSensors(sample) => {
                assert!(sample.counts.iter().all(|counts| (0.0..65536.0).contains(counts)));
            }
            Message::Detections(detections) => {
                images += 1;
                tags += detections.tags.len();
                assert!(detections.tags.iter().flat_map(|tag| tag.corners_px).flatten().all(f64::is_finite));
            }
            _ => {}
        }
    }
    assert!(images >= 45 && tags > 3 * images, "{tags} tags in {images} images");
    assert_eq!(messages, run(RICH, &kinds, 0.1));
}

/// The drives' work warms the oil: a swinging arm's is warmer than a standing one's, which cools to the water.
#[test]
fn oil_warms_with_the_arms_work() {
    let oil_c = |swing_rad: f64| {
        let world = "temperature = { oil_heat_capacity_j_per_k = 3.3e4, thermometer_noise_k = 0.0 }";
        let messages = run(world, &[], swing_rad);
        let last = messages.iter().rev().find_map(|message| match message {
            Message::Temperature(sample) if sample.thermometer == Thermometer::Oil => Some(sample.temperature_c),
            _ => None,
        });
        last.expect("a sample")
    };
    let (standing, swinging) = (oil_c(0.0), oil_c(0.3));
    eprintln!("oil after 10 s: {standing:.4} C standing, {swinging:.4} C swinging");
    // The oil cools from 10 C towards water of 4 C with 300 s; the oil columns of a standing arm hardly move.
    let cooled = 4.0 + 6.0 * (-10.0_f64 / 300.0).exp();
    assert!((standing - cooled).abs() < 2e-3, "{standing} against {cooled}");
    assert!(swinging > standing + 1e-3, "{swinging}");
}
