//! `armcal tagmap` on recordings of other programs and of ours, and the pinhole camera against OpenCV.

use std::path::{Path, PathBuf};

use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, ros};
use armcal::optics::{Fisheye, Radtan, square_corners};
use armcal::stats::stream_rng;
use armcal::tagmap::files::read_tags;
use armcal::time::{SIMULATION_EPOCH, Stamp};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;

use crate::support::texts::Texts;
use crate::support::{Answer, answer, edit, program, read, robot_folder, root, shared_run, temp, write};

#[derive(Deserialize)]
struct Pinholes {
    cameras: Vec<Pinhole>,
}

#[derive(Deserialize)]
struct Pinhole {
    name: String,
    resolution_px: [u32; 2],
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: [f64; 5],
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    point_in_camera_m: [f64; 3],
    pixel_px: [f64; 2],
}

#[test]
fn the_pinhole_camera_is_opencvs() {
    /// Tolerance, px: double precision at 1e3 px, with the terms summed in another order.
    const TOLERANCE_PX: f64 = 1e-9;
    let text = read(&root().join("tests/golden/radtan.json"));
    let file: Pinholes = serde_json::from_str(&text).expect("the golden file reads");
    assert_eq!(file.cameras.len(), 3);
    for camera in file.cameras {
        let lens = Radtan::new(camera.focal_px, camera.center_px, camera.distortion, camera.resolution_px);
        assert!(camera.cases.len() >= 100);
        for case in &camera.cases {
            let point = Vector3::from(case.point_in_camera_m);
            let pixel = lens.project(&point).expect("in view");
            let off_px = (pixel - Vector2::from(case.pixel_px)).amax();
            assert!(off_px < TOLERANCE_PX, "{}: {off_px} px", camera.name);
            let bearing = lens.unproject(&Vector2::from(case.pixel_px)).expect("in view");
            assert!(bearing.cross(&point.normalize()).norm() < 1e-12, "{}", camera.name);
        }
    }
}

/// A hall with six tags as recorded by another program, and its files.
struct Hall {
    folder: tempfile::TempDir,
    /// Poses hall_from_tag of the tags.
    truth: Vec<Isometry3<f64>>,
}

const CAMERAS: &str = "cam0:
  camera_model: pinhole
  intrinsics: [465.6, 465.6, 622.6, 513.9]
  distortion_model: equidistant
  distortion_coeffs: [-0.0229515, 0.01625, -0.00961832, 0.00176252]
  resolution: [1280, 1024]
  rostopic: /cam/image_raw
  tagtopic: /cam/tags
  rig_body: rig
";

const TAGS: &str = "default_body: hall
bodies:
 - hall:
     is_static: true
     default_tag_size: 0.2
     type: simple
     tags:
       - id: 2
         size: 0.2
         pose:
           position: {x: 1.0, y: 2.0, z: 0.5}
           rotation: {x: 0.0, y: 0.0, z: 1.5707963267948966}
           position_noise: {x: 0.0001, y: 0.0001, z: 0.0001}
           rotation_noise: {x: 0.00001, y: 0.00001, z: 0.00001}
       - id: 4
         size: 0.1
 - rig:
     is_static: false
     type: simple
";

const NOISE_PX: f64 = 0.2;

impl Hall {
    fn new() -> Self {
        let mut rng = stream_rng(5, "hall");
        let of_base = Isometry3::from_parts(
            Translation3::new(1.0, 2.0, 0.5),
            UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2),
        );
        let truth = (0..6).map(|id| {
            let place =
                Translation3::new(0.5 * f64::from(id - 2), rng.random_range(-0.3..0.3), rng.random_range(-0.2..0.2));
            let lean =
                Vector3::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), rng.random_range(-3.0..3.0));
            let pose = Isometry3::from_parts(place, UnitQuaternion::from_scaled_axis(lean));
            if id == 2 { of_base } else { of_base * pose }
        });
        let hall = Self { truth: truth.collect(), folder: temp() };
        write(&hall.file("cameras.yaml"), CAMERAS);
        write(&hall.file("tagslam.yaml"), TAGS);
        hall.record();
        hall
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn record(&self) {
        let mut rng = stream_rng(6, "hall's camera");
        let lens = Fisheye::with_widest_view(
            [465.6; 2],
            [622.6, 513.9],
            [-0.0229515, 0.01625, -0.00961832, 0.00176252],
            [1280, 1024],
        );
        let path = self.file("hall.mcap");
        let mut writer = RecordingWriter::create(&path, RecordingHeader::new(Vec::new())).expect("a file");
        for k in 0..40 {
            let base_from_camera = Isometry3::from_parts(
                Translation3::new(rng.random_range(-0.6..0.9), rng.random_range(-0.5..0.5), rng.random_range(0.9..1.4)),
                UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI)
                    * UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| rng.random_range(-0.3..0.3))),
            );
            let camera_from_hall = (self.truth[2] * base_from_camera).inverse();
            let detections = (0_i32..).zip(&self.truth).filter_map(|(id, pose)| {
                let size_m = if id == 4 { 0.1 } else { 0.2 };
                let mut corners = [ros::PixelPoint::default(); 4];
                for (corner, point) in corners.iter_mut().zip(square_corners(size_m)) {
                    let pixel = lens.project(&(camera_from_hall * pose * point).coords).filter(|p| lens.contains(p))?;
                    let [x, y]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                    *corner = ros::PixelPoint { x: pixel.x + NOISE_PX * x, y: pixel.y + NOISE_PX * y };
                }
                Some(ros::AprilTagDetection { family: "36h11".into(), id, corners, ..Default::default() })
            });
            let now = SIMULATION_EPOCH.plus_s(0.1 * f64::from(k));
            let array = ros::AprilTagDetectionArray { header: header(now), detections: detections.collect() };
            writer.write_ros("/cam/tags", &ros::AprilTagDetectionArray::SCHEMA, now, &array).expect("written");
        }
        writer.finish().expect("finished");
    }

    fn map(&self, more: &[&str]) -> Answer {
        let mut command = program();
        command.arg("tagmap").arg(self.file("hall.mcap")).arg("--camera").arg(self.file("cameras.yaml"));
        answer(command.arg("--tags").arg(self.file("tagslam.yaml")).args(more))
    }
}

fn header(stamp: Stamp) -> ros::Header {
    let time = ros::Time { sec: (stamp.nanos / 1_000_000_000) as i32, nanosec: (stamp.nanos % 1_000_000_000) as u32 };
    ros::Header { stamp: time, ..Default::default() }
}

#[test]
fn another_ones_recording_is_mapped_in_the_frame_of_its_own_file() {
    let hall = Hall::new();
    for name in ["map.toml", "map.yaml"] {
        let out = hall.file(name);
        let said = hall.map(&["--out", out.to_str().expect("text")]);
        said.expect(name, 0, &["2 (held)", "rejected     none"]);
        let is_of_table = |line: &&str| line.starts_with(['│', '┌', '╞', '└']);
        let widths: Vec<usize> = said.stdout.lines().filter(is_of_table).map(|line| line.chars().count()).collect();
        assert!(widths.len() > 8 && widths.iter().all(|width| *width <= 80), "{}", said.stdout);
        let map = read_tags(&out).expect("what was written reads");
        assert_eq!((map.frame.as_str(), map.tags.len()), ("hall", 6));
        for tag in &map.tags {
            let found = tag.pose.expect("a pose").translation.vector;
            let off_m = (found - hall.truth[tag.id as usize].translation.vector).norm();
            assert!(off_m < 0.003, "{name}: tag {}: {off_m} m", tag.id);
        }
    }
}

#[test]
fn a_map_that_was_written_serves_as_known() {
    let hall = Hall::new();
    let (map, again) = (hall.file("map.toml"), hall.file("again.toml"));
    hall.map(&["--out", map.to_str().expect("text")]).expect("first", 0, &[]);
    let mut command = program();
    command.arg("tagmap").arg(hall.file("hall.mcap")).arg("--camera").arg(hall.file("cameras.yaml"));
    command.arg("--tags").arg(&map).args(["--mode", "known", "--out"]).arg(&again);
    answer(&mut command).expect("known", 0, &["0 (held)", "5 (held)"]);
    let place = |file: &Path| read_tags(file).expect("reads").tags[0].pose.expect("a pose").translation.vector;
    assert!((place(&map) - place(&again)).norm() < 1e-12);
}

#[test]
fn a_map_does_not_overwrite_the_tags_that_it_starts_from() {
    let hall = Hall::new();
    let map = hall.file("map.toml");
    hall.map(&["--out", map.to_str().expect("text")]).expect("first", 0, &[]);
    let before = std::fs::read(&map).expect("a map");
    let mut command = program();
    command.arg("tagmap").arg(hall.file("hall.mcap")).arg("--camera").arg(hall.file("cameras.yaml"));
    command.arg("--tags").arg(&map).arg("--out").arg(&map);
    answer(&mut command).expect("itself", 2, &["map.toml", "[file_exists]"]);
    assert_eq!(std::fs::read(&map).expect("a map"), before);
}

#[test]
fn bad_input_is_refused_with_file_and_key() {
    let _texts = Texts::of("bad_input_is_refused_with_file_and_key");
    let hall = Hall::new();
    let with = |file: &str, from: &str, to: &str, code: i32, words: &[&str]| {
        let original = read(&hall.file(file));
        edit(&hall.file(file), from, to);
        hall.map(&[]).expect(to, code, words);
        write(&hall.file(file), &original);
    };
    with("cameras.yaml", "equidistant", "omni", 2, &["cameras.yaml: cam0.distortion_model", "radtan"]);
    with(
        "tagslam.yaml",
        "size: 0.1\n",
        "size: 0.0\n",
        2,
        &["tagslam.yaml: bodies.hall.tags: id 4: size", "0.001 .. 10"],
    );
    with("tagslam.yaml", "id: 2\n", "id: 77\n", 2, &["hall.mcap", "[77]", "[0, 1, 2, 3, 4, 5]"]);
    with("cameras.yaml", "/cam/tags", "/other/tags", 0, &[]);
    hall.map(&["--topic", "/none"]).expect("topic", 2, &["/none", "/cam/tags", "--topic"]);
    let out = hall.file("map.txt");
    hall.map(&["--out", out.to_str().expect("text")]).expect("form", 2, &["map.txt", ".toml"]);
    answer(program().args(["tagmap", "x.mcap"])).expect("usage", 2, &["--robot"]);
}

/// A line that replaces the size of tag 4.
fn size_off_by_ten(hall: &Hall) -> String {
    let place = hall.truth[4].translation.vector;
    let rotation = hall.truth[4].rotation.scaled_axis();
    format!(
        "size: 1.0\n         pose:\n           position: {{x: {:?}, y: {:?}, z: {:?}}}\n           \
         rotation: {{x: {:?}, y: {:?}, z: {:?}}}\n           position_noise: {{x: 0.001, y: 0.001, z: 0.001}}\n",
        place.x, place.y, place.z, rotation.x, rotation.y, rotation.z
    )
}

/// The page agrees with the table and begins with the warnings; it loads nothing from elsewhere.
#[test]
fn the_page_has_the_figures_of_the_table_and_the_warnings() {
    let hall = Hall::new();
    let page = hall.file("map.html");
    let said = hall.map(&["--out", page.to_str().expect("text")]);
    said.expect("a page", 0, &["2 (held)"]);
    let text = read(&page);
    let row = said.stdout.lines().find(|line| line.starts_with("│4 ")).expect("tag 4");
    for cell in row.split(['│', '┆']).map(str::trim).filter(|cell| !cell.is_empty()) {
        assert!(text.contains(&format!("<td>{cell}</td>")), "{cell}");
    }
    for word in ["`hall`", "reprojection", "<svg"] {
        assert!(text.contains(word), "{word}");
    }
    for outside in [" src=", " href=", "@import", "url(", "<script", "http:", "https:"] {
        assert!(!text.contains(outside), "{outside}");
    }
    edit(&hall.file("tagslam.yaml"), "size: 0.1\n", &size_off_by_ten(&hall));
    hall.map(&["--out", page.to_str().expect("text")]).expect("off by ten", 3, &[]);
    let text = read(&page);
    let [warning, table] = ["size_m", "<table"].map(|word| text.find(word));
    assert!(warning.is_some() && warning < table, "{warning:?} {table:?}");
}

/// The size is ten times too large, next to a tag of known distance.
#[test]
fn a_size_that_is_off_by_ten_is_warned_of() {
    let hall = Hall::new();
    edit(&hall.file("tagslam.yaml"), "size: 0.1\n", &size_off_by_ten(&hall));
    let said = hall.map(&[]);
    said.expect("off by ten", 3, &["0.10"]);
}

/// A recording of ours: the tags are mapped to their surveyed poses, within the simulated survey's error.
#[test]
fn our_own_recording_is_mapped_by_its_robot() {
    let folder = temp();
    let out = folder.path().join("map.toml");
    let mut command = program();
    command.arg("tagmap").arg(shared_run().file("run.mcap")).arg("--robot").arg(robot_folder()).arg("--out").arg(&out);
    answer(&mut command).expect("ours", 0, &["(held)", "/camera/wrist/detections"]);
    let map = read_tags(&out).expect("reads");
    let robot = armcal::robot::load(&robot_folder()).expect("the robot");
    assert!(map.tags.len() >= 5, "{}", map.tags.len());
    for tag in &map.tags {
        let surveyed = robot.tags.iter().find(|known| known.id == tag.id).expect("a tag of the survey");
        let off_m = (tag.pose.expect("a pose").translation.vector - surveyed.base_from_tag.origin().vector()).norm();
        assert!(off_m < 0.02, "tag {}: {off_m} m", tag.id);
    }
}
