//! A corridor of tags on two walls, as for TagSLAM: the camera moves along it and sees only nearby tags.

use armcal::optics::{CameraModel, Radtan, square_corners};
use armcal::stats::stream_rng;
use armcal::tagmap::{Body, MapDetection, MapInput, MapSettings, MapView, TagMap, TagPrior, solve};
use armcal::time::Stamp;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::measure::{Cost, FarEnd, Row, measured};

const HALF_WIDTH_M: f64 = 1.25;
/// Distance from tag to tag along the corridor, m; tags are alternately on the left and on the right.
const PITCH_M: f64 = 0.25;
const TAG_SIZE_M: f64 = 0.16;
/// Largest range at which the detector finds a tag, m.
const MAX_RANGE_M: f64 = 3.0;
/// Least sine of the angle between the line of sight and the tag's plane.
const LEAST_SLANT: f64 = 0.25;
const CORNER_STD_PX: f64 = 0.3;
/// Angle by which the camera swings from wall to wall along its way.
const SWING_RAD: f64 = 0.6;
const SWING_EVERY_M: f64 = 1.7;
const N_SEEDS: u64 = 20;

struct Corridor {
    camera: CameraModel,
    truth: Vec<Isometry3<f64>>,
    views: Vec<MapView>,
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A map of the corridor from all of its images.
pub fn mapped(n_views: usize, n_tags: usize) -> Row {
    mapped_by_seed(n_views, n_tags, 1)
}

/// Sum over seeds; errors and standard deviations as root mean squares, distances as their mean.
pub fn mapped_over_seeds(n_views: usize, n_tags: usize) -> Row {
    let rows: Vec<Row> = (1..=N_SEEDS).map(|seed| mapped_by_seed(n_views, n_tags, seed)).collect();
    let ends: Vec<&FarEnd> = rows.iter().filter_map(|row| row.far_end.as_ref()).collect();
    let rms =
        |of: &dyn Fn(&FarEnd) -> f64| (ends.iter().map(|end| of(end).powi(2)).sum::<f64>() / ends.len() as f64).sqrt();
    let far_end = FarEnd {
        along_mm: [0, 1].map(|k| rms(&|end| end.along_mm[k])),
        across_mm: [0, 1].map(|k| rms(&|end| end.across_mm[k])),
        squared_distance: ends.iter().map(|end| end.squared_distance).sum::<f64>() / ends.len() as f64,
    };
    let cpu_s = rows.iter().map(|row| row.cost.cpu_s).sum();
    let memory_mb = rows.iter().map(|row| row.cost.memory_mb).fold(0.0, f64::max);
    Row {
        n_detections: rows.iter().map(|row| row.n_detections).sum(),
        steps: rows.iter().map(|row| row.steps).sum(),
        cost: Cost { cpu_s, memory_mb },
        far_end: Some(far_end),
    }
}

fn mapped_by_seed(n_views: usize, n_tags: usize, seed: u64) -> Row {
    let Corridor { camera, truth, views } = corridor(n_views, n_tags, seed);
    let bodies = [Body { name: "corridor".to_owned(), is_static: true, pose: None }];
    let prior = |(id, pose): (usize, &Isometry3<f64>)| {
        let pose = (id == 0).then_some(*pose);
        TagPrior { id: id as u32, size_m: TAG_SIZE_M, body: 0, pose, std: None }
    };
    let priors: Vec<TagPrior> = truth.iter().enumerate().map(prior).collect();
    let input = MapInput { cameras: &[camera], views: &views, bodies: &bodies, tags: &priors };
    let settings = MapSettings { base_tag: Some(0), corner_std_px: CORNER_STD_PX, ..MapSettings::default() };
    let (map, cost) = measured(|| solve(&input, &settings).expect("the corridor can be mapped"));
    assert!(map.has_converged && map.groups.len() == 1, "{:?}", map.warnings);
    assert_eq!(map.tags.len(), n_tags, "every tag is in the map");
    Row { n_detections: map.n_detections, steps: map.n_steps, cost, far_end: Some(far_end(&map, &truth)) }
}

fn far_end(map: &TagMap, truth: &[Isometry3<f64>]) -> FarEnd {
    let last = map.tags.last().expect("the map has tags");
    let error_m = last.frame_from_tag.translation.vector - truth[last.id as usize].translation.vector;
    let std_m = last.position_std_m();
    let covariance = last.position_covariance_m2().cholesky().expect("its place is not known exactly");
    FarEnd {
        along_mm: [1e3 * error_m.x, 1e3 * std_m[0]],
        across_mm: [1e3 * error_m.y, 1e3 * std_m[1]],
        squared_distance: error_m.dot(&covariance.solve(&error_m)),
    }
}

fn corridor(n_views: usize, n_tags: usize, seed: u64) -> Corridor {
    let mut rng = stream_rng(seed, "corridor of the growth");
    let camera: CameraModel =
        Radtan::new([800.0, 800.0], [640.0, 512.0], [-0.23, 0.06, 1e-4, -1e-4, 0.0], [1280, 1024]).into();
    let truth: Vec<_> = (0..n_tags).map(|id| tag(id, &mut rng)).collect();
    // The way begins where the first tags are visible and ends where the last ones are not any more.
    let (first_m, last_m) = (-2.5, PITCH_M * n_tags as f64 - 1.0);
    let views = (0..n_views).map(|k| {
        let x = first_m + (last_m - first_m) * k as f64 / n_views as f64;
        let pose = camera_at(x, &mut rng);
        let stamp = Stamp { nanos: 50_000_000 * k as i64 };
        MapView { camera: 0, stamp, tags: look(&camera, &pose, &truth, &mut rng), attitude: None }
    });
    let views = views.collect();
    Corridor { camera, truth, views }
}

/// Pose of a tag; even ones are on the left, y > 0.
fn tag(id: usize, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let side = if id.is_multiple_of(2) { 1.0 } else { -1.0 };
    let place = Vector3::new(PITCH_M * id as f64, side * HALF_WIDTH_M, rng.random_range(1.0..1.8));
    let (up, out) = (Vector3::z(), Vector3::y() * -side);
    let upright = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[up.cross(&out), up, out]));
    let lean = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| 0.05 * normal(rng)));
    Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_rotation_matrix(&upright) * lean)
}

/// Pose corridor_from_camera: it looks ahead, x to the right, y down.
fn camera_at(x: f64, rng: &mut ChaCha8Rng) -> Isometry3<f64> {
    let at = Vector3::new(x, 0.1 * normal(rng), 1.4 + 0.1 * normal(rng));
    let ahead = Matrix3::from_columns(&[-Vector3::y(), -Vector3::z(), Vector3::x()]);
    let ahead = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(ahead));
    let yaw_rad = SWING_RAD * (std::f64::consts::TAU * x / SWING_EVERY_M).sin();
    let turned = UnitQuaternion::from_scaled_axis(Vector3::z() * yaw_rad);
    let shaken = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| 0.05 * normal(rng)));
    Isometry3::from_parts(Translation3::from(at), turned * ahead * shaken)
}

/// Observations of the tags that are wholly within range and image.
fn look(
    camera: &CameraModel,
    pose: &Isometry3<f64>,
    truth: &[Isometry3<f64>],
    rng: &mut ChaCha8Rng,
) -> Vec<MapDetection> {
    let [w, h] = camera.resolution_px().map(f64::from);
    let reach = (MAX_RANGE_M / PITCH_M).ceil() as usize + 1;
    let about = (pose.translation.x / PITCH_M).max(0.0) as usize;
    let near = about.saturating_sub(reach)..(about + reach).min(truth.len());
    let mut seen = Vec::new();
    for id in near {
        let camera_from_tag = pose.inv_mul(&truth[id]);
        let center = camera_from_tag.translation.vector;
        let slant = -(camera_from_tag.rotation * Vector3::z()).dot(&center.normalize());
        if slant < LEAST_SLANT || center.z <= 0.0 || center.norm() > MAX_RANGE_M {
            continue;
        }
        let pixels = square_corners(TAG_SIZE_M).map(|corner| camera.project(&(camera_from_tag * corner).coords));
        let is_inside = |p: &nalgebra::Vector2<f64>| (0.0..w).contains(&p.x) && (0.0..h).contains(&p.y);
        if pixels.iter().all(|pixel| pixel.as_ref().is_some_and(is_inside)) {
            let noisy = |v: f64, rng: &mut ChaCha8Rng| v + CORNER_STD_PX * normal(rng);
            let corners_px = pixels.map(|p| p.map_or([0.0; 2], |p| [noisy(p.x, rng), noisy(p.y, rng)]));
            seen.push(MapDetection { id: id as u32, corners_px, covariance_px2: None });
        }
    }
    seen
}
