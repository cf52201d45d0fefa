//! Any camera: one set of methods over the models.

use nalgebra::{Matrix2x3, Unit, Vector2, Vector3};

use super::fisheye::Fisheye;
use super::radtan::Radtan;

/// What pose estimation asks of a camera; points in the camera frame, m.
pub trait Lens {
    /// `None` where the lens does not see.
    fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>>;
    /// Projection and d(pixel)/d(point), px/m.
    fn project_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)>;
    /// The direction that a pixel sees.
    fn unproject(&self, pixel_px: &Vector2<f64>) -> Option<Unit<Vector3<f64>>>;
}

macro_rules! is_a_lens {
    ($model:ty) => {
        impl Lens for $model {
            #[inline]
            fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
                <$model>::project(self, point_m)
            }
            #[inline]
            fn project_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
                <$model>::project_with_jacobian(self, point_m)
            }
            #[inline]
            fn unproject(&self, pixel_px: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
                <$model>::unproject(self, pixel_px)
            }
        }
    };
}
is_a_lens!(Fisheye);
is_a_lens!(Radtan);
is_a_lens!(CameraModel);

/// A camera of either model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraModel {
    /// Kannala and Brandt's fisheye.
    Equidistant(Fisheye),
    /// Without distortion it is the plain pinhole.
    Radtan(Radtan),
}

impl CameraModel {
    /// Pixel of a point (camera frame, m); `None` where the lens does not see.
    #[must_use]
    pub fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::Equidistant(lens) => lens.project(point_m),
            Self::Radtan(lens) => lens.project(point_m),
        }
    }

    /// Projection and d(pixel)/d(point), px/m; `None` where the lens does not see.
    #[must_use]
    pub fn project_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        match self {
            Self::Equidistant(lens) => lens.project_with_jacobian(point_m),
            Self::Radtan(lens) => lens.project_with_jacobian(point_m),
        }
    }

    /// The direction (camera frame, unit) that a pixel sees; `None` where no point is projected to it.
    #[must_use]
    pub fn unproject(&self, pixel_px: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        match self {
            Self::Equidistant(lens) => lens.unproject(pixel_px),
            Self::Radtan(lens) => lens.unproject(pixel_px),
        }
    }

    /// Columns and rows.
    #[must_use]
    pub fn resolution_px(&self) -> [u32; 2] {
        match self {
            Self::Equidistant(lens) => lens.resolution_px,
            Self::Radtan(lens) => lens.resolution_px,
        }
    }

    /// Focal lengths along x and y.
    #[must_use]
    pub fn focal_px(&self) -> [f64; 2] {
        match self {
            Self::Equidistant(lens) => lens.focal_px,
            Self::Radtan(lens) => lens.focal_px,
        }
    }

    /// Principal point, x and y.
    #[must_use]
    pub fn center_px(&self) -> [f64; 2] {
        match self {
            Self::Equidistant(lens) => lens.center_px,
            Self::Radtan(lens) => lens.center_px,
        }
    }
}

impl From<Fisheye> for CameraModel {
    fn from(lens: Fisheye) -> Self {
        Self::Equidistant(lens)
    }
}

impl From<Radtan> for CameraModel {
    fn from(lens: Radtan) -> Self {
        Self::Radtan(lens)
    }
}
