//! Attenuation and veiling light of water: `I = J exp(-bD z) + Binf (1 - exp(-bB z))` for each channel (Akkaynak and
//! Treibitz 2018).
//!
//! Absorption a and scattering b are those of Jerlov (1976). `bD = a + b` attenuates a narrow beam. The veil grows with
//! `bB = 2 a + b` (assumed): its light is absorbed on the way out, too, while scattering is mostly forward. `Binf` is
//! the light of lamps and sun that the water sends back from far away (`shader`).

use crate::imaging::math::Rgb;
use crate::spec::{ImageSpec, WaterKind};

/// Coefficients for red, green and blue, 1/m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Water {
    pub direct_per_m: Rgb,
    pub backscatter_per_m: Rgb,
    /// Share of light scattered back per metre and steradian.
    pub in_scatter_per_m_sr: Rgb,
    pub scatter_per_m: Rgb,
}

impl Water {
    pub(super) fn new(spec: &ImageSpec) -> Self {
        let (absorption, scatter) = jerlov(spec.water);
        let scaled = |values: [f64; 3]| values.map(|value| (value * spec.turbidity) as f32);
        let each = |f: &dyn Fn(usize) -> f64| std::array::from_fn(f);
        let direct = spec.direct_per_m.unwrap_or_else(|| each(&|k| absorption[k] + scatter[k]));
        let backscatter = spec.backscatter_per_m.unwrap_or_else(|| each(&|k| 2.0 * absorption[k] + scatter[k]));
        Self {
            direct_per_m: scaled(direct),
            backscatter_per_m: scaled(backscatter),
            in_scatter_per_m_sr: scaled(scatter.map(|b| b * spec.backscatter_per_sr)),
            scatter_per_m: scaled(scatter),
        }
    }
}

/// Returns absorption and scattering, 1/m, for red, green and blue.
fn jerlov(kind: WaterKind) -> ([f64; 3], [f64; 3]) {
    match kind {
        WaterKind::Clear => ([0.460, 0.062, 0.018], [0.001, 0.002, 0.004]),
        WaterKind::Coastal => ([0.473, 0.071, 0.084], [0.415, 0.597, 0.874]),
        WaterKind::Turbid => ([0.604, 0.272, 0.847], [1.96, 2.81, 4.11]),
    }
}
