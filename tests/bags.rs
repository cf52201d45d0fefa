//! ROS 2 bags in SQLite files give the same results as MCAP files with the same messages.

use std::path::{Path, PathBuf};

use armcal::log::{Completeness, decode, for_each_raw, ros};
use armcal::robot::Robot;

use crate::support::bag::{VERSIONS, write_bag};
use crate::support::external::{AS_IN_2018, INPUT_MAP, RealTitan, write_poses};
use crate::support::texts::Texts;
use crate::support::{Answer, answer, program, read, robot_folder, root, temp, titan, write};

/// Two folders with the same file names: one with an MCAP file, one with bags.
struct Both {
    folder: tempfile::TempDir,
}

const FOLDERS: [&str; 2] = ["mcap", "bag"];

impl Both {
    fn new(robot: &Robot, seed: u64, version: u32) -> Self {
        let both = Self { folder: temp() };
        let titan = RealTitan::new(robot, 57, AS_IN_2018, seed);
        for folder in FOLDERS {
            std::fs::create_dir(both.file(folder, "")).expect("a folder");
            write(&both.file(folder, "tags.toml"), &titan.tag_map());
            write(&both.file(folder, "given.toml"), INPUT_MAP);
        }
        write_poses(&both.file("mcap", "arm"), &titan.poses);
        write_bag(&both.file("bag", "arm"), version, &both.file("mcap", "arm"), |_| true);
        both
    }

    fn file(&self, folder: &str, name: &str) -> PathBuf {
        self.folder.path().join(folder).join(name)
    }

    fn answer(&self, folder: &str, words: &str) -> Answer {
        let mut command = program();
        command.current_dir(self.file(folder, "")).args(words.split(' ')).arg("--robot").arg(robot_folder());
        answer(&mut command)
    }
}

const CALIBRATE: &str = "--input given.toml --tag-map tags.toml --method minimum_distance --out out --details";

#[test]
fn bags_give_the_calibration_of_their_messages() {
    let robot = titan();
    for version in VERSIONS {
        let both = Both::new(&robot, u64::from(version), version);
        let [mcap, bag] = FOLDERS.map(|folder| {
            both.answer(folder, "inspect arm --write-input map.toml").expect("proposed", 0, &["/joint_states", "/tf"]);
            both.answer(folder, &format!("calibrate arm {CALIBRATE}")).expect("57 poses", 0, &["ACCEPTED"]);
            ["map.toml", "out/calibration.toml", "out/calibration.covariance.toml"]
                .map(|name| read(&both.file(folder, name)))
        });
        assert!(mcap == bag, "version {version}");
        let told = both.answer("bag", "inspect arm --json");
        told.expect("a bag", 0, &["rosbag2", "\"whole\"", "sensor_msgs/msg/JointState"]);
    }
}

#[test]
fn a_bag_in_several_files_is_one_in_any_order() {
    let both = Both::new(&titan(), 5, 3);
    let mcap = both.file("mcap", "arm");
    write_bag(&both.file("bag", "arm_0.db3"), 3, &mcap, |place| place < 40);
    write_bag(&both.file("bag", "arm_1.db3"), 3, &mcap, |place| place >= 40);
    let calibrations = ["arm_0.db3 arm_1.db3", "arm_1.db3 arm_0.db3", "arm"].map(|names| {
        both.answer("bag", &format!("calibrate {names} {CALIBRATE}")).expect("57 poses", 0, &["ACCEPTED"]);
        read(&both.file("bag", "out/calibration.toml"))
    });
    let [there, back, whole] = calibrations;
    assert!(there == back);
    // The result names the bag's files.
    assert_eq!(there.replace("arm_0.db3, arm_1.db3", "arm"), whole);
    // The message for a folder names its files.
    both.answer("", "inspect bag").expect("a folder", 2, &["folder", "arm_0.db3, arm_1.db3"]);
}

#[test]
fn what_is_no_bag_is_refused_by_name() {
    let _texts = Texts::of("what_is_no_bag_is_refused_by_name");
    let both = Both::new(&titan(), 6, 4);
    let arm = both.file("bag", "arm");
    sqlite::open(&arm).expect("open").execute("DROP TABLE topics").expect("dropped");
    both.answer("bag", &format!("calibrate arm {CALIBRATE}")).expect("no topics", 2, &["arm"]);
    let bytes = std::fs::read(&arm).expect("it reads");
    std::fs::write(&arm, &bytes[..60]).expect("written");
    both.answer("bag", "inspect arm").expect("cut", 2, &["arm", "not a ROS 2 bag", "header"]);
    both.answer("bag", "watch arm --idle-s 1").expect("not without a map", 2, &["arm", "--write-input"]);
}

/// A cut bag is treated like any cut recording.
#[test]
fn a_cut_bag_is_calibrated_from_what_is_there() {
    let both = Both::new(&titan(), 7, 3);
    let arm = both.file("bag", "arm");
    let bytes = std::fs::read(&arm).expect("it reads");
    std::fs::write(&arm, &bytes[..bytes.len() * 9 / 10]).expect("written");
    both.answer("bag", "inspect arm").expect("cut", 3, &["cut", "pages"]);
    both.answer("bag", &format!("calibrate arm {CALIBRATE}")).expect("cut", 3, &["ACCEPTED", "cut"]);
}

type Message = (String, String, u64, Vec<u8>);

fn messages(path: &Path) -> Vec<Message> {
    let mut found = Vec::new();
    let summary = for_each_raw(path, |raw| {
        found.push((raw.topic().to_owned(), raw.schema_name().to_owned(), raw.log_time_nanos, raw.data.to_vec()));
    })
    .expect("it reads");
    assert_eq!(summary.completeness, Completeness::Whole);
    found
}

/// The files come from `rosbags` 0.11.9: tests/oracle/make_bag_golden.py.
#[test]
fn bags_of_another_writer_hold_the_messages_of_its_mcap_files() {
    let [bag, mcap] = ["arm.db3", "arm.mcap"].map(|name| messages(&root().join("tests/golden/bag").join(name)));
    assert_eq!(bag.len(), 37);
    assert!(bag == mcap);
    let last = &bag[36];
    assert_eq!((last.0.as_str(), last.1.as_str()), ("/image", "sensor_msgs/msg/Image"));
    assert!(last.3.len() > 6000 && last.3.ends_with(&[5998, 5999].map(|n: u32| (n % 251) as u8)));
}

/// A ROS 1 bag, and its conversion by the command in our message: tests/oracle/make_ros1_golden.py.
#[test]
fn the_conversion_that_ros_1_bags_are_refused_with_gives_their_messages() {
    let golden = root().join("tests/golden/bag");
    let command = read(&golden.join("ros1.txt"));
    let inspect = |name: &str| answer(program().arg("inspect").arg(golden.join(name)));
    inspect("ros1.bag").expect("ROS 1", 2, &[command.trim(), "rosbags==0.11.9", "recording_format"]);
    inspect("ros1.mcap").expect("converted", 0, &["whole", "elbow", "tag36h11:7"]);
    let converted = messages(&golden.join("ros1.mcap"));
    assert_eq!(converted.len(), 24);
    let joints: ros::JointState = decode(&converted[2].3).expect("joints");
    assert_eq!((joints.name, joints.position), (vec!["shoulder".to_owned(), "elbow".to_owned()], vec![0.1, -0.05]));
    let tags: ros::TfMessage = decode(&converted[3].3).expect("transforms");
    assert_eq!(tags.transforms[0].transform.translation.y, 0.02);
}
