//! What one observation says of the camera's pose relative to the tag.
//!
//! With X = camera_from_tag, a point c of the tag is at p = X c. The camera's pose perturbed on the right by xi = (rho,
//! omega) moves it by `dp = -rho - omega x p`; the tag's by xi_T does the same with the opposite sign and
//! `xi = Ad(X) xi_T`. So one 6x6 matrix in the camera's frame carries all: `H = sum J^T W J`, `g = sum J^T W r`, J =
//! d(prediction)/d(xi), r = measured - predicted.

use nalgebra::{Isometry3, Matrix2x3, Matrix6, SMatrix, SVector, Vector2, Vector3, Vector6};

use crate::calib::bundle::problem::{WeightedMeasurement, WeightedPoint};
use armcal_core::optics::{CameraModel, image_jacobian};
use armcal_core::spatial::{adjoint, log, skew};

/// A observation linearized, in the camera's frame.
#[derive(Clone, Debug)]
pub(crate) struct PoseInformation {
    pub h: Matrix6<f64>,
    pub g: Vector6<f64>,
    /// Ad(camera_from_tag).
    pub adjoint: Matrix6<f64>,
    /// Sum of squares of the whitened residuals.
    pub chi2: f64,
    /// The same of each corner, used or not; zero without corners.
    pub corner_chi2: [f64; 4],
}

/// The lens's part, by its intrinsics: focal lengths, centre, four coefficients of distortion.
#[derive(Clone, Debug)]
pub(crate) struct LensInformation {
    pub cross: SMatrix<f64, 6, 8>,
    pub h: SMatrix<f64, 8, 8>,
    pub g: SVector<f64, 8>,
}

impl LensInformation {
    pub(crate) fn zeros() -> Self {
        Self { cross: SMatrix::zeros(), h: SMatrix::zeros(), g: SVector::zeros() }
    }

    pub(crate) fn weighted(&mut self, weight: f64) {
        self.cross *= weight;
        self.h *= weight;
        self.g *= weight;
    }
}

/// A observation that the lens cannot have seen counts as this many sigma off in each coordinate.
const UNSEEN_SIGMAS: f64 = 1e3;

/// What it costs that the lens cannot have seen `seen`.
pub(crate) fn unseen_chi2(seen: &WeightedMeasurement) -> f64 {
    seen.n_coordinates() as f64 * UNSEEN_SIGMAS * UNSEEN_SIGMAS
}

/// Inverse of the right Jacobian of SE(3), to the second order: `log(exp(d) exp(x)) = d + J x`. For deviations from a
/// prior, which are small (Barfoot, eq. 7.83).
pub(crate) fn right_jacobian_inverse(d: &Vector6<f64>) -> Matrix6<f64> {
    let rho = skew(&Vector3::new(d[0], d[1], d[2]));
    let phi = skew(&Vector3::new(d[3], d[4], d[5]));
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&phi);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&phi);
    ad.fixed_view_mut::<3, 3>(0, 3).copy_from(&rho);
    Matrix6::identity() + 0.5 * ad + ad * ad / 12.0
}

impl PoseInformation {
    /// Linearizes; `noise` multiplies the corners' standard deviations. Adds the lens's part to `by_lens` where that is
    /// wanted. `None` where a corner is beyond the lens's view.
    pub(crate) fn of(
        seen: &WeightedMeasurement,
        camera_from_tag: &Isometry3<f64>,
        lens: &CameraModel,
        noise: f64,
        by_lens: Option<&mut LensInformation>,
    ) -> Option<Self> {
        let scale = noise.powi(-2);
        match seen {
            WeightedMeasurement::Corners { corners_px, half_size_m, info, used } => {
                let corners = Corners { corners_px, half_size_m: *half_size_m, info: info * scale, used };
                of_corners(&corners, camera_from_tag, lens, by_lens)
            }
            WeightedMeasurement::Position { in_camera_m, info } => {
                Some(of_position(in_camera_m, *info, camera_from_tag))
            }
            WeightedMeasurement::Pose { tag_from_camera, info_position, info_rotation } => {
                Some(of_pose(tag_from_camera, *info_position, *info_rotation, camera_from_tag))
            }
            WeightedMeasurement::Board { points } => of_board(points, camera_from_tag, lens, (scale, by_lens)),
        }
    }

    /// A observation that is not possible: it pulls nowhere and costs much.
    pub(crate) fn unseen(seen: &WeightedMeasurement) -> Self {
        let (chi2, corner_chi2) = (unseen_chi2(seen), [UNSEEN_SIGMAS * UNSEEN_SIGMAS; 4]);
        Self { h: Matrix6::zeros(), g: Vector6::zeros(), adjoint: Matrix6::identity(), chi2, corner_chi2 }
    }

    pub(crate) fn weighted(&mut self, weight: f64) {
        self.h *= weight;
        self.g *= weight;
    }
}

/// Corner pixels of a tag and the inverse of their variance.
struct Corners<'a> {
    corners_px: &'a [[f64; 2]; 4],
    half_size_m: f64,
    info: f64,
    used: &'a [bool; 4],
}

fn of_corners(
    corners: &Corners<'_>,
    camera_from_tag: &Isometry3<f64>,
    lens: &CameraModel,
    mut by_lens: Option<&mut LensInformation>,
) -> Option<PoseInformation> {
    let Corners { corners_px, half_size_m, info, used } = *corners;
    let rotation = *camera_from_tag.rotation.to_rotation_matrix().matrix();
    let center = camera_from_tag.translation.vector;
    let (x, y) = (rotation.column(0) * half_size_m, rotation.column(1) * half_size_m);
    let points = [center - x - y, center + x - y, center + x + y, center - x + y];
    let mut h = [[0.0; 6]; 6];
    let mut g = [0.0; 6];
    let (mut chi2, mut corner_chi2) = (0.0, [0.0; 4]);
    let mut projected = [(Vector2::zeros(), Matrix2x3::zeros()); 4];
    for (out, p) in projected.iter_mut().zip(&points) {
        *out = lens.project_with_jacobian(p)?;
    }
    for (corner, ((p, measured), (pixel, by_point))) in points.iter().zip(corners_px).zip(projected).enumerate() {
        let residual = [measured[0] - pixel.x, measured[1] - pixel.y];
        corner_chi2[corner] = info * (residual[0] * residual[0] + residual[1] * residual[1]);
        if !used[corner] {
            continue;
        }
        let rows = image_jacobian(&by_point, p);
        for (row, &r) in rows.iter().zip(&residual) {
            chi2 += r * r;
            for i in 0..6 {
                g[i] += row[i] * r;
                for k in 0..=i {
                    h[i][k] += row[i] * row[k];
                }
            }
        }
        if let Some(by_lens) = &mut by_lens {
            let columns = lens.by_intrinsics(p)?;
            for axis in 0..2 {
                let row = Vector6::from(rows[axis]);
                let column = columns.row(axis).transpose();
                by_lens.cross += row * column.transpose();
                by_lens.h += column * column.transpose();
                by_lens.g += column * residual[axis];
            }
        }
    }
    if let Some(by_lens) = by_lens {
        by_lens.weighted(info);
    }
    let h = Matrix6::from_fn(|i, k| info * if i >= k { h[i][k] } else { h[k][i] });
    let g = Vector6::from(g) * info;
    Some(PoseInformation { h, g, adjoint: adjoint(camera_from_tag), chi2: chi2 * info, corner_chi2 })
}

/// As corners of a tag, with a weight of each; `scale` multiplies the weights.
fn of_board(
    points: &[WeightedPoint],
    camera_from_board: &Isometry3<f64>,
    lens: &CameraModel,
    (scale, mut by_lens): (f64, Option<&mut LensInformation>),
) -> Option<PoseInformation> {
    let (mut h, mut g, mut chi2) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
    for point in points {
        let p = (camera_from_board * point.on_board).coords;
        let (pixel, by_point) = lens.project_with_jacobian(&p)?;
        let info = scale * point.info;
        let rows = image_jacobian(&by_point, &p).map(Vector6::from);
        for (axis, row) in rows.iter().enumerate() {
            let r = point.pixel[axis] - pixel[axis];
            chi2 += info * r * r;
            g += row * (info * r);
            h += row * (row * info).transpose();
        }
        if let Some(by_lens) = &mut by_lens {
            let columns = lens.by_intrinsics(&p)?;
            for (axis, row) in rows.iter().enumerate() {
                let column = columns.row(axis).transpose();
                by_lens.cross += row * (column * info).transpose();
                by_lens.h += column * (column * info).transpose();
                by_lens.g += column * (info * (point.pixel[axis] - pixel[axis]));
            }
        }
    }
    Some(PoseInformation { h, g, adjoint: adjoint(camera_from_board), chi2, corner_chi2: [0.0; 4] })
}

fn of_position(in_camera_m: &Vector3<f64>, info: f64, camera_from_tag: &Isometry3<f64>) -> PoseInformation {
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

/// Residual `-log(measured^-1 X)` in the tag's frame; X moves by `exp(-xi) X = X exp(-Ad(X^-1) xi)`.
fn of_pose(
    tag_from_camera: &Isometry3<f64>,
    info_position: f64,
    info_rotation: f64,
    camera_from_tag: &Isometry3<f64>,
) -> PoseInformation {
    let off = log(&(tag_from_camera * camera_from_tag));
    let jacobian = -right_jacobian_inverse(&off) * adjoint(&camera_from_tag.inverse());
    let info = Vector6::from_fn(|k, _| if k < 3 { info_position } else { info_rotation });
    let weighted = jacobian.transpose() * Matrix6::from_diagonal(&info);
    PoseInformation {
        h: weighted * jacobian,
        g: weighted * -off,
        adjoint: adjoint(camera_from_tag),
        chi2: off.component_mul(&off).dot(&info),
        corner_chi2: [0.0; 4],
    }
}
