//! Replay of a small made-up run.

mod beside_the_arm;
mod live_view;

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::*;
use armcal_core::kinematics::{IkGoal, IkSettings, JointLimits, LinkCorrections, solve_position};
use armcal_core::log::{Recording, RecordingHeader, RecordingWriter, RosMessage, read_recording, ros};
use armcal_core::robot::{Hull, Part, PlacedShape, Robot, Shape};
use armcal_core::routine::Scene;
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::{
    CameraImage, CaptureSet, DetectionReject, DetectionRejects, GripperSample, JointAngles, JointSensorSample,
    JointStateBelief, LogLevel, LogLine, Mark, MarkKind, Message, Phase, ReachAttempt, ReachTask, RejectReason, Sink,
    TagDetection, TagDetections, TemperatureSample, Thermometer, ToolTouch,
};
use armcal_core::time::SIMULATION_EPOCH;

/// Errors of the joint sensors before and after the made-up calibration, rad.
const ERROR_BEFORE_RAD: [f64; 6] = [0.03, -0.035, 0.05, -0.02, 0.04, 0.03];
const ERROR_AFTER_RAD: [f64; 6] = [0.0006, -0.0005, 0.0008, 0.0004, -0.0006, 0.03];

fn robots() -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots")
}

/// Leg of the run: to `goal` by the estimate, then a rest in which something is marked.
struct Leg {
    goal: JointAngles,
    move_s: f64,
    rest_s: f64,
    phase: Phase,
    mark: Option<MarkKind>,
}

/// A run that is fabricated leg by leg.
struct Fabric {
    robot: Robot,
    run: RecordingWriter,
    truth: RecordingWriter,
    time_s: f64,
    at: JointAngles,
    error_rad: [f64; 6],
}

impl Fabric {
    fn record(&mut self, message: &Message) {
        self.run.record(SIMULATION_EPOCH.plus_s(self.time_s), message).unwrap();
    }

    fn phase(&mut self, phase: Phase) {
        let stamp = SIMULATION_EPOCH.plus_s(self.time_s);
        self.record(&Message::Mark(Mark { start: stamp, end: stamp, kind: MarkKind::Phase(phase) }));
    }

    fn say(&mut self, level: LogLevel, text: &str) {
        let stamp = SIMULATION_EPOCH.plus_s(self.time_s);
        self.record(&Message::Log(LogLine { stamp, level, name: "session".into(), text: text.into() }));
    }

    fn leg(&mut self, leg: &Leg) {
        let (from, step_s) = (self.at, 0.02);
        self.phase(Phase::Move);
        for n in 1..=(leg.move_s / step_s) as u32 {
            let share = f64::from(n) * step_s / leg.move_s;
            let smooth = share * share * (3.0 - 2.0 * share);
            self.at = JointAngles::from_fn(6, |j| from[j] + smooth * (leg.goal[j] - from[j]));
            self.step(step_s, n);
        }
        self.at = leg.goal;
        self.phase(leg.phase);
        let start = SIMULATION_EPOCH.plus_s(self.time_s);
        for n in 1..=(leg.rest_s / step_s) as u32 {
            self.step(step_s, n);
        }
        let end = SIMULATION_EPOCH.plus_s(self.time_s);
        if let Some(kind) = leg.mark {
            self.record(&Message::Mark(Mark { start, end, kind }));
        }
    }

    fn step(&mut self, step_s: f64, n: u32) {
        self.time_s += step_s;
        let stamp = SIMULATION_EPOCH.plus_s(self.time_s);
        let actual = JointAngles::from_fn(6, |j| self.at[j] - self.error_rad[j]);
        let counts = ArmSensors::nominal(&self.robot).counts(&actual);
        self.record(&Message::JointSensors(JointSensorSample { stamp, counts }));
        self.record(&Message::JointStates(JointStateBelief { stamp, angles: self.at }));
        self.tell_truth(&actual);
        if n.is_multiple_of(5) {
            self.look(&actual);
        }
        if n.is_multiple_of(50) {
            let warm = 12.0 + 9.0 * (1.0 - (-self.time_s / 60.0).exp());
            for (thermometer, temperature_c) in [(Thermometer::Oil, warm), (Thermometer::Water, 4.2)] {
                let sample = TemperatureSample { stamp, thermometer, temperature_c, variance_c2: 0.01 };
                self.record(&Message::Temperature(sample));
            }
        }
    }

    fn tell_truth(&mut self, actual: &JointAngles) {
        let log_time = SIMULATION_EPOCH.plus_s(self.time_s);
        let header = ros::Header { stamp: log_time.try_into().unwrap(), frame_id: "base_link".into() };
        let joints = ros::JointState {
            header: header.clone(),
            name: self.robot.joint_names(),
            position: actual.to_vec(),
            ..Default::default()
        };
        self.truth.write_ros("/truth/joint_states", &ros::JointState::SCHEMA, log_time, &joints).unwrap();
        let sway = (0.4 * self.time_s).sin();
        let vehicle = Isometry3::from_parts(
            Translation3::new(0.01 * sway, 0.005 * sway, 0.01 * sway),
            UnitQuaternion::from_euler_angles(0.01 * sway, 0.005 * sway, 0.0),
        );
        let tool = self.robot.chain.link_poses(actual).frame(&self.robot.tool.mount);
        for (topic, pose) in [("/truth/vehicle_pose", vehicle), ("/truth/tool_pose", tool)] {
            let pose = ros::PoseStamped { header: header.clone(), pose: ros_pose(&pose) };
            self.truth.write_ros(topic, &ros::PoseStamped::SCHEMA, log_time, &pose).unwrap();
        }
    }

    fn look(&mut self, actual: &JointAngles) {
        let camera = &self.robot.camera;
        let base_from_camera = self.robot.chain.link_poses(actual).frame(&camera.mount);
        let mut tags = Vec::new();
        for tag in &self.robot.tags {
            let camera_from_tag = base_from_camera.inv_mul(tag.base_from_tag.isometry());
            let normal = camera_from_tag.rotation * Vector3::z();
            let corners = armcal_core::optics::square_corners(tag.size_m)
                .map(|corner| camera.lens.project(&(camera_from_tag * corner).coords));
            if let [Some(a), Some(b), Some(c), Some(d)] = corners
                && normal.dot(&camera_from_tag.translation.vector) < 0.0
                && [a, b, c, d].iter().all(|pixel| camera.lens.contains(pixel))
            {
                let corners_px = [a, b, c, d].map(Into::into);
                tags.push(TagDetection { id: tag.id, corners_px, decision_margin: 60.0 });
            }
        }
        let stamp = SIMULATION_EPOCH.plus_s(self.time_s);
        self.record(&Message::Detections(TagDetections { stamp, tags }));
    }
}

fn ros_pose(pose: &Isometry3<f64>) -> ros::Pose {
    let (t, q) = (pose.translation.vector, pose.rotation);
    let orientation = ros::Quaternion { x: q.i, y: q.j, z: q.k, w: q.w };
    ros::Pose { position: [t.x, t.y, t.z].into(), orientation }
}

/// Returns joint angles that bring the estimated tool to a target.
fn reaching(robot: &Robot, target_m: [f64; 3]) -> JointAngles {
    let limits = robot
        .chain
        .joints()
        .iter()
        .map(|joint| joint.limits.unwrap_or(JointLimits { lower_rad: -3.0, upper_rad: 3.0 }));
    let settings = IkSettings {
        limits: limits.collect(),
        locked: vec![false, false, false, false, false, true],
        tolerance_m: 1e-6,
        max_iterations: 500,
    };
    let goal = IkGoal { position_m: Vector3::from(target_m) };
    solve_position(&robot.chain, &robot.tool.mount, &goal, &robot.stowed, &settings).unwrap_or(robot.stowed)
}

/// Writes the files of a run with `n_views` views in `dir`: reach, look about, calibrate, reach again.
fn fabricate(dir: &Path, n_views: u32) -> (PathBuf, PathBuf) {
    let robot = armcal_core::robot::load(&robots().join("titan4")).unwrap();
    let (run_path, truth_path) = (dir.join("run.mcap"), dir.join("truth.mcap"));
    let header = || RecordingHeader::new(robot.joint_names());
    let mut fabric = Fabric {
        run: RecordingWriter::create(&run_path, header()).unwrap(),
        truth: RecordingWriter::create(&truth_path, header()).unwrap(),
        at: robot.stowed,
        robot: robot.clone(),
        time_s: 0.0,
        error_rad: ERROR_BEFORE_RAD,
    };
    let targets_m = vec![[0.9, 0.4, -0.3], [1.1, 0.0, -0.1], [1.0, 0.7, 0.0], [1.2, 0.3, 0.2]];
    let task =
        ReachTask { stamp: SIMULATION_EPOCH, targets_m: targets_m.clone(), tolerance_m: 0.01, poses: Vec::new() };
    fabric.record(&Message::Task(task));
    fabric.phase(Phase::Plan);
    fabric.say(LogLevel::Info, "reach task before calibration, 4 targets");
    for attempt in [ReachAttempt::Before, ReachAttempt::After] {
        for (n, target) in targets_m.iter().enumerate() {
            let mark = Some(MarkKind::Reach { attempt, target_idx: n as u32 });
            let goal = reaching(&robot, *target);
            fabric.leg(&Leg { goal, move_s: 2.0, rest_s: 1.0, phase: Phase::Reach, mark });
        }
        if attempt == ReachAttempt::Before {
            look_about(&mut fabric, n_views);
            fabric.phase(Phase::Calibrate);
            fabric.say(LogLevel::Info, "calibrating from the recording");
            fabric.leg(&Leg { goal: robot.stowed, move_s: 1.0, rest_s: 0.5, phase: Phase::Calibrate, mark: None });
            fabric.error_rad = ERROR_AFTER_RAD;
            fabric.say(LogLevel::Warn, "wrist_rotate cannot be calibrated from this camera");
        }
    }
    fabric.phase(Phase::Done);
    fabric.run.finish().unwrap();
    fabric.truth.finish().unwrap();
    (run_path, truth_path)
}

fn look_about(fabric: &mut Fabric, n_views: u32) {
    let stowed = fabric.robot.stowed;
    for n in 0..n_views {
        let spread = |j: usize| (f64::from(n) * 1.7 + j as f64 * 2.1).sin() * 0.3;
        let goal = JointAngles::from_fn(6, |j| stowed[j] + if j == 1 { -spread(j).abs() } else { spread(j) });
        let set = if n % 4 == 3 { CaptureSet::HeldOut } else { CaptureSet::Fit };
        let mark = Some(MarkKind::Capture { set, pose_idx: n });
        fabric.leg(&Leg { goal, move_s: 1.6, rest_s: 0.8, phase: Phase::Capture, mark });
    }
}

fn small() -> (tempfile::TempDir, Recording, PathBuf, Robot) {
    let dir = tempfile::tempdir().unwrap();
    let (run, truth) = fabricate(dir.path(), 1);
    let recording = read_recording(&run).unwrap();
    let robot = armcal_core::robot::load(&robots().join("titan4")).unwrap();
    (dir, recording, truth, robot)
}

fn input<'a>(recording: &'a Recording, robot: &'a Robot) -> ReplayInput<'a> {
    ReplayInput {
        recording,
        truth: None,
        robot,
        vehicle: None,
        scene: None,
        believed_links: &[],
        tool_beliefs: &[],
        residuals: &[],
        clearance_m: None,
        online: None,
        summary_markdown: None,
    }
}

/// Returns the chunks of the recording in a file, as Rerun's own decoder reads it.
fn chunks(rrd: &Path) -> Vec<crate::rerun::log::Chunk> {
    use re_log_encoding::DecoderApp;
    let file = std::io::BufReader::new(std::fs::File::open(rrd).unwrap());
    let mut chunks = Vec::new();
    for message in DecoderApp::decode_eager(file).unwrap() {
        if let crate::rerun::log::LogMsg::ArrowMsg(store, message) = message.unwrap()
            && store.is_recording()
        {
            chunks.push(crate::rerun::log::Chunk::from_arrow_msg(&message).unwrap());
        }
    }
    chunks
}

/// Returns the entities of the recording in a file with their number of rows.
fn entities(rrd: &Path) -> std::collections::BTreeMap<String, usize> {
    let mut entities = std::collections::BTreeMap::new();
    for chunk in chunks(rrd) {
        *entities.entry(chunk.entity_path().to_string()).or_default() += chunk.num_rows();
    }
    entities
}

/// Recorded images are shown, below detections and rejects.
#[test]
fn images_and_rejects_are_shown_where_there_are_any() {
    let dir = tempfile::tempdir().unwrap();
    let (run, out) = (dir.path().join("run.mcap"), dir.path().join("run.rrd"));
    let robot = armcal_core::robot::load(&robots().join("titan4")).unwrap();
    let mut writer = RecordingWriter::create(&run, RecordingHeader::new(robot.joint_names())).unwrap();
    // Only the markers at both ends of a JPEG: nobody decodes it on the way.
    let jpeg = [&[0xff, 0xd8][..], b"not decoded by anybody", &[0xff, 0xd9]].concat();
    let reject = DetectionReject { id: 7, corners_px: [[9.0; 2]; 4], reason: RejectReason::LowContrast };
    for n in 0..40 {
        let stamp = SIMULATION_EPOCH.plus_s(0.2 * f64::from(n));
        writer.record(stamp, &Message::JointStates(JointStateBelief { stamp, angles: robot.stowed })).unwrap();
        if n < 10 {
            writer.record(stamp, &Message::Image(CameraImage { stamp, jpeg: jpeg.clone() })).unwrap();
            let rejects = vec![reject.clone()];
            writer.record(stamp, &Message::Rejects(DetectionRejects { stamp, rejects })).unwrap();
        }
    }
    writer.finish().unwrap();
    let recording = read_recording(&run).unwrap();
    write_rrd(&input(&recording, &robot), &out).unwrap();
    let entities = entities(&out);
    // Ten images and the end of the last; ten rejects, their style and their end.
    assert_eq!(entities.get("/camera/image"), Some(&11), "{entities:?}");
    assert_eq!(entities.get("/camera/rejected"), Some(&12), "{entities:?}");
    assert!(!entities.contains_key("/camera/background"));
    // The viewer panics if one chunk holds images and their end.
    let of_image = chunks(&out).into_iter().filter(|chunk| chunk.entity_path().to_string() == "/camera/image");
    let has = |chunk: &crate::rerun::log::Chunk, archetype: &str| {
        chunk.component_descriptors().any(|c| c.archetype.is_some_and(|name| name.short_name() == archetype))
    };
    let kinds: Vec<_> = of_image.map(|chunk| (has(&chunk, "EncodedImage"), has(&chunk, "Clear"))).collect();
    assert_eq!(kinds, [(true, false), (false, true)]);
}

#[test]
fn a_run_becomes_a_file_that_rerun_reads() {
    let (dir, recording, truth, robot) = small();
    let out = dir.path().join("run.rrd");
    let corners = [-0.5, 0.5].map(|x| [-0.5, 0.5].map(|y| [-0.5, 0.5].map(|z| [x, y, z])));
    let shape = Shape::Hull(Hull::new(corners.as_flattened().as_flattened()).unwrap());
    let placed = PlacedShape { owner_from_shape: Isometry3::identity(), shape, color_rgb: [9; 3] };
    let scene = Scene { seafloor_z_m: None, obstacles: vec![Part { name: "rock".into(), placed }] };
    let shown = ReplayInput { truth: Some(&truth), scene: Some(&scene), ..input(&recording, &robot) };
    write_rrd(&shown, &out).unwrap();
    let entities = entities(&out);
    for entity in [
        "/world/obstacles/hulls/0",
        "/plots/joint_error",
        "/plots/tool_error/believed",
        "/camera/seen",
        "/phase",
        "/summary",
    ] {
        assert!(entities.contains_key(entity), "{entity} is not among {:?}", entities.keys());
    }
    assert!(entities.keys().any(|entity| entity.contains("/believed_arm/6_")));
    assert!(entities["/plots/joint_error"] > 100);
}

/// The estimated arm has the nominal links until links are estimated, and the estimated links from then on.
#[test]
fn the_believed_arm_is_that_of_its_time() {
    let (_dir, recording, _, robot) = small();
    let mut links = LinkCorrections::default();
    links[1].shift_m.x = 0.01;
    let shown = ReplayInput { believed_links: &[(SIMULATION_EPOCH.plus_s(2.0), links)], ..input(&recording, &robot) };
    let run = crate::recording::scene(&shown).unwrap();
    let tool_m = |time_s: f64| run.believed_poses(time_s, &robot.stowed).frame(&robot.tool.mount).translation.vector;
    assert_eq!(tool_m(1.9), robot.chain.frame(&robot.stowed, &robot.tool.mount).translation.vector);
    assert!(((tool_m(2.0) - tool_m(1.9)).norm() - 0.01).abs() < 1e-9);
}

#[test]
fn jaws_move_while_the_arm_rests() {
    let (dir, mut recording, _, robot) = small();
    let rows = |recording: &Recording, name: &str| {
        let out = dir.path().join(name);
        write_rrd(&input(recording, &robot), &out).unwrap();
        let entities = entities(&out);
        let of = |part: &str| {
            let found = entities.iter().find(|(entity, _)| entity.contains(part));
            *found.unwrap_or_else(|| panic!("{part} is not among {:?}", entities.keys())).1
        };
        (of("/base/arm/6_"), of("/base/arm/jaw_0_jaw_left_link"), of("/base/arm/jaw_1_jaw_right_link"))
    };
    let (link, left, right) = rows(&recording, "still.rrd");
    assert!(left == link && right == link, "{link} {left} {right}");
    let (start, end) = (recording.messages[0].0, recording.messages[recording.messages.len() - 1].0);
    let n = (end.since_s(start) * 25.0) as u32;
    for k in 0..n {
        let stamp = start.plus_s(0.04 * f64::from(k));
        let opening_m = 0.1 * f64::from(k) / f64::from(n);
        recording.messages.push((stamp, Message::Gripper(GripperSample { stamp, opening_m })));
    }
    recording.messages.sort_by_key(|(log_time, _)| *log_time);
    let (link, left, right) = rows(&recording, "opening.rrd");
    assert!(left > link + 20 && right == left, "{link} {left} {right}");
}

/// Each touch is shown from its time on, with those before it.
#[test]
fn surfaces_that_were_touched_are_shown() {
    let (dir, mut recording, _, robot) = small();
    let out = dir.path().join("run.rrd");
    let touched = |out: &Path| {
        let entities = entities(out);
        ["point", "normal"].map(|what| entities.get(&format!("/world/vehicle/base/touched/{what}")).copied())
    };
    write_rrd(&input(&recording, &robot), &out).unwrap();
    assert_eq!(touched(&out), [None, None]);
    for n in 1..=3 {
        let stamp = SIMULATION_EPOCH.plus_s(f64::from(n));
        let touch = ToolTouch {
            stamp,
            duration_s: 0.5,
            surface: format!("plate {n}"),
            point_m: [1.0, 0.0, -0.5],
            normal: [0.0, 0.0, 1.0],
            tip_radius_m: 0.02,
            std_m: 0.001,
        };
        recording.messages.push((stamp, Message::Touch(touch)));
    }
    recording.messages.sort_by_key(|(log_time, _)| *log_time);
    write_rrd(&input(&recording, &robot), &out).unwrap();
    assert_eq!(touched(&out), [Some(3), Some(3)]);
}

#[test]
fn what_broke_stands_in_the_log() {
    #[derive(serde::Serialize)]
    struct Fault {
        header: ros::Header,
        kind: &'static str,
        details: &'static str,
    }
    let (dir, recording, _, robot) = small();
    let truth = dir.path().join("faults.mcap");
    let mut writer = RecordingWriter::create(&truth, RecordingHeader::new(Vec::new())).unwrap();
    let schema = armcal_core::log::RosSchema { name: "armcal_msgs/msg/Fault", text: "" };
    let stamp = SIMULATION_EPOCH.plus_s(2.0);
    let header = ros::Header { stamp: stamp.try_into().unwrap(), frame_id: String::new() };
    let fault = Fault { header, kind: "tag_lost", details: "id = 3" };
    writer.write_ros("/truth/faults", &schema, stamp, &fault).unwrap();
    writer.finish().unwrap();
    let out = dir.path().join("run.rrd");
    write_rrd(&ReplayInput { truth: Some(&truth), ..input(&recording, &robot) }, &out).unwrap();
    assert_eq!(entities(&out).get("/log/truth"), Some(&1));
    assert!(entities(&out).contains_key("/fault_tag"), "a lane");
}

/// A recorder's clock that is set a day ahead costs no frames, and the lines end before it.
#[test]
fn a_jump_of_log_time_is_a_gap() {
    let (dir, mut recording, _, robot) = small();
    let rows = |recording: &Recording| {
        let out = dir.path().join("run.rrd");
        write_rrd(&input(recording, &robot), &out).unwrap();
        entities(&out)
    };
    let whole = rows(&recording);
    let half = recording.messages.len() / 2;
    for (log_time, message) in &mut recording.messages[half..] {
        *log_time = log_time.plus_s(86_400.0);
        if let Message::JointStates(states) = message {
            states.stamp = *log_time;
        }
    }
    let jumped = rows(&recording);
    for entity in ["/plots/counts", "/plots/joint_angle/believed"] {
        let more = jumped[entity] - whole[entity];
        // Two seconds at 12.5 Hz, and the end of the line.
        assert!((1..=27).contains(&more), "{entity}: {} {}", whole[entity], jumped[entity]);
    }
    let run = crate::recording::scene(&input(&recording, &robot)).unwrap();
    assert_eq!(run.tracks.gaps().count(), 1);
    assert!(run.tracks.frames().is_sorted());
}

/// Without estimates for a minute, a sensor that slips meanwhile is not drawn as drift.
#[test]
fn a_wait_without_a_belief_ends_the_lines() {
    let (_dir, mut recording, _, robot) = small();
    let half = recording.messages.len() / 2;
    let mut before_s = f64::NAN;
    let start = recording.messages[0].0;
    for (n, (log_time, message)) in recording.messages.iter_mut().enumerate() {
        let Message::JointStates(states) = message else { continue };
        if n < half {
            before_s = states.stamp.since_s(start);
        } else {
            states.stamp = states.stamp.plus_s(60.0);
            *log_time = states.stamp;
        }
    }
    recording.messages.sort_by_key(|(log_time, _)| *log_time);
    let run = crate::recording::scene(&input(&recording, &robot)).unwrap();
    let drawn = crate::plots::believed(&run);
    let ends: Vec<f64> = drawn.iter().filter(|(_, angles)| angles.is_none()).map(|(time_s, _)| *time_s).collect();
    assert!(matches!(ends[..], [end_s] if (end_s - before_s - 2.0).abs() < 0.1), "{ends:?} after {before_s}");
    assert!(drawn.is_sorted_by(|a, b| a.0 < b.0) && drawn.len() > 10);
}

/// Longer recordings are drawn at lower rates.
#[test]
fn days_of_readings_are_drawn_within_a_budget() {
    let (_dir, mut recording, _, robot) = small();
    let (start, first) = recording.messages[0].clone();
    recording.messages = (0..4 * 86_400 / 20).map(|n| (start.plus_s(20.0 * f64::from(n)), first.clone())).collect();
    let run = crate::recording::scene(&input(&recording, &robot)).unwrap();
    let ticks = run.tracks.frames().count();
    assert!((40_000..=90_001).contains(&ticks), "{ticks}");
}

#[test]
fn same_input_gives_the_same_bytes() {
    let (dir, recording, truth, robot) = small();
    let moved = Robot { folder: "elsewhere".into(), ..robot.clone() };
    let (a, b) = (dir.path().join("a.rrd"), dir.path().join("b.rrd"));
    for (robot, out) in [(&robot, &a), (&moved, &b)] {
        write_rrd(&ReplayInput { truth: Some(&truth), ..input(&recording, robot) }, out).unwrap();
    }
    assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap());
}

#[test]
fn without_truth_there_is_one_arm_and_no_error() {
    let (dir, recording, _, robot) = small();
    let out = dir.path().join("run.rrd");
    write_rrd(&input(&recording, &robot), &out).unwrap();
    let entities = entities(&out);
    assert!(entities.keys().any(|entity| entity.contains("/base/arm/6_")));
    assert!(!entities.keys().any(|entity| entity.contains("believed_arm") || entity.contains("error")));
}

#[test]
fn what_cannot_be_shown_is_refused() {
    let (dir, mut recording, truth, mut robot) = small();
    let out = dir.path().join("run.rrd");
    let wrong_truth = ReplayInput { truth: Some(&recording.path), ..input(&recording, &robot) };
    assert!(matches!(write_rrd(&wrong_truth, &out), Err(ReplayError::NoTruth { .. })));
    let nowhere = dir.path().join("no/run.rrd");
    assert!(matches!(write_rrd(&input(&recording, &robot), &nowhere), Err(ReplayError::Create { .. })));
    robot.sensors[0].joint = "other".into();
    let other_joints = ReplayInput { truth: Some(&truth), ..input(&recording, &robot) };
    assert!(matches!(write_rrd(&other_joints, &out), Err(ReplayError::TruthJoints { .. })));
    recording.messages.clear();
    let error = write_rrd(&input(&recording, &robot), &out).unwrap_err();
    assert!(matches!(error, ReplayError::Empty { .. }), "{error}");
    assert!(!out.exists());
}
