//! A real arm over ROS 2, or over a rosbridge.

use armcal_core::codes::Code;
use std::path::Path;

use anyhow::Result;

use super::nudging::nudge_one;
use super::watch_memory;
#[cfg(not(feature = "images"))]
use crate::cli::exit::UsageError;
use crate::cli::interrupt::Interrupt;
use crate::cli::stdout::note;
#[cfg(feature = "images")]
use crate::recorded_images::LiveTagFinder;
use crate::run::{Failure, Finished, RunInputs, RunOutput, execute_on};
use armcal_belief::session::Progress;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::stats::quantile;
#[cfg(feature = "images")]
use armcal_live::ImageSearch;
use armcal_live::{Connection, LiveArm, RosbridgeWire, Survey, TagCheck, WatchedWire, Wire};

/// A connected arm that was found ready.
pub struct ConnectedArm(LiveArm<Box<dyn Wire>>);

/// Text on the messages that were received before anything moved.
fn describe(survey: &Survey, robot: &Robot) -> String {
    let Survey { seconds, readings, images, tags, .. } = survey;
    let rate_hz = *readings as f64 / seconds.max(1e-9);
    let mut text = format!(
        "the arm is at rest; heard in {seconds:.1} s: {readings} joint readings ({rate_hz:.0} a second), {images} \
         images with {tags} tags"
    );
    let angles = ArmSensors::nominal(robot).angles(&survey.counts);
    for (joint, angle) in robot.joint_names().iter().zip(angles.iter()) {
        text.push_str(&format!("\n  {joint:<20} {:8.2} deg by the datasheet", angle.to_degrees()));
    }
    match &survey.tag_check {
        Some(TagCheck { tags, largest_rad, bound_rad }) => text.push_str(&format!(
            "\n{tags} known tags are in view, up to {:.1} deg from where these angles put them; the datasheet allows \
             {:.1}",
            largest_rad.to_degrees(),
            bound_rad.to_degrees()
        )),
        None => text.push_str("\nno known tag is in view: the angles are not checked"),
    }
    if let Some((n, why)) = &survey.unusable {
        let code = Code::MessagesRejected;
        text.push_str(&format!("\nwarning: {n} messages were of no use, the last: {why} [{code}]"));
    }
    text
}

/// Adds a search for tags in the images of the arm's camera.
#[cfg(feature = "images")]
fn with_images(wire: Box<dyn Wire>, robot: &Robot) -> Result<Box<dyn Wire>> {
    robot.require_lens()?;
    let (lens, family) = (robot.camera.lens, robot.tag_family);
    Ok(Box::new(ImageSearch::new(wire, move || LiveTagFinder::new(&lens, family))?))
}

#[cfg(not(feature = "images"))]
fn with_images(_: Box<dyn Wire>, _: &Robot) -> Result<Box<dyn Wire>> {
    let problem =
        "`images` without `detections`: this build of armcal reads no images; build it with `--features images`";
    Err(UsageError::new(Code::BuildFeatureMissing, problem).into())
}

impl ConnectedArm {
    /// Waits until the arm is ready, and prints what was received from it.
    pub fn open(file: &Path, inputs: &RunInputs) -> Result<Self> {
        let connection = Connection::load(file)?;
        let wire: Box<dyn Wire> = match &connection.rosbridge {
            None => {
                let memory = watch_memory(Some(&inputs.robot.camera.lens))?;
                Box::new(WatchedWire::open(&connection, &inputs.robot, memory)?)
            }
            Some(bridge) => Box::new(RosbridgeWire::open(&connection, bridge, &inputs.robot)?),
        };
        let wire = if connection.searches_images() { with_images(wire, &inputs.robot)? } else { wire };
        let (arm, survey) = LiveArm::connect(wire, &inputs.robot, &connection)?;
        note(describe(&survey, &inputs.robot));
        Ok(Self(arm))
    }

    /// Moves one joint after the other by one degree and back, each after a yes; ends at the first error.
    pub fn nudge(&mut self, robot: &Robot, interrupt: &Interrupt) -> Result<()> {
        let mut answers = std::io::stdin().lock();
        for joint in 0..robot.n_joints() {
            nudge_one(&mut self.0, joint, &mut answers, interrupt)?;
        }
        note("each joint follows its set-points with the right sign and scale");
        Ok(())
    }

    /// Runs on the arm, tells it to stop if the run is interrupted, and reports the response times.
    pub fn execute(
        mut self,
        inputs: &RunInputs,
        output: RunOutput<'_>,
        progress: &mut dyn Progress,
    ) -> Result<Finished, Failure> {
        let result = execute_on(&mut self.0, inputs, inputs.routine.seed, output, progress);
        if result.is_err() {
            self.0.stop("the run broke off");
        }
        let latency_ms = |p: f64| quantile(self.0.latencies_s(), p).map(|seconds| 1e3 * seconds);
        if let (Some(median), Some(slow)) = (latency_ms(0.5), latency_ms(0.99)) {
            note(format_args!("from a reading to its set-point: median {median:.2} ms, 99 % within {slow:.2} ms"));
        }
        result
    }
}
