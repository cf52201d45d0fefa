//! Scenes with known truth, for tests.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::tagmap::{Body, MapDetection, MapInput, MapSettings, MapView, NoiseScale, TagPrior};
use armcal_core::optics::{CameraModel, square_corners};
use armcal_core::stats::stream_rng;
use armcal_core::time::Stamp;

pub(super) struct Scene {
    pub(super) cameras: Vec<CameraModel>,
    pub(super) bodies: Vec<Body>,
    pub(super) priors: Vec<TagPrior>,
    /// True poses, base_from_tag.
    pub(super) truth: Vec<Isometry3<f64>>,
    pub(super) views: Vec<MapView>,
    /// True poses, base_from_camera.
    pub(super) cameras_at: Vec<Isometry3<f64>>,
}

impl Scene {
    pub(super) fn input(&self) -> MapInput<'_> {
        MapInput { cameras: &self.cameras, views: &self.views, bodies: &self.bodies, tags: &self.priors }
    }
}

/// Settings for corners with a known noise of 0.3 px.
pub(super) fn settings() -> MapSettings {
    MapSettings { base_tag: Some(0), noise: NoiseScale::Given, ..MapSettings::default() }
}

pub(super) fn body(name: &str) -> Body {
    Body { name: name.to_owned(), is_static: true, pose: None }
}

/// A pose whose z axis points from `at` to `target`, turned about this axis by `spin_rad`.
pub(super) fn looking(at: Vector3<f64>, target: Vector3<f64>, spin_rad: f64) -> Isometry3<f64> {
    let forward = (target - at).normalize();
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), &forward)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    Isometry3::from_parts(Translation3::from(at), facing * UnitQuaternion::from_scaled_axis(Vector3::z() * spin_rad))
}

/// Detections of the tags in a camera, with noise; tags that are cut off or seen from behind are omitted.
pub(super) fn look(
    camera: &CameraModel,
    base_from_camera: &Isometry3<f64>,
    tags: &[(u32, f64, Isometry3<f64>)],
    noise_px: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<MapDetection> {
    let mut seen = Vec::new();
    for (id, size_m, base_from_tag) in tags {
        let camera_from_tag = base_from_camera.inv_mul(base_from_tag);
        let faces = (camera_from_tag.rotation * Vector3::z()).dot(&camera_from_tag.translation.vector.normalize());
        let mut corners_px = [[0.0; 2]; 4];
        let mut is_whole = faces < -0.17;
        for (pixel, corner) in corners_px.iter_mut().zip(square_corners(*size_m)) {
            let projected = camera.project(&(camera_from_tag * corner).coords);
            let [w, h] = camera.resolution_px().map(f64::from);
            match projected {
                Some(p) if (0.0..w).contains(&p.x) && (0.0..h).contains(&p.y) => {
                    *pixel = [p.x, p.y].map(|v| {
                        let error: f64 = StandardNormal.sample(rng);
                        v + noise_px * error
                    });
                }
                _ => is_whole = false,
            }
        }
        if is_whole {
            seen.push(MapDetection { id: *id, corners_px, covariance_px2: None });
        }
    }
    seen
}

/// `n_tags` on a bent wall, seen by `n_views` cameras in front of it.
pub(super) fn wall(camera: CameraModel, n_tags: u32, n_views: usize, noise_px: f64, seed: u64) -> Scene {
    let mut rng = stream_rng(seed, "tag map scene");
    let mut truth = Vec::new();
    for id in 0..n_tags {
        let place = if id == 0 {
            Vector3::zeros()
        } else {
            Vector3::new(rng.random_range(-0.8..0.8), rng.random_range(-0.6..0.6), rng.random_range(-0.3..0.3))
        };
        let turn = Vector3::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), rng.random_range(-3.0..3.0));
        truth.push(Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_scaled_axis(turn)));
    }
    let tags: Vec<_> = truth.iter().enumerate().map(|(id, pose)| (id as u32, size_of(id as u32), *pose)).collect();
    let mut noise = stream_rng(seed, "tag map noise");
    let mut views = Vec::new();
    let mut cameras_at = Vec::new();
    while views.len() < n_views {
        let at = Vector3::new(rng.random_range(-1.0..1.0), rng.random_range(-0.8..0.8), rng.random_range(0.8..1.6));
        let target = Vector3::new(rng.random_range(-0.3..0.3), rng.random_range(-0.3..0.3), 0.0);
        let pose = looking(at, target, rng.random_range(-3.0..3.0));
        let tags = look(&camera, &pose, &tags, noise_px, &mut noise);
        let stamp = Stamp { nanos: 1_000_000 * views.len() as i64 };
        views.push(MapView { camera: 0, stamp, tags, attitude: None });
        cameras_at.push(pose);
    }
    let priors = tags.iter().map(|(id, size_m, pose)| TagPrior {
        id: *id,
        size_m: *size_m,
        body: 0,
        pose: (*id == 0).then_some(*pose),
        std: None,
    });
    Scene { cameras: vec![camera], bodies: vec![body("base")], priors: priors.collect(), truth, views, cameras_at }
}

pub(super) fn size_of(id: u32) -> f64 {
    if id.is_multiple_of(2) { 0.15 } else { 0.1 }
}

pub(super) fn fisheye() -> CameraModel {
    armcal_core::optics::fixture::lens()
}

pub(super) fn pinhole() -> CameraModel {
    armcal_core::optics::Radtan::new(
        [1506.9, 1506.28],
        [641.176, 524.495],
        [-0.233024, 0.217972, 0.000104351, -9.65731e-05, -0.0913426],
        [1280, 1024],
    )
    .into()
}

pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}
