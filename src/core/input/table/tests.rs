use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::input::{ExternalRecording, InputError, RawMeasurement, parse_input_map, read_external};
use crate::robot::Robot;

const JOINTS: &str = "shoulder_yaw,shoulder_pitch,forearm_pitch,wrist_pitch,wrist_yaw,wrist_rotate";
const MAP: &str = "version = 1\nkind = \"input\"\n\
    [table]\n[joint_sensors]\n[tags]\nchild_frame = \"board\"\nuse = \"pose\"\n\
    [tags.columns]\ndirection = \"camera_from_tag\"\nposition = [\"x\", \"y\", \"z\"]\n";
/// Angles about the fixed axes x, y and z, rad.
const ANGLES: [f64; 3] = [0.4, -1.1, 2.3];
const POSITION_M: [f64; 3] = [0.1, -0.2, 0.9];

fn titan() -> Robot {
    crate::robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/titan4")).expect("it reads")
}

/// Returns the recording that the map reads from a file of that name and content.
fn read_with(map: &str, name: &str, text: &str) -> Result<ExternalRecording, InputError> {
    let folder = tempfile::tempdir().expect("a folder");
    let file: PathBuf = folder.path().join(name);
    std::fs::write(&file, text).expect("written");
    read_external(&file, &parse_input_map(Path::new("map.toml"), map).expect("a map"), &titan())
}

/// Message about a refused file, without the name of its folder.
fn problem(map: &str, name: &str, text: &str) -> String {
    let told = read_with(map, name, text).expect_err("refused").to_string();
    let at = told.find(name).expect("the file's name");
    format!("{}\n", &told[at..])
}

/// Rz Ry Rx, multiplied out by hand.
fn rotation() -> Matrix3<f64> {
    let [(sx, cx), (sy, cy), (sz, cz)] = ANGLES.map(f64::sin_cos);
    let rx = Matrix3::new(1.0, 0.0, 0.0, 0.0, cx, -sx, 0.0, sx, cx);
    let ry = Matrix3::new(cy, 0.0, sy, 0.0, 1.0, 0.0, -sy, 0.0, cy);
    let rz = Matrix3::new(cz, -sz, 0.0, sz, cz, 0.0, 0.0, 0.0, 1.0);
    rz * ry * rx
}

fn pose() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation()));
    Isometry3::from_parts(Translation3::from(Vector3::from(POSITION_M)), turn)
}

fn names(n: usize) -> Vec<String> {
    (0..n).map(|k| format!("r{k}")).collect()
}

#[test]
fn every_form_of_a_pose_means_the_same() {
    let q = pose().rotation;
    let axis_angle = q.scaled_axis();
    let degrees = ANGLES.map(f64::to_degrees);
    let forms: [(&str, Vec<f64>); 6] = [
        ("quaternion_wxyz", vec![q.w, q.i, q.j, q.k]),
        ("quaternion_xyzw", vec![-q.i, -q.j, -q.k, -q.w]),
        ("matrix", rotation().transpose().iter().copied().collect()),
        ("rotation_vector", axis_angle.iter().copied().collect()),
        ("fixed_xyz", ANGLES.to_vec()),
        ("fixed_xyz\"\nrotation_unit = \"deg", degrees.to_vec()),
    ];
    for (form, values) in forms {
        let columns = names(values.len());
        let map = format!("{MAP}rotation = {columns:?}\nrotation_form = \"{form}\"\n");
        let cells: Vec<String> = POSITION_M.iter().chain(&values).map(f64::to_string).collect();
        let text = format!("{JOINTS},x,y,z,{}\n1,2,3,4,5,6,{}\n", columns.join(","), cells.join(","));
        let found = read_with(&map, "poses.csv", &text).expect(form);
        let RawMeasurement::Pose(read) = found.frames[0].tags[0].seen else { panic!("a pose") };
        assert!((read.translation.vector - pose().translation.vector).norm() < 1e-12, "{form}");
        assert!(read.rotation.angle_to(&q) < 1e-9, "{form}: {read}");
        assert_eq!(&found.readings[0].counts[..], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }
}

#[test]
fn the_camera_in_the_boards_frame_is_turned_round() {
    let other = pose().inverse();
    let at_mm = other.translation.vector * 1e3;
    let (roll, pitch, yaw) = other.rotation.euler_angles();
    let map = format!("{MAP}rotation = [\"a\", \"b\", \"c\"]\nrotation_form = \"fixed_xyz\"\nposition_unit = \"mm\"\n");
    let map = map.replace("camera_from_tag", "tag_from_camera");
    let text = format!(
        "# from a rig\n{JOINTS},a,b,c,x,y,z\n1,2,3,4,5,6,{roll},{pitch},{yaw},{},{},{}\n",
        at_mm.x, at_mm.y, at_mm.z
    );
    for (text, name) in [(text.clone(), "a.csv"), (text.replace(',', ";"), "a.txt"), (text.replace(',', "\t"), "a.tsv")]
    {
        let position = read_with(&map.replace("\"pose\"", "\"position\""), name, &text).expect("it reads");
        let RawMeasurement::Position(read) = position.frames[0].tags[0].seen else { panic!("a position") };
        assert!((read - Vector3::from(POSITION_M)).norm() < 1e-12, "{name}: {read}");
    }
}

#[test]
fn joints_of_the_datasheets_angles_become_counts() {
    let robot = titan();
    let map = format!("{MAP}rotation = [\"a\", \"b\", \"c\"]\nrotation_form = \"fixed_xyz\"\n");
    let text = format!("{JOINTS},a,b,c,x,y,z\n-30,20,10,-20,15,5,0,0,0,0,0,1\n");
    let (deg, rad) =
        (map.replace("[tags]\n", "unit = \"deg\"\n[tags]\n"), map.replace("[tags]\n", "unit = \"rad\"\n[tags]\n"));
    let found = read_with(&deg, "a.csv", &text).expect("it reads");
    let sensors = crate::sensor::ArmSensors::nominal(&robot);
    for (joint, degrees) in [-30.0_f64, 20.0, 10.0, -20.0, 15.0, 5.0].into_iter().enumerate() {
        let angle = sensors.models[joint].angle_rad(found.readings[0].counts[joint]);
        assert!((angle - degrees.to_radians()).abs() < 1e-9, "{joint}: {angle}");
    }
    let in_rad = read_with(&rad, "a.csv", &text.replace("-30,20,10,-20,15,5", "-0.5,0,0,0,0,0")).expect("it reads");
    assert!((sensors.models[0].angle_rad(in_rad.readings[0].counts[0]) + 0.5).abs() < 1e-9);
}

/// YAML as eye-to-hand rigs write it: an entry for each time, joints in a list, the pose in a map.
#[test]
fn yaml_entries_are_rows_in_a_list_or_a_map() {
    let map = format!(
        "{MAP}rotation = [\"pose.qw\", \"pose.qx\", \"pose.qy\", \"pose.qz\"]\nrotation_form = \"quaternion_wxyz\"\n"
    );
    let map = map.replace("\"x\", \"y\", \"z\"", "\"pose.x\", \"pose.y\", \"pose.z\"");
    let named: Vec<String> = JOINTS.split(',').zip(0..).map(|(joint, k)| format!("{joint} = \"joints.{k}\"")).collect();
    let map = map.replace("[tags]\n", &format!("names = {{ {} }}\n[tags]\n", named.join(", ")));
    let q = pose().rotation;
    let [x, y, z] = POSITION_M;
    let entry = |k: usize| {
        format!(
            "joints: [{k}, 2, 3, 4, 5.5, 6e0], other: [], pose: {{ qw: {}, qx: {}, qy: {}, qz: {}, x: {x}, y: {y}, \
             z: {z} }}",
            q.w, q.i, q.j, q.k
        )
    };
    let list = format!("- {{ {} }}\n- {{ {} }}\n", entry(1), entry(2));
    let entries = format!("'1593701755': {{ {} }}\n'1593701808': {{ {} }}\n", entry(1), entry(2));
    let below = format!("rig: one\nviews:\n  poses:\n    {}", entries.replace("\n'", "\n    '"));
    let deeper = map.replace("[table]\n", "[table]\nrows = \"views.poses\"\n");
    for (map, text) in [(&map, &list), (&map, &entries), (&deeper, &below)] {
        let found = read_with(map, "poses.yaml", text).expect(text);
        assert_eq!(found.readings.len(), 2);
        assert_eq!(&found.readings[1].counts[..], [2.0, 2.0, 3.0, 4.0, 5.5, 6.0]);
        let RawMeasurement::Pose(read) = found.frames[1].tags[0].seen else { panic!("a pose") };
        assert!(read.rotation.angle_to(&q) < 1e-9 && (read.translation.vector.x - x).abs() < 1e-12);
    }
    let told = [
        problem(&deeper, "poses.yaml", &list),
        problem(&map, "poses.yaml", &list.replace("qx", "qX")),
        problem(&map, "poses.yaml", &list.replace("6e0", "six")),
        problem(&map, "poses.yaml", &"[".repeat(100)),
    ];
    insta::assert_snapshot!("yaml", told.concat());
}

#[test]
fn rows_of_several_tags_are_one_pose() {
    let map = MAP.replace("child_frame = \"board\"\n", "").replace("\"pose\"", "\"position\"") + "id = \"tag\"\n";
    let rows = "1,2,3,4,5,6,7,0,0,1,10\n1,2,3,4,5,6,3,0,1,1,10\n1,2,3,4,5,6,7,0,0,1,20\n1,2,3,4,5,7,7,0,0,1,30\n";
    let text = format!("{JOINTS},tag,x,y,z,t\n{rows}");
    let timed = map.replace("[table]\n", "[table]\ntime = { column = \"t\", unit = \"ms\" }\n");
    let timed_text = text.replace(",20\n", ",1020\n").replace(",30\n", ",2030\n");
    for (map, text, apart_s) in [(&map, &text, [2.0, 1.0]), (&timed, &timed_text, [1.01, 1.01])] {
        let found = read_with(map, "tags.csv", text).expect("it reads");
        let ids: Vec<Vec<u32>> =
            found.frames.iter().map(|frame| frame.tags.iter().filter_map(|tag| tag.id).collect()).collect();
        assert_eq!(ids, [vec![3, 7], vec![7], vec![7]]);
        for (k, apart_s) in apart_s.into_iter().enumerate() {
            let found_s = found.readings[k + 1].stamp.since_s(found.readings[k].stamp);
            assert!((found_s - apart_s).abs() < 1e-9, "{found_s}");
        }
    }
    let faults = [",1,20\n", ",1,5\n", ",2,10\n", ",1,-1\n"].map(|to| timed_text.replace(",1,1020\n", to));
    let mut told = faults.map(|text| problem(&timed, "tags.csv", &text)).concat();
    told += &problem(&timed, "tags.csv", &timed_text.replace("5,6,3,", "5,9,3,"));
    told += &problem(&map, "tags.csv", &text.replace(",7,0,0", ",7.5,0,0"));
    insta::assert_snapshot!("rows_of_tags", told);
}

#[test]
fn what_is_wrong_with_a_table_is_named() {
    let map = format!("{MAP}rotation = {:?}\nrotation_form = \"quaternion_wxyz\"\n", names(4));
    let text = format!("{JOINTS},x,y,z,r0,r1,r2,r3\n1,2,3,4,5,6,0,0,1,1,0,0,0\n1,2,3,4,5,6,0,0,2,1,0,0,0\n");
    assert_eq!(read_with(&map, "a.csv", &text).expect("good").frames.len(), 2);
    let faults = [
        ("shoulder_yaw", "base"),
        ("r3", "r0"),
        ("0,0,2,1", "0,0,2,1.1"),
        ("0,0,2,1", "0,,2,1"),
        ("0,0,2,1", "0,nan,2,1"),
        ("0,0,2,1", "0,0,0,1"),
        ("0,0,2,1", "0,0,2,1,7"),
        ("1,2,3,4,5,6,0,0,2,1", "x,2,3,4,5,6,0,0,2,1"),
    ];
    let told = faults.map(|(from, to)| {
        assert!(text.contains(from), "{from}");
        problem(&map, "a.csv", &text.replacen(from, to, 1))
    });
    let lenient = map.replace("[table]", "not_finite = \"leave_out\"\n[table]");
    let found = read_with(&lenient, "a.csv", &text.replace("0,0,2,1", "0,nan,2,1")).expect("one row is left");
    assert_eq!((found.frames.len(), found.left_out.values().sum::<u64>()), (1, 1));
    // The wrist's rotation moves no camera.
    let without = text.replace(",wrist_rotate", "").replace(",6,0,0", ",0,0");
    assert_eq!(read_with(&map, "a.csv", &without).expect("good").absent_joints, [5]);
    let matrix = map.replace("quaternion_wxyz", "matrix").replace("\"r3\"]", "\"r3\",\"x\",\"y\",\"z\",\"r0\",\"r1\"]");
    let many = format!("{text}{}", "1,2,3,4,5,6,0,0,1,1,0,0,0\n".repeat(super::rows::MAX_ROWS));
    let told = told.into_iter().chain([
        problem(&map, "a.xyz", &text),
        problem(&map, "a.csv", text.lines().next().expect("a line")),
        problem(&matrix, "a.csv", &text),
        problem(&map, "a.csv", &many),
    ]);
    insta::assert_snapshot!("table", told.collect::<String>());
}

const CORNERS: &str = "version = 1\nkind = \"input\"\n\
    [table]\n[joint_sensors]\n[tags]\nuse = \"corners\"\n[tags.columns]\n\
    id = \"tag\"\n";
/// Bottom left, bottom right, top right, top left of two tags.
const SQUARES: [[[f64; 2]; 4]; 2] =
    [[[10.0, 30.5], [31.0, 30.0], [30.0, 9.0], [10.5, 10.0]], [[50.0, 70.5], [71.0, 70.0], [70.0, 49.0], [50.5, 50.0]]];

/// Rows of one tag each.
const ALL_IN_ONE: &str = "a,b,c,d,e,f,g,h";

/// Rows of two tags at two poses, in these columns; `order` has the corners' positions as printed.
fn corner_rows(order: [usize; 4], columns: &str) -> String {
    let mut text = format!("{JOINTS},tag,{columns}\n");
    for (pose, tag) in [(1, 0), (1, 1), (2, 1)] {
        let square = order.map(|place| SQUARES[tag][place]);
        if columns == ALL_IN_ONE {
            let cells = square.as_flattened().iter().map(f64::to_string).collect::<Vec<_>>().join(",");
            text += &format!("{pose},2,3,4,5,6,{tag},{cells}\n");
        } else {
            let rows = square.iter().enumerate().map(|(k, [u, v])| format!("{pose},2,3,4,5,6,{tag},{k},{u},{v}\n"));
            text.extend(rows);
        }
    }
    text
}

#[test]
fn corners_of_tags_are_rows_each_or_eight_columns() {
    let each = format!("{CORNERS}corner = \"k\"\npixel = [\"u\", \"v\"]\n");
    let eight = format!("{CORNERS}corners = [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\", \"g\", \"h\"]\n");
    let opencv = "corner_order = \"opencv\"\n";
    for (map, columns) in [(&each, "k,u,v"), (&eight, ALL_IN_ONE)] {
        for (map, order) in [(map.clone(), [0, 1, 2, 3]), (format!("{map}{opencv}"), [3, 2, 1, 0])] {
            let found = read_with(&map, "corners.csv", &corner_rows(order, columns)).expect(&map);
            let read =
                |frame: &crate::input::TagFrame| frame.tags.iter().map(|tag| (tag.id, tag.seen)).collect::<Vec<_>>();
            let [first, second] = [0, 1].map(|k| (Some(k as u32), RawMeasurement::Corners(SQUARES[k])));
            let frames: Vec<_> = found.frames.iter().map(read).collect();
            assert_eq!(frames, [vec![first, second], vec![second]], "{map}");
            assert!(found.left_out.is_empty());
        }
    }
    let text = corner_rows([0, 1, 2, 3], "k,u,v");
    let part = text.replace("2,2,3,4,5,6,1,3,50.5,50\n", "");
    let found = read_with(&each, "corners.csv", &part).expect("a tag is left");
    assert_eq!((found.frames.len(), found.left_out.values().sum::<u64>()), (1, 1));
    let timed = each.replace("[table]\n", "[table]\ntime = { column = \"wrist_rotate\" }\n");
    let told = [
        problem(&each, "a.csv", &text.replace("1,2,3,4,5,6,0,3,", "1,2,3,4,5,6,0,4,")),
        problem(&each, "a.csv", &text.replace(",k,", ",corner,")),
        problem(&timed, "a.csv", &text.replace("1,2,3,4,5,6,0,3,", "1,2,3,4,5,6,0,2,")),
        problem(&each, "a.csv", &text.lines().take(4).collect::<Vec<_>>().join("\n")),
        problem(&eight, "a.csv", &corner_rows([0, 1, 2, 3], ALL_IN_ONE).replace(",70.5,", ",,")),
    ];
    insta::assert_snapshot!("tag_corners", told.concat());
}

/// Reading is linear in the rows, even if all of them are of one pose.
#[test]
fn many_corners_of_one_pose_are_read_at_once() {
    let map = format!("{CORNERS}corner = \"k\"\npixel = [\"u\", \"v\"]\n");
    let mut text = format!("{JOINTS},tag,k,u,v\n");
    for k in (0..super::rows::MAX_ROWS).rev() {
        text += &format!("1,2,3,4,5,6,{},{},{k},{k}\n", k / 4, k % 4);
    }
    let found = read_with(&map, "a.csv", &text).expect("it reads");
    assert_eq!((found.frames.len(), found.frames[0].tags.len()), (1, super::rows::MAX_ROWS / 4));
}

const PLACES: &str = "version = 1\n[table]\n[joint_sensors]\n[tags]\nuse = \"position\"\n[tags.columns]\n\
    id = \"tag\"\ndirection = \"camera_from_tag\"\nposition = [\"x\", \"y\", \"z\"]\n";

/// Rows of two poses with a tag each, with a point or a comma in the decimals.
fn two_poses(mark: char, point: &str) -> String {
    let text = format!("{JOINTS},tag,x,y,z\n1.5,2,3,4,5,6,3,0,0.25,1\n2.5,2,3,4,5,6,7,0,0.5,2\n");
    text.replace('.', "\0").replace(',', &mark.to_string()).replace('\0', point)
}

#[test]
fn csv_is_read_as_programs_write_it() {
    let plain = two_poses(',', ".");
    let (names, rows) = plain.split_once('\n').expect("a line of names");
    let second = rows.lines().nth(1).expect("a row");
    let spaced = |text: &str| text.replace(',', "  ");
    let texts = [
        plain.clone(),
        two_poses(';', ","),
        two_poses('\t', ","),
        format!("\u{feff}{}", plain.replace('\n', "\r\n")),
        plain.replace('\n', "\r"),
        spaced(&plain),
        format!("sep=;\n{}", two_poses(';', ".")),
        format!("% bench 3\n// of May\n{plain}# end\n"),
        format!("Rig 7; all poses\nby us\n\n{plain}"),
        format!("# saved by a script\n# {names}\n{rows}"),
        format!("# {}\n{}", spaced(names), spaced(rows)),
        plain.replace(second, &format!("{names}\n{second}")),
        format!("{names}\nrad,rad,rad,rad,rad,rad,-,m,m,m\n{rows}"),
        plain.lines().map(|line| format!("{line},,\n")).collect(),
        format!("{names}\n{}", rows.replace('\n', ",\n")),
        plain.replace(",3,0,", ",tag36h11:3,0,").replace(",7,0,", ",tag_0007,0,"),
        plain
            .split(&[',', '\n'][..])
            .collect::<Vec<_>>()
            .chunks(10)
            .filter(|row| row.len() > 1)
            .fold(String::new(), |text, row| {
                text + &row.iter().map(|cell| format!("\"{cell}\"")).collect::<Vec<_>>().join(",") + "\n"
            }),
    ];
    let expected = read_with(PLACES, "a.csv", &plain).expect("plain");
    assert_eq!(expected.readings[1].counts[..2], [2.5, 2.0]);
    for text in texts {
        let found = read_with(PLACES, "a.csv", &text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!((found.readings, found.frames), (expected.readings.clone(), expected.frames.clone()), "{text}");
    }
    // A row with words for no value.
    let lenient = PLACES.replace("[table]", "not_finite = \"leave_out\"\n[table]");
    for word in ["N/A", "", "null", "-", "nan"] {
        let found = read_with(&lenient, "a.csv", &plain.replace("0.25", word)).expect(word);
        assert_eq!((found.frames.len(), found.left_out.values().sum::<u64>()), (1, 1), "{word}");
    }
}

#[test]
fn csv_that_is_of_no_use_is_refused_with_the_remedy() {
    let plain = two_poses(',', ".");
    let told = [
        problem(PLACES, "a.csv", plain.split_once('\n').expect("names").1),
        problem(PLACES, "a.csv", &plain.replace("0.25", "N/A")),
        problem(PLACES, "a.csv", &plain.replace("0.25", "\"[0.1, 0.25]\"")),
        problem(PLACES, "a.csv", &plain.replace("0.25", "left")),
        problem(PLACES, "a.csv", &plain.replace(",3,0,", ",tag36h11,0,")),
        problem(PLACES, "a.csv", &plain.replace("0.25,", "0.25,9,")),
        problem(PLACES, "a.csv", &plain.replace(",x,y,z", "").replace(",0,0.25,1", "").replace(",0,0.5,2", "")),
    ];
    insta::assert_snapshot!("csv_of_no_use", told.concat());
    let folder = tempfile::tempdir().expect("a folder");
    let bytes: [(&str, Vec<u8>); 5] = [
        ("excel.xlsx", b"PK\x03\x04\x14\0\x06\0\x08\0[Content_Types].xml".to_vec()),
        ("run.mcap", b"\x89MCAP0\r\n".to_vec()),
        (
            "utf16.csv",
            plain.encode_utf16().flat_map(u16::to_le_bytes).fold(vec![0xff, 0xfe], |mut all, byte| {
                all.push(byte);
                all
            }),
        ),
        ("excel.csv", b"PK\x03\x04\x14\0\x06\0\x08\0[Content_Types].xml".to_vec()),
        (
            "latin.csv",
            plain.replace("tag", "mark").into_bytes().into_iter().map(|b| if b == b'k' { 0xe4 } else { b }).collect(),
        ),
    ];
    let map = parse_input_map(Path::new("map.toml"), PLACES).expect("a map");
    let told = bytes.map(|(name, bytes)| {
        let file = folder.path().join(name);
        std::fs::write(&file, bytes).expect("written");
        let told = read_external(&file, &map, &titan()).expect_err("refused").to_string();
        told[told.find(name).expect("the file's name")..].to_owned()
    });
    insta::assert_snapshot!("no_utf8", told.join("\n"));
}

/// One entry per pose, with the camera's measurements of the tags in a list: as a JSON array, and as one line per
/// entry.
#[test]
fn lists_of_tags_make_a_row_each() {
    let map = "version = 1\n[table]\n[joint_sensors]\n[tags]\nuse = \"position\"\n[tags.columns]\n\
        id = \"seen.*.id\"\ndirection = \"camera_from_tag\"\n\
        position = [\"seen.*.at.0\", \"seen.*.at.1\", \"seen.*.at.2\"]\n";
    let joints = |k: usize| {
        let named = JOINTS.split(',').map(|name| format!("\"{name}\": {k}.5"));
        named.collect::<Vec<_>>().join(", ")
    };
    let entries = [
        format!("{{{}, \"seen\": [{{\"id\": 4, \"at\": [0, 0, 1]}}, {{\"id\": 9, \"at\": [0, 1, 1]}}]}}", joints(1)),
        format!("{{{}, \"seen\": []}}", joints(2)),
        format!("{{{}, \"seen\": [{{\"id\": 9, \"at\": [1, 1, 1]}}]}}", joints(3)),
    ];
    for (name, text) in [("a.json", format!("[{}]", entries.join(", "))), ("a.jsonl", entries.join("\n"))] {
        let found = read_with(map, name, &text).expect(name);
        let ids: Vec<Vec<Option<u32>>> =
            found.frames.iter().map(|frame| frame.tags.iter().map(|tag| tag.id).collect()).collect();
        assert_eq!(ids, [vec![Some(4), Some(9)], vec![Some(9)]], "{name}");
        assert_eq!(found.readings[1].counts[0], 3.5);
    }
    let shared = format!("common: &all {{{}}}\nposes:\n", joints(5));
    let rows = "- {<<: *all, seen: [{id: 1, at: [0, 0, 1]}]}\n".repeat(150);
    let at = map.replace("[table]\n", "[table]\nrows = \"poses\"\n");
    assert_eq!(read_with(&at, "a.yaml", &(shared + &rows)).expect("anchors").frames.len(), 150);
}

/// Two tagged poses at dates, to the nanosecond.
const DATED: &str = "2026-03-01T12:00:00.000000001Z,1.5,2,3,4,5,6,3,0,0.25,1\n\
    2026-03-01T12:00:01.500000003Z,2.5,2,3,4,5,6,7,0,0.5,2\n";

#[test]
fn times_may_be_dates() {
    let map = PLACES.replace("[table]", "[table]\ntime = { column = \"when\", unit = \"iso8601\" }");
    let names = format!("when,{JOINTS},tag,x,y,z");
    let text = format!("{names}\n{DATED}");
    let decimal = |text: &str| text.replace(',', ";").replace('.', ",");
    let entries: Vec<String> = DATED
        .lines()
        .map(|row| {
            let cells = names.split(',').zip(row.split(',')).enumerate();
            let cell = |(k, (name, cell)): (usize, (&str, &str))| {
                if k == 0 { format!("\"{name}\": \"{cell}\"") } else { format!("\"{name}\": {cell}") }
            };
            format!("{{{}}}", cells.map(cell).collect::<Vec<_>>().join(", "))
        })
        .collect();
    let texts = [
        ("a.csv", text.clone()),
        ("a.csv", text.replace("01T12", "01 12").replace('Z', "")),
        ("a.csv", text.replace("T12", "t13").replace('Z', "+01:00")),
        ("a.csv", text.replace("2026-03-01T12:00:00.000000001Z", "\"2026-03-01T12:00:00,000000001Z\"")),
        ("a.csv", decimal(&text)),
        ("a.tsv", text.replace(',', "\t")),
        ("a.txt", text.replace(',', "  ")),
        ("a.csv", format!("# {names}\n{DATED}")),
        ("a.csv", text.replace("z\n", "z\nUTC,rad,rad,rad,rad,rad,rad,-,m,m,m\n")),
        ("a.jsonl", entries.join("\n")),
        ("a.yaml", entries.iter().map(|entry| format!("- {}\n", entry.replace('"', ""))).collect()),
    ];
    let start = 1_772_366_400_000_000_000;
    for (name, text) in texts {
        let found = read_with(&map, name, &text).unwrap_or_else(|error| panic!("{error}: {text}"));
        let nanos: Vec<i64> = found.readings.iter().map(|reading| reading.stamp.nanos - start).collect();
        assert_eq!(nanos, [1, 1_500_000_003], "{text}");
        assert_eq!(found.frames.len(), 2);
    }
}

#[test]
fn what_is_wrong_with_a_date_is_named() {
    let map = PLACES.replace("[table]", "[table]\ntime = { column = \"when\", unit = \"iso8601\" }");
    let text = format!("when,{JOINTS},tag,x,y,z\n{DATED}");
    let second = "2026-03-01T12:00:01.500000003Z";
    let faults = [
        "12:00:01",
        "2026-03-01",
        "2026-13-01T12:00:01Z",
        "2026-02-29T12:00:01Z",
        "2026-03-01T24:00:00Z",
        "1969-12-31T23:59:59Z",
        "99999-03-01T12:00:01Z",
        "\u{5348}\u{5f8c} 12:00",
        "1772366401.5",
        "",
        "2026-03-01T12:00:00.200Z",
    ];
    let mut told = faults.map(|fault| problem(&map, "a.csv", &text.replace(second, fault))).concat();
    told += &problem(&map.replace("iso8601", "s"), "a.csv", &text);
    told += &problem(&map, "a.csv", DATED);
    insta::assert_snapshot!("dates", told);
    let lenient = map.replace("[table]", "not_finite = \"leave_out\"\n[table]");
    let found = read_with(&lenient, "a.csv", &text.replace(second, "n/a")).expect("one row is left");
    assert_eq!((found.frames.len(), found.left_out.values().sum::<u64>()), (1, 1));
}

/// Times of rows in any order, some of them twice.
#[test]
fn rows_are_sorted_by_their_time_and_copies_are_counted() {
    let map = PLACES.replace("[table]", "[table]\ntime = { column = \"t\" }");
    let row = |k: usize| format!("{k}.5,2,3,4,5,6,{},0,0.25,1,{}\n", k % 3, 100 + 2 * (k / 3));
    let joints = |k: usize| row(k).replacen(&format!("{k}.5"), &format!("{}.5", k / 3), 1);
    let read = |order: &[usize]| {
        let rows: String = order.iter().map(|k| joints(*k)).collect();
        read_with(&map, "a.csv", &format!("{JOINTS},tag,x,y,z,t\n{rows}")).expect("it reads")
    };
    let sorted = read(&(0..12).collect::<Vec<_>>());
    assert_eq!((sorted.readings.len(), sorted.rows_sorted, sorted.skipped.len()), (4, 0, 0));
    for step in [5, 7, 11] {
        let mut order: Vec<usize> = (0..12).map(|k| (k * step) % 12).collect();
        let shuffled = read(&order);
        assert_eq!((&shuffled.readings.len(), &shuffled.skipped), (&4, &sorted.skipped), "{step}");
        let tags = |found: &ExternalRecording| found.frames.iter().map(|frame| frame.tags.clone()).collect::<Vec<_>>();
        assert_eq!(tags(&shuffled), tags(&sorted), "{step}");
        assert!(shuffled.rows_sorted > 0, "{step}");
        order.extend([0, 4, 4]);
        let copied = read(&order);
        assert_eq!(copied.skipped.values().sum::<u64>(), 3, "{step}");
        assert_eq!(tags(&copied), tags(&sorted), "{step}");
    }
}

/// Images of two days have the same names in two folders.
#[test]
fn whole_names_of_images_join_tables_before_names_without_their_folder() {
    let read = |in_joints: [&str; 2], in_tags: [&str; 2]| {
        let folder = tempfile::tempdir().expect("a folder");
        let [a, b] = in_joints;
        let joints = format!("image,{JOINTS}\n{a},1,2,3,4,5,6\n{b},2,2,3,4,5,6\n");
        let [a, b] = in_tags;
        let tags = format!("image,tag,x,y,z\n{b},3,0,0.5,1\n{a},3,0,0.25,1\n");
        std::fs::write(folder.path().join("joints.csv"), joints).expect("written");
        std::fs::write(folder.path().join("tags.csv"), tags).expect("written");
        let map = PLACES.replace("[tags]\n", "[tags]\ntable = { file = \"tags.csv\", key = \"image\" }\n");
        let map = parse_input_map(&folder.path().join("map.toml"), &map).expect("a map");
        read_external(&folder.path().join("joints.csv"), &map, &titan())
    };
    let days = ["day1/img_0.png", "day2/img_0.png"];
    for (in_joints, in_tags) in
        [(days, days), (["a/1.png", "a/2.png"], ["b/1.jpg", "b/2.jpg"]), (["1", "2"], ["1.0", "2.0"])]
    {
        let found = read(in_joints, in_tags).expect("they join");
        let seen: Vec<_> = found.frames.iter().map(|frame| frame.tags[0].seen).collect();
        let places = [0.25, 0.5].map(|y| RawMeasurement::Position(Vector3::new(0.0, y, 1.0)));
        assert_eq!(seen, places, "{in_joints:?}");
    }
    let ambiguous = read(days, ["img_0.png", "img_1.png"]);
    assert!(matches!(ambiguous, Err(InputError::Row { .. })), "{ambiguous:?}");
}
