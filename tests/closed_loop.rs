//! The main claim: after calibration the arm reaches its targets.

use std::path::Path;

use armcal::calib::Status;
use armcal::kinematics::{IkGoal, IkSettings, JointLimits, solve_position};
use armcal::log::{for_each_raw, read_attachments};
use armcal::report::RunSummary;
use armcal::sim::truth::{TruthRecorder, read_truth};
use armcal::sim::{World, WorldInput, WorldSpec};
use armcal::stats::quantile;
use armcal::streams::Arm;
use nalgebra::Vector3;

use crate::support::{
    Nowhere, ShortRoutine, Simulated, answer, program, root, shared, shared_run, temp, titan, vehicle_file, write,
};

/// Tool error, m, median over the seeds of the median over the targets. With 12 poses it is 6.0 mm over these seeds and
/// 2.5 .. 7.4 mm for each of seeds 1 to 10. It comes from the sensors' nonlinearity and from a camera mount that no
/// number of views determines.
const TOOL_ERROR_M: f64 = 0.008;
/// Distance from the target, m, which includes the controller's rest error; 5.7 mm over these seeds.
const REACH_ERROR_M: f64 = 0.010;
/// Ratio of the error after calibration to that before, for every seed; the worst of seeds 1 to 10 is 0.095.
const RATIO: f64 = 1.0 / 6.0;

fn medians(summary: &RunSummary) -> [f64; 3] {
    let score = summary.score.as_ref().expect("scored");
    let after = score.after.as_ref().expect("reached again");
    [score.before.tool_error_m, after.tool_error_m, after.reach_error_m]
        .map(|s| s.expect("targets were reached").median)
}

fn calibration_brings_the_tool_to_its_targets(seeds: std::ops::RangeInclusive<u64>) {
    let (mut tool_m, mut reach_m) = (Vec::new(), Vec::new());
    for seed in seeds {
        let summary = if seed == 1 {
            shared(&ShortRoutine::default()).summary()
        } else {
            let folder = temp();
            Simulated::of(&ShortRoutine { seed, ..ShortRoutine::default() }, folder.path()).finished().summary.clone()
        };
        assert_eq!(summary.status, Status::Accepted);
        assert_eq!(summary.capture.collisions, Some(0), "seed {seed}");
        let [before_m, after_m, miss_m] = medians(&summary);
        eprintln!("seed {seed}: tool {:.1} to {:.2} mm, miss {:.2} mm", before_m * 1e3, after_m * 1e3, miss_m * 1e3);
        assert!(after_m < RATIO * before_m, "seed {seed}: {before_m} {after_m}");
        tool_m.push(after_m);
        reach_m.push(miss_m);
    }
    let [tool_m, reach_m] = [tool_m, reach_m].map(|values| quantile(&values, 0.5).expect("seeds"));
    assert!(tool_m < TOOL_ERROR_M, "{tool_m}");
    assert!(reach_m < REACH_ERROR_M, "{reach_m}");
}

#[test]
fn calibration_brings_the_tool_where_it_is_told() {
    calibration_brings_the_tool_to_its_targets(1..=2);
}

#[test]
#[ignore = "second tier: 5 seeds of the closed loop, 9 s"]
fn calibration_brings_the_tool_where_it_is_told_for_each_of_five_seeds() {
    calibration_brings_the_tool_to_its_targets(1..=5);
}

/// Runs a routine of the project.
fn run_of(name: &str, out: &Path) -> Simulated {
    Simulated::new(&root().join("routines").join(name), None, &[], out)
}

/// Without its sag this arm would have 7 mm of error. The estimator's inputs do not include the simulator's bending.
#[test]
fn an_arm_that_bends_is_calibrated_with_its_sag() {
    let folder = temp();
    let run = run_of("heavy-arm.toml", folder.path());
    let (summary, calibration) = (&run.finished().summary, &run.finished().calibration);
    let [before_m, after_m, _] = medians(summary);
    eprintln!(
        "tool {:.1} to {:.2} mm, {} targets skipped",
        before_m * 1e3,
        after_m * 1e3,
        summary.capture.targets_skipped
    );
    assert_eq!((summary.capture.collisions, summary.status), (Some(0), Status::Accepted));
    assert!(after_m < 2.5e-3 && summary.capture.targets_skipped <= 2, "{after_m}");
    assert!(calibration.sag.is_some(), "no sag was estimated");

    let told =
        |bytes: &[u8]| ["payload", "compliance", "structure"].map(|word| String::from_utf8_lossy(bytes).contains(word));
    let recording = run.file("run");
    for_each_raw(&recording, |raw| assert_eq!(told(raw.data), [false; 3], "{}", raw.topic())).expect("it reads");
    for (name, bytes) in read_attachments(&recording).expect("it reads") {
        assert_eq!(told(&bytes), [false; 3], "{name}");
    }

    // The estimated arm bends in the replay, too, if its calibration is present.
    let alone = temp();
    std::fs::copy(&recording, alone.path().join("run.mcap")).expect("copied");
    let replayed = |folder: &Path| {
        let saved = folder.join("replay.rrd");
        answer(program().arg("replay").arg(folder.join("run.mcap")).arg("--save").arg(&saved)).expect("replay", 0, &[]);
        std::fs::read(saved).expect("written")
    };
    let straight = replayed(alone.path());
    write(&alone.path().join("calibration.toml"), &calibration.to_toml());
    assert!(replayed(alone.path()) != straight);
}

/// On the seabed, where most such arms work.
#[test]
fn an_arm_on_a_parked_vehicle_is_calibrated() {
    let folder = temp();
    let run = run_of("parked.toml", folder.path());
    let summary = &run.finished().summary;
    let [before_m, after_m, _] = medians(summary);
    eprintln!("tool {:.1} to {:.2} mm", before_m * 1e3, after_m * 1e3);
    assert_eq!((summary.capture.collisions, summary.status), (Some(0), Status::Accepted));
    assert!(after_m < 3e-3 && after_m < RATIO * before_m, "{after_m}");
}

/// A contact is detected: without this test "no contact" above would prove nothing.
#[test]
fn an_arm_driven_into_the_vehicle_is_in_the_truth_file() {
    let robot = titan();
    let vehicle = armcal::robot::load_vehicle(&vehicle_file()).expect("the vehicle reads");
    let scene = armcal::routine::Scene::default();
    let spec = WorldSpec::default();
    let mut world =
        World::new(WorldInput { robot: &robot, vehicle: &vehicle, scene: &scene, spec, seed: 1 }).expect("a world");
    let folder = temp();
    let file = folder.path().join("truth.mcap");
    world.set_truth_sink(Box::new(TruthRecorder::create(&file).expect("a file"))).expect("accepted");
    // 0.15 m below the face of the starboard toe plate.
    let goal = IkGoal { position_m: Vector3::new(1.34, -0.1, -1.14) };
    let turn = JointLimits { lower_rad: -3.1, upper_rad: 3.1 };
    let limits = robot.chain.joints().iter().map(|j| j.limits.unwrap_or(turn)).collect();
    let settings = IkSettings { limits, locked: vec![false; 6], tolerance_m: 1e-3, max_iterations: 500 };
    let angles =
        solve_position(&robot.chain, &robot.tool.mount, &goal, &robot.stowed, &settings).expect("within reach");
    world.command(&armcal::sensor::ArmSensors::nominal(&robot).counts(&angles)).expect("accepted");
    Nowhere::watch(&mut world, 12.0);
    world.finish_truth().expect("finished");
    let truth = read_truth(&file).expect("it reads");
    eprintln!("{} contacts, first {:?}", truth.contacts.len(), truth.contacts.first());
    let drawn: Vec<&str> = vehicle.parts.iter().map(|part| part.name.as_str()).collect();
    let touches = |name: &str| drawn.contains(&name);
    assert!(truth.contacts.iter().any(|c| touches(&c.part_a) || touches(&c.part_b)), "{:?}", truth.contacts);
    assert!(truth.min_clearance_m().is_some_and(|distance_m| distance_m < 1e-3));
}

/// Between states a second apart the arm may have been anywhere, so a score from them could use a pose that never
/// occurred.
#[test]
fn a_truth_that_is_too_coarse_tells_no_state() {
    let mut truth = read_truth(shared_run().file("truth.mcap")).expect("it reads");
    let middle = |states: &[armcal::sim::truth::TruthState], n: usize| {
        states[n].stamp.plus_s(0.5 * states[n + 1].stamp.since_s(states[n].stamp))
    };
    let stamp = middle(&truth.states, 200);
    let fine = truth.state_at(stamp).expect("between two states");
    assert!(fine.stamp == stamp);
    truth.states = truth.states.iter().step_by(50).copied().collect();
    assert!(truth.state_at(middle(&truth.states, 4)).is_none());
    assert!(truth.state_at(truth.states[4].stamp).is_some(), "one of its own stamps");
}
