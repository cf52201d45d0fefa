//! Engines compared with each other: two implementations of one arm.

use super::*;
use crate::spec::EngineKind::{Featherstone, Rapier};
use armcal_core::kinematics::{IkGoal, IkSettings, JointLimits, solve_position};

fn world_by(engine: EngineKind, change: impl Fn(&mut WorldSpec)) -> World {
    let mut spec = WorldSpec::default();
    spec.physics.engine = Some(engine);
    change(&mut spec);
    world(spec, 1)
}

/// Returns angles and tool in every period with the valves closed, on a vehicle that rocks.
fn held(engine: EngineKind, seconds: u32) -> Vec<Place> {
    let mut world = world_by(engine, |_| {});
    let period = |world: &mut World| {
        for _ in 0..world.spec.steps_per_period() {
            world.physics_step(&[0.0; MAX_JOINTS]).expect("it steps");
        }
        let state = world.truth_state();
        (state.angles, state.base_from_tool.origin().vector())
    };
    (0..100 * seconds).map(|_| period(&mut world)).collect()
}

/// With closed valves, the same oil carries the same arm.
#[test]
fn engines_hold_the_tool_alike() {
    const LIMIT_M: f64 = 1e-5;
    let (ours, rapiers) = (held(Featherstone, 60), held(Rapier, 60));
    let (off_rad, off_m) = largest(&ours, &rapiers);
    let start = [ours[0]];
    let swing = ours.iter().map(|place| largest(&start, &[*place]).1).fold(0.0, f64::max);
    eprintln!("valves closed: {off_rad:.1e} rad, {:.6} mm; the tool swings by {:.4} mm", off_m * 1e3, swing * 1e3);
    assert!(off_m < LIMIT_M, "{off_m}");
}

/// The engines follow the same set-points through valves, friction and a controller with noisy readings.
#[test]
fn engines_move_the_tool_alike() {
    const REST_M: f64 = 7e-4;
    const REST_MEDIAN_M: f64 = 1.5e-4;
    const MOVING_M: f64 = 2e-3;
    let mut rests = Vec::new();
    for seed in 4..=9 {
        let [(ours, our_rests), (rapiers, rapier_rests)] =
            [Featherstone, Rapier].map(|engine| driven(2e-3, seed, engine));
        let (off_rad, off_m) = largest(&ours, &rapiers);
        eprintln!("seed {seed}: moving {off_rad:.1e} rad, {:.3} mm", off_m * 1e3);
        assert!(off_m < MOVING_M, "{off_m}");
        rests.extend(our_rests.iter().zip(&rapier_rests).map(|(a, b)| (a.1 - b.1).norm()));
    }
    rests.sort_by(f64::total_cmp);
    let [median, high] = [rests[rests.len() / 2], rests[rests.len() * 95 / 100]];
    eprintln!("at rest: median {:.4} mm, 95 % {:.4} mm", median * 1e3, high * 1e3);
    assert!(median < REST_MEDIAN_M && high < REST_M, "{median} {high}");
}

/// Drives the tool to a point inside the vehicle. Returns its final position, base frame, and the number of contacts
/// that began.
fn driven_into_vehicle(engine: EngineKind) -> (nalgebra::Vector3<f64>, usize) {
    struct Nothing;
    impl Sink for Nothing {
        fn record(&mut self, _: Stamp, _: &Message) -> Result<(), armcal_core::streams::SinkError> {
            Ok(())
        }
    }
    // 0.15 m below the face of the starboard toe plate.
    let goal = IkGoal { position_m: nalgebra::Vector3::new(1.34, -0.1, -1.14) };
    let mut world = world_by(engine, |_| {});
    let any = JointLimits { lower_rad: -3.1, upper_rad: 3.1 };
    let limits = world.robot.chain.joints().iter().map(|j| j.limits.unwrap_or(any)).collect();
    let settings = IkSettings { limits, locked: vec![false; 6], tolerance_m: 1e-3, max_iterations: 500 };
    let robot = &world.robot;
    let angles =
        solve_position(&robot.chain, &robot.tool.mount, &goal, &robot.stowed, &settings).expect("within reach");
    let counts = armcal_core::sensor::ArmSensors::nominal(robot).counts(&angles);
    world.command(&counts).expect("accepted");
    let mut touched = 0;
    for _ in 0..1500 {
        world.step(&mut Nothing).expect("it steps");
        world.physics.for_each_contact(|_, _| touched += 1);
    }
    (world.truth_state().base_from_tool.origin().vector(), touched)
}

#[test]
fn the_vehicle_stops_the_arm_in_both_engines() {
    let [(ours, our_touches), (rapiers, rapier_touches)] = [Featherstone, Rapier].map(driven_into_vehicle);
    eprintln!("the tool ends at {ours:.4?} and {rapiers:.4?} m; {our_touches} and {rapier_touches} periods in touch");
    assert!(our_touches > 100 && rapier_touches > 100);
    // A spring of 5e5 N/m yields by 2 mm per 1000 N; along the plate, friction determines the position.
    let off = ours - rapiers;
    assert!(off.z.abs() < 3e-3 && off.norm() < 0.03, "{ours} {rapiers}");
}

#[test]
fn a_locked_valve_does_not_creep_under_rapier() {
    does_not_creep(Rapier);
}

/// Runs with one seed under rapier give the same states of the truth.
#[test]
fn rapier_gives_the_same_bytes_again() {
    let [first, again] = [(), ()].map(|()| driven(2e-3, 4, Rapier).0);
    assert!(first.iter().zip(&again).all(|(a, b)| a.0 == b.0 && a.1 == b.1));
}
