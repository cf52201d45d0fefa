//! Constants that decide something in `say`: unit, source and effect of each, by the file that uses it.

pub(crate) mod reading_error {
    /// Real part of a unit quaternion from which on it turns nothing: less than 0.2 deg is rounding.
    pub(crate) const UNTURNED: f64 = 1.0 - 1e-6;
}

pub(crate) mod refusal {
    /// A smaller share of used observations means that the views fit nothing near the prior.
    pub(crate) const MIN_USED_SHARE: f64 = 0.6;
}

pub(crate) mod refusal_words {
    /// Probabilities in percent and slopes below this are said with more digits.
    pub(crate) const MORE_DIGITS_BELOW: f64 = 0.1;
}

pub(crate) mod repair {
    /// A focal length that is off by less is not what was found of a lens, relative.
    pub(crate) const LEAST_FOCAL: f64 = 1e-3;
}

pub(crate) mod length_unit {
    /// Units that lengths may be written in instead of metres, and how many make a metre.
    pub(crate) const UNITS: [(&str, f64); 5] =
        [("mm", 1e3), ("cm", 1e2), ("dm", 1e1), ("inches", 1.0 / 0.0254), ("feet", 1.0 / 0.3048)];
    /// A ratio of lengths within this of a unit's is that unit, relative. Assumed: neighbours differ by a factor of two
    /// and more.
    pub(crate) const NEAR: f64 = 0.03;
}

pub(crate) mod sensor_keys {
    /// A reversed sensor whose slope is within this of -1 has the scale of its datasheet. Assumed: gears differ by
    /// more.
    pub(crate) const SIGN_ALONE: f64 = 0.1;
    /// Digits of a scale, for files: what they leave is below the sigma of any stated gain. Assumed.
    pub(crate) const SIGNIFICANT_DIGITS: i32 = 6;
}

pub(crate) mod wrong_input_words {
    /// Refractive index of sea water (Treibitz et al. 2012).
    pub(crate) const WATER: f64 = 1.34;
    /// Relative difference from it within which a ratio of focal lengths is named as water.
    pub(crate) const NEAR: f64 = 0.04;
}
