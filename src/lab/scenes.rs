//! The scenes of the detection study: seven tags before the camera, all at one range, leaning by set angles.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use armcal_core::optics::{CameraModel, square_corners};
use armcal_core::robot::Shape;
use armcal_core::stats::stream_rng;
use armcal_sim::imaging::{Light, SolidShape, TagPlane};
use armcal_sim::{ImageSpec, WaterKind};

/// Side of a tag's black square, m.
pub const TAG_SIZE_M: f64 = 0.15;
const WATERS: [WaterKind; 3] = [WaterKind::Clear, WaterKind::Coastal, WaterKind::Turbid];
/// Motion of the image while the shutter is open, px.
const BLURS_PX: [f64; 2] = [0.0, 3.0];
const RANGES_M: [f64; 10] = [0.4, 0.6, 0.8, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0];
/// Angle between a tag's normal and the line of sight, deg; each once in an image.
const INCIDENCES_DEG: [f64; 7] = [0.0, 20.0, 40.0, 55.0, 65.0, 72.0, 78.0];
/// Angles from the axis, rad, between which six tags stand about the one in the middle.
const RING_RAD: [f64; 2] = [0.55, 0.95];
/// Marine snow by kind of water, flakes per m^3. Assumed.
const SNOW_PER_M3: [f64; 3] = [100.0, 500.0, 2000.0];
/// Distance of a textured wall behind the range, m, in every second image; the others show open water.
const WALL_BEHIND_M: f64 = 0.4;
/// Flux of each of two lamps, of a work-class vehicle, lm. Assumed.
const FLUX_LM: f64 = 10_000.0;
const LAMP_HALF_ANGLE_RAD: f64 = 1.0;

/// Condition that all its images share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    pub water: WaterKind,
    pub blur_px: f64,
    pub range_m: f64,
    /// Number of the image under this condition.
    pub repeat: u32,
}

/// A tag placed before the camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedTag {
    pub id: u32,
    pub incidence_rad: f64,
    pub camera_from_tag: Isometry3<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct Scene {
    pub tags: Vec<PlacedTag>,
    /// Tag frame from the camera when the shutter opens, halfway, and when it closes; halfway the two frames coincide.
    pub from_camera: [Isometry3<f64>; 3],
    pub has_wall: bool,
}

/// All conditions, `n_repeats` times each.
#[must_use]
pub fn conditions(n_repeats: u32) -> Vec<Condition> {
    let mut all = Vec::new();
    for water in WATERS {
        for blur_px in BLURS_PX {
            for range_m in RANGES_M {
                all.extend((0..n_repeats).map(|repeat| Condition { water, blur_px, range_m, repeat }));
            }
        }
    }
    all
}

/// Name of the water in a routine.
#[must_use]
pub fn water_name(water: WaterKind) -> &'static str {
    match water {
        WaterKind::Clear => "clear",
        WaterKind::Coastal => "coastal",
        WaterKind::Turbid => "turbid",
    }
}

pub(super) fn image_spec(water: WaterKind) -> ImageSpec {
    ImageSpec { water, snow_per_m3: SNOW_PER_M3[water as usize], ..ImageSpec::default() }
}

/// Lamps on a bar above the camera, to its left and right.
pub(super) fn lights() -> Vec<Light> {
    let ahead = Unit::new_normalize(Vector3::new(0.0, 0.2, 1.0));
    let light = |x: f64| Light {
        position_m: [x, -0.4, -0.3].into(),
        direction: ahead,
        flux_lm: FLUX_LM,
        half_angle_rad: LAMP_HALF_ANGLE_RAD,
    };
    vec![light(-0.7), light(0.7)]
}

/// A wall across the axis.
pub(super) fn wall() -> SolidShape {
    SolidShape { shape: Shape::Box { size_m: [12.0, 12.0, 0.1] }, color_rgb: [120; 3], is_ground: true }
}

pub(super) fn wall_place(range_m: f64) -> Isometry3<f64> {
    Isometry3::translation(0.0, 0.0, range_m + WALL_BEHIND_M)
}

impl Scene {
    pub(super) fn new(lens: &CameraModel, condition: &Condition, seed: u64) -> Self {
        let Condition { water, blur_px, range_m, repeat } = *condition;
        let name = format!("study/detection/{}/{blur_px}/{range_m}/{repeat}", water_name(water));
        let mut rng = stream_rng(seed, &name);
        let mut incidences = INCIDENCES_DEG.map(f64::to_radians);
        shuffle(&mut incidences, &mut rng);
        let turn = rng.random_range(0.0..std::f64::consts::TAU);
        let first_id = rng.random_range(0..500_u32);
        let tags = incidences.iter().enumerate().map(|(k, incidence)| {
            let around = turn + (k as f64 + rng.random_range(-0.1..0.1)) * std::f64::consts::TAU / 6.0;
            let aside = if k == 0 { rng.random_range(0.0..0.1) } else { rng.random_range(RING_RAD[0]..RING_RAD[1]) };
            let sight = Vector3::new(aside.sin() * around.cos(), aside.sin() * around.sin(), aside.cos());
            let [azimuth, spin] = [(); 2].map(|()| rng.random_range(0.0..std::f64::consts::TAU));
            let camera_from_tag = placed(sight * range_m, *incidence, azimuth, spin);
            PlacedTag { id: first_id + 12 * k as u32, incidence_rad: *incidence, camera_from_tag }
        });
        let tags = tags.collect();
        // A sideways motion that moves the centre of the image by the blur.
        let way: f64 = rng.random_range(0.0..std::f64::consts::TAU);
        let half_m = 0.5 * blur_px * range_m / lens.focal_px()[0];
        let moved = |share: f64| Isometry3::translation(share * half_m * way.cos(), share * half_m * way.sin(), 0.0);
        Self { tags, from_camera: [moved(-1.0), moved(0.0), moved(1.0)], has_wall: repeat % 2 == 0 }
    }

    pub(super) fn planes(&self) -> Vec<TagPlane> {
        self.tags.iter().map(|tag| TagPlane::fixed(tag.id, TAG_SIZE_M, tag.camera_from_tag)).collect()
    }

    /// A tag's corners, px, averaged over the exposure (Simpson's rule); `None` unless all are in the image.
    pub(super) fn corners_px(&self, lens: &CameraModel, tag: &PlacedTag) -> Option<[[f64; 2]; 4]> {
        let mut mean = [[0.0; 2]; 4];
        for (from_camera, weight) in self.from_camera.iter().zip([1.0, 4.0, 1.0]) {
            for (sum, corner) in mean.iter_mut().zip(square_corners(TAG_SIZE_M)) {
                let point = from_camera.inverse() * tag.camera_from_tag * corner;
                let pixel = lens.project(&point.coords).filter(|pixel| lens.contains(pixel))?;
                sum[0] += weight / 6.0 * pixel.x;
                sum[1] += weight / 6.0 * pixel.y;
            }
        }
        Some(mean)
    }
}

/// A tag at `center_m` that leans by `incidence_rad` from facing the camera.
fn placed(center_m: Vector3<f64>, incidence_rad: f64, azimuth_rad: f64, spin_rad: f64) -> Isometry3<f64> {
    let facing = UnitQuaternion::rotation_between(&Vector3::z(), &-center_m).unwrap_or_else(UnitQuaternion::identity);
    let axis = Vector3::new(azimuth_rad.cos(), azimuth_rad.sin(), 0.0);
    let lean = UnitQuaternion::from_scaled_axis(axis * incidence_rad);
    let spin = UnitQuaternion::from_scaled_axis(Vector3::z() * spin_rad);
    Isometry3::from_parts(Translation3::from(center_m), facing * lean * spin)
}

/// Shuffles by the method of Fisher and Yates.
fn shuffle(values: &mut [f64], rng: &mut ChaCha8Rng) {
    for k in (1..values.len()).rev() {
        values.swap(k, rng.random_range(0..=k));
    }
}
