//! Constants that decide something in `model`: unit, source and effect of each, by the file that uses it.

pub(crate) mod blocks_clock {
    /// Standard deviation of the delay between clocks, s. Assumed: clocks of one vehicle that nobody synchronized.
    pub(crate) const CLOCK_STD_S: f64 = 0.05;
}

pub(crate) mod blocks_value {
    /// Largest number of columns of a block: that of a lens.
    pub(crate) const MAX_COLUMNS: usize = 8;
}

pub(crate) mod parameters {
    /// Standard deviation of a worn spot's middle and width from the bump's, in widths. Assumed: tracks wear
    /// as they are used.
    pub(crate) const SHAPE_STD: f64 = 0.3;
    /// Standard width of a worn spot, rad. Assumed: about three degrees. A narrower spot affects readings only at its
    /// middle, a wider one needs two bumps.
    pub(crate) const SPOT_WIDTH_RAD: f64 = 0.05;
    /// Distance from a spot's middle, in widths, beyond which a reading has nothing to do with the spot.
    pub(crate) const FAR_WIDTHS: f64 = 3.0;
}

pub(crate) mod prior {
    /// Least standard deviation of a prior: what is said to be exact stays where it is.
    pub(crate) const MIN_STD: f64 = 1e-9;
}

pub(crate) mod scales {
    use armcal_core::robot::MAX_FURTHER_CAMERAS;

    /// Correlation length of a sensor's nonlinearity, half ranges. Assumed: four waves over the range are then still
    /// half as likely as one.
    pub const SHAPE_LENGTH: f64 = 0.16;
    /// Error of an image's stamp, including the delay of moving joints' sensors, s. Assumed.
    pub(crate) const TIME_JITTER_STD_S: f64 = 0.005;
    /// Prior of a sensor's slip on its shaft, rad. Assumed: wide, because the views determine it.
    pub(crate) const STEP_STD_RAD: f64 = 0.1;
    /// Height of a worn spot's bump, rad. Assumed: wide, because the views determine it.
    pub(crate) const BUMP_STD_RAD: f64 = 0.03;
    /// Number of cameras of an arm: the first and all further ones.
    pub const MAX_CAMERAS: usize = 1 + MAX_FURTHER_CAMERAS;
    /// Initial ratio of a scale to robot.toml's value, before the views change it.
    pub(crate) const AS_STATED: f64 = 1.0;
    /// Error of a joint without a usable sensor reading, rad. Assumed: wide, because the views determine it.
    pub(crate) const FREE_JOINT_STD_RAD: f64 = 1.0;
    /// Change of an offset with the oil temperature where no datasheet states it, rad/K. Assumed; the views correct it.
    pub(crate) const OFFSET_STD_RAD_PER_K: f64 = 3e-4;
    /// Change of a gain with the oil temperature, 1/K. Assumed; the views correct it.
    pub(crate) const GAIN_STD_PER_K: f64 = 3e-5;
    /// Change of an offset with the ambient pressure, rad/MPa. Assumed; the views correct it.
    pub(crate) const OFFSET_STD_RAD_PER_MPA: f64 = 1e-4;
    /// Drift of an offset, rad/h. Assumed; the views correct it.
    pub(crate) const DRIFT_STD_RAD_PER_H: f64 = 1e-3;
    /// Half of the backlash between joint and sensor shaft, rad. Assumed; the views correct it.
    pub(crate) const HALF_PLAY_STD_RAD: f64 = 2e-4;
    /// Noise of recorded positions and rotations, m and rad. Assumed; the views correct it.
    pub(crate) const POSE_STD: [f64; 2] = [0.005, 0.02];
}

pub(crate) mod shared_survey_error {
    /// Weight of a map's anchor in the information on the map's place, 1; the other tags have the rest. Assumed: the
    /// anchor determines it best, but may be seen seldom.
    pub(crate) const ANCHOR_WEIGHT: f64 = 0.5;
    /// Weight of the positions of the other tags, 1; their rotations have the rest. Assumed: positions determine turns,
    /// too.
    pub(crate) const POSITION_WEIGHT: f64 = 0.8;
}

pub(crate) mod walk_modes {
    /// Number of estimated modes of a walk: they contain 95 % of its variance.
    pub(crate) const N_WALK_MODES: usize = 4;
}
