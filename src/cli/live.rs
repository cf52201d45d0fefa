//! `armcal run --arm`: a real arm in place of the simulated one; `discover` finds out how it is reached over DDS.

#[cfg(feature = "live")]
mod connected;
pub(super) mod discover;
#[cfg(feature = "live")]
mod ending;
#[cfg(feature = "live")]
mod nudging;

use armcal_core::codes::Code;
use clap::Args;

use crate::cli::exit::UsageError;
use crate::cli::interrupt::Interrupt;
#[cfg(feature = "live")]
pub(super) use connected::ConnectedArm;
#[cfg(feature = "live")]
pub(super) use ending::watch_memory;
#[cfg(not(feature = "live"))]
pub(super) use unconnected::ConnectedArm;

use armcal_core::robot::Robot;

#[derive(Debug, Args)]
pub(super) struct LiveArgs {
    /// Move a real arm instead of the simulated one: ros2:ARM.toml over DDS, or rosbridge:ARM.toml for ROS 1 or 2;
    /// armcal asks before each motion
    #[arg(long, value_name = "ros2:ARM.toml")]
    arm: Option<String>,
    /// Move a real arm without asking before each motion
    #[arg(long, requires = "arm", conflicts_with = "confirm")]
    unattended: bool,
    /// Listen to the arm, print what is heard, and move nothing
    #[arg(long, requires = "arm")]
    pub no_motion: bool,
    /// First move each joint by one degree and back, each after a yes; continue only if all follow
    #[arg(long, requires = "arm", conflicts_with_all = ["unattended", "no_motion"])]
    nudge: bool,
    /// Share of the joint rates in robot.toml, 0.01 to 1
    #[arg(long, requires = "arm", value_name = "SHARE", default_value_t = 1.0, value_parser = share)]
    speed: f64,
}

/// The way to an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Dds,
    Rosbridge,
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

    /// Tries each joint by one degree, where that is asked for.
    pub fn nudge(&self, arm: &mut ConnectedArm, robot: &Robot, interrupt: &Interrupt) -> anyhow::Result<()> {
        if self.nudge { arm.nudge(robot, interrupt) } else { Ok(()) }
    }

    /// Connects to the arm, where one is named, and says what was heard of it.
    pub fn connect(&self, inputs: &mut crate::run::RunInputs) -> anyhow::Result<Option<ConnectedArm>> {
        let Some(arm) = &self.arm else { return Ok(None) };
        let (way, file) = match arm.split_once(':') {
            Some(("ros2", file)) => (Way::Dds, file),
            Some(("rosbridge", file)) => (Way::Rosbridge, file),
            _ => {
                let problem = "it must be ros2: or rosbridge: and a connection map, such as ros2:arm.toml";
                return Err(UsageError::new(Code::UsageInvalid, format!("--arm {arm}: {problem}")).into());
            }
        };
        for sensor in &mut inputs.robot.sensors {
            sensor.max_rate_rad_s *= self.speed;
        }
        ConnectedArm::open(way, file.as_ref(), inputs).map(Some)
    }
}

/// This build has no such part.
#[cfg(not(feature = "live"))]
pub(super) fn not_built(what: &str) -> anyhow::Error {
    UsageError::new(
        Code::BuildFeatureMissing,
        format!("{what}: this build of armcal knows no live arms; build it with `--features live`"),
    )
    .into()
}

#[cfg(not(feature = "live"))]
mod unconnected {
    use std::path::Path;

    use super::{Way, not_built};
    use crate::cli::interrupt::Interrupt;
    use crate::run::{Failure, Finished, RunInputs, RunOutput};
    use armcal_belief::session::Progress;
    use armcal_core::robot::Robot;

    /// There is none.
    pub enum ConnectedArm {}

    impl ConnectedArm {
        pub fn open(_: Way, _: &Path, _: &RunInputs) -> anyhow::Result<Self> {
            Err(not_built("--arm"))
        }

        pub fn nudge(&mut self, _: &Robot, _: &Interrupt) -> anyhow::Result<()> {
            match *self {}
        }

        pub fn execute(
            self,
            _: &RunInputs,
            _: u64,
            _: RunOutput<'_>,
            _: &mut dyn Progress,
        ) -> Result<Finished, Failure> {
            match self {}
        }
    }
}
