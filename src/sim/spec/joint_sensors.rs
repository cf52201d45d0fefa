//! `[world.joint_sensors]`.

use armcal_core::codes::Code;
use std::num::NonZeroU8;
use std::ops::RangeInclusive;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::spec::table::{CheckedTable, DEG, table};
use armcal_core::robot::FileIssue;

table!(
    /// Errors of the joint sensors; see `sensors::joint` for the equations. robot.toml says which joint has which kind.
    #[derive(Copy)]
    JointSensorsSpec {
        /// Relative gain error of a potentiometer, uniform in +- this, about the middle of the joint's range.
        gain_error_max = 0.05, in 0.0..=0.5;
        /// Offset error of any kind, uniform in +- this.
        offset_error_max_rad = 5.0 * DEG, in 0.0..=1.0;
        /// Peak of the potentiometer's smooth nonlinearity, as a fraction of the joint's range.
        nonlinearity_peak = 0.001, in 0.0..=0.2;
        /// Temperature coefficient of the offset, standard deviation over joints.
        temperature_offset_std_rad_per_k = 0.02 * DEG, in 0.0..=0.1;
        /// Temperature coefficient of the relative gain, standard deviation over joints.
        temperature_gain_std_per_k = 20e-6, in 0.0..=0.01;
        /// Oil temperature at which the temperature terms vanish.
        reference_c = 10.0, in -10.0..=80.0;
        /// Random walk of the offset with time.
        drift_rad_per_sqrt_h = 0.02 * DEG, in 0.0..=0.1;
        /// Full width of the backlash between joint and sensor shaft.
        backlash_rad = 0.02 * DEG, in 0.0..=0.1;
        /// Noise of potentiometers and resolvers.
        noise_rms_counts = 1.5, in 0.0..=1000.0;
        /// Step of the converter; 0 for none. A word of `wrap_counts` then has log2(wrap / step) bits.
        resolution_counts = 1.0, in 0.0..=1000.0;
        /// Height of the bump that a worn spot of the track puts on the reading, one spot a joint. Assumed.
        worn_spot_peak_rad = 0.0, in 0.0..=0.2;
        /// Standard width of the worn spot. It is at least the peak, because the reading must increase with the angle.
        /// Assumed.
        worn_spot_width_rad = 2.0 * DEG, in 1e-3..=1.0;
        /// Pressure coefficient of the offset above the surface's pressure, standard deviation over joints. No public
        /// figures: assumed.
        pressure_offset_std_rad_per_mpa = 0.0, in 0.0..=0.01;
        /// Pressure coefficient of the relative gain, standard deviation over joints. No public figures: assumed.
        pressure_gain_std_per_mpa = 0.0, in 0.0..=0.001;
        /// Random walk of the offset with use: its variance grows with the shaft's travel, in turns. Assumed.
        drift_rad_per_sqrt_turn = 0.0, in 0.0..=0.1;
        /// Width of the wiper's hysteresis: readings on the way up and down differ by it. Datasheets of precision
        /// potentiometers state repeatabilities of 0.004 to 0.1 deg.
        hysteresis_rad = 0.0, in 0.0..=0.1;
        /// Share of the wiper that drags; 1 makes a dead zone of the hysteresis, like the shaft's backlash. Assumed.
        hysteresis_share = 0.5, in 0.05..=1.0;
        /// Rate of the wiper's drop-outs anywhere on the track. Assumed.
        dropout_per_s = 0.0, in 0.0..=100.0;
        /// Rate of additional drop-outs in the middle of the worn spot; it falls off towards its sides. Assumed.
        worn_dropout_per_s = 0.0, in 0.0..=100.0;
        /// Mean length of a drop-out. Assumed.
        dropout_mean_s = 0.05, in 1e-3..=100.0;
        /// Resolution of an encoder, steps per turn; 0: all steps of its word.
        encoder_steps_per_turn = 0.0, in 0.0..=1e9;
        /// Once-a-turn error of an encoder: the disc's distance from its axis over the radius of its lines.
        encoder_eccentricity_rad = 0.0, in 0.0..=0.1;
        /// Relative difference of a resolver's two windings, standard deviation over joints. Assumed.
        resolver_imbalance_std = 0.0, in 0.0..=0.1;
        /// Deviation of a resolver's two windings from a right angle, electrical; standard deviation over joints.
        /// Assumed.
        resolver_quadrature_std_rad = 0.0, in 0.0..=0.1;
        /// Temperature coefficient of a resolver's offset with its cable and converter; standard deviation over joints.
        /// Assumed.
        resolver_temperature_std_rad_per_k = 0.0, in 0.0..=0.01;
    } and {
        /// Time constant with which the sensors' own temperature follows the oil's. Assumed.
        #[serde(skip_serializing_if = "is_zero")]
        #[schemars(range(min = 0.0, max = 36_000.0))]
        sensor_lag_s: f64 = 0.0;
        /// Width of the pressure's hysteresis: the pressure's effects on the way down and up differ as if the pressure
        /// differed by it. Assumed.
        #[serde(skip_serializing_if = "is_zero")]
        #[schemars(range(min = 0.0, max = 100.0))]
        pressure_hysteresis_mpa: f64 = 0.0;
        /// Share of the pressure's effect that lags. Assumed.
        #[serde(skip_serializing_if = "is_half")]
        #[schemars(range(min = 0.05, max = 1.0))]
        pressure_hysteresis_share: f64 = 0.5;
        /// Number of electrical turns of a resolver in one turn of its shaft, 1 .. 255.
        resolver_pole_pairs: NonZeroU8 = NonZeroU8::MIN;
    }
);

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it")]
fn is_zero(figure: &f64) -> bool {
    *figure == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it")]
fn is_half(figure: &f64) -> bool {
    *figure == 0.5
}

impl JointSensorsSpec {
    /// Refuses a worn spot so steep that one reading would belong to several angles.
    pub(super) fn check_relations(&self, file: &Path) -> Result<(), FileIssue> {
        for (key, value, range) in [
            ("sensor_lag_s", self.sensor_lag_s, 0.0..=36_000.0),
            ("pressure_hysteresis_mpa", self.pressure_hysteresis_mpa, 0.0..=100.0),
            ("pressure_hysteresis_share", self.pressure_hysteresis_share, 0.05..=1.0),
        ] {
            FileIssue::check_range(file, &format!("world.joint_sensors.{key}"), value, range)?;
        }
        let (peak, width) = (self.worn_spot_peak_rad, self.worn_spot_width_rad);
        if peak > width {
            let problem = format!("{peak} is above worn_spot_width_rad, {width}");
            return Err(FileIssue::new(Code::ValueOutOfRange, file, "world.joint_sensors.worn_spot_peak_rad", problem));
        }
        Ok(())
    }

    /// Returns true if the joints' tracks have a worn spot.
    pub(crate) fn wears(&self) -> bool {
        self.worn_spot_peak_rad > 0.0 || self.worn_dropout_per_s > 0.0
    }
}
