//! A tag's position in the camera's frame.

use nalgebra::{Isometry3, SMatrix, Vector3};

use crate::measure::information::PoseInformation;
use armcal_core::spatial::{adjoint, skew};

/// Returns the information of a position. `info`: inverse variance of each coordinate, m^-2.
pub(super) fn information(in_camera_m: &Vector3<f64>, info: f64, camera_from_tag: &Isometry3<f64>) -> PoseInformation {
    let p = camera_from_tag.translation.vector;
    let residual = in_camera_m - p;
    let mut jacobian = SMatrix::<f64, 3, 6>::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(-1.0);
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&skew(&p));
    let transposed = jacobian.transpose() * info;
    PoseInformation {
        h: transposed * jacobian,
        g: transposed * residual,
        adjoint: adjoint(camera_from_tag),
        chi2: info * residual.norm_squared(),
        corner_chi2: [0.0; 4],
    }
}
