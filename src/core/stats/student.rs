//! Student's t distribution: how likely a mean over its own scatter is by chance.

use crate::stats::chi_square::ln_gamma_of_half;

/// The distribution with so many degrees of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudentT {
    dof: usize,
    /// `ln B(dof / 2, 1/2)`.
    ln_beta: f64,
}

impl StudentT {
    /// A sum over the degrees of freedom: not for each value again.
    #[must_use]
    pub fn new(dof: usize) -> Self {
        Self { dof, ln_beta: ln_gamma_of_half(dof) + ln_gamma_of_half(1) - ln_gamma_of_half(dof + 1) }
    }

    /// Probability that a t variable exceeds `t`: half of `I_x(dof/2, 1/2)`, `x = dof / (dof + t^2)`, for `t > 0`; the
    /// regularized incomplete beta function by its continued fraction (Press et al., Numerical Recipes, 6.4). Not a
    /// number without degrees of freedom, or where `t` is none.
    #[must_use]
    pub fn above(&self, t: f64) -> f64 {
        if self.dof == 0 || t.is_nan() {
            return f64::NAN;
        }
        let dof = self.dof as f64;
        let side = 0.5 * self.incomplete_beta_half(dof / (dof + t * t));
        if t > 0.0 { side } else { 1.0 - side }
    }

    /// `I_x(dof/2, 1/2)`.
    fn incomplete_beta_half(&self, x: f64) -> f64 {
        let (a, b) = (0.5 * self.dof as f64, 0.5);
        if x <= 0.0 || x >= 1.0 {
            return if x <= 0.0 { 0.0 } else { 1.0 };
        }
        let front = (a * x.ln() + b * (1.0 - x).ln() - self.ln_beta).exp();
        if x < (a + 1.0) / (a + b + 2.0) {
            front * continued_fraction(a, b, x) / a
        } else {
            1.0 - front * continued_fraction(b, a, 1.0 - x) / b
        }
    }
}

/// Of `I_x(a, b)`, by Lentz's method.
fn continued_fraction(a: f64, b: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    const MAX_TERMS: usize = 10_000;
    let at_least = |v: f64| if v.abs() < TINY { TINY } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / at_least(1.0 - (a + b) * x / (a + 1.0));
    let mut value = d;
    for term in 1..MAX_TERMS {
        let m = term as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let before = value;
        for by in [even, odd] {
            d = 1.0 / at_least(1.0 + by * d);
            c = at_least(1.0 + by / c);
            value *= c * d;
        }
        if (value / before - 1.0).abs() < 4.0 * f64::EPSILON {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz and Stegun, table 26.10; the last by the normal distribution.
    #[test]
    fn tabulated_quantiles_come_back() {
        for (t, dof, above) in [
            (6.965, 2, 0.01),
            (4.541, 3, 0.01),
            (2.764, 10, 0.01),
            (2.457, 30, 0.01),
            (6.314, 1, 0.05),
            (2.326_35, 1_000_000, 0.01),
        ] {
            let found = StudentT::new(dof).above(t);
            assert!((found / above - 1.0).abs() < 1e-3, "t {t}, {dof} degrees of freedom: {found}");
            assert!((StudentT::new(dof).above(-t) + found - 1.0).abs() < 1e-12);
        }
        assert_eq!(StudentT::new(5).above(0.0), 0.5);
        assert_eq!(StudentT::new(5).above(f64::INFINITY), 0.0);
        assert!(StudentT::new(0).above(1.0).is_nan());
    }
}
