//! The robot's URDF with the calibrated geometry written in.

use armcal_core::codes::Code;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;

use crate::export::urdf_text::{UrdfText, comment_text, xyz_rpy};
use armcal_belief::calib::{Calibration, CameraMount, FurtherCamera};
use armcal_core::robot::{CameraSpec, FileIssue, Robot, RobotError, parse_toml, read_text};

/// Words by which an exported file is recognised.
const MARK: &str = "Calibrated by armcal";

const CONVENTION: &str = "  \
  Joint angles are calibrated angles; zeros and limits are the drawing's. Gain, offset and terms of the joint sensors
  are not in this file. Apply them once, where counts become radians: by the table, by the ROS parameters, or by the
  transmissions of ros2_control. Do not shift joint origins or limits by the offsets as well. With this file, do not
  apply [[link]] and [camera_mount] of calibration.toml again.
";

/// A URDF with the calibrated geometry, and the camera's link in it.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedUrdf {
    /// Text of the file.
    pub text: String,
    /// The link whose frame is the camera's optical frame.
    pub camera_link: String,
    /// Parts of the calibration that no URDF can hold, in words.
    pub left_out: Vec<String>,
}

/// Part of robot.toml: the links that carry camera and tool.
#[derive(Deserialize)]
struct RobotToml {
    camera: OnLink,
    tool: OnLink,
}

#[derive(Deserialize)]
struct OnLink {
    link: String,
}

/// New origins of the text's joints, elements that are added, and both in words.
#[derive(Default)]
struct Changes {
    origins: Vec<(usize, Isometry3<f64>)>,
    added: String,
    in_words: Vec<String>,
    camera_link: String,
}

/// The URDF of `robot` with joint origins that include the estimated link corrections, and the camera at its estimated
/// mount. `calibration` is that of the robot's sensors. Angles are calibrated ones; the file contains no sensor
/// corrections. `file` is the calibration's file, for messages.
///
/// # Errors
/// [`RobotError`] naming file and key: values out of range, or a URDF that is an exported one already.
pub fn calibrated_urdf(file: &Path, calibration: &Calibration, robot: &Robot) -> Result<CalibratedUrdf, RobotError> {
    let (_, urdf) = read_urdf(robot)?;
    let mut changes = Changes::default();
    move_joints(file, calibration, robot, &urdf, &mut changes)?;
    place_camera(file, calibration, robot, &urdf, &mut changes)?;
    add_further_cameras(file, calibration, robot, &urdf, &mut changes)?;
    let left_out = left_out(calibration);
    let comment = comment(calibration, &changes, &left_out);
    let text = urdf.edited(&changes.origins, &comment, &changes.added);
    Ok(CalibratedUrdf { text, camera_link: changes.camera_link, left_out })
}

/// Text and path of the robot's URDF.
///
/// # Errors
/// [`RobotError`] for a URDF that is an exported one already.
pub(super) fn read_urdf(robot: &Robot) -> Result<(PathBuf, UrdfText), RobotError> {
    let urdf_file = robot.folder.join(&robot.urdf_name);
    if robot.urdf_text.contains(MARK) {
        let problem = format!(
            "has `{MARK}` in it: its corrections would be applied twice; give --robot the folder with the drawing"
        );
        return Err(FileIssue::new(Code::ValueInvalid, &urdf_file, "robot", problem).into());
    }
    let urdf = UrdfText::read(&robot.urdf_text).map_err(|message| RobotError::Syntax {
        code: Code::FileSyntax,
        file: urdf_file.clone(),
        message,
    })?;
    Ok((urdf_file, urdf))
}

/// Origins of the text's joints that a link correction moves.
pub(super) fn moved_joints(
    file: &Path,
    calibration: &Calibration,
    robot: &Robot,
    urdf: &UrdfText,
) -> Result<BTreeMap<usize, Isometry3<f64>>, FileIssue> {
    let mut changes = Changes::default();
    move_joints(file, calibration, robot, urdf, &mut changes)?;
    Ok(changes.origins.into_iter().collect())
}

/// Moves joints by their link corrections. The chain's pose of a joint includes fixed joints before it; the joint's own
/// origin takes the whole correction.
fn move_joints(
    file: &Path,
    calibration: &Calibration,
    robot: &Robot,
    urdf: &UrdfText,
    changes: &mut Changes,
) -> Result<(), FileIssue> {
    let corrections = calibration.link_corrections();
    for link in &calibration.link {
        let key = |of: &str| format!("link `{}`: {of}", link.joint);
        for value in link.shift_m {
            FileIssue::check_range(file, &key("shift_m"), value, -1.0..=1.0)?;
        }
        for value in link.turn_rad {
            FileIssue::check_range(file, &key("turn_rad"), value, -1.0..=1.0)?;
        }
        let joint = robot.chain.joints().iter().position(|joint| joint.name == link.joint);
        let in_text = urdf.joints.iter().position(|joint| joint.name == link.joint);
        let (Some(joint), Some(in_text)) = (joint, in_text) else {
            return Err(FileIssue::new(Code::NameUnknown, file, key("joint"), "is no moving joint of the arm"));
        };
        let drawn = &robot.chain.joints()[joint].parent_from_joint;
        let corrected = urdf.joints[in_text].origin * drawn.inverse() * corrections[joint].applied_to(drawn);
        changes.origins.push((in_text, corrected));
        changes.in_words.push(format!("origin of joint {}: link correction", link.joint));
    }
    Ok(())
}

/// Moves the camera's own joint, if it has one that carries nothing else; otherwise adds a link.
fn place_camera(
    file: &Path,
    calibration: &Calibration,
    robot: &Robot,
    urdf: &UrdfText,
    changes: &mut Changes,
) -> Result<(), RobotError> {
    let robot_file = robot.folder.join("robot.toml");
    let RobotToml { camera: OnLink { link }, tool } = parse_toml(&robot_file, &read_text(&robot_file)?)?;
    changes.camera_link.clone_from(&link);
    let Some(mount) = &calibration.camera_mount else { return Ok(()) };
    let estimated = link_from_camera(file, mount)?;
    // Transform from the nominal frame of `link` to the camera.
    let drawn = robot.links.get(&link).unwrap_or(&robot.camera.mount);
    let shift = drawn.link_from_frame.inverse() * estimated;
    let is_alone =
        *drawn == robot.camera.mount && tool.link != link && urdf.joints.iter().all(|joint| joint.parent != link);
    let own = urdf.joints.iter().position(|joint| joint.child == link && joint.is_fixed);
    if let Some(own) = own.filter(|_| is_alone) {
        changes.origins.push((own, urdf.joints[own].origin * shift));
        changes.in_words.push(format!("origin of joint {}: camera mount", urdf.joints[own].name));
        return Ok(());
    }
    let name = free_name("camera", |name| urdf.links.iter().any(|link| link == name));
    let joint = free_name("camera_mount", |name| urdf.joints.iter().any(|joint| joint.name == name));
    changes.added = fixed_link(&name, &joint, &link, &shift);
    changes.in_words.push(format!("link {name}, the camera's optical frame, by joint {joint} on {link}: camera mount"));
    changes.camera_link = name;
    Ok(())
}

/// Adds a link with its own name for each further camera, on the moving link that carries it.
fn add_further_cameras(
    file: &Path,
    calibration: &Calibration,
    robot: &Robot,
    urdf: &UrdfText,
    changes: &mut Changes,
) -> Result<(), FileIssue> {
    for found in &calibration.further_camera {
        let Some(camera) = robot.further_cameras.iter().find(|camera| camera.name == found.name) else { continue };
        let parent = carrier(robot, camera);
        let name = free_name(&found.name, |name| urdf.links.iter().any(|link| link == name));
        let joint = free_name(&format!("{name}_mount"), |name| urdf.joints.iter().any(|joint| joint.name == name));
        let place = further_from_camera(file, found)?;
        changes.added += &fixed_link(&name, &joint, parent, &place);
        let change = format!("link {name}, that camera's optical frame, by joint {joint} on {parent}: its mount");
        changes.in_words.push(change);
    }
    Ok(())
}

/// Name of the moving link that carries a camera, or of the base link.
pub(super) fn carrier<'a>(robot: &'a Robot, camera: &CameraSpec) -> &'a str {
    let body = camera.mount.n_joints.checked_sub(1).and_then(|joint| robot.chain.joints().get(joint));
    body.map_or(robot.base_link.as_str(), |joint| joint.child_link.as_str())
}

/// A link without a shape, and its fixed joint.
fn fixed_link(name: &str, joint: &str, parent: &str, parent_from_link: &Isometry3<f64>) -> String {
    let [name, joint, parent] = [name, joint, parent].map(|text| quick_xml::escape::escape(text).into_owned());
    format!(
        "  <link name=\"{name}\"/>\n  <joint name=\"{joint}\" type=\"fixed\">\n    <parent link=\"{parent}\"/>\
         <child link=\"{name}\"/>\n    <origin {}/>\n  </joint>\n",
        xyz_rpy(parent_from_link)
    )
}

/// `name`, or the first of `name_2`, `name_3`, .. that is free.
fn free_name(name: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let others = (2..).map(|n| format!("{name}_{n}"));
    std::iter::once(name.to_owned()).chain(others).find(|name| !is_taken(name)).unwrap_or_default()
}

/// Calibrated pose of the camera on the moving link that carries it, `link_from_camera`.
pub(super) fn link_from_camera(file: &Path, mount: &CameraMount) -> Result<Isometry3<f64>, FileIssue> {
    place(file, "camera_mount", mount.position_m, mount.quaternion_wxyz)
}

/// Calibrated pose of a further camera on the moving link that carries it.
pub(super) fn further_from_camera(file: &Path, found: &FurtherCamera) -> Result<Isometry3<f64>, FileIssue> {
    place(file, "further_camera", found.position_m, found.quaternion_wxyz)
}

fn place(file: &Path, table: &str, position_m: [f64; 3], [w, x, y, z]: [f64; 4]) -> Result<Isometry3<f64>, FileIssue> {
    for value in position_m {
        FileIssue::check_range(file, &format!("{table}.position_m"), value, -10.0..=10.0)?;
    }
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6).filter(|turn| turn.norm().is_finite());
    let key = format!("{table}.quaternion_wxyz");
    let rotation = rotation
        .ok_or_else(|| FileIssue::new(Code::ValueInvalid, file, key, "is no rotation; its length must not be 0"))?;
    Ok(Isometry3::from_parts(Translation3::from(Vector3::from(position_m)), rotation))
}

pub(super) fn left_out(calibration: &Calibration) -> Vec<String> {
    let sag = calibration.sag.iter().map(|_| "how the arm bends under its weight ([sag])".to_owned());
    let failed = calibration.failed_joint.iter().map(|failed| format!("the failed joint {}", failed.joint));
    sag.chain(failed).collect()
}

fn comment(calibration: &Calibration, changes: &Changes, left_out: &[String]) -> String {
    let Calibration { robot, messages_hash, .. } = calibration;
    let mut text = format!("  {MARK}: robot {robot}, messages_hash {messages_hash}.\n\n{CONVENTION}\n");
    if changes.in_words.is_empty() {
        text += "  Written in: nothing; the calibration has neither link corrections nor a camera mount.\n";
    }
    for change in &changes.in_words {
        text += &format!("  Written in: {change}.\n");
    }
    for what in left_out {
        text += &format!("  Left out, for a URDF cannot hold it: {what}.\n");
    }
    format!("<!--\n{}-->", comment_text(&text))
}
