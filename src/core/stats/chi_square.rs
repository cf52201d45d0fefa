//! The chi-square distribution: how likely a sum of squares is by chance.

/// Probability that a chi-square variable of `dof` degrees of freedom exceeds `x`: `Q(dof/2, x/2)`, the regularized
/// incomplete gamma function by its series below `a + 1` and by Lentz's continued fraction above (Press et al.,
/// Numerical Recipes, 6.2). Not a number where `x` is none; 1 without degrees of freedom.
#[must_use]
pub fn chi_square_above(x: f64, dof: usize) -> f64 {
    above(x, dof, ln_gamma_of_half(dof))
}

/// `ln_gamma`: of half the degrees of freedom, a sum over these.
fn above(x: f64, dof: usize, ln_gamma: f64) -> f64 {
    let (a, x) = (0.5 * dof as f64, 0.5 * x);
    if dof == 0 || x <= 0.0 {
        return 1.0;
    }
    if x.is_infinite() {
        return 0.0;
    }
    let scale = (a * x.ln() - x - ln_gamma).exp();
    if x < a + 1.0 { 1.0 - scale * series(a, x) } else { scale * continued_fraction(a, x) }
}

/// What a chi-square variable of `dof` degrees of freedom stays below with probability `p`, 0 < p < 1; by bisection.
#[must_use]
pub fn chi_square_quantile(p: f64, dof: usize) -> f64 {
    /// Halvings of the bracket: to the last digits.
    const STEPS: usize = 80;
    if dof == 0 {
        return 0.0;
    }
    let ln_gamma = ln_gamma_of_half(dof);
    let mut high = dof as f64 + 1.0;
    while above(high, dof, ln_gamma) > 1.0 - p && high < 1e12 {
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if above(middle, dof, ln_gamma) > 1.0 - p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// `ln Gamma(dof / 2)`, by the recurrence from 1 or 1/2.
pub(super) fn ln_gamma_of_half(dof: usize) -> f64 {
    let (mut at, mut value) = if dof.is_multiple_of(2) { (1.0, 0.0) } else { (0.5, 0.5 * std::f64::consts::PI.ln()) };
    while at < 0.5 * dof as f64 {
        value += f64::ln(at);
        at += 1.0;
    }
    value
}

const MAX_TERMS: usize = 100_000;

fn series(a: f64, x: f64) -> f64 {
    let (mut term, mut sum) = (1.0 / a, 1.0 / a);
    for n in 1..MAX_TERMS {
        term *= x / (a + n as f64);
        sum += term;
        if term < sum * f64::EPSILON {
            break;
        }
    }
    sum
}

fn continued_fraction(a: f64, x: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let at_least = |v: f64| if v.abs() < TINY { TINY } else { v };
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / TINY;
    let mut d = 1.0 / at_least(b);
    let mut value = d;
    for n in 1..MAX_TERMS {
        let an = -(n as f64) * (n as f64 - a);
        b += 2.0;
        d = 1.0 / at_least(an * d + b);
        c = at_least(b + an / c);
        value *= c * d;
        if (c * d - 1.0).abs() < 4.0 * f64::EPSILON {
            break;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        // Abramowitz and Stegun, table 26.8.
        for (p, dof, x) in [
            (0.95, 1, 3.841_459),
            (0.05, 3, 0.351_846),
            (0.999, 3, 16.266_236),
            (0.95, 10, 18.307_038),
            (0.995, 30, 53.671_96),
            (0.5, 100, 99.334_129),
        ] {
            let found = chi_square_quantile(p, dof);
            assert!((found - x).abs() < 2e-6 * x, "{p} of {dof}: {found} for {x}");
            assert!((chi_square_above(found, dof) - (1.0 - p)).abs() < 1e-9);
        }
    }

    #[test]
    fn far_tails_and_odd_input_give_numbers() {
        assert!((chi_square_above(1000.0, 2).ln() + 500.0).abs() < 1e-9);
        assert_eq!(chi_square_above(0.0, 3), 1.0);
        assert_eq!(chi_square_above(f64::INFINITY, 3), 0.0);
        assert!(chi_square_above(f64::NAN, 3).is_nan());
        assert!(chi_square_above(5000.0, 5000) > 0.45 && chi_square_above(5000.0, 5000) < 0.5);
    }
}
