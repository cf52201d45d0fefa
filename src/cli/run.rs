//! `armcal run`: the closed loop on a simulated arm.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use super::exit::Exit;
use super::files;
use super::progress::Bar;
use crate::calib::{Calibration, Status};
use crate::log::ros::{CameraInfo, Header, StringMessage, TfMessage, Transform, TransformStamped};
use crate::log::{LogError, RecordingHeader, RecordingWriter, RosMessage, read_recording, topics};
#[cfg(feature = "viewer")]
use crate::report::markdown;
use crate::report::{RunSummary, html, table};
use crate::robot::{self, Robot, Vehicle};
use crate::routine::{self, Routine};
use crate::score::{ScoreInput, score};
use crate::session::{self, Outcome, Recorder, SessionError, Setup};
use crate::sim::truth::TruthRecorder;
use crate::sim::{World, WorldInput, WorldSpec};
use crate::streams::Arm;
use crate::time::Stamp;

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// The routine (.toml)
    routine: PathBuf,
    /// Seed of everything random in the world; the routine's own if not given
    #[arg(long)]
    seed: Option<u64>,
    /// Output folder; recordings/ROUTINE-NAME if not given
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Everything read and checked before anything moves.
struct Inputs {
    routine: Routine,
    robot: Robot,
    vehicle: Vehicle,
    spec: WorldSpec,
    seed: u64,
    out: PathBuf,
}

impl Inputs {
    fn file(&self, name: &str) -> PathBuf {
        self.out.join(name)
    }
}

pub(super) fn run(args: &RunArgs) -> Result<Exit> {
    let started = Instant::now();
    let inputs = read_inputs(args)?;
    files::make_folder(&inputs.out)?;
    let bar = Bar::new();
    let (outcome, recorder) = drive(&inputs, bar)?;
    finish_recording(&inputs, recorder)?;
    let summary = write_results(&inputs, &outcome, started)?;
    println!("{}", table(&summary));
    println!("written      {}", inputs.out.display());
    Ok(match outcome.calibration.status {
        Status::Refused => Exit::Refused,
        Status::Accepted => Exit::Ok,
    })
}

fn read_inputs(args: &RunArgs) -> Result<Inputs> {
    let routine = routine::load(&args.routine)?;
    let robot = robot::load(&routine.robot_folder)?;
    let vehicle = robot::load_vehicle(&routine.vehicle_file)?;
    let spec = WorldSpec::from_table(&routine.world, &routine.file)?;
    let seed = args.seed.unwrap_or(routine.seed);
    let out = args.out.clone().unwrap_or_else(|| Path::new("recordings").join(&routine.name));
    Ok(Inputs { routine, robot, vehicle, spec, seed, out })
}

/// Runs the loop; streams grow in `.partial` files, which stay readable if it breaks off.
fn drive(inputs: &Inputs, mut bar: Bar) -> Result<(Outcome, Recorder)> {
    let mut world = World::new(WorldInput {
        robot: &inputs.robot,
        vehicle: &inputs.vehicle,
        scene: &inputs.routine.scene,
        spec: inputs.spec,
        seed: inputs.seed,
    })?;
    let truth = TruthRecorder::create(files::partial(&inputs.file("truth.mcap")))?;
    world.set_truth_sink(Box::new(truth))?;
    let header = RecordingHeader::new(inputs.robot.joint_names());
    let mut writer = RecordingWriter::create(files::partial(&inputs.file("run.mcap")), header)?;
    describe(&mut writer, inputs, world.now())?;
    let mut recorder = Recorder::new(writer);
    let setup = Setup { robot: &inputs.robot, vehicle: &inputs.vehicle, routine: &inputs.routine, seed: inputs.seed };
    let result = session::run(&setup, &mut world, &mut recorder, &mut bar);
    bar.finish();
    let finished = world.finish_truth();
    match result {
        Ok(outcome) => {
            finished?;
            Ok((outcome, recorder))
        }
        Err(error) => {
            // Whole up to here: what happened before the failure can be looked at.
            recorder.into_writer().finish()?;
            Err(broken_off(inputs, error))
        }
    }
}

/// Names the recording that a broken run leaves; one in which nothing moved yet is removed.
fn broken_off(inputs: &Inputs, error: SessionError) -> anyhow::Error {
    let kept = files::partial(&inputs.file("run.mcap"));
    if matches!(error, SessionError::Plan(_)) {
        // Nothing of value is in them; if they cannot be removed they do no harm.
        let _ = std::fs::remove_file(&kept);
        let _ = std::fs::remove_file(files::partial(&inputs.file("truth.mcap")));
        return error.into();
    }
    anyhow::Error::new(error).context(format!("the run broke off; its recording is {}", kept.display()))
}

/// What viewers need to show the arm: its URDF, the camera's lens, and where the base is bolted on.
fn describe(writer: &mut RecordingWriter, inputs: &Inputs, now: Stamp) -> Result<(), LogError> {
    let robot = &inputs.robot;
    let urdf = StringMessage { data: robot.urdf_text.clone() };
    writer.write_ros(topics::ROBOT_DESCRIPTION, &StringMessage::SCHEMA, now, &urdf)?;
    writer.write_ros(topics::CAMERA_INFO, &CameraInfo::SCHEMA, now, &camera_info(robot))?;
    let pose = inputs.vehicle.vehicle_from_base;
    let transform = TransformStamped {
        header: Header { frame_id: "vehicle".to_owned(), ..Header::default() },
        child_frame_id: robot.base_link.clone(),
        transform: Transform {
            translation: pose.origin().to_array().into(),
            rotation: crate::log::ros::Quaternion::from_wxyz(pose.quaternion_wxyz()),
        },
    };
    writer.write_ros(topics::TF_STATIC, &TfMessage::SCHEMA, now, &TfMessage { transforms: vec![transform] })
}

fn camera_info(robot: &Robot) -> CameraInfo {
    let lens = &robot.camera.lens;
    let ([fx, fy], [cx, cy]) = (lens.focal_px, lens.center_px);
    CameraInfo {
        header: Header { frame_id: robot.camera.name.clone(), ..Header::default() },
        width: lens.resolution_px[0],
        height: lens.resolution_px[1],
        distortion_model: "equidistant".to_owned(),
        d: lens.distortion.to_vec(),
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}

/// Attaches the drawings (never the world or the seed) and puts both streams in place.
fn finish_recording(inputs: &Inputs, recorder: Recorder) -> Result<()> {
    let mut writer = recorder.into_writer();
    for (name, path) in
        [("robot.toml", inputs.robot.folder.join("robot.toml")), ("vehicle.toml", inputs.routine.vehicle_file.clone())]
    {
        let bytes = std::fs::read(&path).with_context(|| format!("{}: cannot be read", path.display()))?;
        writer.attach(name, "application/toml", &bytes)?;
    }
    writer.attach(&inputs.robot.urdf_name, "application/xml", inputs.robot.urdf_text.as_bytes())?;
    writer.attach("scene.toml", "application/toml", inputs.routine.scene_toml.as_bytes())?;
    let versions = BTreeMap::from([("armcal".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
    writer.metadata("run", versions)?;
    writer.finish()?;
    files::complete(&inputs.file("run.mcap"))?;
    files::complete(&inputs.file("truth.mcap"))
}

fn write_results(inputs: &Inputs, outcome: &Outcome, started: Instant) -> Result<RunSummary> {
    let calibration = &outcome.calibration;
    let recording = read_recording(inputs.file("run.mcap"))?;
    let truth = inputs.file("truth.mcap");
    let scored = score(&ScoreInput {
        recording: &recording,
        truth: &truth,
        robot: &inputs.robot,
        calibration,
        after: &outcome.sensors,
        tolerance_m: inputs.routine.task.tolerance_m,
    })?;
    let mut summary = RunSummary::of_calibration(calibration, outcome.calibration_wall_s);
    summary.routine = Some(inputs.routine.name.clone());
    summary.seed = Some(inputs.seed);
    summary.simulated_s = Some(outcome.duration_s);
    summary.motion_s = Some(outcome.motion_s);
    summary.capture.poses = outcome.poses;
    summary.capture.poses_skipped = outcome.poses_skipped;
    summary.capture.targets_skipped = outcome.targets_skipped;
    summary.capture.collisions = Some(scored.collisions);
    summary.capture.min_clearance_m = scored.min_clearance_m;
    summary.score = Some(scored.score);
    #[cfg(feature = "viewer")]
    mirror(inputs, &recording, &summary)?;
    // Taken last: the replay is part of what a user waits for.
    summary.wall_s = started.elapsed().as_secs_f64();
    write_texts(inputs, calibration, &summary)?;
    Ok(summary)
}

fn write_texts(inputs: &Inputs, calibration: &Calibration, summary: &RunSummary) -> Result<()> {
    files::write_whole(&inputs.file("calibration.toml"), calibration.to_toml().as_bytes())?;
    let json = serde_json::to_string_pretty(summary).context("summary.json")?;
    files::write_whole(&inputs.file("summary.json"), format!("{json}\n").as_bytes())?;
    files::write_whole(&inputs.file("report.html"), html(summary, calibration).as_bytes())
}

#[cfg(feature = "viewer")]
fn mirror(inputs: &Inputs, recording: &crate::log::Recording, summary: &RunSummary) -> Result<()> {
    let markdown = markdown(summary);
    let truth = inputs.file("truth.mcap");
    let out = inputs.file("run.rrd");
    crate::replay::write_rrd(
        &crate::replay::ReplayInput {
            recording,
            truth: Some(&truth),
            robot: &inputs.robot,
            vehicle: Some(&inputs.vehicle),
            scene: Some(&inputs.routine.scene),
            summary_markdown: Some(&markdown),
        },
        &files::partial(&out),
    )?;
    files::complete(&out)
}
