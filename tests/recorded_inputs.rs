//! Further contents of real arms' recordings: slow sensors and images; and proposed input maps.

use std::path::Path;

use armcal::calib::{ExternalContext, prepare_external};
use armcal::input::{RawMeasurement, parse_input_map, read_camera_info, read_external, read_external_images};
use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, ros};
use armcal::optics::{CameraModel, Radtan, TagFamily, square_corners};
use armcal::recorded_images::RecordedImageDetector;
use armcal::robot::Robot;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2};

use crate::support::external::{AS_IN_2018, INPUT_MAP, RealTitan, at, header, joint_state, transform, write_poses};
use crate::support::texts::Texts;
use crate::support::{answer, program, read, robot_folder, temp, titan, write};

const CONDITIONS: &str = "[conditions]\noil_temperature = \"/oil\"\npressure = \"/depth\"\n";

/// Writes a Titan whose oil warms by 0.1 K each pose while it sinks by 1 kPa; `oil_c` is that of the first pose.
fn write_dive(path: &Path, titan: &RealTitan, oil_c: f64) {
    let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
    for (k, pose) in titan.poses.iter().enumerate() {
        let (now, later) = (at(pose.joints_at_s), at(pose.tags_at_s));
        let joints = joint_state(now, &pose.joints);
        writer.write_ros("/joint_states", &ros::JointState::SCHEMA, now, &joints).expect("written");
        let transforms = pose.tags.iter().map(|(frame, tag)| transform(later, "fisheye", frame, tag)).collect();
        writer.write_ros("/tf", &ros::TfMessage::SCHEMA, later, &ros::TfMessage { transforms }).expect("written");
        // The thermometer reports half a second before and after the image; the value between counts.
        for off_s in [-0.5, 0.5] {
            let stamp = later.plus_s(off_s);
            let temperature = oil_c + 0.1 * (k as f64 + off_s);
            let oil = ros::Temperature { header: header(stamp, ""), temperature, variance: 0.0 };
            writer.write_ros("/oil", &ros::Temperature::SCHEMA, stamp, &oil).expect("written");
        }
        let fluid_pressure = 101_325.0 + 1000.0 * k as f64;
        let depth = ros::FluidPressure { header: header(later, ""), fluid_pressure, variance: 0.0 };
        writer.write_ros("/depth", &ros::FluidPressure::SCHEMA, later, &depth).expect("written");
    }
    writer.finish().expect("finished");
}

#[test]
fn oil_temperature_and_pressure_reach_the_views() {
    let folder = temp();
    let (robot, titan) = (titan(), RealTitan::new(&titan(), 12, AS_IN_2018, 21));
    let path = folder.path().join("arm.mcap");
    write_dive(&path, &titan, 20.0);
    let tags = folder.path().join("tags.toml");
    write(&tags, &titan.tag_map());
    let prepared = |text: &str| {
        let map = parse_input_map(Path::new("map.toml"), text).expect("a map");
        let landmarks = armcal::tagmap::files::read_landmarks(&tags).expect("it reads");
        let robot = robot.clone().with_survey(landmarks.survey(&tags, &robot, map.tag_use).expect("a survey").survey);
        let recording = read_external(&path, &map, &robot).expect("it reads");
        prepare_external(&[recording], &map, &robot, ExternalContext::default()).expect("views")
    };
    let with = prepared(&format!("{INPUT_MAP}{CONDITIONS}"));
    assert_eq!(with.data.fit.len(), 12);
    for (k, view) in with.data.fit.iter().enumerate() {
        let oil_c = view.conditions.oil_c.expect("a temperature");
        assert!((oil_c - 20.0 - 0.1 * k as f64).abs() < 1e-9, "{k}: {oil_c}");
        assert_eq!(view.conditions.pressure_pa, Some(101_325.0 + 1000.0 * k as f64));
    }
    let without = prepared(INPUT_MAP);
    assert!(without.data.fit.iter().all(|view| view.conditions.oil_c.is_none()));
    // The hash includes all inputs in use: other temperatures give another hash.
    assert!(without.messages_hash != with.messages_hash);
    write_dive(&path, &titan, 21.0);
    assert!(prepared(&format!("{INPUT_MAP}{CONDITIONS}")).messages_hash != with.messages_hash);
    assert_eq!(prepared(INPUT_MAP).messages_hash, without.messages_hash);
}

#[test]
fn slow_sensors_that_are_not_as_the_map_says_are_refused() {
    let folder = temp();
    let titan = RealTitan::new(&titan(), 12, AS_IN_2018, 22);
    let path = folder.path().join("arm.mcap");
    let problem = |text: &str| {
        let map = parse_input_map(Path::new("map.toml"), text).expect("a map");
        read_external(&path, &map, &crate::support::titan()).expect_err("refused").to_string()
    };
    write_dive(&path, &titan, f64::NAN);
    let text = format!("{INPUT_MAP}{CONDITIONS}");
    let found = problem(&text);
    assert!(["/oil", "message 1", "temperature", "NaN"].iter().all(|word| found.contains(word)), "{found}");
    let lenient = text.replace("[joint_sensors]", "not_finite = \"leave_out\"\n[joint_sensors]");
    let map = parse_input_map(Path::new("map.toml"), &lenient).expect("a map");
    let left = read_external(&path, &map, &crate::support::titan()).expect("it reads").left_out;
    assert_eq!(left.values().sum::<u64>(), 24, "{left:?}");
    let exchanged = text.replace("\"/oil\"", "\"/x\"").replace("/depth", "/oil").replace("/x", "/depth");
    assert!(problem(&exchanged).contains("sensor_msgs/msg/"), "{}", problem(&exchanged));
    assert!(problem(&text.replace("/oil", "/no_oil")).contains("/no_oil"));
}

/// A pinhole camera and a wall with one tag.
struct Camera {
    lens: CameraModel,
    family: TagFamily,
    camera_from_tag: Isometry3<f64>,
}

const ID: u32 = 7;
const SIZE_M: f64 = 0.16;
const RESOLUTION: [u32; 2] = [320, 240];

impl Camera {
    fn before_a_tag_of(family: TagFamily) -> Self {
        let lens = Radtan::new([260.0, 262.0], [158.5, 121.0], [-0.05, 0.01, 0.001, -0.001, 0.0], RESOLUTION).into();
        let turn = UnitQuaternion::from_euler_angles(std::f64::consts::PI + 0.2, -0.15, 0.3);
        Self { lens, family, camera_from_tag: Isometry3::from_parts(Translation3::new(0.03, -0.02, 0.5), turn) }
    }

    /// Grey values: each pixel is the mean of 16 rays onto the plane of the tag.
    fn image(&self) -> Vec<u8> {
        let cells = self.family.cells(ID).expect("an id");
        let (n, margin) = (self.family.n_cells() as f64, self.family.n_margin_cells() as f64);
        let tag_from_camera = self.camera_from_tag.inverse();
        let grey = |pixel: Vector2<f64>| {
            let Some(ray) = self.lens.unproject(&pixel) else { return 90.0 };
            let (origin, along) = (tag_from_camera.translation.vector, tag_from_camera.rotation * ray.into_inner());
            let on_wall = origin - along * (origin.z / along.z);
            let cell = |value: f64| (value / SIZE_M * n + 0.5 * n + margin).floor();
            let (column, row) = (cell(on_wall.x), cell(-on_wall.y));
            let is_print = column >= 0.0 && row >= 0.0;
            match cells.get(row as usize, column as usize).filter(|_| is_print) {
                Some(false) => 30.0,
                Some(true) => 200.0,
                None => 90.0,
            }
        };
        let [width, height] = RESOLUTION.map(f64::from);
        let mut image = Vec::new();
        for k in 0..(width * height) as usize {
            let (x, y) = ((k % width as usize) as f64, (k / width as usize) as f64);
            let at = |n: usize| Vector2::new(x - 0.375 + 0.25 * (n % 4) as f64, y - 0.375 + 0.25 * (n / 4) as f64);
            image.push(((0..16).map(|n| grey(at(n))).sum::<f64>() / 16.0).round() as u8);
        }
        image
    }

    fn info(&self) -> ros::CameraInfo {
        ros::CameraInfo {
            width: RESOLUTION[0],
            height: RESOLUTION[1],
            distortion_model: "plumb_bob".into(),
            d: vec![-0.05, 0.01, 0.001, -0.001, 0.0],
            k: [260.0, 0.0, 158.5, 0.0, 262.0, 121.0, 0.0, 0.0, 1.0],
            ..ros::CameraInfo::default()
        }
    }

    /// Writes one pose of the arm, and the image in four forms a second apart.
    fn write(&self, path: &Path, robot: &Robot) {
        let grey = self.image();
        let (width, height) = (RESOLUTION[0], RESOLUTION[1]);
        let raw = |encoding: &str, n_channels: u32, data: Vec<u8>| ros::Image {
            header: header(at(1.0), "/wrist"),
            encoding: encoding.into(),
            step: width * n_channels,
            data,
            width,
            height,
            ..ros::Image::default()
        };
        let colour: Vec<u8> = grey.iter().flat_map(|value| [*value; 3]).collect();
        let mut png = Vec::new();
        image::GrayImage::from_raw(width, height, grey.clone())
            .expect("a picture")
            .write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)
            .expect("written");
        let png = ros::CompressedImage { header: header(at(1.0), "wrist"), format: "png".into(), data: png };
        let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
        let names: Vec<(String, f64)> = robot.joint_names().into_iter().map(|joint| (joint, 30_000.0)).collect();
        writer.write_ros("/joints", &ros::JointState::SCHEMA, at(1.0), &joint_state(at(1.0), &names)).expect("written");
        writer.write_ros("/info", &ros::CameraInfo::SCHEMA, at(1.0), &self.info()).expect("written");
        for (topic, image) in [("/mono8", raw("mono8", 1, grey)), ("/bgr8", raw("bgr8", 3, colour))] {
            writer.write_ros(topic, &ros::Image::SCHEMA, at(1.0), &image).expect("written");
        }
        writer.write_ros("/png", &ros::CompressedImage::SCHEMA, at(1.0), &png).expect("written");
        let cut = ros::CompressedImage { data: png.data[..100].to_vec(), ..png };
        writer.write_ros("/cut", &ros::CompressedImage::SCHEMA, at(1.0), &cut).expect("written");
        writer.finish().expect("finished");
    }
}

fn image_map(topic: &str) -> String {
    format!(
        "version = 1\nkind = \"input\"\n\
         [joint_sensors]\ntopic = \"/joints\"\n[tags]\ntopic = \"{topic}\"\ncamera_frame = \"wrist\"\n\
         use = \"corners\"\ncamera_info = \"/info\"\n"
    )
}

/// Expects tags of a family that only the robot names: the input map has none.
fn expect_tags_of_a_named_family_to_be_found(families: &[TagFamily]) {
    let (folder, robot) = (temp(), titan());
    for &family in families {
        let recording = folder.path().join(format!("{family}.mcap"));
        Camera::before_a_tag_of(family).write(&recording, &robot);
        let with_family = image_map("/png").replace("[tags]", &format!("[tags]\nfamily = \"{family}\""));
        let read = |text: &str| {
            let map = parse_input_map(Path::new("map.toml"), text).expect("a map");
            let lens = read_camera_info(&recording, "/info").expect("a lens").lens;
            let family = map.tag_family.unwrap_or(robot.tag_family);
            read_external_images(&recording, &map, &robot, &mut RecordedImageDetector::new([&lens], family))
        };
        let found = read(&with_family).expect("a tag");
        assert_eq!(found.frames[0].tags[0].id, Some(ID), "{family}");
        match (read(&image_map("/png")), family) {
            (Ok(found), TagFamily::Tag36h11) => assert_eq!(found.frames[0].tags[0].id, Some(ID)),
            (Err(problem), other) if other != TagFamily::Tag36h11 => {
                let text = problem.to_string();
                assert!(text.contains("no tag of family 36h11") && text.contains("`family` in [tags]"), "{text}");
            }
            (other, _) => panic!("{family}: {other:?}"),
        }
    }
}

#[test]
fn tags_of_the_family_that_the_input_map_names_are_found() {
    expect_tags_of_a_named_family_to_be_found(&[TagFamily::Tag36h11, TagFamily::Tag25h9]);
}

#[test]
#[ignore = "second tier: all families, 4 s"]
fn tags_of_each_family_that_the_input_map_names_are_found() {
    expect_tags_of_a_named_family_to_be_found(&TagFamily::ALL);
}

#[test]
fn tags_are_found_in_recorded_images_of_each_form() {
    let folder = temp();
    let path = folder.path().join("arm.mcap");
    let (camera, robot) = (Camera::before_a_tag_of(TagFamily::Tag36h11), titan());
    camera.write(&path, &robot);
    let lens = read_camera_info(&path, "/info").expect("a lens").lens;
    assert_eq!(lens, camera.lens);
    let expected = square_corners(SIZE_M)
        .map(|corner| camera.lens.project(&(camera.camera_from_tag * corner).coords).expect("in view"));
    let read = |topic: &str, lens: &CameraModel| {
        let map = parse_input_map(Path::new("map.toml"), &image_map(topic)).expect("a map");
        read_external_images(&path, &map, &robot, &mut RecordedImageDetector::new([lens], robot.tag_family))
    };
    for topic in ["/mono8", "/bgr8", "/png"] {
        let found = read(topic, &lens).expect(topic);
        let [tag] = &found.frames[0].tags[..] else { panic!("{topic}: {:?}", found.frames) };
        let RawMeasurement::Corners(corners) = tag.seen else { panic!("corners") };
        assert_eq!(tag.id, Some(ID));
        for (found, wanted) in corners.iter().zip(&expected) {
            let off_px = (Vector2::from(*found) - wanted).norm();
            assert!(off_px < 0.1, "{topic}: {off_px} px off");
        }
    }
    let problem = |topic: &str, lens: &CameraModel| read(topic, lens).expect_err(topic).to_string();
    assert!(problem("/cut", &lens).contains("decoded"), "{}", problem("/cut", &lens));
    let other = titan().camera.lens;
    let found = problem("/png", &other);
    assert!(["/png: message 1", "320 x 240", "camera_info"].iter().all(|word| found.contains(word)), "{found}");
    assert!(read_camera_info(&path, "/png").is_err());
    let map = parse_input_map(Path::new("map.toml"), &image_map("/png")).expect("a map");
    assert!(read_external(&path, &map, &robot).expect_err("nobody looks").to_string().contains("detector"));
}

#[test]
fn a_proposed_input_map_works_and_overwrites_nothing() {
    let _texts = Texts::of("a_proposed_input_map_works_and_overwrites_nothing");
    let folder = temp();
    let titan = RealTitan::new(&titan(), 30, AS_IN_2018, 23);
    let [recording, map, tags] = ["arm.mcap", "map.toml", "tags.toml"].map(|name| folder.path().join(name));
    write_poses(&recording, &titan.poses);
    write(&tags, &titan.tag_map());
    let inspect = || {
        let mut command = program();
        command.arg("inspect").arg(&recording).arg("--robot").arg(robot_folder()).arg("--write-input").arg(&map);
        answer(&mut command)
    };
    inspect().expect("a map", 0, &["written", "map.toml"]);
    let proposed = read(&map);
    inspect().expect("it is there", 2, &["map.toml"]);
    assert_eq!(read(&map), proposed);
    // The tag map has only the positions of these tags, and their noise is known.
    let stated =
        proposed.replace("# position_std_m", "position_std_m").replace("# rotation_std_rad", "rotation_std_rad");
    let stated =
        stated.replace("position_std_m = 0.003", "position_std_m = 0.009").replace("_rad = 0.01 ", "_rad = 0.018 ");
    write(&map, &stated.replace("use = \"pose\"", "use = \"position\""));
    let mut command = program();
    command
        .arg("calibrate")
        .arg("--details")
        .arg(&recording)
        .arg("--robot")
        .arg(robot_folder())
        .arg("--input")
        .arg(&map);
    command.arg("--tag-map").arg(&tags).arg("--out").arg(folder.path().join("out"));
    answer(command.args(["--method", "minimum_distance"])).expect("calibrated", 0, &["ACCEPTED", "30 poses"]);
}
