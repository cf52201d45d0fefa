//! Constants that decide something in `checks`: unit, source and effect of each, by the file that uses it.

pub(crate) mod cross_validation {
    /// Every fifth view in the order of time is one fold.
    pub(crate) const FOLDS: usize = 5;
    /// Smaller distances are rounding, m.
    pub(crate) const LEAST_DISTANCE_M: f64 = 1e-9;
}

pub(crate) mod drawing_report_sag_report {
    /// Sigmas of the estimate from which a compliance is named.
    pub(crate) const NAMED_SIGMAS: f64 = 3.0;
}

pub(crate) mod drawing_report {
    /// Sigmas, of stated size and estimate together, from which an element is named: three axes together exceed four as
    /// seldom (0.1 %) as one axis 3.3.
    pub(crate) const NAMED_SIGMAS: f64 = 4.0;
    /// A repair may be this many stated sigmas and no longer than the link itself: beyond, something else is wrong.
    pub(crate) const MAX_REPAIR_SIGMAS: f64 = 10.0;
    /// Largest repair in default sigmas, where robot.toml states none: 20 mm and 1.1 deg, the largest sizes tried.
    pub(crate) const MAX_UNSTATED_REPAIR_SIGMAS: f64 = 40.0;
    /// Largest repair of a tag's size, as a factor: margins of prints make 0.55 to 1.8; 2 is off by its own length.
    pub(crate) const MAX_SIZE_FACTOR: f64 = 2.05;
    /// Links whose joints meet have no length that could bound a repair, m.
    pub(crate) const LEAST_LENGTH_M: f64 = 0.02;
    pub(crate) const REACH_M: f64 = 1.0;
}

pub(crate) mod innovations {
    /// Size of a camera's error that says nothing of its pose, m and rad.
    pub(crate) const FREE_CAMERA: f64 = 100.0;
    /// The share of its prior variance that a view must tell of a joint's error, for it to be looked at.
    pub(crate) const TOLD: f64 = 0.3;
}

pub(crate) mod noise_checks {
    /// Noise over the stated one above which something is not as stated: a warning.
    pub(crate) const NOISY: f64 = 2.0;
    /// Corners averaged over a view may be off by so many times what robot.toml says of one frame: averages are better
    /// than one frame, and what lenses and printed tags lack stays below it.
    pub(crate) const MAX_OVER_CORNER_NOISE: f64 = 3.0;
    /// Noise that is tried, over robot.toml's, where most observations seem to fit nothing: each takes in what is up to
    /// three times as large.
    pub(crate) const LARGER_NOISE: [f64; 2] = [5.0, 25.0];
    /// Noise of a detector leaves corners averaged over a view within this, px. Assumed: blurred images reach it.
    pub(crate) const MAX_USUAL_CORNER_PX: f64 = 2.0;
    /// Noise of rotations, where none is stated, above which they are of another form: boards and tags are read to 0.05
    /// rad or better. Assumed.
    pub(crate) const MAX_ROTATION_NOISE_RAD: f64 = 0.1;
    pub(crate) const NEAR: f64 = 1e-6;
}

pub(crate) mod observability {
    /// Size of a parameter of which nothing is known, in its unit.
    pub(crate) const UNKNOWN: f64 = 1.0;
    /// Information on what is eliminated (m, rad or prior sigmas) that keeps an unseen one from having no factor.
    pub(crate) const WALL: f64 = 1e-9;
    /// Entries of a null direction below this share of the largest are not named.
    pub(crate) const NAMED: f64 = 0.3;
}

pub(crate) mod refusal_conditions {
    /// Fewer views say nothing about views not seen.
    pub const MIN_HELD_OUT_VIEWS: usize = 3;
    /// Held-out views this much worse than fitted ones mean that the fit learnt its own noise.
    pub(crate) const MAX_HELD_OUT_OVER_FIT: f64 = 2.5;
    /// Held-out views this good are no sign of it, however well the others fit: tags are not surveyed better, m.
    pub(crate) const HARMLESS_HELD_OUT_M: f64 = 0.001;
    /// Held-out observations without a stated noise may be off by this share of the arm's reach: 19 mm for an arm of
    /// 1.9 m. Assumed; recordings of real arms have 0.1 to 0.9 %.
    pub(crate) const MAX_SHARE_OF_REACH: f64 = 0.01;
    /// Each view adds about three numbers that do not share its camera-pose error; fewer views than parameters overfit.
    pub const MIN_VIEWS_PER_PARAMETER: f64 = 1.0;
}

pub(crate) mod reservations_lens {
    /// Focal length (both axes alike), centre, distortion.
    pub(crate) const N: usize = 7;
}

pub(crate) mod held_by_prior {
    /// Share of the tool's variance that would be gone with a parameter known exactly, from which on it is most of it.
    pub(crate) const LEAST_SHARE: f64 = 0.5;
}

pub(crate) mod reservations {
    /// Share of the prior's variance that the views leave, above which an element counts as unseen.
    pub(crate) const UNSEEN_SHARE: f64 = 0.5;
    /// A reservation is worth a line where one sigma of it moves the tool by more than this share of the predicted
    /// error.
    pub(crate) const WORTH_SHARE: f64 = 0.5;
    /// The same where nothing watches over what is beyond the camera.
    pub(crate) const WORTH_SHARE_UNWATCHED: f64 = 0.04;
    /// So many are told, the largest at the tool first.
    pub(crate) const MAX_RESERVATIONS: usize = 5;
    /// Touches that tell an element to so many sigmas of its prior would show it where it is beyond the drawing's
    /// figure.
    pub(crate) const TOUCHED_SIGMAS: f64 = 5.0;
    /// Axes whose shifts are within this share of one another at the tool are spoken of together.
    pub(crate) const ALIKE: f64 = 0.05;
}

pub(crate) mod touch_term {
    /// Fewer touches leave directions of the tool open, and are not used.
    pub(crate) const MIN_TOUCHES: usize = 3;
    /// Above this quantile the touches are less sure than their sigmas say: the ratio of Birge (1932).
    pub(crate) const USUAL: f64 = 0.95;
    /// A cause that leaves no more than this, or this share of all, beyond the best one is of its class.
    pub(crate) const ALIKE_CHI2: f64 = 6.0;
    pub(crate) const ALIKE_SHARE: f64 = 0.1;
    /// Directions of a cause that the touches tell less than this of, relative to the best one, are left out.
    pub(crate) const TOLD_SHARE: f64 = 1e-3;
}

pub(crate) mod consistency {
    /// Geometry that would move the tool by less than this, and by less than the predicted error, is no reason to
    /// refuse, m.
    pub(crate) const WORTH_M: f64 = 0.004;
    /// Nonlinearity over the datasheet's above which a sensor is called worn, and above which it is no such sensor any
    /// more.
    pub(crate) const WORN: f64 = 3.0;
    pub(crate) const MAX_NONLINEARITY: f64 = 10.0;
    /// Gains and offsets farther from the datasheet than this are no calibration any more.
    pub(crate) const MAX_SIGMAS_OFF: f64 = 5.0;
    /// Sigmas of its datasheet from which a gain or offset is named, and its datasheet's sigma is believed no more: of
    /// 14 in a good arm one is beyond as seldom (0.1 %) as one alone 3.3.
    pub(crate) const NAMED_SIGMAS: f64 = 4.0;
    /// Sensors that move the tool by more than this many times its predicted error claim more than chance.
    pub(crate) const MAX_UNCONFIRMED: f64 = 3.0;
    /// Share of the tag observations that may be outliers.
    pub(crate) const MAX_OUTLIERS: f64 = 0.25;
    /// So many times that limit is refused: innovations then are about three times as large as they should be.
    pub(crate) const FAR_BEYOND: f64 = 4.0;
    /// An offset that walks by more than so many times a sensor's usual error from view to view is named.
    pub(crate) const WALKED: f64 = 1.0;
    /// Evidence of the walks from which they are named: less widens U95, and is no finding.
    pub(crate) const NAMED_WALK_NATS: f64 = 3.0;
    /// Probability of a joint's errors in a random order of the views below which its walk is named.
    pub(crate) const WALK_SIGNIFICANCE: f64 = 0.01;
    /// Standard deviation over the prior's above which the prior holds a parameter.
    pub(crate) const HELD: f64 = 0.7;
    pub(crate) const LEAST: usize = 8;
}
