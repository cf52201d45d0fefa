//! Constants that decide something in `methods`: unit, source and effect of each, by the file that uses it.

pub(crate) mod gripper_tag {
    use armcal_core::numeric::{Damping, StopRule};

    /// Mount and tag this many sigma of their priors off: one of them was knocked, or it is another tag.
    pub(crate) const MAX_PRIOR_SIGMAS: f64 = 6.0;
    /// Undamped until a step does not help.
    pub(crate) const DAMPING: Damping =
        Damping { first: 0.0, min: 0.0, max: f64::INFINITY, down: 0.1, up: 10.0, min_after_rejection: 1.0 };
    /// A step this small in units of the priors' sigma changes nothing. The views' weights change a little with the
    /// state: the cost may grow by a share without a step being wrong.
    pub(crate) const STOP: StopRule = StopRule { step_length: 1e-5, slack: 1e-3, ..StopRule::after(50) };
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
    /// A parameter with more than this share of the square of a direction that nothing determines is open.
    pub(crate) const OPEN_SHARE: f64 = 1e-6;
}
