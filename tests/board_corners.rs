//! A chessboard or ChArUco board by its inner corners, from tables and messages: known errors come back.

use std::fmt::Write as _;
use std::path::Path;

use armcal::calib::{
    Calibration, CalibrationData, ExternalContext, PlainLandmark, Status, calibrate_data, prepare_external,
};
use armcal::input::{parse_input_map, read_external};
use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, ros};
use armcal::optics::Chessboard;
use armcal::robot::Robot;
use armcal::routine::Method;
use armcal::stats::{quantile, stream_rng};
use armcal::tagmap::files::read_landmarks;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::support::external::{at, header, joint_state};
use crate::support::synthetic::{N_SEEN, ToolFigures, TrueArm, normal, pixel, small_motion};
use crate::support::{answer, program, robot_folder, temp, titan, write};

const BOARD: Chessboard = Chessboard { squares: [9, 7], square_m: 0.06 };
/// How far the board is from where its map has it, one sigma.
const BOARD_STD: [f64; 2] = [0.002, 0.003];
/// Corners in view that make a pose.
const MIN_CORNERS: usize = 12;

const CSV_MAP: &str = "version = 1\n[table]\n[joint_sensors]\n[tags]\nchild_frame = \"board\"\n\
    use = \"board_corners\"\n[tags.columns]\nid = \"corner\"\npixel = [\"u\", \"v\"]\n";
const MCAP_MAP: &str = "version = 1\n[joint_sensors]\ntopic = \"/joint_states\"\n[tags]\ntopic = \"/corners\"\n\
    child_frame = \"board\"\nuse = \"board_corners\"\n";

/// Numbers of corners and where they were seen, px.
type SeenCorners = Vec<(u32, [f64; 2])>;

/// An arm's words and the corners that its camera saw, pose by pose.
struct BoardTitan<'a> {
    arm: TrueArm<'a>,
    poses: Vec<(Vec<f64>, SeenCorners)>,
}

/// As the map has it: upright before the arm, its printed side (against z) towards the base.
fn drawn_board() -> Isometry3<f64> {
    let axes = Matrix3::from_columns(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::new(1.4, 0.5, 0.0), turn)
}

impl<'a> BoardTitan<'a> {
    fn new(robot: &'a Robot, n: usize, seed: u64) -> Self {
        let mut rng = stream_rng(seed, "board titan");
        let mut arm = TrueArm::with_sensor_errors(robot, &mut rng);
        arm.misplace(&mut rng);
        let base_from_board = drawn_board() * small_motion(BOARD_STD[0], BOARD_STD[1], &mut rng);
        let mut poses = Vec::new();
        while poses.len() < n {
            let angles = arm.random_angles(&mut rng);
            let camera_from_base = robot.chain.link_poses(&angles).frame(&arm.camera).inverse();
            let corners = corners(robot, &(camera_from_base * base_from_board), &mut rng);
            if corners.len() >= MIN_CORNERS {
                poses.push((arm.counts(&angles).iter().map(|word| word.round() % 65536.0).collect(), corners));
            }
        }
        Self { arm, poses }
    }

    /// A row for each corner.
    fn write_csv(&self, path: &Path) {
        let mut text = format!("{},corner,u,v\n", self.arm.robot.joint_names().join(","));
        for (words, corners) in &self.poses {
            let words: Vec<String> = words.iter().map(f64::to_string).collect();
            for (number, [u, v]) in corners {
                let _ = writeln!(text, "{},{number},{u},{v}", words.join(","));
            }
        }
        write(path, &text);
    }

    /// The same as messages: each corner is a detection whose id is its number, and whose centre is its place.
    fn write_mcap(&self, path: &Path) {
        let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
        for (k, (words, corners)) in self.poses.iter().enumerate() {
            let now = at(k as f64);
            let joints: Vec<(String, f64)> =
                self.arm.robot.joint_names().into_iter().zip(words.iter().copied()).collect();
            writer.write_ros("/joint_states", &ros::JointState::SCHEMA, now, &joint_state(now, &joints)).expect("ok");
            let detection = |&(number, [x, y]): &(u32, [f64; 2])| ros::AprilTagDetection {
                id: number as i32,
                centre: ros::PixelPoint { x, y },
                ..ros::AprilTagDetection::default()
            };
            let detections = corners.iter().map(detection).collect();
            let message = ros::AprilTagDetectionArray { header: header(now, "camera"), detections };
            writer.write_ros("/corners", &ros::AprilTagDetectionArray::SCHEMA, now, &message).expect("ok");
        }
        writer.finish().expect("finished");
    }
}

/// Corners of the board's printed side in the image, with the noise that robot.toml has.
fn corners(robot: &Robot, camera_from_board: &Isometry3<f64>, rng: &mut ChaCha8Rng) -> Vec<(u32, [f64; 2])> {
    let middle = camera_from_board * BOARD.corner(BOARD.n_corners() / 2).expect("a corner");
    let facing = (camera_from_board.rotation * Vector3::z()).dot(&middle.coords) / middle.coords.norm();
    if !(0.3..2.0).contains(&middle.coords.norm()) || facing < 0.45 {
        return Vec::new();
    }
    let seen = (0..BOARD.n_corners()).filter_map(|number| {
        let on_board = BOARD.corner(number).expect("a corner");
        Some((number, pixel(&robot.camera.lens, &(camera_from_board * on_board))?))
    });
    seen.map(|(number, at)| (number, at.map(|px| px + robot.camera.corner_std_px * normal(rng)))).collect()
}

fn tag_map(squares: &str) -> String {
    let (place, q) = (drawn_board().translation.vector, drawn_board().rotation);
    format!(
        "version = 1\nframe = \"base_link\"\n[[tag]]\nname = \"board\"\n{squares}position_m = {:?}\n\
         quaternion_wxyz = {:?}\nposition_std_m = {:?}\nrotation_std_rad = {:?}\n",
        [place.x, place.y, place.z],
        [q.w, q.i, q.j, q.k],
        [BOARD_STD[0]; 3],
        [BOARD_STD[1]; 3]
    )
}

const SQUARES: &str = "squares = [9, 7]\nsquare_m = 0.06\n";

fn prepared(robot: &Robot, titan: &BoardTitan<'_>) -> CalibrationData {
    let folder = temp();
    let (path, tags) = (folder.path().join("arm.csv"), folder.path().join("tags.toml"));
    titan.write_csv(&path);
    write(&tags, &tag_map(SQUARES));
    let map = parse_input_map(Path::new("map.toml"), CSV_MAP).expect("a map");
    let named = read_landmarks(&tags).expect("it reads").survey(&tags, robot, map.tag_use).expect("a survey");
    let (id, board) = named.boards.first_key_value().expect("a board");
    let plain = PlainLandmark { id: Some(*id), board: Some(*board) };
    let robot = robot.clone().with_survey(named.survey);
    let recording = read_external(&path, &map, &robot).expect("it reads");
    let context = ExternalContext { plain, ..ExternalContext::default() };
    prepare_external(&[recording], &map, &robot, context).expect("views")
}

fn calibrated(data: CalibrationData) -> Calibration {
    calibrate_data(data, Method::Bundle, None).expect("calibrated")
}

#[test]
fn known_errors_come_back_from_a_boards_corners() {
    const SEEDS: u64 = 10;
    let robot = titan();
    let (mut in_sigmas, mut refused) = (Vec::new(), 0);
    let mut figures: Vec<ToolFigures> = Vec::new();
    for seed in 0..SEEDS {
        let titan = BoardTitan::new(&robot, 40, seed);
        let found = calibrated(prepared(&robot, &titan));
        if found.status == Status::Refused {
            eprintln!("seed {seed}: {:?}", found.refusal);
            refused += 1;
        }
        for j in 0..N_SEEN {
            let (joint, spec) = (&found.joint[j], &robot.sensors[j]);
            let off = joint.gain_rad_per_count * spec.counts_per_rad - titan.arm.gain[j];
            in_sigmas.push(((joint.offset_rad - titan.arm.offset_rad[j]) / joint.offset_std_rad).abs());
            in_sigmas.push((off / (joint.gain_std_rad_per_count * spec.counts_per_rad.abs())).abs());
        }
        figures.push(titan.arm.tool_figures(&found));
    }
    let q = |values: &[f64], q: f64| quantile(values, q).expect("values");
    let (median, p95) = (q(&in_sigmas, 0.5), q(&in_sigmas, 0.95));
    let median_mm = |of: fn(&ToolFigures) -> f64| 1e3 * q(&figures.iter().map(of).collect::<Vec<f64>>(), 0.5);
    let (error_mm, predicted_mm) = (median_mm(|f| f.error_m), median_mm(|f| f.predicted_m));
    let nees = figures.iter().map(|f| f.nees).sum::<f64>() / SEEDS as f64;
    eprintln!("errors in sigma {median:.2}, {p95:.2}; tool {error_mm:.2} mm of {predicted_mm:.2}, NEES {nees:.2}");
    assert_eq!(refused, 0);
    // A normal's are 0.67 and 1.96, and a NEES of 3: these sensors are straight, and the datasheet's need not be.
    assert!((0.1..0.8).contains(&median) && p95 < 2.2, "median {median}, 95 % {p95}");
    assert!(error_mm < 3.0 && (0.5..4.5).contains(&nees), "{error_mm} mm, {nees}");
}

#[test]
fn a_table_and_messages_of_a_boards_corners_give_one_calibration() {
    let (robot, folder) = (titan(), temp());
    let titan = BoardTitan::new(&robot, 40, 3);
    let file = |name: &str| folder.path().join(name);
    titan.write_csv(&file("arm.csv"));
    titan.write_mcap(&file("arm.mcap"));
    write(&file("csv.toml"), CSV_MAP);
    write(&file("mcap.toml"), MCAP_MAP);
    write(&file("tags.toml"), &tag_map(SQUARES));
    let mut check = program();
    check.arg("check").args([file("csv.toml"), file("mcap.toml"), file("tags.toml")]);
    answer(&mut check).expect("both maps", 0, &["corners of the board `board`"]);
    let calibrated = |recording: &str, map: &str| {
        let out = file(&format!("{recording}-out"));
        let mut command = program();
        command.arg("calibrate").arg(file(recording)).arg("--robot").arg(robot_folder()).arg("--input").arg(file(map));
        command.arg("--tag-map").arg(file("tags.toml")).arg("--out").arg(&out);
        answer(&mut command).expect(recording, 0, &["ACCEPTED", "40 views", "reprojection error"]);
        Calibration::read(&out.join("calibration.toml")).expect("it reads")
    };
    let [csv, mcap] = [calibrated("arm.csv", "csv.toml"), calibrated("arm.mcap", "mcap.toml")];
    for (a, b) in csv.joint.iter().zip(&mcap.joint).take(N_SEEN) {
        let off = (a.gain_rad_per_count / b.gain_rad_per_count - 1.0).abs();
        assert!(off < 1e-6 && (a.offset_rad - b.offset_rad).abs() < 1e-6, "{}: {off:e}", a.name);
        assert!(a.gain_estimated && a.offset_estimated, "{}", a.name);
    }
}

#[test]
fn a_board_that_is_not_as_the_tag_map_says_is_refused() {
    let (robot, folder) = (titan(), temp());
    let titan = BoardTitan::new(&robot, 12, 4);
    let file = |name: &str| folder.path().join(name);
    titan.write_csv(&file("arm.csv"));
    write(&file("map.toml"), CSV_MAP);
    let refused = |map: &str, words: &[&str]| {
        write(&file("tags.toml"), map);
        let mut command = program();
        command.arg("calibrate").arg(file("arm.csv")).arg("--robot").arg(robot_folder()).arg("--input");
        command.arg(file("map.toml")).arg("--tag-map").arg(file("tags.toml")).arg("--out").arg(file("out"));
        answer(&mut command).expect(map, 2, words);
    };
    // Columns and rows exchanged; no squares; one of the two keys; a number in place of a name.
    refused(&tag_map("squares = [7, 9]\nsquare_m = 0.06\n"), &["not a square"]);
    refused(&tag_map(""), &["map.toml", "tags.child_frame", "board", "squares"]);
    refused(&tag_map("squares = [9, 7]\n"), &["tags.toml", "board", "square_m", "missing"]);
    refused(&tag_map(SQUARES).replace("name = \"board\"", "id = 3"), &["tags.toml", "tag 3", "name"]);
    refused(&tag_map(SQUARES).replace("[9, 7]", "[9, 2]"), &["tags.toml", "squares", "3 .. 100"]);
}
