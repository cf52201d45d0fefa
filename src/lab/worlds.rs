//! Worlds drawn from all that `[world]` allows: what a closed loop makes of any of them.
//!
//! Each key is drawn with a chance of its world's own, at most `MOST`; most of them about the standard world's figure
//! (by a factor of up to 4 each way), the rest anywhere in the allowed range (evenly over its powers of ten where it
//! has no zero).

use rand::{Rng, RngExt};

use armcal_core::stats::stream_rng;
use armcal_sim::{Figure, WorldSpec};

/// Of the keys, how many differ from the standard world at most.
const MOST: f64 = 0.06;
/// Of what differs and has a figure in the standard world, how much is anywhere in its range.
const ANYWHERE: f64 = 0.3;

/// Keys with several values, or of tables that are not numbers throughout, with what is allowed.
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
    // Among these, so that it does not shift what is drawn for the other keys.
    ("world.geometry.error_ratio", &["1.0", "3.0"]),
];

/// One world: what to set beside the routine.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnWorld {
    /// Number of the draw, and seed of the run.
    pub number: u64,
    /// Index of the arm, of those given.
    pub arm: usize,
    /// Index of the routine.
    pub routine: usize,
    /// `KEY=VALUE` each, for `--set`.
    pub settings: Vec<String>,
}

/// Draws world `number`, for as many arms and routines as there are: the same one each time.
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

    /// Over many draws each number is drawn, never beyond its range, and the same draw is the same world.
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
