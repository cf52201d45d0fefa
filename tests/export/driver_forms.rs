//! URDF, transmissions and tables: forms for drivers.

use armcal::calib::{Calibration, Status};
use armcal::sensor::{ArmSensors, SensorModel};
use armcal::stats::stream_rng;
use armcal::streams::JointAngles;
use rand::RngExt;

use super::{apart, arm_in, as_calibrated, calibration, calibration_file, export, exported, folder_with, frames};
use crate::support::texts::Texts;
use crate::support::{answer, edit, program, read, robot_copy, robot_folder, root, shared_run, temp, titan, write};

/// Rounding errors of a chain, m and rad.
const ROUNDING: f64 = 1e-12;

/// The camera's own joint is moved, or a link is added where it has none. In both cases the camera has its calibrated
/// pose.
#[test]
fn the_exported_urdf_is_the_calibrated_arm() {
    let _texts = Texts::of("the_exported_urdf_is_the_calibrated_arm");
    const ON_ITS_OWN: &str = "link = \"fisheye\"";
    for (before, after) in [(ON_ITS_OWN, ON_ITS_OWN), ("link = \"wrist_yaw_link\"", "link = \"camera\"")] {
        let [drawn, written] = [temp(), temp()];
        folder_with(drawn.path(), &read(&robot_folder().join("titan4.urdf")), ON_ITS_OWN, before);
        let told = export(&calibration_file(), Some(drawn.path()), "urdf");
        told.expect("urdf", 0, &[]);
        folder_with(written.path(), &told.stdout, ON_ITS_OWN, after);
        let read_back = arm_in(written.path());
        let calibrated = as_calibrated(&arm_in(drawn.path()), &calibration());
        let mut rng = stream_rng(1, "export");
        for _ in 0..100 {
            let angles = JointAngles::from_fn(6, |_| rng.random_range(-3.0..3.0));
            let [ours, theirs] = [&calibrated, &read_back].map(|robot| frames(robot, &angles));
            for (ours, theirs) in ours.iter().zip(&theirs) {
                let (off_m, off_rad) = apart(ours, theirs);
                assert!(off_m < ROUNDING && off_rad < 1e-7, "{off_m} {off_rad}");
            }
        }
        let limits = |robot: &armcal::Robot| robot.chain.joints().iter().map(|joint| joint.limits).collect::<Vec<_>>();
        assert_eq!(limits(&read_back), limits(&titan()), "angles are the calibrated ones");
    }
}

/// Exported readings of a sensor that was set to another zero since would be metres off.
#[test]
fn a_robot_whose_sensors_changed_since_is_refused_by_export_check_and_prior() {
    let folder = temp();
    let file = shared_run().file("calibration.toml");
    let robot = robot_copy(folder.path());
    let expect = |words: &[&str], code: i32| {
        for form in ["table", "ros-parameters", "ros2-control"] {
            export(&file, Some(&robot), form).expect(form, code, words);
        }
        answer(program().arg("check").arg(&file).arg(&robot)).expect("check", code, words);
    };
    expect(&[], 0);
    let zero = titan().sensors[0].offset_counts;
    edit(&robot.join("robot.toml"), &format!("offset_counts = {zero:?}"), "offset_counts = 60000.0");
    let file_name = file.display().to_string();
    let words = ["[robot_mismatch]", "shoulder_yaw", "offset_counts", "60000", &file_name];
    expect(&words, 2);
    let recording = shared_run().file("run.mcap");
    let mut calibrate = program();
    calibrate.arg("calibrate").arg(&recording).arg("--robot").arg(&robot).arg("--prior").arg(&file);
    answer(calibrate.arg("--out").arg(folder.path().join("out"))).expect("prior", 2, &words);
}

#[test]
fn all_else_of_the_urdf_stays_as_it_was() {
    let (drawn, exported) = (read(&robot_folder().join("titan4.urdf")), exported("urdf"));
    let mut lines = exported.lines();
    let changed: Vec<&str> = drawn.lines().filter(|line| !lines.clone().any(|other| other == *line)).collect();
    let origins = ["-0.12116 -0.0016319 0", "0.088284 -0.00021082 0.099958", "-0.124 -0.010 0"];
    assert_eq!(changed.len(), 3, "{changed:?}");
    for (line, origin) in changed.iter().zip(origins) {
        assert!(line.contains(&format!("<origin xyz=\"{origin}\"")), "{line}");
    }
    let kept = drawn.lines().filter(|line| !changed.contains(line));
    assert!(kept.clone().all(|line| lines.any(|other| other == line)), "in their order");
}

/// Link corrections are relative to the nominal model, so a second export would count them twice.
#[test]
fn an_exported_urdf_is_not_exported_again() {
    let _texts = Texts::of("an_exported_urdf_is_not_exported_again");
    let folder = temp();
    folder_with(folder.path(), &exported("urdf"), "[tool]", "[tool]");
    let told = export(&calibration_file(), Some(folder.path()), "urdf");
    told.expect("urdf", 2, &["titan4.urdf", "--robot"]);
    assert_eq!(told.stdout, "");
}

/// For a sample without link corrections and mount, only the comment changes.
#[test]
fn a_calibration_of_sensors_alone_changes_no_number_of_the_urdf() {
    let _texts = Texts::of("a_calibration_of_sensors_alone_changes_no_number_of_the_urdf");
    let told = export(&root().join("recordings/sample/calibration.toml"), Some(&robot_folder()), "urdf");
    told.expect("urdf", 0, &[]);
    let end = told.stdout.rfind("-->").expect("a comment") + "-->".len();
    let start = told.stdout.find("\n<!--\n  Calibrated").expect("the comment");
    let rest = format!("{}{}", &told.stdout[..start], &told.stdout[end..]);
    assert_eq!(rest.trim_end(), read(&robot_folder().join("titan4.urdf")).trim_end());
}

struct Row {
    joint: String,
    counts: f64,
    angle_rad: f64,
}

fn rows(csv: &str) -> Vec<Row> {
    let lines = csv.lines().filter(|line| !line.starts_with('#'));
    let mut cells = lines.map(|line| line.split(',').collect::<Vec<_>>());
    assert_eq!(cells.next(), Some(vec!["joint", "counts", "angle_rad"]));
    let number = |text: &str| text.parse().expect("a number");
    cells.map(|c| Row { joint: c[0].to_owned(), counts: number(c[1]), angle_rad: number(c[2]) }).collect()
}

/// Angle at a reading for a driver that interpolates linearly between the rows.
fn by_table(rows: &[&Row], wrap_counts: f64, reading: f64) -> f64 {
    let first = rows[0].counts;
    let reading = first + (reading - first).rem_euclid(wrap_counts);
    let after = rows.iter().position(|row| row.counts >= reading).expect("the reading is within the table").max(1);
    let (a, b) = (rows[after - 1], rows[after]);
    a.angle_rad + (b.angle_rad - a.angle_rad) * (reading - a.counts) / (b.counts - a.counts)
}

fn of<'a>(rows: &'a [Row], model: &SensorModel) -> Vec<&'a Row> {
    rows.iter().filter(|row| row.joint == model.spec.joint).collect()
}

fn sensors() -> ArmSensors {
    calibration().sensors(&titan()).expect("it fits")
}

#[test]
fn the_table_is_exact_at_its_points_and_covers_each_joints_range() {
    let (sensors, robot) = (sensors(), titan());
    let rows = rows(&exported("table"));
    for (model, joint) in sensors.models.iter().zip(robot.chain.joints()) {
        let of_joint = of(&rows, model);
        assert!(of_joint.windows(2).all(|pair| pair[0].counts < pair[1].counts), "ascending");
        for row in &of_joint {
            assert!(
                (model.angle_rad(row.counts) - row.angle_rad).abs() < 1e-9 || joint.limits.is_none(),
                "{}",
                row.counts
            );
        }
        let ends = [of_joint[0].angle_rad, of_joint[of_joint.len() - 1].angle_rad];
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        match joint.limits {
            Some(limits) => assert!(low <= limits.lower_rad + 1e-9 && high >= limits.upper_rad - 1e-9, "{low} {high}"),
            None => assert!((high - low) * model.spec.counts_per_rad > 0.9 * model.spec.wrap_counts, "the whole word"),
        }
    }
}

#[test]
fn straight_lines_between_the_chosen_points_are_within_the_stated_error_at_the_tool() {
    /// Stated interpolation error, m.
    const STATED: f64 = 2e-5;
    let (sensors, robot) = (sensors(), titan());
    let chosen = rows(&exported("table"));
    let worst_m = |rows: &[Row]| {
        let mut rng = stream_rng(2, "export");
        let mut worst = 0.0_f64;
        for _ in 0..500 {
            let angles = JointAngles::from_fn(6, |j| {
                let spec = &sensors.models[j].spec;
                spec.center_rad + rng.random_range(-1.0..1.0) * spec.half_range_rad
            });
            let readings = sensors.counts(&angles);
            let by_table = JointAngles::from_fn(6, |j| {
                let model = &sensors.models[j];
                by_table(&of(rows, model), model.spec.wrap_counts, readings[j])
            });
            let [ours, theirs] = [&angles, &by_table].map(|angles| frames(&robot, angles)[0]);
            worst = worst.max(apart(&ours, &theirs).0);
        }
        worst
    };
    let worst = worst_m(&chosen);
    let n = chosen.len() / 6;
    eprintln!("{n} points a joint: straight lines are off by {:.4} mm at the tool at most", 1e3 * worst);
    assert!(worst < STATED, "{worst}");
    // A table with half as many points has a larger error, and states it.
    let coarse = answer(
        program()
            .arg("export")
            .arg(calibration_file())
            .args(["--as", "table", "--points=9"])
            .args(["--robot".as_ref(), robot_folder().as_os_str()]),
    );
    coarse.expect("table", 0, &["9 points a joint"]);
    assert!(worst_m(&rows(&coarse.stdout)) > STATED);
    assert!(n > 9, "{n}");
}

/// The line for an acoustic link is enough for a table and for transmissions.
#[test]
fn a_compact_line_gives_table_and_transmissions_and_names_what_it_lacks() {
    let _texts = Texts::of("a_compact_line_gives_table_and_transmissions_and_names_what_it_lacks");
    let folder = temp();
    let sample = root().join("recordings/sample/calibration.toml");
    let line = folder.path().join("line.txt");
    let told = export(&sample, None, "compact");
    write(&line, &told.stdout);
    let robot = robot_folder();
    export(&line, Some(&robot), "table").expect("table", 0, &["wrist_yaw,"]);
    export(&line, Some(&robot), "ros2-control").expect("ros2-control", 0, &["<mechanical_reduction>0.954"]);
    for form in ["urdf", "ros-parameters", "csv", "kalibr", "tagslam"] {
        export(&line, Some(&robot), form).expect(form, 2, &["line.txt", "compact", form, "calibration.toml"]);
    }
}

#[test]
fn forms_that_need_the_drawing_ask_for_it() {
    let _texts = Texts::of("forms_that_need_the_drawing_ask_for_it");
    for form in ["urdf", "ros2-control", "ros-parameters", "table", "kalibr"] {
        export(&calibration_file(), None, form).expect(form, 2, &[form]);
        let other = root().join("robots/kraft-predator");
        export(&calibration_file(), Some(&other), form).expect(form, 2, &["titan4", "kraft-predator"]);
    }
    for (points, words) in [("1", "2..=10000"), ("10001", "2..=10000")] {
        let told = answer(program().args(["export", "x.toml", "--as", "table", "--points", points]));
        told.expect("points", 2, &[words]);
    }
    let told = answer(program().arg("export").arg(calibration_file()).args(["--as", "yaml", "--points", "9"]));
    told.expect("points", 2, &["--points", "table"]);
}

/// A refused calibration is not exported in any form without the option.
#[test]
fn refused_calibrations_are_exported_on_demand_only() {
    let _texts = Texts::of("refused_calibrations_are_exported_on_demand_only");
    let folder = temp();
    let refused = folder.path().join("refused.toml");
    let why = Some("too few views".to_owned());
    write(&refused, &Calibration { status: Status::Refused, refusal: why, ..calibration() }.to_toml());
    for form in ["urdf", "ros2-control", "ros-parameters", "table"] {
        let told = export(&refused, Some(&robot_folder()), form);
        told.expect(form, 4, &["refused.toml", "--refused"]);
        assert_eq!(told.stdout, "");
        let mut command = program();
        command.arg("export").arg(&refused).args(["--as", form, "--refused", "--robot"]).arg(robot_folder());
        assert!(answer(&mut command).code == 0);
    }
    for form in ["urdf", "ros2-control", "ros2-control-offset", "table", "csv", "kalibr"] {
        let mut command = program();
        command.arg("export").arg(&refused).args(["--as", form, "--refused", "--robot"]).arg(robot_folder());
        let told = answer(&mut command);
        let first = told.stdout.lines().find(|line| !line.starts_with("<?xml")).unwrap_or_default();
        assert!(first.contains("REFUSED"), "{form}: {first}");
    }
    export(&refused, None, "yaml").expect("yaml", 4, &["--refused"]);
    let mut command = program();
    answer(command.arg("export").arg(&refused).args(["--as", "yaml", "--refused"])).expect(
        "yaml",
        0,
        &["status: refused"],
    );
}

#[test]
fn what_a_form_cannot_hold_is_named() {
    let _texts = Texts::of("what_a_form_cannot_hold_is_named");
    let folder = temp();
    let file = folder.path().join("bending.toml");
    let sag = "[sag]\nmount_rad_per_nm = [0.0, 0.0, 0.0]\nmount_std_rad_per_nm = [0.0, 0.0, 0.0]\ntool_load_n = 10.0\n\
        tool_load_std_n = 1.0\njoint = []\n";
    write(&file, &format!("{}{sag}", read(&calibration_file())));
    let told = export(&file, Some(&robot_folder()), "urdf");
    told.expect("urdf", 0, &[]);
    assert!(told.stderr.contains("warning: ") && told.stderr.contains("[sag]"), "{}", told.stderr);
    let told = export(&calibration_file(), Some(&robot_folder()), "ros2-control");
    assert!(told.stderr.contains("shoulder_yaw, shoulder_pitch"), "{}", told.stderr);
    assert!(told.stdout.contains("wrist_yaw"), "{}", told.stdout);
}

#[test]
fn offsets_alone_are_params_of_joints_and_a_urdf_with_them_is_named() {
    let told = export(&calibration_file(), Some(&robot_folder()), "ros2-control-offset");
    told.expect("offsets", 0, &["<param name=\"offset\">"]);
    assert!(told.stderr.contains("shoulder_yaw"), "{}", told.stderr);
    let sensors = calibration().sensors(&titan()).expect("sensors");
    for model in &sensors.models {
        let text = format!(
            "<joint name=\"{}\">\n  <param name=\"offset\">{}<",
            model.spec.joint,
            model.correction.offset_rad + 0.0
        );
        assert!(told.stdout.contains(&text), "{text}");
    }
    for form in ["ros2-control-offset", "ros2-control"] {
        let block = exported(form);
        let block =
            if form == "ros2-control" { block } else { format!("<ros2_control name=\"a\">{block}</ros2_control>") };
        let folder = temp();
        let urdf = read(&robot_folder().join("titan4.urdf")).replace("</robot>", &format!("{block}</robot>"));
        folder_with(folder.path(), &urdf, "titan4", "titan4");
        let named = arm_in(folder.path()).urdf_warnings.iter().map(ToString::to_string).collect::<String>();
        assert!(named.contains("`wrist_yaw`") && named.contains("urdf_skipped"), "{named}");
    }
}
