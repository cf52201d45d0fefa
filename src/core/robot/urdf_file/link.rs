//! Links of a URDF: mass and shapes, which calibration does not need.

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::scan::{Scan, UrdfPose};
use crate::robot::shape::Shape;
use crate::robot::xml_tree::Place;

/// Smallest mass, kg: files write less for a link without mass, and rounding would dominate its inertia.
const MIN_MASS_KG: f64 = 1e-6;
/// Largest mass, kg.
const MAX_MASS_KG: f64 = 1e6;
/// Smallest and largest length of a shape, m.
const SHAPE_LENGTHS_M: std::ops::RangeInclusive<f64> = 1e-6..=1e4;
/// Known elements of a link; the last four belong to simulators.
const KNOWN: [&str; 7] = ["inertial", "visual", "collision", "contact", "sensor", "gazebo", "self_collision_checking"];
/// Known elements of a visual or a collision shape.
const KNOWN_OF_SHAPE: [&str; 4] = ["origin", "geometry", "material", "verbose"];

/// Colours of materials that are defined once for the file.
pub(super) type NamedColors = BTreeMap<String, [u8; 3]>;

/// Mass of a link.
#[derive(Clone, Debug)]
pub struct Inertial {
    pub mass_kg: f64,
    pub origin: UrdfPose,
    pub inertia_kg_m2: Matrix3<f64>,
}

/// A shape that needs no file, or the name of a mesh.
#[derive(Clone, Debug)]
pub enum UrdfShape {
    Primitive(Shape),
    Mesh { name: String, scale: [f64; 3] },
}

/// A visual or collision shape of a link.
#[derive(Clone, Debug)]
pub struct ShapeElement {
    pub origin: UrdfPose,
    pub shape: UrdfShape,
    pub color_rgb: Option<[u8; 3]>,
}

/// A link.
#[derive(Clone, Debug)]
pub struct UrdfLink {
    pub name: String,
    pub place: Place,
    /// Mass; `None` if the file states none or an unusable one.
    pub inertial: Option<Inertial>,
    pub visual: Vec<ShapeElement>,
    pub collision: Vec<ShapeElement>,
    /// Reason why a collision shape that may have a volume was skipped.
    pub lost: Option<String>,
}

/// A shape that was not read.
struct Unusable {
    problem: String,
    /// True for a point or an empty shape, from which no clearance is needed.
    is_empty: bool,
}

impl From<String> for Unusable {
    fn from(problem: String) -> Self {
        Self { problem, is_empty: false }
    }
}

/// Reads the materials of the file.
pub(super) fn named_colors(scan: &mut Scan<'_>) -> NamedColors {
    let mut colors = NamedColors::new();
    for at in scan.children(0).filter(|&at| scan.element(at).name == "material").collect::<Vec<_>>() {
        let name = scan.element(at).attribute("name").unwrap_or_default().to_owned();
        if let Some(color) = color(scan, &format!("material `{name}`"), at) {
            colors.entry(name).or_insert(color);
        }
    }
    colors
}

/// Reads one `<link>`.
pub(super) fn read_link(scan: &mut Scan<'_>, at: usize, name: String, colors: &NamedColors) -> UrdfLink {
    let owner = format!("link `{name}`");
    scan.skip_unknown(&owner, at, &KNOWN);
    let inertial = scan.only(&owner, at, "inertial");
    let inertial = inertial.and_then(|at| {
        inertial_of(scan, &owner, at).unwrap_or_else(|problem| {
            scan.skip(&owner, at, format!("{problem}; its mass is left out"));
            None
        })
    });
    let mut link = UrdfLink { inertial, ..UrdfLink::implied(&name, scan.element(at).place) };
    for child in scan.children(at) {
        let kind = scan.element(child).name.as_str();
        if kind != "visual" && kind != "collision" {
            continue;
        }
        match shapes(scan, &owner, child, colors) {
            Ok(shapes) if kind == "visual" => link.visual.extend(shapes),
            Ok(shapes) => link.collision.extend(shapes),
            Err(Unusable { problem, is_empty }) => {
                scan.skip(&owner, child, format!("{problem}; this {kind} shape is left out"));
                if kind == "collision" && !is_empty {
                    link.lost.get_or_insert(problem);
                }
            }
        }
    }
    link
}

fn inertial_of(scan: &mut Scan<'_>, owner: &str, at: usize) -> Result<Option<Inertial>, String> {
    let Some(mass) = scan.only(owner, at, "mass") else { return Err("the inertial has no mass".to_owned()) };
    let mass_kg = scan.number(mass, "value").map_err(|problem| format!("the mass's {problem}"))?;
    let mass_kg = mass_kg.ok_or("the mass has no value")?;
    if mass_kg == 0.0 {
        return Ok(None);
    }
    if !(MIN_MASS_KG..=MAX_MASS_KG).contains(&mass_kg) {
        return Err(format!("mass of {mass_kg:?} kg is outside {MIN_MASS_KG:e} to {MAX_MASS_KG:e} kg"));
    }
    let origin = scan.only(owner, at, "origin").map(|origin| scan.pose(origin)).transpose();
    let origin = origin.map_err(|problem| format!("the inertial's {problem}"))?.unwrap_or_default();
    let mut inertia_kg_m2 = Matrix3::zeros();
    if let Some(inertia) = scan.only(owner, at, "inertia") {
        for (row, column, key) in
            [(0, 0, "ixx"), (0, 1, "ixy"), (0, 2, "ixz"), (1, 1, "iyy"), (1, 2, "iyz"), (2, 2, "izz")]
        {
            let problem = match scan.number(inertia, key) {
                Ok(value) if value.is_none_or(f64::is_finite) => {
                    let value = value.unwrap_or(0.0);
                    inertia_kg_m2[(row, column)] = value;
                    inertia_kg_m2[(column, row)] = value;
                    continue;
                }
                Ok(_) => format!("the inertia's {key} is not finite"),
                Err(problem) => format!("the inertia's {problem}"),
            };
            scan.skip(owner, inertia, format!("{problem}; the inertia is left out"));
            inertia_kg_m2 = Matrix3::zeros();
            break;
        }
    }
    Ok(Some(Inertial { mass_kg, origin, inertia_kg_m2 }))
}

/// Returns the shapes of one `<visual>` or `<collision>`: usually one, or one for each of several geometries in the
/// same element.
fn shapes(scan: &mut Scan<'_>, owner: &str, at: usize, colors: &NamedColors) -> Result<Vec<ShapeElement>, Unusable> {
    scan.skip_unknown(owner, at, &KNOWN_OF_SHAPE);
    let origin = scan.only(owner, at, "origin").map(|origin| scan.pose(origin)).transpose();
    let origin = origin.map_err(|problem| format!("the origin's {problem}"))?.unwrap_or_default();
    let material = scan.only(owner, at, "material");
    let color_rgb = material.and_then(|material| {
        let own = color(scan, owner, material);
        own.or_else(|| colors.get(scan.element(material).attribute("name")?).copied())
    });
    let geometry = scan.only(owner, at, "geometry");
    let geometry = geometry.ok_or_else(|| Unusable { problem: "there is no geometry".to_owned(), is_empty: true })?;
    let mut shapes = Vec::new();
    for child in scan.children(geometry) {
        let shape = shape(scan, child)?;
        shapes.push(ShapeElement { origin, shape, color_rgb });
    }
    if shapes.is_empty() {
        return Err(Unusable { problem: "the geometry is empty".to_owned(), is_empty: true });
    }
    if shapes.len() > 1 {
        scan.skip(owner, geometry, format!("the geometry has {} shapes; all are used", shapes.len()));
    }
    Ok(shapes)
}

fn shape(scan: &Scan<'_>, at: usize) -> Result<UrdfShape, Unusable> {
    let name = scan.element(at).name.as_str();
    let length = |key: &str| -> Result<f64, Unusable> {
        let value = scan.number(at, key).map_err(|problem| format!("{name}: {problem}"))?;
        Ok(value.ok_or_else(|| format!("{name}: {key} is missing"))?)
    };
    let shape = match name {
        "box" => {
            let size_m = scan.numbers::<3>(at, "size").map_err(|problem| format!("box: {problem}"))?;
            Shape::Box { size_m: size_m.ok_or_else(|| "box: size is missing".to_owned())? }
        }
        "cylinder" => Shape::Cylinder { radius_m: length("radius")?, length_m: length("length")? },
        "capsule" => Shape::Capsule { radius_m: length("radius")?, length_m: length("length")? },
        "sphere" => Shape::Sphere { radius_m: length("radius")? },
        "mesh" => return mesh(scan, at),
        other => return Err(format!("the geometry `{other}` is not part of URDF").into()),
    };
    let lengths = shape.lengths();
    if let Some((key, value)) = lengths.iter().find(|(_, value)| !SHAPE_LENGTHS_M.contains(value)) {
        let (least, most) = (SHAPE_LENGTHS_M.start(), SHAPE_LENGTHS_M.end());
        let problem = format!("{name}: {key} of {value} is outside {least:e} to {most} m");
        return Err(Unusable { problem, is_empty: lengths.iter().all(|(_, value)| *value == 0.0) });
    }
    Ok(UrdfShape::Primitive(shape))
}

fn mesh(scan: &Scan<'_>, at: usize) -> Result<UrdfShape, Unusable> {
    let name = scan.element(at).attribute("filename").unwrap_or_default().to_owned();
    if name.is_empty() {
        return Err(Unusable { problem: "the mesh names no file".to_owned(), is_empty: true });
    }
    let scale = match scan.numbers::<1>(at, "scale") {
        Ok(Some([scale])) => [scale; 3],
        Ok(None) => [1.0; 3],
        Err(_) => {
            let scale = scan.numbers::<3>(at, "scale").map_err(|problem| format!("mesh `{name}`: {problem}"))?;
            scale.unwrap_or([1.0; 3])
        }
    };
    if let Some(value) = scale.iter().find(|value| !(value.is_finite() && **value != 0.0)) {
        let problem = format!("mesh `{name}`: scale of {value} leaves no volume");
        return Err(Unusable { problem, is_empty: scale.iter().all(|value| *value == 0.0) });
    }
    Ok(UrdfShape::Mesh { name, scale })
}

/// Returns the colour of a material; `None` if it has none or an unreadable one.
fn color(scan: &mut Scan<'_>, owner: &str, material: usize) -> Option<[u8; 3]> {
    let at = scan.children(material).find(|&at| scan.element(at).name == "color")?;
    let four = scan.numbers::<4>(at, "rgba").map(|rgba| rgba.map(|[r, g, b, _]| [r, g, b]));
    let rgb = four.or_else(|problem| scan.numbers::<3>(at, "rgba").map_err(|_| problem));
    match rgb {
        Ok(rgb) => rgb.map(|rgb| rgb.map(|part| (part.clamp(0.0, 1.0) * 255.0).round() as u8)),
        Err(problem) => {
            scan.skip(owner, at, format!("the colour's {problem}; grey is used"));
            None
        }
    }
}
