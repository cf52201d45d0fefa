//! The closed loop of `run` and `drive`: output folder, progress, viewer, closing lines.

use std::io::stdin;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;
use armcal_core::codes::Code;
use clap::Args;

use crate::cli::closing::ClosingArgs;
use crate::cli::confirm::Confirm;
use crate::cli::exit::{Exit, of_summary};
use crate::cli::file_kind::expect_routine;
use crate::cli::interrupt::Interrupt;
use crate::cli::live_view::{LiveViewArgs, OpenView, ViewOf};
use crate::cli::overrides::OverrideArgs;
use crate::cli::own_inputs::spare_inputs;
use crate::cli::progress::Bar;
use crate::cli::stdout::warn;
use crate::output::{OutputFolder, RESULTS};
use crate::run::{Failure, Finished, Keep, RunInputs, RunOutput};
use armcal_belief::session::Progress;

/// Options of both commands.
#[derive(Debug, Args)]
pub(super) struct LoopArgs {
    /// Output folder; default: recordings/ROUTINE-NAME
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    view: LiveViewArgs,
    #[command(flatten)]
    closing: ClosingArgs,
    #[command(flatten)]
    overrides: OverrideArgs,
}

/// Confirmation before each motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Asking {
    /// The operator must confirm each motion on stdin.
    EachMotion,
    Nobody,
}

impl LoopArgs {
    pub fn inputs(&self, routine: &Path) -> Result<RunInputs> {
        expect_routine(routine)?;
        Ok(RunInputs::load(routine, &self.overrides.overrides())?)
    }

    /// Runs the loop by `execute`, and prints its result.
    pub fn carry_out(
        &self,
        inputs: &RunInputs,
        (started, interrupt): (Instant, Interrupt),
        asking: Asking,
        execute: impl FnOnce(RunOutput<'_>, &mut dyn Progress) -> Result<Finished, Failure>,
    ) -> Result<Exit> {
        let out = self.out.clone().unwrap_or_else(|| Path::new("recordings").join(&inputs.routine.name));
        let (routine, robot) = (&inputs.routine.name, &inputs.robot.name);
        tracing::info!("routine {routine}, robot {robot}, results in {}", out.display());
        RESULTS.iter().try_for_each(|name| spare_inputs(&out.join(name), [inputs.routine.file.as_path()]))?;
        let (folder, left_behind) = OutputFolder::open(&out)?;
        if let Some(kept) = left_behind {
            let text = "an earlier run into this folder did not end; its recording is now";
            warn(Code::RunLeftOver, format_args!("{text} {}", kept.display()));
        }
        let mut bar = Bar::new(started, interrupt);
        let of = ViewOf { robot: &inputs.robot, vehicle: Some(&inputs.vehicle), scene: Some(&inputs.routine.scene) };
        let view = self.view.open(&of)?;
        let listener = view.as_ref().map(|view| view.listener(Duration::ZERO));
        let output = RunOutput { folder: &folder, keep: Keep::Everything, listener };
        let result = match asking {
            Asking::EachMotion => execute(output, &mut Confirm::new(&mut bar, stdin().lock())),
            Asking::Nobody => execute(output, &mut bar),
        };
        bar.finish();
        view.into_iter().for_each(OpenView::end);
        self.say(&result.map_err(explained)?, &out)
    }

    fn say(&self, finished: &Finished, out: &Path) -> Result<Exit> {
        if let Some(why) = &finished.replay_failure {
            warn(Code::ReplayMissing, format_args!("no replay was written, all other files are complete: {why}"));
        }
        let shown = finished.kept.as_ref().map_or(out, |kept| &kept.folder).display();
        let next = format!("written      {shown}\nnext         {shown}/report.html; armcal replay {shown}/run.mcap");
        self.closing.say(&finished.summary, &next)?;
        if let Some(kept) = &finished.kept {
            warn(Code::ResultKept, format_args!("{}: {kept}", out.display()));
        }
        Ok(of_summary(&finished.summary))
    }
}

/// Adds the path of the recording that an interrupted run leaves.
fn explained(failure: Failure) -> anyhow::Error {
    let error = anyhow::Error::new(*failure.error);
    match failure.kept {
        Some(kept) => error.context(format!("the run broke off; its recording is {}", kept.display())),
        None => error,
    }
}
