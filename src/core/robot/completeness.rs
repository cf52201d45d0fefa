//! Missing keys of robot.toml, all of them at once.

use crate::codes::Code;
use std::cell::LazyCell;
use std::path::Path;

use toml::{Table, Value};

use super::error::FileIssue;
use crate::kinematics::JointKind;

const ROBOT_KEYS: [&str; 6] = ["name", "urdf", "base_link", "tool", "joint_sensor", "camera"];
const TOOL_KEYS: [&str; 2] = ["link", "point_m"];
const CAMERA_KEYS: [&str; 4] = ["name", "link", "mount_std_m", "mount_std_rad"];
const SENSOR_KEYS: [&str; 12] = [
    "joint",
    "kind",
    "offset_counts",
    "scale_counts_per_deg",
    "wrap_counts",
    "gain_std",
    "offset_std_rad",
    "gain_bound",
    "offset_bound_rad",
    "noise_std_counts",
    "linearity_std_rad",
    "max_rate_rad_s",
];
const SLIDE_KEYS: [&str; 12] = [
    "joint",
    "kind",
    "offset_counts",
    "scale_counts_per_mm",
    "wrap_counts",
    "gain_std",
    "offset_std_m",
    "gain_bound",
    "offset_bound_m",
    "noise_std_counts",
    "linearity_std_m",
    "max_rate_m_s",
];
const GRIPPER_KEYS: [&str; 5] = ["jaws", "opens_along", "rest_opening_m", "opening_max_m", "closing_time_s"];
const TAG_KEYS: [&str; 7] =
    ["id", "family", "size_m", "position_m", "quaternion_wxyz", "position_std_m", "rotation_std_rad"];

/// Checks that `robot` has every key that all commands need. `joints` gives the moving joints of the URDF, if it can be
/// read; it is called only if something is missing.
///
/// # Errors
/// [`FileIssue`] naming all missing keys, and all joints without a sensor.
pub(super) fn check_complete(
    file: &Path,
    robot: &Table,
    joints: impl FnOnce() -> Option<Vec<(String, JointKind)>>,
) -> Result<(), FileIssue> {
    let mut missing: Vec<String> = missing_in("", robot, &ROBOT_KEYS).into_iter().collect();
    let optional = [("gripper", &GRIPPER_KEYS[..]), ("gripper_tag", &TAG_KEYS), ("hydraulics", &["pump_l_per_min"])];
    for (name, keys) in [("tool", &TOOL_KEYS[..]), ("camera", &CAMERA_KEYS)].into_iter().chain(optional) {
        let table = robot.get(name).and_then(Value::as_table);
        missing.extend(table.and_then(|table| missing_in(&format!("[{name}] "), table, keys)));
    }
    let sensors = tables(robot, "joint_sensor");
    let joints = LazyCell::new(|| joints().unwrap_or_default());
    for (n, sensor) in sensors.iter().enumerate() {
        let joint = sensor.get("joint").and_then(Value::as_str).map_or_else(|| format!("number {}", n + 1), quoted);
        let place = format!("[[joint_sensor]] {joint}: ");
        let lacks = |keys| missing_in(&place, sensor, keys);
        missing.extend(lacks(&SENSOR_KEYS).zip(lacks(&SLIDE_KEYS)).map(|(turning, sliding)| {
            let is_it = |(name, _): &&(String, JointKind)| sensor.get("joint").and_then(Value::as_str) == Some(name);
            if joints.iter().find(is_it).is_some_and(|(_, kind)| kind.is_slide()) { sliding } else { turning }
        }));
    }
    for (n, tag) in tables(robot, "tag").iter().enumerate() {
        let id = tag.get("id").map_or_else(|| format!("number {}", n + 1), Value::to_string);
        missing.extend(missing_in(&format!("[[tag]] {id}: "), tag, &TAG_KEYS));
    }
    for (n, camera) in tables(robot, "further_camera").iter().enumerate() {
        let name = camera.get("name").map_or_else(|| format!("number {}", n + 1), Value::to_string);
        missing.extend(missing_in(&format!("[[further_camera]] {name}: "), camera, &CAMERA_KEYS));
    }
    if missing.is_empty() {
        return Ok(());
    }
    let named: Vec<&str> = sensors.iter().filter_map(|sensor| sensor.get("joint")?.as_str()).collect();
    for (kind, keys) in [(JointKind::Revolute, &SENSOR_KEYS), (JointKind::Prismatic, &SLIDE_KEYS)] {
        let is_without = |(name, of): &&(String, JointKind)| *of == kind && !named.contains(&name.as_str());
        let without: Vec<String> = joints.iter().filter(is_without).map(|(name, _)| quoted(name)).collect();
        if !without.is_empty() {
            let (names, keys) = (without.join(", "), keys[1..].join(", "));
            missing.push(format!("a [[joint_sensor]] for each of {names} ({keys})"));
        }
    }
    let problem =
        format!("{}. Add them: `armcal new-robot` writes all of them for a URDF, with their units", missing.join("; "));
    Err(FileIssue::new(Code::KeyMissing, file, "missing", problem))
}

fn quoted(name: &str) -> String {
    format!("`{name}`")
}

fn tables<'a>(robot: &'a Table, name: &str) -> Vec<&'a Table> {
    robot.get(name).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_table).collect()
}

/// Describes the missing keys of one table.
fn missing_in(place: &str, table: &Table, keys: &[&str]) -> Option<String> {
    let missing: Vec<&str> = keys.iter().filter(|key| !table.contains_key(**key)).copied().collect();
    (!missing.is_empty()).then(|| format!("{place}{}", missing.join(", ")))
}
