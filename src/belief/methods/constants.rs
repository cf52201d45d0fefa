//! Constants that decide something in `methods`: unit, source and effect of each, by the file that uses it.

pub(crate) mod gripper_tag {
    use armcal_core::numeric::{Damping, StopRule};

    /// Largest deviation of mount or tag from its prior, in standard deviations. A larger one means that it was
    /// knocked, or that it is another tag.
    pub(crate) const MAX_PRIOR_SIGMAS: f64 = 6.0;
    /// Damping: none until a step does not help.
    pub(crate) const DAMPING: Damping =
        Damping { first: 0.0, min: 0.0, max: f64::INFINITY, down: 0.1, up: 10.0, min_after_rejection: 1.0 };
    /// Stop rule: a step this small in units of the priors' standard deviations changes nothing. The views' weights
    /// change slightly with the state, so that the cost may grow by a share in a correct step.
    pub(crate) const STOP: StopRule = StopRule { step_length: 1e-5, slack: 1e-3, ..StopRule::after(50) };
}

pub(crate) mod joint_limits {
    /// Standard deviation of a stop from its nominal angle, rad. Assumed: half a degree, as machined stops on a worn
    /// arm.
    pub(crate) const STOP_STD_RAD: f64 = 0.0087;
    /// Largest difference of angles that mean one stop, rad.
    pub(crate) const SAME_STOP_RAD: f64 = 0.01;
    /// Least ratio of the difference between readings at two stops to the angle between the stops; below it the sensor
    /// is dead.
    pub(crate) const LEAST_TRAVEL_SHARE: f64 = 0.1;
}

pub(crate) mod observability {
    /// Assumed error of one seen tag position per axis before any residual is known, m: the effect at 1 m of 0.3 px
    /// corners, a mount off by 2 mm and a survey off by 1 mm. It only rejects hopeless cases, so its exact size matters
    /// little.
    pub(crate) const POSITION_STD_M: f64 = 0.004;
    /// Squared component in a null direction above which a parameter counts as unobservable.
    pub(crate) const OPEN_SHARE: f64 = 1e-6;
}
