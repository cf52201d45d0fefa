//! The file robot.toml and its checks.

use crate::codes::Code;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::allowed_pairs::AllowedPairs;
use super::body::LinkBody;
use super::camera::{CameraFile, CameraSpec, CameraTable, check_camera, check_further_cameras};
use super::completeness::check_complete;
use super::drive::{DriveSpec, HydraulicsFile, MotionSpec, usual_displacement};
use super::error::{FileIssue, RobotError, parse_toml, read_in};
use super::geometry::{GeometryPriors, GeometryTable};
use super::gripper::GripperFile;
use super::gripper_tag::{GripperTag, GripperTagFile};
use super::joint_sensor::{JointSensorSpec, SensorFile, check_sensors, displacements};
use super::nominal::{BASE_TAG, Robot, STOWED, TAG_LINK, ToolSpec, check_stowed, lens_issue};
use super::self_collision::{self, Stored};
use super::shape::{PlacedShape, Shape};
use super::survey::{SurveyedTag, TagFile, check_tags};
use super::urdf::{UrdfChain, UrdfModel, notes as urdf_notes};
use super::urdf_mesh::{CollisionMeshes, MeshFolders};
use crate::document::check_head;

use crate::joints::JointAngles;
use crate::kind::Kind;
use crate::kinematics::{ArmLoads, Attachment, JointKind};
use crate::optics::TagFamily;
use crate::schema::schema_of;
use crate::spatial::{Base, Pose};

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    #[serde(rename = "version")]
    _version: u32,
    #[serde(rename = "kind")]
    _kind: Option<Kind>,
    /// Name of the arm, for reports and exports.
    name: String,
    /// Serial number; the report has it.
    serial: Option<String>,
    /// Path of the URDF, relative to the folder of this file.
    urdf: PathBuf,
    /// Link of the URDF that is the base frame.
    base_link: String,
    /// Id of the tag next to the base; `run` and `plan` need it, here or from the vehicle.
    base_tag: Option<u32>,
    /// Link that carries the tags, for a stationary camera; the tags' poses are then in its frame.
    tag_link: Option<String>,
    /// Joint angles from which a run starts, base first; `run` and `plan` need them, here or from the vehicle.
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    stowed_rad: Option<Vec<f64>>,
    /// Collision meshes of the URDF; `run` and `plan` refuse an arm whose meshes are ignored.
    #[serde(default)]
    collision_meshes: CollisionMeshes,
    /// Pairs of links, or of a link and a part of the vehicle, that touch by design: no clearance is kept between them.
    #[serde(default)]
    allowed_pairs: Vec<[String; 2]>,
    /// Weight of the displaced sea water over that of the arm.
    #[serde(default = "default_buoyancy_fraction")]
    #[schemars(range(min = 0.0, max = 0.95))]
    buoyancy_fraction: f64,
    /// Tool point.
    tool: ToolFile,
    /// Jaws of the gripper.
    gripper: Option<GripperFile>,
    /// Tag behind the last joint that the wrist camera sees.
    gripper_tag: Option<GripperTagFile>,
    /// Joint sensors, one for each moving joint, in the order of the chain.
    joint_sensor: Vec<SensorFile>,
    /// Oil supply.
    hydraulics: Option<HydraulicsFile>,
    /// Tracking error of the arm against its set-points.
    #[serde(default)]
    motion: MotionSpec,
    /// Standard deviations of the geometry and loads.
    #[serde(default)]
    #[schemars(with = "GeometryTable")]
    geometry: GeometryPriors,
    /// Camera that calibrates the arm.
    camera: CameraFile,
    /// Further cameras, at most seven, used by `calibrate` on recordings of real arms.
    #[serde(default)]
    further_camera: Vec<CameraFile>,
    /// Surveyed tags in the base frame; those of a vehicle replace them all.
    #[serde(default)]
    tag: Vec<TagFile>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ToolFile {
    /// Link of the URDF that carries the tool.
    link: String,
    /// Tool point in the frame of that link.
    #[schemars(inner(range(min = -10.0, max = 10.0)))]
    point_m: [f64; 3],
    /// Radius of the sphere that touches; needed by `touch` steps.
    #[schemars(range(min = 0.002, max = 0.2))]
    tip_radius_m: Option<f64>,
}

impl ToolFile {
    fn check(&self, file: &Path) -> Result<(), FileIssue> {
        if let Some(radius_m) = self.tip_radius_m {
            FileIssue::check_range(file, "tool.tip_radius_m", radius_m, 0.002..=0.2)?;
        }
        self.point_m
            .iter()
            .try_for_each(|value| FileIssue::check_range(file, "tool.point_m", *value, -10.0..=10.0).map(drop))
    }
}

const TIP_RGB: [u8; 3] = [200, 205, 215];

/// Buoyancy fraction of a Titan: 100 kg in air, 78 kg in sea water.
fn default_buoyancy_fraction() -> f64 {
    0.22
}

/// Returns the schema of robot.toml.
#[must_use]
pub fn robot_schema() -> serde_json::Value {
    schema_of::<RobotFile>(Kind::Robot)
}

/// Reads a robot folder: robot.toml, the URDF that it names, the collision meshes that the URDF names, and
/// self_collision.toml. A self_collision.toml of another URDF is left out and becomes a planning issue.
///
/// # Errors
/// [`RobotError`] naming file, key and allowed range.
pub fn load(folder: &Path) -> Result<Robot, RobotError> {
    let mut robot = load_without_pairs(folder)?;
    match self_collision::read(folder, &robot.urdf_text, &robot.bodies)? {
        Stored::Pairs(pairs) => robot.self_pairs = Some(pairs),
        Stored::Stale(issue) => robot.planning_issues.push(issue),
        Stored::None => {}
    }
    Ok(robot)
}

/// Reads a robot folder without self_collision.toml, which may belong to another URDF.
///
/// # Errors
/// [`RobotError`] naming file, key and allowed range.
pub fn load_without_pairs(folder: &Path) -> Result<Robot, RobotError> {
    let (raw, urdf) = read_files(folder)?;
    robot_of(folder, raw, urdf, Meshes::Read)
}

/// Reads the attachments of a recording in `folder`, which include neither the URDF's meshes nor self_collision.toml.
///
/// # Errors
/// [`RobotError`] naming file, key and allowed range.
pub fn load_attached(folder: &Path) -> Result<Robot, RobotError> {
    let (raw, urdf) = read_files(folder)?;
    robot_of(folder, raw, urdf, Meshes::Skip)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Meshes {
    Read,
    Skip,
}

fn read_files(folder: &Path) -> Result<(RobotFile, UrdfModel), RobotError> {
    let file = folder.join("robot.toml");
    let text = read_in(folder, &file)?;
    let table: toml::Table = parse_toml(&file, &text)?;
    check_head(Kind::Robot, &file, &table)?;
    check_complete(&file, &table, || chain_joints(folder, &table))?;
    let raw: RobotFile = parse_toml(&file, &text)?;
    let urdf = read_urdf(folder, &raw.urdf)?;
    Ok((raw, urdf))
}

/// Returns the chain's joints as far as an incomplete robot.toml determines them.
fn chain_joints(folder: &Path, robot: &toml::Table) -> Option<Vec<(String, JointKind)>> {
    let text = |table: &toml::Table, key: &str| Some(table.get(key)?.as_str()?.to_owned());
    let link = |name: &str| text(robot.get(name)?.as_table()?, "link");
    let tips: Vec<String> = [link("tool"), link("camera")].into_iter().flatten().collect();
    let tips: Vec<&str> = tips.iter().map(String::as_str).collect();
    let urdf = read_urdf(folder, Path::new(&text(robot, "urdf")?)).ok()?;
    let chain = urdf.chain(&text(robot, "base_link")?, &tips).ok()?;
    Some(chain.joints().iter().map(|joint| (joint.name.clone(), joint.kind)).collect())
}

/// Returns the data that planning needs and `raw` lacks.
fn planning_issues(file: &Path, raw: &RobotFile, camera: &CameraSpec, arm: &UrdfChain<'_>) -> Vec<FileIssue> {
    let mut issues = Vec::new();
    if raw.stowed_rad.is_none() {
        let problem = "is missing; add one angle per joint, rad, at which the arm stands clear: paths start there";
        issues.push(FileIssue::new(Code::KeyMissing, file, STOWED, problem));
    }
    if raw.base_tag.is_none() {
        let problem = "is missing; add it and the [[tag]]s around the arm, or name a vehicle that carries tags";
        issues.push(FileIssue::new(Code::KeyMissing, file, BASE_TAG, problem));
    }
    if !camera.lens.is_known() {
        issues.push(lens_issue(file));
    }
    issues.extend(urdf_notes::planning_issues(arm));
    if let Some(slide) = arm.chain.joints().iter().find(|joint| joint.kind.is_slide()) {
        let problem = "is prismatic, and an arm with slides is neither simulated nor planned for yet: `armcal \
                       calibrate` works on recordings of it; where it is a lift that stands still, name the link on \
                       it as base_link";
        issues.push(FileIssue::new(Code::UrdfStructure, &arm.urdf.file, format!("joint `{}`", slide.name), problem));
    } else {
        issues.extend(urdf_notes::unshaped_issue(arm));
    }
    if camera.mount.n_joints == 0 && raw.tag_link.is_none() {
        let problem = "no joint moves it; run and plan need a camera that the arm carries, or tags that it carries \
                       before this one (tag_link)";
        issues.push(FileIssue::new(Code::UrdfStructure, file, "[camera] link", problem));
    }
    let mut ignored: Vec<&str> = arm.collision_meshes().iter().map(|mesh| mesh.link).collect();
    ignored.dedup();
    if raw.collision_meshes == CollisionMeshes::Ignore && !ignored.is_empty() {
        let problem = format!(
            "are ignored for the links {}: nothing keeps paths clear of them. Put the files into the folder and take \
             the key out, or draw boxes, cylinders or spheres",
            ignored.join(", ")
        );
        issues.push(FileIssue::new(Code::MeshUnusable, file, "collision_meshes", problem));
    }
    issues
}

fn robot_of(folder: &Path, raw: RobotFile, urdf: UrdfModel, meshes: Meshes) -> Result<Robot, RobotError> {
    let file = folder.join("robot.toml");
    let chain = urdf.chain(&raw.base_link, &[&raw.tool.link, &raw.camera.link])?;
    let jaws = raw.gripper.as_ref().map(GripperFile::jaws).unwrap_or_default();
    let arm = UrdfChain { urdf: &urdf, base_link: &raw.base_link, chain: &chain };
    let is_read = raw.collision_meshes == CollisionMeshes::Hull && meshes == Meshes::Read;
    let mut bodies = arm.bodies(jaws, is_read.then(|| mesh_folders(&urdf, folder)).as_ref())?;
    let (camera, further_cameras) = check_cameras(&file, &raw, &arm)?;
    let (links, planning_issues) = (arm.attachments(), planning_issues(&file, &raw, &camera, &arm));
    let allowed_pairs = AllowedPairs::check(&file, raw.allowed_pairs, &bodies)?;
    let sensors = check_sensors(&file, &raw.joint_sensor, &chain)?;
    let drive = DriveSpec {
        pump_l_per_min: raw.hydraulics.map(|hydraulics| hydraulics.check(&file)).transpose()?,
        displacement_l_per_rad: displacements_l_per_rad(&file, &raw.joint_sensor, &arm)?,
        motion: raw.motion.check(&file)?,
    };
    let mut tool = arm.attachment(&raw.tool.link)?;
    raw.tool.check(&file)?;
    let gripper = raw.gripper.map(|gripper| gripper.check(&file, &arm, &tool)).transpose()?;
    tool.link_from_frame *= nalgebra::Translation3::from(raw.tool.point_m);
    if let Some(radius_m) = raw.tool.tip_radius_m {
        add_tip(&mut bodies[tool.n_joints], tool.link_from_frame, radius_m);
    }
    let (tags, family) = check_tags(&file, &raw.tag, raw.base_tag, &Pose::<Base, Base>::identity())?;
    let tag_frame = raw.tag_link.as_ref().map(|link| check_tag_link(&file, link, &links, &camera)).transpose()?;
    let gripper_tag = raw.gripper_tag.map(|tag| tag.check(&file, &arm, &camera.mount)).transpose()?;
    gripper_tag.iter().try_for_each(|tag| check_gripper_tag(&file, tag, (&tags, family), tag_frame.as_ref()))?;
    let geometry = raw.geometry.check(&file)?;
    let buoyancy_fraction = FileIssue::check_range(&file, "buoyancy_fraction", raw.buoyancy_fraction, 0.0..=0.95)?;
    Ok(Robot {
        failed: Vec::new(),
        urdf_warnings: urdf_notes::warnings(&arm),
        efforts_n_m: chain.joints().iter().map(|joint| urdf.effort_n_m(&joint.name)).collect(),
        name: raw.name,
        serial: raw.serial,
        folder: folder.to_owned(),
        urdf_name: file_name(&raw.urdf),
        urdf_text: urdf.text,
        base_link: raw.base_link,
        stowed: stowed_or_middle(&file, raw.stowed_rad.as_deref(), &sensors)?,
        planning_issues,
        buoyancy_fraction,
        tool: ToolSpec { mount: tool, tip_radius_m: raw.tool.tip_radius_m },
        gripper,
        gripper_tag,
        base_tag: raw.base_tag,
        anchor_tag: None,
        chain: chain.with_loads(loads(&geometry, &bodies, buoyancy_fraction, tool)),
        bodies,
        self_pairs: None,
        allowed_pairs,
        sensors,
        drive,
        geometry,
        camera,
        further_cameras,
        tags,
        tag_frame: tag_frame.unwrap_or_else(Attachment::base),
        tag_family: family.or(gripper_tag.map(|tag| tag.family)).unwrap_or_default(),
        links,
    })
}

/// Returns the stowed angles of the file, or else the middle of each joint's range.
fn stowed_or_middle(
    file: &Path,
    stowed_rad: Option<&[f64]>,
    sensors: &[JointSensorSpec],
) -> Result<JointAngles, RobotError> {
    let middle = || JointAngles::from_fn(sensors.len(), |joint| sensors[joint].center_rad);
    stowed_rad.map_or_else(|| Ok(middle()), |angles_rad| check_stowed(file, STOWED, angles_rad, sensors.len()))
}

fn check_cameras(
    file: &Path,
    raw: &RobotFile,
    arm: &UrdfChain<'_>,
) -> Result<(CameraSpec, Vec<CameraSpec>), RobotError> {
    let mount = arm.attachment(&raw.camera.link)?;
    let camera = check_camera(CameraTable { file, name: "camera" }, &raw.camera, mount)?;
    let further = check_further_cameras(file, &raw.further_camera, arm, &camera)?;
    Ok((camera, further))
}

/// Checks the tag on the gripper against the other tags. Tags that the arm carries require a stationary camera, a tag
/// on the gripper a moving one.
fn check_gripper_tag(
    file: &Path,
    tag: &GripperTag,
    (tags, family): (&[SurveyedTag], Option<TagFamily>),
    tag_frame: Option<&Attachment>,
) -> Result<(), FileIssue> {
    if tag_frame.is_some() {
        let problem = "does not go together with [gripper_tag]: name that tag as a [[tag]], too";
        return Err(FileIssue::new(Code::KeysConflict, file, TAG_LINK, problem));
    }
    tag.check_beside(file, tags, family)
}

/// Returns the frame of the tags that the arm carries on `link`.
fn check_tag_link(
    file: &Path,
    link: &str,
    links: &BTreeMap<String, Attachment>,
    camera: &CameraSpec,
) -> Result<Attachment, FileIssue> {
    let issue =
        |problem: &str| Err(FileIssue::new(Code::NameUnknown, file, TAG_LINK, format!("is `{link}`; {problem}")));
    match links.get(link) {
        None => issue("no link between base and tool or camera is called so"),
        Some(place) if place.n_joints == 0 => issue("no joint moves it: leave the key out for tags beside the arm"),
        Some(_) if camera.mount.n_joints > 0 => {
            issue("the arm moves the camera ([camera] link); tags on the arm are for a camera that stands still")
        }
        Some(place) => Ok(*place),
    }
}

fn file_name(urdf: &Path) -> String {
    urdf.file_name().map_or_else(|| "robot.urdf".to_owned(), |name| name.to_string_lossy().into_owned())
}

/// Returns the folders of collision meshes: that of the URDF and that of robot.toml.
fn mesh_folders(urdf: &UrdfModel, folder: &Path) -> MeshFolders {
    MeshFolders { folders: [urdf.file.parent().unwrap_or(folder).to_owned(), folder.to_owned()] }
}

fn displacements_l_per_rad(file: &Path, sensors: &[SensorFile], arm: &UrdfChain<'_>) -> Result<Vec<f64>, FileIssue> {
    let given = displacements(file, sensors, arm.chain)?.into_iter().zip(arm.chain.joints());
    Ok(given.map(|(given, joint)| given.unwrap_or_else(|| usual_displacement(arm.urdf, &joint.name))).collect())
}

fn loads(geometry: &GeometryPriors, bodies: &[LinkBody], buoyancy_fraction: f64, tool: Attachment) -> ArmLoads {
    let mut loads = ArmLoads { up: Vector3::from(geometry.up).normalize(), tool, ..ArmLoads::default() };
    for (load, body) in loads.links.iter_mut().zip(bodies) {
        *load = body.load(buoyancy_fraction);
    }
    loads
}

/// Adds the ball about the tool point, as the last of its link's shapes.
fn add_tip(body: &mut LinkBody, owner_from_shape: Isometry3<f64>, radius_m: f64) {
    let tip = PlacedShape { owner_from_shape, shape: Shape::Sphere { radius_m }, color_rgb: TIP_RGB };
    body.visuals.push(tip.clone());
    body.collisions.push(tip);
}

/// Reads the URDF that robot.toml names, or else a file of that name next to robot.toml, as in the attachments of a
/// recording.
fn read_urdf(folder: &Path, urdf: &Path) -> Result<UrdfModel, RobotError> {
    let named = folder.join(urdf);
    let beside = urdf.file_name().map(|name| folder.join(name));
    let file = match beside {
        Some(beside) if !named.is_file() && beside.is_file() => beside,
        _ => named,
    };
    UrdfModel::parse(&file, read_in(folder, &file)?)
}
