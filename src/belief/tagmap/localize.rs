//! Pose of a camera from the tags of one image whose places are known; pose of a tag from its images.

use crate::tagmap::constants::localize::{COMPARE_PX, MAX_IMAGES, UNDAMPED};
use nalgebra::{Isometry3, Matrix6, Point3, Vector6};

use crate::measure::{ImagePoint, TwistSums};
use crate::tagmap::linearize::squares;
use crate::tagmap::problem::Observation;
use armcal_core::numeric::{LeastSquares, Loss, Proposal, StopRule, minimize};
use armcal_core::optics::CameraModel;
use armcal_core::spatial::{adjoint, exp};

/// Misfit of poses: the Cauchy loss over all corners, px^2.
fn cost(camera: &CameraModel, camera_from_tag: &Isometry3<f64>, seen: &Observation) -> f64 {
    let loss = Loss::Cauchy { c: COMPARE_PX };
    // Corners have about the same noise; the loss's width is in pixels.
    let px = seen.whiten[0].try_inverse().map_or(1.0, |inverse| inverse.norm() / std::f64::consts::SQRT_2);
    squares(camera, camera_from_tag, seen).into_iter().map(|n2| loss.of(n2 * px * px).0).sum()
}

/// Returns frame_from_camera with the best fit, from each tag's two solutions, refined on all corners; and its misfit.
pub(super) fn localize(
    cameras: &[CameraModel],
    seen: &[(&Observation, Isometry3<f64>)],
) -> Option<(Isometry3<f64>, f64)> {
    let total = |frame_from_camera: &Isometry3<f64>| -> f64 {
        seen.iter().map(|(s, tag)| cost(&cameras[s.camera], &frame_from_camera.inv_mul(tag), s)).sum()
    };
    let mut best: Option<(Isometry3<f64>, f64)> = None;
    for (observation, frame_from_tag) in seen {
        for solution in observation.solutions() {
            let frame_from_camera = frame_from_tag * solution.camera_from_tag.isometry().inverse();
            let misfit = total(&frame_from_camera);
            if best.as_ref().is_none_or(|(_, least)| misfit < *least) {
                best = Some((frame_from_camera, misfit));
            }
        }
    }
    let (at, least) = best?;
    if seen.len() == 1 {
        return Some((at, least));
    }
    Some(refined(at, least, 8, total, |pose| step(cameras, seen, pose)))
}

/// A pose under a cost with its Gauss-Newton step, perturbed on the right.
struct PoseSearch<C, S> {
    at: Isometry3<f64>,
    least: f64,
    trial: Isometry3<f64>,
    trial_cost: f64,
    cost: C,
    step: S,
}

impl<C: Fn(&Isometry3<f64>) -> f64, S: Fn(&Isometry3<f64>) -> Option<Vector6<f64>>> LeastSquares for PoseSearch<C, S> {
    fn cost(&self) -> f64 {
        self.least
    }

    fn propose(&mut self, _: f64) -> Option<Proposal> {
        self.trial = self.at * exp(&(self.step)(&self.at)?);
        Some(Proposal { length: f64::INFINITY, predicted_gain: f64::INFINITY })
    }

    fn trial_cost(&mut self) -> Option<f64> {
        self.trial_cost = (self.cost)(&self.trial);
        Some(self.trial_cost).filter(|trial| *trial < self.least)
    }

    fn accept(&mut self) {
        (self.at, self.least) = (self.trial, self.trial_cost);
    }
}

/// The pose and its cost after at most `n` steps.
fn refined(
    at: Isometry3<f64>,
    least: f64,
    n: usize,
    cost: impl Fn(&Isometry3<f64>) -> f64,
    step: impl Fn(&Isometry3<f64>) -> Option<Vector6<f64>>,
) -> (Isometry3<f64>, f64) {
    let mut search = PoseSearch { at, least, trial: at, trial_cost: least, cost, step };
    minimize(&mut search, &UNDAMPED, &StopRule::after(n));
    (search.at, search.least)
}

/// Gauss-Newton step under the comparing loss.
fn step(
    cameras: &[CameraModel],
    seen: &[(&Observation, Isometry3<f64>)],
    frame_from_camera: &Isometry3<f64>,
) -> Option<Vector6<f64>> {
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    for (observation, frame_from_tag) in seen {
        let camera_from_tag = frame_from_camera.inv_mul(frame_from_tag);
        let (h, g) = information(&cameras[observation.camera], observation, &camera_from_tag);
        normal += h;
        right += g;
    }
    normal.cholesky().map(|normal| normal.solve(&right))
}

/// Information of one tag in one image on the camera's pose, under the comparing loss.
fn information(
    camera: &CameraModel,
    seen: &Observation,
    camera_from_tag: &Isometry3<f64>,
) -> (Matrix6<f64>, Vector6<f64>) {
    let loss = Loss::Cauchy { c: COMPARE_PX };
    let mut sums = TwistSums::default();
    for (corner, measured) in seen.corners_m.iter().zip(&seen.corners_px) {
        let point = camera_from_tag * Point3::from(*corner);
        let Some(image) = ImagePoint::of(camera, &point.coords) else { continue };
        let residual = measured - image.pixel;
        let (_, weight) = loss.of(residual.norm_squared());
        image.by_twist.iter().zip(&residual).for_each(|(row, residual)| sums.add(row, *residual, weight));
    }
    sums.weighted(1.0)
}

/// Returns a tag's pose with the best fit to its images, from the solutions of each, and its misfit; `images` with
/// frame_from_camera.
pub(super) fn place_tag(
    cameras: &[CameraModel],
    images: &[(&Observation, Isometry3<f64>)],
) -> Option<(Isometry3<f64>, f64)> {
    let some: Vec<_> =
        (0..images.len().min(MAX_IMAGES)).map(|k| &images[k * images.len() / images.len().min(MAX_IMAGES)]).collect();
    let mut best: Option<(Isometry3<f64>, f64)> = None;
    for (observation, frame_from_camera) in &some {
        for solution in observation.solutions() {
            let frame_from_tag = frame_from_camera * solution.camera_from_tag.isometry();
            let misfit = tag_cost(cameras, images, &frame_from_tag);
            if best.as_ref().is_none_or(|(_, least)| misfit < *least) {
                best = Some((frame_from_tag, misfit));
            }
        }
    }
    best
}

/// Returns a tag's pose after a few Gauss-Newton steps under the comparing loss, with the cameras held.
pub(super) fn refine_tag(
    cameras: &[CameraModel],
    images: &[(&Observation, Isometry3<f64>)],
    start: &Isometry3<f64>,
) -> Isometry3<f64> {
    let least = tag_cost(cameras, images, start);
    refined(*start, least, 6, |pose| tag_cost(cameras, images, pose), |pose| tag_step(cameras, images, pose)).0
}

fn tag_step(
    cameras: &[CameraModel],
    images: &[(&Observation, Isometry3<f64>)],
    frame_from_tag: &Isometry3<f64>,
) -> Option<Vector6<f64>> {
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    for (observation, frame_from_camera) in images {
        let camera_from_tag = frame_from_camera.inv_mul(frame_from_tag);
        let (h, g) = information(&cameras[observation.camera], observation, &camera_from_tag);
        // A motion of the tag is one of the camera the other way.
        let by_tag = -adjoint(&camera_from_tag);
        normal += by_tag.transpose() * (h * by_tag);
        right += by_tag.transpose() * g;
    }
    normal.cholesky().map(|normal| normal.solve(&right))
}

pub(super) fn tag_cost(
    cameras: &[CameraModel],
    images: &[(&Observation, Isometry3<f64>)],
    frame_from_tag: &Isometry3<f64>,
) -> f64 {
    images
        .iter()
        .map(|(s, frame_from_camera)| cost(&cameras[s.camera], &frame_from_camera.inv_mul(frame_from_tag), s))
        .sum()
}

pub(super) fn view_cost(
    cameras: &[CameraModel],
    seen: &[(&Observation, Isometry3<f64>)],
    frame_from_camera: &Isometry3<f64>,
) -> f64 {
    seen.iter().map(|(s, tag)| cost(&cameras[s.camera], &frame_from_camera.inv_mul(tag), s)).sum()
}
