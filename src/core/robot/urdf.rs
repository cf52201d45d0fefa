//! Serial chain and bodies of a URDF file.

use crate::codes::Code;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};
use urdf_rs::{Geometry, JointType};

use super::body::LinkBody;
use super::error::{FileIssue, RobotError};
use super::shape::{PlacedShape, Shape};
use super::urdf_mesh::{MeshFolders, NamedMesh};
use super::urdf_text::plain_urdf;
use crate::joints::MAX_JOINTS;
use crate::kinematics::{Attachment, Chain, ChainJoint, JointKind, JointLimits};

/// Limit of an arm's collision shapes, so that planning places them without allocating.
pub const MAX_COLLISION_SHAPES: usize = 64;
/// Grey, for shapes without a material.
const UNPAINTED_RGB: [u8; 3] = [160; 3];

/// A checked URDF file: a tree of links.
#[derive(Clone, Debug)]
pub(super) struct UrdfModel {
    pub file: PathBuf,
    pub text: String,
    pub robot: urdf_rs::Robot,
    /// Child link -> joint index.
    pub joint_of_child: BTreeMap<String, usize>,
}

/// A URDF file and the chain of an arm in it.
#[derive(Clone, Copy)]
pub(super) struct UrdfChain<'a> {
    pub urdf: &'a UrdfModel,
    pub base_link: &'a str,
    pub chain: &'a Chain,
}

/// A shape of a link, at its place in the link's frame.
struct Element<'a> {
    origin: &'a urdf_rs::Pose,
    shape: Shape,
    color_rgb: [u8; 3],
}

/// The shape of a geometry that needs no file; `None` for a mesh.
fn primitive(geometry: &Geometry) -> Option<Shape> {
    match *geometry {
        Geometry::Box { size } => Some(Shape::Box { size_m: size.0 }),
        Geometry::Cylinder { radius, length } => Some(Shape::Cylinder { radius_m: radius, length_m: length }),
        Geometry::Capsule { radius, length } => Some(Shape::Capsule { radius_m: radius, length_m: length }),
        Geometry::Sphere { radius } => Some(Shape::Sphere { radius_m: radius }),
        Geometry::Mesh { .. } => None,
    }
}

fn named_mesh<'a>(link: &'a urdf_rs::Link, geometry: &'a Geometry) -> Option<NamedMesh<'a>> {
    let Geometry::Mesh { filename, scale } = geometry else { return None };
    Some(NamedMesh { link: &link.name, name: filename, scale: scale.map_or([1.0; 3], |scale| scale.0) })
}

/// The pose that an `<origin>` gives.
pub(super) fn isometry(origin: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = origin.rpy.0;
    Isometry3::from_parts(
        Translation3::from(Vector3::from(origin.xyz.0)),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

impl UrdfModel {
    /// Largest torque of a joint, N m; 0 where the file gives none.
    pub(super) fn effort_n_m(&self, joint: &str) -> f64 {
        self.robot.joints.iter().find(|other| other.name == joint).map_or(0.0, |joint| joint.limit.effort)
    }

    /// Parses the text of `file` and checks that it is a tree of known links with finite numbers.
    ///
    /// # Errors
    /// [`RobotError`] naming the file and the link or joint.
    pub fn parse(file: &Path, text: String) -> Result<Self, RobotError> {
        let robot = plain_urdf(&text)
            .and_then(|plain| urdf_rs::read_from_string(&plain).map_err(|error| error.to_string()))
            .map_err(|message| RobotError::Syntax { code: Code::FileSyntax, file: file.to_owned(), message })?;
        let links: BTreeSet<&str> = robot.links.iter().map(|l| l.name.as_str()).collect();
        let mut joint_of_child = BTreeMap::new();
        let mut joint_names = BTreeSet::new();
        for (idx, joint) in robot.joints.iter().enumerate() {
            if !joint_names.insert(joint.name.as_str()) {
                return Err(FileIssue::new(
                    Code::ValueDuplicate,
                    file,
                    format!("joint `{}`", joint.name),
                    "is defined twice",
                )
                .into());
            }
            for link in [&joint.parent.link, &joint.child.link] {
                if !links.contains(link.as_str()) {
                    return Err(RobotError::MissingLink {
                        file: file.to_owned(),
                        joint: joint.name.clone(),
                        link: link.clone(),
                    });
                }
            }
            if joint_of_child.insert(joint.child.link.clone(), idx).is_some() {
                return Err(RobotError::Loop { file: file.to_owned(), link: joint.child.link.clone() });
            }
            check_numbers(file, joint)?;
        }
        let model = Self { file: file.to_owned(), text, robot, joint_of_child };
        model.check_acyclic()?;
        Ok(model)
    }

    fn check_acyclic(&self) -> Result<(), RobotError> {
        for link in &self.robot.links {
            let mut at = link.name.as_str();
            for _ in 0..=self.robot.joints.len() {
                match self.joint_of_child.get(at) {
                    Some(&joint) => at = &self.robot.joints[joint].parent.link,
                    None => break,
                }
            }
            if self.joint_of_child.contains_key(at) {
                return Err(RobotError::Loop { file: self.file.clone(), link: link.name.clone() });
            }
        }
        Ok(())
    }

    /// Joint indices from `base` down to `tip`.
    fn path(&self, base: &str, tip: &str) -> Result<Vec<usize>, RobotError> {
        let no_chain = || RobotError::NoChain { file: self.file.clone(), from: base.to_owned(), to: tip.to_owned() };
        let mut path = Vec::new();
        let mut at = tip;
        while at != base {
            let &joint = self.joint_of_child.get(at).ok_or_else(no_chain)?;
            path.push(joint);
            at = &self.robot.joints[joint].parent.link;
        }
        path.reverse();
        Ok(path)
    }

    /// The chain of moving joints from `base` that carries every link named in `tips`.
    ///
    /// # Errors
    /// [`RobotError::NoChain`] when no single chain carries all tips, [`RobotError::JointKind`] for other joints.
    pub fn chain(&self, base: &str, tips: &[&str]) -> Result<Chain, RobotError> {
        let mut longest: Vec<usize> = Vec::new();
        for tip in tips {
            let path = self.path(base, tip)?;
            if self.moving(&path).count() > self.moving(&longest).count() || longest.is_empty() {
                longest = path;
            }
        }
        let mut joints = Vec::new();
        let mut pending = Isometry3::identity();
        for &idx in &longest {
            let joint = &self.robot.joints[idx];
            check_moving(&self.file, joint)?;
            pending *= isometry(&joint.origin);
            let limits = JointLimits { lower_rad: joint.limit.lower, upper_rad: joint.limit.upper };
            let (kind, limits) = match joint.joint_type {
                JointType::Fixed => continue,
                JointType::Continuous => (JointKind::Revolute, None),
                JointType::Revolute => (JointKind::Revolute, Some(limits)),
                JointType::Prismatic => (JointKind::Prismatic, Some(limits)),
                ref other => {
                    return Err(RobotError::JointKind {
                        file: self.file.clone(),
                        joint: joint.name.clone(),
                        kind: format!("{other:?}").to_lowercase(),
                    });
                }
            };
            joints.push(ChainJoint {
                name: joint.name.clone(),
                child_link: joint.child.link.clone(),
                kind,
                parent_from_joint: pending,
                axis: Unit::new_normalize(Vector3::from(joint.axis.xyz.0)),
                limits,
            });
            pending = Isometry3::identity();
        }
        if joints.is_empty() || joints.len() > MAX_JOINTS {
            let problem =
                format!("{} moving joints between `{base}` and {tips:?}, 1 .. {MAX_JOINTS} allowed", joints.len());
            return Err(FileIssue::new(Code::UrdfStructure, &self.file, "joint", problem).into());
        }
        Ok(Chain::new(joints))
    }

    fn moving<'a>(&'a self, path: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
        path.iter().copied().filter(|&idx| self.robot.joints[idx].joint_type != JointType::Fixed)
    }

    pub(super) fn has_link(&self, name: &str) -> bool {
        self.robot.links.iter().any(|link| link.name == name)
    }

    /// Adds mass and collision shapes; collision meshes where `meshes` are read.
    fn add_link(
        &self,
        body: &mut LinkBody,
        link: &urdf_rs::Link,
        body_from_link: &Isometry3<f64>,
        meshes: Option<&MeshFolders>,
    ) -> Result<(), RobotError> {
        let inertial = &link.inertial;
        let mass_key = format!("link `{}`: mass", link.name);
        let mass_kg = FileIssue::check_range(&self.file, &mass_key, inertial.mass.value, 0.0..=1e6)?;
        let i = &inertial.inertia;
        let inertia = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
        if !inertia.iter().all(|v| v.is_finite()) {
            let key = format!("link `{}`: inertia", link.name);
            return Err(FileIssue::new(Code::ValueInvalid, &self.file, key, "is not finite").into());
        }
        if mass_kg > 0.0 {
            FileIssue::check_range(&self.file, &mass_key, mass_kg, 1e-6..=1e6)?;
            if inertia.cholesky().is_none() {
                body.bad_inertia.get_or_insert_with(|| link.name.clone());
            }
            let body_from_com = body_from_link * isometry(&inertial.origin);
            body.add_mass(mass_kg, &body_from_com, &inertia);
        }
        // Drawn where a link has nothing else.
        let color_rgb = link.visual.iter().find_map(|visual| self.color(visual)).unwrap_or(UNPAINTED_RGB);
        for collision in &link.collision {
            let origin = &collision.origin;
            let placed = match (named_mesh(link, &collision.geometry), meshes) {
                (None, _) => {
                    let Some(shape) = primitive(&collision.geometry) else { continue };
                    self.placed(&link.name, Element { origin, shape, color_rgb }, body_from_link)?
                }
                (Some(mesh), Some(folders)) => {
                    let (shape, center_m) = folders.hull(&self.file, &mesh)?;
                    let element = Element { origin, shape, color_rgb };
                    let mut placed = self.placed(&link.name, element, body_from_link)?;
                    placed.owner_from_shape *= Translation3::from(center_m);
                    placed
                }
                (Some(_), None) => continue,
            };
            body.collisions.push(placed);
        }
        Ok(())
    }

    fn add_visuals(
        &self,
        body: &mut LinkBody,
        link: &urdf_rs::Link,
        body_from_link: &Isometry3<f64>,
    ) -> Result<(), RobotError> {
        for visual in &link.visual {
            // Nothing is drawn of a mesh.
            let Some(shape) = primitive(&visual.geometry) else { continue };
            let color_rgb = self.color(visual).unwrap_or(UNPAINTED_RGB);
            let element = Element { origin: &visual.origin, shape, color_rgb };
            body.visuals.push(self.placed(&link.name, element, body_from_link)?);
        }
        Ok(())
    }

    fn color(&self, visual: &urdf_rs::Visual) -> Option<[u8; 3]> {
        let material = visual.material.as_ref()?;
        let named = self.robot.materials.iter().find(|m| m.name == material.name);
        let color = material.color.as_ref().or_else(|| named.and_then(|m| m.color.as_ref()))?;
        Some([0, 1, 2].map(|k| (color.rgba.0[k].clamp(0.0, 1.0) * 255.0).round() as u8))
    }

    fn placed(
        &self,
        link: &str,
        element: Element<'_>,
        body_from_link: &Isometry3<f64>,
    ) -> Result<PlacedShape, RobotError> {
        let Element { origin, shape, color_rgb } = element;
        for (name, length) in shape.lengths() {
            FileIssue::check_range(&self.file, &format!("link `{link}`: {name}"), length, 1e-6..=1e4)?;
        }
        for value in origin.xyz.0.iter().chain(&origin.rpy.0) {
            FileIssue::check_range(&self.file, &format!("link `{link}`: origin"), *value, -1e4..=1e4)?;
        }
        Ok(PlacedShape { owner_from_shape: body_from_link * isometry(origin), shape, color_rgb })
    }
}

impl UrdfChain<'_> {
    /// Pose of the frame of `link` on the chain.
    ///
    /// # Errors
    /// [`RobotError::NoChain`] when the chain does not carry the link.
    pub fn attachment(&self, link: &str) -> Result<Attachment, RobotError> {
        let mut n_joints = 0;
        let mut link_from_frame = Isometry3::identity();
        for idx in self.urdf.path(self.base_link, link)? {
            let joint = &self.urdf.robot.joints[idx];
            if joint.joint_type == JointType::Fixed {
                link_from_frame *= isometry(&joint.origin);
            } else if self.chain.joints().get(n_joints).is_some_and(|j| j.name == joint.name) {
                n_joints += 1;
                link_from_frame = Isometry3::identity();
            } else {
                let (from, to) = (self.base_link.to_owned(), link.to_owned());
                return Err(RobotError::NoChain { file: self.urdf.file.clone(), from, to });
            }
        }
        Ok(Attachment { n_joints, link_from_frame })
    }

    /// Every link that the chain carries, by name.
    pub fn attachments(&self) -> BTreeMap<String, Attachment> {
        let links = self.urdf.robot.links.iter();
        links.filter_map(|link| Some((link.name.clone(), self.attachment(&link.name).ok()?))).collect()
    }

    /// Visual shapes of the link `name`, in the frame of the chain's link that carries it.
    ///
    /// # Errors
    /// [`RobotError`] for a link that the chain does not carry, or for invalid shapes.
    pub fn visuals_of(&self, name: &str) -> Result<Vec<PlacedShape>, RobotError> {
        let attachment = self.attachment(name)?;
        let mut body = LinkBody::empty(name.to_owned());
        for link in self.urdf.robot.links.iter().filter(|link| link.name == name) {
            self.urdf.add_visuals(&mut body, link, &attachment.link_from_frame)?;
        }
        Ok(body.visuals)
    }

    /// Bodies 0..=n: the base with everything fixed to it, then one per joint of the chain. The links in `apart` move
    /// by themselves; their visual shapes are omitted. Collision meshes are left out where `meshes` is `None`.
    ///
    /// # Errors
    /// [`RobotError::Value`] for invalid numbers, shapes or meshes; all meshes without a file at once.
    pub fn bodies(&self, apart: &[String], meshes: Option<&MeshFolders>) -> Result<Vec<LinkBody>, RobotError> {
        let mut names = vec![self.base_link.to_owned()];
        names.extend(self.chain.joints().iter().map(|j| j.child_link.clone()));
        let mut bodies: Vec<LinkBody> = names.into_iter().map(LinkBody::empty).collect();
        self.check_collisions(meshes)?;
        for link in &self.urdf.robot.links {
            let Ok(attachment) = self.attachment(&link.name) else { continue };
            let body = &mut bodies[attachment.n_joints];
            self.urdf.add_link(body, link, &attachment.link_from_frame, meshes)?;
            if !apart.contains(&link.name) {
                self.urdf.add_visuals(body, link, &attachment.link_from_frame)?;
            }
        }
        Ok(bodies)
    }

    /// Before any mesh is read: the number of shapes, and whether the meshes are there.
    fn check_collisions(&self, meshes: Option<&MeshFolders>) -> Result<(), RobotError> {
        let named = self.collision_meshes();
        let primitives = self.links().flat_map(|link| &link.collision).filter(|c| primitive(&c.geometry).is_some());
        let n_shapes = primitives.count() + meshes.map_or(0, |_| named.len());
        if n_shapes > MAX_COLLISION_SHAPES {
            let problem = format!("{n_shapes} shapes on the chain, 0 .. {MAX_COLLISION_SHAPES} allowed");
            return Err(FileIssue::new(Code::MeshUnusable, &self.urdf.file, "collision", problem).into());
        }
        let Some(folders) = meshes else { return Ok(()) };
        let problems: Vec<String> = named
            .iter()
            .filter_map(|mesh| {
                Some(format!("{} of link `{}`: {}", mesh.name, mesh.link, folders.find(mesh.name).err()?))
            })
            .collect();
        if problems.is_empty() {
            return Ok(());
        }
        let problem = format!(
            "{} cannot be used: {}. Or write collision_meshes = \"ignore\" in robot.toml: then paths cannot be planned",
            problems.len(),
            problems.join("; ")
        );
        Err(FileIssue::new(Code::MeshUnusable, &self.urdf.file, "collision meshes", problem).into())
    }

    /// The links that the chain carries.
    fn links(&self) -> impl Iterator<Item = &urdf_rs::Link> {
        self.urdf.robot.links.iter().filter(|link| self.attachment(&link.name).is_ok())
    }

    /// The collision meshes of the chain's links.
    pub fn collision_meshes(&self) -> Vec<NamedMesh<'_>> {
        let mut named = Vec::new();
        for link in self.links() {
            named.extend(link.collision.iter().filter_map(|collision| named_mesh(link, &collision.geometry)));
        }
        named
    }
}

/// Numbers that matter for joints of every kind, on the chain or beside it.
fn check_numbers(file: &Path, joint: &urdf_rs::Joint) -> Result<(), RobotError> {
    for value in joint.origin.xyz.0.iter().chain(&joint.origin.rpy.0).chain(&joint.axis.xyz.0) {
        FileIssue::check_range(file, &format!("joint `{}`: origin or axis", joint.name), *value, -1e4..=1e4)?;
    }
    Ok(())
}

/// Axis, effort and limits of a joint of the chain.
fn check_moving(file: &Path, joint: &urdf_rs::Joint) -> Result<(), RobotError> {
    if joint.joint_type == JointType::Fixed {
        return Ok(());
    }
    if Vector3::from(joint.axis.xyz.0).norm() < 1e-6 {
        return Err(FileIssue::new(
            Code::ValueInvalid,
            file,
            format!("joint `{}`: axis", joint.name),
            "has no direction",
        )
        .into());
    }
    FileIssue::check_range(file, &format!("joint `{}`: effort", joint.name), joint.limit.effort, 0.0..=1e7)?;
    let (lower, upper) = (joint.limit.lower, joint.limit.upper);
    if matches!(joint.joint_type, JointType::Revolute | JointType::Prismatic)
        && !(lower.is_finite() && upper.is_finite() && lower < upper)
    {
        let key = format!("joint `{}`: limit", joint.name);
        return Err(FileIssue::new(
            Code::ValueInvalid,
            file,
            key,
            format!("lower {lower} must lie below upper {upper}"),
        )
        .into());
    }
    Ok(())
}
