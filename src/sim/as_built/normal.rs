//! Normal random numbers, each from the stream named after its effect.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use armcal_core::stats::stream_rng;

pub(super) fn normal_vector(seed: u64, what: &str, std: f64) -> Vector3<f64> {
    let mut rng = stream_rng(seed, &format!("as_built/{what}"));
    Vector3::from_fn(|_, _| std * Distribution::<f64>::sample(&StandardNormal, &mut rng))
}

pub(super) fn effect_rng(seed: u64, effect: &str, joint: &str) -> ChaCha8Rng {
    stream_rng(seed, &format!("as_built/{effect}/{joint}"))
}

pub(super) fn effect_normal(seed: u64, effect: &str, joint: &str, std: f64) -> f64 {
    let value: f64 = StandardNormal.sample(&mut effect_rng(seed, effect, joint));
    std * value
}
