//! Motions of the commanded arm.

use armcal::kinematics::{IkGoal, IkSettings, JointLimits, solve_position};
use armcal::sim::WorldSpec;
use armcal::streams::{Arm, ArmError, JointCounts, Message};
use nalgebra::Vector3;

use super::{Site, Tape, Witness};

/// Moves in open water before the vehicle, rad from stowed.
const MOVES: [[f64; 6]; 6] = [
    [0.2, 0.0, 0.0, 0.0, 0.0, 0.0],
    [-0.3, -0.2, 0.1, 0.2, -0.2, 1.0],
    [0.1, -0.5, 0.4, -0.3, 0.3, -2.0],
    [-0.5, -0.3, 0.2, 0.4, 0.5, 4.0],
    [0.3, -0.1, 0.3, 0.1, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
];

/// The controller drives the readings to within 0.05 deg of the set-point, for any true angles.
#[test]
fn the_controller_comes_to_rest_at_its_set_point() {
    const LIMIT_DEG: f64 = 0.05;
    let site = Site::titan();
    let mut worst: f64 = 0.0;
    for seed in 1..=3 {
        let mut world = site.world(WorldSpec::default(), seed);
        let mut tape = Tape::default();
        for shift in MOVES {
            let target: Vec<f64> = site.robot.stowed.iter().zip(shift).map(|(a, b)| a + b).collect();
            world.command(&site.nominal_counts(&target)).expect("accepted");
            tape.run(&mut world, 8.0);
            let since = world.now();
            tape.run(&mut world, 1.0);
            let mean = tape.mean_angles(&site, since);
            for (j, wanted) in target.iter().enumerate() {
                worst = worst.max((mean[j] - wanted).abs().to_degrees());
            }
            tape.messages.clear();
        }
    }
    eprintln!("worst rest error {worst:.4} deg");
    assert!(worst < LIMIT_DEG, "{worst}");
}

/// At rest the valves are closed most of the time, and the joints hardly move.
#[test]
fn at_rest_the_arm_is_still() {
    /// Limit of the rate, rad/s, rms: it comes from rocking oil and rare valve pulses.
    const LIMIT_RAD_S: f64 = 2e-3;
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 5);
    let witness = Witness::default();
    world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
    Tape::default().run(&mut world, 30.0);
    let states = witness.states.borrow();
    let squares: f64 = states.iter().flat_map(|s| s.rates.iter().map(|r| r * r).collect::<Vec<_>>()).sum();
    let rms = (squares / (states.len() * 6) as f64).sqrt();
    let first = states[0].base_from_tool.origin();
    let moved = states.iter().map(|s| s.base_from_tool.origin().distance_m(&first)).fold(0.0, f64::max);
    eprintln!("rates {rms:.2e} rad/s rms, tool moved {:.2} mm", moved * 1e3);
    assert!(rms < LIMIT_RAD_S, "{rms}");
    assert!(moved < 3e-3, "{moved}");
}

/// The arm follows a path of set-points closely: feed-forward compensates for the loop's lag.
#[test]
fn a_path_is_followed() {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 6);
    let mut tape = Tape::default();
    let mut worst: f64 = 0.0;
    for i in 0..600 {
        let phase = std::f64::consts::TAU * f64::from(i) / 600.0;
        let target: Vec<f64> = site.robot.stowed.iter().map(|a| a - 0.15 * (1.0 - phase.cos())).collect();
        world.command(&site.nominal_counts(&target)).expect("accepted");
        let since = world.now();
        tape.run(&mut world, 0.01);
        if i > 50 {
            let reading = tape.mean_angles(&site, since);
            worst = worst.max(reading.iter().zip(&target).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
        }
    }
    eprintln!("worst lag {worst:.4} rad at 0.16 rad/s");
    assert!(worst < 0.03, "{worst}");
}

/// Drives the tool to `goal_m` (base frame); returns the recorded truth.
fn driven_to(site: &Site, goal_m: [f64; 3]) -> Witness {
    let mut world = site.world(WorldSpec::default(), 1);
    let witness = Witness::default();
    world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
    Tape::default().run(&mut world, 1.0);
    assert!(witness.contacts.borrow().is_empty(), "stowed, it touches nothing: {:?}", witness.contacts.borrow());
    let any = JointLimits { lower_rad: -3.1, upper_rad: 3.1 };
    let limits = site.robot.chain.joints().iter().map(|j| j.limits.unwrap_or(any)).collect();
    let settings = IkSettings { limits, locked: vec![false; 6], tolerance_m: 1e-3, max_iterations: 500 };
    let goal = IkGoal { position_m: Vector3::from(goal_m) };
    let angles = solve_position(&site.robot.chain, &site.robot.tool.mount, &goal, &site.robot.stowed, &settings)
        .expect("within reach");
    world.command(&site.nominal_counts(&angles)).expect("accepted");
    Tape::default().run(&mut world, 15.0);
    witness
}

fn assert_touched(witness: &Witness, part: &str) {
    let contacts = witness.contacts.borrow();
    eprintln!("{} contacts, first {:?}", contacts.len(), contacts.first());
    assert!(contacts.iter().any(|c| c.part_a == part || c.part_b == part), "{contacts:?}");
    let nearest = witness.clearances.borrow().iter().map(|c| c.distance_m).fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-3, "{nearest}");
    let fastest = witness.states.borrow().iter().flat_map(|s| s.rates.to_vec()).map(f64::abs).fold(0.0, f64::max);
    eprintln!("fastest {fastest:.2} rad/s");
    assert!(fastest < 10.0, "contact must not throw the arm about: {fastest} rad/s");
}

#[test]
fn a_target_in_the_vehicle_ends_in_contact() {
    // The goal is 0.15 m below the face of the starboard toe plate.
    assert_touched(&driven_to(&Site::titan(), [1.34, -0.1, -1.14]), "toe_plate_starboard");
}

#[test]
fn a_target_in_the_seafloor_ends_in_contact() {
    let mut site = Site::titan();
    site.scene.seafloor_z_m = Some(-1.1);
    // One motion goes through open water, the other onto the seafloor, which stops it.
    let depth = |witness: &Witness| {
        let states = witness.states.borrow();
        let last = &states[states.len() - 1];
        (last.world_from_vehicle * site.vehicle.vehicle_from_base * last.base_from_tool).origin().vector().z
    };
    let stopped = driven_to(&site, [0.8, -0.4, -1.45]);
    assert_touched(&stopped, "seafloor");
    let free = depth(&driven_to(&Site::titan(), [0.8, -0.4, -1.45]));
    eprintln!("the tool comes to z = {:.3} m, without a seafloor to {free:.3} m", depth(&stopped));
    assert!(free < -1.2 && depth(&stopped) > -1.12, "{free} {}", depth(&stopped));
}

/// For any sensor errors, the stowed arm is clear of the vehicle and sees tags.
#[test]
fn stowed_is_safe_for_every_seed() {
    let site = Site::titan();
    let mut fewest = usize::MAX;
    let mut nearest = f64::INFINITY;
    for seed in 1..=20 {
        let mut world = site.world(WorldSpec::default(), seed);
        let witness = Witness::default();
        world.set_truth_sink(Box::new(witness.clone())).expect("accepted");
        let mut tape = Tape::default();
        tape.run(&mut world, 1.0);
        assert!(witness.contacts.borrow().is_empty(), "seed {seed}: {:?}", witness.contacts.borrow());
        nearest = witness.clearances.borrow().iter().map(|c| c.distance_m).fold(nearest, f64::min);
        let seen = tape.messages.iter().filter_map(|(_, m)| match m {
            Message::Detections(detections) => Some(detections.tags.len()),
            _ => None,
        });
        fewest = fewest.min(seen.max().unwrap_or(0));
    }
    eprintln!("nearest {nearest:.3} m, fewest tags {fewest}");
    assert!(nearest > 0.02, "{nearest}");
    assert!(fewest >= 3, "{fewest}");
}

#[test]
fn wrong_set_points_are_refused() {
    let site = Site::titan();
    let mut world = site.world(WorldSpec::default(), 1);
    let short = world.command(&JointCounts::from_slice(&[0.0; 5]));
    assert!(matches!(short, Err(ArmError::JointCount { got: 5, expected: 6 })));
    let nan = world.command(&JointCounts::from_slice(&[0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0]));
    assert!(matches!(nan, Err(ArmError::SetPoint { joint: 2, .. })));
}
