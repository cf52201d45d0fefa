//! `[world.clock]`, `[world.camera]`, `[world.tags]`.

use std::ops::RangeInclusive;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::image::CameraMode;
use crate::spec::table::{CheckedTable, DEG, table};
use armcal_core::robot::FileIssue;

/// Window between lens and water.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PortKind {
    /// No window: rays are straight, as through a dome centred on the lens's pupil.
    #[default]
    None,
    /// Sphere whose centre may be off the pupil.
    Dome,
    /// Plane across the lens's axis.
    Flat,
}

/// Noise and misses of the geometric camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CornerNoiseKind {
    /// Noise by `corner_noise_px`, misses by `miss_probability`, and the limits of range, incidence and side.
    #[default]
    Standard,
    /// Model `optics::CornerNoise` fitted to rendered images in the world's kind of water, which replaces those values.
    Fitted,
}

impl CornerNoiseKind {
    fn is_standard(&self) -> bool {
        *self == Self::Standard
    }
}

table!(
    /// Clock of the camera compared with that of the joint sensors.
    #[derive(Copy)]
    ClockSpec {
        /// Mean delay of its stamps.
        camera_latency_s = 0.020, in 0.0..=1.0;
        /// Standard deviation of the delay.
        camera_jitter_s = 0.005, in 0.0..=0.2;
        /// Rate at which its clock gains on the joint sensors', from the start on. Quartz: 1 to 100 ppm.
        camera_clock_drift_ppm = 0.0, in -1000.0..=1000.0;
    }
);

table!(
    /// The wrist camera and its detector.
    #[derive(Copy)]
    CameraWorldSpec {
        /// Standard deviation per corner coordinate at 1 m, seen head-on; see `sensors::camera` for how it grows.
        corner_noise_px = 0.3, in 0.0..=20.0;
        /// Share of visible tags that the detector misses.
        miss_probability = 0.02, in 0.0..=1.0;
        /// Standard deviation per axis of the mount's error.
        mount_std_rad = 0.2 * DEG, in 0.0..=0.5;
        /// Standard deviation per axis of the mount's position error.
        mount_std_m = 0.002, in 0.0..=0.2;
        /// Rate of images.
        rate_hz = 5.0, in 0.1..=100.0;
        /// Largest distance at which the detector still finds a tag.
        max_range_m = 2.5, in 0.1..=50.0;
        /// Largest angle between the tag's normal and the line of sight.
        max_incidence_rad = 70.0 * DEG, in 0.1..=1.55;
        /// Shortest side in the image that the detector still decodes.
        min_side_px = 16.0, in 1.0..=1000.0;
        /// Time for which the shutter is open before an image's instant; corners are means over it.
        exposure_s = 0.0, in 0.0..=0.5;
        /// Relative growth of the corner noise per px of corner motion during the exposure. Assumed.
        blur_noise_per_px = 0.0, in 0.0..=10.0;
        /// Share of detections with the id of another tag of the map. Assumed.
        wrong_id_probability = 0.0, in 0.0..=1.0;
        /// Standard deviation of the focal length's relative error, common to both axes. Assumed.
        focal_std = 0.0, in 0.0..=0.1;
        /// Standard deviation per axis of the image centre's error. Assumed.
        center_std_px = 0.0, in 0.0..=100.0;
        /// Standard deviation of each distortion coefficient's error. Assumed.
        distortion_std = 0.0, in 0.0..=0.002;
        /// Inner radius of a dome port. Assumed.
        dome_radius_m = 0.05, in 0.01..=0.5;
        /// Standard deviation per axis of the dome's centre about the lens's pupil. Assumed.
        dome_decentre_std_m = 0.0, in 0.0..=0.02;
        /// Distance from the lens's pupil to a flat port. Assumed.
        port_distance_m = 0.02, in 0.0..=0.5;
        /// Thickness of a dome or a flat port. Assumed.
        port_thickness_m = 0.01, in 0.0..=0.1;
    } and {
        /// Port in front of the lens.
        port: PortKind = PortKind::None;
        /// Source of detections; also a routine's `[camera] mode`.
        #[serde(skip_serializing_if = "CameraMode::is_geometric")]
        mode: CameraMode = CameraMode::Geometric;
        /// Noise of the geometric camera's corners.
        #[serde(skip_serializing_if = "CornerNoiseKind::is_standard")]
        noise: CornerNoiseKind = CornerNoiseKind::Standard;
    }
);

table!(
    /// Errors of the tag survey.
    #[derive(Copy)]
    TagsSpec {
        /// Standard deviation per axis of a tag's position error.
        survey_std_m = 0.001, in 0.0..=0.2;
        /// Standard deviation per axis of a tag's rotation error.
        survey_std_rad = 0.2 * DEG, in 0.0..=0.5;
    } and {
        /// Standard deviation per axis of the base tag's position error, if it is machined or measured better than the
        /// others.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0, max = 0.2))]
        base_std_m: Option<f64> = None;
        /// Standard deviation per axis of the base tag's rotation error.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0, max = 0.5))]
        base_std_rad: Option<f64> = None;
        /// Standard deviation per axis of the gripper tag's position error against the nominal model; 0.3 mm if left
        /// out. Assumed: a measuring arm on the bench.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0, max = 0.2))]
        gripper_std_m: Option<f64> = None;
        /// Standard deviation per axis of the gripper tag's rotation error against the nominal model; 0.1 deg if left
        /// out. Assumed.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 0.0, max = 0.5))]
        gripper_std_rad: Option<f64> = None;
    }
);

impl TagsSpec {
    /// Returns the standard deviations of a surveyed tag's pose, (m, rad) per axis.
    pub(crate) fn survey_std(&self) -> (f64, f64) {
        (self.survey_std_m, self.survey_std_rad)
    }

    /// Returns the standard deviations of the base tag's pose, (m, rad) per axis.
    pub(crate) fn base_tag_std(&self) -> (f64, f64) {
        (self.base_std_m.unwrap_or(self.survey_std_m), self.base_std_rad.unwrap_or(self.survey_std_rad))
    }

    /// Returns the standard deviations of the gripper tag's pose, (m, rad) per axis.
    pub(crate) fn gripper_std(&self) -> (f64, f64) {
        (self.gripper_std_m.unwrap_or(0.0003), self.gripper_std_rad.unwrap_or(0.1 * DEG))
    }

    pub(super) fn check_options(&self, file: &Path) -> Result<(), FileIssue> {
        let each = [
            ("base_std_m", self.base_std_m, 0.0..=0.2),
            ("base_std_rad", self.base_std_rad, 0.0..=0.5),
            ("gripper_std_m", self.gripper_std_m, 0.0..=0.2),
            ("gripper_std_rad", self.gripper_std_rad, 0.0..=0.5),
        ];
        for (key, value, range) in each {
            if let Some(value) = value {
                FileIssue::check_range(file, &format!("world.tags.{key}"), value, range)?;
            }
        }
        Ok(())
    }
}
