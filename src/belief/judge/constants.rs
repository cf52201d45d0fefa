//! Constants that decide something in `judge`: unit, source and effect of each, by the file that uses it.

/// Probability that a good arm, tag or length fails a single check by chance.
pub(crate) const FALSE_ALARM: f64 = 1e-4;

pub(crate) mod baseline_comparison {
    /// Level of the test: an improvement with a larger probability counts as chance.
    pub const SIGNIFICANCE: f64 = 0.01;
    /// Least reported probability; smaller ones add no information.
    pub(crate) const LEAST_P: f64 = 1e-9;
}

pub(crate) mod coverage {
    /// Probability that U95 holds (GUM 6.2; JCGM 106 calls it the coverage probability).
    pub const COVERAGE: f64 = 0.95;
    /// Number of nodes in `s_1` and in the angle: the probability is then accurate to 1e-5 from isotropic to rank one.
    pub(crate) const NODES: usize = 24;
    pub(crate) const ANGLES: usize = 12;
    /// Degrees of freedom above which the noise counts as known: U95 differs by less than 0.3 %.
    pub(crate) const INFINITE_DOF: f64 = 500.0;
    pub(crate) const STEPS: usize = 60;
    pub(crate) const NEWTON_STEPS: usize = 6;
    /// Relative accuracy of U95 at which the search for it ends.
    pub(crate) const KNOWN_TO: f64 = 1e-6;
}

pub(crate) mod decision {
    use crate::judge::constants::coverage::COVERAGE;

    /// Largest probability, at any target, that the tool is off by more than the tolerance: the specific risk of JCGM
    /// 106.
    pub const MAX_RISK: f64 = 1.0 - COVERAGE;
}
