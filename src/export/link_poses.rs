//! Link poses in manufacturers' files: kinematics.yaml of Universal Robots and of Franka, read and written.
//!
//! A pose is the `origin` of a joint: m, and roll, pitch, yaw in rad about fixed axes, as in URDF. Sources:
//! UniversalRobots/Universal_Robots_ROS2_Description 2221ec0, urdf/inc/ur_common.xacro, lines 93 to 133 and 236, used
//! in urdf/ur_macro.xacro, lines 277 to 337. For Franka, frankaemika/franka_description b299b39,
//! robots/common/utils.xacro, lines 263 to 266. `ur_calibration`, which writes such files, has the angles in another
//! order (Universal_Robots_ROS2_Driver 696e1a7, ur_calibration/src/calibration.cpp, line 230). Its files are read as
//! the URDF reads them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use crate::export::urdf::{left_out, moved_joints, read_urdf};
use crate::export::urdf_text::{UrdfText, comment_text, roll_pitch_yaw};
use crate::export::yaml_text::double;
use armcal_belief::calib::Calibration;
use armcal_core::codes::Code;
use armcal_core::robot::{FileIssue, Robot, RobotError, syntax_code};
use armcal_core::text::yaml_problem;

/// Largest allowed coordinate, m; `MAX_RAD` is that of angles, rad.
const MAX_M: f64 = 10.0;
const MAX_RAD: f64 = 7.0;
/// Largest distance from the URDF's own pose, m; `NEAR_RAD` is that of angles. A pose beyond it is another arm's.
/// Assumed: links are made to 1 mm.
const NEAR_M: f64 = 0.05;
const NEAR_RAD: f64 = 0.3;

/// Maker of a file's arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkPoseForm {
    /// `kinematics: shoulder: {x, y, z, roll, pitch, yaw}` to `wrist_3`, and a hash.
    Ur,
    /// `joint1: kinematic: {x, y, z, roll, pitch, yaw}` to `joint8`, the flange.
    Franka,
}

impl LinkPoseForm {
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Ur => &["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"],
            Self::Franka => &["joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "joint7", "joint8"],
        }
    }

    /// Path of a key in the file.
    fn place(self, key: &str) -> String {
        match self {
            Self::Ur => format!("kinematics.{key}"),
            Self::Franka => format!("{key}.kinematic"),
        }
    }

    /// Index of the URDF's joint for `key`: UR names the child link, Franka the joint, both after a prefix.
    fn joint(self, urdf_file: &Path, urdf: &UrdfText, key: &str) -> Result<usize, FileIssue> {
        let (what, tail) = match self {
            Self::Ur => ("joint to a link", format!("{key}_link")),
            Self::Franka => ("joint", key.to_owned()),
        };
        let is_it =
            |name: &str| name.strip_suffix(tail.as_str()).is_some_and(|rest| rest.is_empty() || rest.ends_with('_'));
        let names = urdf.joints.iter().map(|joint| if self == Self::Ur { &joint.child } else { &joint.name });
        let found: Vec<usize> = names.enumerate().filter(|(_, name)| is_it(name)).map(|(at, _)| at).collect();
        let problem = match found[..] {
            [at] => return Ok(at),
            [] => format!("the URDF has no {what} `{tail}`, with or without a prefix; give the URDF of this arm"),
            _ => format!("the URDF has {} of {what} `{tail}`; give one with a single arm", found.len()),
        };
        Err(FileIssue::new(Code::NameUnknown, urdf_file, key, problem))
    }
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseYaml {
    x: f64,
    y: f64,
    z: f64,
    roll: f64,
    pitch: f64,
    yaw: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UrYaml {
    kinematics: UrLinks,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct UrLinks {
    shoulder: PoseYaml,
    upper_arm: PoseYaml,
    forearm: PoseYaml,
    wrist_1: PoseYaml,
    wrist_2: PoseYaml,
    wrist_3: PoseYaml,
    #[serde(rename = "hash")]
    _hash: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FrankaJoints {
    joint1: FrankaJoint,
    joint2: FrankaJoint,
    joint3: FrankaJoint,
    joint4: FrankaJoint,
    joint5: FrankaJoint,
    joint6: FrankaJoint,
    joint7: FrankaJoint,
    joint8: Option<FrankaJoint>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct FrankaJoint {
    kinematic: PoseYaml,
}

/// Link poses from a file, in the order of its form's keys.
#[derive(Debug, PartialEq)]
pub struct LinkPoses {
    /// Maker of the file's arm.
    pub form: LinkPoseForm,
    poses: Vec<Isometry3<f64>>,
}

/// Reads the text of a kinematics.yaml; `file` names it in errors.
///
/// # Errors
/// [`RobotError`] naming file, key and allowed range.
pub fn parse_link_poses(file: &Path, text: &str) -> Result<LinkPoses, RobotError> {
    let keys: BTreeMap<String, IgnoredAny> = yaml(file, text)?;
    let (form, raw) = if keys.contains_key("kinematics") {
        let UrLinks { shoulder, upper_arm, forearm, wrist_1, wrist_2, wrist_3, .. } =
            yaml::<UrYaml>(file, text)?.kinematics;
        (LinkPoseForm::Ur, vec![shoulder, upper_arm, forearm, wrist_1, wrist_2, wrist_3])
    } else if keys.contains_key("joint1") {
        let all: FrankaJoints = yaml(file, text)?;
        let moving = [all.joint1, all.joint2, all.joint3, all.joint4, all.joint5, all.joint6, all.joint7];
        (LinkPoseForm::Franka, moving.into_iter().chain(all.joint8).map(|joint| joint.kinematic).collect())
    } else {
        let found: Vec<&String> = keys.keys().take(12).collect();
        let problem = format!(
            "is missing; a file of Universal Robots has `kinematics`, one of Franka `joint1` to `joint7`, this one \
             {found:?}"
        );
        return Err(FileIssue::new(Code::KeyMissing, file, "kinematics", problem).into());
    };
    let pose = |(key, raw): (&&str, PoseYaml)| pose(file, &form.place(key), raw);
    let poses = form.keys().iter().zip(raw).map(pose).collect::<Result<_, _>>()?;
    Ok(LinkPoses { form, poses })
}

fn yaml<T: DeserializeOwned>(file: &Path, text: &str) -> Result<T, RobotError> {
    serde_saphyr::from_str(text).map_err(|error| {
        let message = yaml_problem(&error.to_string());
        RobotError::Syntax { code: syntax_code(&message), file: file.to_owned(), message }
    })
}

fn pose(file: &Path, place: &str, raw: PoseYaml) -> Result<Isometry3<f64>, FileIssue> {
    let check =
        |key: &str, value, most: f64| FileIssue::check_range(file, &format!("{place}.{key}"), value, -most..=most);
    let position = Vector3::new(check("x", raw.x, MAX_M)?, check("y", raw.y, MAX_M)?, check("z", raw.z, MAX_M)?);
    let (roll, pitch, yaw) =
        (check("roll", raw.roll, MAX_RAD)?, check("pitch", raw.pitch, MAX_RAD)?, check("yaw", raw.yaw, MAX_RAD)?);
    Ok(Isometry3::from_parts(Translation3::from(position), UnitQuaternion::from_euler_angles(roll, pitch, yaw)))
}

impl LinkPoses {
    /// The text of a URDF with these poses as its joints' origins; `file` is the poses' file, for messages.
    ///
    /// # Errors
    /// [`RobotError`] where the URDF lacks a joint, or its pose differs so much that the file is another arm's.
    pub fn written_into(&self, file: &Path, (urdf_file, urdf): (&Path, &str)) -> Result<String, RobotError> {
        let urdf = UrdfText::read(urdf).map_err(|message| RobotError::Syntax {
            code: Code::FileSyntax,
            file: urdf_file.to_owned(),
            message,
        })?;
        let mut origins = Vec::new();
        for (key, pose) in self.form.keys().iter().zip(&self.poses) {
            let at = self.form.joint(urdf_file, &urdf, key)?;
            let off = urdf.joints[at].origin.inverse() * pose;
            let (off_m, off_rad) = (off.translation.vector.norm(), off.rotation.angle());
            if off_m > NEAR_M || off_rad > NEAR_RAD {
                let problem = format!(
                    "is {off_m:.3} m and {off_rad:.3} rad from joint {} of the URDF; at most {NEAR_M} m and {NEAR_RAD} \
                     rad are allowed. Give the file and the URDF of one arm",
                    urdf.joints[at].name
                );
                return Err(FileIssue::new(Code::ValueInvalid, file, self.form.place(key), problem).into());
            }
            origins.push((at, *pose));
        }
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let comment = format!("<!-- Link poses written in by armcal: those of {name}. -->", name = comment_text(&name));
        Ok(urdf.edited(&origins, &comment, ""))
    }
}

/// Calibrated link poses in a manufacturer's form, and the parts of the calibration that it cannot hold.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibratedLinkPoses {
    /// Text of the file.
    pub text: String,
    /// Parts of the calibration that the file does not hold, in words.
    pub left_out: Vec<String>,
}

/// The link poses of `robot` with the corrections of `calibration`; `file` is the calibration's file, for messages.
///
/// # Errors
/// [`RobotError`] naming file and key: a URDF that lacks a joint of the form, or is an exported one.
pub fn calibrated_link_poses(
    file: &Path,
    calibration: &Calibration,
    robot: &Robot,
    form: LinkPoseForm,
) -> Result<CalibratedLinkPoses, RobotError> {
    let (urdf_file, urdf) = read_urdf(robot)?;
    let mut moved = moved_joints(file, calibration, robot, &urdf)?;
    let mut text = head(calibration);
    if form == LinkPoseForm::Ur {
        text += "kinematics:\n";
    }
    for key in form.keys() {
        let at = form.joint(&urdf_file, &urdf, key)?;
        let pose = moved.remove(&at).unwrap_or(urdf.joints[at].origin);
        let inner = if form == LinkPoseForm::Franka { "  kinematic:\n" } else { "" };
        let indent = if form == LinkPoseForm::Ur { "  " } else { "" };
        let _ = write!(text, "{indent}{key}:\n{inner}");
        let [x, y, z] = <[f64; 3]>::from(pose.translation.vector);
        let [roll, pitch, yaw] = roll_pitch_yaw(&pose.rotation);
        for (name, value) in [("x", x), ("y", y), ("z", z), ("roll", roll), ("pitch", pitch), ("yaw", yaw)] {
            let _ = writeln!(text, "    {name}: {}", double(value + 0.0));
        }
    }
    if form == LinkPoseForm::Ur {
        text += "  hash: calib_armcal # the robot's own: the driver compares it, and names a difference\n";
    }
    let others = moved.keys().map(|at| format!("the correction of joint {}", urdf.joints[*at].name));
    let mount = calibration.camera_mount.iter().map(|_| "the camera's mount".to_owned());
    let further = calibration.further_camera.iter().map(|camera| format!("the mount of camera {}", camera.name));
    let left_out = others.chain(mount).chain(further).chain(left_out(calibration)).collect();
    Ok(CalibratedLinkPoses { text, left_out })
}

fn head(calibration: &Calibration) -> String {
    let Calibration { messages_hash, .. } = calibration;
    format!(
        "# Link poses calibrated by armcal, messages_hash {messages_hash}. Joint angles are calibrated angles:\n\
         # gain and offset of the joint sensors are not in this file. Apply them once, where readings become angles.\n"
    )
}
