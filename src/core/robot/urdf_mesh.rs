//! Collision meshes that a URDF names: found below the robot folder, read as convex hulls.

use crate::codes::Code;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::error::FileIssue;
use super::hull::Hull;
use super::mesh::{self, MeshError};
use super::part::check_place;
use super::shape::Shape;
use crate::files::check_within;

/// Use of the collision meshes of a URDF: `collision_meshes` of robot.toml.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum CollisionMeshes {
    /// Each mesh is read as its convex hull.
    #[default]
    Hull,
    /// No mesh is read; planning is refused.
    Ignore,
}

/// A mesh as referenced by the URDF.
#[derive(Clone, Copy)]
pub(super) struct NamedMesh<'a> {
    pub link: &'a str,
    pub name: &'a str,
    /// Metres per unit of the file along each axis; negative if it mirrors.
    pub scale: [f64; 3],
}

/// Folders in which meshes are searched for.
pub(super) struct MeshFolders {
    /// Folders of the URDF and of robot.toml.
    pub folders: [PathBuf; 2],
}

impl MeshFolders {
    /// Returns the file of a mesh.
    ///
    /// # Errors
    /// The remedy: the end of a sentence that begins with the mesh's name.
    pub fn find(&self, name: &str) -> Result<PathBuf, String> {
        let places = places(name);
        for folder in &self.folders {
            let found = places.iter().map(|place| folder.join(place)).find(|file| file.is_file());
            let Some(file) = found else { continue };
            check_within(folder, &file).map_err(|error| error.to_string())?;
            if mesh::is_readable(&file) {
                return Ok(file);
            }
        }
        let wanted = self.folders[1].join(places.first().map_or(Path::new(name), PathBuf::as_path));
        let wanted = wanted.display();
        Err(if mesh::is_readable(Path::new(name)) {
            format!("copy it to {wanted}")
        } else {
            format!("only .stl, .obj and .dae are read; convert it (Blender, assimp) to {wanted}")
        })
    }

    /// Returns the convex hull of a mesh, m, about its centre, and that centre.
    ///
    /// # Errors
    /// [`FileIssue`] naming `urdf`, the link and the mesh.
    pub fn hull(&self, urdf: &Path, mesh: &NamedMesh<'_>) -> Result<(Shape, [f64; 3]), FileIssue> {
        let issue = |problem: String| {
            let key = format!("link `{}`: collision mesh {}", mesh.link, mesh.name);
            FileIssue::new(Code::MeshUnusable, urdf, key, problem)
        };
        let file = self.find(mesh.name).map_err(issue)?;
        let mut read = mesh::read(&file).map_err(|error: MeshError| issue(error.to_string()))?;
        for vertex in &mut read.vertices {
            *vertex = [0, 1, 2].map(|axis| vertex[axis] * mesh.scale[axis]);
            check_place(urdf, "a vertex", vertex).map_err(|error| issue(error.problem))?;
        }
        let hull = Hull::centered(&read.vertices).map_err(|error| issue(error.to_string()))?;
        let shape = Hull::new(&hull.points_m).map_err(|error| issue(error.to_string()))?;
        Ok((Shape::Hull(shape), hull.center_m))
    }
}

/// Returns the candidate paths of a mesh below a folder: the whole path in the URDF, the path without its first folder
/// (the package), and the file name. For other formats, the paths of a converted file come first. None leads out of the
/// folder.
pub(super) fn places(name: &str) -> Vec<PathBuf> {
    let path = name.split_once("://").map_or(name, |(_, rest)| rest);
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    let n = parts.len();
    let mut firsts = vec![0, 1.min(n.saturating_sub(1)), n.saturating_sub(1)];
    firsts.dedup();
    let mut places: Vec<PathBuf> = Vec::new();
    for from in firsts {
        let place: PathBuf = parts[from..].iter().collect();
        let converted = ["stl", "obj"].map(|extension| place.with_extension(extension));
        let is_plain = mesh::is_plain(&place);
        places.extend(converted.into_iter().filter(|_| !is_plain));
        places.push(place);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_looked_for_below_the_folder_alone() {
        let names = |name: &str| -> Vec<String> {
            places(name).iter().map(|place| place.to_string_lossy().into_owned()).collect()
        };
        assert_eq!(names("package://arm/meshes/a.stl"), ["arm/meshes/a.stl", "meshes/a.stl", "a.stl"]);
        assert_eq!(names("../meshes/./a.STL"), ["meshes/a.STL", "a.STL"]);
        assert_eq!(names("file:///home/a.obj"), ["home/a.obj", "a.obj"]);
        assert_eq!(names("../../../../etc/passwd.stl"), ["etc/passwd.stl", "passwd.stl"]);
        assert_eq!(names("a.dae"), ["a.stl", "a.obj", "a.dae"]);
        assert_eq!(names("a.ply"), ["a.stl", "a.obj", "a.ply"]);
        for odd in ["", "..", "package://", "/", "a"] {
            assert!(places(odd).iter().all(|place| place.is_relative()), "{odd}");
        }
    }
}
