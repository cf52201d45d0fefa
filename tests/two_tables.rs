//! Joints in one table, corners of tags in another: `inspect` proposes a map that joins them, `calibrate` accepts it.

use std::fmt::Write as _;
use std::path::PathBuf;

use armcal::calib::Calibration;
use armcal::robot::{Robot, load};
use armcal::stats::stream_rng;
use armcal::streams::CaptureSet;
use tempfile::TempDir;

use crate::support::synthetic::{TrueArm, add_noise};
use crate::support::texts::Texts;
use crate::support::{Answer, answer, edit, program, read, root, temp, write};

/// Numbers of the corners as printed, in armcal's order; `OPENCV` has the opposite winding from the top left.
const APRILTAG: [usize; 4] = [0, 1, 2, 3];
const OPENCV: [usize; 4] = [3, 2, 1, 0];

/// Raw readings, and the corners of each tag by its number.
type Pose = (Vec<f64>, Vec<(u32, [[f64; 2]; 4])>);

/// Measurements of an arm's script at each pose.
struct Rig {
    robot_folder: PathBuf,
    robot: Robot,
    poses: Vec<Pose>,
    folder: TempDir,
}

/// A column before the others: its name, and its cell for each pose.
type Lead<'a> = (&'a str, &'a dyn Fn(usize) -> String);

impl Rig {
    fn new(name: &str, n: usize, seed: u64) -> Self {
        let robot_folder = root().join("robots").join(name);
        let robot = load(&robot_folder).expect("it reads");
        let mut rng = stream_rng(seed, "two tables");
        let arm = TrueArm::as_its_datasheet(&robot, &mut rng);
        let mut shots = arm.shots(CaptureSet::Fit, n, &mut rng);
        add_noise(&mut shots, robot.camera.corner_std_px, &mut rng);
        let poses = shots.into_iter().map(|shot| (arm.counts(&shot.angles).to_vec(), shot.tags)).collect();
        Self { robot_folder, robot, poses, folder: temp() }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write_joints(&self, name: &str, lead: &[Lead<'_>], has: impl Fn(usize) -> bool) {
        let names: Vec<&str> = lead.iter().map(|(name, _)| *name).collect();
        let mut text = [names.join(","), self.robot.joint_names().join(",")].join(",") + "\n";
        for (k, (counts, _)) in self.poses.iter().enumerate().filter(|(k, _)| has(*k)) {
            let cells: Vec<String> = lead.iter().map(|(_, cell)| cell(k)).collect();
            let counts: Vec<String> = counts.iter().map(f64::to_string).collect();
            writeln!(text, "{},{}", cells.join(","), counts.join(",")).expect("text");
        }
        write(&self.file(name), &text);
    }

    /// Writes the four corners of a tag per row.
    fn write_tags(&self, name: &str, lead: Lead<'_>, order: [usize; 4]) {
        let mut text = format!("{},tag,x0,y0,x1,y1,x2,y2,x3,y3\n", lead.0);
        for (k, (_, tags)) in self.poses.iter().enumerate() {
            for (id, corners) in tags {
                let cells: Vec<String> = order.iter().flat_map(|at| corners[*at]).map(|px| px.to_string()).collect();
                writeln!(text, "{},tag36h11:{id},{}", (lead.1)(k), cells.join(",")).expect("text");
            }
        }
        write(&self.file(name), &text);
    }

    /// Writes one corner per row.
    fn write_corners(&self, name: &str, lead: Lead<'_>, order: [usize; 4]) {
        let mut text = format!("{};Tag ID;corner;u [px];v [px]\n", lead.0);
        for (k, (_, tags)) in self.poses.iter().enumerate() {
            for (id, corners) in tags {
                for (number, at) in order.into_iter().enumerate() {
                    let [u, v] = corners[at];
                    let pixel = format!("{u};{v}").replace('.', ",");
                    writeln!(text, "{};{id};{number};{pixel}", (lead.1)(k)).expect("text");
                }
            }
        }
        write(&self.file(name), &text);
    }

    fn inspect(&self, tables: &[&str]) -> Answer {
        let mut command = program();
        command.arg("inspect").args(tables.iter().map(|name| self.file(name))).arg("--robot").arg(&self.robot_folder);
        answer(command.arg("--write-input").arg(self.file("map.toml")))
    }

    fn calibrate(&self, table: &str) -> Answer {
        let mut command = program();
        command.arg("calibrate").arg(self.file(table)).arg("--robot").arg(&self.robot_folder);
        answer(command.arg("--input").arg(self.file("map.toml")).arg("--out").arg(self.file("out")))
    }

    fn expect_accepted(&self, table: &str) -> Calibration {
        self.calibrate(table).expect("calibrated", 0, &["ACCEPTED"]);
        self.result()
    }

    fn result(&self) -> Calibration {
        Calibration::read(&self.file("out/calibration.toml")).expect("it reads")
    }

    /// Values of keys of `[tags]` in the proposed map.
    fn tags(&self, keys: &[&str]) -> toml::Value {
        let map: toml::Value = toml::from_str(&read(&self.file("map.toml"))).expect("TOML");
        keys.iter().fold(map["tags"].clone(), |found, key| found[*key].clone())
    }
}

fn image(k: usize) -> String {
    format!("img_{k:04}.png")
}

/// Time in s; images are taken 30 ms after the joints were read.
fn seconds(k: usize) -> String {
    format!("{:.3}", 1.5 * k as f64 + 7.0)
}

fn nanos(k: usize) -> String {
    (1_500_000_000 * k as u64 + 7_030_000_000).to_string()
}

#[test]
fn tables_are_joined_by_the_images_name_as_one_table_would_be() {
    let _texts = Texts::of("tables_are_joined_by_the_images_name_as_one_table_would_be");
    let rig = Rig::new("titan4", 40, 1);
    rig.write_joints("joints.csv", &[("image", &image)], |_| true);
    rig.write_tags("corners.csv", ("file_name", &|k| format!("shots/{}", image(k))), OPENCV);
    rig.inspect(&["joints.csv", "corners.csv"]).expect("both", 0, &["written"]);
    let keys = [&["table", "key"][..], &["table", "joints_key"], &["columns", "corner_order"]];
    assert_eq!(keys.map(|keys| rig.tags(keys)), ["file_name", "image", "opencv"].map(toml::Value::from));
    let two = rig.expect_accepted("joints.csv");
    // The same data in one table.
    let joints = read(&rig.file("joints.csv"));
    let rows: Vec<&str> = joints.lines().map(|line| line.split_once(',').expect("a key").1).collect();
    let corners = read(&rig.file("corners.csv"));
    let mut one = format!("{},{}\n", rows[0], corners.lines().next().expect("names"));
    for line in corners.lines().skip(1) {
        let pose: usize = line[10..14].parse().expect("the image's number");
        writeln!(one, "{},{line}", rows[pose + 1]).expect("text");
    }
    write(&rig.file("one.csv"), &one);
    std::fs::remove_file(rig.file("map.toml")).expect("removed");
    rig.inspect(&["one.csv"]).expect("one", 0, &["written"]);
    let one = rig.expect_accepted("one.csv");
    for (a, b) in two.joint.iter().zip(&one.joint) {
        assert_eq!((a.offset_rad, a.gain_rad_per_count), (b.offset_rad, b.gain_rad_per_count), "{}", a.name);
    }
}

/// Only the table of the tags is named, and its times have another unit.
#[test]
fn tables_next_to_each_other_are_joined_by_time() {
    let _texts = Texts::of("tables_next_to_each_other_are_joined_by_time");
    let rig = Rig::new("kraft-predator", 36, 2);
    rig.write_joints("joints.csv", &[("t", &seconds)], |_| true);
    rig.write_corners("corners.txt", ("stamp", &nanos), APRILTAG);
    write(&rig.file("notes.csv"), "day,weather\n1,2\n");
    rig.inspect(&["corners.txt"]).expect("the tags", 0, &["joints.csv", "written"]);
    let keys = [&["table", "time", "column"][..], &["table", "time", "unit"], &["columns", "corner_order"]];
    assert_eq!(keys.map(|keys| rig.tags(keys)), ["stamp", "ns", "apriltag"].map(toml::Value::from));
    rig.expect_accepted("joints.csv");
    rig.calibrate("corners.txt").expect("the other one", 2, &["`tags.table`", "[table_invalid]"]);
}

/// Dates in another zone in one table, nanoseconds in the other.
#[test]
fn dates_and_nanoseconds_are_joined_by_time() {
    let rig = Rig::new("kraft-predator", 36, 2);
    let date = |k: usize| format!("2026-03-01T13:{:02}:{:02}.030+01:00", k / 60, k % 60);
    let nanos = |k: usize| (1_772_366_400_000_000_000 + 1_000_000_000 * k as u64).to_string();
    rig.write_joints("joints.csv", &[("t", &nanos)], |_| true);
    rig.write_corners("corners.txt", ("stamp", &date), APRILTAG);
    rig.inspect(&["corners.txt"]).expect("the tags", 0, &["joints.csv", "written"]);
    let keys = [&["table", "time", "column"][..], &["table", "time", "unit"]];
    assert_eq!(keys.map(|keys| rig.tags(keys)), ["stamp", "iso8601"].map(toml::Value::from));
    assert!(!read(&rig.file("map.toml")).contains("clock_offset_s"), "the dates are those of the joints");
    rig.expect_accepted("joints.csv");
}

/// A camera with its own clock: the message's line, added to the map, makes the tables fit.
#[test]
fn clocks_of_tables_that_differ_are_named_and_the_advice_works() {
    let _texts = Texts::of("clocks_of_tables_that_differ_are_named_and_the_advice_works");
    let rig = Rig::new("kraft-predator", 40, 3);
    rig.write_joints("joints.csv", &[("time", &|k| format!("{:.3}", 1.79e9 + 2.0 * k as f64))], |_| true);
    rig.write_tags("corners.csv", ("time", &|k| format!("{:.3}", 12.25 + 2.0 * k as f64)), APRILTAG);
    rig.inspect(&["joints.csv", "corners.csv"]).expect("both", 0, &["written"]);
    assert_eq!(rig.tags(&["clock_offset_s"]), toml::Value::from(1_789_999_987.75));
    edit(&rig.file("map.toml"), "clock_offset_s = ", "# ");
    let said = rig.calibrate("joints.csv");
    said.expect("two clocks", 2, &["[clocks_differ]"]);
    let advice = said.stderr.split("clock_offset_s = ").nth(1).and_then(|text| text.split(' ').next());
    let advice = format!("[tags]\nclock_offset_s = {}", advice.expect("a number"));
    edit(&rig.file("map.toml"), "[tags]", &advice);
    rig.expect_accepted("joints.csv");
}

#[test]
fn rows_without_their_other_half_are_counted_and_none_is_taken_twice() {
    let _texts = Texts::of("rows_without_their_other_half_are_counted_and_none_is_taken_twice");
    let rig = Rig::new("titan4", 30, 4);
    rig.write_joints("joints.csv", &[("frame", &image)], |k| k > 2);
    rig.write_tags("corners.csv", ("frame", &image), OPENCV);
    rig.inspect(&["joints.csv"]).expect("joints", 0, &["corners.csv", "written"]);
    let n: usize = rig.poses[..3].iter().map(|(_, tags)| tags.len()).sum();
    let left_out = format!("joints.csv: {n} rows of ");
    rig.calibrate("joints.csv").expect("27 poses", 3, &["ACCEPTED", &left_out, "[messages_rejected]"]);
    // Some rows occur twice.
    let twice = |name: &str| {
        let text = read(&rig.file(name));
        let line = text.lines().next_back().expect("a row").to_owned() + "\n";
        write(&rig.file(name), &(text.clone() + &line));
        let said = rig.calibrate("joints.csv");
        write(&rig.file(name), &text);
        said
    };
    twice("joints.csv").expect("a pose twice", 2, &["[table_invalid]"]);
    twice("corners.csv").expect("a tag twice", 2, &["[table_invalid]"]);
    // The tables have no text in common, and no column that might have one.
    rig.write_tags("corners.csv", ("frame", &|k| format!("shot{k}")), OPENCV);
    rig.calibrate("joints.csv").expect("no match", 2, &["shot0", "img_0003", "joints_key", "[table_invalid]"]);
    std::fs::remove_file(rig.file("map.toml")).expect("removed");
    let both = ["joints.csv", "corners.csv"];
    rig.inspect(&both).expect("nothing joins them", 2, &["[table_invalid]"]);
    assert!(!rig.file("map.toml").exists());
    // With several candidates the user must choose.
    rig.write_tags("corners.csv", ("frame", &image), OPENCV);
    rig.write_tags("old.csv", ("frame", &image), OPENCV);
    rig.inspect(&both[..1]).expect("two others", 2, &["corners.csv", "old.csv", "[usage_invalid]"]);
    rig.inspect(&both).expect("named", 0, &["written"]);
}

/// Both windings in both forms; corners that are listed row by row are read after the advice is followed.
#[test]
fn the_order_of_corners_is_proposed_by_their_winding() {
    let _texts = Texts::of("the_order_of_corners_is_proposed_by_their_winding");
    let rig = Rig::new("kraft-predator", 30, 5);
    rig.write_joints("joints.csv", &[("image", &image)], |_| true);
    let propose = |name: &str, order: [usize; 4]| {
        match name {
            "four.csv" => rig.write_tags(name, ("image", &image), order),
            _ => rig.write_corners(name, ("image", &image), order),
        }
        let _ = std::fs::remove_file(rig.file("map.toml"));
        rig.inspect(&["joints.csv", name]).expect(name, 0, &["written"]);
        rig.tags(&["columns", "corner_order"])
    };
    let orders = [APRILTAG, OPENCV, [1, 0, 3, 2], [0, 1, 3, 2], [3, 2, 0, 1]];
    for name in ["four.csv", "each.csv"] {
        let proposed = orders.map(|order| propose(name, order));
        assert_eq!(proposed, ["apriltag", "opencv", "opencv", "apriltag", "opencv"].map(toml::Value::from), "{name}");
    }
    // The corners are listed row by row: with the columns of the last two exchanged they are read.
    propose("four.csv", [3, 2, 0, 1]);
    rig.calibrate("joints.csv").expect("crossed", 2, &["corner_order", "[input_corner_order]"]);
    edit(&rig.file("map.toml"), "\"x2\", \"y2\", \"x3\", \"y3\"", "\"x3\", \"y3\", \"x2\", \"y2\"");
    rig.expect_accepted("joints.csv");
}

/// The first corner is bottom right, and `inspect` takes it as top left: half of the tags would be accepted as moved.
#[test]
fn a_turn_of_all_tags_is_no_repair_of_each() {
    let rig = Rig::new("kraft-predator", 30, 5);
    rig.write_joints("joints.csv", &[("image", &image)], |_| true);
    rig.write_tags("four.csv", ("image", &image), [1, 0, 3, 2]);
    rig.inspect(&["joints.csv", "four.csv"]).expect("proposed", 0, &["written"]);
    rig.calibrate("joints.csv").expect("turned", 4, &["[input_tag_frames]"]);
}

/// The map names its table relative to its own folder.
#[test]
fn a_map_elsewhere_names_the_table_by_its_whole_path() {
    let rig = Rig::new("titan4", 30, 6);
    rig.write_joints("joints.csv", &[("image", &image)], |_| true);
    rig.write_tags("corners.csv", ("image", &image), OPENCV);
    let elsewhere = temp();
    let mut command = program();
    command.arg("inspect").arg(rig.file("joints.csv")).arg("--robot").arg(&rig.robot_folder).arg("--write-input");
    answer(command.arg(elsewhere.path().join("map.toml"))).expect("proposed", 0, &["written"]);
    std::fs::rename(elsewhere.path().join("map.toml"), rig.file("map.toml")).expect("moved");
    let file = rig.tags(&["table", "file"]);
    assert_eq!(file.as_str(), rig.file("corners.csv").to_str());
    rig.expect_accepted("joints.csv");
}
