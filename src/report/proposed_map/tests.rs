use std::path::{Path, PathBuf};

use armcal_core::input::{Source, TagUse, parse_input_map};
use armcal_core::log::ros::{
    AprilTagDetection, AprilTagDetectionArray, CameraInfo, CompressedImage, FluidPressure, JointState, PixelPoint,
    Temperature, TfMessage, TransformStamped,
};
use armcal_core::log::{RecordingHeader, RecordingWriter, RosMessage};
use armcal_core::robot::{Robot, load};
use armcal_core::time::SIMULATION_EPOCH;

use super::*;

fn titan() -> Robot {
    load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4")).expect("it reads")
}

struct Given {
    folder: tempfile::TempDir,
    writer: RecordingWriter,
}

impl Given {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let writer = RecordingWriter::create(folder.path().join("a.mcap"), RecordingHeader::new(Vec::new()));
        Self { folder, writer: writer.expect("a file") }
    }

    fn add<M: RosMessage + serde::Serialize>(&mut self, topic: &str, message: &M) {
        self.writer.write_ros(topic, &M::SCHEMA, SIMULATION_EPOCH, message).expect("written");
    }

    fn joints(&mut self, topic: &str, names: &[String], value: f64) {
        let (name, position) = (names.to_vec(), vec![value; names.len()]);
        self.add(topic, &JointState { name, position, ..JointState::default() });
    }

    fn frames(&mut self, pairs: &[(&str, &str)]) {
        let transform = |(parent, child): &(&str, &str)| {
            let mut transform = TransformStamped { child_frame_id: (*child).to_owned(), ..TransformStamped::default() };
            transform.header.frame_id = (*parent).to_owned();
            transform
        };
        self.add("/tf", &TfMessage { transforms: pairs.iter().map(transform).collect() });
    }

    fn proposed(self, robot: Option<&Robot>) -> (tempfile::TempDir, Result<String, ProposalError>) {
        let path: PathBuf = self.folder.path().join("a.mcap");
        self.writer.finish().expect("finished");
        let found = propose_input_map(&path, robot);
        let named = self.folder.path().display().to_string();
        (self.folder, found.map(|text| text.replace(&named, "FOLDER")))
    }

    /// Reason that nothing can be proposed.
    fn missing(self, robot: Option<&Robot>) -> String {
        let (folder, found) = self.proposed(robot);
        found.expect_err("something is missing").to_string().replace(&folder.path().display().to_string(), "FOLDER")
    }
}

fn topics(text: &str) -> (armcal_core::input::InputMap, armcal_core::input::Topics) {
    let map = parse_input_map(Path::new("map.toml"), text).expect("it reads");
    let Source::Topics(topics) = map.source.clone() else { panic!("topics") };
    (map, topics)
}

#[test]
fn transforms_of_numbered_tags_are_told_from_those_of_the_arm() {
    let robot = titan();
    let mut given = Given::new();
    let recorded: Vec<String> = robot.joint_names().iter().map(|joint| format!("left/{joint}")).collect();
    given.joints("/gripper", &["finger".to_owned()], 0.1);
    given.joints("/arm", &recorded, 1.0);
    given.frames(&[("base_link", "link_1"), ("wrist_camera", "tag36h11:7"), ("wrist_camera", "tag36h11:12")]);
    given.add("/water", &Temperature::default());
    given.add("/hpu/oil_temperature", &Temperature::default());
    given.add("/depth", &FluidPressure::default());
    let (_folder, text) = given.proposed(Some(&robot));
    let text = text.expect("a map");
    let (map, topics) = topics(&text);
    assert_eq!((topics.joints.as_str(), topics.tags.as_str()), ("/arm", "/tf"));
    assert_eq!(topics.camera_frame.as_deref(), Some("wrist_camera"));
    assert_eq!(map.child_frame.expect("a frame").text(), "tag36h11:{id}");
    assert_eq!(map.joint_names["wrist_yaw"], "left/wrist_yaw");
    assert_eq!((map.tag_use, map.joint_unit), (TagUse::Pose, armcal_core::input::JointUnit::Rad));
    assert_eq!(topics.conditions.oil_temperature.as_deref(), Some("/hpu/oil_temperature"));
    assert_eq!(topics.conditions.pressure.as_deref(), Some("/depth"));
    insta::assert_snapshot!("numbered_tags", text);
}

#[test]
fn detections_come_before_images_and_images_bring_their_lens() {
    let mut given = Given::new();
    given.joints("/words", &["a".to_owned()], 30_000.0);
    given.add("/left/image", &CompressedImage::default());
    let k = [400.0, 0.0, 320.0, 0.0, 400.0, 240.0, 0.0, 0.0, 1.0];
    let info =
        CameraInfo { width: 640, height: 480, k, distortion_model: "plumb_bob".to_owned(), ..Default::default() };
    given.add("/right/camera_info", &info);
    given.add("/left/camera_info", &info);
    let (folder, text) = given.proposed(None);
    let text = text.expect("a map");
    let (map, of_images) = topics(&text);
    assert_eq!((of_images.tags.as_str(), map.tag_use), ("/left/image", TagUse::Corners));
    assert_eq!(of_images.camera_info.as_deref(), Some("/left/camera_info"));
    insta::assert_snapshot!("images", text);
    drop(folder);
    let mut given = Given::new();
    given.joints("/words", &["a".to_owned()], 30_000.0);
    given.add("/image", &CompressedImage::default());
    let corners = [[1.0, 1.0], [9.0, 1.0], [9.0, 9.0], [1.0, 9.0]].map(|[x, y]| PixelPoint { x, y });
    let detections = vec![AprilTagDetection { id: 5, corners, ..AprilTagDetection::default() }];
    given.add("/tags", &AprilTagDetectionArray { detections, ..AprilTagDetectionArray::default() });
    let text = given.proposed(None).1.expect("a map");
    assert_eq!(topics(&text).1.tags, "/tags");
    insta::assert_snapshot!("detections", text);
}

/// Detections without an outline; one tag among them makes all of them tags.
#[test]
fn corners_of_a_board_are_told_from_tags() {
    let proposed = |outline: [f64; 4]| {
        let mut given = Given::new();
        given.joints("/words", &["a".to_owned()], 30_000.0);
        let detection = |id: i32| {
            let centre = PixelPoint { x: 100.0 + f64::from(id), y: 50.0 };
            AprilTagDetection { id, centre, ..AprilTagDetection::default() }
        };
        let mut detections: Vec<AprilTagDetection> = (0..5).map(detection).collect();
        detections[3].corners = outline.map(|x| PixelPoint { x, y: 7.0 });
        given.add("/corners", &AprilTagDetectionArray { detections, ..AprilTagDetectionArray::default() });
        given.proposed(None).1.expect("a map")
    };
    let text = proposed([0.0; 4]);
    let (map, of_board) = topics(&text);
    assert_eq!((of_board.tags.as_str(), map.tag_use), ("/corners", TagUse::BoardCorners));
    assert_eq!(map.child_frame.expect("a frame").text(), "board");
    insta::assert_snapshot!("board", text);
    assert_eq!(topics(&proposed([1.0, 2.0, 3.0, 2.0])).0.tag_use, TagUse::Corners);
}

#[test]
fn the_only_pair_of_frames_is_taken_and_names_cannot_break_the_file() {
    let mut given = Given::new();
    given.joints("/j\"\n[x]", &["a\n[b]".to_owned()], 1.0);
    given.frames(&[("here", "there")]);
    let text = given.proposed(None).1.expect("a map");
    let (map, topics) = topics(&text);
    assert_eq!((topics.joints.as_str(), topics.camera_frame.as_deref()), ("/j\"\n[x]", Some("here")));
    assert_eq!(map.child_frame.expect("a frame").text(), "there");
}

#[test]
fn what_is_missing_is_named() {
    let mut given = Given::new();
    given.frames(&[("camera", "board")]);
    let no_joints = given.missing(None);
    let mut given = Given::new();
    given.joints("/j", &["a".to_owned()], 1.0);
    given.frames(&[("base", "link_1"), ("link_1", "link_2")]);
    let no_tags = given.missing(None);
    let mut given = Given::new();
    given.joints("/j", &["a".to_owned()], 1.0);
    given.frames(&[("camera", "board")]);
    let other_joints = given.missing(Some(&titan()));
    insta::assert_snapshot!("missing", [no_joints, no_tags, other_joints].join("\n"));
}

#[test]
fn names_of_a_topic_are_kept_within_a_limit() {
    let mut given = Given::new();
    let names: Vec<String> = (0..5000).map(|k| format!("j{k}")).collect();
    given.joints("/j", &names, 1.0);
    let children: Vec<String> = (0..5000).map(|k| format!("part{k}x")).collect();
    let pairs: Vec<(&str, &str)> = children.iter().map(|child| ("base", child.as_str())).collect();
    given.frames(&pairs);
    let folder = given.folder;
    given.writer.finish().expect("finished");
    let mut contents = Contents::default();
    for_each_raw(folder.path().join("a.mcap"), |raw| contents.take(raw)).expect("it reads");
    assert_eq!((contents.topics["/j"].joints.len(), contents.topics["/tf"].frames.len()), (2000, 2000));
}

/// The reason is then that of `calibrate`; with a lens in robot.toml, nobody needs this one.
#[test]
fn a_lens_of_no_use_is_named_in_the_map_where_the_robot_needs_one() {
    let k = [400.0, 0.0, 320.0, 0.0, 400.0, 240.0, 0.0, 0.0, 1.0];
    let whole =
        CameraInfo { width: 640, height: 480, k, distortion_model: "plumb_bob".to_owned(), ..Default::default() };
    let binned = CameraInfo { binning_x: 2, binning_y: 2, ..whole.clone() };
    let zeros = CameraInfo { k: [0.0; 9], ..whole.clone() };
    let mut without_lens = titan();
    without_lens.camera.lens = armcal_core::optics::CameraModel::unknown();
    for (robot, info, is_named) in [
        (&without_lens, &binned, true),
        (&without_lens, &zeros, true),
        (&without_lens, &whole, true),
        (&titan(), &binned, false),
    ] {
        let mut given = Given::new();
        given.joints("/arm", &robot.joint_names(), 1.0);
        given.add("/tags", &AprilTagDetectionArray::default());
        given.add("/camera_info", info);
        let text = given.proposed(Some(robot)).1.expect("a map");
        assert_eq!(topics(&text).1.camera_info.is_some(), is_named, "{text}");
    }
}
