//! The equidistant fisheye lens.

use nalgebra::{Matrix2x3, SMatrix, SVector, Unit, Vector2, Vector3};

/// Equidistant lens: `theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)`,
/// `pixel = f * theta_d * (x, y)/r + c`. Theta is the angle from the optical axis (z) and r = |(x, y)|. Pixel centres
/// are at integers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fisheye {
    /// Focal lengths along x and y.
    pub focal_px: [f64; 2],
    /// Principal point, x and y.
    pub center_px: [f64; 2],
    /// Distortion coefficients k1, k2, k3, k4.
    pub distortion: [f64; 4],
    /// Columns and rows.
    pub resolution_px: [u32; 2],
    /// Half of the field of view; points beyond it are not projected.
    pub max_view_angle_rad: f64,
}

/// Angle beyond the field of view within which points still have derivatives, rad.
const BEYOND_RAD: f64 = 0.05;

impl Fisheye {
    /// Builds a lens whose field of view is not given. The view extends as far from the axis as the projected radius
    /// grows. It ends at most at 1.5 times the radius of the image's corners and at 172 deg.
    #[must_use]
    pub fn with_widest_view(
        focal_px: [f64; 2],
        center_px: [f64; 2],
        distortion: [f64; 4],
        resolution_px: [u32; 2],
    ) -> Self {
        let mut lens = Self { focal_px, center_px, distortion, resolution_px, max_view_angle_rad: 0.0 };
        let farthest = 1.5 * super::radtan::farthest_corner(focal_px, center_px, resolution_px);
        for i in 1..=600 {
            let theta = 0.005 * f64::from(i);
            if lens.distorted_slope(theta) <= 0.0 {
                break;
            }
            lens.max_view_angle_rad = theta;
            if lens.distorted(theta) > farthest {
                break;
            }
        }
        lens
    }

    fn is_far_outside(&self, theta: f64) -> bool {
        let beyond_rad = theta - self.max_view_angle_rad;
        beyond_rad > BEYOND_RAD || beyond_rad > 0.0 && self.distorted_slope(theta) <= 0.0
    }

    fn distorted(&self, theta: f64) -> f64 {
        let [k1, k2, k3, k4] = self.distortion;
        let t2 = theta * theta;
        theta * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    }

    fn distorted_slope(&self, theta: f64) -> f64 {
        let [k1, k2, k3, k4] = self.distortion;
        let t2 = theta * theta;
        1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
    }

    /// Returns true if the projected radius grows with the angle over the whole field of view, so that each pixel has
    /// one bearing.
    #[must_use]
    pub fn is_monotonic(&self) -> bool {
        (0..=200).all(|i| self.distorted_slope(self.max_view_angle_rad * f64::from(i) / 200.0) > 0.0)
    }

    /// Projects a point (camera frame, m); `None` beyond the field of view or at the camera itself.
    #[inline]
    #[must_use]
    pub fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        let r = point_m.x.hypot(point_m.y);
        self.project_at(point_m, r, r.atan2(point_m.z))
    }

    /// Projects a point whose distance from the axis and angle are known.
    #[inline]
    pub(super) fn project_at(&self, point_m: &Vector3<f64>, r: f64, theta: f64) -> Option<Vector2<f64>> {
        if theta > self.max_view_angle_rad || point_m.norm_squared() < 1e-18 {
            return None;
        }
        // theta_d / r tends to 1 / z on the axis.
        let scale = if r > 1e-9 * point_m.z.abs() { self.distorted(theta) / r } else { 1.0 / point_m.z };
        Some(Vector2::new(
            self.focal_px[0] * scale * point_m.x + self.center_px[0],
            self.focal_px[1] * scale * point_m.y + self.center_px[1],
        ))
    }

    /// Returns projection and d(pixel)/d(point), px/m. Points up to 0.05 rad outside the field of view also have a
    /// pixel, if the radius grows there. So an estimate can move a corner across the edge of the view.
    #[must_use]
    pub fn project_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let (x, y, z) = (point_m.x, point_m.y, point_m.z);
        let r = x.hypot(y);
        let theta = r.atan2(z);
        let d2 = r * r + z * z;
        if self.is_far_outside(theta) || d2 < 1e-18 {
            return None;
        }
        let [fx, fy] = self.focal_px;
        // theta_d / r tends to 1 / z on the axis, and so do all derivatives along the image.
        let is_on_axis = r <= 1e-9 * z.abs();
        let scale = if is_on_axis { 1.0 / z } else { self.distorted(theta) / r };
        let pixel = Vector2::new(fx * scale * x + self.center_px[0], fy * scale * y + self.center_px[1]);
        if is_on_axis {
            return Some((pixel, Matrix2x3::new(fx * scale, 0.0, 0.0, 0.0, fy * scale, 0.0)));
        }
        let (ux, uy) = (x / r, y / r);
        // Derivatives with theta = atan2(r, z): along the radius, across it (theta_d / r), and along the axis.
        let slope = self.distorted_slope(theta);
        let (along, axial) = (slope * z / d2, -slope * r / d2);
        let both = (along - scale) * ux * uy;
        let jacobian = Matrix2x3::new(
            fx * (along * ux * ux + scale * uy * uy),
            fx * both,
            fx * axial * ux,
            fy * both,
            fy * (along * uy * uy + scale * ux * ux),
            fy * axial * uy,
        );
        Some((pixel, jacobian))
    }

    /// Returns d(pixel)/d(fx, fy, cx, cy, k1, k2, k3, k4).
    pub(super) fn by_intrinsics(&self, point_m: &Vector3<f64>) -> Option<SMatrix<f64, 2, 8>> {
        let r = point_m.x.hypot(point_m.y);
        let theta = r.atan2(point_m.z);
        if self.is_far_outside(theta) {
            return None;
        }
        let (ux, uy) = if r > 0.0 { (point_m.x / r, point_m.y / r) } else { (0.0, 0.0) };
        let t2 = theta * theta;
        let powers = [theta * t2, theta * t2 * t2, theta * t2 * t2 * t2, theta * t2 * t2 * t2 * t2];
        let distorted = theta + powers.iter().zip(&self.distortion).map(|(t, k)| t * k).sum::<f64>();
        let row = |direction: f64, axis: usize| {
            let mut out = SVector::<f64, 8>::zeros();
            out[axis] = distorted * direction;
            out[2 + axis] = 1.0;
            for (k, power) in powers.iter().enumerate() {
                out[4 + k] = self.focal_px[axis] * direction * power;
            }
            out.transpose()
        };
        Some(SMatrix::from_rows(&[row(ux, 0), row(uy, 1)]))
    }

    /// Returns the bearing (camera frame, unit) of a pixel; `None` beyond the field of view.
    #[must_use]
    pub fn unproject(&self, pixel_px: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        let ([mx, my], theta_d) = self.radius_seen(pixel_px)?;
        let theta = self.undistorted(theta_d);
        let scale = if theta_d > 1e-12 { theta.sin() / theta_d } else { 1.0 };
        Some(Unit::new_normalize(Vector3::new(mx * scale, my * scale, theta.cos())))
    }

    /// Returns a pixel over the focal lengths, and its distance from the axis there; `None` beyond the field of view.
    pub(super) fn radius_seen(&self, pixel_px: &Vector2<f64>) -> Option<([f64; 2], f64)> {
        let mx = (pixel_px.x - self.center_px[0]) / self.focal_px[0];
        let my = (pixel_px.y - self.center_px[1]) / self.focal_px[1];
        let theta_d = mx.hypot(my);
        let is_seen = theta_d.is_finite() && theta_d <= self.distorted(self.max_view_angle_rad);
        is_seen.then_some(([mx, my], theta_d))
    }

    /// Inverts [`Self::distorted`] by Newton's method inside a shrinking bracket, so that it cannot diverge.
    fn undistorted(&self, theta_d: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.max_view_angle_rad);
        let mut theta = theta_d.min(high);
        for _ in 0..50 {
            let error = self.distorted(theta) - theta_d;
            if error > 0.0 {
                high = theta;
            } else {
                low = theta;
            }
            let newton = theta - error / self.distorted_slope(theta);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - theta).abs() < 1e-15 {
                return next;
            }
            theta = next;
        }
        theta
    }

    /// Returns true if a pixel lies in the image.
    #[inline]
    #[must_use]
    pub fn contains(&self, pixel_px: &Vector2<f64>) -> bool {
        let [w, h] = self.resolution_px.map(f64::from);
        (0.0..=w - 1.0).contains(&pixel_px.x) && (0.0..=h - 1.0).contains(&pixel_px.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::fixture::lens;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn unproject_undoes_project(x in -2.0f64..2.0, y in -2.0f64..2.0, z in 0.25f64..2.0) {
            let point = Vector3::new(x, y, z);
            if let Some(pixel) = lens().project(&point) {
                let bearing = lens().unproject(&pixel).expect("a projected point lies in the field of view");
                prop_assert!(bearing.cross(&point.normalize()).norm() < 1e-10);
            }
        }

        #[test]
        fn jacobian_agrees_with_central_differences(x in -1.0f64..1.0, y in -1.0f64..1.0, z in 0.3f64..2.0) {
            let point = Vector3::new(x, y, z);
            let Some((_, jacobian)) = lens().project_with_jacobian(&point) else { return Ok(()) };
            let h = 1e-6;
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = h;
                let (Some(plus), Some(minus)) = (lens().project(&(point + step)), lens().project(&(point - step)))
                else { return Ok(()) };
                let difference = (plus - minus) / (2.0 * h);
                prop_assert!((jacobian.column(axis) - difference).norm() < 1e-4 * (1.0 + difference.norm()));
            }
        }
    }

    #[test]
    fn derivatives_go_on_beyond_the_edge_of_the_field_of_view() {
        let lens = crate::optics::fixture::fisheye();
        let at = |angle_rad: f64| Vector3::new(angle_rad.sin(), 0.0, angle_rad.cos());
        let edge_rad = lens.max_view_angle_rad;
        let radius_px = |angle_rad: f64| lens.project_with_jacobian(&at(angle_rad)).map(|(pixel, _)| pixel.x);
        assert!(lens.project(&at(edge_rad + 0.01)).is_none());
        assert!(radius_px(edge_rad + 0.01) > radius_px(edge_rad));
        assert_eq!(radius_px(edge_rad + 2.0 * BEYOND_RAD), None);
    }

    #[test]
    fn the_optical_axis_is_regular() {
        let (pixel, jacobian) = lens().project_with_jacobian(&Vector3::new(0.0, 0.0, 2.0)).expect("in view");
        assert!((pixel - Vector2::new(633.6, 510.9)).norm() < 1e-12);
        assert!((jacobian[(0, 0)] - 387.33 / 2.0).abs() < 1e-9);
    }
}
