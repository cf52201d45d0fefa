//! The world from inside: what its messages cannot show.

use std::path::Path;

use super::*;
use crate::robot::{load, load_vehicle};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn world(spec: WorldSpec, seed: u64) -> World {
    let robot = load(&Path::new(ROOT).join("robots/titan4")).expect("the robot reads");
    let vehicle = load_vehicle(&Path::new(ROOT).join("robots/vehicles/work-class-front.toml")).expect("it reads");
    World::new(WorldInput { robot: &robot, vehicle: &vehicle, scene: &Scene::default(), spec, seed }).expect("a world")
}

/// With closed valves the joints only give as far as the oil does: no creep of the solver under gravity and rocking.
#[test]
fn a_locked_valve_holds_still() {
    const LIMIT_RAD: f64 = 1e-3;
    let mut world = world(WorldSpec::default(), 1);
    let start = world.physics.angles();
    let mut largest: f64 = 0.0;
    for _ in 0..30_000 {
        world.physics_step(&[0.0; MAX_JOINTS]).expect("it steps");
        largest = largest.max(world.physics.angles().max_abs_difference(&start));
    }
    eprintln!("largest {largest:.2e} rad");
    assert!(largest < LIMIT_RAD, "{largest}");
}

/// The pistons start where they carry the arm: a jump would be of the order of 5e-3 rad, torque over stiffness.
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

/// Readings at the start are the stowed pose by the datasheet, wherever the arm is.
#[test]
fn the_sensors_start_stowed() {
    let world = world(WorldSpec::default(), 3);
    let nominal = crate::sensor::ArmSensors::nominal(&world.robot).angles(&world.measured);
    // Noise of 1.5 counts at 46 counts per degree, four sigma.
    assert!(nominal.max_abs_difference(&world.robot.stowed) < 6.5_f64.to_radians() / 46.0);
    assert!(world.physics.angles().max_abs_difference(&world.robot.stowed) > 0.01, "the arm itself is elsewhere");
}

/// Five times the steps in a period change a move by less than a tenth of a millimetre's worth of angle.
#[test]
fn the_step_is_short_enough() {
    let run = |step_s: f64| {
        let mut spec = WorldSpec::default();
        spec.physics.step_s = step_s;
        let mut world = world(spec, 4);
        let mut path = Vec::new();
        for period in 0..300 {
            for _ in 0..world.spec.steps_per_period() {
                let mut commands = [0.0; MAX_JOINTS];
                if period < 150 {
                    commands = [0.5, -0.4, 0.5, 0.3, -0.3, 0.5, 0.0, 0.0];
                }
                world.physics_step(&commands).expect("it steps");
            }
            path.push(world.physics.angles());
        }
        path
    };
    let (coarse, fine) = (run(1e-3), run(2e-4));
    let moving = coarse.iter().zip(&fine).map(|(a, b)| a.max_abs_difference(b)).fold(0.0, f64::max);
    eprintln!("largest difference on the way {moving:.2e} rad");
    assert!(moving < 2e-3, "{moving}");
}
