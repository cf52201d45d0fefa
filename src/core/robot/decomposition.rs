//! Convex parts of a mesh by parry's V-HACD, within a budget.
//!
//! V-HACD works on voxels, 64 along the longest side, and tries planes that cut them; it cannot be stopped on its way.
//! A mesh that is no body (a soup of triangles) fills the box with surface and takes minutes, so two counts that its
//! work grows with are looked at first.

use nalgebra::Vector3;
use parry3d::math::Vec3;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use parry3d::transformation::voxelization::VoxelSet;

use super::hull::{CenteredHull, Hull, HullError};
use super::mesh::Mesh;

/// Limit of the hulls of one decomposed mesh.
const MAX_HULLS: u32 = 32;
/// Limit of tests of a triangle against a voxel; a million small triangles make 6e7.
const MAX_TESTS: f64 = 1e8;
/// Limit of voxels with surface in them; a cube has 24,000.
const MAX_SURFACE_VOXELS: usize = 60_000;

/// Hulls of a convex decomposition of the mesh.
///
/// # Errors
/// [`HullError`] where it has no body, or one that takes too much work.
pub(super) fn decomposed(mesh: &Mesh) -> Result<Vec<CenteredHull>, HullError> {
    // A flat mesh has no voxels to decompose.
    Hull::centered(&mesh.vertices)?;
    let vertices: Vec<Vec3> = mesh.vertices.iter().map(|p| Vec3::from_array(*p)).collect();
    let parameters = VHACDParameters { max_convex_hulls: MAX_HULLS, ..VHACDParameters::default() };
    check_work(mesh, &vertices, &parameters)?;
    let parts = VHACD::decompose(&parameters, &vertices, &mesh.triangles, true);
    let mut hulls = Vec::new();
    for points in parts.compute_primitive_intersections(&vertices, &mesh.triangles) {
        let points: Vec<[f64; 3]> = points.iter().map(|p| p.to_array()).collect();
        match Hull::centered(&points) {
            Ok(hull) => hulls.push(hull),
            // A flat piece of a face at the border of two parts; the neighbouring part has the same face.
            Err(HullError::Flat { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    if hulls.is_empty() {
        return Err(HullError::Degenerate("no part of it is thick enough".to_owned()));
    }
    Ok(hulls)
}

fn check_work(mesh: &Mesh, vertices: &[Vec3], parameters: &VHACDParameters) -> Result<(), HullError> {
    let of_corners = |corners: &[[f64; 3]]| {
        let bound = |pick: fn(f64, f64) -> f64| {
            Vector3::from_fn(|axis, _| corners.iter().map(|p| p[axis]).reduce(pick).unwrap_or_default())
        };
        bound(f64::max) - bound(f64::min)
    };
    let side_m = of_corners(&mesh.vertices).max() / f64::from(parameters.resolution);
    let tests = mesh.triangles.iter().map(|triangle| {
        let size_m = of_corners(&triangle.map(|corner| mesh.vertices[corner as usize]));
        // The voxels that it touches, and one more on either side.
        size_m.map(|length_m| (length_m / side_m).ceil() + 2.0).product()
    });
    let too_complex = |what, n, max| Err(HullError::TooComplex { what, n, max });
    let n_tests: f64 = tests.sum();
    if n_tests > MAX_TESTS {
        return too_complex("tests of triangles against voxels", n_tests, MAX_TESTS);
    }
    let voxels = VoxelSet::voxelize(vertices, &mesh.triangles, parameters.resolution, parameters.fill_mode, false);
    match voxels.voxels().iter().filter(|voxel| voxel.is_on_surface).count() {
        n if n > MAX_SURFACE_VOXELS => too_complex("voxels of surface", n as f64, MAX_SURFACE_VOXELS as f64),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::stream_rng;
    use rand::RngExt;

    /// `n` triangles anywhere in a cube of 1 m, of sides up to `side_m`.
    fn soup(n: u32, side_m: f64) -> Mesh {
        let mut rng = stream_rng(1, "soup");
        let mut mesh = Mesh::default();
        for k in 0..n {
            let place: [f64; 3] = std::array::from_fn(|_| rng.random_range(0.0..1.0 - side_m));
            for _ in 0..3 {
                mesh.vertices.push(place.map(|value| value + rng.random_range(0.0..side_m)));
            }
            mesh.triangles.push([3 * k, 3 * k + 1, 3 * k + 2]);
        }
        mesh
    }

    #[test]
    fn what_would_take_minutes_is_refused_with_the_reason() {
        for (n, side_m, words) in [(300, 0.99, "voxels of surface"), (20_000, 0.99, "tests of triangles")] {
            let started = std::time::Instant::now();
            let error = decomposed(&soup(n, side_m)).map(|hulls| hulls.len()).expect_err("refused").to_string();
            assert!(error.contains(words) && error.contains("simplify"), "{error}");
            assert!(started.elapsed().as_secs() < 10, "{:?}", started.elapsed());
        }
    }
}
