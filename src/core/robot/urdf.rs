//! Serial chain and bodies of a URDF file.

use crate::codes::Code;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3, Unit, Vector3};

use super::body::LinkBody;
use super::error::{FileIssue, RobotError};
use super::shape::{PlacedShape, Shape};
use super::urdf_file::{JointType, Range, ShapeElement, Skipped, UrdfFile, UrdfJoint, UrdfLink, UrdfShape};
use super::urdf_mesh::{MeshFolders, NamedMesh};
use crate::joints::MAX_JOINTS;
use crate::kinematics::{Attachment, Chain, ChainJoint, JointKind};

pub(super) mod notes;

/// Limit of an arm's collision shapes, so that planning places them without allocating.
pub const MAX_COLLISION_SHAPES: usize = 64;
/// Maximum number of joints between a link and the root of its tree; those of a humanoid have about thirty.
const MAX_JOINTS_UP: usize = 200;
/// Maximum number of joints of a URDF; a humanoid with its hands has about 100. The search for an arm compares each
/// with the others.
const MAX_URDF_JOINTS: usize = 1000;
/// Grey colour of shapes without a material.
const UNPAINTED_RGB: [u8; 3] = [160; 3];

/// A checked URDF file: a tree of links.
#[derive(Clone, Debug)]
pub(super) struct UrdfModel {
    pub file: PathBuf,
    pub text: String,
    pub robot: UrdfFile,
    /// Joint index by child link; the first joint that holds the link.
    pub joint_of_child: BTreeMap<String, usize>,
    /// Second joint that holds a child link, by link: a closed chain.
    closing: BTreeMap<String, usize>,
    /// Names that are shared by several joints.
    repeated: BTreeSet<String>,
}

/// A URDF file and the chain of an arm in it.
#[derive(Clone, Copy)]
pub(super) struct UrdfChain<'a> {
    pub urdf: &'a UrdfModel,
    pub base_link: &'a str,
    pub chain: &'a Chain,
}

/// Returns the shape of an element that needs no file; `None` for a mesh.
fn primitive(element: &ShapeElement) -> Option<&Shape> {
    match &element.shape {
        UrdfShape::Primitive(shape) => Some(shape),
        UrdfShape::Mesh { .. } => None,
    }
}

fn named_mesh<'a>(link: &'a UrdfLink, element: &'a ShapeElement) -> Option<NamedMesh<'a>> {
    let UrdfShape::Mesh { name, scale } = &element.shape else { return None };
    Some(NamedMesh { link: &link.name, name, scale: *scale })
}

fn placed(element: &ShapeElement, shape: Shape, body_from_link: &Isometry3<f64>, color_rgb: [u8; 3]) -> PlacedShape {
    PlacedShape { owner_from_shape: body_from_link * element.origin.isometry(), shape, color_rgb }
}

impl UrdfModel {
    /// Returns the joint of that name; the first one if several have it.
    pub(super) fn joint(&self, name: &str) -> Option<&UrdfJoint> {
        self.robot.joints.iter().find(|joint| joint.name == name)
    }

    /// Returns the largest torque of a joint, N m; 0 if the file gives none.
    pub(super) fn effort_n_m(&self, joint: &str) -> f64 {
        self.joint(joint).map_or(0.0, |joint| joint.effort)
    }

    /// Parses the text of `file` and checks that it is a tree of links.
    ///
    /// # Errors
    /// [`RobotError`] naming the file and the link or joint.
    pub fn parse(file: &Path, text: String) -> Result<Self, RobotError> {
        let robot = UrdfFile::parse(&text).map_err(|message| RobotError::Syntax {
            code: Code::FileSyntax,
            file: file.to_owned(),
            message,
        })?;
        if robot.joints.len() > MAX_URDF_JOINTS {
            let message =
                format!("{} joints, 0 .. {MAX_URDF_JOINTS} allowed; give the arm's part alone", robot.joints.len());
            return Err(RobotError::Syntax { code: Code::ValueInvalid, file: file.to_owned(), message });
        }
        let mut model = Self {
            file: file.to_owned(),
            text,
            robot,
            joint_of_child: BTreeMap::new(),
            closing: BTreeMap::new(),
            repeated: BTreeSet::new(),
        };
        model.connect();
        model.check_acyclic()?;
        model.add_implied_links()?;
        model.note_loose_links();
        Ok(model)
    }

    /// Fills the tables of joints. Ambiguous joints matter only on the chain, and are skipped elsewhere.
    fn connect(&mut self) {
        let mut places = BTreeMap::new();
        for (idx, joint) in self.robot.joints.iter().enumerate() {
            let mut skip = |text: String| {
                let owner = format!("joint `{}`", joint.name);
                self.robot.skipped.push(Skipped { owner, place: joint.place, text });
            };
            if let Some(first) = places.insert(joint.name.clone(), joint.place) {
                self.repeated.insert(joint.name.clone());
                skip(format!("has the name of the joint at {first}; neither can be a joint of the arm"));
            }
            if self.joint_of_child.contains_key(&joint.child) {
                skip(format!(
                    "holds the link `{}`, which another joint holds: the chain that it closes is skipped",
                    joint.child
                ));
                self.closing.entry(joint.child.clone()).or_insert(idx);
            } else {
                self.joint_of_child.insert(joint.child.clone(), idx);
            }
        }
    }

    fn check_acyclic(&self) -> Result<(), RobotError> {
        for joint in &self.robot.joints {
            let Err(at) = self.go_up(&joint.child, MAX_JOINTS_UP) else { continue };
            let file = self.file.clone();
            return Err(match self.go_up(at, self.robot.joints.len()) {
                Ok(()) => {
                    let message = format!(
                        "{}: link `{}` is below more than {MAX_JOINTS_UP} joints; give the arm's part alone",
                        joint.place, joint.child
                    );
                    RobotError::Syntax { code: Code::ValueInvalid, file, message }
                }
                Err(_) => {
                    let (place, link) = (joint.place.to_string(), joint.child.clone());
                    RobotError::Loop { file, place, link, joint: joint.name.clone() }
                }
            });
        }
        Ok(())
    }

    /// Follows the joints from a link to the root of its tree. The error is the link after `n` joints, if more are
    /// above it.
    fn go_up<'a>(&'a self, link: &'a str, n: usize) -> Result<(), &'a str> {
        let mut at = link;
        for _ in 0..=n {
            let Some(&joint) = self.joint_of_child.get(at) else { return Ok(()) };
            at = &self.robot.joints[joint].parent;
        }
        Err(at)
    }

    /// Adds links that only joints name, if the joints leave no doubt about the link.
    fn add_implied_links(&mut self) -> Result<(), RobotError> {
        let defined: BTreeSet<String> = self.robot.links.iter().map(|link| link.name.clone()).collect();
        let parents = self.robot.joints.iter().map(|joint| joint.parent.clone());
        let links: BTreeSet<String> = defined.iter().cloned().chain(parents).collect();
        let n_roots = links.iter().filter(|link| !self.joint_of_child.contains_key(*link)).count();
        let mut added: BTreeMap<String, UrdfLink> = BTreeMap::new();
        for joint in &self.robot.joints {
            for link in [&joint.parent, &joint.child] {
                if defined.contains(link) || added.contains_key(link) {
                    continue;
                }
                // A wrong name splits the tree.
                if n_roots > 1 {
                    return Err(RobotError::MissingLink {
                        file: self.file.clone(),
                        place: joint.place.to_string(),
                        joint: joint.name.clone(),
                        link: link.clone(),
                    });
                }
                let text = "no <link> of this name is defined; it is used without mass and shape".to_owned();
                self.robot.skipped.push(Skipped { owner: format!("link `{link}`"), place: joint.place, text });
                added.insert(link.clone(), UrdfLink::implied(link, joint.place));
            }
        }
        self.robot.links.extend(added.into_values());
        Ok(())
    }

    fn note_loose_links(&mut self) {
        let held: BTreeSet<&String> =
            self.robot.joints.iter().flat_map(|joint| [&joint.parent, &joint.child]).collect();
        let loose = self.robot.links.iter().filter(|link| !held.is_empty() && !held.contains(&link.name));
        let note = |link: &UrdfLink| Skipped {
            owner: format!("link `{}`", link.name),
            place: link.place,
            text: "no joint holds it: skipped".to_owned(),
        };
        let notes: Vec<Skipped> = loose.map(note).collect();
        self.robot.skipped.extend(notes);
    }

    /// Returns the links that no joint holds and that are the parent of a joint.
    pub fn roots(&self) -> impl Iterator<Item = &str> {
        let parents: BTreeSet<&str> = self.robot.joints.iter().map(|joint| joint.parent.as_str()).collect();
        let links = self.robot.links.iter().map(|link| link.name.as_str());
        links.filter(move |link| !self.joint_of_child.contains_key(*link) && parents.contains(link))
    }

    /// Returns the joint indices from `base` down to `tip`.
    ///
    /// # Errors
    /// [`RobotError::NoChain`] if `base` is not above `tip`, [`RobotError::Loop`] in a closed chain.
    pub fn path(&self, base: &str, tip: &str) -> Result<Vec<usize>, RobotError> {
        let no_chain = || RobotError::NoChain { file: self.file.clone(), from: base.to_owned(), to: tip.to_owned() };
        let mut path = Vec::new();
        let mut at = tip;
        while at != base {
            let &joint = self.joint_of_child.get(at).ok_or_else(no_chain)?;
            path.push(joint);
            at = &self.robot.joints[joint].parent;
        }
        path.reverse();
        self.check_open(&path)?;
        Ok(path)
    }

    /// Refuses a path through a link that two joints hold.
    fn check_open(&self, path: &[usize]) -> Result<(), RobotError> {
        for &joint in path {
            let link = &self.robot.joints[joint].child;
            if let Some(&closing) = self.closing.get(link) {
                let closing = &self.robot.joints[closing];
                return Err(RobotError::Loop {
                    file: self.file.clone(),
                    place: closing.place.to_string(),
                    link: link.clone(),
                    joint: closing.name.clone(),
                });
            }
        }
        Ok(())
    }

    /// Returns the chain of moving joints from `base` that carries every link named in `tips`.
    ///
    /// # Errors
    /// [`RobotError::NoChain`] if no single chain carries all tips, [`RobotError::JointKind`] for other joints, and for
    /// joints whose frame or axis is wrong.
    pub fn chain(&self, base: &str, tips: &[&str]) -> Result<Chain, RobotError> {
        let mut longest: Vec<usize> = Vec::new();
        for tip in tips {
            let path = self.path(base, tip)?;
            path.iter().try_for_each(|&idx| self.check_usable(&self.robot.joints[idx]))?;
            if self.moving(&path).count() > self.moving(&longest).count() || longest.is_empty() {
                longest = path;
            }
        }
        let mut joints = Vec::new();
        let mut pending = Isometry3::identity();
        for &idx in &longest {
            let joint = &self.robot.joints[idx];
            pending *= joint.origin.isometry();
            let kind = match joint.joint_type {
                JointType::Fixed => continue,
                JointType::Prismatic => JointKind::Prismatic,
                _ => JointKind::Revolute,
            };
            joints.push(ChainJoint {
                name: joint.name.clone(),
                child_link: joint.child.clone(),
                kind,
                parent_from_joint: pending,
                axis: Unit::new_normalize(Vector3::from(joint.axis)),
                limits: if let Range::Limits(limits) = joint.range { Some(limits) } else { None },
            });
            pending = Isometry3::identity();
        }
        if joints.is_empty() || joints.len() > MAX_JOINTS {
            let problem = format!(
                "{} moving joints between `{base}` and {tips:?}, 1 .. {MAX_JOINTS} allowed. Name other links as base, \
                 tool or camera",
                joints.len()
            );
            return Err(FileIssue::new(Code::UrdfStructure, &self.file, "joint", problem).into());
        }
        Ok(Chain::new(joints))
    }

    /// Refuses a joint of the chain that kinematics cannot use.
    fn check_usable(&self, joint: &UrdfJoint) -> Result<(), RobotError> {
        let (file, name) = (&self.file, &joint.name);
        if let Some(defect) = joint.defects.first() {
            let key = format!("{}: joint `{name}`: {}", defect.place, defect.key);
            return Err(FileIssue::new(Code::ValueInvalid, file, key, defect.problem.clone()).into());
        }
        if joint.is_fixed() {
            return Ok(());
        }
        let key = || format!("{}: joint `{name}`", joint.place);
        if let JointType::Other(kind) = &joint.joint_type {
            let (file, place) = (file.clone(), joint.place.to_string());
            return Err(RobotError::JointKind { file, place, joint: name.clone(), kind: kind.clone() });
        }
        if self.repeated.contains(name) {
            let problem = "is defined twice, so that its readings cannot be assigned. Rename one of the two";
            return Err(FileIssue::new(Code::ValueDuplicate, file, key(), problem).into());
        }
        if let Some(leader) = &joint.mimic {
            let problem = format!(
                "follows the joint `{leader}` (mimic), and calibration needs a sensor on each joint of the chain. If \
                 it has one, delete its <mimic>. Otherwise name a base behind it or a tool in front of it (--base, \
                 --tip)"
            );
            return Err(FileIssue::new(Code::UrdfStructure, file, key(), problem).into());
        }
        Ok(())
    }

    fn moving<'a>(&'a self, path: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
        path.iter().copied().filter(|&idx| !self.robot.joints[idx].is_fixed())
    }

    pub(super) fn has_link(&self, name: &str) -> bool {
        self.robot.links.iter().any(|link| link.name == name)
    }

    /// Adds mass and collision shapes; collision meshes if `meshes` are read.
    fn add_link(
        &self,
        body: &mut LinkBody,
        link: &UrdfLink,
        body_from_link: &Isometry3<f64>,
        meshes: Option<&MeshFolders>,
    ) -> Result<(), RobotError> {
        if let Some(inertial) = &link.inertial {
            if inertial.inertia_kg_m2.cholesky().is_none() {
                body.bad_inertia.get_or_insert_with(|| link.name.clone());
            }
            let body_from_com = body_from_link * inertial.origin.isometry();
            body.add_mass(inertial.mass_kg, &body_from_com, &inertial.inertia_kg_m2);
        }
        // Colour of a link's shapes, if the link has nothing else to show.
        let color_rgb = link.visual.iter().find_map(|visual| visual.color_rgb).unwrap_or(UNPAINTED_RGB);
        for collision in &link.collision {
            let shape = match (named_mesh(link, collision), meshes) {
                (None, _) => {
                    let Some(shape) = primitive(collision) else { continue };
                    placed(collision, shape.clone(), body_from_link, color_rgb)
                }
                (Some(mesh), Some(folders)) => {
                    let (shape, center_m) = folders.hull(&self.file, &mesh)?;
                    let mut placed = placed(collision, shape, body_from_link, color_rgb);
                    placed.owner_from_shape *= Translation3::from(center_m);
                    placed
                }
                (Some(_), None) => continue,
            };
            body.collisions.push(shape);
        }
        Ok(())
    }

    /// Adds the shapes to display; meshes are not shown.
    fn add_visuals(&self, body: &mut LinkBody, link: &UrdfLink, body_from_link: &Isometry3<f64>) {
        for visual in &link.visual {
            let Some(shape) = primitive(visual) else { continue };
            let color_rgb = visual.color_rgb.unwrap_or(UNPAINTED_RGB);
            body.visuals.push(placed(visual, shape.clone(), body_from_link, color_rgb));
        }
    }
}

impl UrdfChain<'_> {
    /// Returns the pose of the frame of `link` on the chain.
    ///
    /// # Errors
    /// [`RobotError::NoChain`] if the chain does not carry the link.
    pub fn attachment(&self, link: &str) -> Result<Attachment, RobotError> {
        let mut n_joints = 0;
        let mut link_from_frame = Isometry3::identity();
        for idx in self.urdf.path(self.base_link, link)? {
            let joint = &self.urdf.robot.joints[idx];
            if joint.is_fixed() {
                self.urdf.check_usable(joint)?;
                link_from_frame *= joint.origin.isometry();
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

    /// Returns all links that the chain carries, by name.
    pub fn attachments(&self) -> BTreeMap<String, Attachment> {
        let links = self.urdf.robot.links.iter();
        links.filter_map(|link| Some((link.name.clone(), self.attachment(&link.name).ok()?))).collect()
    }

    /// Returns the visual shapes of the link `name`, in the frame of the chain's link that carries it.
    ///
    /// # Errors
    /// [`RobotError`] for a link that the chain does not carry, or for invalid shapes.
    pub fn visuals_of(&self, name: &str) -> Result<Vec<PlacedShape>, RobotError> {
        let attachment = self.attachment(name)?;
        let mut body = LinkBody::empty(name.to_owned());
        for link in self.urdf.robot.links.iter().filter(|link| link.name == name) {
            self.urdf.add_visuals(&mut body, link, &attachment.link_from_frame);
        }
        Ok(body.visuals)
    }

    /// Returns the bodies 0..=n: the base with everything fixed to it, then one per joint of the chain. The links in
    /// `apart` move by themselves; their visual shapes are omitted. Collision meshes are left out if `meshes` is
    /// `None`. All collision shapes are left out if more of them need no file than planning can take.
    ///
    /// # Errors
    /// [`RobotError::Value`] for invalid numbers, shapes or meshes; all meshes without a file at once.
    pub fn bodies(&self, apart: &[String], meshes: Option<&MeshFolders>) -> Result<Vec<LinkBody>, RobotError> {
        let mut names = vec![self.base_link.to_owned()];
        names.extend(self.chain.joints().iter().map(|j| j.child_link.clone()));
        let mut bodies: Vec<LinkBody> = names.into_iter().map(LinkBody::empty).collect();
        if let Some(folders) = meshes {
            self.check_collisions(folders)?;
        }
        let has_room = self.n_primitives() <= MAX_COLLISION_SHAPES;
        for link in &self.urdf.robot.links {
            let Ok(attachment) = self.attachment(&link.name) else { continue };
            let body = &mut bodies[attachment.n_joints];
            self.urdf.add_link(body, link, &attachment.link_from_frame, meshes)?;
            if !apart.contains(&link.name) {
                self.urdf.add_visuals(body, link, &attachment.link_from_frame);
            }
        }
        if !has_room {
            bodies.iter_mut().for_each(|body| body.collisions.clear());
        }
        Ok(bodies)
    }

    /// Returns the number of shapes on the chain that need no file.
    pub fn n_primitives(&self) -> usize {
        self.links().flat_map(|link| &link.collision).filter(|element| primitive(element).is_some()).count()
    }

    /// Checks, before any mesh is read, the number of shapes and the presence of the meshes.
    fn check_collisions(&self, folders: &MeshFolders) -> Result<(), RobotError> {
        let named = self.collision_meshes();
        let n_shapes = self.n_primitives() + named.len();
        if n_shapes > MAX_COLLISION_SHAPES {
            let problem = format!(
                "{n_shapes} shapes on the chain, 0 .. {MAX_COLLISION_SHAPES} allowed. Or write collision_meshes = \
                 \"ignore\" in robot.toml: then paths cannot be planned"
            );
            return Err(FileIssue::new(Code::MeshUnusable, &self.urdf.file, "collision", problem).into());
        }
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

    /// Returns the links that the chain carries.
    pub fn links(&self) -> impl Iterator<Item = &UrdfLink> {
        self.urdf.robot.links.iter().filter(|link| self.attachment(&link.name).is_ok())
    }

    /// Returns the collision meshes of the chain's links.
    pub fn collision_meshes(&self) -> Vec<NamedMesh<'_>> {
        let mut named = Vec::new();
        for link in self.links() {
            named.extend(link.collision.iter().filter_map(|collision| named_mesh(link, collision)));
        }
        named
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parses links one below the other, or all below the first.
    fn parsed(n: usize, parent: impl Fn(usize) -> usize) -> Result<UrdfModel, RobotError> {
        let link = |k: usize| format!("<link name=\"l{k}\"/>");
        let joint = |k: usize| {
            let parent = parent(k);
            format!("<joint name=\"j{k}\" type=\"fixed\"><parent link=\"l{parent}\"/><child link=\"l{k}\"/></joint>")
        };
        let joints: String = (1..=n).map(joint).collect();
        let text = format!("<robot name=\"a\">{}{joints}</robot>", (0..=n).map(link).collect::<String>());
        UrdfModel::parse(Path::new("a.urdf"), text)
    }

    #[test]
    fn many_joints_and_long_chains_are_refused_before_they_are_compared() {
        assert!(parsed(MAX_JOINTS_UP, |k| k - 1).is_ok());
        assert!(parsed(MAX_URDF_JOINTS, |_| 0).is_ok());
        let told = [
            parsed(MAX_JOINTS_UP + 1, |k| k - 1),
            parsed(MAX_URDF_JOINTS + 1, |_| 0),
            parsed(MAX_URDF_JOINTS, |k| 1 + k % MAX_URDF_JOINTS),
        ];
        let told = told.map(|found| found.expect_err("refused").to_string());
        insta::assert_snapshot!("many_joints", told.join("\n"));
    }
}
