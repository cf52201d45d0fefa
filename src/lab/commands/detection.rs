//! `armcal-lab detection`: tags rendered, detected and compared with the truth.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result};
use clap::Args;

use armcal::cli::Exit;
use armcal::cli::Waiting;
use armcal::cli::{note, say};
use armcal::output;
use armcal_core::optics::CameraModel;
use armcal_core::stats::quantile;
use armcal_detect::{DetectorSettings, GreyImage};
use armcal_lab::{
    StudyError, Watcher, conditions, conditions_csv, detection_study, fit_noise, report, trials_csv, truth_csv,
};
use armcal_sim::WaterKind;

#[derive(Debug, Args)]
pub(super) struct DetectionArgs {
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

pub(super) fn detection(args: &DetectionArgs) -> Result<Exit> {
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
