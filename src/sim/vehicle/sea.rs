//! Motion of the water about the vehicle: a current, and waves that fade with depth.
//!
//! Waves are a sum of linear deep-water waves, `w2 = g k`, whose orbits have radius `a exp(-k depth)`. Their amplitudes
//! follow the spectrum of Pierson and Moskowitz for the given significant height and peak period (DNV-RP-C205, section
//! 3.5.5). The motion is that at the vehicle's station and the same everywhere about the arm, because waves that reach
//! down are much longer than an arm.

use nalgebra::Vector3;
use rand::RngExt;

use crate::spec::WaterSpec;
use armcal_core::robot::GRAVITY_M_S2;
use armcal_core::stats::stream_rng;

const N_WAVES: usize = 16;

/// Current and waves.
#[derive(Clone, Debug)]
pub(crate) struct Sea {
    current: Vector3<f64>,
    /// Horizontal direction in which the waves run, unit.
    heading: Vector3<f64>,
    waves: Vec<Wave>,
    /// Water settings of a vehicle that dives; `None` at constant depth.
    dive: Option<WaterSpec>,
}

#[derive(Clone, Copy, Debug)]
struct Wave {
    /// Radius of the orbit at the vehicle's depth, m; at the surface for a vehicle that dives.
    radius_m: f64,
    rate_rad_s: f64,
    phase_rad: f64,
}

/// Motion of the water against the world, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WaterMotion {
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration, m/s2.
    pub acceleration: Vector3<f64>,
}

impl Sea {
    pub(crate) fn new(spec: &WaterSpec, seed: u64) -> Self {
        let (sin, cos) = spec.wave_direction_rad.sin_cos();
        let waves = if spec.wave_height_m > 0.0 { draw_waves(spec, seed) } else { Vec::new() };
        let dive = spec.dives().then_some(*spec);
        Self { current: Vector3::from(spec.current_m_s), heading: Vector3::new(cos, sin, 0.0), waves, dive }
    }

    /// Returns the water's motion at `t_s`; z is up.
    pub(crate) fn at(&self, t_s: f64) -> WaterMotion {
        let mut motion = WaterMotion { velocity: self.current, acceleration: Vector3::zeros() };
        for wave in &self.waves {
            let (sin, cos) = (wave.rate_rad_s * t_s + wave.phase_rad).sin_cos();
            let fade = self.dive.map_or(1.0, |water| (-wave.number_per_m() * water.station_depth_m(t_s)).exp());
            let speed = wave.radius_m * wave.rate_rad_s * fade;
            motion.velocity += speed * (cos * self.heading + sin * Vector3::z());
            motion.acceleration += speed * wave.rate_rad_s * (-sin * self.heading + cos * Vector3::z());
        }
        motion
    }
}

impl Wave {
    /// Returns the wave number of deep water: 2 pi over the wavelength.
    fn number_per_m(&self) -> f64 {
        self.rate_rad_s * self.rate_rad_s / GRAVITY_M_S2
    }
}

/// Draws frequencies in equal shares of 0.6 to 3 times the peak's, each at random within its share, and random phases.
fn draw_waves(spec: &WaterSpec, seed: u64) -> Vec<Wave> {
    let mut rng = stream_rng(seed, "waves");
    let peak = std::f64::consts::TAU / spec.wave_period_s;
    let share = 2.4 * peak / N_WAVES as f64;
    let mut waves: Vec<Wave> = (0..N_WAVES)
        .map(|i| {
            let rate_rad_s = 0.6 * peak + (i as f64 + rng.random_range(0.0..1.0)) * share;
            let ratio = peak / rate_rad_s;
            let density = ratio.powi(5) * (-1.25 * ratio.powi(4)).exp();
            let phase_rad = rng.random_range(0.0..std::f64::consts::TAU);
            Wave { radius_m: (2.0 * density * share).sqrt(), rate_rad_s, phase_rad }
        })
        .collect();
    // At the surface, the significant height is four times the standard deviation of the elevation.
    let std_m = waves.iter().map(|w| 0.5 * w.radius_m * w.radius_m).sum::<f64>().sqrt();
    let depth_m = if spec.dives() { 0.0 } else { spec.depth_m };
    for wave in &mut waves {
        wave.radius_m *= 0.25 * spec.wave_height_m / std_m * (-wave.number_per_m() * depth_m).exp();
    }
    waves
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sea(depth_m: f64) -> Sea {
        let spec = WaterSpec { wave_height_m: 2.0, depth_m, current_m_s: [0.3, 0.0, 0.0], ..WaterSpec::default() };
        Sea::new(&spec, 7)
    }

    #[test]
    fn acceleration_is_the_rate_of_velocity() {
        let sea = sea(15.0);
        for t in [0.0, 3.1, 77.7] {
            let slope = (sea.at(t + 1e-4).velocity - sea.at(t - 1e-4).velocity) / 2e-4;
            assert!((slope - sea.at(t).acceleration).norm() < 1e-7, "{t}");
        }
    }

    /// The standard deviation of the heave at the surface is a quarter of the significant height, and decreases with
    /// depth.
    #[test]
    fn waves_have_their_height_and_fade_with_depth() {
        let rms = |depth_m: f64| sea(depth_m).waves.iter().map(|w| 0.5 * w.radius_m * w.radius_m).sum::<f64>().sqrt();
        assert!((rms(0.0) - 0.5).abs() < 1e-12);
        assert!(rms(20.0) < 0.5 * rms(0.0) && rms(20.0) > 0.05 * rms(0.0), "{}", rms(20.0));
        assert!(rms(500.0) < 1e-3 * rms(0.0), "{}", rms(500.0));
    }

    #[test]
    fn a_vehicle_that_dives_feels_the_waves_of_its_depth() {
        let spec: WaterSpec = toml::from_str(
            "wave_height_m = 2.0\ncurrent_m_s = [0.3, 0.0, 0.0]\ndive_time_s = [100.0, 200.0]\n\
             dive_depth_m = [0.0, 30.0]",
        )
        .expect("valid");
        let diving = Sea::new(&spec, 7);
        for (t_s, depth_m) in [(33.0, 0.0), (150.0, 15.0), (700.0, 30.0)] {
            let apart = diving.at(t_s).velocity - sea(depth_m).at(t_s).velocity;
            assert!(apart.norm() < 1e-12, "{t_s} s: {apart}");
        }
    }
}
