//! `[world.vehicle]`.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, DEG, table};
use armcal_core::robot::FileIssue;

/// Where the vehicle's motion comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MotionKind {
    /// Sums of sinusoids; the arm does not push back.
    #[default]
    Swell,
    /// `motion_file`; the arm does not push back.
    Recorded,
    /// The vehicle floats, pushed by the water, its thrusters and the arm; its file's `[dynamics]` has the figures.
    Free,
    /// It stands on the seabed, its thrusters off: a free body on soft ground, rocked by the arm. `[world.ground]` has
    /// the figures.
    Parked,
}

table!(
    /// The vehicle's motion about its station, and its attitude sensor.
    VehicleMotionSpec {
        /// Of roll, pitch and yaw each.
        rotation_rms_rad = 0.5 * DEG, in 0.0..=0.3;
        /// In each direction.
        translation_rms_m = 0.03, in 0.0..=2.0;
        /// Shortest period of the motion.
        period_min_s = 5.0, in 0.5..=600.0;
        /// Longest period of the motion.
        period_max_s = 15.0, in 0.5..=600.0;
        /// The motion swells over this time at the start.
        ramp_s = 5.0, in 0.0..=600.0;
        /// Standard deviation per axis of the attitude sensor's constant turn against the vehicle. Assumed.
        attitude_misalignment_std_rad = 0.0, in 0.0..=0.2;
        /// Standard deviation per axis of the rates' bias at the start. Assumed.
        gyro_bias_std_rad_s = 0.0, in 0.0..=1.0;
        /// Random walk of that bias, per axis. Assumed.
        gyro_drift_rad_s_per_sqrt_h = 0.0, in 0.0..=1.0;
        /// Standard deviation per axis of the specific force's bias. Assumed.
        accelerometer_bias_std_m_s2 = 0.0, in 0.0..=10.0;
        /// Noise of the attitude, one sigma per axis.
        attitude_noise_rad = 0.05 * DEG, in 0.0..=0.2;
        /// Noise of the rates, one sigma per axis.
        gyro_noise_rad_s = 5e-4, in 0.0..=1.0;
        /// Noise of the specific force, one sigma per axis.
        accelerometer_noise_m_s2 = 0.02, in 0.0..=10.0;
        /// Of a free vehicle's position and attitude control (assumed: a pilot's aid); 0 for thrusters that are off.
        station_keeping_rad_s = 0.5, in 0.0..=5.0;
        /// Damping ratio of that control.
        station_damping_ratio = 0.9, in 0.0..=5.0;
        /// First-order lag of the thrusters (assumed).
        thruster_lag_s = 0.2, in 0.0..=5.0;
        /// Random force on a free vehicle in each direction, in the band of the periods: tether and turbulence
        /// (assumed).
        #[serde(alias = "wobble_force_rms_n")]
        disturbance_force_rms_n = 0.0, in 0.0..=1e5;
        /// The same as a moment.
        #[serde(alias = "wobble_moment_rms_n_m")]
        disturbance_moment_rms_n_m = 0.0, in 0.0..=1e5;
    } and {
        /// Prescribed by the figures above, prescribed by a file, free, or parked.
        motion: MotionKind = MotionKind::Swell;
        /// CSV of a recorded motion, beside the routine.
        motion_file: Option<PathBuf> = None;
    }
);
