//! Constants that decide something in `measure`: unit, source and effect of each, by the file that uses it.

pub(crate) mod observation {
    /// Residual of each coordinate, in standard deviations, that an observation outside of the lens's view counts with.
    pub(crate) const UNSEEN_SIGMAS: f64 = 1e3;
}
