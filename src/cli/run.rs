//! `armcal run`: the closed loop on a simulated arm.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::Result;
use clap::Args;

use crate::cli::closed_loop::{Asking, LoopArgs};
use crate::cli::exit::Exit;
use crate::cli::interrupt::Interrupt;
use crate::cli::named;
use crate::cli::stdout::note;
use crate::run::{RunInputs, execute};
use armcal_core::routine::Step;
use armcal_core::text::counted;
use armcal_sim::CameraMode;

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// Routine (.toml), or the name of one that comes with armcal
    #[arg(value_parser = named::routine())]
    routine: PathBuf,
    /// Seed of all random numbers; default: the routine's seed
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Ask on stdin before each motion; y or Enter: go, h: hold, a: abort
    #[arg(long)]
    confirm: bool,
    #[command(flatten)]
    closed_loop: LoopArgs,
}

pub(super) fn run(args: &RunArgs) -> Result<Exit> {
    let started = Instant::now();
    let inputs = args.closed_loop.inputs(&args.routine)?;
    let interrupt = Interrupt::install()?;
    let seed = args.seed.unwrap_or(inputs.routine.seed);
    if let Some(foretold) = rendering_foretold(&inputs) {
        note(foretold);
    }
    let asking = if args.confirm { Asking::EachMotion } else { Asking::Nobody };
    args.closed_loop
        .carry_out(&inputs, (started, interrupt), asking, |output, progress| execute(&inputs, seed, output, progress))
}

/// Ratio of all images to those while the arm stands for a view: as many images come while it moves. Measured.
const IMAGES_PER_VIEW_IMAGE: f64 = 2.0;
/// Number of frames of a view beyond those of its dwell, while the arm settles. Measured.
const SETTLING_FRAMES: f64 = 2.0;
/// Number of pixels of an image to which the processor times for searching and rendering apply. One thread searches
/// while all cores render the next image. Measured.
const USUAL_PIXELS: f64 = 1224.0 * 1024.0;
const SEARCHED_S: f64 = 0.05;
const RENDERED_S: f64 = 0.11;

/// Estimated time of a run that renders its images; `None` for one that renders none.
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
