//! Convex parts of a mesh by parry's V-HACD, within a budget.
//!
//! V-HACD works on voxels, 64 along the longest side, and tries planes that cut them; it cannot be interrupted. A mesh
//! that is not a body (a soup of triangles) fills the box with surface and takes minutes. So two counts that determine
//! its work are checked first, and the pieces into which voxels cut triangles, which become the hulls.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use parry3d::math::Vec3;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use parry3d::transformation::voxelization::VoxelSet;

use super::hull::{CenteredHull, Hull, HullError};
use super::triangles::Mesh;

/// Limit of the hulls of one decomposed mesh.
const MAX_HULLS: u32 = 32;
/// Limit of tests of a triangle against a voxel; a million small triangles make 6e7.
const MAX_TESTS: f64 = 1e8;
/// Limit of pieces of triangles in voxels, each about 12 us and 0.8 kB; a body of 200,000 small triangles has as many.
const MAX_PIECES: f64 = 400_000.0;
/// Limit of voxels with surface in them; a cube has 24,000.
const MAX_SURFACE_VOXELS: usize = 60_000;

/// Returns the hulls of a convex decomposition of the mesh.
///
/// # Errors
/// [`HullError`] if the mesh has no body, or one that takes too much work.
pub(super) fn decomposed(mesh: &Mesh) -> Result<Vec<CenteredHull>, HullError> {
    // A flat mesh has no voxels to decompose.
    Hull::centered(&mesh.vertices)?;
    let vertices: Vec<Vec3> = mesh.vertices.iter().map(|p| Vec3::from_array(*p)).collect();
    let triangles = without_repetitions(mesh);
    let parameters = VHACDParameters { max_convex_hulls: MAX_HULLS, ..VHACDParameters::default() };
    check_work(mesh, &triangles, &vertices, &parameters)?;
    let parts = VHACD::decompose(&parameters, &vertices, &triangles, true);
    let mut hulls = Vec::new();
    for part in parts.voxel_parts() {
        let points = part.compute_primitive_intersections(&vertices, &triangles);
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

/// Returns the triangles, each once: a face that a file repeats adds only work.
fn without_repetitions(mesh: &Mesh) -> Vec<[u32; 3]> {
    let mut known = BTreeSet::new();
    let is_new = |triangle: &&[u32; 3]| {
        let mut corners = **triangle;
        corners.sort_unstable();
        known.insert(corners)
    };
    mesh.triangles.iter().filter(is_new).copied().collect()
}

fn check_work(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    vertices: &[Vec3],
    parameters: &VHACDParameters,
) -> Result<(), HullError> {
    let of_corners = |corners: &[[f64; 3]]| {
        let bound = |pick: fn(f64, f64) -> f64| {
            Vector3::from_fn(|axis, _| corners.iter().map(|p| p[axis]).reduce(pick).unwrap_or_default())
        };
        bound(f64::max) - bound(f64::min)
    };
    let side_m = of_corners(&mesh.vertices).max() / f64::from(parameters.resolution);
    let tests = triangles.iter().map(|triangle| {
        let size_m = of_corners(&triangle.map(|corner| mesh.vertices[corner as usize]));
        // Number of voxels that the triangle touches, and one more on either side.
        size_m.map(|length_m| (length_m / side_m).ceil() + 2.0).product()
    });
    let too_complex = |what, n, max| Err(HullError::TooComplex { what, n, max });
    let n_tests: f64 = tests.sum();
    if n_tests > MAX_TESTS {
        return too_complex("tests of triangles against voxels", n_tests, MAX_TESTS);
    }
    let n_pieces: f64 =
        triangles.iter().map(|triangle| pieces(triangle.map(|n| mesh.vertices[n as usize]), side_m)).sum();
    if n_pieces > MAX_PIECES {
        return too_complex("pieces of triangles in voxels", n_pieces, MAX_PIECES);
    }
    let voxels = VoxelSet::voxelize(vertices, triangles, parameters.resolution, parameters.fill_mode, false);
    match voxels.voxels().iter().filter(|voxel| voxel.is_on_surface).count() {
        n if n > MAX_SURFACE_VOXELS => too_complex("voxels of surface", n as f64, MAX_SURFACE_VOXELS as f64),
        _ => Ok(()),
    }
}

/// Returns the approximate number of voxels of this side that cut a triangle. It is the number of squares in its area
/// plus half the number of lengths in its edges.
fn pieces(corners: [[f64; 3]; 3], side_m: f64) -> f64 {
    let [a, b, c] = corners.map(Vector3::from);
    let area_m2 = (b - a).cross(&(c - a)).norm() / 2.0;
    let edges_m = (b - a).norm() + (c - b).norm() + (a - c).norm();
    1.0 + area_m2 / side_m.powi(2) + edges_m / (2.0 * side_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::stream_rng;
    use rand::RngExt;

    /// Returns a mesh of `n` triangles anywhere in a cube of 1 m, with sides up to `side_m`.
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

    /// Returns an angle of two plates, with every face `n` times. Each repetition has its own vertices, shifted by
    /// `step_m` if that is not zero.
    fn angle(n: u32, step_m: f64) -> Mesh {
        let outline = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.2], [0.2, 0.2], [0.2, 1.0], [0.0, 1.0]];
        let faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
        let mut mesh = Mesh::default();
        for k in 0..n {
            let first = if step_m == 0.0 { 0 } else { mesh.vertices.len() as u32 };
            if k == 0 || step_m != 0.0 {
                let z = step_m * f64::from(k);
                mesh.vertices.extend([0.0, 0.2].iter().flat_map(|h| outline.map(|[x, y]| [x, y, h + z])));
            }
            for [a, b, c] in faces {
                mesh.triangles.extend([[a, c, b], [a + 6, b + 6, c + 6]].map(|of| of.map(|n| n + first)));
            }
            for a in 0..6 {
                let b = (a + 1) % 6;
                mesh.triangles.extend([[a, b, b + 6], [a, b + 6, a + 6]].map(|of| of.map(|n| n + first)));
            }
        }
        mesh
    }

    #[test]
    fn faces_that_are_repeated_cost_nothing_and_change_nothing() {
        let (once, often) = (decomposed(&angle(1, 0.0)).unwrap(), decomposed(&angle(1000, 0.0)).unwrap());
        assert!(!once.is_empty() && once.len() == often.len());
        let points = |hulls: &[CenteredHull]| -> Vec<_> { hulls.iter().map(|hull| hull.points_m.clone()).collect() };
        assert_eq!(points(&once), points(&often));
    }

    #[test]
    fn faces_that_lie_upon_each_other_by_the_thousand_are_refused() {
        let error = decomposed(&angle(500, 1e-6)).map(|hulls| hulls.len()).expect_err("refused").to_string();
        insta::assert_snapshot!("faces_upon_each_other", error);
    }

    #[test]
    fn what_would_take_minutes_is_refused_with_the_reason() {
        for (n, side_m) in [(300, 0.99), (20_000, 0.99)] {
            let started = std::time::Instant::now();
            let error = decomposed(&soup(n, side_m)).map(|hulls| hulls.len()).expect_err("refused").to_string();
            insta::assert_snapshot!(format!("soup_of_{n}"), error);
            assert!(started.elapsed().as_secs() < 10, "{:?}", started.elapsed());
        }
    }
}
