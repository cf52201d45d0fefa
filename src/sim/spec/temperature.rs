//! `[world.temperature]`.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::spec::points::{Points, Polyline};
use crate::spec::table::{CheckedTable, table};
use armcal_core::robot::FileIssue;

table!(
    /// Temperatures of oil and water. The oil warms as `start + rise * (1 - exp(-t / time constant))`, or by the arm's
    /// work.
    #[derive(Copy)]
    TemperatureSpec {
        /// Water temperature at the start, if it is the same at all depths.
        water_c = 4.0, in -3.0..=40.0;
        /// Oil temperature at the start.
        oil_start_c = 10.0, in -3.0..=80.0;
        /// Rise of the oil after a long time.
        oil_rise_k = 8.0, in 0.0..=60.0;
        /// Time constant of the oil; with 300 s it rises by 6.9 K of the 8 K within 10 minutes.
        oil_time_constant_s = 300.0, in 1.0..=1e5;
        /// Noise of both thermometers.
        thermometer_noise_k = 0.05, in 0.0..=5.0;
        /// Change of the water after a long time (a dive into colder water); the oil follows with its own time
        /// constant.
        water_change_k = 0.0, in -60.0..=60.0;
        /// Time constant of the water's change.
        water_time_constant_s = 1800.0, in 1.0..=1e6;
        /// Heat capacity of the oil and of the parts that it warms. If it is positive, the oil warms by the power that
        /// the hydraulics lose. It cools towards the water with its time constant, and `oil_rise_k` does not count.
        /// Assumed: 20 L of oil hold 3.3e4 J/K.
        oil_heat_capacity_j_per_k = 0.0, in 0.0..=1e9;
        /// Standard deviation of each thermometer's constant error. Assumed.
        thermometer_bias_std_k = 0.0, in 0.0..=5.0;
        /// Time constant of each thermometer, of a probe in its well. Assumed.
        thermometer_lag_s = 0.0, in 0.0..=3600.0;
        /// Step of each thermometer's converter; 0 for none.
        thermometer_resolution_k = 0.0, in 0.0..=5.0;
    } and {
        /// Depths of `profile_c`, ascending, at most 16; none for water that is the same everywhere.
        #[schemars(with = "Vec<f64>", inner(range(min = 0.0, max = 12_000.0)))]
        profile_depth_m: Points = Points::NONE;
        /// Water temperature at those depths, linear between them and constant beyond; it replaces `water_c`.
        #[schemars(with = "Vec<f64>", inner(range(min = -2.0, max = 30.0)))]
        profile_c: Points = Points::NONE;
    }
);

impl TemperatureSpec {
    pub(super) fn check_relations(&self, file: &Path) -> Result<(), FileIssue> {
        self.profile().check(
            file,
            ["world.temperature.profile_depth_m", "world.temperature.profile_c"],
            [0.0..=12_000.0, -2.0..=30.0],
        )
    }

    fn profile(&self) -> Polyline<'_> {
        Polyline { at: &self.profile_depth_m, values: &self.profile_c }
    }

    /// Returns the water temperature at the start, at a depth.
    pub(crate) fn water_at_c(&self, depth_m: f64) -> f64 {
        self.profile().value_at(depth_m).unwrap_or(self.water_c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<TemperatureSpec, String> {
        let spec: TemperatureSpec = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        spec.check_relations(Path::new("r.toml")).map_err(|issue| issue.to_string())?;
        Ok(spec)
    }

    #[test]
    fn the_water_is_linear_between_the_profiles_depths() {
        let spec = read("profile_depth_m = [0, 50.0, 1050]\nprofile_c = [24.0, 14.0, 4.0]").expect("valid");
        for (depth_m, expected_c) in [(-1.0, 24.0), (0.0, 24.0), (25.0, 19.0), (50.0, 14.0), (300.0, 11.5), (9e3, 4.0)]
        {
            assert!((spec.water_at_c(depth_m) - expected_c).abs() < 1e-12, "{depth_m} m");
        }
        assert_eq!(TemperatureSpec::default().water_at_c(300.0), 4.0);
        let text = toml::to_string(&spec).expect("text");
        assert_eq!(read(&text).expect("it reads back"), spec);
    }

    #[test]
    fn a_profile_that_is_none_is_refused_with_the_reason() {
        let long = format!("profile_depth_m = {:?}", (0..17).map(f64::from).collect::<Vec<_>>());
        let texts = [
            "profile_depth_m = [0.0, 10.0]\nprofile_c = [4.0]",
            "profile_depth_m = [10.0, 10.0]\nprofile_c = [4.0, 5.0]",
            "profile_depth_m = [nan]\nprofile_c = [4.0]",
            "profile_depth_m = [1.0]\nprofile_c = [31.0]",
            &long,
        ];
        insta::assert_snapshot!("profiles", texts.map(|text| read(text).expect_err("refused")).join("\n"));
    }
}
