//! An arm with two prismatic joints (tests/golden/slides): a lift that leans, and a telescope as forearm.

use std::path::{Path, PathBuf};

use armcal::calib::{Calibration, CalibrationData, ExternalContext, Status, calibrate_data, prepare_external};
use armcal::input::{parse_input_map, read_external};
use armcal::log::{RecordingHeader, RecordingWriter, RosMessage, ros};
use armcal::robot::{Robot, load};
use armcal::routine::Method;
use armcal::stats::{quantile, stream_rng};
use armcal::streams::CaptureSet;

use crate::board_corners::{by_chance, off_from_view_to_view, squared_errors};
use crate::support::external::{at, header, joint_state};
use crate::support::synthetic::{Shot, TrueArm, add_noise, normal};
use crate::support::texts::Texts;
use crate::support::{ShortRoutine, answer, program, read, root, run, temp, write};

/// Numbers of the joints that slide.
const SLIDES: [usize; 2] = [0, 3];
const N_JOINTS: usize = 6;
const N_POSES: usize = 40;

fn folder() -> PathBuf {
    root().join("tests/golden/slides")
}

fn arm() -> Robot {
    load(&folder()).expect("the robot reads")
}

/// The input map for joint positions in `unit` ("rad", "deg", "counts"); slides are in metres, except for counts.
fn input_map(unit: &str) -> String {
    let unit = if unit == "mm" { "rad\"\nslide_unit = \"mm" } else { unit };
    format!(
        "version = 1\nkind = \"input\"\n\
         [joint_sensors]\ntopic = \"/joint_states\"\nunit = \"{unit}\"\n[tags]\ntopic = \"/tags\"\n\
         camera_frame = \"wrist_optical\"\nuse = \"corners\"\n"
    )
}

/// An arm drawn from its datasheet, with its readings and detections, pose by pose.
struct Recorded<'a> {
    arm: TrueArm<'a>,
    /// Raw words, and the detections.
    poses: Vec<(Vec<f64>, Shot)>,
}

impl<'a> Recorded<'a> {
    fn new(robot: &'a Robot, name: &str, seed: u64) -> Self {
        let mut rng = stream_rng(seed, name);
        let mut arm = TrueArm::as_its_datasheet(robot, &mut rng);
        arm.misplace(&mut rng);
        let mut poses = Vec::new();
        while poses.len() < N_POSES {
            let meant = arm.random_angles(&mut rng);
            let angles = off_from_view_to_view(robot, &meant, &mut rng);
            let see = |idx: usize| Some((robot.tags[idx].id, arm.corners(&angles, idx)?));
            let tags: Vec<_> = (0..robot.tags.len()).filter_map(see).collect();
            if tags.len() >= 3 {
                let noisy = |j: usize| arm.counts(&meant)[j] + robot.sensors[j].noise_std_counts * normal(&mut rng);
                let words: Vec<f64> = (0..N_JOINTS).map(noisy).map(f64::round).collect();
                let mut shot = [Shot { set: CaptureSet::Fit, angles, tags }];
                add_noise(&mut shot, robot.camera.corner_std_px, &mut rng);
                let [shot] = shot;
                poses.push((words, shot));
            }
        }
        Self { arm, poses }
    }

    /// The position that a word has by the datasheet, as a driver publishes it.
    fn position(&self, joint: usize, word: f64, unit: &str) -> f64 {
        let spec = &self.arm.robot.sensors[joint];
        let si = (word - spec.offset_counts) / spec.counts_per_rad;
        match unit {
            "counts" => word,
            "deg" if !SLIDES.contains(&joint) => si.to_degrees(),
            "mm" if SLIDES.contains(&joint) => 1e3 * si,
            _ => si,
        }
    }

    fn write(&self, path: &Path, unit: &str) {
        let mut writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new())).expect("a file");
        for (k, (words, shot)) in self.poses.iter().enumerate() {
            let now = at(k as f64);
            let position = |(joint, name): (usize, String)| (name, self.position(joint, words[joint], unit));
            let joints: Vec<(String, f64)> =
                self.arm.robot.joint_names().into_iter().enumerate().map(position).collect();
            writer.write_ros("/joint_states", &ros::JointState::SCHEMA, now, &joint_state(now, &joints)).expect("ok");
            let detection = |(id, corners): &(u32, [[f64; 2]; 4])| ros::AprilTagDetection {
                id: *id as i32,
                corners: corners.map(|[x, y]| ros::PixelPoint { x, y }),
                ..Default::default()
            };
            let detections = shot.tags.iter().map(detection).collect();
            let array = ros::AprilTagDetectionArray { header: header(now, "wrist_optical"), detections };
            writer.write_ros("/tags", &ros::AprilTagDetectionArray::SCHEMA, now, &array).expect("ok");
        }
        writer.finish().expect("finished");
    }

    fn prepared(&self, unit: &str) -> CalibrationData {
        let folder = temp();
        let path = folder.path().join("arm.mcap");
        self.write(&path, unit);
        let map = parse_input_map(Path::new("map.toml"), &input_map(unit)).expect("a map");
        let recording = read_external(&path, &map, self.arm.robot).expect("it reads");
        prepare_external(&[recording], &map, self.arm.robot, ExternalContext::default()).expect("views")
    }
}

/// Errors of a slide's gain and offset, each with its standard deviation.
fn of_slide(found: &Calibration, arm: &TrueArm<'_>, joint: usize) -> [(f64, f64); 2] {
    let (of, spec) = (&found.joint[joint], &arm.robot.sensors[joint]);
    let gain = of.gain_rad_per_count * spec.counts_per_rad - arm.gain[joint];
    let gain_std = of.gain_std_rad_per_count * spec.counts_per_rad.abs();
    [(gain, gain_std), (of.offset_rad - arm.offset_rad[joint], of.offset_std_rad)]
}

/// Expects errors of the predicted size for arms drawn from their datasheet, and slides as well determined as joints
/// that turn. With only the datasheet the tool error is about 30 mm.
fn expect_errors_of_slides_as_predicted(seeds: u64) {
    /// Tool error, m, median over poses, then median over the arms; `NINE_IN_TEN_M` is for nine in ten arms. Both were
    /// fixed before the first run.
    const MEDIAN_M: f64 = 0.003;
    const NINE_IN_TEN_M: f64 = 0.006;
    /// Largest ratio of a slide's sigmas to the datasheet's.
    const TOLD: f64 = 0.4;
    let robot = arm();
    let (mut all, mut errors_m) = (Vec::new(), Vec::new());
    for seed in 0..seeds {
        let recorded = Recorded::new(&robot, "slides", seed);
        let found = calibrate_data(recorded.prepared("rad"), Method::Bundle, None).expect("calibrated");
        assert_eq!(found.status, Status::Accepted, "seed {seed}: {:?}", found.refusal);
        for joint in SLIDES {
            let [(gain, gain_std), (offset_m, offset_std_m)] = of_slide(&found, &recorded.arm, joint);
            let spec = &robot.sensors[joint];
            assert!(gain_std < TOLD * spec.gain_std && offset_std_m < TOLD * spec.offset_std_rad, "seed {seed}");
            assert!(
                gain.abs() < 5.0 * gain_std && offset_m.abs() < 5.0 * offset_std_m,
                "seed {seed}: {gain} {offset_m}"
            );
        }
        all.push(squared_errors(&recorded.arm, &found, &mut stream_rng(seed, "slides at a pose")));
        errors_m.push(recorded.arm.tool_figures(&found).error_m);
    }
    let n = seeds as usize;
    let parameters: f64 = all.iter().map(|of| of.parameters).sum();
    let tool: f64 = all.iter().map(|of| of.tool).sum();
    let each: Vec<f64> = (0..2 * N_JOINTS).map(|k| all.iter().map(|of| of.each[k]).sum()).collect();
    let [median_m, most_m] = [0.5, 0.9].map(|share| quantile(&errors_m, share).expect("seeds"));
    eprintln!(
        "slides: parameters {:.2} of 12, each {:.2?} of 1, tool {:.2} of 3; tool off {:.2} mm, nine in ten {:.2} mm",
        parameters / n as f64,
        each.iter().map(|sum| sum / n as f64).collect::<Vec<f64>>(),
        tool / n as f64,
        1e3 * median_m,
        1e3 * most_m
    );
    assert!(median_m < MEDIAN_M && most_m < NINE_IN_TEN_M, "{median_m} {most_m}");
    assert!(by_chance(2 * N_JOINTS * n).contains(&parameters), "parameters {parameters}");
    assert!(by_chance(3 * n).contains(&tool), "tool {tool}");
    for sum in each {
        assert!(by_chance(n).contains(&sum), "one parameter {sum}");
    }
}

#[test]
fn errors_of_slides_come_back_and_are_as_large_as_predicted() {
    expect_errors_of_slides_as_predicted(8);
}

#[test]
#[ignore = "second tier: 40 arms, 11 s"]
fn errors_of_slides_come_back_over_forty_arms() {
    expect_errors_of_slides_as_predicted(40);
}

#[test]
fn positions_in_metres_beside_angles_in_any_unit_give_one_calibration() {
    let robot = arm();
    let recorded = Recorded::new(&robot, "units", 1);
    let [rad, deg, mm, counts] = ["rad", "deg", "mm", "counts"]
        .map(|unit| calibrate_data(recorded.prepared(unit), Method::Bundle, None).expect("calibrated"));
    for other in [deg, mm, counts] {
        for (a, b) in rad.joint.iter().zip(&other.joint) {
            let off = (a.gain_rad_per_count / b.gain_rad_per_count - 1.0).abs();
            assert!(off < 1e-6 && (a.offset_rad - b.offset_rad).abs() < 1e-6, "{}: {off:e}", a.name);
        }
    }
}

/// The program's own files and messages name the units of slides.
#[test]
fn millimetres_for_metres_are_refused_by_name() {
    let robot = arm();
    let (recorded, folder) = (Recorded::new(&robot, "units", 1), temp());
    let path = folder.path().join("arm.mcap");
    for (written, stated, words) in
        [("mm", "rad", ["millimetres", "slide_unit = \"mm\""]), ("mm", "deg", ["millimetres", "slide_unit = \"mm\""])]
    {
        recorded.write(&path, written);
        let map = parse_input_map(Path::new("map.toml"), &input_map(stated)).expect("a map");
        let problem = read_external(&path, &map, &robot).expect_err("another unit").to_string();
        assert!(words.iter().all(|word| problem.contains(word)), "{problem}");
    }
    let map = input_map("mm").replace("unit = \"rad\"", "unit = \"counts\"");
    let problem = parse_input_map(Path::new("map.toml"), &map).expect_err("raw readings").to_string();
    assert!(problem.starts_with("map.toml: joint_sensors.slide_unit:"), "{problem}");
}

#[test]
fn files_and_words_are_in_metres_for_slides() {
    let _texts = Texts::of("files_and_words_are_in_metres_for_slides");
    let (robot, folder_out) = (arm(), temp());
    let file = |name: &str| folder_out.path().join(name);
    let recorded = Recorded::new(&robot, "files", 2);
    recorded.write(&file("arm.mcap"), "rad");
    write(&file("map.toml"), &input_map("rad"));
    let mut command = program();
    command.arg("calibrate").arg(file("arm.mcap")).arg("--robot").arg(folder()).arg("--input").arg(file("map.toml"));
    command.arg("--out").arg(file("out"));
    answer(&mut command).expect("calibrate", 0, &["ACCEPTED", "40 views"]);
    let toml = file("out/calibration.toml");
    let text = read(&toml);
    let lift = &text[text.find("name = \"lift\"").expect("lift")..text.find("name = \"shoulder_yaw\"").expect("yaw")];
    for key in
        ["moves = \"prismatic\"", "\noffset_m = ", "\ngain_m_per_count = ", "\ncovered_m = ", "\nhalf_range_m = "]
    {
        assert!(lift.contains(key), "{key} in {lift}");
    }
    assert!(!lift.contains("_rad"), "{lift}");
    let found = Calibration::read(&toml).expect("it reads again");
    assert_eq!(found.to_toml(), text, "written as it was read");
    assert!(found.sensors(&robot).is_ok());
    // A slide has no value in rad.
    write(&file("wrong.toml"), &text.replacen("offset_m = ", "offset_rad = ", 1));
    let export = |calibration: &Path, form: &str| {
        answer(program().arg("export").arg(calibration).args(["--as", form]).arg("--robot").arg(folder()))
    };
    export(&file("wrong.toml"), "json").expect("rad", 2, &["wrong.toml", "`lift`: offset_rad", "offset_m"]);
    export(&toml, "json").expect("json", 0, &["\"offset_m\"", "\"offset_rad\""]);
    export(&toml, "csv").expect("csv", 0, &["joint,center,gain_per_count", ",unit", ",m\n", ",rad\n"]);
    export(&toml, "table").expect("table", 0, &["joint,counts,position,unit"]);
    export(&toml, "ros-parameters").expect("parameters", 0, &["offset_m: ", "counts_per_m: ", "unit: \"m\""]);
    export(&toml, "ros2-control").expect("ros2_control", 0, &[]);
    export(&toml, "urdf").expect("urdf", 0, &["type=\"prismatic\""]);
    export(&toml, "compact").expect("compact", 2, &[]);
    let report = read(&file("out/report.html"));
    for words in ["(slide,", ", mm", " (mm"] {
        assert!(report.contains(words), "{words}");
    }
}

#[test]
fn what_knows_no_slides_refuses_the_arm_and_says_what_works() {
    let _texts = Texts::of("what_knows_no_slides_refuses_the_arm_and_says_what_works");
    let given = temp();
    let file = |name: &str| given.path().join(name);
    let words = ["`lift`", "prismatic", "calibrate"];
    answer(program().arg("check").arg(folder())).expect("check", 0, &["ok: ", "warning", words[0], words[1], words[2]]);
    let routine = ShortRoutine { robot: folder(), ..ShortRoutine::default() }.write(given.path());
    run(&routine, &file("run")).expect("run", 2, &["slides.urdf", words[0], words[1], words[2]]);
    let mut plan = program();
    plan.arg("plan").arg(&routine).arg("--out").arg(file("plan"));
    answer(&mut plan).expect("plan", 2, &["slides.urdf", words[0], words[1], words[2]]);
    let robot = arm();
    Recorded::new(&robot, "refused", 3).write(&file("arm.mcap"), "rad");
    write(&file("map.toml"), &input_map("rad"));
    for how in [&[][..], &["--stationary"]] {
        let mut command = program();
        command.arg("watch").arg(file("arm.mcap")).arg("--robot").arg(folder()).arg("--input");
        command.arg(file("map.toml")).arg("--out").arg(file("out")).args(how);
        answer(&mut command).expect("online", 2, &["slides.urdf", words[0], words[1], words[2], "online"]);
    }
}
