//! Robust loss functions.

/// Cost and weight of a residual, as functions of its squared whitened length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// `x`: least squares.
    Square,
    /// `x` to `k^2`, linear in the length beyond: `2 k sqrt(x) - k^2` (Huber 1964).
    Huber {
        /// Limit of the quadratic part, in standard deviations.
        k: f64,
    },
    /// `c^2 ln(1 + x / c^2)`: the weight falls with the distance.
    Cauchy {
        /// Scale, in standard deviations.
        c: f64,
    },
}

impl Loss {
    /// Returns (cost, d(cost)/d(x)) of a residual of squared whitened length `x`.
    #[must_use]
    #[inline]
    pub fn of(self, x: f64) -> (f64, f64) {
        match self {
            Self::Huber { k } if x > k * k => {
                let length = x.sqrt();
                (2.0 * k * length - k * k, k / length)
            }
            Self::Square | Self::Huber { .. } => (x, 1.0),
            Self::Cauchy { c } => {
                let c2 = c * c;
                (c2 * (x / c2).ln_1p(), 1.0 / (1.0 + x / c2))
            }
        }
    }

    /// Returns cost and weight of a residual of `n` coordinates. For the same error of each coordinate its length is
    /// `sqrt(n)` times as large, and so is the scale.
    #[must_use]
    #[inline]
    pub fn of_coordinates(self, x: f64, n: usize) -> (f64, f64) {
        let root = (n as f64).sqrt();
        match self {
            Self::Square => (x, 1.0),
            Self::Huber { k } => Self::Huber { k: k * root }.of(x),
            Self::Cauchy { c } => {
                let c2 = c * c * n as f64;
                (c2 * (x / c2).ln_1p(), 1.0 / (1.0 + x / c2))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_slopes_of_the_costs() {
        const STEP: f64 = 1e-6;
        for loss in [Loss::Square, Loss::Huber { k: 1.3 }, Loss::Cauchy { c: 2.4 }] {
            for x in [0.01, 1.0, 1.7, 20.0, 3000.0] {
                for n in [1, 2, 8] {
                    let slope =
                        (loss.of_coordinates(x + STEP, n).0 - loss.of_coordinates(x - STEP, n).0) / (2.0 * STEP);
                    let weight = loss.of_coordinates(x, n).1;
                    assert!((slope - weight).abs() < 1e-5, "{loss:?} at {x}, {n} coordinates: {slope} {weight}");
                }
                assert_eq!(loss.of(x), loss.of_coordinates(x, 1), "{loss:?} at {x}");
            }
        }
    }

    #[test]
    fn small_residuals_cost_their_square() {
        for loss in [Loss::Square, Loss::Huber { k: 1.0 }, Loss::Cauchy { c: 1.0 }] {
            let (cost, weight) = loss.of(1e-8);
            assert!((cost / 1e-8 - 1.0).abs() < 1e-7 && (weight - 1.0).abs() < 1e-7, "{loss:?}");
        }
    }
}
