//! Motion of a pixel caused by a motion of the camera.

use nalgebra::{Matrix2x3, Vector3};

/// Returns the rows of d(pixel)/d(xi), px/m and px/rad. The camera's pose, perturbed on the right by
/// `xi = (rho, omega)`, moves a point p of its frame by `-rho - omega x p`. `by_point` is d(pixel)/d(point) of the lens
/// at `point`.
#[must_use]
pub fn image_jacobian(by_point: &Matrix2x3<f64>, point: &Vector3<f64>) -> [[f64; 6]; 2] {
    let p = point;
    std::array::from_fn(|axis| {
        let a = [by_point[(axis, 0)], by_point[(axis, 1)], by_point[(axis, 2)]];
        // The product a . (-rho - omega x p) gives -a for rho, and a x p for omega.
        [-a[0], -a[1], -a[2], a[1] * p.z - a[2] * p.y, a[2] * p.x - a[0] * p.z, a[0] * p.y - a[1] * p.x]
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector6};

    use super::*;
    use crate::optics::Fisheye;

    #[test]
    fn it_is_the_difference_of_pixels_of_a_camera_that_moves() {
        let lens =
            Fisheye::with_widest_view([640.0, 642.0], [960.0, 540.0], [0.02, -0.01, 0.003, -0.001], [1920, 1080]);
        let step = 1e-6;
        for point in [Vector3::new(0.1, -0.2, 0.9), Vector3::new(-0.5, 0.3, 0.4), Vector3::new(0.0, 0.0, 1.3)] {
            let (_, by_point) = lens.project_with_jacobian(&point).expect("it is in view");
            let rows = image_jacobian(&by_point, &point);
            for k in 0..6 {
                let pixel = |step: f64| {
                    let mut xi = Vector6::zeros();
                    xi[k] = step;
                    let moved = Isometry3::from_parts(
                        Translation3::new(xi[0], xi[1], xi[2]),
                        UnitQuaternion::from_scaled_axis(Vector3::new(xi[3], xi[4], xi[5])),
                    );
                    lens.project(&moved.inverse_transform_vector(&(point - moved.translation.vector))).expect("in view")
                };
                let difference = (pixel(step) - pixel(-step)) / (2.0 * step);
                for axis in 0..2 {
                    let off = (rows[axis][k] - difference[axis]).abs();
                    assert!(
                        off < 1e-4 * (1.0 + difference[axis].abs()),
                        "{point} {k}: {} {}",
                        rows[axis][k],
                        difference[axis]
                    );
                }
            }
        }
    }
}
