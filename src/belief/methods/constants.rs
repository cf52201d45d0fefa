//! Constants that decide something in `methods`: unit, source and effect of each, by the file that uses it.

pub(crate) mod gripper_tag {
    /// Fewer views than this are left to the priors.
    pub(crate) const MIN_VIEWS: usize = 4;
    /// Mount and tag this many sigma of their priors off: one of them was knocked, or it is another tag.
    pub(crate) const MAX_PRIOR_SIGMAS: f64 = 6.0;
}

pub(crate) mod joint_limits {
    /// How far a stop may be from its drawing, one sigma, rad; assumed: half a degree, as machined stops on a worn arm.
    pub(crate) const STOP_STD_RAD: f64 = 0.0087;
    /// Angles nearer than this are one stop, rad.
    pub(crate) const SAME_STOP_RAD: f64 = 0.01;
    /// Readings of different stops differ by at least this share of the angle between them, or the sensor is dead.
    pub(crate) const LEAST_TRAVEL_SHARE: f64 = 0.1;
}

pub(crate) mod observability {
    /// Assumed error of one seen tag position per axis before any residual is known, m: what 0.3 px corners, a mount
    /// off by 2 mm and a survey off by 1 mm come to at 1 m. It decides only what is hopeless, so its exact size matters
    /// little.
    pub(crate) const POSITION_STD_M: f64 = 0.004;
}
