//! robot.toml to checked types.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix6};
use serde::Deserialize;

use super::camera::{CameraFile, check_camera};
use super::drive::{DriveSpec, HydraulicsFile, MotionSpec, check_displacements};
use super::error::{FileIssue, RobotError, parse_toml, read_text};
use super::failed::FailedJoint;
use super::gripper::{GripperFile, GripperSpec};
use super::gripper_tag::{GripperTag, GripperTagFile};
use super::self_collision::{self, SelfPairs};
use super::survey::{SurveyedTag, TagFile, TagSurvey, check_tags};
use super::urdf::{LinkBody, UrdfModel};
use super::vehicle::Vehicle;
use crate::joints::JointAngles;
use crate::kinematics::{Attachment, Chain};
use crate::optics::Fisheye;
use crate::spatial::{Base, Pose};

/// An arm as drawn and surveyed.
#[derive(Clone, Debug)]
pub struct Robot {
    pub name: String,
    pub folder: PathBuf,
    pub urdf_name: String,
    pub urdf_text: String,
    pub base_link: String,
    pub chain: Chain,
    /// Bodies 0..=n_joints: base first.
    pub bodies: Vec<LinkBody>,
    /// Links that can come near each other, where the folder says so.
    pub self_pairs: Option<SelfPairs>,
    pub sensors: Vec<JointSensorSpec>,
    pub drive: DriveSpec,
    pub tool: ToolSpec,
    /// Where the tool is a gripper that opens and closes.
    pub gripper: Option<GripperSpec>,
    /// Where one is glued behind the camera.
    pub gripper_tag: Option<GripperTag>,
    pub camera: CameraSpec,
    pub tags: Vec<SurveyedTag>,
    pub base_tag: u32,
    pub stowed: JointAngles,
    /// Weight of the displaced sea water over the arm's own weight.
    pub buoyancy_fraction: f64,
    /// Joints that are declared to have failed; no robot folder says it.
    pub failed: Vec<FailedJoint>,
}

/// Kind of joint sensor; decides which effects belief expects of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    Potentiometer,
    Encoder,
    Resolver,
}

/// A joint sensor by its datasheet: `angle = center + wrap(counts - counts(center)) / counts_per_rad`.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSensorSpec {
    pub joint: String,
    pub kind: SensorKind,
    /// The reading at angle zero.
    pub offset_counts: f64,
    pub counts_per_rad: f64,
    pub wrap_counts: f64,
    /// The middle of the joint's range: gain errors are meant about it.
    pub center_rad: f64,
    /// Half of the joint's range; of a joint without limits half a turn.
    pub half_range_rad: f64,
    /// One sigma of the relative gain error.
    pub gain_std: f64,
    pub offset_std_rad: f64,
    /// The worst that planning keeps clear for.
    pub gain_bound: f64,
    pub offset_bound_rad: f64,
    pub noise_std_counts: f64,
    /// One sigma of what a straight line leaves of the sensor's error: nonlinearity, temperature, wear.
    pub linearity_std_rad: f64,
    /// One sigma of what the offset changes by with the oil's temperature.
    pub temperature_std_rad_per_k: f64,
    /// One sigma of what the offset walks away by in an hour; it grows with the root of time.
    pub drift_std_rad_per_sqrt_h: f64,
    pub max_rate_rad_s: f64,
}

impl JointSensorSpec {
    /// The same sensor with `ratio` times as many counts per radian; the reading in the middle of the range stays.
    #[must_use]
    pub fn with_scale(&self, ratio: f64) -> Self {
        let counts_per_rad = ratio * self.counts_per_rad;
        let offset_counts = self.offset_counts + (self.counts_per_rad - counts_per_rad) * self.center_rad;
        Self { counts_per_rad, offset_counts, ..self.clone() }
    }
}

#[derive(Clone, Debug)]
pub struct ToolSpec {
    /// The tool point, axes of the link that carries it.
    pub mount: Attachment,
}

#[derive(Clone, Debug)]
pub struct CameraSpec {
    pub name: String,
    pub mount: Attachment,
    pub lens: Fisheye,
    pub corner_std_px: f64,
    /// One sigma per axis of the mount's error.
    pub mount_std_m: f64,
    pub mount_std_rad: f64,
}

impl Robot {
    #[must_use]
    pub fn n_joints(&self) -> usize {
        self.chain.n_joints()
    }

    #[must_use]
    pub fn tag(&self, id: u32) -> Option<&SurveyedTag> {
        self.tags.iter().find(|tag| tag.id == id)
    }

    #[must_use]
    pub fn joint_names(&self) -> Vec<String> {
        self.sensors.iter().map(|s| s.joint.clone()).collect()
    }

    /// The same arm with the tags of `survey`.
    #[must_use]
    pub fn with_survey(mut self, survey: TagSurvey) -> Self {
        self.tags = survey.tags;
        self.base_tag = survey.base_tag;
        self
    }

    /// The arm on `vehicle`: with the vehicle's tags and the angles that it stows this arm at, where it has any.
    ///
    /// # Errors
    /// [`RobotError`] naming the vehicle's file when it stows another number of joints.
    pub fn mounted_on(mut self, vehicle: &Vehicle) -> Result<Self, RobotError> {
        if let Some(stowed_rad) = vehicle.stowed_rad.get(&self.name) {
            let key = format!("stowed_rad.{}", self.name);
            self.stowed = check_stowed(&vehicle.file, &key, stowed_rad, self.n_joints())?;
        }
        let Some(survey) = &vehicle.survey else { return Ok(self) };
        if let Some(tag) = &self.gripper_tag {
            tag.check_id(&vehicle.file, &survey.tags)?;
        }
        Ok(self.with_survey(survey.clone()))
    }

    /// The same arm with sensors `scale` times as far from a straight line.
    #[must_use]
    pub fn with_linearity(mut self, scale: f64) -> Self {
        for sensor in &mut self.sensors {
            sensor.linearity_std_rad *= scale;
        }
        self
    }

    /// The same arm with its camera where it was found to hang, with the covariance of that (translation m, rotation rad).
    #[must_use]
    pub fn with_camera_at(mut self, link_from_camera: Isometry3<f64>, covariance: &Matrix6<f64>) -> Self {
        let rms = |from: usize| ((0..3).map(|k| covariance[(from + k, from + k)]).sum::<f64>() / 3.0).max(0.0).sqrt();
        self.camera.mount.link_from_frame = link_from_camera;
        (self.camera.mount_std_m, self.camera.mount_std_rad) = (rms(0), rms(3));
        self
    }

    /// The tags around the arm.
    #[must_use]
    pub fn survey(&self) -> TagSurvey {
        TagSurvey { base_tag: self.base_tag, tags: self.tags.clone() }
    }

    /// Whether the arm can be simulated: each moving body has mass.
    ///
    /// # Errors
    /// [`RobotError::ZeroMass`] naming the first link without.
    pub fn require_masses(&self) -> Result<(), RobotError> {
        match self.bodies[1..].iter().find(|body| body.mass_kg <= 0.0) {
            None => Ok(()),
            Some(body) => Err(RobotError::ZeroMass {
                file: self.folder.join(&self.urdf_name),
                link: body.name.clone(),
                mass_kg: body.mass_kg,
            }),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    version: u32,
    name: String,
    urdf: PathBuf,
    base_link: String,
    base_tag: u32,
    stowed_rad: Vec<f64>,
    /// A Titan's, where the file says nothing: 100 kg in air, 78 kg in sea water.
    #[serde(default = "usual_buoyancy")]
    buoyancy_fraction: f64,
    tool: ToolFile,
    gripper: Option<GripperFile>,
    gripper_tag: Option<GripperTagFile>,
    joint_sensor: Vec<SensorFile>,
    hydraulics: Option<HydraulicsFile>,
    #[serde(default)]
    motion: MotionSpec,
    camera: CameraFile,
    #[serde(default)]
    tag: Vec<TagFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolFile {
    link: String,
    point_m: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorFile {
    joint: String,
    kind: SensorKind,
    offset_counts: f64,
    /// Counts per degree: sources state this round figure, and dividing keeps it exact.
    scale_counts_per_deg: f64,
    wrap_counts: f64,
    gain_std: f64,
    offset_std_rad: f64,
    gain_bound: f64,
    offset_bound_rad: f64,
    noise_std_counts: f64,
    linearity_std_rad: f64,
    #[serde(default = "usual_change")]
    temperature_std_rad_per_k: f64,
    #[serde(default = "usual_change")]
    drift_std_rad_per_sqrt_h: f64,
    max_rate_rad_s: f64,
    /// By the URDF's effort where the file says nothing.
    displacement_l_per_rad: Option<f64>,
}

/// 0.02 deg a kelvin and 0.02 deg in an hour, for datasheets that say nothing.
fn usual_change() -> f64 {
    0.00035
}

fn usual_buoyancy() -> f64 {
    0.22
}

/// Reads a robot folder: robot.toml and the URDF that it names.
///
/// # Errors
/// [`RobotError`] naming file, key and allowed range.
pub fn load(folder: &Path) -> Result<Robot, RobotError> {
    let robot = load_without_pairs(folder)?;
    let self_pairs = self_collision::read(folder, &robot.urdf_text, &robot.bodies)?;
    Ok(Robot { self_pairs, ..robot })
}

/// The same without its self_collision.toml, which may be of another URDF.
///
/// # Errors
/// [`RobotError`] naming file, key and allowed range.
pub fn load_without_pairs(folder: &Path) -> Result<Robot, RobotError> {
    let file = folder.join("robot.toml");
    let raw: RobotFile = parse_toml(&file, &read_text(&file)?)?;
    FileIssue::check_range(&file, "version", f64::from(raw.version), 1.0..=1.0)?;
    let urdf = UrdfModel::read(&drawing_file(folder, &raw.urdf))?;
    let chain = urdf.chain(&raw.base_link, &[&raw.tool.link, &raw.camera.link])?;
    let jaws = raw.gripper.as_ref().map(GripperFile::jaws).unwrap_or_default();
    let bodies = urdf.bodies(&raw.base_link, &chain, jaws)?;
    let sensors = check_sensors(&file, &raw.joint_sensor, &chain)?;
    let drive = DriveSpec {
        pump_l_per_min: raw.hydraulics.map(|hydraulics| hydraulics.check(&file)).transpose()?,
        displacement_l_per_rad: check_displacements(
            &file,
            raw.joint_sensor.iter().map(|sensor| (sensor.joint.as_str(), sensor.displacement_l_per_rad)),
            &urdf,
        )?,
        motion: raw.motion.check(&file)?,
    };
    let stowed = check_stowed(&file, "stowed_rad", &raw.stowed_rad, chain.n_joints())?;
    let mut tool = urdf.attachment(&raw.base_link, &raw.tool.link, &chain)?;
    for value in raw.tool.point_m {
        FileIssue::check_range(&file, "tool.point_m", value, -10.0..=10.0)?;
    }
    let gripper = raw.gripper.map(|gripper| gripper.check(&file, &urdf, &raw.base_link, &chain, &tool)).transpose()?;
    tool.link_from_frame *= nalgebra::Translation3::from(raw.tool.point_m);
    let camera_mount = urdf.attachment(&raw.base_link, &raw.camera.link, &chain)?;
    let camera = check_camera(&file, raw.camera, camera_mount)?;
    let tags = check_tags(&file, &raw.tag, raw.base_tag, &Pose::<Base, Base>::identity())?;
    let gripper_tag =
        raw.gripper_tag.map(|tag| tag.check(&file, &urdf, &raw.base_link, &chain, &camera.mount)).transpose()?;
    if let Some(tag) = &gripper_tag {
        tag.check_id(&file, &tags)?;
    }
    Ok(Robot {
        failed: Vec::new(),
        name: raw.name,
        folder: folder.to_owned(),
        urdf_name: raw.urdf.file_name().map_or_else(|| "robot.urdf".to_owned(), |n| n.to_string_lossy().into_owned()),
        urdf_text: urdf.text,
        base_link: raw.base_link,
        stowed,
        buoyancy_fraction: FileIssue::check_range(&file, "buoyancy_fraction", raw.buoyancy_fraction, 0.0..=0.95)?,
        tool: ToolSpec { mount: tool },
        gripper,
        gripper_tag,
        base_tag: raw.base_tag,
        chain,
        bodies,
        self_pairs: None,
        sensors,
        drive,
        camera,
        tags,
    })
}

/// Where robot.toml says that the URDF is; beside it where it is not there, for a recording carries the two side by side.
fn drawing_file(folder: &Path, urdf: &Path) -> PathBuf {
    let named = folder.join(urdf);
    let beside = urdf.file_name().map(|name| folder.join(name));
    match beside {
        Some(beside) if !named.is_file() && beside.is_file() => beside,
        _ => named,
    }
}

fn check_stowed(file: &Path, key: &str, angles_rad: &[f64], n_joints: usize) -> Result<JointAngles, RobotError> {
    if angles_rad.len() != n_joints || !angles_rad.iter().all(|v| v.abs() <= 100.0) {
        let problem = format!("needs {n_joints} angles within 100 rad, one a joint");
        return Err(FileIssue::new(file, key, problem).into());
    }
    Ok(JointAngles::from_slice(angles_rad))
}

fn check_sensors(file: &Path, raw: &[SensorFile], chain: &Chain) -> Result<Vec<JointSensorSpec>, RobotError> {
    let names: Vec<&str> = raw.iter().map(|s| s.joint.as_str()).collect();
    let expected: Vec<&str> = chain.joints().iter().map(|j| j.name.as_str()).collect();
    if names != expected {
        let problem =
            format!("the URDF's moving joints are {expected:?}, in this order, but the sensors name {names:?}");
        return Err(FileIssue::new(file, "joint_sensor", problem).into());
    }
    raw.iter()
        .zip(chain.joints())
        .map(|(s, joint)| {
            let check = |key: &str, value: f64, range| {
                FileIssue::check_range(file, &format!("joint_sensor `{}`: {key}", s.joint), value, range)
            };
            if let Some(limits) = joint.limits {
                let range_counts = (limits.upper_rad - limits.lower_rad).to_degrees() * s.scale_counts_per_deg.abs();
                if s.wrap_counts < range_counts {
                    let key = format!("joint_sensor `{}`: wrap_counts", s.joint);
                    let problem =
                        format!("{} is less than the {range_counts:.0} counts of the joint's range", s.wrap_counts);
                    return Err(FileIssue::new(file, key, problem).into());
                }
            }
            let sign = if s.scale_counts_per_deg < 0.0 { -1.0 } else { 1.0 };
            Ok(JointSensorSpec {
                joint: s.joint.clone(),
                kind: s.kind,
                offset_counts: check("offset_counts", s.offset_counts, -1e9..=1e9)?,
                counts_per_rad: sign
                    * check("scale_counts_per_deg (size)", s.scale_counts_per_deg.abs(), 1e-3..=1e9)?
                    * 180.0
                    / std::f64::consts::PI,
                wrap_counts: check("wrap_counts", s.wrap_counts, 1.0..=1e12)?,
                center_rad: joint.limits.map_or(0.0, |l| 0.5 * (l.lower_rad + l.upper_rad)),
                half_range_rad: joint
                    .limits
                    .map_or(std::f64::consts::PI, |l| 0.5 * (l.upper_rad - l.lower_rad).max(f64::MIN_POSITIVE)),
                gain_std: check("gain_std", s.gain_std, 0.0..=10.0)?,
                offset_std_rad: check("offset_std_rad", s.offset_std_rad, 0.0..=6.3)?,
                gain_bound: check("gain_bound", s.gain_bound, 0.0..=0.5)?,
                offset_bound_rad: check("offset_bound_rad", s.offset_bound_rad, 0.0..=3.2)?,
                linearity_std_rad: check("linearity_std_rad", s.linearity_std_rad, 0.0..=1.0)?,
                temperature_std_rad_per_k: check("temperature_std_rad_per_k", s.temperature_std_rad_per_k, 0.0..=0.1)?,
                drift_std_rad_per_sqrt_h: check("drift_std_rad_per_sqrt_h", s.drift_std_rad_per_sqrt_h, 0.0..=0.1)?,
                noise_std_counts: check("noise_std_counts", s.noise_std_counts, 0.0..=1e6)?,
                max_rate_rad_s: check("max_rate_rad_s", s.max_rate_rad_s, 1e-3..=20.0)?,
            })
        })
        .collect()
}
