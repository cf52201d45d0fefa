//! `armcal study`: parts on their own, against known truth.

mod bound;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::{Args, Subcommand};

use self::paper::{PaperArgs, paper};
use self::poses::{PosesArgs, poses};
use crate::cli::exit::Exit;
use crate::cli::stdout::{note, say};
use crate::cli::study::bound::{BoundArgs, bound};
use crate::cli::study_dive::{DiveArgs, dive};
use crate::cli::study_dive_faults::{DiveFaultsArgs, dive_faults};
use crate::cli::study_falsified::{FalsifiedArgs, falsified};
use crate::cli::study_plan::{
    EdgesArgs, PathsArgs, SelfCollisionArgs, TrackingErrorArgs, edges, paths, self_collision, tracking_error,
};
use crate::cli::study_worlds::{WorldsArgs, worlds};
use crate::cli::waiting::Waiting;
use crate::output;
use armcal_core::optics::CameraModel;
use armcal_core::stats::quantile;
use armcal_detect::{DetectorSettings, GreyImage};
use armcal_sim::WaterKind;
use armcal_study::{
    StudyError, Watcher, conditions, conditions_csv, detection_study, fit_noise, report, trials_csv, truth_csv,
};

mod paper;
mod poses;

#[derive(Debug, Args)]
pub(super) struct StudyArgs {
    #[command(subcommand)]
    study: Study,
}

#[derive(Debug, Subcommand)]
enum Study {
    /// Render tags at set ranges and incidences in three kinds of water, detect them, and compare with the truth
    Detection(DetectionArgs),
    /// Compare the paper's methods with least squares and with the bound, on landmark positions with noise
    Paper(PaperArgs),
    /// Certify random edges of an arm and scan each by brute force
    Edges(EdgesArgs),
    /// Plan between random poses at several sites, under wide and narrow bounds
    Paths(PathsArgs),
    /// Find which links of an arm can come near each other, and store it in the robot's folder
    #[command(alias = "pairs")]
    SelfCollision(SelfCollisionArgs),
    /// Measure how far the joints of a recording left the straight lines of their set-points
    #[command(alias = "stray")]
    TrackingError(TrackingErrorArgs),
    /// Choose poses by each criterion and at random, and compare the tool error that they leave
    Poses(PosesArgs),
    /// Falsify drawing, survey or a sensor after a capture, and compare the verdict with the truth
    Falsified(FalsifiedArgs),
    /// Run a routine in worlds drawn from all that `[world]` allows, and look for what must not be
    Worlds(WorldsArgs),
    /// Run a closed loop for several seeds, and compare the tool error with the Bayesian bound of the views
    Bound(BoundArgs),
    /// Run a dive for several seeds, follow each recording online, and compare the belief with the truth at each task
    Dive(DiveArgs),
    /// Run dives with each kind of fault, and compare when it is named with when an oracle could tell it
    DiveFaults(DiveFaultsArgs),
}

#[derive(Debug, Args)]
struct DetectionArgs {
    /// Folder for trials.csv, conditions.csv and report.txt
    #[arg(long, value_name = "DIR", default_value = "recordings/study-detection")]
    out: PathBuf,
    /// Robot folder whose camera it is
    #[arg(long, value_name = "DIR", default_value = "robots/titan4")]
    robot: PathBuf,
    /// Images under each condition
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Seed of places and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Image decimation for the quad search: side of the blocks of pixels taken for one, px
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    decimation: f32,
    /// The same of the second search, in an image of normalized contrast, px; 0 for none
    #[arg(long, value_name = "N", default_value_t = 2.0)]
    second_decimation: f32,
    /// Folder for the images (PNG) and truth.csv, for other detectors
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
}

pub(super) fn study(args: &StudyArgs) -> Result<Exit> {
    match &args.study {
        Study::Detection(args) => detection(args),
        Study::Paper(args) => paper(args),
        Study::Edges(args) => edges(args),
        Study::Paths(args) => paths(args),
        Study::SelfCollision(args) => self_collision(args),
        Study::TrackingError(args) => tracking_error(args),
        Study::Poses(args) => poses(args),
        Study::Falsified(args) => falsified(args),
        Study::Worlds(args) => worlds(args),
        Study::Bound(args) => bound(args),
        Study::Dive(args) => dive(args),
        Study::DiveFaults(args) => dive_faults(args),
    }
}

fn detection(args: &DetectionArgs) -> Result<Exit> {
    let lens: CameraModel = armcal_core::robot::load(&args.robot)?.camera.lens;
    let settings = DetectorSettings {
        decimation: args.decimation,
        second_decimation: args.second_decimation,
        ..DetectorSettings::default()
    };
    output::make_folder(&args.out)?;
    if let Some(folder) = &args.images {
        output::make_folder(folder)?;
    }
    let mut clock = Clock { start: Instant::now(), images: args.images.as_deref(), waiting: None };
    let study = detection_study(&lens, &settings, &conditions(args.repeats), args.seed, &mut clock)?;
    let fitted = [WaterKind::Clear, WaterKind::Coastal, WaterKind::Turbid].map(|water| fit_noise(&study, water));
    let text = report(&study, &fitted);
    let write = |folder: &Path, name: &str, text: &str| {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("{}: cannot be written", path.display()))
    };
    write(&args.out, "trials.csv", &trials_csv(&study))?;
    write(&args.out, "conditions.csv", &conditions_csv(&study))?;
    write(&args.out, "report.txt", &text)?;
    if let Some(folder) = &args.images {
        write(folder, "truth.csv", &truth_csv(&study))?;
        let ms = 1e3 * quantile(&study.detect_s, 0.5).unwrap_or(f64::NAN);
        write(folder, "time_ms.txt", &format!("{ms:.2}"))?;
    }
    say(&format!("{text}written      {}", args.out.display()))?;
    Ok(Exit::Ok)
}

struct Clock<'a> {
    start: Instant,
    images: Option<&'a Path>,
    waiting: Option<Waiting>,
}

impl Watcher for Clock<'_> {
    fn wall_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn image(&mut self, name: &str, image: GreyImage, n_done: usize, n_all: usize) -> Result<(), StudyError> {
        let waiting =
            self.waiting.get_or_insert_with(|| Waiting::for_each_of(n_all as u64, "rendering and searching images"));
        waiting.one_more();
        if n_done.is_multiple_of(50) && !waiting.is_seen() {
            note(format_args!("{n_done} of {n_all} images"));
        }
        let Some(folder) = self.images else { return Ok(()) };
        let path = folder.join(name);
        let size = [image.width, image.height].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
        image::save_buffer(&path, image.data, size[0], size[1], image::ExtendedColorType::L8)
            .map_err(|error| StudyError::Watcher(format!("{}: {error}", path.display())))
    }
}
