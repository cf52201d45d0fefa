//! Lenses estimated from the views, together with the poses of cameras and tags.

use nalgebra::{DMatrix, DVector, Dyn, Matrix6, OMatrix, U6};

use crate::tagmap::adjust::{MAX_STEPS, minimize, scale};
use crate::tagmap::columns::{ByUnknown, Columns, Information, Linearized};
use crate::tagmap::constants::adjust::HUBER_WIDTH;
use crate::tagmap::constants::lens_fit::{
    ENOUGH_GAIN, MAX_LENS_STEPS, PER_CAMERA, PRECISE, SHORTENED, WIDE_CENTER, WIDE_DISTORTION, WIDE_FOCAL,
};
use crate::tagmap::linearize::cost;
use crate::tagmap::problem::MapProblem;
use armcal_core::numeric::Loss;
use armcal_core::optics::CameraModel;

/// Errors of fitted lenses, and the effect on the tags.
#[derive(Clone, Debug)]
pub(super) struct LensErrors {
    /// Covariance of the intrinsics of all cameras, eight each.
    pub(super) covariance: DMatrix<f64>,
    /// Jacobians d(pose of the node)/d(intrinsics).
    pub(super) nodes: Vec<OMatrix<f64, U6, Dyn>>,
}

impl LensErrors {
    /// Contribution of the lenses' errors to the joint covariance of two nodes.
    pub(super) fn common(&self, a: usize, b: usize) -> Matrix6<f64> {
        &self.nodes[a] * &self.covariance * self.nodes[b].transpose()
    }
}

/// Returns the lenses with the best fit, starting from those of the problem.
pub(super) fn fit_lenses(problem: &MapProblem<'_>) -> Option<Vec<CameraModel>> {
    let loss = loss_of(problem);
    let stated = problem.cameras.to_vec();
    let mut best = problem.clone();
    let mut least = cost(&best, loss);
    for _ in 0..MAX_LENS_STEPS {
        let information = information(&Linearized::of(&best, loss)?, stated.len());
        let step = step_within(&information, &stated, &best.cameras)?;
        let Some((next, next_cost)) = SHORTENED.iter().find_map(|share| stepped(&best, &(&step * *share), loss, least))
        else {
            break;
        };
        let gain = least - next_cost;
        (best, least) = (next, next_cost);
        if gain < ENOUGH_GAIN {
            break;
        }
    }
    Some(best.cameras.into_owned())
}

/// Errors of the lenses at a solution with fitted lenses.
pub(super) fn lens_errors(problem: &MapProblem<'_>) -> Option<LensErrors> {
    let information = information(&Linearized::of(problem, loss_of(problem))?, problem.cameras.len());
    let precision = &information.matrix + wide(&problem.cameras);
    Some(LensErrors { covariance: precision.cholesky()?.inverse(), nodes: information.nodes })
}

fn loss_of(problem: &MapProblem<'_>) -> Loss {
    Loss::Huber { k: HUBER_WIDTH * scale(problem) }
}

fn information(linearized: &Linearized<'_, '_>, n_cameras: usize) -> Information {
    let n = PER_CAMERA * n_cameras;
    linearized.information(&Columns {
        n,
        concerns: &|_| true,
        by_unknown: &|corner, _| {
            let mut all = ByUnknown::zeros(n);
            let own = corner.camera.by_intrinsics(&corner.point.coords)?;
            all.columns_mut(PER_CAMERA * corner.seen.camera, PER_CAMERA).copy_from(&own);
            Some(all)
        },
    })
}

/// Prior information on any lens: keeps a step possible where the views do not determine it.
fn wide(cameras: &[CameraModel]) -> DMatrix<f64> {
    let of_camera = |camera: &CameraModel| {
        let [focal_x, focal_y] = camera.focal_px().map(|focal_px| WIDE_FOCAL * focal_px);
        let center = WIDE_CENTER * camera.focal_px()[0];
        let k = WIDE_DISTORTION;
        [focal_x, focal_y, center, center, k, k, k, k].map(|std: f64| std.powi(-2))
    };
    DMatrix::from_diagonal(&DVector::from_vec(cameras.iter().flat_map(of_camera).collect()))
}

fn step_within(information: &Information, stated: &[CameraModel], now: &[CameraModel]) -> Option<DVector<f64>> {
    let wide = wide(stated);
    let off = |(stated, now): (&CameraModel, &CameraModel)| {
        let (stated, now) = (stated.intrinsics(), now.intrinsics());
        (0..PER_CAMERA).map(move |k| now[k] - stated[k])
    };
    let off = DVector::from_vec(stated.iter().zip(now).flat_map(off).collect());
    let right = &information.right - &wide * off;
    Some((&information.matrix + wide).cholesky()?.solve(&right))
}

/// Returns the problem with lenses after a step and poses that follow; `None` if it fits no better.
fn stepped<'a>(problem: &MapProblem<'a>, step: &DVector<f64>, loss: Loss, least: f64) -> Option<(MapProblem<'a>, f64)> {
    let mut next = problem.clone();
    for (idx, camera) in next.cameras.to_mut().iter_mut().enumerate() {
        let now = camera.intrinsics();
        *camera = camera.with_intrinsics(std::array::from_fn(|k| now[k] + step[PER_CAMERA * idx + k]));
        if camera.focal_px().iter().any(|focal_px| focal_px.is_nan() || *focal_px <= 0.0) {
            return None;
        }
    }
    next.steps_left = MAX_STEPS;
    minimize(&mut next, loss, PRECISE);
    let found = cost(&next, loss);
    (found < least).then_some((next, found))
}
