//! `armcal run --arm`: a real arm in place of the simulated one.

use anyhow::Result;
use clap::Args;

use crate::cli::exit::UsageError;
use crate::cli::stdout::note;
use crate::output::OutputFolder;
use crate::run::{Failure, Finished, RunInputs, execute_on};
use armcal_belief::session::Progress;
use armcal_core::robot::Robot;
use armcal_core::sensor::ArmSensors;
use armcal_core::stats::quantile;
use armcal_live::{Connection, LiveArm, Ros2Wire, Survey};

#[derive(Debug, Args)]
pub(super) struct LiveArgs {
    /// A real arm in place of the simulated one, by its connection map: ros2:ARM.toml. It asks before each motion
    #[arg(long, value_name = "ros2:ARM.toml")]
    arm: Option<String>,
    /// Do not ask before each motion of a real arm
    #[arg(long, requires = "arm", conflicts_with = "confirm")]
    unattended: bool,
    /// Listen to the arm, say what is heard, and move nothing
    #[arg(long, requires = "arm")]
    pub no_motion: bool,
    /// Drive every joint at this share of the rate that the robot's file allows
    #[arg(long, requires = "arm", value_name = "SHARE", default_value_t = 1.0, value_parser = share)]
    speed: f64,
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|error| format!("{error}"))?;
    if (0.01..=1.0).contains(&share) { Ok(share) } else { Err("it must be 0.01 .. 1".to_owned()) }
}

impl LiveArgs {
    /// Whether the operator is asked: always, unless it is written out that nobody is there.
    pub fn is_attended(&self) -> bool {
        self.arm.is_some() && !self.unattended
    }

    /// Connects to the arm, where one is named, and says what was heard of it.
    pub fn connect(&self, inputs: &mut RunInputs) -> Result<Option<LiveArm<Ros2Wire>>> {
        let Some(arm) = &self.arm else { return Ok(None) };
        let Some(file) = arm.strip_prefix("ros2:") else {
            return Err(UsageError(format!(
                "--arm {arm}: it must be ros2: and a connection map, such as ros2:arm.toml"
            ))
            .into());
        };
        let connection = Connection::load(file.as_ref())?;
        for sensor in &mut inputs.robot.sensors {
            sensor.max_rate_rad_s *= self.speed;
        }
        let wire = Ros2Wire::open(&connection, &inputs.robot)?;
        let (arm, survey) = LiveArm::connect(wire, &inputs.robot, &connection)?;
        note(describe(&survey, &inputs.robot));
        Ok(Some(arm))
    }
}

/// What was heard before anything moved.
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
    if let Some((n, why)) = &survey.unusable {
        text.push_str(&format!("\nwarning: {n} messages were of no use, the last: {why}"));
    }
    text
}

/// Runs on the arm, tells it to stop where the run breaks off, and says how quickly it was answered.
pub(super) fn execute(
    mut arm: LiveArm<Ros2Wire>,
    inputs: &RunInputs,
    seed: u64,
    output: &OutputFolder,
    progress: &mut dyn Progress,
) -> Result<Finished, Failure> {
    let result = execute_on(&mut arm, inputs, seed, output, progress);
    if result.is_err() {
        arm.stop("the run broke off");
    }
    let latency_ms = |p: f64| quantile(arm.latencies_s(), p).map(|seconds| 1e3 * seconds);
    if let (Some(median), Some(slow)) = (latency_ms(0.5), latency_ms(0.99)) {
        note(format_args!("from a reading to its set-point: median {median:.2} ms, 99 % within {slow:.2} ms"));
    }
    result
}
