//! Primitives and poses in Rerun's terms.

use crate::rerun::{Boxes3D, Capsules3D, Cylinders3D, Ellipsoids3D, FillMode, Mesh3D};
use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use crate::colors::Rgba;
use crate::entity_log::EntityLog;
use crate::poses::{quaternion, vector};
use armcal_core::robot::{Hull, PlacedShape, Shape};

/// Style of a body.
#[derive(Clone, Copy)]
pub(super) enum Look {
    /// Colours of its nominal model.
    Drawn,
    /// Transparent, in one colour.
    Ghost(Rgba),
}

/// Batch of shapes of one kind.
#[derive(Default)]
struct Batch {
    sizes: Vec<[f32; 3]>,
    places: Vec<Isometry3<f64>>,
    colors: Vec<Rgba>,
}

impl Batch {
    fn push(&mut self, size: [f64; 3], place: Isometry3<f64>, color: Rgba) {
        self.sizes.push(size.map(|v| v as f32));
        self.places.push(place);
        self.colors.push(color);
    }

    fn centers(&self) -> Vec<[f32; 3]> {
        self.places.iter().map(|place| vector(&place.translation.vector)).collect()
    }

    fn turns(&self) -> Vec<crate::rerun::Quaternion> {
        self.places.iter().map(|place| quaternion(&place.rotation)).collect()
    }

    fn lengths(&self) -> Vec<f32> {
        self.sizes.iter().map(|size| size[2]).collect()
    }

    fn radii(&self) -> Vec<f32> {
        self.sizes.iter().map(|size| size[0]).collect()
    }
}

/// Draws shapes, fixed in the frame of `entity`, under it.
pub(super) fn log_shapes<'a>(
    stream: &mut EntityLog,
    entity: &str,
    shapes: impl IntoIterator<Item = &'a PlacedShape>,
    look: Look,
) {
    let [mut boxes, mut cylinders, mut capsules, mut balls] = [(); 4].map(|()| Batch::default());
    let mut n_hulls = 0;
    for placed in shapes {
        let [r, g, b] = placed.color_rgb;
        let color = match look {
            Look::Drawn => [r, g, b, 255],
            Look::Ghost(color) => color,
        };
        let place = placed.owner_from_shape;
        match placed.shape {
            Shape::Hull(ref hull) => {
                let part = format!("{entity}/hulls/{n_hulls}");
                if !stream.is_shown(&part) {
                    stream.log_static(&part, &mesh(hull, &place, color));
                }
                n_hulls += 1;
            }
            Shape::Box { size_m } => boxes.push(size_m.map(|v| 0.5 * v), place, color),
            Shape::Cylinder { radius_m, length_m } => cylinders.push([radius_m, radius_m, length_m], place, color),
            Shape::Capsule { radius_m, length_m } => {
                // Rerun's capsule begins at its origin; ours is centred there.
                let begin = place * Translation3::new(0.0, 0.0, -0.5 * length_m);
                capsules.push([radius_m, radius_m, length_m], begin, color);
            }
            Shape::Sphere { radius_m } => balls.push([radius_m; 3], place, color),
        }
    }
    let fill = match look {
        Look::Drawn => FillMode::Solid,
        Look::Ghost(_) => FillMode::TransparentFillMajorWireframe,
    };
    if !boxes.sizes.is_empty() {
        let shown = Boxes3D::from_centers_and_half_sizes(boxes.centers(), boxes.sizes.iter().copied());
        let shown = shown.with_quaternions(boxes.turns()).with_colors(boxes.colors).with_fill_mode(fill);
        stream.log_static(&format!("{entity}/boxes"), &shown);
    }
    if !cylinders.sizes.is_empty() {
        let shown = Cylinders3D::from_lengths_and_radii(cylinders.lengths(), cylinders.radii());
        let shown = shown.with_centers(cylinders.centers()).with_quaternions(cylinders.turns());
        stream.log_static(&format!("{entity}/cylinders"), &shown.with_colors(cylinders.colors).with_fill_mode(fill));
    }
    if !capsules.sizes.is_empty() {
        let shown = Capsules3D::from_lengths_and_radii(capsules.lengths(), capsules.radii());
        let shown = shown.with_translations(capsules.centers()).with_quaternions(capsules.turns());
        stream.log_static(&format!("{entity}/capsules"), &shown.with_colors(capsules.colors).with_fill_mode(fill));
    }
    if !balls.sizes.is_empty() {
        let shown = Ellipsoids3D::from_centers_and_radii(balls.centers(), balls.radii());
        stream.log_static(&format!("{entity}/balls"), &shown.with_colors(balls.colors).with_fill_mode(fill));
    }
}

/// Returns a hull as a mesh in its owner's frame. Each triangle has its own corners, so that edges are sharp.
fn mesh(hull: &Hull, place: &Isometry3<f64>, color: Rgba) -> Mesh3D {
    let (mut corners, mut normals) = (Vec::new(), Vec::new());
    for triangle in hull.triangles() {
        let at = triangle.map(|k| place * Point3::from(hull.corners_m()[k as usize]));
        let normal = (at[1] - at[0]).cross(&(at[2] - at[0])).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        corners.extend(at.map(|point| vector(&point.coords)));
        normals.extend([vector(&normal); 3]);
    }
    let n = corners.len() as u32;
    let triangles = (0..n / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]);
    let [r, g, b, a] = color;
    let color = crate::rerun::Rgba32::from_unmultiplied_rgba(r, g, b, a);
    Mesh3D::new(corners).with_vertex_normals(normals).with_triangle_indices(triangles).with_albedo_factor(color)
}

/// Returns a name as one part of an entity's path.
pub(super) fn path_part(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' || c == '-' { c } else { '_' }).collect()
}
