//! `[world.image]`: water, light and sensor of rendered images. Read where `camera.mode = "rendered"`.

use std::ops::RangeInclusive;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, table};
use armcal_core::robot::FileIssue;

/// Source of the wrist camera's detections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CameraMode {
    /// Corners are projected and noise is added.
    #[default]
    Geometric,
    /// Images are rendered, and a detector reads them.
    Rendered,
}

impl CameraMode {
    pub(super) fn is_geometric(&self) -> bool {
        *self == Self::Geometric
    }
}

/// Optical class of water, after Jerlov (1976): absorption and scattering for red, green and blue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WaterKind {
    /// Clear ocean water.
    #[default]
    Clear,
    /// Coastal water.
    Coastal,
    /// Harbour water.
    Turbid,
}

table!(
    /// Settings of rendered images.
    #[derive(Copy)]
    ImageSpec {
        /// Factor on the water's coefficients; 0 removes the water.
        turbidity = 1.0, in 0.0..=100.0;
        /// Share of the scattered light that comes back per steradian, for light of the lamps. Petzold (1972): 0.018
        /// over the half sphere.
        backscatter_per_sr = 0.003, in 0.0..=1.0;
        /// Sunlight on a surface that faces up; 0 at depth.
        ambient_lux = 0.0, in 0.0..=1e6;
        /// Number of particles in the water. Assumed; 0 for none.
        snow_per_m3 = 0.0, in 0.0..=1e5;
        /// Mean radius of the particles. Assumed.
        snow_radius_m = 0.0005, in 1e-5..=0.02;
        /// Standard deviation of the lens's blur, a Gaussian. Assumed; 0 for none.
        blur_px = 0.5, in 0.0..=10.0;
        /// Share of the light that is lost at half the image's diagonal from its centre; it grows with the square of
        /// the distance. Assumed; 0 for none.
        vignetting = 0.3, in 0.0..=1.0;
        /// Number of electrons that a pixel collects per cd/m2 in the longest automatic exposure. Assumed: f/2.8, 10
        /// ms, 6.9 um pixels.
        electrons_per_cd_m2 = 100.0, in 1e-3..=1e6;
        /// Number of electrons at which a pixel is full, which is 255 at gain 1. Assumed.
        full_well_electrons = 10_000.0, in 100.0..=1e6;
        /// Noise of reading a pixel, electrons. Assumed.
        read_noise_electrons = 5.0, in 0.0..=1000.0;
        /// Factor on the shot noise's standard deviation: 1 is physical, 0 is none.
        shot_noise = 1.0, in 0.0..=10.0;
        /// Gain behind the pixel; 0: set for each image so that its bright parts are near white.
        gain = 0.0, in 0.0..=1000.0;
        /// Largest automatic gain. Assumed.
        gain_max = 16.0, in 1.0..=1000.0;
        /// Rate of images while nothing asks for them; 0 for none.
        preview_hz = 0.5, in 0.0..=100.0;
        /// Shortest time between recorded images.
        log_period_s = 1.0, in 0.0..=1e6;
        /// JPEG quality of the images, which the detector reads with the same quality.
        jpeg_quality = 80.0, in 1.0..=100.0;
    } and {
        /// Class of the water.
        water: WaterKind = WaterKind::Clear;
        /// Attenuation of light from a surface, 1/m, red, green, blue; without it, that of the class.
        #[schemars(inner(range(min = 0.0, max = 100.0)))]
        direct_per_m: Option<[f64; 3]> = None;
        /// Attenuation with which the veil grows, 1/m, red, green, blue; without it, that of the class.
        #[schemars(inner(range(min = 0.0, max = 100.0)))]
        backscatter_per_m: Option<[f64; 3]> = None;
        /// Veil at infinity, cd/m2, red, green, blue; without it, that of lamps and sun.
        #[schemars(inner(range(min = 0.0, max = 1e6)))]
        veil_cd_m2: Option<[f64; 3]> = None;
    }
);

impl ImageSpec {
    /// Returns an image without disturbances: even light of 1000 lux from all sides, no water, no blur, no noise. The
    /// gain is fixed so that white is 0.85 of full scale.
    #[must_use]
    pub fn clean() -> Self {
        Self {
            turbidity: 0.0,
            ambient_lux: 1000.0,
            blur_px: 0.0,
            vignetting: 0.0,
            electrons_per_cd_m2: 10_000.0 * std::f64::consts::PI / 1000.0,
            read_noise_electrons: 0.0,
            shot_noise: 0.0,
            gain: 1.0,
            ..Self::default()
        }
    }

    /// Returns true if all values are those of a world without image settings.
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Checks relations that a table's ranges cannot express.
    pub(super) fn check_relations(&self, file: &Path) -> Result<(), FileIssue> {
        let lists = [
            ("direct_per_m", self.direct_per_m, 100.0),
            ("backscatter_per_m", self.backscatter_per_m, 100.0),
            ("veil_cd_m2", self.veil_cd_m2, 1e6),
        ];
        for (key, values, most) in lists {
            for value in values.iter().flatten() {
                FileIssue::check_range(file, &format!("world.image.{key}"), *value, 0.0..=most)?;
            }
        }
        Ok(())
    }
}
