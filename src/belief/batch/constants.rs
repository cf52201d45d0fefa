//! Constants that decide something in `batch`: unit, source and effect of each, by the file that uses it.

pub(crate) mod marked_calibrations {
    /// Least number of views for a fit.
    pub const MIN_VIEWS: usize = 3;
}

pub(crate) mod rounds {
    /// Least number of views that determine noise and nonlinearity; below it the datasheet's figures stay.
    pub(crate) const MIN_VIEWS_FOR_EVIDENCE: usize = 12;
}

pub(crate) mod failure_impact {
    /// Least number of views that distinguish the offset after a slip from single views in which the reading jumped.
    pub(crate) const MIN_VIEWS_SINCE: usize = 3;
    /// Relative difference within which a gain is a ratio of units: no sensor of these units departs by so much.
    pub(crate) const UNIT_SHARE: f64 = 0.15;
}

pub(crate) mod slips_since {
    /// Change in sigmas that counts as a slip: one false slip in about a million comparisons.
    pub(crate) const MIN_SIGMAS: f64 = 5.0;
    /// Smallest slip, rad; smaller changes are drift.
    pub(crate) const MIN_SLIP_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;
    /// Number of angles at which the calibrations are compared.
    pub(crate) const N_ANGLES: usize = 9;
}
