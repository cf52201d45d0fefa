//! Every reader of files that users name, as a function of bytes: for the fuzz targets here and for
//! `tests/mutations.rs`.

use std::borrow::Cow;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use armcal::calib::{Calibration, CompactCalibration, ExternalContext, PlainLandmark, calibrate, prepare_external};
use armcal::log::{
    GrowingRecording, Growth, RecordingHeader, RecordingWriter, TopicMap, for_each_raw, read_attachments,
    read_recording,
};
use armcal::robot::{DraftedMeshes, NewRobot, Robot, draft_robot, load, load_vehicle};
use armcal::routine::Method;
use armcal::streams::Message;
use armcal::tagmap::files::{parse_cameras, parse_tags, read_landmarks};

/// A robot, a vehicle and a recording in a folder of their own, where readers find the files that they expect beside
/// the one that is read.
pub struct Scratch {
    folder: tempfile::TempDir,
    robot: Robot,
    recording: PathBuf,
}

impl Scratch {
    /// `root`: this repository.
    pub fn new(root: &Path) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for copy in ["robot", "of_urdf", "of_robot"] {
            let copy = folder.path().join(copy);
            fs::create_dir(&copy).expect("a folder");
            for name in ["robot.toml", "titan4.urdf"] {
                fs::copy(root.join("robots/titan4").join(name), copy.join(name)).expect("copied");
            }
        }
        fs::copy(root.join("robots/vehicles/work-class-front.toml"), folder.path().join("vehicle.toml"))
            .expect("copied");
        let robot = load(&folder.path().join("robot")).expect("the robot reads");
        Self { folder, robot, recording: root.join("fuzz/corpus/recording/views.mcap") }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, bytes).expect("written");
        path
    }
}

/// A reader: whether it takes these bytes.
pub type Read = fn(&Scratch, &[u8]) -> bool;

/// By the names of the targets and of the folders of their corpora.
pub const READERS: [(&str, Read); 28] = [
    ("urdf", urdf),
    ("new_robot", new_robot),
    ("recording", recording),
    ("bag", bag),
    ("cdr", cdr),
    ("robot", robot),
    ("vehicle", vehicle),
    ("routine", routine),
    ("calibration", calibration),
    ("compact", compact),
    ("tags", tags),
    ("cameras", cameras),
    ("link_poses", link_poses),
    ("lerobot", lerobot),
    ("tag_map", tag_map),
    ("input_map", input_map),
    ("table_csv", table_csv),
    ("table_yaml", table_yaml),
    ("table_board", table_board),
    ("image", image),
    ("task", task),
    ("plan", plan),
    ("stl", stl),
    ("obj", obj),
    ("dae", dae),
    ("campaign_table", campaign_table),
    ("motion", motion),
    ("views", views),
];

fn text(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}

fn urdf(scratch: &Scratch, bytes: &[u8]) -> bool {
    scratch.write("of_urdf/titan4.urdf", bytes);
    // The names of links and joints of the drawings in the corpus.
    load(&scratch.path("of_urdf")).is_ok()
}

/// A robot folder for any URDF, with the mesh of the corpus beside it.
fn new_robot(scratch: &Scratch, bytes: &[u8]) -> bool {
    let given = scratch.path("given");
    fs::create_dir_all(&given).expect("a folder");
    fs::write(given.join("hand.obj"), "v 0 0 0\nv 0 9 0\nv 9 0 0\nv 0 0 9\nf 1 2 3\nf 1 3 4\nf 1 4 2\n")
        .expect("written");
    let urdf = scratch.write("given/arm.urdf", bytes);
    let wanted = NewRobot {
        urdf: &urdf,
        text: None,
        base: None,
        tip: None,
        camera: None,
        lens: None,
        touching: &[],
        clear_rad: None,
    };
    let Ok(drafted) = draft_robot(&wanted, DraftedMeshes::Read) else { return false };
    let made = tempfile::tempdir_in(scratch.folder.path()).expect("a folder");
    for file in drafted.files {
        let path = made.path().join(&file.path);
        assert!(file.path.is_relative(), "{}", path.display());
        // A mesh's name from the URDF may be longer than the system has it: the program says so and ends.
        let is_made = fs::create_dir_all(path.parent().expect("a folder")).and_then(|()| fs::write(path, file.bytes));
        if is_made.is_err() {
            return false;
        }
    }
    load(made.path()).is_ok()
}

fn robot(scratch: &Scratch, bytes: &[u8]) -> bool {
    scratch.write("of_robot/robot.toml", bytes);
    load(&scratch.path("of_robot")).is_ok()
}

fn vehicle(scratch: &Scratch, bytes: &[u8]) -> bool {
    load_vehicle(&scratch.write("of_vehicle.toml", bytes)).is_ok()
}

fn routine(scratch: &Scratch, bytes: &[u8]) -> bool {
    let Ok(routine) = armcal::routine::load(&scratch.write("routine.toml", bytes)) else { return false };
    routine.load_arm().is_ok_and(|(robot, _)| armcal::sim::WorldSpec::from_routine(&routine, &robot).is_ok())
}

fn recording(scratch: &Scratch, bytes: &[u8]) -> bool {
    followed(scratch, bytes);
    any_recording(scratch, &scratch.write("recording.mcap", bytes))
}

/// A ROS 2 bag; what begins as a log of writes is one, beside the bag of the corpus.
fn bag(scratch: &Scratch, bytes: &[u8]) -> bool {
    if !bytes.starts_with(&[0x37, 0x7f, 0x06]) {
        return any_recording(scratch, &scratch.write("bag.db3", bytes));
    }
    let corpus = scratch.recording.with_file_name("../bag/arm.db3");
    let path = scratch.path("logged.db3");
    fs::copy(corpus, &path).expect("copied");
    scratch.write("logged.db3-wal", bytes);
    any_recording(scratch, &path)
}

fn any_recording(scratch: &Scratch, path: &Path) -> bool {
    let _ = read_attachments(path);
    let proposed = armcal::report::proposed_map::propose_input_map(path, Some(&scratch.robot));
    if let Some(map) = proposed.ok().and_then(|text| armcal::input::parse_input_map(path, &text).ok()) {
        let _ = armcal::input::read_external(path, &map, &scratch.robot);
    }
    let _ = armcal::report::inspection::inspect(path, None)
        .map(|found| armcal::report::inspection::to_text(&found, Some(80)));
    read_recording(path).is_ok_and(|recording| !recording.messages.is_empty())
}

/// The same while it grows: half of it, then all.
fn followed(scratch: &Scratch, bytes: &[u8]) {
    let (path, map) = (scratch.write("growing.mcap", &bytes[..bytes.len() / 2]), TopicMap::default());
    let mut growing = GrowingRecording::open(&path, &map).expect("a file");
    while growing.poll(|_, _| {}).is_ok_and(|growth| growth == Growth::Behind) {}
    scratch.write("growing.mcap", bytes);
    while growing.poll(|_, _| {}).is_ok_and(|growth| growth == Growth::Behind) {}
    let _ = growing.finish(|_, _| {});
}

/// The first byte chooses one of the recording's topics, the rest is its message.
fn cdr(scratch: &Scratch, bytes: &[u8]) -> bool {
    let Some((&which, payload)) = bytes.split_first() else { return false };
    let mut channels: Vec<(String, String, Vec<u8>)> = Vec::new();
    for_each_raw(&scratch.recording, |message| {
        if !channels.iter().any(|(topic, ..)| *topic == message.channel.topic) {
            let schema = message.channel.schema.as_ref();
            let (name, data) = schema.map(|schema| (schema.name.clone(), schema.data.to_vec())).unwrap_or_default();
            channels.push((message.channel.topic.clone(), name, data));
        }
    })
    .expect("the corpus reads");
    let (topic, name, data) = &channels[usize::from(which) % channels.len()];
    let mut out = Vec::new();
    let options = mcap::WriteOptions::new().compression(None).compression_threads(0);
    let mut writer = options.create(Cursor::new(&mut out)).expect("begun");
    let schema = writer.add_schema(name, "ros2msg", data).expect("a schema");
    let channel_id = writer.add_channel(schema, topic, "cdr", &Default::default()).expect("a channel");
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, payload).expect("written");
    writer.finish().expect("finished");
    drop(writer);
    read_recording(scratch.write("cdr.mcap", &out)).is_ok_and(|recording| recording.rejected.is_empty())
}

fn calibration(scratch: &Scratch, bytes: &[u8]) -> bool {
    let Ok(calibration) = Calibration::parse(Path::new("calibration.toml"), &text(bytes)) else { return false };
    let _ = (calibration.to_toml(), calibration.lookup(), CompactCalibration::of(&calibration));
    calibration.sensors(&scratch.robot).is_ok()
}

fn compact(scratch: &Scratch, bytes: &[u8]) -> bool {
    let Ok(compact) = CompactCalibration::from_text(&text(bytes)) else { return false };
    compact.to_text().is_ok() && compact.sensors(&scratch.robot).is_ok()
}

fn tags(_: &Scratch, bytes: &[u8]) -> bool {
    parse_tags(Path::new("tags.yaml"), &text(bytes)).is_ok()
}

/// As those of the arm's own URDF, written into it.
fn link_poses(scratch: &Scratch, bytes: &[u8]) -> bool {
    let file = Path::new("kinematics.yaml");
    let poses = armcal::export::parse_link_poses(file, &text(bytes));
    poses.is_ok_and(|poses| {
        let _ = poses.written_into(file, (Path::new("arm.urdf"), &scratch.robot.urdf_text));
        true
    })
}

/// As the JSON that an input map names.
fn lerobot(scratch: &Scratch, bytes: &[u8]) -> bool {
    const MAP: &[u8] =
        b"version = 1\nkind = \"input\"\n[joint_sensors]\ntopic = \"/j\"\nlerobot = { file = \"arm.json\", motors = \
        \"feetech\", values = \"degrees\" }\n[tags]\ntopic = \"/t\"\nuse = \"corners\"\n";
    scratch.write("arm.json", bytes);
    let map = armcal::input::read_input_map(&scratch.write("input.toml", MAP));
    map.is_ok_and(|map| {
        let _ = map.check_robot(Path::new("input.toml"), &scratch.robot);
        true
    })
}

fn cameras(_: &Scratch, bytes: &[u8]) -> bool {
    parse_cameras(Path::new("cameras.yaml"), &text(bytes)).is_ok()
}

fn tag_map(scratch: &Scratch, bytes: &[u8]) -> bool {
    let _ = parse_tags(Path::new("map.toml"), &text(bytes));
    read_landmarks(&scratch.write("map.toml", bytes)).is_ok()
}

fn input_map(_: &Scratch, bytes: &[u8]) -> bool {
    armcal::input::parse_input_map(Path::new("input.toml"), &text(bytes)).is_ok()
}

/// As poses of numbered tags at their times.
fn table_csv(scratch: &Scratch, bytes: &[u8]) -> bool {
    const MAP: &str = "version = 1\nkind = \"input\"\n\
        [table]\ntime = { column = \"t\" }\n[joint_sensors]\n[tags]\nuse = \"pose\"\n\
        [tags.columns]\ndirection = \"tag_from_camera\"\nposition = [\"x\", \"y\", \"z\"]\nid = \"tag\"\n\
        rotation = [\"rx\", \"ry\", \"rz\"]\nrotation_form = \"fixed_xyz\"\n";
    table(scratch, "rows.csv", (MAP, bytes))
}

/// As poses of one landmark.
fn table_yaml(scratch: &Scratch, bytes: &[u8]) -> bool {
    const MAP: &str = "version = 1\nkind = \"input\"\n[table]\nrows = \"views\"\n[joint_sensors]\n\
        names = { shoulder_yaw = \"joints.0\", shoulder_pitch = \"joints.1\", forearm_pitch = \"joints.2\", \
        wrist_pitch = \"joints.3\", wrist_yaw = \"joints.4\", wrist_rotate = \"joints.5\" }\n\
        [tags]\nchild_frame = \"board\"\nuse = \"pose\"\n[tags.columns]\ndirection = \"camera_from_tag\"\n\
        position = [\"pose.x\", \"pose.y\", \"pose.z\"]\nrotation_form = \"quaternion_wxyz\"\n\
        rotation = [\"pose.r.0\", \"pose.r.1\", \"pose.r.2\", \"pose.r.3\"]\n";
    table(scratch, "rows.yaml", (MAP, bytes))
}

/// As corners of a board, up to the views; the corpus shows it near the middle of the image, face on.
fn table_board(scratch: &Scratch, bytes: &[u8]) -> bool {
    const MAP: &str = "version = 1\nkind = \"input\"\n[table]\n[joint_sensors]\n[tags]\nchild_frame = \"board\"\n\
        use = \"board_corners\"\n[tags.columns]\nid = \"corner\"\npixel = [\"u\", \"v\"]\n";
    const BOARD: &[u8] =
        b"version = 1\nkind = \"tag_map\"\nframe = \"base_link\"\n[[tag]]\nname = \"board\"\nsquares = [4, 4]\n\
        square_m = 0.05\nposition_m = [1.4, 0.5, 0.0]\nquaternion_wxyz = [0.5, -0.5, 0.5, -0.5]\n";
    let map = armcal::input::parse_input_map(Path::new("input.toml"), MAP).expect("a map");
    let tags = scratch.write("board.toml", BOARD);
    let named = read_landmarks(&tags).expect("it reads").survey(&tags, &scratch.robot, map.tag_use).expect("a survey");
    let (id, board) = named.boards.first_key_value().expect("a board");
    let plain = PlainLandmark { id: Some(*id), board: Some(*board) };
    let robot = scratch.robot.clone().with_survey(named.survey);
    let read = armcal::input::read_external(&scratch.write("rows.csv", bytes), &map, &robot);
    let context = ExternalContext { plain, ..ExternalContext::default() };
    read.is_ok_and(|recording| prepare_external(&[recording], &map, &robot, context).is_ok())
}

fn table(scratch: &Scratch, name: &str, (map, bytes): (&str, &[u8])) -> bool {
    let map = armcal::input::parse_input_map(Path::new("input.toml"), map).expect("a map");
    armcal::input::read_external(&scratch.write(name, bytes), &map, &scratch.robot).is_ok()
}

/// A compressed image of a small camera, in which tags are looked for.
fn image(_: &Scratch, bytes: &[u8]) -> bool {
    use armcal::input::{ImageDetector, RecordedImage};
    let lens = armcal::optics::Radtan::new([60.0; 2], [31.5, 23.5], [0.0; 5], [64, 48]).into();
    let image = armcal::log::ros::CompressedImage {
        format: "png or jpeg".to_owned(),
        data: bytes.to_vec(),
        ..armcal::log::ros::CompressedImage::default()
    };
    armcal::recorded_images::RecordedImageDetector::new([&lens], armcal::optics::TagFamily::default())
        .detect(0, &RecordedImage::Compressed(image))
        .is_ok()
}

fn task(_: &Scratch, bytes: &[u8]) -> bool {
    armcal::input::parse_task(Path::new("task.toml"), &text(bytes)).is_ok()
}

fn plan(scratch: &Scratch, bytes: &[u8]) -> bool {
    armcal::plan::PlanFile::read(&scratch.write("plan.toml", bytes)).is_ok()
}

fn stl(scratch: &Scratch, bytes: &[u8]) -> bool {
    mesh(scratch, &scratch.write("a.stl", bytes), 0.001)
}

fn dae(scratch: &Scratch, bytes: &[u8]) -> bool {
    mesh(scratch, &scratch.write("a.dae", bytes), 1.0)
}

fn obj(scratch: &Scratch, bytes: &[u8]) -> bool {
    mesh(scratch, &scratch.write("a.obj", bytes), 0.001)
}

/// As one hull. What a decomposition takes, seconds, is for `tests/mutations.rs` alone.
fn mesh(scratch: &Scratch, file: &Path, scale_m: f64) -> bool {
    let scene = format!(
        "version = 1\nkind = \"scene\"\n[[obstacle]]\nname = \"a\"\nshape = \"mesh\"\n\
         file = {file:?}\nscale_m = {scale_m}\nposition_m = [0.0, 0.0, 0.0]\n"
    );
    armcal::routine::load_scene(&scratch.write("scene.toml", scene.as_bytes())).is_ok()
}

fn campaign_table(scratch: &Scratch, bytes: &[u8]) -> bool {
    armcal::campaign::read_table(&scratch.write("rows.csv", bytes)).is_ok()
}

fn motion(_: &Scratch, bytes: &[u8]) -> bool {
    armcal::sim::RecordedMotion::parse(Path::new("motion.csv"), text(bytes).into_owned()).is_ok()
}

/// The corpus's recording with single values replaced, calibrated: each twelve bytes are a place and a number.
fn views(scratch: &Scratch, bytes: &[u8]) -> bool {
    let mut recording = read_recording(&scratch.recording).expect("the corpus reads");
    for change in bytes.chunks_exact(12) {
        let n = recording.messages.len();
        let at = usize::from(u16::from_le_bytes([change[0], change[1]])) % n;
        let number = f64::from_le_bytes(std::array::from_fn(|k| change[4 + k]));
        if number.is_finite() {
            replace(&mut recording.messages[at].1, usize::from(change[2]), number);
        }
    }
    let path = scratch.path("views.mcap");
    let mut writer =
        RecordingWriter::create(&path, RecordingHeader::new(recording.joint_names.clone())).expect("a file");
    for (stamp, message) in &recording.messages {
        // What cannot be written cannot be read.
        let _ = armcal::streams::Sink::record(&mut writer, *stamp, message);
    }
    writer.finish().expect("finished");
    read_recording(&path).is_ok_and(|read| calibrate(&read, &scratch.robot, Method::Bundle).is_ok())
}

fn replace(message: &mut Message, place: usize, number: f64) {
    match message {
        Message::JointSensors(sample) => {
            let n = sample.counts.len();
            sample.counts[place % n] = number;
        }
        Message::Detections(detections) if !detections.tags.is_empty() => {
            let n = detections.tags.len();
            let tag = &mut detections.tags[place / 9 % n];
            match place % 9 {
                8 => tag.id = number.to_bits() as u32 % 600,
                corner => tag.corners_px[corner / 2][corner % 2] = number,
            }
        }
        Message::Temperature(sample) => sample.temperature_c = number,
        Message::Attitude(sample) => sample.quaternion_wxyz[place % 4] = number,
        _ => {}
    }
}
