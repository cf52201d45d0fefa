//! Constants that decide something in `batch`: unit, source and effect of each, by the file that uses it.

pub(crate) mod marked_calibrations {
    /// The fewest views that may be fitted at all.
    pub const MIN_VIEWS: usize = 3;
}

pub(crate) mod rounds {
    /// Fewer views do not determine how large noise and nonlinearity are: the datasheet's figures stand.
    pub(crate) const MIN_VIEWS_FOR_EVIDENCE: usize = 12;
}

pub(crate) mod failure_impact {
    /// Fewer views do not tell where a sensor stands since it slipped from views in which it jumped.
    pub(crate) const MIN_VIEWS_SINCE: usize = 3;
    /// A gain this close to a ratio of units is that ratio: no sensor of these units differs by so much.
    pub(crate) const UNIT_SHARE: f64 = 0.15;
}

pub(crate) mod slips_since {
    /// One false slip in some million comparisons.
    pub(crate) const MIN_SIGMAS: f64 = 5.0;
    /// Smaller changes are drift, rad.
    pub(crate) const MIN_SLIP_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;
    /// Angles at which the calibrations are compared.
    pub(crate) const N_ANGLES: usize = 9;
}
