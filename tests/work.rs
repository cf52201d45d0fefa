//! Work on a dive: targets at given times, tags passed on the way, and a world that changes meanwhile.

use std::path::Path;

use armcal::log::{Recording, read_recording};
use armcal::report::RunSummary;
use armcal::say::FindingKind;
use armcal::streams::{JointCommand, MarkKind, Message, ReachAttempt};
use armcal::time::Stamp;

use crate::support::texts::Texts;
use crate::support::{
    FinishedRun, ShortRoutine, Simulated, answer, calibrate, program, read, robot_folder, run, shared, temp, write,
};

const EVERY_S: f64 = 120.0;
/// Task 1 passes no tags because its time is in the gap; task 3 does.
const STEPS: &str = "
    [[step]]
    do = \"capture\"
    poses = 11
    held_out = 3
    [[step]]
    do = \"calibrate\"
    [[step]]
    do = \"work\"
    tasks = 4
    every_s = 120.0
    look_every = 2
    look_s = 0.5
    gaps_s = [[100.0, 130.0]]
    rate_rad_s = 0.3
    rest_rad = [-2.0, -0.32, 0.45, 0.85, 0.05, 0.0]
    looks_rad = [[-1.64, -0.73, 0.55, -0.67, -0.25, 0.0], [-1.32, -0.32, -0.36, 0.33, -0.64, 0.0]]
    [world.water]
    dive_time_s = [0.0, 100.0, 400.0]
    dive_depth_m = [0.0, 0.0, 1500.0]
    [world.joint_sensors]
    pressure_offset_std_rad_per_mpa = 1e-3
";

/// One read-only run for all tests of this file.
fn worked() -> &'static FinishedRun {
    shared(&ShortRoutine {
        targets_m: vec![[1.401, -1.220, 0.115], [1.375, -0.582, 0.391], [1.173, -0.947, 0.587]],
        tail: STEPS.to_owned(),
        ..ShortRoutine::default()
    })
}

fn recording() -> Recording {
    read_recording(worked().file("run.mcap")).expect("it reads")
}

/// Start of each task, and its line in the log.
fn tasks(recording: &Recording) -> Vec<(Stamp, String)> {
    let line = |message: &Message| match message {
        Message::Log(line) => Some((line.stamp, line.text.strip_prefix("work: task ")?.to_owned())),
        _ => None,
    };
    recording.messages.iter().filter_map(|(_, message)| line(message)).collect()
}

/// Time and target of each rest of the arm.
fn rests(recording: &Recording) -> Vec<(Stamp, u32)> {
    let rest = |message: &Message| match message {
        Message::Mark(mark) => match mark.kind {
            MarkKind::Reach { attempt: ReachAttempt::After, target_idx } => Some((mark.start, target_idx)),
            _ => None,
        },
        _ => None,
    };
    recording.messages.iter().filter_map(|(_, message)| rest(message)).collect()
}

#[test]
fn tasks_begin_at_their_times_and_pass_tags_in_their_turns() {
    let recording = recording();
    let tasks = tasks(&recording);
    let texts: Vec<&str> = tasks.iter().map(|(_, text)| text.as_str()).collect();
    assert_eq!(texts, ["1 of 4, target 1", "2 of 4, target 2", "3 of 4, target 3", "4 of 4, target 1 by look 2"]);
    for pair in tasks[1..].windows(2) {
        assert!((pair[1].0.since_s(pair[0].0) - EVERY_S).abs() < 0.1, "{pair:?}");
    }
    assert_eq!(rests(&recording).iter().map(|(_, target)| *target).collect::<Vec<_>>(), [0, 1, 2, 0]);
    let images_with_tags = |from: &Stamp| {
        let sees = |message: &Message| match message {
            Message::Detections(image) if !image.tags.is_empty() => {
                (0.0..EVERY_S).contains(&image.stamp.since_s(*from))
            }
            _ => false,
        };
        recording.messages.iter().filter(|(_, message)| sees(message)).count()
    };
    let seen: Vec<usize> = tasks.iter().map(|(began, _)| images_with_tags(began)).collect();
    // Three images come at rest; the others were taken on the way.
    assert!(seen[..3] == [0, 0, 0] && seen[3] > 12, "{seen:?}");
}

#[test]
fn between_tasks_the_arm_idles_and_in_them_it_is_as_slow_as_asked() {
    let recording = recording();
    let (tasks, rests) = (tasks(&recording), rests(&recording));
    let (from, to) = (rests[1].0.plus_s(30.0), tasks[2].0.plus_s(-5.0));
    let is_reading = |message: &Message| matches!(message, Message::JointSensors(_));
    let readings = recording.messages.iter().filter(|(at, message)| is_reading(message) && *at > from && *at < to);
    let (readings, seconds) = (readings.count() as f64, to.since_s(from));
    assert!(seconds > 20.0 && readings < 1.1 * seconds + 2.0, "{readings} readings in {seconds} s");
    let robot = armcal::load_robot(&robot_folder()).expect("it reads");
    let commands: Vec<_> = recording
        .messages
        .iter()
        .filter_map(|(_, message)| match message {
            Message::JointCommand(command) if command.stamp > tasks[0].0 => Some(command),
            _ => None,
        })
        .collect();
    let rate = |pair: &[&JointCommand]| {
        let seconds = pair[1].stamp.since_s(pair[0].stamp);
        let joint = |j: usize| {
            let sensor = &robot.sensors[j];
            let half = 0.5 * sensor.wrap_counts;
            let counts = (pair[1].counts[j] - pair[0].counts[j] + half).rem_euclid(sensor.wrap_counts) - half;
            (counts / sensor.counts_per_rad / seconds).abs()
        };
        (0..robot.n_joints()).map(joint).fold(0.0, f64::max)
    };
    let fastest = commands.windows(2).map(rate).fold(0.0, f64::max);
    // The rate is by the datasheet's scale, which has at most 5 % of error.
    assert!((0.27..0.32).contains(&fastest), "{fastest} rad/s");
}

/// At 15 MPa, with 1 mrad per MPa, the sensors are wrong at depth, and the score gives the error with its time.
#[test]
fn each_task_is_scored_with_its_time() {
    let score = worked().summary().score.expect("scored");
    let rests = rests(&recording());
    assert_eq!(score.work.len(), rests.len());
    for (task, (at, target)) in score.work.iter().zip(&rests) {
        assert_eq!((task.step, task.target), (3, *target as usize));
        assert!((task.time_s - at.since_s(armcal::time::SIMULATION_EPOCH)).abs() < 0.02, "{task:?} {at:?}");
    }
    let errors_m: Vec<f64> = score.work.iter().map(|task| task.tool_error_m).collect();
    let of_step = score.reaches.last().and_then(|reach| reach.side.tool_error_m).expect("reached");
    assert_eq!((of_step.n, of_step.max), (4, errors_m.iter().copied().fold(0.0, f64::max)));
    assert!(errors_m[0] < 0.01 && errors_m[3] > 0.01, "{errors_m:?}");
}

#[test]
fn work_changes_nothing_of_the_calibration_before_it() {
    let again = temp();
    calibrate(&worked().file("run.mcap"), &robot_folder(), again.path()).expect("from the recording", 0, &["ACCEPTED"]);
    assert!(read(&again.path().join("calibration.toml")) == read(&worked().file("calibration.toml")));
}

/// Hours without tags at great depth, with a tolerance of 8 mm: the arm looks at tags before a task that would miss it.
/// It works by its estimate of that moment, and logs it.
#[test]
fn calibration_poses_are_asked_for_where_a_task_would_miss() {
    let _texts = Texts::of("calibration_poses_are_asked_for_where_a_task_would_miss");
    let steps = STEPS
        .replace("look_every = 2", "look_every = 1000\n    belief = \"online\"")
        .replace("tasks = 4", "tasks = 6")
        .replace("pressure_offset_std_rad_per_mpa = 1e-3", "pressure_offset_std_rad_per_mpa = 4e-4");
    let short = ShortRoutine {
        targets_m: vec![[1.401, -1.220, 0.115], [1.375, -0.582, 0.391], [1.173, -0.947, 0.587]],
        tail: steps,
        ..ShortRoutine::default()
    };
    let folder = temp();
    let text = short.text().replace("tolerance_m = 0.03", "tolerance_m = 0.008");
    let file = folder.path().join("asked.toml");
    write(&file, &text);
    let out = folder.path().join("out");
    run(&file, &out).expect("a dive", 0, &["asked"]);
    let summary: RunSummary = serde_json::from_str(&read(&out.join("summary.json"))).expect("a summary");
    let online = summary.online.expect("it was followed");
    assert!((1..=3).contains(&online.asked.len()), "{online:?}");
    for asked in &online.asked {
        let [before_m, after_m] = asked.u95_m.expect("of a target");
        assert!(before_m > 0.008 && after_m < 0.008 && asked.views == 2, "{asked:?}");
    }
    let work = summary.score.expect("scored").work;
    assert!(work.len() == 6 && work.iter().all(|task| task.tool_error_m < 0.008), "{work:?}");
    // The recording gives the run's online estimates again.
    let followed = folder.path().join("followed");
    let mut again = program();
    again.arg("watch").arg(out.join("run.mcap")).arg("--robot").arg(robot_folder());
    answer(again.arg("--out").arg(&followed)).expect("the recording", 0, &[]);
    let last = |folder: &Path| read(&folder.join("belief.jsonl")).lines().last().map(str::to_owned);
    assert_eq!(last(&out), last(&followed));
}

#[test]
fn work_by_the_calibration_asks_for_nothing() {
    let summary = worked().summary();
    assert!(summary.online.is_none() && !worked().file("belief.jsonl").exists());
}

/// A sensor that slips between tasks is named when tags are passed next, and no other fault is named. The study of
/// dives with faults is in the second tier (`online`).
#[test]
fn a_slip_between_tasks_is_named() {
    const BY_RAD: f64 = 0.03;
    let steps = STEPS
        .replace("look_every = 2", "look_every = 1\n    belief = \"online\"")
        .replace("pressure_offset_std_rad_per_mpa = 1e-3", "")
        + &format!(
            "[[world.fault]]\nat_s = 350.0\nkind = \"sensor_jump\"\njoint = \"wrist_pitch\"\nby_rad = {BY_RAD}\n"
        );
    let short = ShortRoutine {
        targets_m: vec![[1.401, -1.220, 0.115], [1.375, -0.582, 0.391], [1.173, -0.947, 0.587]],
        tail: steps,
        ..ShortRoutine::default()
    };
    let folder = temp();
    let run = Simulated::of(&short, folder.path());
    let online = run.finished().summary.online.as_ref().expect("it was followed");
    let [event] = &online.events[..] else { panic!("{:?}", online.events) };
    assert_eq!((event.finding.kind, event.finding.name.as_str()), (FindingKind::SensorSlip, "wrist_pitch"));
    assert!((event.finding.size.expect("a size").abs() - BY_RAD).abs() < 0.005, "{event:?}");
}

/// Five tasks worked by the online estimate; the wrist's sensor dies at the fourth. `faults` adds further ones.
fn with_a_dead_wrist(faults: &str) -> ShortRoutine {
    let steps = STEPS
        .replace("look_every = 2", "look_every = 1000\n    belief = \"online\"")
        .replace("tasks = 4", "tasks = 5")
        .replace("pressure_offset_std_rad_per_mpa = 1e-3", "")
        + "[[world.fault]]\nat_s = 400.0\nkind = \"sensor_dead\"\njoint = \"wrist_pitch\"\n"
        + faults;
    ShortRoutine {
        targets_m: vec![[1.401, -1.220, 0.115], [1.375, -0.582, 0.391], [1.173, -0.947, 0.587]],
        tail: steps,
        ..ShortRoutine::default()
    }
}

/// A wrist whose sensor dies is abandoned, located by the camera, and held: no task has an error above the tolerance.
#[test]
fn with_a_dead_sensor_the_arm_does_only_what_it_knows() {
    let _texts = Texts::of("with_a_dead_sensor_the_arm_does_only_what_it_knows");
    let folder = temp();
    let out = folder.path().join("out");
    let routine = with_a_dead_wrist("").write(folder.path());
    run(&routine, &out).expect("a dead wrist", 0, &["wrist_pitch (dead)"]);
    let summary: RunSummary = serde_json::from_str(&read(&out.join("summary.json"))).expect("a summary");
    let asked = summary.online.expect("it was followed").asked;
    assert!(asked.iter().any(|asked| asked.u95_m.is_none() && asked.views > 10), "looked for: {asked:?}");
    let (work, skipped) = (summary.score.expect("scored").work, summary.capture.skipped_targets);
    assert!(work.len() >= 3 && work.len() + skipped.len() == 5, "{work:?} {skipped:?}");
    assert!(work.iter().all(|task| task.tool_error_m < 0.03), "{work:?}");
}

/// All tags are gone, too: the wrist's angle is unknown, and the dive continues without it. A calibration from the
/// recording equals the earlier one.
#[test]
fn a_dive_goes_on_where_no_view_shows_where_a_dead_joint_stands() {
    let _texts = Texts::of("a_dive_goes_on_where_no_view_shows_where_a_dead_joint_stands");
    let lost = |id: u32| format!("[[world.fault]]\nat_s = 400.0\nkind = \"tag_lost\"\nid = {id}\n");
    let faults: String = (0..8).map(lost).collect();
    let folder = temp();
    let out = folder.path().join("out");
    let routine = with_a_dead_wrist(&faults).write(folder.path());
    // The exit code says that the tool is not known well enough at the end.
    run(&routine, &out).expect("a lost wrist", 4, &["wrist_pitch"]);
    let again = folder.path().join("again");
    calibrate(&out.join("run.mcap"), &robot_folder(), &again).expect("the calibration before", 0, &["ACCEPTED"]);
    let hash = |folder: &Path| {
        let text = read(&folder.join("calibration.toml"));
        text.lines().find(|line| line.starts_with("messages_hash")).map(str::to_owned)
    };
    assert!(hash(&out).is_some());
    assert_eq!(hash(&again), hash(&out));
}
