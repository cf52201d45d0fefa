//! `[world.vehicle]`.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, DEG, table};
use armcal_core::robot::FileIssue;

/// Source of the vehicle's motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MotionKind {
    /// Sums of sinusoids; the arm does not move the vehicle.
    #[default]
    Swell,
    /// Motion of `motion_file`; the arm does not move the vehicle.
    Recorded,
    /// Floating vehicle, moved by the water, its thrusters and the arm; `[dynamics]` of its file has the values.
    Free,
    /// Vehicle on the seabed with its thrusters off: a free body on soft ground, rocked by the arm. `[world.ground]`
    /// has the values.
    Parked,
}

table!(
    /// The vehicle's motion about its station, and its attitude sensor.
    VehicleMotionSpec {
        /// RMS rotation in roll, pitch and yaw each.
        rotation_rms_rad = 0.5 * DEG, in 0.0..=0.3;
        /// RMS translation in each direction.
        translation_rms_m = 0.03, in 0.0..=2.0;
        /// Shortest period of the motion.
        period_min_s = 5.0, in 0.5..=600.0;
        /// Longest period of the motion.
        period_max_s = 15.0, in 0.5..=600.0;
        /// Time over which the motion grows at the start.
        ramp_s = 5.0, in 0.0..=600.0;
        /// Standard deviation per axis of the attitude sensor's constant turn against the vehicle. Assumed.
        attitude_misalignment_std_rad = 0.0, in 0.0..=0.2;
        /// Standard deviation per axis of the rates' bias at the start. Assumed.
        gyro_bias_std_rad_s = 0.0, in 0.0..=1.0;
        /// Random walk of the rates' bias, per axis. Assumed.
        gyro_drift_rad_s_per_sqrt_h = 0.0, in 0.0..=1.0;
        /// Standard deviation per axis of the specific force's bias. Assumed.
        accelerometer_bias_std_m_s2 = 0.0, in 0.0..=10.0;
        /// Noise of the attitude, one sigma per axis.
        attitude_noise_rad = 0.05 * DEG, in 0.0..=0.2;
        /// Noise of the rates, one sigma per axis.
        gyro_noise_rad_s = 5e-4, in 0.0..=1.0;
        /// Noise of the specific force, one sigma per axis.
        accelerometer_noise_m_s2 = 0.02, in 0.0..=10.0;
        /// Natural frequency of a free vehicle's position and attitude control (assumed: a pilot's aid); 0 for
        /// thrusters that are off.
        station_keeping_rad_s = 0.5, in 0.0..=5.0;
        /// Damping ratio of that control.
        station_damping_ratio = 0.9, in 0.0..=5.0;
        /// First-order lag of the thrusters (assumed).
        thruster_lag_s = 0.2, in 0.0..=5.0;
        /// RMS random force on a free vehicle in each direction, in the band of the periods: tether and turbulence
        /// (assumed).
        #[serde(alias = "wobble_force_rms_n")]
        disturbance_force_rms_n = 0.0, in 0.0..=1e5;
        /// RMS random moment on a free vehicle about each axis, in the band of the periods (assumed).
        #[serde(alias = "wobble_moment_rms_n_m")]
        disturbance_moment_rms_n_m = 0.0, in 0.0..=1e5;
    } and {
        /// Kind of motion: prescribed by the values above, prescribed by a file, free, or parked.
        motion: MotionKind = MotionKind::Swell;
        /// CSV file of a recorded motion, relative to the routine's folder.
        motion_file: Option<PathBuf> = None;
    }
);
