//! Ten rendered runs calibrated from their images only, next to the runs' own results: docs/reference/real-arms.md.
//!
//! `cargo bench --bench image_seeds` takes an hour, and two with `ARMCAL_IMAGE_ALL=1`, which uses the images between
//! the views as well. `ARMCAL_IMAGE_SEEDS=N` runs fewer seeds. Runs and results stay in target/image-seeds, or in the
//! folder `ARMCAL_IMAGE_FOLDER`, and are reused. It fails if the images give another result than the runs.

#![allow(clippy::print_stdout, reason = "the table is what it is run for")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use armcal::calib::Calibration;
use armcal::log::{Recording, TopicMap, for_each_raw, read_recording, topics};
use armcal::robot::{Robot, load};
use armcal::stats::{quantile, stream_rng};
use armcal::streams::{MarkKind, Message};
use armcal::time::Stamp;
use armcal::verify::{Belief, reaches};
use rand::RngExt;

const MAP: &str = "version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/joint_sensors\"\n[tags]\n\
    topic = \"/camera/wrist/image/compressed\"\nuse = \"corners\"\n[conditions]\n\
    oil_temperature = \"/temperature/oil\"\npressure = \"/depth_pressure\"\n";

fn setting(name: &str) -> Option<String> {
    std::env::var(name).ok()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn robot_folder() -> PathBuf {
    root().join("robots/titan4")
}

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_armcal"))
}

/// Runs the program to a verdict; a refusal is a result, too.
fn verdict(command: &mut Command) {
    let status = command.status().expect("the program starts");
    assert!(matches!(status.code(), Some(0 | 4)), "{command:?}: {status}");
}

/// Choice of the images that are searched.
#[derive(Clone, Copy)]
enum Images {
    /// Images of the views that the run's own calibration had.
    OfViews,
    All,
}

impl Images {
    fn name(self) -> &'static str {
        match self {
            Self::OfViews => "views",
            Self::All => "all",
        }
    }
}

/// Writes the recording without detections, marks and the unwanted images.
fn strip(run: &Path, to: &Path, images: Images) {
    let map = TopicMap { only: Some([armcal::log::Stream::Marks].into()), ..TopicMap::default() };
    let marks = armcal::log::read_recording_with(run, &map).expect("it reads").messages;
    let spans: Vec<(Stamp, Stamp)> = marks
        .iter()
        .filter_map(|(_, message)| match message {
            Message::Mark(mark) if matches!(mark.kind, MarkKind::Capture { .. }) => Some((mark.start, mark.end)),
            _ => None,
        })
        .collect();
    let kept = ["/joint_sensors", "/temperature/oil", "/depth_pressure"];
    let file = std::fs::File::create(to).expect("a file");
    let mut writer = mcap::WriteOptions::new().compression_threads(0).create(file).expect("begun");
    for_each_raw(run, |raw| {
        let in_view = || spans.iter().any(|(start, end)| (*start..=*end).contains(&raw.log_time()));
        let is_wanted = matches!(images, Images::All) || in_view();
        if !(kept.contains(&raw.topic()) || raw.topic() == topics::IMAGES && is_wanted) {
            return;
        }
        let schema = raw.channel.schema.as_ref().expect("a type");
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).expect("a type");
        let channel_id = writer.add_channel(schema, raw.topic(), "cdr", &BTreeMap::new()).expect("a topic");
        let (sequence, log_time) = (raw.sequence, raw.log_time_nanos);
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, raw.data).expect("written");
    })
    .expect("it reads");
    writer.finish().expect("finished");
}

/// One run.
struct Seed {
    folder: PathBuf,
}

impl Seed {
    fn new(folder: &Path, seed: u64) -> Self {
        let folder = folder.join(format!("seed-{seed}"));
        if !folder.join("run.mcap").exists() {
            let mut command = program();
            command.arg("run").arg(root().join("routines/titan4-rendered.toml")).arg("--seed").arg(seed.to_string());
            // The run logs every searched image instead of one per second, because its views hold several.
            command.args(["--set", "world.image.log_period_s=0.0"]);
            verdict(command.arg("--out").arg(&folder));
        }
        Self { folder }
    }

    fn own(&self) -> Calibration {
        Calibration::read(&self.folder.join("calibration.toml")).expect("it reads")
    }

    fn calibrated_by(&self, images: Images) -> Calibration {
        let out = self.folder.join(images.name());
        let result = out.join("calibration.toml");
        if !result.exists() {
            let (stripped, map) = (self.folder.join("stripped.mcap"), self.folder.join("map.toml"));
            strip(&self.folder.join("run.mcap"), &stripped, images);
            std::fs::write(&map, MAP).expect("written");
            let mut command = program();
            command.arg("calibrate").arg(&stripped).arg("--robot").arg(robot_folder()).arg("--input").arg(map);
            verdict(command.arg("--out").arg(out));
            std::fs::remove_file(stripped).expect("removed");
        }
        Calibration::read(&result).expect("it reads")
    }

    /// Distance of the estimated from the true tool at each target that was reached, m.
    fn tool_errors_m(&self, robot: &Robot, recording: &Recording, found: &Calibration) -> Vec<f64> {
        let sensors = found.sensors(robot).expect("this robot");
        let belief = Belief { from: Stamp { nanos: 0 }, sensors: &sensors, links: found.link_corrections() };
        let truth = armcal::sim::truth::read_truth(self.folder.join("truth.mcap")).expect("it reads");
        let error_m = |rest: &armcal::verify::ReachRest| {
            let state = truth.state_at(rest.start.plus_s(0.5 * rest.end.since_s(rest.start)))?;
            Some((rest.believed_tool.origin().vector() - state.base_from_tool.origin().vector()).norm())
        };
        reaches(recording, robot, &[belief]).iter().filter_map(error_m).collect()
    }
}

/// Largest difference of a gain or an offset from the run's own, over its sigma; and the largest difference of a gain.
fn differences(own: &Calibration, other: &Calibration) -> (f64, f64, String) {
    let (mut farthest, mut gain, mut which) = (0.0, 0.0_f64, String::new());
    for (a, b) in own.joint.iter().zip(&other.joint) {
        let of_gain = (b.gain_rad_per_count - a.gain_rad_per_count).abs();
        let parameters = [
            (a.gain_estimated, of_gain / a.gain_std_rad_per_count, "gain"),
            (a.offset_estimated, (b.offset_rad - a.offset_rad).abs() / a.offset_std_rad, "offset"),
        ];
        for (_, sigmas, name) in parameters.into_iter().filter(|(is_estimated, ..)| *is_estimated) {
            if sigmas > farthest {
                (farthest, which) = (sigmas, format!("{} {name}", a.name));
            }
        }
        if a.gain_estimated {
            gain = gain.max(of_gain / a.gain_rad_per_count.abs());
        }
    }
    (farthest, gain, which)
}

/// 95 % interval of the mean log ratio, by the bootstrap over seeds, as ratios.
fn ratio_interval(logs: &[f64]) -> [f64; 2] {
    let mut rng = stream_rng(1, "image seeds");
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let drawn = |rng: &mut rand_chacha::ChaCha8Rng| -> Vec<f64> {
        logs.iter().map(|_| logs[RngExt::random_range(rng, 0..logs.len())]).collect()
    };
    let means: Vec<f64> = (0..4000).map(|_| mean(&drawn(&mut rng))).collect();
    [0.025, 0.975].map(|q| quantile(&means, q).expect("values").exp())
}

fn main() {
    // Without this check `cargo test --all-targets` would run the benchmark.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let folder = setting("ARMCAL_IMAGE_FOLDER").map_or_else(|| root().join("target/image-seeds"), PathBuf::from);
    let n_seeds: u64 = setting("ARMCAL_IMAGE_SEEDS").map_or(10, |n| n.parse().expect("a number of seeds"));
    let robot = load(&robot_folder()).expect("the robot reads");
    println!(
        "| seed | images of | views | farthest parameter, sigma | which | gains, % | tool error, own, mm | images, mm |"
    );
    println!("|--:|---|--:|--:|---|--:|--:|--:|");
    let mut farthest: BTreeMap<&str, f64> = BTreeMap::new();
    let mut logs: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for seed in 1..=n_seeds {
        let run = Seed::new(&folder, seed);
        let own = run.own();
        let recording = read_recording(run.folder.join("run.mcap")).expect("it reads");
        let median_mm =
            |found: &Calibration| 1e3 * quantile(&run.tool_errors_m(&robot, &recording, found), 0.5).unwrap();
        let own_mm = median_mm(&own);
        let all = setting("ARMCAL_IMAGE_ALL").map(|_| Images::All);
        for images in [Images::OfViews].into_iter().chain(all) {
            let found = run.calibrated_by(images);
            let (sigmas, gain, which) = differences(&own, &found);
            let images_mm = median_mm(&found);
            let name = images.name();
            let views = found.fit.views;
            println!(
                "| {seed} | {name} | {views} | {sigmas:.2} | {which} | {:.3} | {own_mm:.2} | {images_mm:.2} |",
                1e2 * gain
            );
            let most = farthest.entry(name).or_default();
            *most = most.max(sigmas);
            logs.entry(name).or_default().push((images_mm / own_mm).ln());
        }
    }
    for (name, logs) in &logs {
        let [low, high] = ratio_interval(logs);
        println!("{name}: farthest {:.2} sigma; ratio of tool errors {low:.3} .. {high:.3}", farthest[name]);
    }
    let [low, high] = ratio_interval(&logs["views"]);
    assert!(low <= 1.0 && 1.0 <= high, "{low:.3} .. {high:.3}");
    assert!(farthest["views"] < 0.3, "{:.2} sigma", farthest["views"]);
}
