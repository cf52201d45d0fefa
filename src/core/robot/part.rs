//! Parts of a vehicle and obstacles in files: primitives, hulls and meshes.

use crate::codes::Code;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::decomposition::decomposed;
use super::error::{FileIssue, RobotError};
use super::hull::{CenteredHull, Hull};
use super::mesh;
use super::shape::{PlacedShape, Shape};
use crate::spatial::{Pose, Vehicle as VehicleFrame};

/// A convex part, placed in its owner's frame.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name of the part in its file; parts of a decomposed mesh are numbered.
    pub name: String,
    /// Shape, pose and colour.
    pub placed: PlacedShape,
}

/// Conversion of a mesh to convex parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Convex {
    /// A single hull around the whole mesh.
    #[default]
    Hull,
    /// Several hulls that leave concavities free.
    Decomposed,
}

/// A part or obstacle in a file.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartFile {
    /// Name of the part, for messages and reports.
    name: String,
    /// Shape: `box`, `cylinder`, `capsule`, `sphere`, `hull` or `mesh`.
    #[schemars(extend("enum" = ["box", "cylinder", "capsule", "sphere", "hull", "mesh"]))]
    shape: String,
    /// Edges of a box along x, y, z.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 1e-4, max = 1e4)))]
    size_m: Option<[f64; 3]>,
    /// Radius of a cylinder, capsule or sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-4, max = 1e4))]
    radius_m: Option<f64>,
    /// Length of a cylinder along z, or between the centres of a capsule's caps.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-4, max = 1e4))]
    length_m: Option<f64>,
    /// Points of a hull: the smallest convex body around them, 0.1 mm thick at least.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(inner(range(min = -1e4, max = 1e4))))]
    points_m: Option<Vec<[f64; 3]>>,
    /// Mesh file (STL, OBJ, DAE), relative to the folder of this file.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<PathBuf>,
    /// Metres per unit of the mesh; absent: 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-6, max = 1e4))]
    scale_m: Option<f64>,
    /// Conversion of the mesh: one hull, or up to 32 that follow its hollows (V-HACD).
    #[serde(skip_serializing_if = "Option::is_none")]
    convex: Option<Convex>,
    /// Position of the shape's centre in its owner's frame.
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    position_m: [f64; 3],
    /// Attitude of the shape in its owner's frame.
    #[serde(default = "no_rotation")]
    quaternion_wxyz: [f64; 4],
    /// Colour in pictures.
    #[serde(default = "grey")]
    color_rgb: [u8; 3],
}

/// Maximum number of shapes of one list.
pub const MAX_PARTS: usize = 256;

fn no_rotation() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

fn grey() -> [u8; 3] {
    [140, 140, 140]
}

/// Checks that coordinates are within 10 km: larger ones are a mistake.
pub(super) fn check_place(file: &Path, key: &str, position_m: &[f64; 3]) -> Result<(), FileIssue> {
    position_m.iter().try_for_each(|&value| FileIssue::check_range(file, key, value, -1e4..=1e4).map(|_| ()))
}

/// Returns the parts of `raw`, a list `table` of `file`. Also returns the same list without mesh files for a recording:
/// meshes become hulls with their points.
///
/// # Errors
/// [`RobotError`] naming file and key; for meshes, both files.
pub fn check_parts(raw: &[PartFile], file: &Path, table: &str) -> Result<(Vec<Part>, Vec<PartFile>), RobotError> {
    let mut plain = Vec::new();
    for part in raw {
        plain.extend(part.without_files(file, table)?);
    }
    if plain.len() > MAX_PARTS {
        let problem = format!("{} shapes, 0 .. {MAX_PARTS} allowed", plain.len());
        return Err(FileIssue::new(Code::ValueCount, file, table, problem).into());
    }
    let parts = plain.iter().map(|part| part.check(file, table)).collect::<Result<_, _>>()?;
    Ok((parts, plain))
}

impl PartFile {
    pub(super) fn is_mesh(&self) -> bool {
        self.shape == "mesh"
    }

    fn key(&self, table: &str, key: &str) -> String {
        format!("{table} `{}`: {key}", self.name)
    }

    fn check(&self, file: &Path, table: &str) -> Result<Part, RobotError> {
        let at = |key: &str| self.key(table, key);
        let missing =
            |key: &str| FileIssue::new(Code::KeyMissing, file, at(key), format!("is needed by shape `{}`", self.shape));
        let size = || self.size_m.ok_or_else(|| missing("size_m"));
        let radius = || self.radius_m.ok_or_else(|| missing("radius_m"));
        let length = || self.length_m.ok_or_else(|| missing("length_m"));
        let shape = match self.shape.as_str() {
            "box" => Shape::Box { size_m: size()? },
            "cylinder" => Shape::Cylinder { radius_m: radius()?, length_m: length()? },
            "capsule" => Shape::Capsule { radius_m: radius()?, length_m: length()? },
            "sphere" => Shape::Sphere { radius_m: radius()? },
            "hull" => self.hull(file, table, self.points_m.as_deref().ok_or_else(|| missing("points_m"))?)?,
            other => {
                let problem = format!("`{other}` is none of box, cylinder, capsule, sphere, hull, mesh");
                return Err(FileIssue::new(Code::NameUnknown, file, at("shape"), problem).into());
            }
        };
        for (key, given) in [
            ("points_m", self.points_m.is_some() && self.shape != "hull"),
            ("file", self.file.is_some()),
            ("scale_m", self.scale_m.is_some()),
            ("convex", self.convex.is_some()),
        ] {
            if given {
                return Err(FileIssue::new(
                    Code::KeyUnknown,
                    file,
                    at(key),
                    format!("is not a key of shape `{}`", self.shape),
                )
                .into());
            }
        }
        for (key, value) in shape.lengths() {
            FileIssue::check_range(file, &at(key), value, 1e-4..=1e4)?;
        }
        let place: Pose<VehicleFrame, VehicleFrame> =
            Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz).ok_or_else(|| {
                FileIssue::new(Code::ValueInvalid, file, at("position_m, quaternion_wxyz"), "must be finite, not zero")
            })?;
        check_place(file, &at("position_m"), &self.position_m)?;
        let placed = PlacedShape { owner_from_shape: *place.isometry(), shape, color_rgb: self.color_rgb };
        Ok(Part { name: self.name.clone(), placed })
    }

    fn hull(&self, file: &Path, table: &str, points_m: &[[f64; 3]]) -> Result<Shape, RobotError> {
        let key = self.key(table, "points_m");
        points_m.iter().try_for_each(|point| check_place(file, &key, point))?;
        Ok(Shape::Hull(
            Hull::new(points_m).map_err(|error| FileIssue::new(Code::MeshUnusable, file, key, error.to_string()))?,
        ))
    }

    /// Returns the part itself, or the hulls of its mesh.
    fn without_files(&self, file: &Path, table: &str) -> Result<Vec<Self>, RobotError> {
        if !self.is_mesh() {
            return Ok(vec![self.clone()]);
        }
        let at = |key: &str| self.key(table, key);
        let missing = |key: &str| FileIssue::new(Code::KeyMissing, file, at(key), "is needed by shape `mesh`");
        let named = self.file.as_ref().ok_or_else(|| missing("file"))?;
        let mesh_file = file.parent().unwrap_or(Path::new(".")).join(named);
        let issue = |key: &str, problem: String| {
            FileIssue::new(Code::MeshUnusable, file, at(key), format!("{}: {problem}", mesh_file.display()))
        };
        let scale_m = FileIssue::check_range(file, &at("scale_m"), self.scale_m.unwrap_or(1.0), 1e-6..=1e4)?;
        let place: Pose<VehicleFrame, VehicleFrame> =
            Pose::from_position_quaternion_wxyz(self.position_m, self.quaternion_wxyz).ok_or_else(|| {
                FileIssue::new(Code::ValueInvalid, file, at("position_m, quaternion_wxyz"), "must be finite, not zero")
            })?;
        let mut mesh = mesh::read(&mesh_file).map_err(|error| issue("file", error.to_string()))?;
        mesh.vertices.as_flattened_mut().iter_mut().for_each(|v| *v *= scale_m);
        mesh.vertices
            .iter()
            .try_for_each(|vertex| check_place(file, &at("scale_m"), vertex))
            .map_err(|error| issue("scale_m", error.problem))?;
        let hulls = match self.convex.unwrap_or_default() {
            Convex::Hull => vec![Hull::centered(&mesh.vertices).map_err(|error| issue("file", error.to_string()))?],
            Convex::Decomposed => decomposed(&mesh).map_err(|error| issue("convex", error.to_string()))?,
        };
        let several = hulls.len() > 1;
        let part = |(n, hull): (usize, CenteredHull)| Self {
            name: if several { format!("{} {}", self.name, n + 1) } else { self.name.clone() },
            shape: "hull".to_owned(),
            points_m: Some(hull.points_m),
            file: None,
            scale_m: None,
            convex: None,
            position_m: (place.isometry() * nalgebra::Point3::from(hull.center_m)).coords.into(),
            ..self.clone()
        };
        Ok(hulls.into_iter().enumerate().map(part).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use parry3d::math::Vec3;

    /// An angle of two bars 1 m long and 0.2 m thick, in mm, as OBJ.
    const ANGLE_MM: &str = "v 0 0 0\nv 1000 0 0\nv 1000 200 0\nv 200 200 0\nv 200 1000 0\nv 0 1000 0\n\
        v 0 0 200\nv 1000 0 200\nv 1000 200 200\nv 200 200 200\nv 200 1000 200\nv 0 1000 200\n\
        f 4 3 2 1\nf 6 5 4 1\nf 7 8 9 10\nf 7 10 11 12\n\
        f 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12\n";

    fn parts(text: &str) -> Result<(Vec<Part>, Vec<PartFile>), RobotError> {
        #[derive(Deserialize, JsonSchema)]
        struct List {
            obstacle: Vec<PartFile>,
        }
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("angle.obj"), ANGLE_MM).expect("written");
        std::fs::write(folder.path().join("flat.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
        std::fs::write(folder.path().join("text.stl"), "no mesh").expect("written");
        let list: List = toml::from_str(&format!("[[obstacle]]\nname = \"rock\"\n{text}")).expect("TOML");
        check_parts(&list.obstacle, &folder.path().join("r.toml"), "obstacle")
    }

    fn mesh(keys: &str) -> String {
        format!(
            "shape = \"mesh\"\nposition_m = [1, 2, 3]\nquaternion_wxyz = [0.7071067811865476, 0, 0, \
             0.7071067811865476]\n{keys}"
        )
    }

    /// Returns the distance of a point (owner's frame) from the nearest part, m.
    fn distance_m(parts: &[Part], point: [f64; 3]) -> f64 {
        let at = parry3d::math::Pose3::from_translation(Vec3::from_array(point));
        let ball = parry3d::shape::SharedShape::ball(1e-6);
        let distance = |part: &Part| {
            let pose = crate::robot::parry_pose(&part.placed.owner_from_shape);
            parry3d::query::distance(&pose, part.placed.shape.to_parry().as_ref(), &at, ball.as_ref())
                .expect("known")
                .distance
        };
        parts.iter().map(distance).fold(f64::INFINITY, f64::min)
    }

    /// Returns a point of the mesh's frame in the owner's frame.
    fn placed([x, y, z]: [f64; 3]) -> [f64; 3] {
        [1.0 - y, 2.0 + x, 3.0 + z]
    }

    #[test]
    fn a_mesh_is_its_hull_at_its_place() {
        let (found, _) = parts(&mesh("file = \"angle.obj\"\nscale_m = 0.001\n")).expect("a mesh");
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].name, "rock");
        assert!(distance_m(&found, placed([1.1, 0.1, 0.1])) - 0.1 < 1e-5);
        assert!((distance_m(&found, placed([1.1, 0.1, 0.1])) - 0.1).abs() < 1e-5);
        assert!(distance_m(&found, placed([0.5, 0.5, 0.1])) < 1e-9, "the hollow is filled");
        assert!((found[0].placed.shape.bounding_radius_m() - (0.5_f64.hypot(0.5)).hypot(0.1)).abs() < 1e-9);
    }

    #[test]
    fn a_decomposed_mesh_leaves_its_hollow_free() {
        let (found, _) =
            parts(&mesh("file = \"angle.obj\"\nscale_m = 0.001\nconvex = \"decomposed\"\n")).expect("a mesh");
        assert!((2..=8).contains(&found.len()), "{}", found.len());
        assert_eq!(found[1].name, "rock 2");
        let hollow_m = distance_m(&found, placed([0.6, 0.6, 0.1]));
        assert!((0.3..0.41).contains(&hollow_m), "{hollow_m}");
        for corner in
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.2], [1.0, 0.2, 0.0], [0.2, 1.0, 0.2], [0.0, 1.0, 0.0], [0.2, 0.2, 0.1]]
        {
            assert!(distance_m(&found, placed(corner)) < 0.01, "{corner:?}");
        }
    }

    /// The list in a recording has the same bodies, bit for bit, and needs no file.
    #[test]
    fn the_list_without_files_stands_for_the_same_parts() {
        for convex in ["hull", "decomposed"] {
            let keys = format!("file = \"angle.obj\"\nscale_m = 0.001\nconvex = \"{convex}\"\n");
            let (found, plain) = parts(&mesh(&keys)).expect("a mesh");
            #[derive(Serialize, Deserialize, JsonSchema)]
            struct List {
                obstacle: Vec<PartFile>,
            }
            let text = toml::to_string(&List { obstacle: plain }).expect("TOML");
            assert!(!text.contains("angle.obj"), "{text}");
            let again: List = toml::from_str(&text).expect("TOML");
            let (again, _) =
                check_parts(&again.obstacle, Path::new("elsewhere/scene.toml"), "obstacle").expect("hulls");
            assert_eq!(again.len(), found.len());
            for (a, b) in again.iter().zip(&found) {
                assert_eq!((&a.name, &a.placed), (&b.name, &b.placed));
                let (Shape::Hull(a), Shape::Hull(b)) = (&a.placed.shape, &b.placed.shape) else { panic!("hulls") };
                assert_eq!((a.corners_m(), a.triangles()), (b.corners_m(), b.triangles()));
            }
        }
    }

    #[test]
    fn what_is_wrong_with_a_mesh_is_named() {
        let at = "position_m = [0, 0, 0]\n";
        let box_at = format!("shape = \"box\"\nsize_m = [1, 1, 1]\n{at}");
        let many = format!("{box_at}[[obstacle]]\nname = \"b\"\n").repeat(MAX_PARTS) + &box_at;
        let told = [
            mesh(""),
            mesh("file = \"none.stl\"\n"),
            mesh("file = \"text.stl\"\n"),
            mesh("file = \"flat.obj\"\n"),
            mesh("file = \"flat.obj\"\nconvex = \"decomposed\"\n"),
            mesh("file = \"angle.obj\"\nscale_m = 0.0\n"),
            mesh("file = \"angle.obj\"\nscale_m = 1000\n"),
            format!("{box_at}file = \"angle.obj\"\n"),
            format!("{box_at}points_m = []\n"),
            format!("shape = \"hull\"\n{at}"),
            format!("shape = \"hull\"\npoints_m = [[0, 0, nan]]\n{at}"),
            format!("shape = \"torus\"\n{at}"),
            many,
        ]
        .map(|text| {
            let told = parts(&text).expect_err("refused").to_string();
            // The name of the folder differs each time.
            let words = told.split(' ').map(|word| word.rsplit_once('/').map_or(word, |(_, name)| name));
            words.collect::<Vec<_>>().join(" ")
        });
        insta::assert_snapshot!("parts", told.join("\n"));
    }
}
