//! Information of one observation on the camera's pose relative to the tag.
//!
//! With X = camera_from_tag, a point c of the tag is at p = X c. The camera's pose perturbed on the right by xi = (rho,
//! omega) moves it by `dp = -rho - omega x p`; the tag's by xi_T does the same with the opposite sign and `xi = Ad(X)
//! xi_T`. So one 6x6 matrix in the camera's frame contains all information: `H = sum J^T W J`, `g = sum J^T W r`, J =
//! d(prediction)/d(xi), r = measured - predicted.

use nalgebra::{Matrix6, SMatrix, SVector, Vector6};

use crate::measure::projection::ImagePoint;

/// Linearized observation, in the camera's frame.
#[derive(Clone, Debug)]
pub(crate) struct PoseInformation {
    pub h: Matrix6<f64>,
    pub g: Vector6<f64>,
    /// Ad(camera_from_tag).
    pub adjoint: Matrix6<f64>,
    /// Sum of squares of the whitened residuals.
    pub chi2: f64,
    /// Sum of squares of each corner's whitened residuals, used or not; zero without corners.
    pub corner_chi2: [f64; 4],
}

/// Information on the lens's intrinsics: focal lengths, centre, four distortion coefficients.
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

    /// Adds a point: the derivatives of its pixel by the intrinsics, its residual, its weight.
    pub(crate) fn add(
        &mut self,
        image: &ImagePoint,
        by_intrinsics: &SMatrix<f64, 2, 8>,
        residual_px: [f64; 2],
        weight: f64,
    ) {
        let rows = image.by_twist.iter().zip(by_intrinsics.row_iter());
        for ((row, by_intrinsics), residual) in rows.zip(residual_px) {
            let column = by_intrinsics.transpose();
            let weighted = column * weight;
            self.cross += Vector6::from(*row) * weighted.transpose();
            self.h += column * weighted.transpose();
            self.g += weighted * residual;
        }
    }
}

/// Running sums over the rows of residuals.
#[derive(Clone, Debug, Default)]
pub(crate) struct TwistSums {
    /// Lower triangle of `H`.
    h: [[f64; 6]; 6],
    g: [f64; 6],
}

impl TwistSums {
    /// Adds a coordinate of a point: its row by the twist, its residual, its weight.
    #[inline]
    pub(crate) fn add(&mut self, row: &[f64; 6], residual: f64, weight: f64) {
        for i in 0..6 {
            let by = weight * row[i];
            self.g[i] += by * residual;
            self.h[i].iter_mut().zip(&row[..=i]).for_each(|(h, other)| *h += by * other);
        }
    }

    /// Returns `H` and `g`, times a weight that all rows share.
    pub(crate) fn weighted(&self, weight: f64) -> (Matrix6<f64>, Vector6<f64>) {
        let h = Matrix6::from_fn(|i, k| weight * if i >= k { self.h[i][k] } else { self.h[k][i] });
        (h, Vector6::from(self.g) * weight)
    }
}

impl PoseInformation {
    pub(crate) fn weighted(&mut self, weight: f64) {
        self.h *= weight;
        self.g *= weight;
    }
}
