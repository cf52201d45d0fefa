//! One run from start to end: world, loop, streams, score, and the files that are kept.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::calib::{Calibration, calibration_method};
use crate::output::{AcceptedKept, OutputError, OutputFolder, accepted_kept};
#[cfg(feature = "viewer")]
use crate::report::markdown;
use crate::report::{About, AssertSummary, HeldJointSummary, OnlineSummary, RenewalSummary, Report, RunSummary, html};
use crate::run::describe::describe;
use crate::run::{Failure, RunError, RunInputs, Stage, corner_scatter_px};
use armcal_belief::session::{
    self, AssertResult, BelievedFrames, EstimateUpdate, HeldJoint, MessageListener, Outcome, Progress, Recorder,
    SessionInputs,
};
use armcal_core::files::{self, FileKind};
use armcal_core::log::{Recording, RecordingHeader, RecordingWriter, read_recording};
use armcal_core::robot::FrameTree;
use armcal_core::streams::Arm;
use armcal_core::time::Stamp;

/// Files that a run leaves in its folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// Recording, truth, replay, calibration, summary, report.
    Everything,
    /// Recording and truth, which the score needs; the caller removes them.
    StreamsAlone,
}

/// Destination of a run.
pub struct RunOutput<'a> {
    pub folder: &'a OutputFolder,
    pub keep: Keep,
    /// Listener that receives every message when it is recorded.
    pub listener: Option<MessageListener>,
}

/// Results of a run.
#[derive(Debug)]
pub struct Finished {
    pub summary: RunSummary,
    pub calibration: Calibration,
    /// Scatter of the tags' corners, px; see [`corner_scatter_px`].
    pub corner_scatter_px: Option<f64>,
    /// Reason that a requested replay is missing.
    pub replay_failure: Option<String>,
    /// Place of the results, if the accepted ones in the run's folder stay.
    pub kept: Option<AcceptedKept>,
}

/// Runs the closed loop on an arm whose truth is unknown: there is no score. The watcher's clock must start with the
/// command: its reading at the end is the summary's `wall_s`. Results come into place all at once at the end, if they
/// are kept.
/// all at once at the end, if they are kept.
///
/// # Errors
/// [`Failure`] with the stage, and the current path of the recording. It stays readable if the loop is interrupted.
pub fn execute_on(
    arm: &mut dyn Arm,
    inputs: &RunInputs,
    seed: u64,
    output: RunOutput<'_>,
    progress: &mut dyn Progress,
) -> Result<Finished, Failure> {
    let RunOutput { folder, keep, listener } = output;
    let run = Run { inputs, seed, output: folder, keep, source: Source::Arm };
    run.real(arm, listener, progress).map_err(|failure| run.broken_off(failure))
}

pub(super) struct Run<'a> {
    pub(super) inputs: &'a RunInputs,
    pub(super) seed: u64,
    pub(super) output: &'a OutputFolder,
    pub(super) keep: Keep,
    #[cfg_attr(not(any(feature = "sim", feature = "viewer")), expect(dead_code, reason = "there is no truth"))]
    pub(super) source: Source,
}

/// Source of the streams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// Simulation: the truth is known.
    #[cfg(feature = "sim")]
    World,
    Arm,
}

impl Run<'_> {
    fn real(
        &self,
        arm: &mut dyn Arm,
        listener: Option<MessageListener>,
        progress: &mut dyn Progress,
    ) -> Result<Finished, Failure> {
        let (outcome, recorder) = self.drive(arm, listener, progress)?;
        self.keep_all(outcome, recorder, progress)
    }

    pub(super) fn keep_all(
        &self,
        outcome: Outcome,
        recorder: Recorder,
        progress: &mut dyn Progress,
    ) -> Result<Finished, Failure> {
        self.finish_recording(recorder).map_err(Failure::at(Stage::Results))?;
        let finished = self.write_results(outcome, progress).map_err(Failure::at(Stage::Results))?;
        if self.keep == Keep::Everything {
            let kept = accepted_kept(self.output.path(), &finished.calibration);
            let folder = kept.as_ref().map_or(self.output.path(), |kept| kept.folder.as_path());
            self.output.commit_into(folder).map_err(Failure::at(Stage::Results))?;
            return Ok(Finished { kept, ..finished });
        }
        Ok(finished)
    }

    /// Path of the truth of a simulated run.
    #[cfg(feature = "viewer")]
    fn truth(&self) -> Option<PathBuf> {
        match self.source {
            #[cfg(feature = "sim")]
            Source::World => Some(self.partial("truth.mcap")),
            Source::Arm => None,
        }
    }

    /// Path at which the result `name` is written until it is complete.
    pub(super) fn partial(&self, name: &str) -> PathBuf {
        self.output.partial(name)
    }

    pub(super) fn drive(
        &self,
        arm: &mut dyn Arm,
        listener: Option<MessageListener>,
        progress: &mut dyn Progress,
    ) -> Result<(Outcome, Recorder), Failure> {
        let inputs = self.inputs;
        let recorder = self.recorder(arm.now()).map_err(Failure::at(Stage::World))?;
        let mut recorder = recorder.with_listener(listener);
        let setup = SessionInputs {
            robot: &inputs.robot,
            vehicle: &inputs.vehicle,
            routine: &inputs.routine,
            method: calibration_method(inputs.routine.method),
            seed: self.seed,
        };
        match session::run(&setup, arm, &mut recorder, progress) {
            Ok(outcome) => Ok((outcome, recorder)),
            Err(error) => {
                // The recording is valid up to here, so the time before the failure can be examined. If the recording
                // itself failed, this fails too, and `error` gives the reason.
                let _ = recorder.into_writer().finish();
                Err(Failure::of_session(error))
            }
        }
    }

    fn recorder(&self, now: Stamp) -> Result<Recorder, RunError> {
        let robot = &self.inputs.robot;
        let header = RecordingHeader::new(robot.joint_names()).with_tags_of(robot.tag_family);
        let tree = FrameTree::of(robot)?;
        let camera_frame = header.camera_frame.clone();
        let mut writer = RecordingWriter::create(self.partial("run.mcap"), header)?;
        describe(&mut writer, self.inputs, &tree, now)?;
        Ok(Recorder::new(writer).with_frames(BelievedFrames::new(robot, tree, &camera_frame)))
    }

    /// Keeps the recording of an interrupted run and names it in the failure; removes a recording in which nothing
    /// moved yet.
    pub(super) fn broken_off(&self, failure: Failure) -> Failure {
        if let Some(error) = self.output.is_gone() {
            return Failure { stage: failure.stage, error: Box::new(error.into()), kept: None };
        }
        if matches!(failure.stage, Stage::Input | Stage::World | Stage::Plan) {
            self.output.discard();
            return failure;
        }
        // A recording that cannot be renamed stays at its place; the next run into this folder will report it.
        Failure { kept: self.output.set_aside().unwrap_or_default(), ..failure }
    }

    /// Attaches the files of robot, vehicle and scene (never the world or the seed) and closes the recording.
    fn finish_recording(&self, recorder: Recorder) -> Result<(), RunError> {
        let mut writer = recorder.into_writer();
        let (robot, routine) = (&self.inputs.robot, &self.inputs.routine);
        let path = robot.folder.join("robot.toml");
        let bytes = files::read_bytes(&path, FileKind::Text).map_err(OutputError::of(&path, "cannot be read"))?;
        writer.attach("robot.toml", "application/toml", &bytes)?;
        writer.attach("vehicle.toml", "application/toml", self.inputs.vehicle.text.as_bytes())?;
        writer.attach(&robot.urdf_name, "application/xml", robot.urdf_text.as_bytes())?;
        writer.attach("scene.toml", "application/toml", routine.scene_toml.as_bytes())?;
        let versions = BTreeMap::from([("armcal".to_owned(), env!("CARGO_PKG_VERSION").to_owned())]);
        writer.metadata("run", versions)?;
        Ok(writer.finish()?)
    }

    fn write_results(&self, outcome: Outcome, progress: &mut dyn Progress) -> Result<Finished, RunError> {
        let recording = read_recording(self.partial("run.mcap"))?;
        let mut summary = self.summary(&outcome);
        #[cfg(feature = "sim")]
        if self.source == Source::World {
            self.add_score(&mut summary, &outcome, &recording)?;
        }
        summary = summary.judged();
        let mut replay_failure = None;
        if self.keep == Keep::Everything {
            // A failed replay must not cost the calibration; on a full disk there may still be room for the small
            // files.
            replay_failure = self.mirror(&recording, &summary, &outcome).err().map(|error| error.to_string());
            if replay_failure.is_some() {
                self.output.leave_out("run.rrd")?;
            }
            // The time is taken last, because the user also waits for the replay.
            summary.wall_s = progress.wall_s();
            self.write_texts(&outcome, &summary)?;
        }
        let corner_scatter_px = corner_scatter_px(&recording);
        Ok(Finished { summary, calibration: outcome.calibration, corner_scatter_px, replay_failure, kept: None })
    }

    fn summary(&self, outcome: &Outcome) -> RunSummary {
        let mut summary = RunSummary::of_calibration(&outcome.calibration, outcome.calibration_wall_s);
        summary.routine = Some(self.inputs.routine.name.clone());
        summary.seed = Some(self.seed);
        summary.simulated_s = Some(outcome.duration_s);
        summary.motion_s = Some(outcome.motion_s);
        summary.waited_s = Some(outcome.waited_s);
        summary.stopped.clone_from(&outcome.stopped);
        let held = |held: &HeldJoint| HeldJointSummary {
            joint: self.inputs.robot.sensors[held.joint].joint.clone(),
            kind: held.kind,
            angle_rad: held.angle_rad,
            bound_rad: held.bound_rad,
        };
        summary.held_joints = outcome.held.iter().map(held).collect();
        summary.still_reachable.clone_from(&outcome.still_reachable);
        summary.asserts = outcome.asserts.iter().map(assert_summary).collect();
        summary.capture.poses = outcome.poses;
        summary.capture.poses_skipped = outcome.poses_skipped;
        summary.capture.targets_skipped = outcome.skipped_targets.len();
        summary.capture.skipped_targets.clone_from(&outcome.skipped_targets);
        summary.capture.renewals = outcome.renewals.iter().map(renewal_summary).collect();
        summary.capture.stop_reason.clone_from(&outcome.capture_ended);
        summary.online = outcome.online.as_ref().and_then(OnlineSummary::of);
        summary
    }

    fn write_texts(&self, outcome: &Outcome, summary: &RunSummary) -> Result<(), RunError> {
        let calibration = &outcome.calibration;
        let log = outcome.online.as_ref().map(|online| &online.log);
        let files = calibration.to_files();
        self.output.write("calibration.covariance.toml", files.covariance.as_bytes())?;
        self.output.write("calibration.toml", files.calibration.as_bytes())?;
        if let Some(map) = &calibration.map {
            self.output.write("tagmap.toml", map.to_toml().as_bytes())?;
        }
        if let Some(log) = log {
            self.output.write("belief.jsonl", log.to_jsonl().as_bytes())?;
        }
        let json = serde_json::to_string_pretty(summary)?;
        self.output.write("summary.json", format!("{json}\n").as_bytes())?;
        let (robot, routine) = (&self.inputs.robot, &self.inputs.routine);
        let about = About {
            operator: routine.operator.clone(),
            vehicle: Some(self.inputs.vehicle.name.clone()),
            recordings: vec!["run.mcap".to_owned()],
        };
        let report = html(&Report { summary, calibration, robot, online: log, about });
        Ok(self.output.write("report.html", report.as_bytes())?)
    }

    #[cfg(not(feature = "viewer"))]
    fn mirror(&self, _: &Recording, _: &RunSummary, _: &Outcome) -> Result<(), RunError> {
        Ok(())
    }

    #[cfg(feature = "viewer")]
    fn mirror(
        &self,
        recording: &Recording,
        summary: &RunSummary,
        outcome: &Outcome,
    ) -> Result<(), armcal_replay::ReplayError> {
        let markdown = markdown(summary);
        let believed_links: Vec<_> = outcome.epochs.iter().map(|epoch| (epoch.from, epoch.links())).collect();
        let tool_beliefs: Vec<_> =
            outcome.epochs.iter().map(|epoch| (epoch.from, epoch.tool_belief(&self.inputs.robot))).collect();
        let residuals: Vec<_> =
            outcome.calibrations().into_iter().map(|(since, found)| (since, &found.details.views[..])).collect();
        let truth = self.truth();
        armcal_replay::write_rrd(
            &armcal_replay::ReplayInput {
                recording,
                truth: truth.as_deref(),
                robot: &self.inputs.robot,
                vehicle: Some(&self.inputs.vehicle),
                scene: Some(&self.inputs.routine.scene),
                believed_links: &believed_links,
                tool_beliefs: &tool_beliefs,
                residuals: &residuals,
                clearance_m: Some(self.inputs.routine.capture.clearance_m),
                online: outcome.online.as_ref().map(|online| &online.log),
                summary_markdown: Some(&markdown),
            },
            &self.partial("run.rrd"),
        )
    }
}

fn renewal_summary(renewal: &EstimateUpdate) -> RenewalSummary {
    let EstimateUpdate { views, elapsed_s, expected_tool_error_m, .. } = *renewal;
    RenewalSummary { views, elapsed_s, predicted_tool_error_m: expected_tool_error_m }
}

/// A limit without a figure does not hold, because nothing shows that it does.
pub(super) fn assert_summary(limit: &AssertResult) -> AssertSummary {
    let holds = limit.holds().unwrap_or(false);
    AssertSummary { step: limit.step, key: limit.figure, limit: limit.limit, value: limit.value, holds }
}
