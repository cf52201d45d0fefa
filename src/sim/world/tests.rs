//! Inner state of the world, which its messages do not have.

use std::path::Path;

use nalgebra::Isometry3;

use crate::spec::{EngineKind, PhysicsSpec, WorldSpec};
use crate::world::*;
use armcal_core::robot::{Part, PlacedShape, Shape, load, load_vehicle};
use armcal_core::routine::Scene;
use armcal_core::streams::{Arm, JointAngles, MAX_JOINTS, Message, Sink, Thermometer};
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

mod engines;
mod geometry;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn world(spec: WorldSpec, seed: u64) -> World {
    world_above(spec, seed, None)
}

fn world_above(spec: WorldSpec, seed: u64, seafloor_z_m: Option<f64>) -> World {
    world_in(spec, seed, Scene { seafloor_z_m, ..Scene::default() })
}

fn world_in(spec: WorldSpec, seed: u64, scene: Scene) -> World {
    let robot = load(&Path::new(ROOT).join("robots/titan4")).expect("the robot reads");
    let vehicle = load_vehicle(&Path::new(ROOT).join("robots/vehicles/work-class-front.toml")).expect("it reads");
    World::new(WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec, seed }).expect("a world")
}

/// With closed valves that do not leak, the joints yield only as far as the oil does, and return. No solver creeps in
/// ten minutes of gravity and rocking. Means over 100 s, several times the slowest period, distinguish creep from
/// elastic motion.
#[test]
fn a_locked_valve_does_not_creep() {
    does_not_creep(EngineKind::Featherstone);
}

fn does_not_creep(engine: EngineKind) {
    const LIMIT_RAD: f64 = 1e-4;
    let mut spec = WorldSpec::default();
    spec.physics.engine = Some(engine);
    let mut world = world(spec, 1);
    let n = world.joint_sensors.len();
    let start = world.physics.angles();
    let (mut first, mut last, mut swing) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS], 0.0_f64);
    const STEPS: u32 = 300_000;
    const MEAN: u32 = 50_000;
    for step in 0..STEPS {
        world.physics_step(&[0.0; MAX_JOINTS]).expect("it steps");
        let angles = world.physics.angles();
        swing = swing.max(angles.max_abs_difference(&start));
        let sums = if step < MEAN { &mut first } else { &mut last };
        if !(MEAN..STEPS - MEAN).contains(&step) {
            for j in 0..n {
                sums[j] += angles[j] / f64::from(MEAN);
            }
        }
    }
    let crept = (0..n).map(|j| (last[j] - first[j]).abs()).fold(0.0, f64::max);
    eprintln!("{engine:?} crept {crept:.1e} rad in 10 minutes, swung by {swing:.1e}");
    assert!(crept < LIMIT_RAD, "{crept}");
    assert!(swing > crept && swing < 1e-3, "the oil gives: {swing}");
}

/// Sink that stores the messages.
#[derive(Default)]
struct Tape(Vec<Message>);

impl Sink for Tape {
    fn record(&mut self, _: Stamp, message: &Message) -> Result<(), armcal_core::streams::SinkError> {
        self.0.push(message.clone());
        Ok(())
    }
}

fn stamp_of(message: &Message) -> Option<Stamp> {
    match message {
        Message::Pressure(sample) => Some(sample.stamp),
        Message::Temperature(sample) => Some(sample.stamp),
        Message::JointSensors(sample) => Some(sample.stamp),
        _ => None,
    }
}

const DIVE: &str = "
    [water]
    dive_time_s = [0.0, 3600.0, 7200.0]
    dive_depth_m = [0.0, 4000.0, 0.0]
    pressure_noise_pa = 0.0
    [temperature]
    profile_depth_m = [0.0, 4000.0]
    profile_c = [25.0, 1.0]
    oil_start_c = 25.0
    oil_heat_capacity_j_per_k = 3.3e4
    thermometer_noise_k = 0.0
    [joint_sensors]
    temperature_gain_std_per_k = 0.0
    drift_rad_per_sqrt_h = 0.0
    noise_rms_counts = 0.0
    resolution_counts = 0.0
    pressure_offset_std_rad_per_mpa = 2e-4
    pressure_hysteresis_mpa = 2.0
    sensor_lag_s = 600.0
    [vehicle]
    rotation_rms_rad = 0.0
    translation_rms_m = 0.0";

/// In a dive to 4000 m within an hour and back within another, at rest and in the strides of a wait, all sensors follow
/// closed forms: two lags in a row and the play operator for gauge, thermometers and joint sensors.
#[test]
fn a_dive_is_felt_by_every_sensor() {
    let spec = WorldSpec::from_table(&DIVE.parse().expect("TOML"), Path::new("r.toml")).expect("valid");
    let mut world = world(spec, 5);
    let (start, joints) = (world.measured, world.header.as_built.joints.clone());
    let (oil_s, sensor_s) = (300.0_f64, 600.0_f64);
    // Response of `lags` in a row to a rise of 1 per second.
    let oil = |t_s: f64| t_s - oil_s * (1.0 - (-t_s / oil_s).exp());
    let both = |t_s: f64| {
        let fading = oil_s.powi(2) * (-t_s / oil_s).exp() - sensor_s.powi(2) * (-t_s / sensor_s).exp();
        t_s - oil_s - sensor_s + fading / (oil_s - sensor_s)
    };
    let there_and_back =
        |of: &dyn Fn(f64) -> f64, t_s: f64| of(t_s) - if t_s > 3600.0 { 2.0 * of(t_s - 3600.0) } else { 0.0 };
    let mut tape = Tape::default();
    world.rest(7300.0, &mut tape).expect("it rests");
    for (t_s, lag_mpa) in [(2000.0, -1.0), (3500.0, -1.0), (5400.0, 1.0), (7100.0, 1.0)] {
        let depth_m = 4000.0 / 3600.0 * there_and_back(&|t_s| t_s, t_s);
        let pressure_mpa = 1e-6 * 1025.0 * armcal_core::robot::GRAVITY_M_S2 * depth_m;
        let k_per_s = -24.0 / 3600.0;
        let mut seen = 0;
        for message in tape.0.iter().filter(|message| stamp_of(message) == Some(SIMULATION_EPOCH.plus_s(t_s))) {
            seen += 1;
            match message {
                Message::Pressure(sample) => {
                    assert!((sample.pressure_pa - 101_325.0 - 1e6 * pressure_mpa).abs() < 1.0, "{sample:?}");
                }
                Message::Temperature(sample) => {
                    let expected_c = 25.0
                        + k_per_s
                            * if sample.thermometer == Thermometer::Oil {
                                there_and_back(&oil, t_s)
                            } else {
                                there_and_back(&|t_s| t_s, t_s)
                            };
                    // The water is constant over each second.
                    assert!((sample.temperature_c - expected_c).abs() < 0.01, "{sample:?} against {expected_c}");
                }
                Message::JointSensors(sample) => {
                    for (j, joint) in joints.iter().enumerate() {
                        let expected = joint.temperature_offset_rad_per_k * k_per_s * there_and_back(&both, t_s)
                            + joint.pressure_offset_rad_per_mpa * (pressure_mpa + lag_mpa);
                        let counts_per_rad = world.robot.sensors[j].counts_per_rad;
                        let shift = (sample.counts[j] - start[j]) / counts_per_rad;
                        assert!((shift - expected).abs() < 1e-5, "joint {j} at {t_s} s: {shift} against {expected}");
                    }
                }
                _ => {}
            }
        }
        assert_eq!(seen, 4, "{t_s} s");
    }
}

fn floating(change: impl Fn(&mut WorldSpec)) -> World {
    let mut spec = WorldSpec::default();
    spec.vehicle.motion = crate::spec::MotionKind::Free;
    change(&mut spec);
    world(spec, 3)
}

/// Returns the position of the vehicle after `seconds` with the valves closed: distance from its station (m), angle
/// (rad).
fn drifted(world: &mut World, seconds: f64) -> (f64, f64) {
    for _ in 0..(seconds / world.spec.physics.step_s) as u32 {
        world.physics_step(&[0.0; MAX_JOINTS]).expect("it steps");
    }
    let pose = world.base.world_from_vehicle;
    (pose.origin().vector().norm(), pose.rotation().angle())
}

/// Ballasted for its arm, the vehicle floats level without control. Its thrusters hold it in a current, and without
/// them it drifts away.
#[test]
fn a_free_vehicle_floats_level_and_keeps_its_station() {
    let thrusters_off = |spec: &mut WorldSpec| spec.vehicle.station_keeping_rad_s = 0.0;
    let (away_m, turned_rad) = drifted(&mut floating(thrusters_off), 120.0);
    eprintln!("by itself: {:.2} mm and {:.4} deg off", away_m * 1e3, turned_rad.to_degrees());
    assert!(away_m < 0.02 && turned_rad < 0.2_f64.to_radians(), "{away_m} {turned_rad}");
    let current = |spec: &mut WorldSpec| spec.water.current_m_s = [0.3, 0.1, 0.0];
    let (away_m, turned_rad) = drifted(&mut floating(current), 180.0);
    eprintln!("held in a current: {:.1} mm and {:.3} deg off", away_m * 1e3, turned_rad.to_degrees());
    assert!(away_m < 0.05 && turned_rad < 3.0_f64.to_radians(), "{away_m} {turned_rad}");
    let both = |spec: &mut WorldSpec| {
        current(spec);
        thrusters_off(spec);
    };
    assert!(drifted(&mut floating(both), 60.0).0 > 2.0, "without thrusters it goes with the water");
}

/// After an impulse of 800 N s the speed is impulse over the mass of vehicle and added water.
#[test]
fn a_free_vehicle_takes_the_impulse_of_a_knock() {
    let mut world = floating(|spec| spec.vehicle.station_keeping_rad_s = 0.0);
    let added_kg = world.vehicle.dynamics.expect("figures of the vehicle").added_mass_kg[0];
    let impulse = crate::fault::Impulse { impulse_n_s: [800.0, 0.0, 0.0], angular_impulse_n_m_s: [0.0; 3] };
    world.free.as_mut().expect("it floats").impulse(0.0, &impulse);
    for _ in 0..60 {
        world.physics_step(&[0.0; MAX_JOINTS]).expect("it steps");
    }
    let speed = (world.base.world_from_base.rotation() * world.base.velocity).x;
    // The arm is coupled by its oil and takes a small part of the impulse.
    let alone = 800.0 / (world.vehicle.mass_kg + added_kg);
    eprintln!("{speed:.4} m/s, without the arm {alone:.4}");
    assert!((0.9..1.02).contains(&(speed / alone)), "{speed} {alone}");
}

/// The arm's own motion moves a free vehicle, and the sensors measure it.
#[test]
fn the_arm_rocks_the_vehicle_that_carries_it() {
    let rocked = |motion| {
        let mut world = floating(|spec| {
            spec.vehicle.motion = motion;
            spec.vehicle.rotation_rms_rad = 0.0;
            spec.vehicle.translation_rms_m = 0.0;
        });
        let mut largest: f64 = 0.0;
        for step in 0..5000 {
            let valve = if (step / 1000) % 2 == 0 { 0.8 } else { -0.8 };
            world.physics_step(&[valve, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("it steps");
            largest = largest.max(world.base.vehicle_rate.norm());
        }
        largest
    };
    let (free, held) = (rocked(crate::spec::MotionKind::Free), rocked(crate::spec::MotionKind::Swell));
    eprintln!("the arm turns the vehicle at up to {:.3} deg/s", free.to_degrees());
    assert_eq!(held, 0.0);
    assert!((0.05_f64..10.0).contains(&free.to_degrees()), "{free}");
}

/// The pistons start in equilibrium with the arm: a jump would be of the order of 5e-3 rad, torque over stiffness.
#[test]
fn it_starts_in_equilibrium() {
    let mut world = world(WorldSpec::default(), 2);
    let start = world.physics.angles();
    for _ in 0..1000 {
        world.physics_step(&[0.0; MAX_JOINTS]).expect("it steps");
    }
    let moved = world.physics.angles().max_abs_difference(&start);
    eprintln!("moved {moved:.2e} rad");
    assert!(moved < 1e-4, "{moved}");
}

/// Readings at the start are those of the stowed configuration by the datasheet, for any true angles.
#[test]
fn the_sensors_start_stowed() {
    let world = world(WorldSpec::default(), 3);
    let nominal = armcal_core::sensor::ArmSensors::nominal(&world.robot).angles(&world.measured);
    // Noise of 1.5 counts at 46 counts per degree, four sigma.
    assert!(nominal.max_abs_difference(&world.robot.stowed) < 6.5_f64.to_radians() / 46.0);
    assert!(world.physics.angles().max_abs_difference(&world.robot.stowed) > 0.01, "the arm itself is elsewhere");
}

/// Moves in front of the vehicle, rad from stowed; the arm rests after each.
const MOVES: [[f64; 6]; 5] = [
    [-0.3, -0.2, 0.1, 0.2, -0.2, 1.0],
    [0.1, -0.5, 0.4, -0.3, 0.3, -2.0],
    [-0.5, -0.3, 0.2, 0.4, 0.5, 4.0],
    [0.3, -0.1, 0.3, 0.1, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
];

/// True angles and tool position, at the end of a move or in one of its periods.
type Place = (JointAngles, nalgebra::Vector3<f64>);

/// Drives the moves by set-points, as a session does. Returns every period on the way and the mean over each rest.
fn driven(step_s: f64, seed: u64, engine: EngineKind) -> (Vec<Place>, Vec<Place>) {
    struct Nothing;
    impl Sink for Nothing {
        fn record(&mut self, _: Stamp, _: &Message) -> Result<(), armcal_core::streams::SinkError> {
            Ok(())
        }
    }
    const MOVE_PERIODS: u32 = 400;
    const REST_PERIODS: u32 = 300;
    let mut spec = WorldSpec::default();
    (spec.physics.step_s, spec.physics.engine) = (step_s, Some(engine));
    let mut world = world(spec, seed);
    let sensors = armcal_core::sensor::ArmSensors::nominal(&world.robot);
    let stowed = world.robot.stowed;
    let (mut on_the_way, mut at_rest, mut from) = (Vec::new(), Vec::new(), stowed);
    for shift in MOVES {
        let to = JointAngles::from_fn(6, |j| stowed[j] + shift[j]);
        let mut rest = Vec::new();
        for period in 1..=MOVE_PERIODS + REST_PERIODS {
            let u = (f64::from(period) / f64::from(MOVE_PERIODS)).min(1.0);
            let share = u * u * (3.0 - 2.0 * u);
            let set_point = JointAngles::from_fn(6, |j| from[j] + share * (to[j] - from[j]));
            world.command(&sensors.counts(&set_point)).expect("accepted");
            world.step(&mut Nothing).expect("it steps");
            let state = world.truth_state();
            let place = (state.angles, state.base_from_tool.origin().vector());
            on_the_way.push(place);
            if period > MOVE_PERIODS + REST_PERIODS - 100 {
                rest.push(place);
            }
        }
        let n = rest.len() as f64;
        let angles = JointAngles::from_fn(6, |j| rest.iter().map(|(angles, _)| angles[j]).sum::<f64>() / n);
        at_rest.push((angles, rest.iter().map(|(_, tool)| tool).sum::<nalgebra::Vector3<f64>>() / n));
        from = to;
    }
    (on_the_way, at_rest)
}

/// Returns the largest differences of joint angles (rad) and tool positions (m).
fn largest(a: &[Place], b: &[Place]) -> (f64, f64) {
    let pairs = || a.iter().zip(b);
    (
        pairs().map(|(a, b)| a.0.max_abs_difference(&b.0)).fold(0.0, f64::max),
        pairs().map(|(a, b)| (a.1 - b.1).norm()).fold(0.0, f64::max),
    )
}

/// Moves with ever longer steps are compared with those of a step of a quarter of a millisecond. The differences at
/// rest arise mostly in the rest band, from where the controller's noisy readings let each valve close.
#[test]
fn the_step_is_short_enough() {
    /// Limit at rest, m: a tenth of the calibrated arm's errors (5 mm); the rest band is 3.5e-4 rad.
    const REST_M: f64 = 5e-4;
    const MOVING_RAD: f64 = 2e-3;
    eprintln!("step_ms  seed  moving_rad  moving_mm  rest_rad  rest_mm");
    for seed in [4, 5, 6] {
        let (fine, fine_rest) = driven(2.5e-4, seed, EngineKind::Featherstone);
        for step_s in [5e-4, 1e-3, 2e-3, 2.5e-3, 5e-3] {
            let (on_the_way, at_rest) = driven(step_s, seed, EngineKind::Featherstone);
            let ((moving_rad, moving_m), (rest_rad, rest_m)) =
                (largest(&on_the_way, &fine), largest(&at_rest, &fine_rest));
            eprintln!(
                "{:7}  {seed:4}  {moving_rad:10.1e}  {:9.2}  {rest_rad:8.1e}  {:7.3}",
                step_s * 1e3,
                moving_m * 1e3,
                rest_m * 1e3
            );
            if step_s <= WorldSpec::default().physics.step_s {
                assert!(moving_rad < MOVING_RAD, "{step_s} s: {moving_rad}");
                assert!(rest_m < REST_M, "{step_s} s: {rest_m}");
            }
        }
    }
}

/// The ground carries the weight of a vehicle on the seabed while it rocks under the arm, and the vehicle stays.
#[test]
fn parked_skids_carry_the_weight() {
    let weight_n = 1500.0;
    let mut spec = WorldSpec::default();
    spec.vehicle.motion = crate::spec::MotionKind::Parked;
    spec.ground.vehicle_weight_n = weight_n;
    let mut world = world(spec, 1);
    let mut mean_n = 0.0;
    const STEPS: u32 = 10_000;
    for step in 0..STEPS {
        // The shoulder's valve swings it to and fro.
        let swing = 0.3 * (f64::from(step) * 2e-3).sin();
        world.physics_step(&std::array::from_fn(|j| if j == 1 { swing } else { 0.0 })).expect("it steps");
        let load_n = world.free.as_ref().expect("it is free").ground_load_n();
        mean_n += load_n / f64::from(STEPS);
    }
    let (away_m, turned_rad) = drifted(&mut world, 10.0);
    let rest_n = world.free.as_ref().expect("it is free").ground_load_n();
    eprintln!("carried {mean_n:.1} N on the way, {rest_n:.2} N at rest; moved by {away_m:.1e} m, {turned_rad:.1e} rad");
    assert!((mean_n / weight_n - 1.0).abs() < 0.01 && (rest_n / weight_n - 1.0).abs() < 0.001);
    assert!(away_m < 5e-3 && turned_rad < 5e-3, "{away_m} {turned_rad}");
    assert!(turned_rad > 1e-6, "soft ground gives: {turned_rad}");
}

/// A floating vehicle that is too heavy sinks until it stands on its skids, and stays there.
#[test]
fn a_sinking_vehicle_lands_and_stays() {
    let mut spec = WorldSpec::default();
    spec.vehicle.motion = crate::spec::MotionKind::Free;
    spec.vehicle.station_keeping_rad_s = 0.0;
    spec.ground.vehicle_weight_n = 800.0;
    spec.water.current_m_s = [0.05, 0.0, 0.0];
    let mut world = world_above(spec, 1, Some(-2.2));
    drifted(&mut world, 60.0);
    let landed = world.base.world_from_vehicle.origin().vector();
    drifted(&mut world, 60.0);
    let stays = world.base.world_from_vehicle.origin().vector();
    // The skids' lower faces are 1.01 m below the origin.
    eprintln!("landed at {landed:.4?}, moved by {:.1e} m in a minute", (stays - landed).norm());
    assert!((stays.z + 1.19).abs() < 0.03, "{stays}");
    assert!((stays - landed).norm() < 1e-4, "{landed} {stays}");
    assert!((world.free.as_ref().expect("it is free").ground_load_n() / 800.0 - 1.0).abs() < 0.01);
}

/// A floating vehicle that is too heavy descends onto a block, on which its skids stand as on springs. Without the
/// block it passes through that position.
#[test]
fn a_sinking_vehicle_stands_on_an_obstacle() {
    const WEIGHT_N: f64 = 800.0;
    // The skids' lower faces are 1.01 m below the origin.
    let block = |top_m: f64| Part {
        name: "block".to_owned(),
        placed: PlacedShape {
            owner_from_shape: Isometry3::translation(0.0, 0.0, top_m - 0.25),
            shape: Shape::Box { size_m: [6.0, 6.0, 0.5] },
            color_rgb: [0; 3],
        },
    };
    let after_60_s = |obstacles: Vec<Part>| {
        let mut spec = WorldSpec::default();
        spec.vehicle.motion = crate::spec::MotionKind::Free;
        spec.vehicle.station_keeping_rad_s = 0.0;
        spec.ground.vehicle_weight_n = WEIGHT_N;
        let mut world = world_in(spec, 1, Scene { seafloor_z_m: None, obstacles });
        drifted(&mut world, 60.0);
        let mut touching = Vec::new();
        let name = |part: usize| world.solids.part_name(part);
        world.physics.for_each_contact(|a, b| touching.push((name(a), name(b))));
        let touching: Vec<String> = touching.iter().map(|(a, b)| format!("{a} {b}")).collect();
        (world.base.world_from_vehicle.origin().vector().z, touching)
    };
    let (fallen_m, nothing) = after_60_s(Vec::new());
    assert!(fallen_m < -2.0 && nothing.is_empty(), "{fallen_m} {nothing:?}");
    let (stands_m, touching) = after_60_s(vec![block(-1.4)]);
    let sunk_in_m = -0.39 - stands_m;
    eprintln!("sunk in by {:.2} mm, {touching:?}", 1e3 * sunk_in_m);
    // Each pair of parts is one spring.
    let expected_m = WEIGHT_N / (touching.len() as f64 * PhysicsSpec::default().contact_stiffness_n_m);
    assert!(touching.len() >= 2 && touching.iter().all(|pair| pair.contains("block")), "{touching:?}");
    assert!((sunk_in_m / expected_m - 1.0).abs() < 0.3, "{sunk_in_m} m, by the springs {expected_m} m");
}
