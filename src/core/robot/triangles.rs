//! Triangles with shared corners, as readers of meshes make them.

use std::collections::BTreeMap;

/// Triangles with shared corners, in the file's own unit; those of COLLADA, which states its unit, in metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mesh {
    pub vertices: Vec<[f64; 3]>,
    pub triangles: Vec<[u32; 3]>,
}

/// Limit of a mesh's triangles, including degenerate ones.
const MAX_TRIANGLES: usize = 1_000_000;
/// Limit of a mesh's vertices: the number that triangles without shared corners have.
pub(super) const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;
/// Number of triangles that is allowed for every file, and bytes of each triangle beyond that, because a file may show
/// one part many times. A triangle takes up to 250 bytes of memory, and at least 12 in a file.
const ALWAYS_ALLOWED_TRIANGLES: usize = 200_000;
const MIN_BYTES_PER_TRIANGLE: usize = 10;

/// Returns the maximum number of triangles of a file of `bytes`.
pub(super) fn max_triangles(bytes: usize) -> usize {
    MAX_TRIANGLES.min(ALWAYS_ALLOWED_TRIANGLES + bytes / MIN_BYTES_PER_TRIANGLE)
}

/// Error for a file of more than [`max_triangles`].
pub(super) fn too_many_triangles(max: usize) -> String {
    format!("more than {max} triangles; use a coarser mesh")
}

/// An unfinished mesh; equal corners share one vertex.
pub(super) struct MeshBuilder {
    mesh: Mesh,
    number: BTreeMap<[u64; 3], u32>,
    n_added: usize,
    max_triangles: usize,
}

impl MeshBuilder {
    /// Builds an empty mesh for a file of this number of bytes.
    pub fn of_file(bytes: usize) -> Self {
        let max_triangles = max_triangles(bytes);
        Self { mesh: Mesh::default(), number: BTreeMap::new(), n_added: 0, max_triangles }
    }

    /// Adds a triangle.
    ///
    /// # Errors
    /// A sentence, if there are too many triangles or one has no position.
    pub fn add(&mut self, corners: [[f64; 3]; 3]) -> Result<(), String> {
        if self.n_added == self.max_triangles {
            return Err(too_many_triangles(self.max_triangles));
        }
        self.n_added += 1;
        if !corners.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(format!("triangle {} has a coordinate that is not finite", self.mesh.triangles.len()));
        }
        let Self { mesh, number, .. } = self;
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

    /// Returns the mesh of the added triangles.
    pub fn finish(self) -> Mesh {
        self.mesh
    }
}
