//! Camera model: one set of methods over all lens models.

use nalgebra::{Matrix2x3, SMatrix, Unit, Vector2, Vector3};

use super::fisheye::Fisheye;
use super::flat_port::FlatPort;
use super::radtan::Radtan;

/// Methods of a camera that pose estimation needs; points in the camera frame, m.
pub trait Lens {
    /// Returns the pixel of a point; `None` if the point is outside the lens's view.
    fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>>;
    /// Returns projection and d(pixel)/d(point), px/m.
    fn project_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)>;
    /// Returns the bearing of a pixel.
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

/// A lens of one of the models, or an unknown lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LensModel {
    /// Kannala and Brandt's fisheye.
    Equidistant(Fisheye),
    /// Brown's pinhole with distortion; the plain pinhole if all coefficients are zero.
    Radtan(Radtan),
    /// Lens without a model.
    Unknown(UnknownLens),
}

/// Maximum number of pixels of an image: the tag detector's library takes 13 bytes for each.
const MAX_PIXELS: u64 = 100_000_000;
/// Allowed columns and rows of an image: the same library counts them in signed 16-bit numbers.
const SIDE_PX: std::ops::RangeInclusive<u32> = 16..=32767;

/// Checks the size of a camera's images before any memory of that size is allocated.
///
/// # Errors
/// The end of a sentence about the images: their size and the allowed size.
pub fn check_image_size(resolution_px: [u32; 2]) -> Result<(), String> {
    let [width, height] = resolution_px;
    let is_side = resolution_px.iter().all(|n| SIDE_PX.contains(n));
    if is_side && u64::from(width) * u64::from(height) <= MAX_PIXELS {
        return Ok(());
    }
    let (least, most, megapixels) = (SIDE_PX.start(), SIDE_PX.end(), MAX_PIXELS / 1_000_000);
    Err(format!(
        "{width} x {height} pixels; each side may have {least} .. {most}, and an image up to {megapixels} megapixels"
    ))
}

/// An unknown lens: it projects no point, and all its numbers are NaN.
#[derive(Clone, Copy, Debug)]
pub struct UnknownLens {
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: [f64; 4],
    resolution_px: [u32; 2],
}

impl Default for UnknownLens {
    fn default() -> Self {
        Self { focal_px: [f64::NAN; 2], center_px: [f64::NAN; 2], distortion: [f64::NAN; 4], resolution_px: [0; 2] }
    }
}

/// All unknown lenses are equal.
impl PartialEq for UnknownLens {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl UnknownLens {
    fn project(&self, _: &Vector3<f64>) -> Option<Vector2<f64>> {
        None
    }

    fn project_with_jacobian(&self, _: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        None
    }

    fn unproject(&self, _: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        None
    }

    fn by_intrinsics(&self, _: &Vector3<f64>) -> Option<SMatrix<f64, 2, 8>> {
        None
    }

    fn is_monotonic(&self) -> bool {
        false
    }
}

/// A camera: a lens, and the window in front of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraModel {
    /// Lens in air if there is a window, otherwise in its medium.
    pub lens: LensModel,
    /// Window in front of the lens; `None` if the lens was calibrated in its medium.
    pub port: Option<FlatPort>,
}

/// Evaluates the same expression on the lens of each model.
macro_rules! of_lens {
    ($camera:expr, $lens:ident => $value:expr) => {
        match &$camera.lens {
            LensModel::Equidistant($lens) => $value,
            LensModel::Radtan($lens) => $value,
            LensModel::Unknown($lens) => $value,
        }
    };
}

impl CameraModel {
    /// Returns the camera with an unknown lens, which projects no point.
    #[must_use]
    pub fn unknown() -> Self {
        Self { lens: LensModel::Unknown(UnknownLens::default()), port: None }
    }

    /// Returns true if the lens is known.
    #[inline]
    #[must_use]
    pub fn is_known(&self) -> bool {
        !matches!(self.lens, LensModel::Unknown(_))
    }

    /// Returns the pixel of a point (camera frame, m); `None` if the point is outside the lens's view.
    #[inline]
    #[must_use]
    pub fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        match &self.port {
            None => of_lens!(self, lens => lens.project(point_m)),
            Some(port) => {
                let direction = port.direction_in_air(point_m)?;
                of_lens!(self, lens => lens.project(&direction))
            }
        }
    }

    /// Returns the pixel of a point less than `within_rad` off the axis; `None` for other points.
    #[inline]
    #[must_use]
    pub fn project_within(&self, point_m: &Vector3<f64>, within_rad: f64) -> Option<Vector2<f64>> {
        let radius_m = point_m.x.hypot(point_m.y);
        let angle_rad = radius_m.atan2(point_m.z);
        if angle_rad.partial_cmp(&within_rad) != Some(std::cmp::Ordering::Less) {
            return None;
        }
        match (&self.port, &self.lens) {
            (None, LensModel::Equidistant(lens)) => lens.project_at(point_m, radius_m, angle_rad),
            _ => self.project(point_m),
        }
    }

    /// Returns true if a pixel has a bearing by [`Self::unproject`].
    #[must_use]
    pub fn sees(&self, pixel_px: &Vector2<f64>) -> bool {
        match (&self.port, &self.lens) {
            (None, LensModel::Equidistant(lens)) => lens.radius_seen(pixel_px).is_some(),
            _ => self.unproject(pixel_px).is_some(),
        }
    }

    /// Returns projection and d(pixel)/d(point), px/m; `None` if the point is outside the lens's view.
    #[inline]
    #[must_use]
    pub fn project_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        match &self.port {
            None => of_lens!(self, lens => lens.project_with_jacobian(point_m)),
            Some(port) => {
                let (direction, by_point) = port.direction_with_jacobian(point_m)?;
                let (pixel, by_direction) = of_lens!(self, lens => lens.project_with_jacobian(&direction))?;
                Some((pixel, by_direction * by_point))
            }
        }
    }

    /// Returns the bearing (camera frame, unit) of a pixel; `None` if no point is projected to it. Behind a window rays
    /// do not meet in one point: the bearing is that of the ray's point at 1 m.
    #[must_use]
    pub fn unproject(&self, pixel_px: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        let direction = of_lens!(self, lens => lens.unproject(pixel_px))?;
        self.port.as_ref().map_or(Some(direction), |port| port.direction_in_water(&direction))
    }

    /// Returns the derivatives of a point's pixel by [`Self::intrinsics`]; `None` if the point is outside the lens's
    /// view.
    #[must_use]
    pub fn by_intrinsics(&self, point_m: &Vector3<f64>) -> Option<SMatrix<f64, 2, 8>> {
        let direction = self.port.map_or(Some(*point_m), |port| port.direction_in_air(point_m))?;
        of_lens!(self, lens => lens.by_intrinsics(&direction))
    }

    /// Focal lengths, centre, and the first four coefficients of distortion.
    #[must_use]
    pub fn intrinsics(&self) -> [f64; 8] {
        let ([fx, fy], [cx, cy]) = (self.focal_px(), self.center_px());
        let [a, b, c, d] = of_lens!(self, lens => std::array::from_fn(|k| lens.distortion[k]));
        [fx, fy, cx, cy, a, b, c, d]
    }

    /// Returns the camera with other [`Self::intrinsics`].
    #[must_use]
    pub fn with_intrinsics(&self, [fx, fy, cx, cy, k @ ..]: [f64; 8]) -> Self {
        let mut other = *self;
        match &mut other.lens {
            LensModel::Equidistant(lens) => {
                (lens.focal_px, lens.center_px, lens.distortion) = ([fx, fy], [cx, cy], k);
            }
            LensModel::Radtan(lens) => {
                (lens.focal_px, lens.center_px) = ([fx, fy], [cx, cy]);
                lens.distortion[..4].copy_from_slice(&k);
            }
            LensModel::Unknown(_) => {}
        }
        other
    }

    /// Columns and rows.
    #[inline]
    #[must_use]
    pub fn resolution_px(&self) -> [u32; 2] {
        of_lens!(self, lens => lens.resolution_px)
    }

    /// Focal lengths along x and y.
    #[inline]
    #[must_use]
    pub fn focal_px(&self) -> [f64; 2] {
        of_lens!(self, lens => lens.focal_px)
    }

    /// Principal point, x and y.
    #[inline]
    #[must_use]
    pub fn center_px(&self) -> [f64; 2] {
        of_lens!(self, lens => lens.center_px)
    }

    /// All coefficients of distortion in the order of their model.
    #[must_use]
    pub fn distortion(&self) -> Vec<f64> {
        of_lens!(self, lens => lens.distortion.to_vec())
    }

    /// Returns the model's name as used by ROS and Kalibr.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self.lens {
            LensModel::Equidistant(_) => "equidistant",
            LensModel::Radtan(_) => "plumb_bob",
            LensModel::Unknown(_) => "unknown",
        }
    }

    /// Half of the field of view in front of the window; points beyond it are not projected.
    #[must_use]
    pub fn max_view_angle_rad(&self) -> f64 {
        let angle_rad = match &self.lens {
            LensModel::Equidistant(lens) => lens.max_view_angle_rad,
            LensModel::Radtan(lens) => (lens.max_radius() * (1.0 - 1e-9)).atan(),
            LensModel::Unknown(_) => 0.0,
        };
        match &self.port {
            None => angle_rad,
            Some(port) => (angle_rad.min(std::f64::consts::FRAC_PI_2).sin() / port.water_index).asin(),
        }
    }

    /// Returns true if the projected radius grows with the angle, so that each pixel has one bearing.
    #[must_use]
    pub fn is_monotonic(&self) -> bool {
        of_lens!(self, lens => lens.is_monotonic())
    }

    /// Returns true if a pixel lies in the image.
    #[inline]
    #[must_use]
    pub fn contains(&self, pixel_px: &Vector2<f64>) -> bool {
        let [w, h] = self.resolution_px().map(f64::from);
        (0.0..=w - 1.0).contains(&pixel_px.x) && (0.0..=h - 1.0).contains(&pixel_px.y)
    }
}

impl From<Fisheye> for CameraModel {
    fn from(lens: Fisheye) -> Self {
        Self { lens: LensModel::Equidistant(lens), port: None }
    }
}

impl From<Radtan> for CameraModel {
    fn from(lens: Radtan) -> Self {
        Self { lens: LensModel::Radtan(lens), port: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::fixture::lens;
    use proptest::prelude::*;

    fn cameras() -> [CameraModel; 4] {
        let port = FlatPort { distance_m: 0.02, thickness_m: 0.01, glass_index: 1.49, water_index: 1.333 };
        let pinhole: CameraModel =
            Radtan::new([500.0, 501.0], [610.0, 515.0], [-0.12, 0.03, 5e-4, -3e-4, 0.01], [1224, 1024]).into();
        [lens(), pinhole, CameraModel { port: Some(port), ..lens() }, CameraModel { port: Some(port), ..pinhole }]
    }

    #[test]
    fn an_unknown_lens_sees_nothing_and_has_no_numbers() {
        let camera = CameraModel::unknown();
        let ahead = Vector3::z();
        assert!(!camera.is_known() && lens().is_known());
        assert!(camera.project(&ahead).is_none() && camera.project_with_jacobian(&ahead).is_none());
        assert!(camera.by_intrinsics(&ahead).is_none() && camera.unproject(&Vector2::zeros()).is_none());
        assert!(!camera.contains(&Vector2::zeros()) && !camera.is_monotonic());
        assert!(camera.intrinsics().iter().all(|value| value.is_nan()));
        assert_eq!(camera.with_intrinsics([1.0; 8]), camera);
    }

    proptest! {
        #[test]
        fn derivatives_are_those_of_differences(x in -0.6f64..0.6, y in -0.6f64..0.6, z in 0.3f64..2.0) {
            const H: f64 = 1e-6;
            let point = Vector3::new(x, y, z);
            for camera in cameras() {
                let Some((pixel, by_point)) = camera.project_with_jacobian(&point) else { continue };
                prop_assert!(camera.project(&point).is_none_or(|p| (p - pixel).norm() < 1e-9));
                for axis in 0..3 {
                    let ends = [H, -H].map(|h| camera.project(&(point + Vector3::ith(axis, h))));
                    let [Some(plus), Some(minus)] = ends else { continue };
                    let difference = (plus - minus) / (2.0 * H);
                    prop_assert!((by_point.column(axis) - difference).norm() < 1e-4 * (1.0 + difference.norm()));
                }
                let by_intrinsics = camera.by_intrinsics(&point).expect("in view");
                for k in 0..8 {
                    let ends = [H, -H].map(|h| {
                        let mut at = camera.intrinsics();
                        at[k] += h;
                        camera.with_intrinsics(at).project(&point)
                    });
                    let [Some(plus), Some(minus)] = ends else { continue };
                    let difference = (plus - minus) / (2.0 * H);
                    let off = (by_intrinsics.column(k) - difference).norm();
                    prop_assert!(off < 1e-4 * (1.0 + difference.norm()), "{k}: {off}");
                }
            }
        }

        #[test]
        fn what_is_within_an_angle_is_what_is_projected(x in -1.5f64..1.5, y in -1.5f64..1.5, z in -0.2f64..2.0) {
            const WITHIN_RAD: f64 = 0.9;
            let point = Vector3::new(x, y, z);
            for camera in cameras() {
                let is_within = x.hypot(y).atan2(z) < WITHIN_RAD;
                let expected = camera.project(&point).filter(|_| is_within);
                prop_assert_eq!(camera.project_within(&point, WITHIN_RAD), expected);
            }
        }

        #[test]
        fn what_sees_is_what_has_a_direction(x in -3000.0f64..4000.0, y in -3000.0f64..4000.0) {
            let pixel = Vector2::new(x, y);
            for camera in cameras() {
                prop_assert_eq!(camera.sees(&pixel), camera.unproject(&pixel).is_some());
            }
        }

        #[test]
        fn a_square_behind_a_port_has_its_pose(x in -0.2f64..0.2, y in -0.2f64..0.2, z in 0.4f64..1.5) {
            use crate::optics::{solve_square, square_corners};
            use nalgebra::{Isometry3, Translation3, UnitQuaternion};
            for camera in cameras() {
                let turn = UnitQuaternion::from_scaled_axis(Vector3::new(2.8, 0.3, 0.2));
                let pose = Isometry3::from_parts(Translation3::new(x, y, z), turn);
                let corners = square_corners(0.15).map(|corner| camera.project(&(pose * corner).coords));
                let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
                let solved = solve_square(&camera, 0.15, &[a, b, c, d].map(Into::into)).expect("a pose");
                let off = solved.camera_from_tag.isometry().inv_mul(&pose);
                prop_assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6);
            }
        }
    }
}
