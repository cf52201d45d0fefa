//! Constants that decide something in `measure`: unit, source and effect of each, by the file that uses it.

pub(crate) mod observation {
    /// An observation that the lens cannot have seen counts as this many sigma off in each coordinate.
    pub(crate) const UNSEEN_SIGMAS: f64 = 1e3;
}
