//! `inspect` on tables of poses: its description of their columns, and the input map that it proposes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use armcal::input::{Source, parse_input_map, read_external};
use armcal::robot::{Robot, load};
use armcal::stats::stream_rng;
use armcal::streams::JointAngles;
use armcal::tagmap::files::read_landmarks;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::support::synthetic::TrueArm;
use crate::support::texts::Texts;
use crate::support::{Answer, answer, program, read, root, temp, write};

/// A board before an arm.
const BOARD: &str = "version = 1\nkind = \"tag_map\"\n\
    frame = \"base_link\"\n[[tag]]\nname = \"board\"\nposition_m = [1.0, 0.2, -0.1]\n\
    quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\nposition_std_m = [0.002, 0.002, 0.002]\n\
    rotation_std_rad = [0.01, 0.01, 0.01]\n";

/// Joint angles and the board in the camera's frame at random poses.
fn poses(robot: &Robot, n: usize, seed: u64) -> Vec<(JointAngles, Isometry3<f64>)> {
    let mut rng = stream_rng(seed, "tables");
    let arm = TrueArm::with_sensor_errors(robot, &mut rng);
    let base_from_board = Isometry3::from_parts(Translation3::new(1.0, 0.2, -0.1), UnitQuaternion::identity());
    let mut pose = || {
        let angles = arm.random_angles(&mut rng);
        (angles, robot.chain.link_poses(&angles).frame(&arm.camera).inverse() * base_from_board)
    };
    (0..n).map(|_| pose()).collect()
}

fn inspect(table: &Path, robot: Option<&Path>, map: Option<&Path>) -> Answer {
    let mut command = program();
    command.arg("inspect").arg(table);
    if let Some(folder) = robot {
        command.arg("--robot").arg(folder);
    }
    if let Some(file) = map {
        command.arg("--write-input").arg(file);
    }
    answer(&mut command)
}

/// Returns the proposed map, and checks that the table reads by it as `poses`.
#[track_caller]
fn expect_proposal(table: &Path, robot: (&Robot, &Path), poses: &[(JointAngles, Isometry3<f64>)]) -> String {
    let map = table.with_extension("map.toml");
    inspect(table, Some(robot.1), Some(&map)).expect("a table", 0, &["joints", "position", "written"]);
    let text = read(&map);
    let parsed = parse_input_map(&map, &text).expect("it reads");
    let Source::Table(_) = &parsed.source else { panic!("{text}") };
    let tags = table.with_extension("tags.toml");
    write(&tags, BOARD);
    let named = read_landmarks(&tags).expect("it reads").survey(&tags, robot.0, parsed.tag_use).expect("a survey");
    let with_board = robot.0.clone().with_survey(named.survey);
    let recording = read_external(table, &parsed, &with_board).expect("it reads");
    assert_eq!(recording.readings.len(), poses.len(), "{text}");
    for (reading, (angles, _)) in recording.readings.iter().zip(poses) {
        for (joint, spec) in robot.0.sensors.iter().enumerate() {
            let found = (reading.counts[joint] - spec.offset_counts) / spec.counts_per_rad;
            assert!((found - angles[joint]).abs() < 1e-5, "{joint}: {found} against {}\n{text}", angles[joint]);
        }
    }
    for (frame, (_, board)) in recording.frames.iter().zip(poses) {
        let armcal::input::RawMeasurement::Pose(seen) = frame.tags[0].seen else { panic!("{text}") };
        let off_m = (seen.translation.vector - board.translation.vector).norm();
        assert!(off_m < 1e-5 && seen.rotation.angle_to(&board.rotation) < 1e-5, "{off_m} m off\n{text}");
    }
    text
}

fn place(folder: &Path, name: &str) -> PathBuf {
    folder.join(name)
}

#[test]
fn tables_are_described_and_a_map_is_proposed() {
    let _texts = Texts::of("tables_are_described_and_a_map_is_proposed");
    let folder = temp();
    // Joints by their names in radians, a quaternion, times in s.
    let titan_folder = root().join("robots/titan4");
    let titan = load(&titan_folder).expect("it reads");
    let of_titan = poses(&titan, 12, 1);
    let mut text = format!("time,{},tag_x,tag_y,tag_z,tag_qx,tag_qy,tag_qz,tag_qw\n", titan.joint_names().join(","));
    for (k, (angles, board)) in of_titan.iter().enumerate() {
        let [x, y, z]: [f64; 3] = board.translation.vector.into();
        let q = board.rotation;
        let joints: Vec<String> = angles.iter().map(f64::to_string).collect();
        writeln!(text, "{},{},{x},{y},{z},{},{},{},{}", 2 * k, joints.join(","), q.i, q.j, q.k, q.w).expect("text");
    }
    let table = place(folder.path(), "titan.csv");
    write(&table, &text);
    let map = expect_proposal(&table, (&titan, &titan_folder), &of_titan);
    assert!(map.contains("unit = \"rad\"") && map.contains("unit = \"s\""), "{map}");
    // Degrees, millimetres, rotation vectors, columns that are only numbered.
    let bench_folder = root().join("tests/golden/bench");
    let bench = load(&bench_folder).expect("it reads");
    let of_bench = poses(&bench, 15, 2);
    let mut text = "q1;q2;q3;q4;q5;q6;x;y;z;rx;ry;rz\n".to_owned();
    for (angles, board) in &of_bench {
        let joints: Vec<String> = angles.iter().map(|angle| angle.to_degrees().to_string()).collect();
        let mm: Vector3<f64> = 1e3 * board.translation.vector;
        let turn = board.rotation.scaled_axis();
        writeln!(text, "{};{};{};{};{};{};{}", joints.join(";"), mm.x, mm.y, mm.z, turn.x, turn.y, turn.z)
            .expect("text");
    }
    let table = place(folder.path(), "bench.csv");
    write(&table, &text);
    let map = expect_proposal(&table, (&bench, &bench_folder), &of_bench);
    assert!(map.contains("unit = \"deg\"") && map.contains("position_unit = \"mm\""), "{map}");
    // YAML with nested maps; the robot's own pose is not the board's.
    let kraft_folder = root().join("robots/kraft-predator");
    let kraft = load(&kraft_folder).expect("it reads");
    let of_kraft = poses(&kraft, 9, 3);
    let mut text = "date: 2026-03-01\nsamples:\n".to_owned();
    for (angles, board) in &of_kraft {
        let [x, y, z]: [f64; 3] = board.translation.vector.into();
        let q = board.rotation;
        let joints = kraft.joint_names().into_iter().zip(angles.iter()).map(|(name, angle)| format!("{name}: {angle}"));
        let joints: Vec<String> = joints.collect();
        writeln!(
            text,
            "- robot: {{translation: {{x: 1.0, y: 2.0, z: 3.0}}}}\n  joints: {{{}}}\n  tracking: {{translation: \
             {{x: {x}, y: {y}, z: {z}}}, rotation: {{x: {}, y: {}, z: {}, w: {}}}}}",
            joints.join(", "),
            q.i,
            q.j,
            q.k,
            q.w
        )
        .expect("text");
    }
    let table = place(folder.path(), "kraft.yaml");
    write(&table, &text);
    let map = expect_proposal(&table, (&kraft, &kraft_folder), &of_kraft);
    assert!(map.contains("rows = \"samples\"") && map.contains("tracking.translation.x"), "{map}");
}

/// Dates in the format of pandas and ROS tools, in a column of another name, next to a column of numbers.
#[test]
fn dates_are_proposed_as_times_and_read() {
    let folder = temp();
    let titan_folder = root().join("robots/titan4");
    let titan = load(&titan_folder).expect("it reads");
    let of_titan = poses(&titan, 8, 4);
    let forms: [(&str, &dyn Fn(usize) -> String); 3] = [
        ("stamp", &|k| format!("2026-02-28T23:59:{:02}.250000001Z", 50 + k)),
        ("captured_at", &|k| format!("2026-03-01 00:59:{:02},250000001+01:00", 50 + k)),
        ("time [UTC]", &|k| format!("2026-02-28 23:59:{:02}.250000001", 50 + k)),
    ];
    for (k, (column, date)) in forms.into_iter().enumerate() {
        let mut text = format!("{column};{};tag_x;tag_y;tag_z;qx;qy;qz;qw\n", titan.joint_names().join(";"));
        for (row, (angles, board)) in of_titan.iter().enumerate() {
            let [x, y, z]: [f64; 3] = board.translation.vector.into();
            let q = board.rotation;
            let joints: Vec<String> = angles.iter().map(f64::to_string).collect();
            let cells = joints.join(";");
            writeln!(text, "{};{cells};{x};{y};{z};{};{};{};{}", date(row), q.i, q.j, q.k, q.w).expect("text");
        }
        let table = place(folder.path(), &format!("dated{k}.csv"));
        write(&table, &text);
        let said = inspect(&table, Some(&titan_folder), None);
        said.expect("dates", 0, &["2026-02-28T23:59:50.250Z", "2026-02-28T23:59:57.250Z"]);
        let map = expect_proposal(&table, (&titan, &titan_folder), &of_titan);
        assert!(map.contains(&format!("time = {{ column = \"{column}\", unit = \"iso8601\" }}")), "{map}");
        let parsed = parse_input_map(&table, &map).expect("it reads");
        let found = read_external(&table, &parsed, &titan).expect(column);
        let first = found.readings[0].stamp;
        assert_eq!(first.nanos, 1_772_323_190_250_000_001);
        assert!(found.readings.iter().zip(0_u8..).all(|(reading, k)| reading.stamp.since_s(first) == f64::from(k)));
        write(&table, &text.replace(&date(5), "2026-02-30T23:59:55Z"));
        let refused = read_external(&table, &parsed, &titan).expect_err("no such day").to_string();
        let shown = ["row 6", column, "2026-02-30T23:59:55Z"];
        assert!(shown.iter().all(|words| refused.contains(words)), "{refused}");
    }
}

#[test]
fn what_a_table_lacks_is_named() {
    let _texts = Texts::of("what_a_table_lacks_is_named");
    let folder = temp();
    let given = |name: &str, text: &str| {
        let table = place(folder.path(), name);
        write(&table, text);
        (inspect(&table, None, None), inspect(&table, None, Some(&table.with_extension("map.toml"))))
    };
    let names = "joint_names: [j1, j2]\njoint_values:\n  - [0.1, -0.5]\n  - [0.2, -0.4]\n  - [0.3, 0.4]\n";
    let (said, proposed) = given("joints.yaml", names);
    said.expect("joints alone", 0, &["YAML", "3 rows", "j1, j2", "missing "]);
    proposed.expect("joints alone", 2, &["table_invalid"]);
    let samples = "samples:\n- tracking: {translation: {x: 0.1, y: 0.2, z: 0.5}, rotation: {x: 0, y: 0, z: 0, w: 1}}\n\
                   - tracking: {translation: {x: 0.2, y: 0.1, z: 0.6}, rotation: {x: 0, y: 1, z: 0, w: 0}}\n";
    let (said, proposed) = given("samples.yaml", samples);
    said.expect("poses alone", 0, &["`samples`", "2 rows", "position", "missing "]);
    proposed.expect("poses alone", 2, &["joints_mismatch"]);
    let (said, _) =
        given("gaps.csv", "t,q1,q2,x,y,z\n1,0.1,0.2,0.5,0.1,1.0\n3,,0.3,0.5,0.1,1.1\n4,0.2,bad,0.4,0.1,1.2\n");
    said.expect("gaps", 0, &["1 of 3", "`q1`", "`q2`", "\"bad\"", "`t`: 1 to 4"]);
    let (said, _) = given("corners.csv", "joint_1,joint_2,corner,u,v\n0.1,0.2,0,100,200\n0.1,0.2,1,120,200\n");
    said.expect("corners", 0, &["pixel", "corner"]);
    let (said, _) = given("lens.yaml", "image_width: 640\nimage_height: 480\ncamera_name: wrist\n");
    said.expect("no table", 2, &["YAML", "image_width", "table_invalid"]);
    let (said, _) = given("notes.txt", "measured on Monday\nwithout numbers\n");
    said.expect("no table", 2, &["table_invalid"]);
    let json =
        program().arg("inspect").arg(place(folder.path(), "joints.yaml")).arg("--json").output().expect("it runs");
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).expect("JSON");
    assert_eq!((&json["rows"], &json["joints"][1]), (&3.into(), &"j2".into()));
}

#[test]
fn corners_of_tags_are_found_and_proposed() {
    let _texts = Texts::of("corners_of_tags_are_found_and_proposed");
    let folder = temp();
    let titan_folder = root().join("robots/titan4");
    let titan = load(&titan_folder).expect("it reads");
    let joints = titan.joint_names();
    let square = [[10.0, 30.0], [31.0, 30.5], [30.0, 9.0], [10.5, 10.0]];
    let head = format!("time,{},tag_id", joints.join(","));
    let words = |pose: usize| format!("{pose},0.01,0.02,0.03,0.04,0.05,0.06");
    let eight = |names: [&str; 8]| {
        let cells: Vec<String> = square.as_flattened().iter().map(f64::to_string).collect();
        format!("{head},{}\n{},7,{cells}\n{},7,{cells}\n", names.join(","), words(1), words(2), cells = cells.join(","))
    };
    let mut each = format!("{head},corner,u,v\n");
    let mut nested = String::new();
    for pose in [1, 2] {
        for (k, [u, v]) in square.iter().enumerate() {
            writeln!(each, "{},7,{k},{u},{v}", words(pose)).expect("text");
        }
        let named: Vec<String> = joints.iter().zip(1..).map(|(joint, k)| format!("{joint}: 0.0{k}")).collect();
        writeln!(nested, "- {{ time: {pose}, joints: {{ {} }}, tag: 7, corners: {square:?} }}", named.join(", "))
            .expect("text");
    }
    let tables = [
        ("each.csv", each),
        ("u0.csv", eight(["u0", "v0", "u1", "v1", "u2", "v2", "u3", "v3"])),
        (
            "corner1_x.csv",
            eight([
                "corner1_x",
                "corner1_y",
                "corner2_x",
                "corner2_y",
                "corner3_x",
                "corner3_y",
                "corner4_x",
                "corner4_y",
            ]),
        ),
        ("px_0.csv", eight(["px_0", "py_0", "px_1", "py_1", "px_2", "py_2", "px_3", "py_3"])),
        ("nested.yaml", nested),
    ];
    for (name, text) in tables {
        let table = place(folder.path(), name);
        write(&table, &text);
        let map = table.with_extension("map.toml");
        inspect(&table, Some(&titan_folder), Some(&map)).expect(name, 0, &["joints", "pixel", "written"]);
        let parsed = parse_input_map(&map, &read(&map)).expect("it reads");
        let recording = read_external(&table, &parsed, &titan).expect(name);
        assert_eq!(recording.readings.len(), 2, "{name}");
        let seen = &recording.frames[1].tags[0];
        assert_eq!((seen.id, seen.seen), (Some(7), armcal::input::RawMeasurement::Corners(square)), "{name}");
    }
}

/// Corners in the order of OpenCV's detector, read in that of AprilTag: that is a mirror image.
#[test]
fn corners_in_another_order_are_refused_with_the_key_to_change() {
    let _texts = Texts::of("corners_in_another_order_are_refused_with_the_key_to_change");
    let folder = temp();
    let titan_folder = root().join("robots/titan4");
    let titan = load(&titan_folder).expect("it reads");
    let tag = titan.tags[0].id;
    let mut table = format!("time,{},tag,u0,v0,u1,v1,u2,v2,u3,v3\n", titan.joint_names().join(","));
    for pose in 1..7 {
        let at = 500.0 + 10.0 * f64::from(pose);
        let corners =
            [[at, at], [at + 90.0, at], [at + 90.0, at + 90.0], [at, at + 90.0]].map(|[u, v]| format!("{u},{v}"));
        let angles = [0.01; 6].map(|angle| (angle * f64::from(pose)).to_string());
        writeln!(table, "{pose},{},{tag},{}", angles.join(","), corners.join(",")).expect("text");
    }
    let (table_file, map) = (place(folder.path(), "corners.csv"), place(folder.path(), "map.toml"));
    write(&table_file, &table);
    inspect(&table_file, Some(&titan_folder), Some(&map)).expect("a table", 0, &["written"]);
    let proposed = read(&map);
    let other = proposed.replace("corner_order = \"opencv\"", "corner_order = \"apriltag\"");
    assert_ne!(other, proposed, "the map states the order that the corners have");
    write(&map, &other);
    let mut command = program();
    command.arg("calibrate").arg(&table_file).arg("--robot").arg(&titan_folder).arg("--input").arg(&map);
    command.arg("--out").arg(folder.path().join("out"));
    answer(&mut command).expect("mirrored", 2, &["[input_corner_order]"]);
    write(&map, &proposed);
    answer(&mut command).expect("in the proposed order", 4, &["REFUSED"]);
}
