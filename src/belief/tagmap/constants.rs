//! Constants that decide something in `tagmap`: unit, source and effect of each, by the file that uses it.

pub(crate) mod adjust {
    use armcal_core::numeric::Damping;

    /// Width of the Cauchy loss in estimated standard deviations (Zhang 1997: 2.385 costs 5 % of efficiency; only the
    /// start uses it).
    pub(crate) const CAUCHY_WIDTH: f64 = 2.385;
    /// Width of the very first loss, whose pull does not fade.
    pub(crate) const FIRST_WIDTH: f64 = 1.345;
    /// Width up to which corners count fully in the end; one in 3000 correct ones lies beyond.
    pub(crate) const HUBER_WIDTH: f64 = 4.0;
    /// Bounds of the scale from the residuals, over the given standard deviation of corners. A detector's noise lies
    /// well within; a value beyond them indicates a wrong model. Assumed.
    pub(crate) const SCALE_BOUNDS: (f64, f64) = (0.02, 50.0);
    /// The median of the length of a two-dimensional unit normal vector is sqrt(2 ln 2).
    pub(crate) const MEDIAN_OF_LENGTH: f64 = 1.177_41;
    pub(crate) const MAX_ITERATIONS: usize = 50;
    /// Limit of the steps of all adjustments of a map together. Views that fit each other need 10 to 40; those that
    /// contradict each other never converge.
    pub(crate) const MAX_STEPS: usize = 250;
    /// Steps that change the cost by less than this share of it end an adjustment.
    pub(crate) const CONVERGED: f64 = 1e-14;
    /// Decrease of chi-square per step that ends an adjustment: a smaller one moves nothing by a noticeable share of
    /// its standard deviation. A loss that is not quadratic converges no faster than this if a few detections lie
    /// beyond its width.
    pub(crate) const AT_REST: f64 = 1e-3;
    /// Relative change of the cost that ends a rough adjustment.
    pub(crate) const ROUGHLY: f64 = 1e-3;
    /// Share of the cost below which rounding, not the model, prevents progress.
    pub(crate) const ROUNDING: f64 = 1e-12;
    /// Damping of the normal equations' diagonal, relative.
    pub(crate) const DAMPING: Damping =
        Damping { first: 1e-6, min: 1e-12, max: 1e12, down: 0.1, up: 10.0, min_after_rejection: 1e-6 };
}

pub(crate) mod assemble {
    /// Chi-square of 6 degrees of freedom, 99.99 %.
    pub(crate) const FAR_FROM_KNOWN: f64 = 27.86;
    /// Least number and share of a tag's rejected detections that are no chance: of 5 % outliers three in ten are rarer
    /// than 2 %. Assumed.
    pub(crate) const MIN_REJECTED: usize = 3;
    pub(crate) const REJECTED_SHARE: f64 = 0.25;
}

pub(crate) mod blind {
    /// Number of detections that determine a lens or an odd tag; more change little but the time. Assumed.
    pub(crate) const MAX_DETECTIONS: usize = 400;
    pub(crate) const MIN_VIEWS: usize = 12;
    /// Least degrees of freedom of the residuals that determine a lens.
    pub(crate) const MIN_FREEDOM: usize = 60;
}

pub(crate) mod check {
    /// Sizes of tags, m. Assumed: others are in another unit.
    pub(crate) const SIZE_RANGE_M: std::ops::RangeInclusive<f64> = 1e-3..=10.0;
}

pub(crate) mod checked {
    /// Distance in a tag's standard deviations beyond which the map's place for it counts as another one.
    pub(crate) const OTHER_SIGMAS: f64 = 3.0;
}

pub(crate) mod columns {
    /// Share of its information that an unknown must keep when the poses follow. Below it, it cannot be separated from
    /// them: the size of a tag that is seen alone is its distance. Rounding leaves 1e-10.
    pub(crate) const DETERMINED: f64 = 1e-6;
}

pub(crate) mod contradictions {
    /// Number of common images from which the tags of two groups must be one map. Assumed: two images that fit each
    /// other already tie them.
    pub(crate) const MIN_COMMON_IMAGES: usize = 5;
    /// Number of images with an id at two places from which two tags have it. Assumed: a false detection seldom comes
    /// twice.
    pub(crate) const MIN_TWICE: usize = 2;
}

pub(crate) mod files_landmark {
    /// First id of landmarks with a name but no number: this plus their position in the file, from 0.
    pub const FIRST_NAMED_ID: u32 = 1_000_000;
}

pub(crate) mod files_own {
    /// Largest number of squares along one side of a board.
    pub(crate) const MAX_SQUARES: f64 = 100.0;
}

pub(crate) mod files_tagslam {
    /// Least standard deviation in written files, m and rad, because a held tag has none.
    pub(crate) const HELD: (f64, f64) = (1e-4, 1e-5);
}

pub(crate) mod groups {
    /// Least standard deviation of a place on a body, m and rad.
    pub(crate) const LEAST_STD: f64 = 1e-7;
}

pub(crate) mod incremental_layout {
    /// Number of images that place a tag; more change little but the time. Assumed.
    pub(crate) const MAX_IMAGES: usize = 24;
}

pub(crate) mod known_places {
    /// A place with a larger standard deviation does not test how a file is read, m and rad. Assumed.
    pub(crate) const MAX_STD_M: f64 = 0.05;
    pub(crate) const MAX_STD_RAD: f64 = 0.1;
    /// Least number of tags for another reading where their places are not used: fewer may match it by chance.
    pub(crate) const MIN_TAGS: usize = 3;
    /// Largest number of views in the test.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// Share of the detections that may be rejected before the views count as contradicting the map. Assumed.
    pub(crate) const MAX_REJECTED_SHARE: f64 = 0.2;
}

pub(crate) mod lens_fit {
    /// Intrinsics of a camera: focal lengths, centre, four of distortion.
    pub(crate) const PER_CAMERA: usize = 8;
    pub(crate) const MAX_LENS_STEPS: usize = 15;
    /// Decrease of the sum of squares below which the fit ends.
    pub(crate) const ENOUGH_GAIN: f64 = 0.01;
    /// Shares of a step, in the order in which they are tried.
    pub(crate) const SHORTENED: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
    /// Relative gain at which the poses of a trial have converged.
    pub(crate) const PRECISE: f64 = 1e-8;
    /// One sigma of any lens: focal length and centre over the focal length, distortion. Assumed, so wide that it
    /// decides only parameters that no view constrains.
    pub(crate) const WIDE_FOCAL: f64 = 0.5;
    pub(crate) const WIDE_CENTER: f64 = 0.2;
    pub(crate) const WIDE_DISTORTION: f64 = 0.5;
}

pub(crate) mod lens_test {
    /// Corner noise over the stated one from which a lens or a size is doubtful: the limit of `calibrate`'s warning.
    pub(crate) const NOISY: f64 = 2.0;
    /// Log evidence that another lens must bring beyond the cost of its unknowns: the limit of a calibration's nominal
    /// model.
    pub(crate) const MIN_GAIN_NATS: f64 = 6.0;
    /// Largest share of the corners' variance that another lens may leave. A smaller improvement is within the error of
    /// any lens model, and a map tolerates it. Assumed.
    pub(crate) const LEFT_SHARE: f64 = 0.9;
    /// Least share of the detections that another lens must keep.
    pub(crate) const MIN_USED_SHARE: f64 = 0.95;
    /// Share of the variance with other figures of the stated lens that another reading may leave at most. Assumed.
    pub(crate) const MUCH_BETTER: f64 = 0.5;
    /// A reading without fitted figures that leaves no more than this, over the variance of fitted lenses, is the
    /// cause. Assumed.
    pub(crate) const AS_GOOD: f64 = 1.2;
    /// Stride through the focal lengths of `explain` that gives the starts: 14 % apart.
    pub(crate) const FOCAL_STRIDE: usize = 7;
    /// Number of starts that are fitted.
    pub(crate) const MAX_STARTS: usize = 3;
    /// Largest number of rounds that fit lenses and map alternately, and the share of the variance that justifies
    /// another.
    pub(crate) const MAX_ROUNDS: usize = 4;
    pub(crate) const WORTH_A_ROUND: f64 = 0.99;
    /// Distance of a focal length from its bound that refuses it, in its own standard deviations.
    pub(crate) const SURE_SIGMAS: f64 = 3.0;
}

pub(crate) mod linearize {
    /// Residual of a corner that the lens does not see, in standard deviations.
    pub(crate) const UNSEEN_SIGMAS: f64 = 1e4;
}

pub(crate) mod localize {
    use armcal_core::numeric::Damping;

    /// Width of the Cauchy loss that compares starts, px: the error of a start is a few pixels, that of a wrong one
    /// tens.
    pub(crate) const COMPARE_PX: f64 = 5.0;
    pub(crate) const MAX_IMAGES: usize = 40;
    /// Damping of zero: a few steps make a start for the adjustment, and one that does not help ends them.
    pub(crate) const UNDAMPED: Damping =
        Damping { first: 0.0, min: 0.0, max: 0.0, down: 0.0, up: 0.0, min_after_rejection: 1.0 };
}

pub(crate) mod lost_anchor {
    /// Factor of a wrong size below which no tag is lost. Assumed.
    pub(crate) const LEAST_FACTOR: f64 = 1.02;
    /// Least number of observations that determine the size of a tag.
    pub(crate) const MIN_SIGHTINGS: usize = 3;
}

pub(crate) mod normal_equations {
    /// Keeps a step possible while a camera or tag has no observation: a determined one has 1e4 and more (1/m^2,
    /// 1/rad^2).
    pub(crate) const UNDETERMINED: f64 = 1e-6;
}

pub(crate) mod odd_tags {
    /// Log evidence that an odd tag must bring beyond the cost of its unknowns and of the choice among tags. It is the
    /// limit of a calibration's nominal model.
    pub(crate) const MIN_GAIN_NATS: f64 = 6.0;
    /// Errors below these belong to any print and mount: relative size, m and rad. Assumed.
    pub(crate) const LEAST_SIZE: f64 = 0.005;
    pub(crate) const LEAST_MOVE_M: f64 = 0.001;
    pub(crate) const LEAST_TURN_RAD: f64 = 0.01;
    /// Number of parts of a tag's detections between which a move is tested, and the least number of detections on each
    /// side.
    pub(crate) const PARTS: usize = 8;
    pub(crate) const MIN_SIDE: usize = 3;
}

pub(crate) mod recording {
    /// Longest gap between attitudes that is interpolated, s.
    pub(crate) const MAX_GAP_S: f64 = 0.2;
    /// Largest error of a quaternion's length; beyond it, it is no attitude. Assumed.
    pub(crate) const UNIT_TOLERANCE: f64 = 0.01;
}

pub(crate) mod scale {
    /// Factor of a wrong size below which it is not reported: a square's distance has an error of a few percent.
    pub(crate) const LEAST_FACTOR: f64 = 1.15;
    /// Limit of a distance's error, natural logarithm; larger ones count as this.
    pub(crate) const FARTHEST: f64 = 1.0;
    /// Share of the disagreement that an explanation may leave at most.
    pub(crate) const EXPLAINS: f64 = 0.5;
    pub(crate) const MAX_SAMPLES: usize = 400;
    pub(crate) const MAX_ROOTS: usize = 60;
    /// Largest sigma of a tag's place, as a share of its size, that gives a distance.
    pub(crate) const SURE_SHARE: f64 = 0.25;
    /// Distance below which two tags are at one place and determine no scale, m.
    pub(crate) const ONE_PLACE_M: f64 = 1e-6;
}

pub(crate) mod solve {
    /// Rounds that select detections and fit again.
    pub(crate) const MAX_ROUNDS: usize = 8;
    /// Factor of the misfit by which a newly found pose must be better to replace one.
    pub(crate) const MUCH_WORSE: f64 = 1.25;
    /// Least degrees of freedom of the residuals that determine the noise; below it the corners' noise is as given.
    pub(crate) const MIN_FREEDOM: usize = 8;
}

pub(crate) mod tag_mapping {
    /// Largest sigma per axis of a tag's place in the base tag's frame, m; tags beyond it are left out. Assumed: ten
    /// times a usual survey.
    pub(crate) const MAX_RELATIVE_STD_M: f64 = 0.01;
}

pub(crate) mod tag_pairs {
    /// Least share of a pair's images that must agree.
    pub(crate) const MIN_SHARE: f64 = 0.3;
}

pub(crate) mod types {
    /// Standard deviation of a corner in each direction where neither detections nor settings state it, px. Assumed.
    pub(crate) const CORNER_STD_PX: f64 = 0.3;
    /// Detections whose corners have a larger error than this many standard deviations (rms) are rejected. Assumed.
    pub(crate) const REJECT_SIGMAS: f64 = 5.0;
    /// Images in which two groups of tags must be seen together to become one. Assumed.
    pub(crate) const MIN_LINK_VIEWS: usize = 2;
    /// Standard deviation of an attitude where the settings do not state it, rad. Assumed.
    pub(crate) const ATTITUDE_STD_RAD: f64 = 0.01;
}

pub(crate) mod vote {
    /// Number of images that vote; more change only the time. Assumed.
    pub(crate) const MAX_VOTERS: usize = 24;
    /// Chi-square of 6 degrees of freedom, 99.9 %, up to which poses agree.
    pub(crate) const AGREES: f64 = 22.46;
    /// Standard deviation of a corner in votes, px: detectors are seldom worse. Assumed.
    pub(crate) const VOTE_STD_PX: f64 = 0.5;
}
