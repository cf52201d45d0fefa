//! Constants that decide something in `say`: unit, source and effect of each, by the file that uses it.

pub(crate) mod reading_error {
    /// Real part of a unit quaternion from which on the rotation counts as none: less than 0.2 deg is rounding.
    pub(crate) const UNTURNED: f64 = 1.0 - 1e-6;
}

pub(crate) mod refusal {
    /// A smaller share of used observations means that the views fit nothing near the prior.
    pub(crate) const MIN_USED_SHARE: f64 = 0.6;
}

pub(crate) mod refusal_words {
    /// Probabilities in percent and slopes below this limit are printed with more digits.
    pub(crate) const MORE_DIGITS_BELOW: f64 = 0.1;
}

pub(crate) mod repair {
    /// Smallest relative focal length error to report. Below it, centre or distortion is the error of the lens.
    pub(crate) const LEAST_FOCAL: f64 = 1e-3;
}

pub(crate) mod length_unit {
    /// Length units that may have been written instead of metres, and the number of each in one metre.
    pub(crate) const UNITS: [(&str, f64); 5] =
        [("mm", 1e3), ("cm", 1e2), ("dm", 1e1), ("inches", 1.0 / 0.0254), ("feet", 1.0 / 0.3048)];
    /// Relative difference from a unit's ratio within which a ratio of lengths is that unit. Assumed: neighbouring
    /// units differ at least by a factor of two.
    pub(crate) const NEAR: f64 = 0.03;
}

pub(crate) mod sensor_keys {
    /// Distance from -1 within which a reversed sensor's slope keeps the scale of its datasheet. Assumed: gears differ
    /// by more.
    pub(crate) const SIGN_ALONE: f64 = 0.1;
    /// Digits of a scale in files: the rounding is below the sigma of any stated gain. Assumed.
    pub(crate) const SIGNIFICANT_DIGITS: i32 = 6;
}

pub(crate) mod wrong_input_words {
    /// Refractive index of sea water (Treibitz et al. 2012).
    pub(crate) const WATER: f64 = 1.34;
    /// Relative difference from `WATER` within which a ratio of focal lengths is attributed to water.
    pub(crate) const NEAR: f64 = 0.04;
}
