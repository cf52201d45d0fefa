//! Worlds drawn from all that `[world]` allows, for closed loops in any of them.
//!
//! Each key is drawn with a chance that is fixed per world, at most `MOST`. Most drawn values lie about the standard
//! world's figure, by a factor of up to 4 each way. The rest are anywhere in the allowed range, uniform over its powers
//! of ten where it excludes zero.

use rand::{Rng, RngExt};

use armcal_core::stats::stream_rng;
use armcal_sim::{Figure, WorldSpec};

/// Largest share of the keys that differ from the standard world.
const MOST: f64 = 0.06;
/// Share of the differing keys with a standard figure that are drawn from their whole range.
const ANYWHERE: f64 = 0.3;

/// Keys with a choice of values, or of tables that are not purely numeric, with the allowed values.
const CHOICES: [(&str, &[&str]); 10] = [
    ("world.physics.engine", &["\"rapier\"", "\"featherstone\""]),
    ("world.vehicle.motion", &["\"swell\"", "\"free\"", "\"parked\""]),
    ("world.physics.step_s", &["0.001", "0.002", "0.0025"]),
    ("world.water.current_m_s", &["[0.3, 0.1, 0.0]", "[-1.5, 0.5, 0.2]", "[5.0, 5.0, 5.0]"]),
    ("world.water.wave_height_m", &["0.5", "3.0", "20.0"]),
    ("world.water.depth_m", &["0.0", "30.0", "12000.0"]),
    ("world.structure.payload_kg", &["5.0", "60.0", "10000.0"]),
    ("world.structure.mount_compliance_rad_per_nm", &["[1e-5, 1e-5, 1e-5]", "[1e-2, 1e-2, 1e-2]"]),
    ("capture.margins", &["\"belief\""]),
    // This key is among the choices so that it does not shift the draws of the other keys.
    ("world.geometry.error_ratio", &["1.0", "3.0"]),
];

/// One world: the settings that it adds to the routine.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnWorld {
    /// Number of the draw, and seed of the run.
    pub number: u64,
    /// Index of the arm among the given ones.
    pub arm: usize,
    /// Index of the routine among the given ones.
    pub routine: usize,
    /// Settings as `KEY=VALUE`, for `--set`.
    pub settings: Vec<String>,
}

/// Draws world `number` for the given numbers of arms and routines; the same arguments give the same world.
#[must_use]
pub fn drawn_world(number: u64, n_arms: usize, n_routines: usize) -> DrawnWorld {
    let mut rng = stream_rng(number, "any world");
    let (arm, routine) = (rng.random_range(0..n_arms), rng.random_range(0..n_routines));
    let share = rng.random_range(0.0..MOST);
    let figures = WorldSpec::figures();
    let chosen = |key: &str| CHOICES.iter().any(|(choice, _)| *choice == key);
    let mut settings = Vec::new();
    for figure in figures.iter().filter(|figure| !chosen(&figure.key)) {
        if rng.random_bool(share) {
            settings.push(format!("{}={:?}", figure.key, drawn(figure, &mut rng)));
        }
    }
    for (key, values) in CHOICES {
        if rng.random_bool(share) {
            settings.push(format!("{key}={}", values[rng.random_range(0..values.len())]));
        }
    }
    DrawnWorld { number, arm, routine, settings }
}

fn drawn(figure: &Figure, rng: &mut impl Rng) -> f64 {
    let (low, high) = (*figure.range.start(), *figure.range.end());
    let evenly = rng.random_range(0.0..=1.0);
    let anywhere = if low > 0.0 { low * (high / low).powf(evenly) } else { low + (high - low) * evenly };
    let near = figure.usual * 4.0_f64.powf(rng.random_range(-1.0..=1.0));
    let is_near = figure.usual != 0.0 && !rng.random_bool(ANYWHERE);
    (if is_near { near } else { anywhere }).clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Many draws cover each number, never beyond its range, and the same draw gives the same world.
    #[test]
    fn worlds_cover_every_key_within_its_range() {
        let worlds: Vec<DrawnWorld> = (0..600).map(|number| drawn_world(number, 3, 4)).collect();
        assert_eq!(worlds[7], drawn_world(7, 3, 4));
        assert!(worlds.iter().all(|world| world.arm < 3 && world.routine < 4));
        let figures = WorldSpec::figures();
        assert!(figures.len() > 60, "{}", figures.len());
        for figure in &figures {
            let values: Vec<f64> = worlds
                .iter()
                .flat_map(|world| &world.settings)
                .filter_map(|setting| setting.strip_prefix(&figure.key)?.strip_prefix('=')?.parse().ok())
                .collect();
            assert!(values.len() > 3, "{} was drawn {} times", figure.key, values.len());
            assert!(values.iter().all(|value| figure.range.contains(value)), "{}: {values:?}", figure.key);
        }
    }
}
