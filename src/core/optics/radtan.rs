//! The pinhole with radial and tangential distortion.

use nalgebra::{Matrix2, Matrix2x3, SMatrix, Unit, Vector2, Vector3};

/// Brown's model (1971) as in OpenCV's `projectPoints`, ROS's `plumb_bob` and Kalibr's `radtan`.
/// With `(a, b) = (x, y)/z` and `r^2 = a^2 + b^2`:
/// `a' = a (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 a b + p2 (r^2 + 2 a^2)`,
/// `b' = b (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 b^2) + 2 p2 a b`, `pixel = f * (a', b') + c`.
/// Pixel centres are at integers. With all coefficients zero it is the plain pinhole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radtan {
    /// Focal lengths along x and y.
    pub focal_px: [f64; 2],
    /// Principal point, x and y.
    pub center_px: [f64; 2],
    /// Distortion coefficients k1, k2, p1, p2, k3: the order of OpenCV.
    pub distortion: [f64; 5],
    /// Columns and rows.
    pub resolution_px: [u32; 2],
    /// Largest r in view: up to there the distorted radius grows, so that each pixel has one bearing.
    max_radius: f64,
}

/// Largest radius in the view of a pinhole: 79 deg from the axis.
const WIDEST_RADIUS: f64 = 5.0;
const RADIUS_STEPS: u32 = 2000;
/// Largest radius of a projection, over the radius of the image's farthest corner.
const MARGIN: f64 = 1.5;

impl Radtan {
    /// Builds the lens with its range of unique bearings, searched from the axis outwards to 1.5 times the radius of
    /// the image's corners.
    #[must_use]
    pub fn new(focal_px: [f64; 2], center_px: [f64; 2], distortion: [f64; 5], resolution_px: [u32; 2]) -> Self {
        let mut lens = Self { focal_px, center_px, distortion, resolution_px, max_radius: 0.0 };
        let farthest = farthest_corner(focal_px, center_px, resolution_px) * MARGIN;
        for i in 1..=RADIUS_STEPS {
            let r = WIDEST_RADIUS * f64::from(i) / f64::from(RADIUS_STEPS);
            if lens.radial_slope(r * r) <= 0.0 {
                break;
            }
            lens.max_radius = r;
            if r * lens.radial(r * r) > farthest {
                break;
            }
        }
        lens
    }

    /// Tangent of the largest angle from the axis in view.
    #[must_use]
    pub fn max_radius(&self) -> f64 {
        self.max_radius
    }

    /// Returns true if the projected radius grows over the whole view.
    #[must_use]
    pub fn is_monotonic(&self) -> bool {
        (0..=200).all(|i| self.radial_slope((self.max_radius * f64::from(i) / 200.0).powi(2)) > 0.0)
    }

    fn radial(&self, r2: f64) -> f64 {
        let [k1, k2, _, _, k3] = self.distortion;
        1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    }

    /// Returns d(r radial)/dr.
    fn radial_slope(&self, r2: f64) -> f64 {
        let [k1, k2, _, _, k3] = self.distortion;
        1.0 + r2 * (3.0 * k1 + r2 * (5.0 * k2 + r2 * 7.0 * k3))
    }

    /// Returns the distorted coordinates of `(a, b)` and their Jacobian.
    fn distort(&self, a: f64, b: f64) -> (Vector2<f64>, Matrix2<f64>) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = a * a + b * b;
        let radial = self.radial(r2);
        // The derivative d radial / d(r^2).
        let slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
        let value = Vector2::new(
            a * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a),
            b * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b,
        );
        let cross = 2.0 * a * b * slope + 2.0 * p1 * a + 2.0 * p2 * b;
        let jacobian = Matrix2::new(
            radial + 2.0 * a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a,
            cross,
            cross,
            radial + 2.0 * b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a,
        );
        (value, jacobian)
    }

    /// Returns `(x, y)/z` of a point in view.
    fn normalized(&self, point_m: &Vector3<f64>) -> Option<(f64, f64)> {
        if point_m.z.partial_cmp(&1e-9) != Some(std::cmp::Ordering::Greater) {
            return None;
        }
        let (a, b) = (point_m.x / point_m.z, point_m.y / point_m.z);
        (a.hypot(b) <= self.max_radius).then_some((a, b))
    }

    /// Projects a point (camera frame, m); `None` behind the camera or beyond the range of unique bearings.
    #[must_use]
    pub fn project(&self, point_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        let (a, b) = self.normalized(point_m)?;
        let (d, _) = self.distort(a, b);
        Some(Vector2::new(self.focal_px[0] * d.x + self.center_px[0], self.focal_px[1] * d.y + self.center_px[1]))
    }

    /// Returns projection and d(pixel)/d(point), px/m.
    #[must_use]
    pub fn project_with_jacobian(&self, point_m: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let (a, b) = self.normalized(point_m)?;
        let (d, of_distortion) = self.distort(a, b);
        let z = point_m.z;
        let of_division = Matrix2x3::new(1.0 / z, 0.0, -a / z, 0.0, 1.0 / z, -b / z);
        let focal = Matrix2::new(self.focal_px[0], 0.0, 0.0, self.focal_px[1]);
        let pixel =
            Vector2::new(self.focal_px[0] * d.x + self.center_px[0], self.focal_px[1] * d.y + self.center_px[1]);
        Some((pixel, focal * of_distortion * of_division))
    }

    /// Returns d(pixel)/d(fx, fy, cx, cy, k1, k2, p1, p2).
    pub(super) fn by_intrinsics(&self, point_m: &Vector3<f64>) -> Option<SMatrix<f64, 2, 8>> {
        let (a, b) = self.normalized(point_m)?;
        let (d, _) = self.distort(a, b);
        let r2 = a * a + b * b;
        let [fx, fy] = self.focal_px;
        let (x, y) = (fx * a * r2, fy * b * r2);
        let row = |focal: [f64; 2], center: [f64; 2], k: [f64; 4]| {
            SMatrix::<f64, 1, 8>::from_row_slice(&[focal[0], focal[1], center[0], center[1], k[0], k[1], k[2], k[3]])
        };
        Some(SMatrix::from_rows(&[
            row([d.x, 0.0], [1.0, 0.0], [x, x * r2, fx * 2.0 * a * b, fx * (r2 + 2.0 * a * a)]),
            row([0.0, d.y], [0.0, 1.0], [y, y * r2, fy * (r2 + 2.0 * b * b), fy * 2.0 * a * b]),
        ]))
    }

    /// Returns the bearing (camera frame, unit) of a pixel; `None` beyond the range of unique bearings.
    #[must_use]
    pub fn unproject(&self, pixel_px: &Vector2<f64>) -> Option<Unit<Vector3<f64>>> {
        let seen = Vector2::new(
            (pixel_px.x - self.center_px[0]) / self.focal_px[0],
            (pixel_px.y - self.center_px[1]) / self.focal_px[1],
        );
        if !(seen.x.is_finite() && seen.y.is_finite()) {
            return None;
        }
        let mut at = self.radially_undistorted(&seen)?;
        // The tangential part is a small correction: Newton's method starts at the radial solution.
        for _ in 0..20 {
            let (value, jacobian) = self.distort(at.x, at.y);
            let step = jacobian.try_inverse()? * (seen - value);
            at += step;
            if step.norm() < 1e-15 {
                break;
            }
        }
        let (value, _) = self.distort(at.x, at.y);
        let is_solved = (value - seen).norm() < 1e-9 && at.norm() <= self.max_radius;
        is_solved.then(|| Unit::new_normalize(Vector3::new(at.x, at.y, 1.0)))
    }

    /// Inverts the radial part by bisection, then Newton's method.
    fn radially_undistorted(&self, seen: &Vector2<f64>) -> Option<Vector2<f64>> {
        let wanted = seen.norm();
        if wanted < 1e-12 {
            return Some(*seen);
        }
        let (mut low, mut high) = (0.0, self.max_radius);
        let mut r = wanted.min(high);
        for _ in 0..60 {
            let error = r * self.radial(r * r) - wanted;
            if error > 0.0 {
                high = r;
            } else {
                low = r;
            }
            let newton = r - error / self.radial_slope(r * r);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - r).abs() < 1e-14 {
                break;
            }
            r = next;
        }
        Some(seen * (r / wanted))
    }
}

/// Distance of the image's farthest corner from the centre, in focal lengths.
pub(super) fn farthest_corner(focal_px: [f64; 2], center_px: [f64; 2], resolution_px: [u32; 2]) -> f64 {
    let [w, h] = resolution_px.map(f64::from);
    let corners = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]];
    let radius = |[x, y]: [f64; 2]| ((x - center_px[0]) / focal_px[0]).hypot((y - center_px[1]) / focal_px[1]);
    corners.into_iter().map(radius).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lens() -> Radtan {
        Radtan::new(
            [1506.9, 1506.28],
            [641.176, 524.495],
            [-0.233024, 0.217972, 0.000104351, -9.65731e-05, -0.0913426],
            [1280, 1024],
        )
    }

    proptest! {
        #[test]
        fn unproject_undoes_project(x in -0.6f64..0.6, y in -0.6f64..0.6, z in 0.25f64..2.0) {
            let point = Vector3::new(x * z, y * z, z);
            let pixel = lens().project(&point).expect("in view");
            let bearing = lens().unproject(&pixel).expect("a projected point has a bearing");
            prop_assert!(bearing.cross(&point.normalize()).norm() < 1e-12);
        }

        #[test]
        fn jacobian_agrees_with_central_differences(x in -0.5f64..0.5, y in -0.5f64..0.5, z in 0.3f64..2.0) {
            let point = Vector3::new(x * z, y * z, z);
            let (pixel, jacobian) = lens().project_with_jacobian(&point).expect("in view");
            prop_assert!((pixel - lens().project(&point).expect("in view")).norm() < 1e-12);
            let h = 1e-6;
            for axis in 0..3 {
                let mut step = Vector3::zeros();
                step[axis] = h;
                let at = |p: Vector3<f64>| lens().project(&p).expect("in view");
                let difference = (at(point + step) - at(point - step)) / (2.0 * h);
                prop_assert!((jacobian.column(axis) - difference).norm() < 1e-5 * (1.0 + difference.norm()));
            }
        }
    }

    #[test]
    fn what_has_no_unique_bearing_is_not_seen() {
        assert!(lens().project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
        assert!(lens().project(&Vector3::new(0.1, 0.0, 0.0)).is_none());
        assert!(lens().project(&Vector3::new(9.0, 0.0, 1.0)).is_none());
        assert!(lens().unproject(&Vector2::new(1e5, 0.0)).is_none());
        assert!(lens().unproject(&Vector2::new(f64::NAN, 0.0)).is_none());
        // Every pixel of the image has a bearing.
        for (x, y) in [(0.0, 0.0), (1279.0, 0.0), (0.0, 1023.0), (1279.0, 1023.0)] {
            assert!(lens().unproject(&Vector2::new(x, y)).is_some());
        }
    }
}
