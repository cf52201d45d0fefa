//! A driver for your own arm: the trait `Arm`, and a whole session with it.
//!
//! Run `cargo run --release --example own_arm`. The arm here is ideal except for its joint sensors, which have errors
//! of gain and offset. It follows set-points by its own readings and sees the tags with some noise. A driver for
//! hardware sends set-points to a controller, and passes on the messages that come back.

#![allow(clippy::print_stdout, reason = "a small program, for a terminal")]

use std::error::Error;
use std::path::Path;

use armcal::optics::square_corners;
use armcal::session::run;
use armcal::stats::stream_rng;
use armcal::streams::{JointSensorSample, TagDetection, TagDetections};
use armcal::time::SIMULATION_EPOCH;
use armcal::{
    Arm, ArmError, ArmSensors, JointAngles, JointCounts, Message, Method, Recorder, RecordingHeader, RecordingWriter,
    Robot, SessionInputs, Sink, Stamp, Unwatched, load_routine,
};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const PERIOD_S: f64 = 0.02;
/// Number of control periods between two images.
const IMAGE_EVERY: u64 = 10;
/// Share of the distance to the set-point that the arm moves in one period.
const FOLLOWING: f64 = 0.3;
/// Standard deviation of a corner, px.
const CORNER_NOISE_PX: f64 = 0.3;

struct MyArm<'a> {
    robot: &'a Robot,
    /// True sensors of the arm, which the estimator does not know.
    sensors: ArmSensors,
    true_angles: JointAngles,
    set_point: JointCounts,
    n_periods: u64,
    noise: ChaCha8Rng,
}

impl<'a> MyArm<'a> {
    fn new(robot: &'a Robot) -> Self {
        let mut sensors = ArmSensors::nominal(robot);
        for (joint, model) in sensors.models.iter_mut().enumerate().take(robot.camera.mount.n_joints) {
            model.correction.gain *= 1.0 + 0.01 * (joint as f64 - 2.0);
            model.correction.offset_rad += 0.02 * (1.5 - joint as f64);
        }
        let set_point = ArmSensors::nominal(robot).counts(&robot.stowed);
        Self {
            robot,
            true_angles: sensors.angles(&set_point),
            sensors,
            set_point,
            n_periods: 0,
            noise: stream_rng(1, "corners"),
        }
    }

    /// All tags whose corners all lie in the image; occlusion does not count.
    fn detections(&mut self) -> Vec<TagDetection> {
        let base_from_camera = self.robot.chain.frame(&self.true_angles, &self.robot.camera.mount);
        let lens = &self.robot.camera.lens;
        let mut noise_px = || CORNER_NOISE_PX * Distribution::<f64>::sample(&StandardNormal, &mut self.noise);
        let detect = |tag: &armcal::robot::SurveyedTag| {
            let camera_from_tag = base_from_camera.inverse() * tag.base_from_tag.isometry();
            let mut corners_px = [[0.0; 2]; 4];
            for (pixel, corner) in corners_px.iter_mut().zip(square_corners(tag.size_m)) {
                let exact = lens.project(&(camera_from_tag * corner).coords).filter(|px| lens.contains(px))?;
                *pixel = [exact.x + noise_px(), exact.y + noise_px()];
            }
            let faces_camera =
                camera_from_tag.translation.vector.dot(&(camera_from_tag * nalgebra::Vector3::z())) < 0.0;
            faces_camera.then_some(TagDetection { id: tag.id, corners_px, decision_margin: 80.0 })
        };
        self.robot.tags.iter().filter_map(detect).collect()
    }
}

impl Arm for MyArm<'_> {
    fn now(&self) -> Stamp {
        SIMULATION_EPOCH.plus_s(self.n_periods as f64 * PERIOD_S)
    }

    fn period_s(&self) -> f64 {
        PERIOD_S
    }

    fn command(&mut self, set_point: &JointCounts) -> Result<(), ArmError> {
        self.set_point = *set_point;
        Ok(())
    }

    fn step(&mut self, sink: &mut dyn Sink) -> Result<(), ArmError> {
        self.n_periods += 1;
        let goal = self.sensors.angles(&self.set_point);
        for (angle, goal) in self.true_angles.iter_mut().zip(goal.iter()) {
            *angle += FOLLOWING * (goal - *angle);
        }
        let stamp = self.now();
        let counts = JointCounts::from_fn(goal.len(), |j| self.sensors.counts(&self.true_angles)[j].round());
        let reading = Message::JointSensors(JointSensorSample { stamp, counts });
        sink.record(stamp, &reading).map_err(ArmError::Sink)?;
        if self.n_periods.is_multiple_of(IMAGE_EVERY) {
            let detections = Message::Detections(TagDetections { stamp, tags: self.detections() });
            sink.record(stamp, &detections).map_err(ArmError::Sink)?;
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut routine = load_routine(&Path::new(env!("CARGO_MANIFEST_DIR")).join("routines/titan4-sample.toml"))?;
    routine.method = Method::Bundle;
    let (robot, vehicle) = routine.load_arm()?;
    let mut arm = MyArm::new(&robot);

    let folder = tempfile::tempdir()?;
    let header = RecordingHeader::new(robot.joint_names());
    let mut recorder = Recorder::new(RecordingWriter::create(folder.path().join("run.mcap"), header)?);
    let method = armcal::calib::calibration_method(routine.method);
    let inputs = SessionInputs { robot: &robot, vehicle: &vehicle, routine: &routine, method, seed: routine.seed };
    let outcome = run(&inputs, &mut arm, &mut recorder, &mut Unwatched)?;
    recorder.into_writer().finish()?;

    let calibration = &outcome.calibration;
    println!("{} views in {:.0} s of the arm's time", outcome.poses, outcome.duration_s);
    println!("verdict: {:?} {}", calibration.status, calibration.refusal.as_deref().unwrap_or_default());
    for (joint, truth) in calibration.joint.iter().zip(&arm.sensors.models).take(robot.camera.mount.n_joints) {
        let offset_rad = truth.correction.offset_rad;
        println!("{:<15} offset {:7.4} rad, in truth {offset_rad:7.4} rad", joint.name, joint.offset_rad);
    }
    Ok(())
}
