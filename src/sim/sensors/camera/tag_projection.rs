//! Projection of one tag: visibility, corner pixels, motion blur and corner noise.

use nalgebra::{Isometry3, Point3, Vector2, Vector3};

use crate::body_poses::BodyPoses;
use crate::sensors::camera::ported_lens::PortedLens;
use crate::solids::Solids;
use crate::spec::CameraWorldSpec;
use armcal_core::kinematics::Attachment;
use armcal_core::optics::{CornerNoise, square_corners};

/// Distance from the tag at which lines of sight end: neither its pose nor that of its backing is exact.
const CLEAR_OF_BACKING_M: f64 = 0.006;

#[derive(Clone, Copy, Debug)]
pub(super) struct TagInBase {
    pub id: u32,
    pub size_m: f64,
    pub base_from_tag: Isometry3<f64>,
}

/// Tag on a link, or on the base.
#[derive(Clone, Copy, Debug)]
pub(super) struct TagOnLink {
    pub id: u32,
    pub size_m: f64,
    /// Mount of the tag as built.
    pub mount: Attachment,
}

impl TagOnLink {
    pub(super) fn at(&self, links: &BodyPoses) -> TagInBase {
        let Attachment { n_joints, link_from_frame } = self.mount;
        let base_from_tag = if n_joints == 0 { link_from_frame } else { links.frame(&self.mount) };
        TagInBase { id: self.id, size_m: self.size_m, base_from_tag }
    }
}

/// Corners of a tag in the image, with range, incidence, size and blur.
#[derive(Clone, Copy, Debug)]
pub(super) struct TagProjection {
    pub corners_px: [Vector2<f64>; 4],
    range_m: f64,
    cos_incidence: f64,
    side_px: f64,
    /// Largest displacement of a corner during the exposure.
    blur_px: f64,
}

/// Camera and scene of a projection. Lines of sight are straight: an occluding shape is in the water like the tag.
#[derive(Clone, Copy)]
pub(super) struct TagProjector<'a> {
    pub spec: &'a CameraWorldSpec,
    pub lens: &'a PortedLens,
    pub solids: &'a Solids,
    pub housing: &'a [usize],
    /// Fitted noise model, which replaces the standard noise and limits.
    pub fitted: Option<&'a CornerNoise>,
}

/// Smallest cosine of incidence with fitted noise. Its detection probability covers range, incidence and size.
const MIN_COS_INCIDENCE: f64 = 0.05;

impl TagProjector<'_> {
    pub(super) fn project(&self, tag: &TagInBase, base_from_camera: &Isometry3<f64>) -> Option<TagProjection> {
        let camera_from_tag = base_from_camera.inverse() * tag.base_from_tag;
        let center = camera_from_tag.translation.vector;
        let range_m = center.norm();
        let normal = camera_from_tag.rotation * Vector3::z();
        let cos_incidence = -normal.dot(&center) / range_m;
        let is_beyond_limits = match self.fitted {
            Some(_) => cos_incidence < MIN_COS_INCIDENCE,
            None => range_m > self.spec.max_range_m || cos_incidence < self.spec.max_incidence_rad.cos(),
        };
        if is_beyond_limits {
            return None;
        }
        let corners_px = self.corners_px(tag, &camera_from_tag)?;
        let side_px = (0..4).map(|k| (corners_px[k] - corners_px[(k + 1) % 4]).norm()).fold(f64::INFINITY, f64::min);
        let pupil = Point3::from(base_from_camera.translation.vector);
        let in_front = |p: &Point3<f64>| tag.base_from_tag * (p + Vector3::z() * CLEAR_OF_BACKING_M);
        let is_hidden = |p: &Point3<f64>| self.solids.hides(&pupil, &in_front(p), self.housing);
        let corners = square_corners(tag.size_m);
        let is_too_small = self.fitted.is_none() && side_px < self.spec.min_side_px;
        if is_too_small || is_hidden(&Point3::origin()) || corners.iter().any(is_hidden) {
            return None;
        }
        Some(TagProjection { corners_px, range_m, cos_incidence, side_px, blur_px: 0.0 })
    }

    /// Averages the corners over the exposure (Simpson's rule) by `earlier` camera poses, at its start and halfway.
    /// `None` for a tag that was not in the image all the time.
    pub(super) fn average_over_exposure(
        &self,
        at_end: TagProjection,
        tag: &TagInBase,
        earlier: Option<&[Isometry3<f64>; 2]>,
    ) -> Option<TagProjection> {
        let Some([start, middle]) = earlier else { return Some(at_end) };
        let start = self.corners_px(tag, &(start.inverse() * tag.base_from_tag))?;
        let middle = self.corners_px(tag, &(middle.inverse() * tag.base_from_tag))?;
        let end = at_end.corners_px;
        let corners_px = std::array::from_fn(|k| (start[k] + middle[k] * 4.0 + end[k]) / 6.0);
        let blur_px = (0..4).map(|k| (end[k] - start[k]).norm()).fold(0.0, f64::max);
        Some(TagProjection { corners_px, blur_px, ..at_end })
    }

    fn corners_px(&self, tag: &TagInBase, camera_from_tag: &Isometry3<f64>) -> Option<[Vector2<f64>; 4]> {
        let mut corners_px = [Vector2::zeros(); 4];
        for (pixel, corner) in corners_px.iter_mut().zip(&square_corners(tag.size_m)) {
            *pixel = self.lens.project(&(camera_from_tag * corner).coords).filter(|p| self.lens.contains(p))?;
        }
        Some(corners_px)
    }
}

impl TagProjection {
    /// Returns the corners with noise, from normal numbers of unit variance; `None` for a missed tag. `uniform` is in
    /// 0..1.
    pub(super) fn detected(
        &self,
        projector: &TagProjector,
        uniform: f64,
        noise: &[Vector2<f64>; 4],
    ) -> Option<[Vector2<f64>; 4]> {
        let Some(fitted) = projector.fitted else {
            let std_px = self.corner_std_px(projector.spec);
            return Some(std::array::from_fn(|k| self.corners_px[k] + std_px * noise[k]));
        };
        if uniform >= fitted.chance.of(self.side_px, self.range_m) {
            return None;
        }
        let corners_px = self.corners_px.map(Into::into);
        let covariances = fitted.covariances_px2(&corners_px, self.range_m, self.blur_px);
        let mut noisy = self.corners_px;
        for ((corner, covariance), noise) in noisy.iter_mut().zip(covariances).zip(noise) {
            *corner += covariance.cholesky()?.l() * noise;
        }
        Some(noisy)
    }

    /// Returns the standard deviation per coordinate.
    fn corner_std_px(&self, spec: &CameraWorldSpec) -> f64 {
        let sharp_px = spec.corner_noise_px * (0.8 + 0.2 * self.range_m) / self.cos_incidence.sqrt();
        sharp_px * (1.0 + spec.blur_noise_per_px * self.blur_px)
    }

    /// Returns a plausible margin for readers that filter by it: large and frontal tags have nearly 100.
    pub(super) fn decision_margin(&self) -> f64 {
        100.0 * self.cos_incidence * (1.0 - (-self.side_px / 40.0).exp())
    }
}
