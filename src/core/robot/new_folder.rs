//! A robot folder for a URDF: robot.toml with the values read, the values assumed, and those left to fill in.

use crate::codes::Code;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use toml::Value;

use super::arm_chain::{Ends, FoundArm, find_arm};
use super::error::{FileIssue, RobotError, read_text};
use super::mesh;
use super::urdf::{MAX_COLLISION_SHAPES, UrdfChain, UrdfModel};
use super::urdf_file::UrdfJoint;
use super::urdf_mesh::places;
use crate::files::{self, FileKind};
use crate::kind::Kind;
use crate::kinematics::{Chain, ChainJoint, JointKind};
use crate::optics::{CameraModel, LensModel};
use crate::schema::first_line;

/// Inputs of a new robot folder.
#[derive(Clone, Copy, Debug)]
pub struct NewRobot<'a> {
    /// Path of the URDF.
    pub urdf: &'a Path,
    /// Text of the URDF, if it differs from the file's.
    pub text: Option<&'a str>,
    /// Link whose frame is the base frame; `None`: the root, or the child of a root called `world`.
    pub base: Option<&'a str>,
    /// Link of the tool; `None`: the end of the longest chain of joints.
    pub tip: Option<&'a str>,
    /// Link whose frame is the camera's: x right, y down, z forward.
    pub camera: Option<&'a str>,
    /// Description of the lens's source, and the camera's lens.
    pub lens: Option<(&'a str, &'a CameraModel)>,
    /// Links that overlap or are close to each other at nearly every configuration.
    pub touching: &'a [[String; 2]],
    /// Configuration without self-collision, rad (m of slides), base first.
    pub clear_rad: Option<&'a [f64]>,
}

/// Treatment of the collision meshes.
#[derive(Clone, Copy, Debug)]
pub enum DraftedMeshes<'a> {
    /// The meshes are copied and read.
    Read,
    /// Some meshes cannot be read; the text is the reason.
    Ignored(&'a str),
}

/// A file of the new folder.
#[derive(Clone, Debug)]
pub struct NewFile {
    /// Path relative to the folder.
    pub path: PathBuf,
    /// Content of the file.
    pub bytes: Vec<u8>,
}

/// The files of a new robot folder.
#[derive(Clone, Debug)]
pub struct DraftedRobot {
    /// Files: the URDF, its collision meshes and, last, robot.toml.
    pub files: Vec<NewFile>,
    /// Joints that were left out because they seem to belong to a gripper or to the arm's carrier.
    pub left_out: Vec<String>,
    /// Joints among them that move in several ways, such as planar ones: no chain continues over them.
    pub cut_at: Vec<String>,
    /// Joints whose origin is turned by more than a turn, as degrees would be.
    pub turned: Vec<String>,
}

/// Largest angle of an origin in radians: a turn, and rounding. Larger ones are degrees.
const MAX_TURN_RAD: f64 = std::f64::consts::TAU + 0.01;

/// Number of folders above the URDF's in which packages are searched for.
const MAX_ANCESTORS: usize = 8;

/// Returns the files of a robot folder. Collision meshes are searched for in the URDF's folder and in those above it.
///
/// # Errors
/// [`RobotError`] for a URDF that cannot be read, that has no arm, or that has several arms and no tip is named.
pub fn draft_robot(wanted: &NewRobot<'_>, meshes: DraftedMeshes<'_>) -> Result<DraftedRobot, RobotError> {
    let (urdf, arm) = read_arm(wanted)?;
    let camera = arm.camera.as_deref().unwrap_or(&arm.tip);
    let chain = urdf.chain(&arm.base, &[&arm.tip, camera])?;
    let on_chain = UrdfChain { urdf: &urdf, base_link: &arm.base, chain: &chain };
    let urdf_name = wanted.urdf.file_name().map_or_else(|| "arm.urdf".into(), PathBuf::from);
    let mut files = mesh_files(&on_chain, wanted.urdf)?;
    files.push(NewFile { path: urdf_name.clone(), bytes: urdf.text.clone().into_bytes() });
    let name = &urdf.robot.name;
    let draft = Draft { wanted, urdf: &urdf, urdf_name: &urdf_name, name, arm: &arm, chain: &chain, meshes };
    files.push(NewFile { path: "robot.toml".into(), bytes: draft.text().into_bytes() });
    let is_turned = |joint: &&UrdfJoint| joint.origin.rpy_rad.iter().any(|rad| rad.abs() > MAX_TURN_RAD);
    let turned = urdf.robot.joints.iter().filter(is_turned).map(|joint| joint.name.clone()).collect();
    Ok(DraftedRobot { files, left_out: arm.left_out, cut_at: arm.cut_at, turned })
}

/// Returns the URDF, and the arm in it.
fn read_arm(wanted: &NewRobot<'_>) -> Result<(UrdfModel, FoundArm), RobotError> {
    let text = wanted.text.map_or_else(|| read_text(wanted.urdf), |text| Ok(text.to_owned()))?;
    let urdf = UrdfModel::parse(wanted.urdf, text)?;
    let arm = find_arm(&urdf, &Ends { base: wanted.base, tip: wanted.tip, camera: wanted.camera })?;
    Ok((urdf, arm))
}

/// Limit of the bytes of all copied collision meshes, which are in memory together.
const MAX_MESH_BYTES: u64 = 500_000_000;

/// Returns the collision meshes found, each once, at the paths where the reader of robot folders searches for them.
fn mesh_files(arm: &UrdfChain<'_>, urdf: &Path) -> Result<Vec<NewFile>, RobotError> {
    let mut found: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    for mesh in arm.collision_meshes().iter().take(MAX_COLLISION_SHAPES) {
        let Some(source) = mesh_source(urdf, mesh.name) else { continue };
        // Formats come after their conversions; so the first path has the source's extension, or no path is read.
        let extension = source.extension().unwrap_or_default();
        let place = places(mesh.name).into_iter().next().unwrap_or_default().with_extension(extension);
        found.insert(place, source);
    }
    let n_bytes: u64 = found.values().filter_map(|source| source.metadata().ok()).map(|of_file| of_file.len()).sum();
    if n_bytes > MAX_MESH_BYTES {
        let (have, most) = (n_bytes / 1_000_000, MAX_MESH_BYTES / 1_000_000);
        let problem = format!("have {have} MB together, at most {most} MB are copied: simplify them");
        return Err(FileIssue::new(Code::MeshUnusable, urdf, "collision meshes", problem).into());
    }
    let read = |(path, source): (PathBuf, PathBuf)| {
        let bytes = files::read_bytes(&source, FileKind::Mesh);
        let bytes = bytes.map_err(|error| RobotError::Unreadable { file: source, source: error })?;
        Ok(NewFile { path, bytes })
    };
    found.into_iter().map(read).collect()
}

/// Returns the file of a mesh by its path, relative to the URDF or in a package above it. `None` if no such file can be
/// read.
fn mesh_source(urdf: &Path, name: &str) -> Option<PathBuf> {
    let folder = urdf.parent().unwrap_or(Path::new("."));
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let as_written = name.strip_prefix("file://").or((!name.contains("://")).then_some(name));
    let mut sources: Vec<PathBuf> = Vec::new();
    if let Some(path) = as_written {
        let path = folder.join(path);
        sources.extend(["stl", "obj"].map(|extension| path.with_extension(extension)));
        sources.insert(0, path);
    }
    let places = places(name);
    for ancestor in folder.ancestors().take(MAX_ANCESTORS) {
        sources.extend(places.iter().map(|place| ancestor.join(place)));
    }
    sources.into_iter().find(|file| mesh::is_readable(file) && file.is_file())
}

/// Data that robot.toml is written from.
struct Draft<'a> {
    wanted: &'a NewRobot<'a>,
    urdf: &'a UrdfModel,
    urdf_name: &'a Path,
    name: &'a str,
    arm: &'a FoundArm,
    chain: &'a Chain,
    meshes: DraftedMeshes<'a>,
}

/// Returns a text as a TOML string.
fn quoted(text: &str) -> String {
    Value::from(text).to_string()
}

/// Returns a text for one line of a comment.
fn on_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

impl Draft<'_> {
    fn text(&self) -> String {
        let mut out = String::new();
        self.head(&mut out);
        self.tool(&mut out);
        out.push_str(SENSORS);
        self.chain.joints().iter().for_each(|joint| self.sensor(&mut out, joint));
        self.camera(&mut out);
        out.push_str(REST);
        out
    }

    fn head(&self, out: &mut String) {
        let (n, arm) = (self.chain.n_joints(), self.arm);
        let urdf = quoted(&self.urdf_name.to_string_lossy());
        let _ = write!(
            out,
            "{}# Written by `armcal new-robot` from {}. \"Read\" is what the URDF says, \"assumed\" is not: look at\n\
             # it. Angles in rad, lengths and the ways of slides in m. Keys that begin with # are left to fill in.\n\
             version = 1\nkind = \"robot\"\nname = {}\nurdf = {urdf}\n\
             # Read: the chain of {n} moving joints from here. Tags and targets are in this link's frame.\n\
             base_link = {}\n\
             # Assumed: the arm is in air. Under water: the displaced water's weight over the arm's.\n\
             buoyancy_fraction = 0.0\n",
            first_line(Kind::Robot),
            on_line(&self.urdf_name.to_string_lossy()),
            quoted(self.name),
            quoted(&arm.base)
        );
        if let DraftedMeshes::Ignored(why) = self.meshes {
            let _ = write!(
                out,
                "# {}\n# Until that is done: links are without shape, and run and plan refuse the arm.\n\
                 collision_meshes = \"ignore\"\n",
                on_line(why)
            );
        }
        self.shapes(out);
        out.push_str("# With [[tag]]s below: the id of the one beside the base.\n# base_tag = 0\n");
    }

    fn shapes(&self, out: &mut String) {
        let touching = self.wanted.touching;
        if !touching.is_empty() {
            let pairs: Vec<String> =
                touching.iter().map(|[a, b]| format!("    [{}, {}],\n", quoted(a), quoted(b))).collect();
            let _ = write!(
                out,
                "# Found: these links overlap or are within 5 cm at nearly every pose, so that no plan could\n\
                 # keep them apart. Look whether that is by design.\nallowed_pairs = [\n{}]\n",
                pairs.concat()
            );
        }
        let middle = self.chain.joints().iter().map(middle_rad);
        let (angles_rad, whence) = match self.wanted.clear_rad {
            Some(clear) => (clear.to_vec(), "angles near the middle of each range at which the arm is clear of itself"),
            None => (middle.collect(), "the middle of each range"),
        };
        let slides = if self.has_slide() { " Of a slide m; run and plan refuse slides so far." } else { "" };
        let angles: Vec<String> = angles_rad.into_iter().map(to_millirad).collect();
        let _ = write!(
            out,
            "# For run and plan: the angles at which the arm is stowed, clear of everything; paths start there.\n\
             # Here {whence}.{slides}\n# stowed_rad = [{}]\n",
            angles.join(", ")
        );
    }

    fn has_slide(&self) -> bool {
        self.chain.joints().iter().any(|joint| joint.kind.is_slide())
    }

    fn tool(&self, out: &mut String) {
        let _ = write!(
            out,
            "\n[tool]\n# Read: the end of the chain.\nlink = {}\n\
             # Assumed: the tool point is that link's origin.\npoint_m = [0.0, 0.0, 0.0]\n",
            quoted(&self.arm.tip)
        );
        if !self.arm.left_out.is_empty() {
            let joints = on_line(&self.arm.left_out.join(", "));
            let _ = writeln!(
                out,
                "# Assumed: not the arm's, but a gripper's or a carriage's: {joints}. Or name --base, --tip."
            );
        }
    }

    fn sensor(&self, out: &mut String, joint: &ChainJoint) {
        let drawn = self.urdf.joint(&joint.name);
        let velocity = drawn.map_or(0.0, |drawn| drawn.velocity);
        let (rate_rad_s, whose) = match velocity {
            v if v.is_finite() && v > 0.0 => (v.clamp(1e-3, 20.0), "read"),
            _ => (0.5, "assumed"),
        };
        let limits = joint.limits.map_or_else(
            || "no limits".to_owned(),
            |limits| format!("{} .. {} {}", limits.lower_rad, limits.upper_rad, joint.kind.si()),
        );
        let (rest, max_rate) = match joint.kind {
            JointKind::Revolute => (SENSOR, "max_rate_rad_s"),
            JointKind::Prismatic => (SLIDE_SENSOR, "max_rate_m_s"),
        };
        let _ = write!(
            out,
            "\n[[joint_sensor]]\n# Read: {limits}.\njoint = {}\n{rest}\
             {max_rate} = {rate_rad_s:?}  # {whose}\n",
            quoted(&joint.name),
        );
    }

    /// Returns true if no joint of the arm moves the camera.
    fn stands_still(&self, link: &str) -> bool {
        let arm = UrdfChain { urdf: self.urdf, base_link: &self.arm.base, chain: self.chain };
        arm.attachment(link).is_ok_and(|attachment| attachment.n_joints == 0)
    }

    fn camera(&self, out: &mut String) {
        if let Some(link) = self.arm.camera.as_ref().filter(|link| self.stands_still(link)) {
            let _ = write!(out, "\n[camera]\nname = {0}\n# Read.\nlink = {0}\n{STANDING}", quoted(link));
            self.lens(out);
            return;
        }
        let (link, whose, std_m, std_rad) = match &self.arm.camera {
            Some(link) => {
                (link, "# Read: the camera's link. Its frame is optical: x right, y down, z forward.", 0.01, 0.05)
            }
            None => (
                &self.arm.tip,
                "# Assumed: the camera looks along z of the tool's link, for no link is called a camera. Add a link\n\
                 # to the URDF where it is, in the optical frame: x right, y down, z forward.",
                0.1,
                0.3,
            ),
        };
        let _ = write!(
            out,
            "\n[camera]\nname = {}\n{whose}\nlink = {}\n\
             # Assumed: how well its place on the link is known, one sigma per axis. Measure it: they are priors.\n\
             mount_std_m = {std_m:?}\nmount_std_rad = {std_rad:?}\n",
            quoted(link),
            quoted(link)
        );
        self.lens(out);
    }

    fn lens(&self, out: &mut String) {
        let Some((source, lens)) = self.wanted.lens else { return out.push_str(LENS) };
        let (model, widest) = match &lens.lens {
            LensModel::Equidistant(fisheye) => {
                ("equidistant", format!("max_view_angle_rad = {:?}\n", fisheye.max_view_angle_rad))
            }
            _ => ("pinhole", String::new()),
        };
        let _ = write!(
            out,
            "# Read: the lens, {}.\nmodel = \"{model}\"\nresolution_px = {:?}\nfocal_px = {:?}\ncenter_px = {:?}\n\
             distortion = {:?}\n{widest}corner_std_px = 0.3  # assumed\n",
            on_line(source),
            lens.resolution_px(),
            lens.focal_px(),
            lens.center_px(),
            lens.distortion()
        );
    }
}

fn middle_rad(joint: &ChainJoint) -> f64 {
    joint.limits.map_or(0.0, |limits| 0.5 * (limits.lower_rad + limits.upper_rad))
}

fn to_millirad(angle_rad: f64) -> String {
    // Adding zero turns -0 into 0.
    format!("{:?}", (angle_rad * 1e3).round() / 1e3 + 0.0)
}

const SENSORS: &str = "
# Assumed: an electric arm's encoders, recorded in radians: one count is one radian. For raw words write the datasheet's
# counts per degree, the reading at angle zero and the counts after which the word repeats. The figures with std are
# priors, one sigma, and calibrate weighs them against the recording; planning keeps clear of the bounds.
";

const SENSOR: &str = "kind = \"encoder\"  # assumed; or potentiometer, resolver
offset_counts = 0.0
scale_counts_per_deg = 0.017453292519943295  # pi / 180
wrap_counts = 1e6  # never repeats
gain_std = 0.002
offset_std_rad = 0.01
gain_bound = 0.005
offset_bound_rad = 0.02
noise_std_counts = 1e-4
linearity_std_rad = 2e-4
temperature_std_rad_per_k = 1e-5
drift_std_rad_per_sqrt_h = 1e-5
";

const SLIDE_SENSOR: &str =
    "# A slide: its figures are in metres. Assumed: a linear encoder that counts metres, homed at a switch (5 mm), on a
# drive whose scale is known to 2 mm in a metre; a metre of steel grows by 0.01 mm per kelvin. For raw words write the
# datasheet's counts per millimetre.
kind = \"encoder\"  # assumed; or potentiometer, resolver
offset_counts = 0.0
scale_counts_per_mm = 0.001
wrap_counts = 1e6  # never repeats
gain_std = 0.002
offset_std_m = 0.005
gain_bound = 0.005
offset_bound_m = 0.01
noise_std_counts = 2e-5
linearity_std_m = 1e-4
temperature_std_m_per_k = 1e-5
drift_std_m_per_sqrt_h = 1e-5
";

const LENS: &str = "# For images, for corners of tags, and for run and plan: the lens.
# model = \"pinhole\"  # or equidistant, with max_view_angle_rad
# resolution_px = [1280, 720]
# focal_px = [900.0, 900.0]
# center_px = [639.5, 359.5]
# distortion = [0.0, 0.0, 0.0, 0.0]
# corner_std_px = 0.3
";

const STANDING: &str =
    "# No joint moves this link: the camera stands still and sees tags or a board that the arm carries. The
# tag map says where they are, in the frame of the arm's link that carries them; for run and plan that link is named
# at the top of this file (tag_link = \"LINK\"), and the [[tag]]s below are in its frame. Left to fill in: where the
# camera is on its link (optical frame: x right, y down, z forward), and how well that is known, one sigma per axis.
position_m = [0.0, 0.0, 0.0]
quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
mount_std_m = 0.1
mount_std_rad = 0.1
";

const REST: &str = "
# How well links and tool point are known, one sigma per axis. Unstated, U95 does not include them.
# [geometry]
# link_position_std_m = 5e-4
# link_rotation_std_rad = 5e-4
# tool_position_std_m = 5e-4

# Tags of one family (36h11, 25h9, Standard41h12 ..) around the arm, in the base link's frame; z points out of the tag.
# Or a tag map, --tag-map.
# [[tag]]
# id = 0
# family = \"36h11\"
# size_m = 0.15
# position_m = [0.5, 0.0, 0.2]
# quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
# position_std_m = 0.001
# rotation_std_rad = 0.0035
";
