//! Triangles with shared corners, as readers of meshes make them.

use std::collections::BTreeMap;

/// Triangles with shared corners, in the file's own unit; those of COLLADA, which names it, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mesh {
    pub vertices: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

/// Limit of a mesh's triangles.
const MAX_TRIANGLES: usize = 1_000_000;
/// Limit of its vertices: as many as triangles of their own have.
pub(super) const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;

/// Mesh in the making; equal corners share one vertex.
#[derive(Default)]
pub(super) struct MeshBuilder {
    mesh: Mesh,
    number: BTreeMap<[u64; 3], u32>,
}

impl MeshBuilder {
    /// Adds a triangle.
    ///
    /// # Errors
    /// A sentence, where there are too many or one has no place.
    pub fn add(&mut self, corners: [[f64; 3]; 3]) -> Result<(), String> {
        if self.mesh.triangles.len() == MAX_TRIANGLES {
            return Err(format!("more than {MAX_TRIANGLES} triangles"));
        }
        if !corners.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(format!("triangle {} has a coordinate that is not finite", self.mesh.triangles.len()));
        }
        let Self { mesh, number } = self;
        let triangle = corners.map(|corner| {
            // Adding zero turns -0 into 0.
            *number.entry(corner.map(|v| (v + 0.0).to_bits())).or_insert_with(|| {
                mesh.vertices.push(corner);
                mesh.vertices.len() as u32 - 1
            })
        });
        let [a, b, c] = triangle;
        // Degenerate triangles are skipped.
        if a != b && b != c && c != a {
            mesh.triangles.push(triangle);
        }
        Ok(())
    }

    /// What was added.
    pub fn finish(self) -> Mesh {
        self.mesh
    }
}
