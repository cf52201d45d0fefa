//! Constants that decide something in `checks`: unit, source and effect of each, by the file that uses it.

pub(crate) mod cross_validation {
    /// Every fifth view in the order of time is one fold.
    pub(crate) const FOLDS: usize = 5;
    /// Smaller distances are rounding, m.
    pub(crate) const LEAST_DISTANCE_M: f64 = 1e-9;
}

pub(crate) mod drawing_report_sag_report {
    /// Compliance over its standard deviation from which a finding names it.
    pub(crate) const NAMED_SIGMAS: f64 = 3.0;
}

pub(crate) mod drawing_report {
    /// Standard deviations, stated and estimated combined, from which a finding names an element. Three axes together
    /// exceed 4 as rarely (0.1 %) as one axis exceeds 3.3.
    pub(crate) const NAMED_SIGMAS: f64 = 4.0;
    /// Largest repair in stated standard deviations, and no longer than the link itself; beyond, something else is
    /// wrong.
    pub(crate) const MAX_REPAIR_SIGMAS: f64 = 10.0;
    /// Largest repair in default sigmas, where robot.toml states none: 20 mm and 1.1 deg, the largest sizes tried.
    pub(crate) const MAX_UNSTATED_REPAIR_SIGMAS: f64 = 40.0;
    /// Largest repair of a tag's size, as a factor: margins of prints make 0.55 to 1.8; 2 is off by its own length.
    pub(crate) const MAX_SIZE_FACTOR: f64 = 2.05;
    /// Least length of a link that bounds its repair, m: links whose joints meet have no length.
    pub(crate) const LEAST_LENGTH_M: f64 = 0.02;
    pub(crate) const REACH_M: f64 = 1.0;
}

pub(crate) mod innovations {
    /// Standard deviation of a camera error that leaves the camera's pose free, m and rad.
    pub(crate) const FREE_CAMERA: f64 = 100.0;
    /// Least share of the prior variance of a joint's error that a view must determine for the error to be tested.
    pub(crate) const TOLD: f64 = 0.3;
}

pub(crate) mod noise_checks {
    /// Ratio of fitted to stated noise above which a warning is given.
    pub(crate) const NOISY: f64 = 2.0;
    /// Largest residual of corners averaged over a view, as a multiple of robot.toml's noise of one frame. Averages are
    /// better than one frame, and errors of lenses and printed tags stay below it.
    pub(crate) const MAX_OVER_CORNER_NOISE: f64 = 3.0;
    /// Multiples of robot.toml's noise to try if most observations are outliers: each covers errors up to three times
    /// as large.
    pub(crate) const LARGER_NOISE: [f64; 2] = [5.0, 25.0];
    /// Largest residual of corners averaged over a view from a detector's noise, px. Assumed: blurred images reach it.
    pub(crate) const MAX_USUAL_CORNER_PX: f64 = 2.0;
    /// Noise of rotations above which they have another format, if none is stated, rad. Boards and tags are read to
    /// 0.05 rad or better. Assumed.
    pub(crate) const MAX_ROTATION_NOISE_RAD: f64 = 0.1;
    pub(crate) const NEAR: f64 = 1e-6;
}

pub(crate) mod observability {
    /// Standard deviation of a parameter of which nothing is known, in its unit.
    pub(crate) const UNKNOWN: f64 = 1.0;
    /// Information added to marginalised columns (m, rad or prior standard deviations), so that an unseen one keeps a
    /// Cholesky factor.
    pub(crate) const WALL: f64 = 1e-9;
    /// Share of a null direction's largest entry below which an entry is not named.
    pub(crate) const NAMED: f64 = 0.3;
    /// Estimated standard deviation over the prior's below which a parameter is determined: the datasheet's scales,
    /// which the null space is of, were larger than the estimated ones.
    pub(crate) const DETERMINED: f64 = 0.5;
}

pub(crate) mod refusal_conditions {
    /// Least number of held-out views: fewer do not test the prediction of new views.
    pub const MIN_HELD_OUT_VIEWS: usize = 3;
    /// Ratio of held-out to fit error above which the fit has learnt its own noise.
    pub(crate) const MAX_HELD_OUT_OVER_FIT: f64 = 2.5;
    /// Held-out error that is no sign of overfitting at any fit error, m: tags are not surveyed better.
    pub(crate) const HARMLESS_HELD_OUT_M: f64 = 0.001;
    /// Largest held-out error without a stated noise, as a share of the arm's reach: 19 mm for an arm of 1.9 m.
    /// Assumed; recordings of real arms have 0.1 to 0.9 %.
    pub(crate) const MAX_SHARE_OF_REACH: f64 = 0.01;
    /// Least number of views per parameter. Each view adds about three numbers that do not share its camera-pose error;
    /// fewer views than parameters overfit.
    pub const MIN_VIEWS_PER_PARAMETER: f64 = 1.0;
}

pub(crate) mod reservations_lens {
    /// Number of lens parameters: focal length (both axes alike), centre, distortion.
    pub(crate) const N: usize = 7;
}

pub(crate) mod held_by_prior {
    /// Least share of the tool's variance that would vanish with a parameter known exactly, for the parameter to count.
    pub(crate) const LEAST_SHARE: f64 = 0.5;
}

pub(crate) mod reservations {
    /// Share of the prior's variance that the views leave, above which an element counts as unseen.
    pub(crate) const UNSEEN_SHARE: f64 = 0.5;
    /// Least tool error by one standard deviation for a reservation, as a share of the predicted error.
    pub(crate) const WORTH_SHARE: f64 = 0.5;
    /// Least share of the predicted error for a reservation if nothing checks the links distal to the camera.
    pub(crate) const WORTH_SHARE_UNWATCHED: f64 = 0.04;
    /// Largest number of reservations to report, the largest at the tool first.
    pub(crate) const MAX_RESERVATIONS: usize = 5;
    /// Largest standard deviation from touches, in prior standard deviations, that would reveal an element beyond its
    /// stated accuracy.
    pub(crate) const TOUCHED_SIGMAS: f64 = 5.0;
    /// Largest relative difference of the shifts at the tool for axes to be reported together.
    pub(crate) const ALIKE: f64 = 0.05;
}

pub(crate) mod touch_term {
    /// Least number of touches: fewer leave directions of the tool undetermined, and are not used.
    pub(crate) const MIN_TOUCHES: usize = 3;
    /// Quantile of the touches' chi-square above which the ratio of Birge (1932) inflates their covariance.
    pub(crate) const USUAL: f64 = 0.95;
    /// Largest chi-square beyond the best cause's for a cause of its class; or `ALIKE_SHARE` of all if that is larger.
    pub(crate) const ALIKE_CHI2: f64 = 6.0;
    pub(crate) const ALIKE_SHARE: f64 = 0.1;
    /// Least information of the touches on a direction of a cause, relative to the best one; the other directions are
    /// not used.
    pub(crate) const TOLD_SHARE: f64 = 1e-3;
}

pub(crate) mod consistency {
    /// Tool error below which wrong geometry is no reason to refuse, m, if it is also below the predicted error.
    pub(crate) const WORTH_M: f64 = 0.004;
    /// Nonlinearity over the datasheet's above which a sensor is reported as worn. Above `MAX_NONLINEARITY`, it is no
    /// such sensor any more.
    pub(crate) const WORN: f64 = 3.0;
    pub(crate) const MAX_NONLINEARITY: f64 = 10.0;
    /// Largest deviation of gains and offsets from the datasheet, in standard deviations: a larger one is no
    /// calibration any more.
    pub(crate) const MAX_SIGMAS_OFF: f64 = 5.0;
    /// Standard deviations from the datasheet from which a gain or offset is named, and its datasheet's figure is no
    /// longer trusted. One of 14 in a good arm exceeds 4 as rarely (0.1 %) as a single one exceeds 3.3.
    pub(crate) const NAMED_SIGMAS: f64 = 4.0;
    /// Largest tool motion by unconfirmed sensors, as a multiple of its predicted error: more is beyond chance.
    pub(crate) const MAX_UNCONFIRMED: f64 = 3.0;
    /// Largest share of outliers among the tag observations.
    pub(crate) const MAX_OUTLIERS: f64 = 0.25;
    /// Multiple of the innovations' limit above which they are refused: they are then about three times too large.
    pub(crate) const FAR_BEYOND: f64 = 4.0;
    /// Walk of an offset, as a multiple of the sensor's usual error between views, above which it is named.
    pub(crate) const WALKED: f64 = 1.0;
    /// Evidence of the walks above which they are named, nats: less widens U95, and is no finding.
    pub(crate) const NAMED_WALK_NATS: f64 = 3.0;
    /// Probability of a joint's errors in a random order of the views, below which its walk is named.
    pub(crate) const WALK_SIGNIFICANCE: f64 = 0.01;
    /// Standard deviation over the prior's above which a parameter is held by its prior.
    pub(crate) const HELD: f64 = 0.7;
    pub(crate) const LEAST: usize = 8;
}
