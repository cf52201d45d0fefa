//! A joint sensor as built.

use std::f64::consts::TAU;
use std::num::NonZeroU8;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::spec::{JointSensorsSpec, WorldSpec};
use armcal_core::robot::{Robot, SensorKind};
use armcal_core::stats::stream_rng;

/// A joint sensor as built; `sensors::joint` has the equations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointAsBuilt {
    pub name: String,
    pub center_rad: f64,
    pub range_rad: f64,
    pub gain_error: f64,
    pub offset_error_rad: f64,
    pub temperature_offset_rad_per_k: f64,
    pub temperature_gain_per_k: f64,
    /// Counts per radian over the datasheet's.
    #[serde(default = "one_to_one")]
    pub gear_ratio: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pressure_offset_rad_per_mpa: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pressure_gain_per_mpa: f64,
    pub harmonics: Vec<Harmonic>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worn_spot: Option<WornSpot>,
    /// Of an encoder: `amplitude * sin(order * shaft + phase)`, shaft's angle in rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eccentricity: Option<Harmonic>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolver: Option<ResolverAsBuilt>,
}

/// Truths recorded before there were gears.
fn one_to_one() -> f64 {
    1.0
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// One term of the nonlinearity: `amplitude * sin(2 pi order (theta - center) / range + phase)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Harmonic {
    pub order: f64,
    pub amplitude_rad: f64,
    pub phase_rad: f64,
}

/// Where a potentiometer's track is worn: `peak * wear`, `wear = exp(-((theta - center) / width)^2 / 2)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WornSpot {
    pub center_rad: f64,
    /// Of either sign.
    pub peak_rad: f64,
    pub width_rad: f64,
}

/// What is wrong with a resolver's windings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResolverAsBuilt {
    pub pole_pairs: NonZeroU8,
    /// Electrical angle at shaft angle zero.
    pub phase_rad: f64,
    pub imbalance: f64,
    pub quadrature_rad: f64,
    pub temperature_offset_rad_per_k: f64,
}

impl WornSpot {
    /// 1 in its middle, 0 far from it.
    #[must_use]
    pub fn wear(&self, angle_rad: f64) -> f64 {
        (-0.5 * ((angle_rad - self.center_rad) / self.width_rad).powi(2)).exp()
    }

    /// What it adds to the reading, rad.
    #[must_use]
    pub fn bump_rad(&self, angle_rad: f64) -> f64 {
        self.peak_rad * self.wear(angle_rad)
    }
}

impl JointAsBuilt {
    /// The smooth deviation of the sensor at `angle_rad`, rad.
    #[must_use]
    pub fn nonlinearity_rad(&self, angle_rad: f64) -> f64 {
        let turn = TAU * (angle_rad - self.center_rad) / self.range_rad;
        self.harmonics.iter().map(|h| h.amplitude_rad * (h.order * turn + h.phase_rad).sin()).sum()
    }

    pub(super) fn draw(robot: &Robot, joint: usize, spec: &WorldSpec, seed: u64) -> Self {
        let limits = robot.chain.joints()[joint].limits;
        let name = &robot.sensors[joint].joint;
        let sensors = &spec.joint_sensors;
        let mut built = Self {
            name: name.clone(),
            center_rad: robot.sensors[joint].center_rad,
            // A joint without stops is measured over one turn.
            range_rad: limits.map_or(TAU, |l| l.upper_rad - l.lower_rad),
            gain_error: 0.0,
            offset_error_rad: sensors.offset_error_max_rad * effect_rng(seed, "offset", name).random_range(-1.0..=1.0),
            temperature_offset_rad_per_k: 0.0,
            temperature_gain_per_k: 0.0,
            gear_ratio: spec.gear_ratio.get(name).copied().unwrap_or(1.0),
            pressure_offset_rad_per_mpa: 0.0,
            pressure_gain_per_mpa: 0.0,
            harmonics: Vec::new(),
            worn_spot: None,
            eccentricity: None,
            resolver: None,
        };
        match robot.sensors[joint].kind {
            SensorKind::Potentiometer => built.draw_potentiometer(sensors, seed),
            SensorKind::Encoder => built.draw_encoder(sensors, seed),
            SensorKind::Resolver => built.draw_resolver(sensors, seed),
        }
        built
    }

    fn draw_potentiometer(&mut self, sensors: &JointSensorsSpec, seed: u64) {
        let name = self.name.clone();
        let normal = |effect: &str, std: f64| normal(seed, effect, &name, std);
        self.gain_error = sensors.gain_error_max * effect_rng(seed, "gain", &name).random_range(-1.0..=1.0);
        self.temperature_offset_rad_per_k = normal("temperature_offset", sensors.temperature_offset_std_rad_per_k);
        self.temperature_gain_per_k = normal("temperature_gain", sensors.temperature_gain_std_per_k);
        self.pressure_offset_rad_per_mpa = normal("pressure_offset", sensors.pressure_offset_std_rad_per_mpa);
        self.pressure_gain_per_mpa = normal("pressure_gain", sensors.pressure_gain_std_per_mpa);
        self.harmonics = draw_harmonics(self, sensors.nonlinearity_peak, &mut effect_rng(seed, "nonlinearity", &name));
        if sensors.wears() {
            let mut rng = effect_rng(seed, "worn_spot", &name);
            // Not beside the end stops, where no arm works.
            let center_rad = self.center_rad + self.range_rad * rng.random_range(-0.4..=0.4);
            let sign = if rng.random_range(0.0..1.0) < 0.5 { -1.0 } else { 1.0 };
            let peak_rad = sign * sensors.worn_spot_peak_rad;
            self.worn_spot = Some(WornSpot { center_rad, peak_rad, width_rad: sensors.worn_spot_width_rad });
        }
    }

    fn draw_encoder(&mut self, sensors: &JointSensorsSpec, seed: u64) {
        if sensors.encoder_eccentricity_rad > 0.0 {
            let phase_rad = effect_rng(seed, "eccentricity", &self.name).random_range(0.0..TAU);
            let amplitude_rad = sensors.encoder_eccentricity_rad;
            self.eccentricity = Some(Harmonic { order: 1.0, amplitude_rad, phase_rad });
        }
    }

    fn draw_resolver(&mut self, sensors: &JointSensorsSpec, seed: u64) {
        let normal = |effect: &str, std: f64| normal(seed, effect, &self.name, std);
        self.resolver = Some(ResolverAsBuilt {
            pole_pairs: sensors.resolver_pole_pairs,
            phase_rad: effect_rng(seed, "resolver_phase", &self.name).random_range(0.0..TAU),
            imbalance: normal("resolver_imbalance", sensors.resolver_imbalance_std),
            quadrature_rad: normal("resolver_quadrature", sensors.resolver_quadrature_std_rad),
            temperature_offset_rad_per_k: normal("resolver_temperature", sensors.resolver_temperature_std_rad_per_k),
        });
    }
}

fn effect_rng(seed: u64, effect: &str, joint: &str) -> ChaCha8Rng {
    stream_rng(seed, &format!("as_built/{effect}/{joint}"))
}

fn normal(seed: u64, effect: &str, joint: &str, std: f64) -> f64 {
    let value: f64 = StandardNormal.sample(&mut effect_rng(seed, effect, joint));
    std * value
}

/// Two to four harmonics over the range, scaled so that the largest deviation within it is `peak` of the range.
fn draw_harmonics(joint: &JointAsBuilt, peak: f64, rng: &mut impl rand::Rng) -> Vec<Harmonic> {
    const SAMPLES: u32 = 2000;
    let n = rng.random_range(2..=4_u32);
    let raw = (1..=n)
        .map(|order| Harmonic {
            order: f64::from(order),
            amplitude_rad: rng.random_range(0.2..=1.0),
            phase_rad: rng.random_range(0.0..TAU),
        })
        .collect();
    let mut unscaled = JointAsBuilt { harmonics: raw, ..joint.clone() };
    let largest = (0..=SAMPLES)
        .map(|i| joint.center_rad + joint.range_rad * (f64::from(i) / f64::from(SAMPLES) - 0.5))
        .map(|angle| unscaled.nonlinearity_rad(angle).abs())
        .fold(f64::MIN_POSITIVE, f64::max);
    for harmonic in &mut unscaled.harmonics {
        harmonic.amplitude_rad *= peak * joint.range_rad / largest;
    }
    unscaled.harmonics
}
