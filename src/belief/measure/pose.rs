//! A tag's pose in the camera's frame.
//!
//! The residual is `-log(measured^-1 X)` in the tag's frame; X moves by `exp(-xi) X = X exp(-Ad(X^-1) xi)`.

use nalgebra::{Isometry3, Matrix6, Vector3, Vector6};

use crate::measure::information::PoseInformation;
use armcal_core::spatial::{adjoint, log, skew};

/// Returns the information of a pose. `info`: inverse variances along (m^-2) and about (rad^-2) the tag's axes.
pub(super) fn information(
    tag_from_camera: &Isometry3<f64>,
    info: [f64; 2],
    camera_from_tag: &Isometry3<f64>,
) -> PoseInformation {
    let off = log(&(tag_from_camera * camera_from_tag));
    let jacobian = -right_jacobian_inverse(&off) * adjoint(&camera_from_tag.inverse());
    let info = Vector6::from_fn(|k, _| info[k / 3]);
    let weighted = jacobian.transpose() * Matrix6::from_diagonal(&info);
    PoseInformation {
        h: weighted * jacobian,
        g: weighted * -off,
        adjoint: adjoint(camera_from_tag),
        chi2: off.component_mul(&off).dot(&info),
        corner_chi2: [0.0; 4],
    }
}

/// Returns the inverse of the right Jacobian of SE(3), to the second order: `log(exp(d) exp(x)) = d + J x`. Valid for
/// small deviations from a prior (Barfoot, eq. 7.83).
pub(crate) fn right_jacobian_inverse(d: &Vector6<f64>) -> Matrix6<f64> {
    let rho = skew(&Vector3::new(d[0], d[1], d[2]));
    let phi = skew(&Vector3::new(d[3], d[4], d[5]));
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&phi);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&phi);
    ad.fixed_view_mut::<3, 3>(0, 3).copy_from(&rho);
    Matrix6::identity() + 0.5 * ad + ad * ad / 12.0
}
