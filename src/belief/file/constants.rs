//! Constants that decide something in `file`: unit, source and effect of each, by the file that uses it.

pub(crate) mod calibration_file {
    /// Relative difference below which the scale of `spec` counts as the measured one, 1: only rounding differs.
    pub(crate) const SAME: f64 = 1e-9;
    /// The least slope that a sensor may have anywhere, relative to its gain.
    pub(crate) const LEAST_SLOPE: f64 = 0.2;
}

pub(crate) mod camera_mount {
    /// Length of a quaternion that is one by the digits of its file, 1.
    pub(crate) const UNIT_LENGTH: std::ops::RangeInclusive<f64> = 0.999..=1.001;
}

pub(crate) mod compact_precision {
    /// The text must be shorter than this, bytes.
    pub const MAX_COMPACT_BYTES: usize = 512;
    /// Steps per unit of corrections and their deviations: multiples of 1e-7 (gains: relative, offsets: rad). Half a
    /// step at 8 joints of a 5 m arm at the ends of their ranges moves the tool by less than 0.01 mm.
    pub(crate) const STEPS: f64 = 1e7;
    /// Steps per unit if the sensors have terms: 1e-6 leaves room for them and moves the tool of a 2 m arm by less than
    /// 0.02 mm.
    pub(crate) const STEPS_WITH_TERMS: f64 = 1e6;
    /// Steps per metre of predicted tool errors: whole micrometres.
    pub(crate) const UM_PER_M: f64 = 1e6;
    /// The largest correction, in steps: 10 times the datasheet's gain, 10 rad.
    pub(crate) const MAX_STEPS: i64 = 99_999_999;
    /// Number of digits of the messages' hash in the text.
    pub(crate) const HASH_DIGITS: usize = 12;
}

pub(crate) mod compact_terms {
    /// Steps of the shape's coefficients, finest first, rad; the finest that fits is used. The coarsest moves the tool
    /// of a 2 m arm by less than 0.05 mm.
    pub(crate) const SHAPE_STEPS_RAD: [f64; 3] = [1e-6, 2e-6, 5e-6];
    /// Steps per rad/K and rad/MPa, 1/K, rad/h, rad: half a step at 20 K, 20 MPa or 5 h moves a joint by at most 5e-6
    /// rad.
    pub(crate) const OFFSET_STEPS: f64 = 2e6;
    pub(crate) const GAIN_STEPS: f64 = 5e6;
    pub(crate) const DRIFT_STEPS: f64 = 1e6;
    pub(crate) const PLAY_STEPS: f64 = 2e5;
    /// Steps per C and per Pa of the reference.
    pub(crate) const OIL_STEPS: f64 = 1e2;
    pub(crate) const PRESSURE_STEPS: f64 = 1e-3;
    pub(crate) const BASE: i64 = 45;
    /// Number of digits that no allowed number exceeds.
    pub(crate) const MAX_DIGITS: usize = 4;
    pub(crate) const LARGEST_STEPS: i64 = 1_000_000;
}

pub(crate) mod compact_text {
    /// Robot names longer than this after escaping are shortened, bytes.
    pub(crate) const MAX_NAME_BYTES: usize = 40;
    pub(crate) const SUM_DIGITS: usize = 8;
    /// Number of letters of the longest code of a refusal, with room for later ones.
    pub(crate) const MAX_CODE: usize = 32;
}

pub(crate) mod covariance_file {
    /// Number of rows above which a covariance is written with seven significant digits.
    pub(crate) const FULL_DIGITS_ROWS: usize = 24;
}

pub(crate) mod joint_check {
    /// Relative difference below which a gain is the one that its ratio to the datasheet gives, 1: only rounding.
    pub(crate) const SAME_GAIN: f64 = 1e-6;
    /// The largest ratio of a gain or a scale to the datasheet's, 1; scales of robot.toml span this much.
    pub(crate) const LARGEST_RATIO: f64 = 1e12;
    /// The largest scale or zero, counts per radian or counts: robot.toml allows 1e9 per degree or millimetre.
    pub(crate) const LARGEST_SCALE: f64 = 1e12;
}

pub(crate) mod lookup {
    /// Number of points of a table; the error of straight lines between them is about 1 % of the nonlinearity.
    pub(crate) const POINTS: usize = 65;
}

pub(crate) mod robot_match {
    /// Difference of a datasheet's value from the one that a calibration was made with that is only rounding: relative
    /// for scales, rad or m for zeros and centres. It moves the tool of a 5 m arm by less than 0.01 mm.
    pub(crate) const SAME_DATASHEET: f64 = 1e-6;
}

pub(crate) mod valid_range {
    /// Excess that is not reported: oil (K), pressure (Pa), age (h). Assumed.
    pub(crate) const MARGIN_K: f64 = 2.0;
    pub(crate) const MARGIN_PA: f64 = 0.5e6;
    pub(crate) const MARGIN_H: f64 = 6.0;
}

pub(crate) mod validity {
    /// Excess of an angle that is not reported, rad. Assumed.
    pub(crate) const MARGIN_RAD: f64 = 0.05;
    /// Excess over the captured range, in widths of that range, above which a target is not judged. U95 includes the
    /// stated linearity of a sensor beyond the views, and in good arms up to 0.96 widths occur. Assumed.
    pub(crate) const MAX_EXTRAPOLATION: f64 = 1.0;
    /// Least tool motion per joint motion that makes a joint matter to a target, m/rad; slides always do. Assumed.
    pub(crate) const MIN_LEVER_M: f64 = 0.01;
}
