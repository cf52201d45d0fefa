//! One simulated capture of a routine: the recorded bytes, and the truth at the task's targets.

use nalgebra::Vector3;

use crate::falsified::cases::{Case, CaseKind};
use crate::falsified::error::FalsifiedError;
use crate::falsified::perturbation::{CaptureHalf, SensorFault, SoundReading};
use armcal_belief::calib::{CalibrationMethod, surveyed};
use armcal_belief::session::{self, Recorder, SessionInputs, Unwatched};
use armcal_core::log::{Recording, RecordingHeader, RecordingWriter, read_recording};
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::{CalibrateSettings, OnRefusal, Routine, Step};
use armcal_core::sensor::SensorModel;
use armcal_core::streams::{JointAngles, Mark, MarkKind, Message};
use armcal_core::time::Stamp;
use armcal_sim::truth::{Truth, TruthRecorder, read_truth};
use armcal_sim::{World, WorldInput, WorldSpec};

/// Number of views in a case of alike views.
const ALIKE_VIEWS: usize = 12;

/// True state of the arm at rest for a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrueRest {
    /// Start of the reach's mark.
    pub start: Stamp,
    pub angles: JointAngles,
    /// Tool position in the base frame, m.
    pub tool_m: Vector3<f64>,
}

/// Recording and truth of one seed's capture.
pub(super) struct Capture {
    pub seed: u64,
    /// The robot with the recorded survey.
    pub robot: Robot,
    pub recording: Recording,
    pub rests: Vec<TrueRest>,
    /// Time between the two halves of the captured views.
    pub middle: Stamp,
    /// Travel by the datasheet at `middle`, rad.
    pub middle_travel_rad: JointAngles,
}

/// Inputs that all seeds share.
pub(super) struct Scene<'a> {
    pub routine: &'a Routine,
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
}

impl Capture {
    /// Simulates the routine with `seed`, without what comes before the capture. The recording goes through a file.
    pub(super) fn simulate(scene: &Scene<'_>, seed: u64) -> Result<Self, FalsifiedError> {
        let routine = abridged(scene.routine);
        let folder = tempfile::tempdir().map_err(FalsifiedError::of("temporary folder"))?;
        let [run, truth] = ["run.mcap", "truth.mcap"].map(|name| folder.path().join(name));
        let mut world = World::new(WorldInput {
            robot: scene.robot,
            vehicle: scene.vehicle,
            scene: &routine.scene,
            spec: WorldSpec::from_routine(&routine, scene.robot)?,
            seed,
        })?;
        world.set_truth_sink(Box::new(TruthRecorder::create(&truth).map_err(FalsifiedError::of("truth"))?))?;
        let header = RecordingHeader::new(scene.robot.joint_names());
        let writer = RecordingWriter::create(&run, header).map_err(FalsifiedError::of("recording"))?;
        let mut recorder = Recorder::new(writer);
        let inputs = SessionInputs {
            robot: scene.robot,
            vehicle: scene.vehicle,
            routine: &routine,
            method: CalibrationMethod::Bundle,
            seed,
        };
        session::run(&inputs, &mut world, &mut recorder, &mut Unwatched)?;
        world.finish_truth()?;
        recorder.into_writer().finish().map_err(FalsifiedError::of("recording"))?;
        let mut recording = read_recording(&run).map_err(FalsifiedError::of("recording"))?;
        // The folder has another name each time, and messages name the file; a fixed path keeps the results equal.
        recording.path = "run.mcap".into();
        Self::of(scene.robot, seed, recording, &read_truth(&truth)?)
    }

    fn of(robot: &Robot, seed: u64, recording: Recording, truth: &Truth) -> Result<Self, FalsifiedError> {
        let robot = surveyed(&recording, robot).into_owned();
        let rests = marks(&recording).filter_map(|mark| {
            let MarkKind::Reach { .. } = mark.kind else { return None };
            let state = truth.state_at(mark.start.plus_s(0.5 * mark.end.since_s(mark.start)))?;
            let tool_m = state.base_from_tool.origin().vector();
            Some(TrueRest { start: mark.start, angles: state.angles, tool_m })
        });
        let rests: Vec<TrueRest> = rests.collect();
        let views: Vec<&Mark> = capture_marks(&recording);
        let middle = views.get(views.len() / 2).map(|mark| mark.start);
        let (Some(middle), false) = (middle, rests.is_empty()) else {
            return Err(FalsifiedError::Scene(format!("seed {seed}: the routine captures or reaches nothing")));
        };
        let before = |message: &Message| match message {
            Message::JointSensors(sample) if sample.stamp <= middle => Some((sample.stamp, sample.counts)),
            _ => None,
        };
        let last = recording.messages.iter().filter_map(|(_, message)| before(message)).max_by_key(|(stamp, _)| *stamp);
        let counts = last.ok_or_else(|| FalsifiedError::Scene(format!("seed {seed}: no readings")))?.1;
        let middle_travel_rad = JointAngles::from_fn(robot.n_joints(), |joint| {
            SensorModel::nominal(&robot.sensors[joint]).nominal_travel_rad(counts[joint])
        });
        Ok(Self { seed, robot, recording, rests, middle, middle_travel_rad })
    }

    pub(super) fn half(&self, at: Stamp) -> CaptureHalf {
        if at > self.middle { CaptureHalf::Second } else { CaptureHalf::First }
    }

    /// Number of touches in the recording.
    pub(super) fn n_touches(&self) -> usize {
        self.recording.messages.iter().filter(|(_, message)| matches!(message, Message::Touch(_))).count()
    }

    /// The recording with the wrong readings of `fault`, if any, and with the views and touches of `case`.
    pub(super) fn falsified(&self, case: &Case, fault: Option<&SensorFault>) -> Recording {
        let mut recording = self.recording.clone();
        keep_touches(&mut recording, case.n_touches);
        if let Some(fault) = fault {
            self.falsify_readings(fault, &mut recording);
        }
        match case.kind {
            CaseKind::FewViews => keep_views(&mut recording, case.size as usize),
            CaseKind::AlikeViews => split_views(&mut recording, case.size as usize),
            _ => {}
        }
        recording
    }

    fn falsify_readings(&self, fault: &SensorFault, recording: &mut Recording) {
        let joint = fault.joint;
        let sensor = SensorModel::nominal(&self.robot.sensors[joint]);
        for (_, message) in &mut recording.messages {
            let Message::JointSensors(sample) = message else { continue };
            let sound = SoundReading {
                travel_rad: sensor.nominal_travel_rad(sample.counts[joint]),
                middle_travel_rad: self.middle_travel_rad[joint],
                half: self.half(sample.stamp),
            };
            let travel_rad = fault.travel_rad(&sensor, &sound);
            sample.counts[joint] = sensor.counts(sensor.spec.center_rad + travel_rad);
        }
    }
}

/// The routine cut down to its captures, one calibration, and one reach of all targets after them.
fn abridged(routine: &Routine) -> Routine {
    let mut short = routine.clone();
    let first = short.steps.iter().position(|step| matches!(step, Step::Capture(_))).unwrap_or_default();
    short.steps.drain(..first);
    for step in &mut short.steps {
        if let Step::Calibrate(settings) = step {
            *settings = CalibrateSettings { on_refusal: OnRefusal::Continue, ..*settings };
        }
    }
    short
}

fn marks(recording: &Recording) -> impl Iterator<Item = &Mark> {
    recording.messages.iter().filter_map(|(_, message)| match message {
        Message::Mark(mark) => Some(mark),
        _ => None,
    })
}

/// Marks of captures in the order of time.
fn capture_marks(recording: &Recording) -> Vec<&Mark> {
    let mut captures: Vec<&Mark> =
        marks(recording).filter(|mark| matches!(mark.kind, MarkKind::Capture { .. })).collect();
    captures.sort_by_key(|mark| mark.start);
    captures
}

/// Starts of `n` captures, evenly spread over all.
fn spread(recording: &Recording, n: usize) -> Vec<Stamp> {
    let all = capture_marks(recording);
    let n = n.min(all.len());
    (0..n).map(|k| all[(2 * k + 1) * all.len() / (2 * n)].start).collect()
}

fn is_capture(message: &Message) -> Option<&Mark> {
    match message {
        Message::Mark(mark) if matches!(mark.kind, MarkKind::Capture { .. }) => Some(mark),
        _ => None,
    }
}

/// Keeps the first `n` touches: the arm chooses each touch as the most informative after the previous ones.
fn keep_touches(recording: &mut Recording, n: usize) {
    let mut n_before = 0;
    recording.messages.retain(|(_, message)| {
        n_before += usize::from(matches!(message, Message::Touch(_)));
        !matches!(message, Message::Touch(_)) || n_before <= n
    });
}

/// Removes the marks of all captures but `n`.
fn keep_views(recording: &mut Recording, n: usize) {
    let kept = spread(recording, n);
    recording.messages.retain(|(_, message)| is_capture(message).is_none_or(|mark| kept.contains(&mark.start)));
}

/// Keeps `n` captures and divides each, so that there are [`ALIKE_VIEWS`] views; some may be too short for an image.
fn split_views(recording: &mut Recording, n: usize) {
    keep_views(recording, n);
    let parts = ALIKE_VIEWS / n.max(1);
    let mut messages = Vec::with_capacity(recording.messages.len() + ALIKE_VIEWS);
    let mut n_views = 0;
    for (log_time, message) in std::mem::take(&mut recording.messages) {
        let Some(&Mark { start, end, kind: MarkKind::Capture { set, .. } }) = is_capture(&message) else {
            messages.push((log_time, message));
            continue;
        };
        let part_s = end.since_s(start) / parts as f64;
        for part in 0..parts {
            let [from, to] = [part, part + 1].map(|k| start.plus_s(part_s * k as f64));
            let kind = MarkKind::Capture { set, pose_idx: n_views };
            messages.push((log_time, Message::Mark(Mark { start: from, end: to, kind })));
            n_views += 1;
        }
    }
    recording.messages = messages;
}
