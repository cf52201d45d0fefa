//! Constants that affect this crate's results: unit, source and effect of each, by the file that uses it.

pub(crate) mod minimum_variance {
    /// Eigenvalue of the objective's curvature, as a share of the largest, below which it is zero within rounding.
    pub(crate) const NULL_SHARE: f64 = 1e-12;
    /// Share of a null direction above which a parameter takes part in it.
    pub(crate) const PART_OF_NULL: f64 = 1e-6;
}

pub(crate) mod search {
    /// Half-width of the search box in units of prior sigma; beyond it a sensor is broken, not out of calibration.
    pub(crate) const BOUND_SIGMAS: f64 = 6.0;
    /// Share of the box beyond which a parameter counts as on its bound.
    pub(crate) const ON_BOUND: f64 = 0.999;
}
