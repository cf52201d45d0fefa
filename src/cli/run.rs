//! `armcal run`: the closed loop on a simulated arm, or on a real one.

use armcal_core::codes::Code;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Result;
use clap::Args;

use crate::cli::closing::ClosingArgs;
use crate::cli::confirm::Confirm;
use crate::cli::exit::{Exit, of_summary};
use crate::cli::file_kind::expect_routine;
use crate::cli::interrupt::Interrupt;
use crate::cli::live::LiveArgs;
use crate::cli::live_view::{LiveViewArgs, OpenView, ViewOf};
use crate::cli::overrides::OverrideArgs;
use crate::cli::progress::Bar;
use crate::cli::stdout::{note, warn};
use crate::output::OutputFolder;
use crate::run::{Failure, Keep, RunInputs, RunOutput, execute};
use armcal_belief::session::Progress;
use armcal_core::routine::Step;
use armcal_core::text::counted;
use armcal_sim::CameraMode;

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// Routine (.toml)
    routine: PathBuf,
    /// Seed of all random numbers; default: the routine's seed
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Output folder; default: recordings/ROUTINE-NAME
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Ask on stdin before each motion; y or Enter: go, h: hold, a: abort
    #[arg(long)]
    confirm: bool,
    #[command(flatten)]
    live: LiveArgs,
    #[command(flatten)]
    view: LiveViewArgs,
    #[command(flatten)]
    closing: ClosingArgs,
    #[command(flatten)]
    overrides: OverrideArgs,
}

pub(super) fn run(args: &RunArgs) -> Result<Exit> {
    let started = Instant::now();
    expect_routine(&args.routine)?;
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
    let (routine, robot) = (&inputs.routine.name, &inputs.robot.name);
    tracing::info!("routine {routine}, robot {robot}, seed {seed}, results in {}", out.display());
    let (output, left_behind) = OutputFolder::open(&out)?;
    if let Some(kept) = left_behind {
        let text = "an earlier run into this folder did not end; its recording is now";
        warn(Code::RunLeftOver, format_args!("{text} {}", kept.display()));
    }
    if let Some(foretold) = rendering_foretold(&inputs).filter(|_| arm.is_none()) {
        note(foretold);
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
        warn(Code::ReplayMissing, format_args!("no replay was written, all other files are complete: {why}"));
    }
    let written = finished.kept.as_ref().map_or(&out, |kept| &kept.folder);
    let shown = written.display();
    let next = format!("written      {shown}\nnext         {shown}/report.html; armcal replay {shown}/run.mcap");
    args.closing.say(&finished.summary, &next)?;
    if let Some(kept) = &finished.kept {
        warn(Code::ResultKept, format_args!("{}: {kept}", out.display()));
    }
    Ok(of_summary(&finished.summary))
}

/// Images while the arm stands for a view, over those in all: as many come while it is on its way. Measured.
const IMAGES_PER_VIEW_IMAGE: f64 = 2.0;
/// Frames of a view beside those of its dwell: the arm settles. Measured.
const SETTLING_FRAMES: f64 = 2.0;
/// Processor time to search and to render an image of this many pixels. One thread searches, all cores render the next
/// image meanwhile. Measured.
const USUAL_PIXELS: f64 = 1224.0 * 1024.0;
const SEARCHED_S: f64 = 0.05;
const RENDERED_S: f64 = 0.11;

/// How long a run takes that renders its images; `None` for one that renders none.
fn rendering_foretold(inputs: &RunInputs) -> Option<String> {
    let camera = &inputs.spec.camera;
    if camera.mode != CameraMode::Rendered {
        return None;
    }
    let frames = |step: &Step| match step {
        Step::Capture(capture) => {
            f64::from(capture.poses + capture.held_out) * (capture.dwell_s * camera.rate_hz + SETTLING_FRAMES)
        }
        _ => 0.0,
    };
    let images = IMAGES_PER_VIEW_IMAGE * inputs.routine.steps.iter().map(frames).sum::<f64>();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let [columns, rows] = inputs.robot.camera.lens.resolution_px().map(f64::from);
    let each_s = SEARCHED_S.max((SEARCHED_S + RENDERED_S) / cores as f64) * columns * rows / USUAL_PIXELS;
    Some(format!(
        "about {images:.0} images will be rendered and searched, in about {:.0} s on {}",
        images * each_s,
        counted(cores, "core")
    ))
}

/// Names the recording that a broken run leaves.
fn explained(failure: Failure) -> anyhow::Error {
    let error = anyhow::Error::new(*failure.error);
    match failure.kept {
        Some(kept) => error.context(format!("the run broke off; its recording is {}", kept.display())),
        None => error,
    }
}
