//! Homography from a tag's rectified view to the tag's own coordinates, by four corners, and its derivative by them.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Plane to tag: `s = (g0 x + g1 y + g2)/d`, `t = (g3 x + g4 y + g5)/d`, `d = g6 x + g7 y + 1`; s, t = +-1 at the
/// corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homography {
    pub g: SVector<f64, 8>,
    inverse_system: SMatrix<f64, 8, 8>,
}

/// A point in tag coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct TagPoint {
    pub s: f64,
    pub t: f64,
    /// 1/d.
    pub scale: f64,
}

/// Tag coordinates of the corners in order: bottom left, bottom right, top right, top left as printed.
pub(super) const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

impl Homography {
    pub(super) fn new(corners: &[Vector2<f64>; 4]) -> Option<Self> {
        let mut system = SMatrix::<f64, 8, 8>::zeros();
        let mut right = SVector::<f64, 8>::zeros();
        for (k, (corner, [s, t])) in corners.iter().zip(CORNERS).enumerate() {
            let (x, y) = (corner.x, corner.y);
            system.set_row(2 * k, &SMatrix::from([[x], [y], [1.0], [0.0], [0.0], [0.0], [-s * x], [-s * y]]));
            system.set_row(2 * k + 1, &SMatrix::from([[0.0], [0.0], [0.0], [x], [y], [1.0], [-t * x], [-t * y]]));
            right[2 * k] = s;
            right[2 * k + 1] = t;
        }
        let inverse_system = system.try_inverse()?;
        let g = inverse_system * right;
        g.iter().all(|value| value.is_finite()).then_some(Self { g, inverse_system })
    }

    #[inline]
    pub(super) fn map(&self, plane: &Vector2<f64>) -> TagPoint {
        let g = &self.g;
        let scale = 1.0 / (g[6] * plane.x + g[7] * plane.y + 1.0);
        TagPoint {
            s: (g[0] * plane.x + g[1] * plane.y + g[2]) * scale,
            t: (g[3] * plane.x + g[4] * plane.y + g[5]) * scale,
            scale,
        }
    }

    /// Jacobian d(s, t)/d(x, y).
    #[inline]
    pub(super) fn jacobian(&self, point: &TagPoint) -> Matrix2<f64> {
        let g = &self.g;
        Matrix2::new(
            (g[0] - point.s * g[6]) * point.scale,
            (g[1] - point.s * g[7]) * point.scale,
            (g[3] - point.t * g[6]) * point.scale,
            (g[4] - point.t * g[7]) * point.scale,
        )
    }

    /// d(g)/d(corner pixels), from d(plane)/d(pixel) at each corner: the derivative of `A(corners) g = right`.
    pub(super) fn corner_jacobian(&self, jacobians: &[Matrix2<f64>; 4]) -> SMatrix<f64, 8, 8> {
        let mut right = SMatrix::<f64, 8, 8>::zeros();
        for (k, ([s, t], jacobian)) in CORNERS.into_iter().zip(jacobians).enumerate() {
            let tag_by_plane = self.jacobian(&TagPoint { s, t, scale: 1.0 });
            right.fixed_view_mut::<2, 2>(2 * k, 2 * k).copy_from(&(-tag_by_plane * jacobian));
        }
        self.inverse_system * right
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners() -> [Vector2<f64>; 4] {
        [[-0.2, 0.25], [0.3, 0.2], [0.22, -0.2], [-0.15, -0.3]].map(Vector2::from)
    }

    #[test]
    fn corners_fall_on_corners_and_derivatives_agree_with_differences() {
        let homography = Homography::new(&corners()).expect("a square");
        for (corner, [s, t]) in corners().iter().zip(CORNERS) {
            let point = homography.map(corner);
            assert!((point.s - s).abs() < 1e-12 && (point.t - t).abs() < 1e-12);
        }
        let analytic = homography.corner_jacobian(&[Matrix2::identity(); 4]);
        for k in 0..8 {
            let moved = |h: f64| {
                let mut corners = corners();
                corners[k / 2][k % 2] += h;
                Homography::new(&corners).expect("a square").g
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((difference - analytic.column(k)).norm() < 1e-5 * difference.norm(), "{k}");
        }
    }
}
