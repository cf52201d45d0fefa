//! Recordings of many hours: memory grows with the number of views, not with the hours.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use armcal::log::{RecordingHeader, RecordingWriter};
use armcal::stats::stream_rng;
use armcal::streams::{
    Attitude, CaptureSet, JointCommand, JointSensorSample, JointStateBelief, Mark, Message, Sink, TagDetection,
    TagDetections, TemperatureSample, Thermometer,
};
use armcal::time::{SIMULATION_EPOCH, Stamp};

use crate::support::synthetic::{Shot, TrueArm, add_noise, normal};
use crate::support::{answer, program, read, robot_folder, temp, titan};

/// Period of the joint sensors; other streams come every few of them.
const PERIOD_S: f64 = 0.01;

/// Writes a recording of `hours` with few views: an arm that mostly stands still, with all its streams.
fn write_long(path: &Path, hours: f64) {
    let robot = titan();
    let mut rng = stream_rng(3, "long");
    let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
    let mut shots = arm.shots(CaptureSet::Fit, 30, &mut rng);
    shots.extend(arm.shots(CaptureSet::HeldOut, 10, &mut rng));
    add_noise(&mut shots, 0.2, &mut rng);
    let mut writer = RecordingWriter::create(path, RecordingHeader::new(robot.joint_names())).expect("a file");
    let steps_per_shot = (hours * 3600.0 / PERIOD_S) as u32 / shots.len() as u32;
    let views = arm.messages(&shots);
    let (task, views) = views.split_first().expect("a task");
    writer.record(task.0, &task.1).expect("recorded");
    for (k, (shot, view)) in shots.iter().zip(views.chunks(3)).enumerate() {
        let start = SIMULATION_EPOCH.plus_s(f64::from(steps_per_shot) * k as f64 * PERIOD_S);
        for step in 0..steps_per_shot {
            let noise: [f64; 6] = std::array::from_fn(|_| normal(&mut rng));
            for message in standing(&arm, shot, step, start.plus_s(f64::from(step) * PERIOD_S), &noise) {
                writer.record(start.plus_s(f64::from(step) * PERIOD_S), &message).expect("recorded");
            }
        }
        // The span of a view is half a second; it ends with the last reading.
        let (_, Message::Mark(mark)) = &view[2] else { panic!("no mark") };
        let end = start.plus_s(f64::from(steps_per_shot - 1) * PERIOD_S);
        writer.record(end, &Message::Mark(Mark { start: end.plus_s(-0.5), end, kind: mark.kind })).expect("recorded");
    }
    writer.finish().expect("finished");
}

/// The messages of one step of an arm that stands.
fn standing(arm: &TrueArm<'_>, shot: &Shot, step: u32, stamp: Stamp, noise: &[f64; 6]) -> Vec<Message> {
    let mut counts = arm.counts(&shot.angles);
    counts.iter_mut().zip(noise).for_each(|(count, noise)| *count = (*count + noise).round());
    let mut messages = vec![Message::JointSensors(JointSensorSample { stamp, counts })];
    if step.is_multiple_of(4) {
        messages.push(Message::JointCommand(JointCommand { stamp, counts }));
        messages.push(Message::JointStates(JointStateBelief { stamp, angles: shot.angles }));
    }
    if step.is_multiple_of(5) {
        let [x, y, z, ..] = noise.map(|noise| 1e-3 * noise);
        messages.push(Message::Attitude(Attitude {
            stamp,
            quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
            angular_velocity_rad_s: [x, y, z],
            specific_force_m_s2: [x, y, 9.81],
        }));
    }
    if step.is_multiple_of(20) {
        let tag = |&(id, corners_px): &(u32, _)| TagDetection { id, corners_px, decision_margin: 60.0 + noise[0] };
        messages.push(Message::Detections(TagDetections { stamp, tags: shot.tags.iter().map(tag).collect() }));
    }
    if step.is_multiple_of(100) {
        for (thermometer, temperature_c) in [(Thermometer::Oil, 31.0), (Thermometer::Water, 4.0)] {
            let temperature_c = temperature_c + 0.01 * noise[1];
            messages.push(Message::Temperature(TemperatureSample {
                stamp,
                thermometer,
                temperature_c,
                variance_c2: 0.1,
            }));
        }
    }
    messages
}

/// Peak memory of a program, kB, its time and its exit code.
fn measured(command: &mut Command, said: &Path) -> (u64, Duration, i32) {
    let started = Instant::now();
    let said = fs::File::create(said).expect("a file");
    let mut child = command.stdout(said).spawn().expect("started");
    let (file, mut most_kb) = (format!("/proc/{}/status", child.id()), 0);
    loop {
        let status = fs::read_to_string(&file).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kb = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
        most_kb = most_kb.max(kb.unwrap_or(0));
        if let Some(status) = child.try_wait().expect("waited for") {
            return (most_kb, started.elapsed(), status.code().expect("an exit code"));
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// `ARMCAL_LONG_HOURS=10 cargo test --release --test main hours_of_readings -- --nocapture` for a longer one.
#[test]
fn hours_of_readings_cost_no_memory() {
    let hours = std::env::var("ARMCAL_LONG_HOURS").ok().and_then(|hours| hours.parse().ok()).unwrap_or(1.0);
    let folder = temp();
    let recording = folder.path().join("long.mcap");
    write_long(&recording, hours);
    let bytes = fs::metadata(&recording).expect("written").len();
    let mut command = program();
    command.arg("calibrate").arg(&recording).arg("--robot").arg(robot_folder()).arg("--out").arg(folder.path());
    let said = folder.path().join("said.txt");
    let (most_kb, time, code) = measured(&mut command, &said);
    eprintln!("{hours} h, {} MB: {} MB, {:.1} s", bytes >> 20, most_kb >> 10, time.as_secs_f64());
    assert_eq!(code, 0, "{}", read(&said));
    assert!(most_kb < 80 << 10, "{most_kb} kB");
    // An hour kept in memory is 42 MB.
    assert!(most_kb < 50 << 10 || hours > 1.0, "{most_kb} kB");
    if hours <= 1.0 {
        let mut replay = program();
        replay.arg("replay").arg(&recording).arg("--robot").arg(robot_folder());
        let said = answer(replay.arg("--save").arg(folder.path().join("long.rrd")));
        said.expect("a replay", 0, &["of /joint_sensors"]);
    }
    let keep = std::env::var_os("ARMCAL_LONG_KEEP");
    keep.map(|path| fs::copy(&recording, path).expect("copied"));
}
