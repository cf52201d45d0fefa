//! Constants that decide something in `judge`: unit, source and effect of each, by the file that uses it.

/// Probability that a good arm, tag or length fails any one check by chance.
pub(crate) const FALSE_ALARM: f64 = 1e-4;

pub(crate) mod baseline_comparison {
    /// Level of the test: an improvement that chance makes more often is none.
    pub const SIGNIFICANCE: f64 = 0.01;
    /// Smaller probabilities say nothing that this one does not.
    pub(crate) const LEAST_P: f64 = 1e-9;
}

pub(crate) mod coverage {
    /// Probability that U95 holds (GUM 6.2; JCGM 106 calls it the coverage probability).
    pub const COVERAGE: f64 = 0.95;
    /// Nodes in `s_1` and in the angle: the probability is then right to 1e-5 from isotropic to rank one.
    pub(crate) const NODES: usize = 24;
    pub(crate) const ANGLES: usize = 12;
    /// More degrees of freedom than this are as good as infinite: U95 differs by less than 0.3 %.
    pub(crate) const INFINITE_DOF: f64 = 500.0;
    pub(crate) const STEPS: usize = 60;
    pub(crate) const NEWTON_STEPS: usize = 6;
    /// Share of U95 to which it is known: the search for it ends there.
    pub(crate) const KNOWN_TO: f64 = 1e-6;
}

pub(crate) mod decision {
    use crate::judge::constants::coverage::COVERAGE;

    /// Largest probability, at any target, that the tool is off by more than the tolerance: the specific risk of JCGM
    /// 106.
    pub const MAX_RISK: f64 = 1.0 - COVERAGE;
}
