//! Student's t distribution: the probability of a mean, relative to its own scatter, by chance.

use crate::stats::chi_square::ln_gamma_of_half;

/// Returns the probability that a t variable of `dof` degrees of freedom exceeds `t`. For `t > 0` it is half of
/// `I_x(dof/2, 1/2)`, `x = dof / (dof + t^2)`: the regularized incomplete beta function by its continued fraction
/// (Press et al., Numerical Recipes, 6.4). NaN without degrees of freedom, or if `t` is NaN.
#[must_use]
pub fn student_t_above(t: f64, dof: usize) -> f64 {
    if dof == 0 || t.is_nan() {
        return f64::NAN;
    }
    let x = dof as f64 / (dof as f64 + t * t);
    let side = 0.5 * incomplete_beta_half(x, dof);
    if t > 0.0 { side } else { 1.0 - side }
}

/// Returns `I_x(dof/2, 1/2)`.
fn incomplete_beta_half(x: f64, dof: usize) -> f64 {
    let (a, b) = (0.5 * dof as f64, 0.5);
    if x <= 0.0 || x >= 1.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    let ln_beta = ln_gamma_of_half(dof) + ln_gamma_of_half(1) - ln_gamma_of_half(dof + 1);
    let front = (a * x.ln() + b * (1.0 - x).ln() - ln_beta).exp();
    if x < (a + 1.0) / (a + b + 2.0) {
        front * continued_fraction(a, b, x) / a
    } else {
        1.0 - front * continued_fraction(b, a, 1.0 - x) / b
    }
}

/// Returns the continued fraction of `I_x(a, b)`, by Lentz's method.
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
            let found = student_t_above(t, dof);
            assert!((found / above - 1.0).abs() < 1e-3, "t {t}, {dof} degrees of freedom: {found}");
            assert!((student_t_above(-t, dof) + found - 1.0).abs() < 1e-12);
        }
        assert_eq!(student_t_above(0.0, 5), 0.5);
        assert_eq!(student_t_above(f64::INFINITY, 5), 0.0);
        assert!(student_t_above(1.0, 0).is_nan());
    }
}
