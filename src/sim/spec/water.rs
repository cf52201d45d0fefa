//! `[world.water]`.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::points::{Points, Polyline};
use crate::spec::table::CheckedTable;
use armcal_core::robot::FileIssue;

/// Sea water around the arm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WaterSpec {
    /// Density; 0: neither drag nor buoyancy.
    #[schemars(range(min = 0.0, max = 2000.0))]
    pub density_kg_m3: f64,
    /// Drag coefficient of every link, per axis of its shapes.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub drag_coefficient: f64,
    /// Weight of the displaced water over the arm's own; without it, that of the robot's file.
    #[schemars(range(min = 0.0, max = 0.95))]
    pub buoyancy_fraction: Option<f64>,
    /// Linear friction of each joint, for slow motion.
    #[schemars(range(min = 0.0, max = 1e4))]
    pub joint_friction_n_m_s_rad: f64,
    /// Standard deviation of the depth gauge's constant error; assumed.
    #[schemars(range(min = 0.0, max = 1e7))]
    pub pressure_bias_std_pa: f64,
    /// Standard deviation of the depth gauge's relative scale error; assumed.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub pressure_scale_std: f64,
    /// Depth of the vehicle's station below the surface.
    #[schemars(range(min = 0.0, max = 12000.0))]
    pub depth_m: f64,
    /// Times of `dive_depth_m` since the start, ascending, at most 16; none for a vehicle that stays at its depth.
    #[serde(skip_serializing_if = "Points::is_empty")]
    #[schemars(with = "Vec<f64>", inner(range(min = 0.0, max = 1e6)))]
    pub dive_time_s: Points,
    /// Depths of the station at those times, linear between them and constant beyond; they replace `depth_m`.
    #[serde(skip_serializing_if = "Points::is_empty")]
    #[schemars(with = "Vec<f64>", inner(range(min = 0.0, max = 12000.0)))]
    pub dive_depth_m: Points,
    /// Noise of a single reading, one standard deviation.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub pressure_noise_pa: f64,
    /// Scale of the links' theoretical added mass; 0 for none.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub added_mass_coefficient: f64,
    /// Steady current in the world's axes, z up.
    #[schemars(inner(range(min = -5.0, max = 5.0)))]
    pub current_m_s: [f64; 3],
    /// Significant height of the waves at the surface; 0 for none.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub wave_height_m: f64,
    /// Peak period of the waves.
    #[schemars(range(min = 1.0, max = 30.0))]
    pub wave_period_s: f64,
    /// Direction in which the waves run, from the world's x axis about z.
    #[schemars(range(min = -6.3, max = 6.3))]
    pub wave_direction_rad: f64,
}

impl Default for WaterSpec {
    fn default() -> Self {
        Self {
            density_kg_m3: 1025.0,
            drag_coefficient: 1.2,
            buoyancy_fraction: None,
            joint_friction_n_m_s_rad: 5.0,
            pressure_bias_std_pa: 0.0,
            pressure_scale_std: 0.0,
            depth_m: 500.0,
            dive_time_s: Points::NONE,
            dive_depth_m: Points::NONE,
            pressure_noise_pa: 200.0,
            added_mass_coefficient: 1.0,
            current_m_s: [0.0; 3],
            wave_height_m: 0.0,
            wave_period_s: 8.0,
            wave_direction_rad: 0.0,
        }
    }
}

impl WaterSpec {
    /// Returns the weight of the displaced water over the arm's own; 0 if it is not set here.
    pub(crate) fn buoyancy(&self) -> f64 {
        self.buoyancy_fraction.unwrap_or(0.0)
    }

    /// Returns true if the station's depth changes with time.
    pub(crate) fn dives(&self) -> bool {
        !self.dive_time_s.is_empty()
    }

    /// Returns the depth of the vehicle's station below the surface, `t_s` after the start.
    pub(crate) fn station_depth_m(&self, t_s: f64) -> f64 {
        self.dive().value_at(t_s).unwrap_or(self.depth_m)
    }

    fn dive(&self) -> Polyline<'_> {
        Polyline { at: &self.dive_time_s, values: &self.dive_depth_m }
    }
}

impl CheckedTable for WaterSpec {
    fn check(&self, file: &Path, table: &str) -> Result<(), FileIssue> {
        let check =
            |key: &str, value: f64, range| FileIssue::check_range(file, &format!("{table}.{key}"), value, range);
        check("density_kg_m3", self.density_kg_m3, 0.0..=2000.0)?;
        check("drag_coefficient", self.drag_coefficient, 0.0..=10.0)?;
        check("buoyancy_fraction", self.buoyancy(), 0.0..=0.95)?;
        check("joint_friction_n_m_s_rad", self.joint_friction_n_m_s_rad, 0.0..=1e4)?;
        check("pressure_bias_std_pa", self.pressure_bias_std_pa, 0.0..=1e7)?;
        check("pressure_scale_std", self.pressure_scale_std, 0.0..=0.1)?;
        check("depth_m", self.depth_m, 0.0..=12000.0)?;
        let keys = ["dive_time_s", "dive_depth_m"].map(|key| format!("{table}.{key}"));
        self.dive().check(file, [&keys[0], &keys[1]], [0.0..=1e6, 0.0..=12_000.0])?;
        check("pressure_noise_pa", self.pressure_noise_pa, 0.0..=1e6)?;
        check("added_mass_coefficient", self.added_mass_coefficient, 0.0..=10.0)?;
        for (axis, speed) in self.current_m_s.iter().enumerate() {
            check(&format!("current_m_s[{axis}]"), *speed, -5.0..=5.0)?;
        }
        check("wave_height_m", self.wave_height_m, 0.0..=20.0)?;
        check("wave_period_s", self.wave_period_s, 1.0..=30.0)?;
        check("wave_direction_rad", self.wave_direction_rad, -6.3..=6.3)?;
        Ok(())
    }
}
