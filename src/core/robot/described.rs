//! The arm and its surroundings as one URDF, for viewers: the vehicle and the tags as further links.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Translation3};
use quick_xml::escape::escape;

use crate::optics::TagFamily;

use super::frame_tree::{FixedFrame, FrameTree};
use super::nominal::Robot;
use super::shape::{PlacedShape, Shape};
use super::vehicle::Vehicle;

/// Name of the vehicle's frame.
const VEHICLE: &str = "vehicle";
/// Thickness of a drawn tag, m: its face is at the tag's frame.
const TAG_THICKNESS_M: f64 = 0.004;
/// Colour of a drawn tag.
const TAG_RGB: [u8; 3] = [245, 245, 235];

/// Geometry that a viewer draws of an arm and its surroundings, as the estimator knows them.
#[derive(Clone, Debug)]
pub struct Described {
    /// URDF of the robot with links for vehicle and tags, except those whose name a link of the arm has.
    pub urdf: String,
    /// Frames that never move: the arm's mount on the vehicle, fixed links, tags.
    pub fixed: Vec<FixedFrame>,
}

/// Returns the name of a tag's frame by its family and id, such as tag36h11:7.
#[must_use]
pub fn tag_frame_name(family: TagFamily, id: u32) -> String {
    format!("{}:{id}", family.long_name())
}

impl Described {
    /// Describes an arm on a vehicle, with the surveyed tags whose poses the arm is given.
    #[must_use]
    pub fn new(robot: &Robot, vehicle: &Vehicle, tree: &FrameTree) -> Self {
        let names = tree.names();
        let mut fixed = Vec::new();
        let mut added = String::new();
        if !names.contains(VEHICLE) {
            let shapes: Vec<&PlacedShape> = vehicle.parts.iter().map(|part| &part.placed).collect();
            add_link(&mut added, VEHICLE, &shapes);
            let parent_from_child = vehicle.vehicle_from_base.isometry() * tree.base_from_root;
            fixed.push(FixedFrame { parent: VEHICLE.to_owned(), child: tree.root.clone(), parent_from_child });
        }
        // Finds the link that carries the tags: its frame is that of the tags.
        let fixed_to =
            || robot.links.iter().find(|(_, place)| **place == robot.tag_frame).map(|(name, _)| name.as_str());
        let carrier = robot.tag_link().or_else(fixed_to);
        for tag in robot.tags.iter().filter(|tag| tag.is_known()) {
            let (name, Some(carrier)) = (tag_frame_name(robot.tag_family, tag.id), carrier) else { continue };
            if names.contains(name.as_str()) {
                continue;
            }
            let size_m = if tag.size_m.is_finite() { tag.size_m } else { 0.05 };
            let plate = PlacedShape {
                owner_from_shape: Isometry3::from(Translation3::new(0.0, 0.0, -0.5 * TAG_THICKNESS_M)),
                shape: Shape::Box { size_m: [size_m, size_m, TAG_THICKNESS_M] },
                color_rgb: TAG_RGB,
            };
            add_link(&mut added, &name, &[&plate]);
            let parent_from_child = *tag.base_from_tag.isometry();
            fixed.push(FixedFrame { parent: carrier.to_owned(), child: name, parent_from_child });
        }
        for (number, frame) in fixed.iter().enumerate() {
            add_joint(&mut added, number, frame);
        }
        let mut urdf = robot.urdf_text.clone();
        if let Some(end) = urdf.rfind("</robot>") {
            urdf.insert_str(end, &added);
        }
        fixed.extend(tree.fixed.iter().cloned());
        Self { urdf, fixed }
    }
}

fn add_link(text: &mut String, name: &str, shapes: &[&PlacedShape]) {
    let _ = writeln!(text, "  <link name=\"{}\">", escape(name));
    for (number, placed) in shapes.iter().enumerate() {
        let geometry = match placed.shape {
            Shape::Box { size_m: [x, y, z] } => format!("<box size=\"{x} {y} {z}\"/>"),
            Shape::Cylinder { radius_m, length_m } | Shape::Capsule { radius_m, length_m } => {
                format!("<cylinder radius=\"{radius_m}\" length=\"{length_m}\"/>")
            }
            Shape::Sphere { radius_m } => format!("<sphere radius=\"{radius_m}\"/>"),
            // A URDF refers to meshes only as files.
            Shape::Hull(_) => continue,
        };
        let [r, g, b] = placed.color_rgb.map(|part| f64::from(part) / 255.0);
        let material = format!("{} {number}", escape(name));
        let _ = writeln!(
            text,
            "    <visual>{}<geometry>{geometry}</geometry><material name=\"{material}\"><color rgba=\"{r:.3} {g:.3} \
             {b:.3} 1\"/></material></visual>",
            origin(&placed.owner_from_shape),
        );
    }
    text.push_str("  </link>\n");
}

fn add_joint(text: &mut String, number: usize, frame: &FixedFrame) {
    let (parent, child) = (escape(frame.parent.as_str()), escape(frame.child.as_str()));
    let _ = writeln!(
        text,
        "  <joint name=\"armcal_fixed_{number}\" type=\"fixed\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{}\
         </joint>",
        origin(&frame.parent_from_child),
    );
}

fn origin(pose: &Isometry3<f64>) -> String {
    let ([x, y, z], (roll, pitch, yaw)) = (pose.translation.vector.into(), pose.rotation.euler_angles());
    format!("<origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>")
}
