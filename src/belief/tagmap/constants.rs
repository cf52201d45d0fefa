//! Constants that decide something in `tagmap`: unit, source and effect of each, by the file that uses it.

pub(crate) mod adjust {
    use armcal_core::numeric::Damping;

    /// Width of the Cauchy loss, in standard deviations found (Zhang 1997: 2.385 costs 5 % of efficiency; it is the
    /// start alone).
    pub(crate) const CAUCHY_WIDTH: f64 = 2.385;
    /// The very first loss, whose pull does not fade.
    pub(crate) const FIRST_WIDTH: f64 = 1.345;
    /// Corners to here count fully in the end; one in 3000 honest ones lies beyond.
    pub(crate) const HUBER_WIDTH: f64 = 4.0;
    /// Bounds of the scale that is taken from the residuals, over the corners' standard deviation given: a detector's
    /// noise lies well within; what lies beyond is a wrong model. Assumed.
    pub(crate) const SCALE_BOUNDS: (f64, f64) = (0.02, 50.0);
    /// The median of the length of a two-dimensional unit normal vector is sqrt(2 ln 2).
    pub(crate) const MEDIAN_OF_LENGTH: f64 = 1.177_41;
    pub(crate) const MAX_ITERATIONS: usize = 50;
    /// Of all adjustments of a map. Views that fit each other take 10 to 40; those that contradict each other never
    /// rest.
    pub(crate) const MAX_STEPS: usize = 250;
    /// Steps that change the cost by less than this share of it end an adjustment.
    pub(crate) const CONVERGED: f64 = 1e-14;
    /// A chi-square that still falls by less than this a step moves nothing by a noticeable share of its standard
    /// deviation. A loss that is not quadratic converges no faster than this where a few detections lie beyond its
    /// width.
    pub(crate) const AT_REST: f64 = 1e-3;
    /// Where only a start is wanted.
    pub(crate) const ROUGHLY: f64 = 1e-3;
    /// Below this share of the cost it is rounding, not the model, that stands in the way.
    pub(crate) const ROUNDING: f64 = 1e-12;
    /// Of the normal equations' diagonal, relative.
    pub(crate) const DAMPING: Damping =
        Damping { first: 1e-6, min: 1e-12, max: 1e12, down: 0.1, up: 10.0, min_after_rejection: 1e-6 };
}

pub(crate) mod assemble {
    /// Chi-square of 6 degrees of freedom, 99.99 %.
    pub(crate) const FAR_FROM_KNOWN: f64 = 27.86;
    /// So many rejected detections of a tag, and this share of them, are no chance: of 5 % outliers three in ten are
    /// rarer than 2 %. Assumed.
    pub(crate) const MIN_REJECTED: usize = 3;
    pub(crate) const REJECTED_SHARE: f64 = 0.25;
}

pub(crate) mod blind {
    /// A lens or an odd tag is told from so many detections; more change little but the time. Assumed.
    pub(crate) const MAX_DETECTIONS: usize = 400;
    pub(crate) const MIN_VIEWS: usize = 12;
    /// Residuals with fewer degrees of freedom tell no lens.
    pub(crate) const MIN_FREEDOM: usize = 60;
}

pub(crate) mod check {
    /// Sizes of tags, m. Assumed: others are in another unit.
    pub(crate) const SIZE_RANGE_M: std::ops::RangeInclusive<f64> = 1e-3..=10.0;
}

pub(crate) mod checked {
    /// Beyond so many of its standard deviations a tag is elsewhere than the map says.
    pub(crate) const OTHER_SIGMAS: f64 = 3.0;
}

pub(crate) mod columns {
    /// An unknown that keeps less of its information when the poses follow is one with them: the size of a tag that is
    /// seen alone is its distance. Rounding leaves 1e-10.
    pub(crate) const DETERMINED: f64 = 1e-6;
}

pub(crate) mod contradictions {
    /// Images that show tags of two groups from which these must be one map. Assumed: images that fit each other tie
    /// them by two.
    pub(crate) const MIN_COMMON_IMAGES: usize = 5;
    /// Images with an id at two places from which it is on two tags. Assumed: a false detection seldom comes twice.
    pub(crate) const MIN_TWICE: usize = 2;
}

pub(crate) mod files_landmark {
    /// Numbers of landmarks that have a name and no number: this plus their place in the file, from 0.
    pub const FIRST_NAMED_ID: u32 = 1_000_000;
}

pub(crate) mod files_own {
    /// Squares of a board along one side.
    pub(crate) const MAX_SQUARES: f64 = 100.0;
}

pub(crate) mod files_tagslam {
    /// The least that files give as a standard deviation, for a held tag has none.
    pub(crate) const HELD: (f64, f64) = (1e-4, 1e-5);
}

pub(crate) mod groups {
    /// Tighter than this a place on a body cannot be known: m and rad.
    pub(crate) const LEAST_STD: f64 = 1e-7;
}

pub(crate) mod incremental_layout {
    /// Images that place a tag; more change little but the time. Assumed.
    pub(crate) const MAX_IMAGES: usize = 24;
}

pub(crate) mod known_places {
    /// A place that is less sure than this says nothing about how a file is read, m and rad. Assumed.
    pub(crate) const MAX_STD_M: f64 = 0.05;
    pub(crate) const MAX_STD_RAD: f64 = 0.1;
    /// Fewer tags may stand to one another by chance as another reading has them, where their places are not believed.
    pub(crate) const MIN_TAGS: usize = 3;
    /// Views that are looked at.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// Share of the detections that may be rejected before the views count as contradicting the map. Assumed.
    pub(crate) const MAX_REJECTED_SHARE: f64 = 0.2;
}

pub(crate) mod lens_fit {
    /// Intrinsics of a camera: focal lengths, centre, four of distortion.
    pub(crate) const PER_CAMERA: usize = 8;
    pub(crate) const MAX_LENS_STEPS: usize = 15;
    /// A step that lowers the sum of squares by less ends the fit.
    pub(crate) const ENOUGH_GAIN: f64 = 0.01;
    /// Shares of a step that are tried in turn.
    pub(crate) const SHORTENED: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
    /// Relative gain at which the poses of a trial rest.
    pub(crate) const PRECISE: f64 = 1e-8;
    /// One sigma of any lens: focal length and centre over the focal length, distortion. Assumed, so wide that only
    /// what the views do not show follows it.
    pub(crate) const WIDE_FOCAL: f64 = 0.5;
    pub(crate) const WIDE_CENTER: f64 = 0.2;
    pub(crate) const WIDE_DISTORTION: f64 = 0.5;
}

pub(crate) mod lens_test {
    /// Corner noise over the stated one from which a lens or a size is doubtful: as `calibrate` warns.
    pub(crate) const NOISY: f64 = 2.0;
    /// Log evidence that another lens must bring, beyond what its unknowns cost: as of a calibration's drawing.
    pub(crate) const MIN_GAIN_NATS: f64 = 6.0;
    /// Another lens leaves at most this share of the corners' variance: what explains less is within what no lens
    /// model has, and a map holds it. Assumed.
    pub(crate) const LEFT_SHARE: f64 = 0.9;
    /// Another lens keeps this share of the detections.
    pub(crate) const MIN_USED_SHARE: f64 = 0.95;
    /// Another reading leaves this share of the variance that the stated lens with other figures leaves. Assumed.
    pub(crate) const MUCH_BETTER: f64 = 0.5;
    /// A reading as it is that leaves no more than this, over the variance of fitted lenses, is the cause. Assumed.
    pub(crate) const AS_GOOD: f64 = 1.2;
    /// One in so many of the focal lengths of `explain` is a start: 14 % apart.
    pub(crate) const FOCAL_STRIDE: usize = 7;
    /// Starts that are fitted.
    pub(crate) const MAX_STARTS: usize = 3;
    /// Rounds of lenses and map in turn, and the share of the variance that one must leave for another.
    pub(crate) const MAX_ROUNDS: usize = 4;
    pub(crate) const WORTH_A_ROUND: f64 = 0.99;
    /// Its own standard deviations by which a focal length must be beyond its bound.
    pub(crate) const SURE_SIGMAS: f64 = 3.0;
}

pub(crate) mod linearize {
    /// A corner that the lens does not see counts as one that is this many standard deviations off.
    pub(crate) const UNSEEN_SIGMAS: f64 = 1e4;
}

pub(crate) mod localize {
    use armcal_core::numeric::Damping;

    /// Width of the Cauchy loss by which starts are compared, px: a start is a few pixels off, a wrong one tens.
    pub(crate) const COMPARE_PX: f64 = 5.0;
    pub(crate) const MAX_IMAGES: usize = 40;
    /// Undamped: a few steps make a start for the adjustment, and one that does not help ends them.
    pub(crate) const UNDAMPED: Damping =
        Damping { first: 0.0, min: 0.0, max: 0.0, down: 0.0, up: 0.0, min_after_rejection: 1.0 };
}

pub(crate) mod lost_anchor {
    /// Sizes nearer to right than this lose no tag. Assumed.
    pub(crate) const LEAST_FACTOR: f64 = 1.02;
    /// Sightings that tell the size of a tag.
    pub(crate) const MIN_SIGHTINGS: usize = 3;
}

pub(crate) mod normal_equations {
    /// Keeps a step possible while some camera or tag sees nothing at all: what is determined has 1e4 and more (1/m^2,
    /// 1/rad^2).
    pub(crate) const UNDETERMINED: f64 = 1e-6;
}

pub(crate) mod odd_tags {
    /// Log evidence that an odd tag must bring, beyond what its unknowns and the choice among tags cost: as of a
    /// calibration's drawing.
    pub(crate) const MIN_GAIN_NATS: f64 = 6.0;
    /// Sizes and moves below these are those of any print and mount: share, m and rad. Assumed.
    pub(crate) const LEAST_SIZE: f64 = 0.005;
    pub(crate) const LEAST_MOVE_M: f64 = 0.001;
    pub(crate) const LEAST_TURN_RAD: f64 = 0.01;
    /// A move is looked for after each of so many parts of a tag's detections, with so many on each side.
    pub(crate) const PARTS: usize = 8;
    pub(crate) const MIN_SIDE: usize = 3;
}

pub(crate) mod recording {
    /// Longest gap between attitudes that is bridged, s.
    pub(crate) const MAX_GAP_S: f64 = 0.2;
    /// A quaternion whose length is off by more is no attitude. Assumed.
    pub(crate) const UNIT_TOLERANCE: f64 = 0.01;
}

pub(crate) mod scale {
    /// Sizes nearer to right than this are not spoken of: a square's distance is itself uncertain by some percent.
    pub(crate) const LEAST_FACTOR: f64 = 1.15;
    /// A measured distance that is off by more than this (natural logarithm) counts as this.
    pub(crate) const FARTHEST: f64 = 1.0;
    /// An explanation must leave less than this share of the disagreement.
    pub(crate) const EXPLAINS: f64 = 0.5;
    pub(crate) const MAX_SAMPLES: usize = 400;
    pub(crate) const MAX_ROOTS: usize = 60;
    /// A tag whose place has a larger sigma than this share of its size gives no distance.
    pub(crate) const SURE_SHARE: f64 = 0.25;
    /// Tags nearer to each other are at one place and tell no scale, m.
    pub(crate) const ONE_PLACE_M: f64 = 1e-6;
}

pub(crate) mod solve {
    /// Rounds of choosing detections and fitting again.
    pub(crate) const MAX_ROUNDS: usize = 8;
    /// A pose found anew replaces one that fits worse by this factor.
    pub(crate) const MUCH_WORSE: f64 = 1.25;
    /// Residuals with fewer degrees of freedom tell no noise: the corners' is as given.
    pub(crate) const MIN_FREEDOM: usize = 8;
}

pub(crate) mod tag_mapping {
    /// A tag whose place in the base tag's frame is less sure than this per axis is left out, m. Assumed: ten times a
    /// usual survey.
    pub(crate) const MAX_RELATIVE_STD_M: f64 = 0.01;
}

pub(crate) mod tag_pairs {
    /// The least share of a pair's images that must agree.
    pub(crate) const MIN_SHARE: f64 = 0.3;
}

pub(crate) mod types {
    /// Of a corner in each direction, where neither detections nor settings say it, px. Assumed.
    pub(crate) const CORNER_STD_PX: f64 = 0.3;
    /// Detections whose corners have a larger error than this many standard deviations (rms) are rejected. Assumed.
    pub(crate) const REJECT_SIGMAS: f64 = 5.0;
    /// Images in which two groups of tags must be seen together to become one. Assumed.
    pub(crate) const MIN_LINK_VIEWS: usize = 2;
    /// Of an attitude where the settings do not say it, rad. Assumed.
    pub(crate) const ATTITUDE_STD_RAD: f64 = 0.01;
}

pub(crate) mod vote {
    /// Images that vote; more change nothing but the time. Assumed.
    pub(crate) const MAX_VOTERS: usize = 24;
    /// Chi-square of 6 degrees of freedom, 99.9 %: agreement.
    pub(crate) const AGREES: f64 = 22.46;
    /// A corner's standard deviation as votes take it, px: detectors are seldom worse. Assumed.
    pub(crate) const VOTE_STD_PX: f64 = 0.5;
}
