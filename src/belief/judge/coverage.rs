//! U95: the radius that contains the tool's position error with 95 % probability (GUM: expanded uncertainty).
//!
//! An error with covariance `C` (eigenvalues `l`) is `rho C^(1/2) s`: `s` is uniform on the unit sphere, and `rho^2` is
//! chi-square with 3 degrees of freedom, or `3 F(3, nu)` where the size of the noise was estimated with `nu` degrees of
//! freedom. So `P(|e| <= r)` is the mean of `P(rho^2 <= r^2 / sum l_i s_i^2)` over the sphere. It is integrated over an
//! octant: Gauss-Legendre in `s_1`, the midpoint rule in the angle about that axis.

pub use crate::judge::constants::coverage::COVERAGE;
use crate::judge::constants::coverage::{ANGLES, INFINITE_DOF, KNOWN_TO, NEWTON_STEPS, NODES, STEPS};
use armcal_core::stats::{StudentT, chi_square_above};
use nalgebra::Matrix3;

/// Distribution of the tool's position error at one configuration of the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorDistribution {
    /// Eigenvalues of the covariance, m^2, the largest first; none is negative.
    eigenvalues_m2: [f64; 3],
    /// `None` where the covariance's size is known.
    fitted_size: Option<FittedSize>,
}

/// A size of the noise that was estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FittedSize {
    dof: f64,
    student: StudentT,
    /// `B(1/2, dof / 2)`.
    beta: f64,
}

impl ErrorDistribution {
    /// Distribution for a covariance, m^2, whose size has `dof` degrees of freedom (infinite where it is known). `None`
    /// where the covariance is not finite: nothing is known of the error then.
    #[must_use]
    pub fn new(covariance_m2: &Matrix3<f64>, dof: f64) -> Option<Self> {
        if !covariance_m2.iter().all(|value| value.is_finite()) || dof.is_nan() {
            return None;
        }
        let mut eigenvalues_m2: [f64; 3] = covariance_m2.symmetric_eigenvalues().into();
        eigenvalues_m2.sort_by(|a, b| b.total_cmp(a));
        let eigenvalues_m2 = eigenvalues_m2.map(|value| value.max(0.0));
        // The GUM (G.4.1) takes the next lower integer.
        let fitted_size = (dof < INFINITE_DOF).then(|| FittedSize::new(dof.max(1.0) as usize));
        Some(Self { eigenvalues_m2, fitted_size })
    }

    /// Probability that the error exceeds `radius_m`.
    #[must_use]
    pub fn beyond(&self, radius_m: f64) -> f64 {
        let [first, second, third] = self.eigenvalues_m2;
        if first == 0.0 || radius_m.is_infinite() {
            return 0.0;
        }
        let along = octant_nodes().into_iter().map(|(s, weight)| {
            let about = (0..ANGLES).map(|k| {
                let angle_rad = (k as f64 + 0.5) * std::f64::consts::FRAC_PI_2 / ANGLES as f64;
                let across = second * angle_rad.cos().powi(2) + third * angle_rad.sin().powi(2);
                self.radius_above(radius_m * radius_m / (first * s * s + across * (1.0 - s * s)))
            });
            weight * about.sum::<f64>() / ANGLES as f64
        });
        along.sum::<f64>().clamp(0.0, 1.0)
    }

    /// U95, m.
    #[must_use]
    pub fn u95_m(&self) -> f64 {
        let largest_m = self.eigenvalues_m2[0].sqrt();
        if largest_m == 0.0 {
            return 0.0;
        }
        let (mut low_m, mut high_m) = (0.0, 3.0 * largest_m);
        while self.beyond(high_m) > 1.0 - COVERAGE {
            (low_m, high_m) = (high_m, 2.0 * high_m);
        }
        for _ in 0..STEPS {
            let middle_m = 0.5 * (low_m + high_m);
            if self.beyond(middle_m) > 1.0 - COVERAGE {
                low_m = middle_m
            } else {
                high_m = middle_m
            }
            if high_m - low_m < KNOWN_TO * high_m {
                break;
            }
        }
        high_m
    }

    /// Probability that `rho^2` exceeds `x`.
    fn radius_above(&self, x: f64) -> f64 {
        self.fitted_size.map_or_else(|| chi_square_above(x, 3), |size| size.radius_above(x))
    }
}

impl FittedSize {
    fn new(dof: usize) -> Self {
        Self { dof: dof as f64, student: StudentT::new(dof), beta: beta_with_half(dof) }
    }

    /// Probability that `3 F(3, dof)` exceeds `x`.
    fn radius_above(&self, x: f64) -> f64 {
        if x.is_infinite() {
            return 0.0;
        }
        // The tail of |t| in one dimension, and the term that two more dimensions add: a recurrence of the incomplete
        // beta function.
        let share = x / (x + self.dof);
        2.0 * self.student.above(x.sqrt()) + 2.0 * share.sqrt() * (1.0 - share).powf(0.5 * self.dof) / self.beta
    }
}

/// `B(1/2, dof / 2)`, by its recurrence from `B(1/2, 1/2)` or `B(1/2, 1)`.
fn beta_with_half(dof: usize) -> f64 {
    let (mut b, mut value) = if dof.is_multiple_of(2) { (1.0, 2.0) } else { (0.5, std::f64::consts::PI) };
    while b < 0.5 * dof as f64 {
        value *= b / (b + 0.5);
        b += 1.0;
    }
    value
}

/// Gauss-Legendre nodes and weights on [0, 1], by Newton's method on the Legendre polynomial.
fn octant_nodes() -> [(f64, f64); NODES] {
    std::array::from_fn(|k| {
        let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (NODES as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..NEWTON_STEPS {
            let (mut before, mut value) = (1.0, x);
            for n in 2..=NODES {
                let n = n as f64;
                (before, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n);
            }
            slope = NODES as f64 * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_core::stats::{quantile, stream_rng};
    use nalgebra::{Rotation3, Vector3};
    use rand::RngExt as _;
    use rand_distr::{ChiSquared, Distribution as _, StandardNormal};

    fn turned(std_m: [f64; 3], about: f64) -> Matrix3<f64> {
        let turn = Rotation3::from_euler_angles(about, 2.0 * about, -0.7 * about);
        turn * Matrix3::from_diagonal(&Vector3::from(std_m.map(|std| std * std))) * turn.inverse()
    }

    /// Draws of the error's size; `dof` none for a covariance that is known.
    fn drawn_95_m(covariance_m2: &Matrix3<f64>, dof: Option<usize>, n: usize) -> f64 {
        let mut rng = stream_rng(7, "coverage");
        let root = covariance_m2.symmetric_eigen();
        let root = root.eigenvectors * Matrix3::from_diagonal(&root.eigenvalues.map(|value| value.max(0.0).sqrt()));
        let scatter = dof.map(|dof| (dof as f64, ChiSquared::new(dof as f64).expect("degrees of freedom")));
        let mut size_m = || {
            let normal = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let scale = scatter.as_ref().map_or(1.0, |(dof, scatter)| (dof / scatter.sample(&mut rng)).sqrt());
            scale * (root * normal).norm()
        };
        let sizes: Vec<f64> = (0..n).map(|_| size_m()).collect();
        quantile(&sizes, COVERAGE).expect("draws")
    }

    /// Closed forms: chi with three, two and one degrees of freedom.
    #[test]
    fn equal_axes_have_the_quantiles_of_chi() {
        for (std_m, chi_square) in
            [([1e-3; 3], 7.814_728), ([1e-3, 1e-3, 0.0], 5.991_465), ([1e-3, 0.0, 0.0], 3.841_459)]
        {
            let error = ErrorDistribution::new(&turned(std_m, 0.4), f64::INFINITY).expect("finite");
            let expected_m = 1e-3 * f64::sqrt(chi_square);
            assert!((error.u95_m() / expected_m - 1.0).abs() < 1e-5, "{std_m:?}: {}", error.u95_m());
            assert!((error.beyond(expected_m) - 0.05).abs() < 1e-5, "{std_m:?}: {}", error.beyond(expected_m));
        }
    }

    #[test]
    fn draws_of_many_covariances_lie_within_u95() {
        let shapes = [1.0, 0.7, 0.3, 0.1, 0.01].into_iter().flat_map(|b| [1.0, 0.5, 0.1, 0.0].map(|c| [1.0, b, b * c]));
        for (k, std_m) in shapes.enumerate() {
            let covariance_m2 = turned(std_m, 0.3 * k as f64);
            let error = ErrorDistribution::new(&covariance_m2, f64::INFINITY).expect("finite");
            let drawn_m = drawn_95_m(&covariance_m2, None, 1_000_000);
            assert!((error.u95_m() / drawn_m - 1.0).abs() < 0.005, "{std_m:?}: {} for {drawn_m}", error.u95_m());
        }
    }

    #[test]
    fn few_degrees_of_freedom_widen_it() {
        let covariance_m2 = turned([1.0, 0.4, 0.2], 0.9);
        let known_m = ErrorDistribution::new(&covariance_m2, f64::INFINITY).expect("finite").u95_m();
        let mut before_m = f64::INFINITY;
        for dof in [3, 4, 10, 60] {
            let error = ErrorDistribution::new(&covariance_m2, dof as f64 + 0.9).expect("finite");
            let drawn_m = drawn_95_m(&covariance_m2, Some(dof), 400_000);
            assert!((error.u95_m() / drawn_m - 1.0).abs() < 0.015, "{dof}: {} for {drawn_m}", error.u95_m());
            assert!(error.u95_m() < before_m && error.u95_m() > known_m, "{dof}");
            before_m = error.u95_m();
        }
        let many = ErrorDistribution::new(&covariance_m2, INFINITE_DOF - 1.0).expect("finite").u95_m();
        assert!((many / known_m - 1.0).abs() < 3e-3, "{many} for {known_m}");
    }

    #[test]
    fn what_is_not_finite_has_no_distribution_and_what_is_exact_no_radius() {
        assert_eq!(ErrorDistribution::new(&Matrix3::from_element(f64::NAN), 10.0), None);
        assert_eq!(ErrorDistribution::new(&Matrix3::from_diagonal_element(f64::INFINITY), 10.0), None);
        let exact = ErrorDistribution::new(&Matrix3::zeros(), 10.0).expect("finite");
        assert_eq!((exact.u95_m(), exact.beyond(0.0)), (0.0, 0.0));
        let some = ErrorDistribution::new(&Matrix3::identity(), f64::INFINITY).expect("finite");
        assert!((some.beyond(0.0) - 1.0).abs() < 1e-12);
    }
}
