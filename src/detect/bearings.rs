//! Bearings of pixels from a table of the lens's inverse, and a rectified (pinhole) view that faces a tag.

use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};

use armcal_core::optics::CameraModel;

const N_NODES: usize = 4096;
/// Smallest cosine between a pixel's bearing and that of the tag's centre: 80 deg.
const MIN_DEPTH: f64 = 0.17;

/// Bearings of pixels, interpolated in a table over the squared radius; accurate to 1e-8 rad.
#[derive(Clone, Debug)]
pub(super) struct BearingTable {
    focal_px: [f64; 2],
    center_px: [f64; 2],
    nodes_per_square: f64,
    /// (sin(theta)/theta_d, cos(theta)) at squared distorted angles.
    nodes: Vec<[f64; 2]>,
}

impl BearingTable {
    pub(super) fn new(lens: &CameraModel) -> Self {
        let [fx, cx, cy] = [lens.focal_px()[0], lens.center_px()[0], lens.center_px()[1]];
        let edge = Vector3::new(lens.max_view_angle_rad().sin(), 0.0, lens.max_view_angle_rad().cos());
        let largest = lens.project(&(edge * (1.0 - 1e-12))).map_or(0.0, |pixel| ((pixel.x - cx) / fx).powi(2));
        let nodes_per_square = (N_NODES - 1) as f64 / largest.max(1e-9);
        let at = |k: usize| {
            let theta_d = (k as f64 / nodes_per_square).sqrt().min(largest.sqrt() * (1.0 - 1e-9));
            let bearing = lens.unproject(&Vector2::new(fx * theta_d + cx, cy));
            bearing.map_or([1.0, 1.0], |b| [if theta_d > 1e-9 { b.x / theta_d } else { 1.0 }, b.z])
        };
        let nodes = (0..N_NODES).map(at).collect();
        Self { focal_px: lens.focal_px(), center_px: lens.center_px(), nodes_per_square, nodes }
    }

    /// Bearing of a pixel (camera frame, of length 1 to 1e-8); `None` beyond the field of view.
    #[inline]
    pub(super) fn bearing(&self, pixel_px: [f64; 2]) -> Option<Vector3<f64>> {
        let x = (pixel_px[0] - self.center_px[0]) / self.focal_px[0];
        let y = (pixel_px[1] - self.center_px[1]) / self.focal_px[1];
        let position = (x * x + y * y) * self.nodes_per_square;
        let k = position as usize;
        let [a, b] = [self.nodes.get(k)?, self.nodes.get(k + 1)?];
        let fraction = position - k as f64;
        let scale = a[0] + fraction * (b[0] - a[0]);
        Some(Vector3::new(x * scale, y * scale, a[1] + fraction * (b[1] - a[1])))
    }
}

/// Pinhole camera of focal length 1 at the camera's position that faces a tag: its image has straight tag sides.
#[derive(Clone, Debug)]
pub(super) struct RectifiedView<'a> {
    table: &'a BearingTable,
    rotation: Rotation3<f64>,
}

impl<'a> RectifiedView<'a> {
    pub(super) fn new(table: &'a BearingTable, corners_px: &[[f64; 2]; 4]) -> Option<Self> {
        let mut sum = Vector3::zeros();
        for corner in corners_px {
            sum += table.bearing(*corner)?;
        }
        let rotation = Rotation3::rotation_between(&sum, &Vector3::z())?;
        Some(Self { table, rotation })
    }

    /// Intersection of a pixel's line of sight with the plane z = 1.
    #[inline]
    pub(super) fn plane(&self, pixel_px: [f64; 2]) -> Option<Vector2<f64>> {
        let rotated = self.rotation * self.table.bearing(pixel_px)?;
        (rotated.z > MIN_DEPTH).then(|| Vector2::new(rotated.x / rotated.z, rotated.y / rotated.z))
    }

    /// Returns the intersection like [`Self::plane`], with its Jacobian d(plane)/d(pixel).
    #[inline]
    pub(super) fn plane_with_jacobian(&self, pixel_px: [f64; 2]) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        const H: f64 = 0.5;
        let [x, y] = pixel_px;
        let here = self.plane(pixel_px)?;
        let (left, right) = (self.plane([x - H, y])?, self.plane([x + H, y])?);
        let (up, down) = (self.plane([x, y - H])?, self.plane([x, y + H])?);
        Some((here, Matrix2::from_columns(&[(right - left) / (2.0 * H), (down - up) / (2.0 * H)])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::optics::fixture::lens;

    #[test]
    fn the_table_is_the_lens() {
        let (lens, table) = (lens(), BearingTable::new(&lens()));
        let mut n = 0;
        for x in (0..1224).step_by(37) {
            for y in (0..1024).step_by(41) {
                let pixel = [f64::from(x), f64::from(y)];
                let (Some(exact), Some(ours)) = (lens.unproject(&pixel.into()), table.bearing(pixel)) else {
                    assert_eq!(lens.unproject(&pixel.into()).is_some(), table.bearing(pixel).is_some(), "{pixel:?}");
                    continue;
                };
                n += 1;
                assert!((exact.into_inner() - ours).norm() < 3e-8, "{pixel:?}");
            }
        }
        assert!(n > 500, "{n}");
    }
}
