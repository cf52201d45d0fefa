//! Vectors, colours, and fast functions that give the same bits on every machine.

use armcal_core::numeric::NO_FRACTION;

/// Vector in the camera's frame or an object's, single precision.
pub(super) type Vec3 = nalgebra::Vector3<f32>;
/// Red, green, blue.
pub(super) type Rgb = [f32; 3];
/// Several vectors, or colours, component by component: loops over them become vector instructions.
pub(super) type Lanes<const N: usize> = [[f32; N]; 3];

/// Converts vectors to lanes.
#[inline]
pub(super) fn lanes<const N: usize>(vectors: &[Vec3; N]) -> Lanes<N> {
    std::array::from_fn(|axis| std::array::from_fn(|k| vectors[k][axis]))
}

/// Returns `exp(x)` for x <= 0, to a relative error of 1e-6 and of the bits of x; 0 below -87.
#[inline]
pub(super) fn exp(x: f32) -> f32 {
    exp2(x * std::f32::consts::LOG2_E)
}

/// Returns `2^x` for x <= 0: the whole part goes into the exponent, the rest through its Taylor polynomial of degree 6.
#[inline]
pub(super) fn exp2(x: f32) -> f32 {
    // No branch, so that a loop of these can become vector instructions.
    let is_some = x >= -126.0;
    let x = if is_some { x } else { 0.0 };
    let below = x - 0.5;
    let nearest = (below + NO_FRACTION) - NO_FRACTION;
    let whole = if nearest < below { nearest + 1.0 } else { nearest };
    let rest = (x - whole) * std::f32::consts::LN_2;
    let polynomial = 1.0
        + rest
            * (1.0
                + rest
                    * (0.5 + rest * (1.0 / 6.0 + rest * (1.0 / 24.0 + rest * (1.0 / 120.0 + rest * (1.0 / 720.0))))));
    let value = f32::from_bits((whole + (NO_FRACTION + 127.0)).to_bits() << 23) * polynomial;
    if is_some { value } else { 0.0 }
}

/// Returns the smaller value without handling NaN: one instruction.
#[inline]
pub(super) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline]
pub(super) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns a hash of 64 bits: the finalizer of SplitMix64 (Steele et al. 2014).
#[inline]
pub(super) fn hash(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Returns a uniform number in 0..1 from the upper bits of a hash.
#[inline]
pub(super) fn unit(hash: u64) -> f32 {
    (hash >> 40) as f32 * (1.0 / 16_777_216.0)
}

/// Returns the key that selects the random numbers of image `number`.
pub(super) fn image_key(seed: u64, number: u64) -> u64 {
    hash(seed ^ hash(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_exact_enough() {
        for k in 0..20_000 {
            let x = -f64::from(k) * 0.004;
            let relative = f64::from(exp(x as f32)) / f64::from(x as f32).exp() - 1.0;
            assert!(relative.abs() < 1e-5, "{x}: {relative}");
        }
        assert_eq!(exp(-200.0), 0.0);
    }
}
