//! The file robot.toml and its checks.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;

use super::allowed_pairs::AllowedPairs;
use super::body::LinkBody;
use super::camera::{CameraFile, check_camera};
use super::drive::{DriveSpec, HydraulicsFile, MotionSpec, check_displacements};
use super::error::{FileIssue, RobotError, parse_toml, read_in};
use super::geometry::GeometryPriors;
use super::gripper::GripperFile;
use super::gripper_tag::GripperTagFile;
use super::joint_sensor::{SensorFile, check_sensors};
use super::nominal::{Robot, ToolSpec, check_stowed};
use super::self_collision;
use super::shape::{PlacedShape, Shape};
use super::survey::{TagFile, check_tags};
use super::urdf::{UrdfChain, UrdfModel};
use crate::kinematics::{ArmLoads, Attachment};
use crate::spatial::{Base, Pose};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    version: u32,
    name: String,
    urdf: PathBuf,
    base_link: String,
    base_tag: u32,
    stowed_rad: Vec<f64>,
    #[serde(default)]
    allowed_pairs: Vec<[String; 2]>,
    #[serde(default = "default_buoyancy_fraction")]
    buoyancy_fraction: f64,
    tool: ToolFile,
    gripper: Option<GripperFile>,
    gripper_tag: Option<GripperTagFile>,
    joint_sensor: Vec<SensorFile>,
    hydraulics: Option<HydraulicsFile>,
    #[serde(default)]
    motion: MotionSpec,
    #[serde(default)]
    geometry: GeometryPriors,
    camera: CameraFile,
    #[serde(default)]
    tag: Vec<TagFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolFile {
    link: String,
    point_m: [f64; 3],
    tip_radius_m: Option<f64>,
}

impl ToolFile {
    fn check_point(&self, file: &Path) -> Result<(), FileIssue> {
        self.point_m
            .iter()
            .try_for_each(|value| FileIssue::check_range(file, "tool.point_m", *value, -10.0..=10.0).map(drop))
    }
}

const TIP_RGB: [u8; 3] = [200, 205, 215];

/// Of a Titan: 100 kg in air, 78 kg in sea water.
fn default_buoyancy_fraction() -> f64 {
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

/// Reads a robot folder without its self_collision.toml, which may belong to another URDF.
///
/// # Errors
/// [`RobotError`] naming file, key and allowed range.
pub fn load_without_pairs(folder: &Path) -> Result<Robot, RobotError> {
    let file = folder.join("robot.toml");
    let raw: RobotFile = parse_toml(&file, &read_in(folder, &file)?)?;
    FileIssue::check_range(&file, "version", f64::from(raw.version), 1.0..=1.0)?;
    let urdf = read_urdf(folder, &raw.urdf)?;
    let chain = urdf.chain(&raw.base_link, &[&raw.tool.link, &raw.camera.link])?;
    let jaws = raw.gripper.as_ref().map(GripperFile::jaws).unwrap_or_default();
    let arm = UrdfChain { urdf: &urdf, base_link: &raw.base_link, chain: &chain };
    let mut bodies = arm.bodies(jaws)?;
    let allowed_pairs = AllowedPairs::check(&file, raw.allowed_pairs, &bodies)?;
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
    let mut tool = arm.attachment(&raw.tool.link)?;
    raw.tool.check_point(&file)?;
    let gripper = raw.gripper.map(|gripper| gripper.check(&file, &arm, &tool)).transpose()?;
    tool.link_from_frame *= nalgebra::Translation3::from(raw.tool.point_m);
    if let Some(radius_m) = raw.tool.tip_radius_m {
        FileIssue::check_range(&file, "tool.tip_radius_m", radius_m, 0.002..=0.2)?;
        add_tip(&mut bodies[tool.n_joints], tool.link_from_frame, radius_m);
    }
    let camera_mount = arm.attachment(&raw.camera.link)?;
    let camera = check_camera(&file, raw.camera, camera_mount)?;
    let tags = check_tags(&file, &raw.tag, raw.base_tag, &Pose::<Base, Base>::identity())?;
    let gripper_tag = raw.gripper_tag.map(|tag| tag.check(&file, &arm, &camera.mount)).transpose()?;
    if let Some(tag) = &gripper_tag {
        tag.check_id(&file, &tags)?;
    }
    let geometry = raw.geometry.check(&file)?;
    let buoyancy_fraction = FileIssue::check_range(&file, "buoyancy_fraction", raw.buoyancy_fraction, 0.0..=0.95)?;
    Ok(Robot {
        failed: Vec::new(),
        name: raw.name,
        folder: folder.to_owned(),
        urdf_name: raw.urdf.file_name().map_or_else(|| "robot.urdf".to_owned(), |n| n.to_string_lossy().into_owned()),
        urdf_text: urdf.text,
        base_link: raw.base_link,
        stowed,
        buoyancy_fraction,
        tool: ToolSpec { mount: tool, tip_radius_m: raw.tool.tip_radius_m },
        gripper,
        gripper_tag,
        base_tag: raw.base_tag,
        chain: chain.with_loads(loads(&geometry, &bodies, buoyancy_fraction, tool)),
        bodies,
        self_pairs: None,
        allowed_pairs,
        sensors,
        drive,
        geometry,
        camera,
        tags,
    })
}

fn loads(geometry: &GeometryPriors, bodies: &[LinkBody], buoyancy_fraction: f64, tool: Attachment) -> ArmLoads {
    let mut loads = ArmLoads { up: Vector3::from(geometry.up).normalize(), tool, ..ArmLoads::default() };
    for (load, body) in loads.links.iter_mut().zip(bodies) {
        *load = body.load(buoyancy_fraction);
    }
    loads
}

/// The ball about the tool point, the last of its link's shapes.
fn add_tip(body: &mut LinkBody, owner_from_shape: Isometry3<f64>, radius_m: f64) {
    let tip = PlacedShape { owner_from_shape, shape: Shape::Sphere { radius_m }, color_rgb: TIP_RGB };
    body.visuals.push(tip.clone());
    body.collisions.push(tip);
}

/// The URDF that robot.toml names, or else a file of that name beside robot.toml, as in the attachments of a recording.
fn read_urdf(folder: &Path, urdf: &Path) -> Result<UrdfModel, RobotError> {
    let named = folder.join(urdf);
    let beside = urdf.file_name().map(|name| folder.join(name));
    let file = match beside {
        Some(beside) if !named.is_file() && beside.is_file() => beside,
        _ => named,
    };
    UrdfModel::parse(&file, read_in(folder, &file)?)
}
