//! The Cramer-Rao bound by an independent method: dense, by central differences of the projection at the truth.

use nalgebra::{DMatrix, Isometry3, Matrix3, Vector6};

use crate::tagmap::tests::fixture::{Scene, size_of};
use armcal_core::optics::square_corners;
use armcal_core::spatial::exp;

const STEP: f64 = 1e-6;

/// Lower bound of each tag's position covariance for unbiased estimators, m^2, base frame; tag 0 is held.
pub(super) fn cramer_rao(scene: &Scene, ids: &[u32], noise_px: f64) -> Vec<Matrix3<f64>> {
    let free: Vec<u32> = ids.iter().copied().filter(|id| *id != 0).collect();
    let views: Vec<usize> = (0..scene.views.len()).filter(|view| !scene.views[*view].tags.is_empty()).collect();
    let n_rows: usize = scene.views.iter().map(|view| 8 * view.tags.len()).sum();
    let mut jacobian = DMatrix::zeros(n_rows, 6 * (free.len() + views.len()));
    let mut row = 0;
    for (at, view) in views.iter().enumerate() {
        let pose = scene.cameras_at[*view];
        for tag in &scene.views[*view].tags {
            let truth = scene.truth[tag.id as usize];
            let camera = &scene.cameras[scene.views[*view].camera];
            let pixels = |camera_at: &Isometry3<f64>, tag_at: &Isometry3<f64>| -> Vec<f64> {
                let corners = square_corners(size_of(tag.id));
                let seen = corners.map(|c| camera.project(&(camera_at.inv_mul(tag_at) * c).coords).expect("was seen"));
                seen.iter().flat_map(|p| [p.x, p.y]).collect()
            };
            for k in 0..6 {
                let mut step = Vector6::zeros();
                step[k] = STEP;
                let (ahead, back) = (exp(&step), exp(&-step));
                let column = |plus: Vec<f64>, minus: Vec<f64>| -> Vec<f64> {
                    plus.iter().zip(minus).map(|(a, b)| (a - b) / (2.0 * STEP)).collect()
                };
                let of_view = column(pixels(&(pose * ahead), &truth), pixels(&(pose * back), &truth));
                for (r, value) in of_view.into_iter().enumerate() {
                    jacobian[(row + r, 6 * (free.len() + at) + k)] = value;
                }
                let Some(place) = free.iter().position(|id| *id == tag.id) else { continue };
                let of_tag = column(pixels(&pose, &(truth * ahead)), pixels(&pose, &(truth * back)));
                for (r, value) in of_tag.into_iter().enumerate() {
                    jacobian[(row + r, 6 * place + k)] = value;
                }
            }
            row += 8;
        }
    }
    let information = jacobian.tr_mul(&jacobian) / (noise_px * noise_px);
    let covariance = information.cholesky().expect("the views determine the tags").inverse();
    let position = |(place, id): (usize, &u32)| {
        let turn = scene.truth[*id as usize].rotation.to_rotation_matrix();
        turn * covariance.fixed_view::<3, 3>(6 * place, 6 * place).into_owned() * turn.transpose()
    };
    free.iter().enumerate().map(position).collect()
}
