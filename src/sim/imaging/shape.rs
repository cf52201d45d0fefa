//! Intersection of rays with convex shapes, several at a time. A shape around the camera is invisible.

use crate::imaging::math::{Lanes, Vec3, lanes, max, min};
use crate::imaging::tag_board::{self, Board};
use armcal_core::robot::Shape;

/// Number of low bits that hold the face; the others hold the object's number plus one, and 0 is open water.
pub(super) const FACE_BITS: u32 = 3;

/// Form of an object in its own frame; lengths in m.
#[derive(Clone, Debug)]
pub(super) enum Form {
    Tag(Board),
    Box {
        half: [f32; 3],
    },
    /// Cylinder along z.
    Cylinder {
        radius: f32,
        half: f32,
    },
    Capsule {
        radius: f32,
        half: f32,
    },
    Sphere {
        radius: f32,
    },
    /// Hull by its outer normals and their distances from the origin.
    Hull {
        planes: Vec<[f32; 4]>,
        radius: f32,
    },
}

/// Pose of an object in the camera's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Rows of `object_from_camera`'s rotation.
    rows: [[f32; 3]; 3],
    /// Position of the eye in the object's frame, m.
    eye: [f32; 3],
}

impl Place {
    pub(super) fn new(object_from_camera: &nalgebra::Isometry3<f64>) -> Self {
        let rotation = object_from_camera.rotation.to_rotation_matrix();
        Self {
            rows: std::array::from_fn(|i| std::array::from_fn(|j| rotation[(i, j)] as f32)),
            eye: object_from_camera.translation.vector.cast().into(),
        }
    }

    #[inline]
    fn turn<const N: usize>(&self, rays: &Lanes<N>) -> Lanes<N> {
        std::array::from_fn(|i| {
            let [a, b, c] = self.rows[i];
            std::array::from_fn(|k| a * rays[0][k] + b * rays[1][k] + c * rays[2][k])
        })
    }

    /// Returns the points on rays, object frame.
    #[inline]
    pub(super) fn points<const N: usize>(&self, rays: &Lanes<N>, range_m: &[f32; N]) -> Lanes<N> {
        let mut points = self.turn(rays);
        for (points, eye) in points.iter_mut().zip(self.eye) {
            for k in 0..N {
                points[k] = eye + range_m[k] * points[k];
            }
        }
        points
    }

    /// Returns the intersection of a ray with the plane z = 0, x and y in the object's frame, m.
    #[inline]
    pub(super) fn on_plane(&self, ray: [f32; 3]) -> [f32; 2] {
        let d = self.turn(&ray.map(|v| [v]));
        let range = -self.eye[2] / d[2][0];
        [self.eye[0] + range * d[0][0], self.eye[1] + range * d[1][0]]
    }

    /// Turns a vector from object to camera axes.
    #[inline]
    pub(super) fn back(&self, v: &Vec3) -> Vec3 {
        Vec3::from_fn(|j, _| (0..3).map(|i| self.rows[i][j] * v[i]).sum())
    }
}

impl Form {
    pub(super) fn of_shape(shape: &Shape) -> Self {
        match shape {
            Shape::Box { size_m } => Self::Box { half: size_m.map(|s| (0.5 * s) as f32) },
            Shape::Cylinder { radius_m, length_m } => {
                Self::Cylinder { radius: *radius_m as f32, half: (0.5 * length_m) as f32 }
            }
            Shape::Capsule { radius_m, length_m } => {
                Self::Capsule { radius: *radius_m as f32, half: (0.5 * length_m) as f32 }
            }
            Shape::Sphere { radius_m } => Self::Sphere { radius: *radius_m as f32 },
            Shape::Hull(hull) => {
                let corner = |i: u32| nalgebra::Vector3::from(hull.corners_m()[i as usize]);
                let planes = hull.triangles().iter().filter_map(|&[a, b, c]| {
                    let normal = (corner(b) - corner(a)).cross(&(corner(c) - corner(a))).try_normalize(1e-18)?;
                    Some([normal.x, normal.y, normal.z, normal.dot(&corner(a))].map(|v| v as f32))
                });
                Self::Hull { planes: planes.collect(), radius: hull.radius_m() as f32 }
            }
        }
    }

    /// Returns the ranges at which rays enter, m; infinite for rays that miss. A tag's range is reduced, because it is
    /// glued to a surface.
    #[inline]
    pub(super) fn enter<const N: usize>(&self, place: &Place, rays: &Lanes<N>) -> [f32; N] {
        let d = place.turn(rays);
        let e = &place.eye;
        match self {
            Self::Tag(board) => enter_board(board.half_m, e, &d),
            Self::Box { half } => enter_box(half, e, &d),
            Self::Cylinder { radius, half } => enter_cylinder(*radius, *half, e, &d),
            Self::Capsule { radius, half } => enter_capsule(*radius, *half, e, &d),
            Self::Sphere { radius } => enter_sphere(*radius, e, &d),
            Self::Hull { planes, .. } => enter_hull(planes, e, &d),
        }
    }

    /// Returns the faces and true ranges at the intersections; the `range_m` of a tag is reduced.
    #[inline]
    pub(super) fn faces<const N: usize>(
        &self,
        place: &Place,
        rays: &Lanes<N>,
        range_m: &[f32; N],
    ) -> ([u16; N], [f32; N]) {
        let Self::Tag(board) = self else {
            let parts = self.parts(&place.points(rays, range_m));
            return (parts.map(face_of), *range_m);
        };
        let d = place.turn(rays);
        let true_m: [f32; N] = std::array::from_fn(|k| -place.eye[2] / d[2][k]);
        let mut faces = [tag_board::FACE_BACK; N];
        if place.eye[2] > 0.0 {
            for (k, face) in faces.iter_mut().enumerate() {
                *face = board.face(place.eye[0] + true_m[k] * d[0][k], place.eye[1] + true_m[k] * d[1][k]);
            }
        }
        (faces, true_m)
    }

    /// Returns true if each face has one normal.
    #[inline]
    pub(super) fn is_flat(&self) -> bool {
        matches!(self, Self::Tag(_) | Self::Box { .. })
    }

    /// Returns the surface where a ray enters at `range_m`: true range, face and outer normal (camera frame).
    pub(super) fn meet(&self, place: &Place, ray: &Vec3, range_m: f32) -> (f32, u16, Vec3) {
        let rays = lanes(&[*ray]);
        if matches!(self, Self::Tag(_)) {
            let ([face], [range_m]) = self.faces(place, &rays, &[range_m]);
            let towards = if place.eye[2] > 0.0 { 1.0 } else { -1.0 };
            return (range_m, face, Vec3::from(place.rows[2]) * towards);
        }
        let points = place.points(&rays, &[range_m]);
        let [part] = self.parts(&points);
        let normal = self.normal(part, &Vec3::from(points.map(|[axis]| axis)));
        (range_m, face_of(part), place.back(&normal))
    }

    /// Returns the part of the surface on which points are: a box's axis, a cylinder's side (0) or ends (1), a hull's
    /// plane.
    #[inline]
    fn parts<const N: usize>(&self, p: &Lanes<N>) -> [u16; N] {
        let mut parts = [0; N];
        match self {
            Self::Tag(_) | Self::Capsule { .. } | Self::Sphere { .. } => {}
            Self::Box { half } => {
                for k in 0..N {
                    let excess: [f32; 3] = std::array::from_fn(|i| p[i][k].abs() - half[i]);
                    let (best, most) = if excess[1] > excess[0] { (1, excess[1]) } else { (0, excess[0]) };
                    parts[k] = if excess[2] > most { 2 } else { best };
                }
            }
            Self::Cylinder { radius, half } => {
                for k in 0..N {
                    parts[k] = u16::from(p[2][k].abs() - half > p[0][k].hypot(p[1][k]) - radius);
                }
            }
            Self::Hull { planes, .. } => {
                let mut most = [f32::NEG_INFINITY; N];
                for (n, [a, b, c, d]) in planes.iter().enumerate() {
                    for k in 0..N {
                        let out = a * p[0][k] + b * p[1][k] + c * p[2][k] - d;
                        if out > most[k] {
                            (most[k], parts[k]) = (out, n as u16);
                        }
                    }
                }
            }
        }
        parts
    }

    /// Returns the outer normal of a part at one of its points, own frame.
    fn normal(&self, part: u16, p: &Vec3) -> Vec3 {
        match self {
            Self::Tag(_) => Vec3::z(),
            Self::Box { .. } => {
                let axis = usize::from(part);
                let mut normal = Vec3::zeros();
                normal[axis] = p[axis].signum();
                normal
            }
            Self::Cylinder { .. } if part == 1 => Vec3::new(0.0, 0.0, p.z.signum()),
            Self::Cylinder { .. } => Vec3::new(p.x, p.y, 0.0) / p.x.hypot(p.y).max(1e-9),
            Self::Capsule { half, .. } => {
                let from_axis = Vec3::new(p.x, p.y, p.z - p.z.clamp(-half, *half));
                from_axis / from_axis.norm().max(1e-9)
            }
            Self::Sphere { .. } => p / p.norm().max(1e-9),
            Self::Hull { planes, .. } => {
                let [a, b, c, _] = planes[usize::from(part)];
                Vec3::new(a, b, c)
            }
        }
    }
}

/// Returns a part's face: with few bits, neighbours seldom share one.
#[inline]
fn face_of(part: u16) -> u16 {
    part % (1 << FACE_BITS)
}

#[inline]
fn enter_board<const N: usize>(half: f32, e: &[f32; 3], d: &Lanes<N>) -> [f32; N] {
    let lift = if e[2] > 0.0 { tag_board::CLEAR_OF_BACKING_M } else { 0.0 };
    std::array::from_fn(|k| {
        let inverse = 1.0 / d[2][k];
        let range = -e[2] * inverse;
        let (x, y) = (e[0] + range * d[0][k], e[1] + range * d[1][k]);
        let is_on = range > 0.0 && x.abs() <= half && y.abs() <= half;
        let nearer = range - lift * inverse.abs();
        if is_on { max(nearer, 1e-6) } else { f32::INFINITY }
    })
}

#[inline]
fn enter_box<const N: usize>(half: &[f32; 3], e: &[f32; 3], d: &Lanes<N>) -> [f32; N] {
    std::array::from_fn(|k| {
        let (mut near, mut far) = (f32::NEG_INFINITY, f32::INFINITY);
        for i in 0..3 {
            let inverse = 1.0 / d[i][k];
            let (a, b) = ((-half[i] - e[i]) * inverse, (half[i] - e[i]) * inverse);
            near = max(near, min(a, b));
            far = min(far, max(a, b));
        }
        if near <= far && near > 0.0 { near } else { f32::INFINITY }
    })
}

#[inline]
fn enter_cylinder<const N: usize>(radius: f32, half: f32, e: &[f32; 3], d: &Lanes<N>) -> [f32; N] {
    let c = e[0] * e[0] + e[1] * e[1] - radius * radius;
    std::array::from_fn(|k| {
        let a = max(d[0][k] * d[0][k] + d[1][k] * d[1][k], 1e-12);
        let b = e[0] * d[0][k] + e[1] * d[1][k];
        let root = b * b - a * c;
        let width = max(root, 0.0).sqrt();
        let inverse = 1.0 / d[2][k];
        let (low, high) = ((-half - e[2]) * inverse, (half - e[2]) * inverse);
        let near = max((-b - width) / a, min(low, high));
        let far = min((-b + width) / a, max(low, high));
        if root >= 0.0 && near <= far && near > 0.0 { near } else { f32::INFINITY }
    })
}

#[inline]
fn enter_sphere<const N: usize>(radius: f32, e: &[f32; 3], d: &Lanes<N>) -> [f32; N] {
    let c = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] - radius * radius;
    std::array::from_fn(|k| {
        let b = e[0] * d[0][k] + e[1] * d[1][k] + e[2] * d[2][k];
        let root = b * b - c;
        let near = -b - max(root, 0.0).sqrt();
        if root >= 0.0 && near > 0.0 { near } else { f32::INFINITY }
    })
}

#[inline]
fn enter_capsule<const N: usize>(radius: f32, half: f32, e: &[f32; 3], d: &Lanes<N>) -> [f32; N] {
    let c = e[0] * e[0] + e[1] * e[1] - radius * radius;
    let below = enter_sphere(radius, &[e[0], e[1], e[2] + half], d);
    let above = enter_sphere(radius, &[e[0], e[1], e[2] - half], d);
    std::array::from_fn(|k| {
        let a = max(d[0][k] * d[0][k] + d[1][k] * d[1][k], 1e-12);
        let b = e[0] * d[0][k] + e[1] * d[1][k];
        let root = b * b - a * c;
        let near = (-b - max(root, 0.0).sqrt()) / a;
        let z = e[2] + near * d[2][k];
        let is_side = root >= 0.0 && near > 0.0 && z.abs() <= half;
        min(if is_side { near } else { f32::INFINITY }, min(below[k], above[k]))
    })
}

#[inline]
fn enter_hull<const N: usize>(planes: &[[f32; 4]], e: &[f32; 3], d: &Lanes<N>) -> [f32; N] {
    let (mut near, mut far) = ([f32::NEG_INFINITY; N], [f32::INFINITY; N]);
    for [a, b, c, offset] in planes {
        let out = a * e[0] + b * e[1] + c * e[2] - offset;
        for k in 0..N {
            let along = a * d[0][k] + b * d[1][k] + c * d[2][k];
            let range = -out / along;
            if along < 0.0 {
                near[k] = max(near[k], range);
            } else if along > 0.0 {
                far[k] = min(far[k], range);
            } else if out > 0.0 {
                far[k] = f32::NEG_INFINITY;
            }
        }
    }
    std::array::from_fn(|k| if near[k] <= far[k] && near[k] > 0.0 { near[k] } else { f32::INFINITY })
}
