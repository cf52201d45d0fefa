//! What far residuals cost.

/// Cost and weight of a sighting by the sum of its squared whitened residuals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Loss {
    Square,
    /// `c^2 ln(1 + chi2 / c^2)`, `c^2 = width^2` times the number of coordinates: what is far pulls less the farther it is.
    Cauchy {
        width: f64,
    },
}

impl Loss {
    /// (cost, d(cost)/d(chi2)).
    pub(super) fn of(self, chi2: f64, n_coordinates: usize) -> (f64, f64) {
        match self {
            Self::Square => (chi2, 1.0),
            Self::Cauchy { width } => {
                let c2 = width * width * n_coordinates as f64;
                (c2 * (chi2 / c2).ln_1p(), 1.0 / (1.0 + chi2 / c2))
            }
        }
    }
}
