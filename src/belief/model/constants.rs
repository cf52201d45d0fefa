//! Constants that decide something in `model`: unit, source and effect of each, by the file that uses it.

pub(crate) mod blocks_clock {
    /// One sigma, s. Assumed: clocks of one vehicle that nobody synchronized.
    pub(crate) const CLOCK_STD_S: f64 = 0.05;
}

pub(crate) mod blocks_value {
    /// Columns of a lens, which has the most.
    pub(crate) const MAX_COLUMNS: usize = 8;
}

pub(crate) mod parameters {
    /// How far a spot's middle and its width are from the bump's, in widths. Assumed: tracks wear as they are used.
    pub(crate) const SHAPE_STD: f64 = 0.3;
}

pub(crate) mod prior {
    /// Least standard deviation of a prior: what is said to be exact stays where it is.
    pub(crate) const MIN_STD: f64 = 1e-9;
}

pub(crate) mod scales {
    /// Correlation length of a sensor's nonlinearity, half ranges. Assumed: four waves over the range are then still
    /// half as likely as one.
    pub const SHAPE_LENGTH: f64 = 0.16;
    /// Of an image's stamp about the camera's clock, with what sensors of moving joints are late by, s. Assumed.
    pub(crate) const TIME_JITTER_STD_S: f64 = 0.005;
    /// How far a sensor may slip on its shaft, rad. Assumed: wide, the views tell it.
    pub(crate) const STEP_STD_RAD: f64 = 0.1;
    /// Height of a worn spot's bump, rad. Assumed: wide, the views tell it.
    pub(crate) const BUMP_STD_RAD: f64 = 0.03;
}

pub(crate) mod walk_modes {
    /// Modes of a walk that are estimated: they hold 95 % of its variance.
    pub(crate) const N_WALK_MODES: usize = 4;
}
