//! The one linearization of a projection.

use nalgebra::{Matrix2x3, Matrix2x6, Vector2, Vector3};

use armcal_core::optics::{CameraModel, image_jacobian};

/// Image of a point in the camera's frame, and the image's derivatives.
#[derive(Clone, Copy)]
pub(crate) struct ImagePoint {
    pub pixel: Vector2<f64>,
    /// d(pixel)/d(point), px/m.
    pub by_point: Matrix2x3<f64>,
    /// Rows of d(pixel)/d(xi), px/m and px/rad: the camera's pose perturbed on the right.
    pub by_twist: [[f64; 6]; 2],
}

impl ImagePoint {
    /// Returns the image; `None` if the lens does not see the point.
    #[inline]
    pub(crate) fn of(lens: &CameraModel, point_m: &Vector3<f64>) -> Option<Self> {
        let (pixel, by_point) = lens.project_with_jacobian(point_m)?;
        Some(Self { pixel, by_point, by_twist: image_jacobian(&by_point, point_m) })
    }

    /// Returns the measured minus the predicted pixel, px.
    #[inline]
    pub(crate) fn residual_px(&self, measured_px: &[f64; 2]) -> [f64; 2] {
        [measured_px[0] - self.pixel.x, measured_px[1] - self.pixel.y]
    }

    /// Returns [`Self::by_twist`] as a matrix.
    #[inline]
    pub(crate) fn jacobian(&self) -> Matrix2x6<f64> {
        let [x, y] = self.by_twist;
        Matrix2x6::from_rows(&[x.into(), y.into()])
    }
}
