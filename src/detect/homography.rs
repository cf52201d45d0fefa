//! The map from a tag's plane view to the tag itself, given by four corners, and how it moves with them.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Plane to tag: `s = (g0 x + g1 y + g2)/d`, `t = (g3 x + g4 y + g5)/d`, `d = g6 x + g7 y + 1`; s, t = +-1 at the corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homography {
    pub g: SVector<f64, 8>,
    inverse_system: SMatrix<f64, 8, 8>,
}

/// A point's place on the tag, and what it depends on.
#[derive(Clone, Copy, Debug)]
pub(super) struct TagPlace {
    pub s: f64,
    pub t: f64,
    /// 1/d.
    pub scale: f64,
}

/// The corners in order: bottom left, bottom right, top right, top left as printed.
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
    pub(super) fn place(&self, point: &Vector2<f64>) -> TagPlace {
        let g = &self.g;
        let scale = 1.0 / (g[6] * point.x + g[7] * point.y + 1.0);
        TagPlace {
            s: (g[0] * point.x + g[1] * point.y + g[2]) * scale,
            t: (g[3] * point.x + g[4] * point.y + g[5]) * scale,
            scale,
        }
    }

    /// d(s, t)/d(x, y).
    #[inline]
    pub(super) fn slope(&self, place: &TagPlace) -> Matrix2<f64> {
        let g = &self.g;
        Matrix2::new(
            (g[0] - place.s * g[6]) * place.scale,
            (g[1] - place.s * g[7]) * place.scale,
            (g[3] - place.t * g[6]) * place.scale,
            (g[4] - place.t * g[7]) * place.scale,
        )
    }

    /// d(g)/d(corner pixels), from d(plane)/d(pixel) at each corner: differentiating `A(corners) g = right`.
    pub(super) fn corner_jacobian(&self, jacobians: &[Matrix2<f64>; 4]) -> SMatrix<f64, 8, 8> {
        let mut right = SMatrix::<f64, 8, 8>::zeros();
        for (k, ([s, t], jacobian)) in CORNERS.into_iter().zip(jacobians).enumerate() {
            let slope = self.slope(&TagPlace { s, t, scale: 1.0 });
            right.fixed_view_mut::<2, 2>(2 * k, 2 * k).copy_from(&(-slope * jacobian));
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
            let place = homography.place(corner);
            assert!((place.s - s).abs() < 1e-12 && (place.t - t).abs() < 1e-12);
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
