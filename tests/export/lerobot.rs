//! LeRobot's calibration JSON: recordings read by it, and the exported homing offsets.

use std::path::{Path, PathBuf};

use armcal::export::lerobot_homings;
use armcal::input::{InputMap, read_external, read_input_map};
use armcal::robot::Robot;
use armcal::sensor::{ArmSensors, SensorModel};

use super::{calibration, calibration_file, export};
use crate::support::{answer, program, read, robot_folder, temp, titan, write};

/// The Titan 4 on motors of 4096 ticks per turn.
fn on_motors() -> Robot {
    let mut robot = titan();
    for spec in &mut robot.sensors {
        spec.counts_per_rad = 4096.0 / std::f64::consts::TAU;
        (spec.offset_counts, spec.wrap_counts) = (2048.0, 4096.0);
    }
    robot
}

/// Writes input map and JSON into a folder: every joint's motor, and a gripper's.
fn files(folder: &Path, robot: &Robot, motors: &str, values: &str) -> PathBuf {
    let motor = |id: usize, name: &str| {
        format!(
            "\"{name}\": {{\"id\": {id}, \"drive_mode\": 0, \"homing_offset\": {}, \"range_min\": {}, \"range_max\": \
             3400}}",
            10 * id,
            700 + id
        )
    };
    let names = robot.joint_names().into_iter().chain(["gripper".to_owned()]);
    let motors_json: Vec<String> = names.enumerate().map(|(id, name)| motor(id, &name)).collect();
    write(&folder.join("arm.json"), &format!("{{{}}}", motors_json.join(", ")));
    let names: Vec<String> = robot.joint_names().iter().map(|name| format!("{name} = \"{name}.pos\"")).collect();
    let map = folder.join("map.toml");
    let text = format!(
        "version = 1\nkind = \"input\"\n\
         [table]\n[joint_sensors]\nnames = {{ {} }}\nlerobot = {{ file = \"arm.json\", motors = \
         \"{motors}\", values = \"{values}\" }}\n[tags]\nchild_frame = \"board\"\nuse = \"position\"\n\
         [tags.columns]\ndirection = \"camera_from_tag\"\nposition = [\"x\", \"y\", \"z\"]\n",
        names.join(", ")
    );
    write(&map, &text);
    map
}

fn read_map(file: &Path) -> InputMap {
    read_input_map(file).expect("it reads")
}

#[test]
fn numbers_of_lerobot_are_read_as_ticks() {
    let robot = on_motors();
    let folder = temp();
    let head: Vec<String> = robot.joint_names().iter().map(|name| format!("{name}.pos")).collect();
    let table = folder.path().join("poses.csv");
    // Degrees count from the middle of 700 + id to 3400; percents are of its half.
    for (values, number, tick_of) in [
        ("degrees", 9.0, (|id: f64| 0.5 * (4100.0 + id) + 9.0 * 4095.0 / 360.0) as fn(f64) -> f64),
        ("range_m100_100", 25.0, |id| 0.5 * (4100.0 + id) + 0.125 * (2700.0 - id)),
        ("ticks", 2100.0, |_| 2100.0),
    ] {
        let map = files(folder.path(), &robot, "feetech", values);
        let cells = vec![number.to_string(); robot.n_joints()].join(",");
        write(&table, &format!("{},x,y,z\n{cells},0,0,1\n", head.join(",")));
        let found = read_external(&table, &read_map(&map), &robot).expect(values);
        for (joint, counts) in found.readings[0].counts.iter().enumerate() {
            assert!((counts - tick_of(joint as f64)).abs() < 1e-9, "{values}: {counts}");
        }
    }
    let map = files(folder.path(), &robot, "feetech", "range_m100_100");
    write(&table, &format!("{},x,y,z\n{},0,0,1\n", head.join(","), vec!["101"; robot.n_joints()].join(",")));
    let told = read_external(&table, &read_map(&map), &robot).expect_err("no percent").to_string();
    assert!(told.contains("range_m100_100"), "{told}");
    let told = read_map(&map).check_robot(&map, &titan()).expect_err("other counts").to_string();
    assert!(told.contains("11.37778"), "{told}");
    let mut other = robot.clone();
    other.sensors[2].joint = "elbow".to_owned();
    let told = read_map(&map).check_robot(&map, &other).expect_err("no motor").to_string();
    assert!(told.contains("elbow"), "{told}");
}

/// The middle of each motor's range reads as robot.toml's angle there, within half a tick.
#[test]
fn homing_offsets_put_the_middle_of_the_range_at_its_angle() {
    let robot = on_motors();
    for (motors, sign) in [("feetech", -1.0), ("dynamixel", 1.0)] {
        let folder = temp();
        let map_file = files(folder.path(), &robot, motors, "degrees");
        let map = read_map(&map_file);
        let mut sensors = ArmSensors::nominal(&robot);
        for (joint, model) in sensors.models.iter_mut().enumerate() {
            model.correction.offset_rad = 0.02 * joint as f64 - 0.05;
            model.correction.gain = 1.003;
        }
        let found = lerobot_homings((&map_file, &map), &calibration(), (&robot, &sensors)).expect("homings");
        assert!(found.left_out.iter().any(|what| what.contains("+0.300")), "{found:?}");
        assert!(found.left_out.iter().any(|what| what.contains("shoulder_pitch")), "{found:?}");
        let [before, after] = [read(&folder.path().join("arm.json")), found.text].map(|text| {
            let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            json
        });
        assert_eq!(before["gripper"], after["gripper"]);
        for (model, spec) in sensors.models.iter().zip(&robot.sensors) {
            let motor = |json: &serde_json::Value, key: &str| json[&spec.joint][key].as_f64().expect("a number");
            let middle = 0.5 * (motor(&after, "range_min") + motor(&after, "range_max"));
            assert!(middle > 2000.0 && motor(&before, "range_min") == motor(&after, "range_min"));
            // The motor's own angle at the new middle, and its reading there with the old offset.
            let actual = middle - sign * motor(&after, "homing_offset");
            let reading = actual + sign * motor(&before, "homing_offset");
            let angle_off = model.angle_rad(reading) - SensorModel::nominal(spec).angle_rad(middle);
            assert!(angle_off.abs() < 0.51 / spec.counts_per_rad, "{motors} {}: {angle_off}", spec.joint);
        }
    }
}

#[test]
fn what_lerobots_form_lacks_is_asked_for() {
    let folder = temp();
    export(&calibration_file(), Some(&robot_folder()), "lerobot").expect("no map", 2, &["--input"]);
    let map = files(folder.path(), &titan(), "feetech", "degrees");
    let with = |map: &Path| {
        let mut command = program();
        command.arg("export").arg(calibration_file()).args(["--as", "lerobot", "--robot"]).arg(robot_folder());
        answer(command.arg("--input").arg(map))
    };
    with(&map).expect("other counts", 2, &["scale_counts_per_deg"]);
    write(&map, &read(&map).lines().filter(|line| !line.starts_with("lerobot")).collect::<Vec<_>>().join("\n"));
    with(&map).expect("no JSON named", 2, &["joint_sensors.lerobot"]);
}
