//! Recordings of other programs, as messages that a test edits before they are written.

use std::path::{Path, PathBuf};

use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, RosSchema, decode, for_each_raw, ros};
use armcal::optics::CameraModel;
use armcal::robot::load;
use armcal::stats::stream_rng;
use armcal::streams::CaptureSet;
use armcal::time::Stamp;
use tempfile::TempDir;

use super::external::{at, header};
use super::synthetic::{TrueArm, add_noise};
use super::{Answer, answer, program, root, temp, write};

/// Tags in one of the types that armcal reads, or bytes of any other type.
#[derive(Clone, Debug)]
pub enum Payload {
    Joints(ros::JointState),
    Tags(ros::AprilTagDetectionArray),
    Isaac(ros::IsaacDetectionArray),
    Info(Box<ros::CameraInfo>),
    /// Detections written under the name of this type.
    Named(&'static str, ros::AprilTagDetectionArray),
}

#[derive(Clone, Debug)]
pub struct Recorded {
    pub topic: String,
    pub log: Stamp,
    pub payload: Payload,
}

/// An arm with its recording: one joint reading and one detection array per pose.
pub struct Scene {
    pub folder: TempDir,
    pub robot: PathBuf,
    tag_map: Option<PathBuf>,
    pub messages: Vec<Recorded>,
    /// Topics of joints, tags and lens.
    pub topics: [String; 3],
}

/// Frame of the cameras of our robots.
const LENS_FRAME: &str = "optical";

impl Scene {
    /// A bench arm of six joints without a lens in its folder, 40 poses 5 s apart before twelve tags.
    pub fn bench() -> Self {
        let golden = root().join("tests/golden/bench");
        let mut messages = Vec::new();
        for_each_raw(golden.join("run.mcap"), |raw| {
            let payload = match raw.topic() {
                "/joint_states" => Payload::Joints(decode(raw.data).expect("joints")),
                "/detections" => Payload::Tags(decode(raw.data).expect("tags")),
                _ => Payload::Info(Box::new(decode(raw.data).expect("a lens"))),
            };
            messages.push(Recorded { topic: raw.topic().to_owned(), log: raw.log_time(), payload });
        })
        .expect("it reads");
        Self {
            folder: temp(),
            robot: golden.clone(),
            tag_map: Some(golden.join("tags.toml")),
            messages,
            topics: ["/joint_states", "/detections", "/camera_info"].map(str::to_owned),
        }
    }

    /// One of our robots with its own tags, at 40 random poses `period_s` apart.
    pub fn of_robot(name: &str, topics: [&str; 3], period_s: f64, seed: u64) -> Self {
        let folder = root().join("robots").join(name);
        let robot = load(&folder).expect("it reads");
        let mut rng = stream_rng(seed, "messages of other programs");
        let arm = TrueArm::with_sensor_errors(&robot, &mut rng);
        let mut shots = arm.shots(CaptureSet::Fit, 40, &mut rng);
        add_noise(&mut shots, 0.3, &mut rng);
        let mut messages = Vec::new();
        for (k, shot) in shots.iter().enumerate() {
            let log = at(period_s * k as f64);
            let position = arm.counts(&shot.angles).iter().map(|word| word.round() % 65536.0).collect();
            let joints =
                ros::JointState { header: header(log, ""), name: robot.joint_names(), position, ..Default::default() };
            let detections = shot.tags.iter().map(|(id, corners_px)| detection(*id, corners_px)).collect();
            let tags = ros::AprilTagDetectionArray { header: header(log, LENS_FRAME), detections };
            let info = camera_info(&robot.camera.lens, LENS_FRAME);
            let payloads = [Payload::Joints(joints), Payload::Tags(tags), Payload::Info(Box::new(info))];
            for (topic, payload) in topics.iter().zip(payloads) {
                messages.push(Recorded { topic: (*topic).to_owned(), log, payload });
            }
        }
        Self { folder: temp(), robot: folder, tag_map: None, messages, topics: topics.map(str::to_owned) }
    }

    /// Calibrates with a copy of the robot that lacks its lens.
    pub fn without_lens(mut self) -> Self {
        let copy = self.folder.path().join("robot");
        std::fs::create_dir(&copy).expect("a folder");
        for entry in std::fs::read_dir(&self.robot).expect("a folder").flatten() {
            let text = std::fs::read_to_string(entry.path()).expect("a text");
            let is_lens = |line: &&str| {
                let keys = ["model =", "resolution_px", "focal_px", "center_px", "distortion", "max_view_angle_rad"];
                keys.iter().any(|key| line.starts_with(key))
            };
            let is_robot = entry.file_name() == "robot.toml";
            let kept: Vec<&str> = text.lines().filter(|line| !(is_robot && is_lens(line))).collect();
            write(&copy.join(entry.file_name()), &(kept.join("\n") + "\n"));
        }
        self.robot = copy;
        self
    }

    pub fn joints(&mut self) -> impl Iterator<Item = (&mut Stamp, &mut ros::JointState)> {
        self.messages.iter_mut().filter_map(|message| match &mut message.payload {
            Payload::Joints(joints) => Some((&mut message.log, joints)),
            _ => None,
        })
    }

    pub fn tags(&mut self) -> impl Iterator<Item = (&mut Stamp, &mut ros::AprilTagDetectionArray)> {
        self.messages.iter_mut().filter_map(|message| match &mut message.payload {
            Payload::Tags(tags) => Some((&mut message.log, tags)),
            _ => None,
        })
    }

    pub fn infos(&mut self) -> impl Iterator<Item = &mut ros::CameraInfo> {
        self.messages.iter_mut().filter_map(|message| match &mut message.payload {
            Payload::Info(info) => Some(info.as_mut()),
            _ => None,
        })
    }

    /// Adds a message right before each one with joints; `None` adds none.
    pub fn before_joints(&mut self, made: impl Fn(usize, &ros::JointState) -> Option<ros::JointState>) {
        let mut n = 0;
        let mut all = Vec::new();
        for message in std::mem::take(&mut self.messages) {
            if let Payload::Joints(joints) = &message.payload {
                let more = made(n, joints).map(Payload::Joints);
                all.extend(more.map(|payload| Recorded { payload, ..message.clone() }));
                n += 1;
            }
            all.push(message);
        }
        self.messages = all;
    }

    /// Replaces the tags.
    pub fn retype_tags(&mut self, of: impl Fn(ros::AprilTagDetectionArray) -> Payload) {
        for message in &mut self.messages {
            if let Payload::Tags(tags) = &message.payload {
                message.payload = of(tags.clone());
            }
        }
    }

    pub fn recording(&self) -> PathBuf {
        let path = self.folder.path().join("arm.mcap");
        let mut writer = RecordingWriter::create(&path, RecordingHeader::new(Vec::new())).expect("a file");
        for Recorded { topic, log, payload } in &self.messages {
            match payload {
                Payload::Joints(joints) => writer.write_ros(topic, &ros::JointState::SCHEMA, *log, joints),
                Payload::Tags(tags) => writer.write_ros(topic, &ros::AprilTagDetectionArray::SCHEMA, *log, tags),
                Payload::Isaac(tags) => writer.write_ros(topic, &ros::IsaacDetectionArray::SCHEMA, *log, tags),
                Payload::Info(info) => writer.write_ros(topic, &ros::CameraInfo::SCHEMA, *log, info.as_ref()),
                Payload::Named(name, tags) => {
                    let schema = RosSchema { name, text: ros::AprilTagDetectionArray::SCHEMA.text };
                    writer.write_ros(topic, &schema, *log, tags)
                }
            }
            .expect("written");
        }
        writer.finish().expect("finished");
        path
    }

    /// The input map with lines above its tables, and in `[tags]`.
    pub fn map(&self, above: &str, in_tags: &str) -> PathBuf {
        let [joints, tags, lens] = &self.topics;
        let path = self.folder.path().join("map.toml");
        let text = format!(
            "version = 1\nkind = \"input\"\n\
             {above}[joint_sensors]\ntopic = \"{joints}\"\n[tags]\ntopic = \"{tags}\"\nuse = \"corners\"\n\
             camera_info = \"{lens}\"\n{in_tags}"
        );
        write(&path, &text);
        path
    }

    pub fn calibrate_by(&self, map: &Path) -> Answer {
        let mut command = program();
        command.arg("calibrate").arg(self.recording()).arg("--robot").arg(&self.robot).arg("--input").arg(map);
        if let Some(file) = &self.tag_map {
            command.arg("--tag-map").arg(file);
        }
        answer(command.arg("--out").arg(self.folder.path().join("out")))
    }

    pub fn calibrate(&self) -> Answer {
        self.calibrate_by(&self.map("", ""))
    }

    /// Runs `inspect --write-input`; returns its answer and the map. Its output is not part of the compared texts.
    pub fn propose(&self) -> (Answer, PathBuf) {
        let map = self.folder.path().join("proposed.toml");
        let mut command = program();
        command.arg("inspect").arg(self.recording()).arg("--robot").arg(&self.robot).arg("--write-input").arg(&map);
        let output = command.output().expect("the program starts");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
        (Answer { code: output.status.code().unwrap_or(-1), stdout, stderr }, map)
    }
}

fn detection(id: u32, corners_px: &[[f64; 2]; 4]) -> ros::AprilTagDetection {
    let corners = corners_px.map(|[x, y]| ros::PixelPoint { x, y });
    ros::AprilTagDetection { family: "tag36h11".into(), id: id as i32, corners, ..Default::default() }
}

/// The lens of one of our fisheye cameras.
pub fn camera_info(lens: &CameraModel, frame: &str) -> ros::CameraInfo {
    let ([fx, fy], [cx, cy], [width, height]) = (lens.focal_px(), lens.center_px(), lens.resolution_px());
    let [.., k1, k2, k3, k4] = lens.intrinsics();
    ros::CameraInfo {
        header: ros::Header { frame_id: frame.to_owned(), ..ros::Header::default() },
        width,
        height,
        distortion_model: "equidistant".into(),
        d: vec![k1, k2, k3, k4],
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        ..ros::CameraInfo::default()
    }
}

/// Detections in the type of NVIDIA's package.
pub fn isaac(tags: ros::AprilTagDetectionArray) -> Payload {
    let point = |pixel: ros::PixelPoint| ros::Point { x: pixel.x, y: pixel.y, z: 0.0 };
    let detection = |tag: ros::AprilTagDetection| ros::IsaacDetection {
        family: tag.family,
        id: tag.id,
        center: point(tag.centre),
        corners: tag.corners.map(point),
        ..ros::IsaacDetection::default()
    };
    let detections = tags.detections.into_iter().map(detection).collect();
    Payload::Isaac(ros::IsaacDetectionArray { header: tags.header, detections })
}
