//! `armcal run`: the closed loop on a simulated arm, or on a real one.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;

use crate::cli::closing::say_closing;
use crate::cli::confirm::Confirm;
use crate::cli::exit::{Exit, of_summary};
use crate::cli::interrupt::Interrupt;
use crate::cli::live::LiveArgs;
use crate::cli::live_view::{LiveViewArgs, OpenView, ViewOf};
use crate::cli::overrides::OverrideArgs;
use crate::cli::progress::Bar;
use crate::cli::stdout::note;
use crate::output::OutputFolder;
use crate::report::table;
use crate::run::{Failure, Keep, RunInputs, RunOutput, execute};
use armcal_belief::session::Progress;

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
    /// Ask on stdin before each motion: y or nothing goes on, h holds, a aborts
    #[arg(long)]
    confirm: bool,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    view: LiveViewArgs,
    #[command(flatten)]
    overrides: OverrideArgs,
}

pub(super) fn run(args: &RunArgs) -> Result<Exit> {
    let started = Instant::now();
    let mut inputs = RunInputs::load(&args.routine, &args.overrides.overrides())?;
    let mut arm = args.live.connect(&mut inputs)?;
    if args.live.no_motion {
        return Ok(Exit::Ok);
    }
    let interrupt = Interrupt::install()?;
    if let Some(arm) = &mut arm {
        args.live.nudge(arm, &inputs.robot, &interrupt)?;
    }
    let seed = args.seed.unwrap_or(inputs.routine.seed);
    let out = args.out.clone().unwrap_or_else(|| Path::new("recordings").join(&inputs.routine.name));
    let (output, left_behind) = OutputFolder::open(&out)?;
    if let Some(kept) = left_behind {
        note(format_args!(
            "warning: an earlier run into this folder did not end; its recording is now {}",
            kept.display()
        ));
    }
    let mut bar = Bar::new(started, interrupt);
    let of = ViewOf { robot: &inputs.robot, vehicle: Some(&inputs.vehicle), scene: Some(&inputs.routine.scene) };
    let view = args.view.open(&of)?;
    let listener = view.as_ref().map(|view| view.listener(Duration::ZERO));
    let run = |progress: &mut dyn Progress| {
        let output = RunOutput { folder: &output, keep: Keep::Everything, listener };
        match arm {
            Some(arm) => arm.execute(&inputs, seed, output, progress),
            None => execute(&inputs, seed, output, progress),
        }
    };
    let result = if args.confirm || args.live.is_attended() {
        run(&mut Confirm::new(&mut bar, std::io::stdin().lock()))
    } else {
        run(&mut bar)
    };
    bar.finish();
    view.into_iter().for_each(OpenView::end);
    let finished = result.map_err(explained)?;
    if let Some(why) = &finished.replay_failure {
        note(format_args!("warning: there is no replay, all other files are whole: {why}"));
    }
    let shown = out.display();
    say_closing(&format!(
        "{}\nwritten      {shown}\nnext         {shown}/report.html; armcal replay {shown}/run.mcap",
        table(&finished.summary)
    ))?;
    Ok(of_summary(&finished.summary))
}

/// Names the recording that a broken run leaves.
fn explained(failure: Failure) -> anyhow::Error {
    let error = anyhow::Error::new(*failure.error);
    match failure.kept {
        Some(kept) => error.context(format!("the run broke off; its recording is {}", kept.display())),
        None => error,
    }
}
