//! Constants that decide something in `explain`: unit, source and effect of each, by the file that uses it.

pub(crate) mod angles_by_camera {
    /// Tags farther than this from the survey hardly pull while an angle is searched for, m.
    pub(crate) const SEARCH_WIDTH_M: f64 = 0.1;
    /// Candidates of one joint over its range, by how many joints are searched for in one view.
    pub(crate) const CANDIDATES: [usize; 3] = [90, 40, 16];
    pub(crate) const FINEST_STEP_RAD: f64 = 1e-4;
    /// A camera mount with larger stated sigmas does not place the tags, m and rad.
    pub(crate) const KNOWN_MOUNT: [f64; 2] = [0.05, 0.2];
}

pub(crate) mod baseline {
    /// Ways to do without a calibration of joints: the datasheet's arm, least squares, and joint errors by the
    /// evidence.
    pub(crate) const N_BASELINES: usize = 3;
    /// Passes over the sizes of errors; each brings exact sensors down by a factor of three.
    pub(crate) const MAX_PASSES: usize = 8;
    /// A size that stays above this share of the one before has settled.
    pub(crate) const SETTLED: f64 = 0.8;
}

pub(crate) mod calibration_prior {
    /// Of a sensor whose datasheet is silent, rad per root of an hour. Assumed: the standard world's sensors.
    pub(crate) const USUAL_DRIFT_STD_RAD_PER_SQRT_H: f64 = 0.02 * std::f64::consts::PI / 180.0;
    /// How far a sensor may slip where the datasheet says that it has no offset, rad. Assumed.
    pub(crate) const LEAST_SLIP_STD_RAD: f64 = 0.02;
    /// The file's numbers are rounded to seven digits: this share of the variances is added so that the matrix has an
    /// inverse.
    pub(crate) const ROUNDING: f64 = 1e-6;
    /// The normal's 0.999 quantile, and that of 0.001 shared by some eight joints' two sides.
    pub(crate) const Z_999: f64 = 3.090;
    pub(crate) const Z_OF_JOINTS: f64 = 3.9;
    /// One sigma of where a camera may hang that was mounted anew, m and rad. Assumed.
    pub(crate) const MOUNTED_ANEW_STD: [f64; 2] = [0.05, 0.2];
    /// From this share on, in tenfold steps, no more is added and the matrix has no inverse. Assumed.
    pub(crate) const MAX_ROUNDING: f64 = 0.1;
}

pub(crate) mod drawing {
    /// What an alternative must bring. Of 60 good arms one reached 5 (docs/theory/verdict.md).
    pub(crate) const MIN_GAIN_NATS: f64 = 6.0;
    /// Sizes of an error that are tried, over robot.toml's.
    pub(crate) const MULTIPLES: [f64; 5] = [2.0, 5.0, 10.0, 20.0, 40.0];
    /// The scale of all tags is looked for so near to what the distances between them say, and the interval cut so
    /// often: to some 0.03 %.
    pub(crate) const LOG_RATIO_RANGE: f64 = 0.01;
    pub(crate) const GOLDEN_STEPS: usize = 8;
    /// A lens that is not the one of robot.toml may be off by so many of a measured lens's sigmas.
    pub(crate) const LENS_SCALE: f64 = 10.0;
}

pub(crate) mod failure_detection {
    /// A joint whose errors over all views are larger than this and than twice the datasheet's linearity is looked at,
    /// rad.
    pub(crate) const LARGE_STD_RAD: f64 = 0.15 * std::f64::consts::PI / 180.0;
    /// A share of rejected observations that wrong ids alone do not make.
    pub(crate) const MANY_REJECTED: f64 = 0.1;
    /// What giving up one reading costs: 2 ln(1 rad / 1 mrad).
    pub(crate) const PER_READING: f64 = 14.0;
    /// What a step costs: 2 ln(0.1 rad / 1 mrad).
    pub(crate) const PER_STEP: f64 = 9.0;
    /// The evidence that a failure needs: odds of e^15 to one.
    pub(crate) const MARGIN: f64 = 30.0;
    /// At most this many failures are looked for beyond those that the readings alone show.
    pub(crate) const MAX_FOUND: usize = 2;
    /// A joint's error from view to view over its datasheet's linearity: sensors do not have more, after what is smooth
    /// is taken off.
    pub(crate) const MAX_OVER_LINEARITY: f64 = 3.0;
    /// Pairs of sensors that are estimated as failed: those that place the tags nearest to their survey. Assumed.
    pub(crate) const MAX_PAIRS: usize = 6;
    /// Views that choose those pairs, spread over all. Assumed.
    pub(crate) const RANKED_VIEWS: usize = 12;
}

pub(crate) mod failure_pattern {
    /// An angle that is spread by less than this many of its own sigma, or than `LOCKED_RAD`, does not change.
    pub(crate) const LOCKED_SIGMAS: f64 = 3.0;
    pub(crate) const LOCKED_RAD: f64 = 0.2 * std::f64::consts::PI / 180.0;
    /// A sensor that says something follows the angle to this share of the angle's spread, with about the datasheet's
    /// slope.
    pub(crate) const FOLLOWS: f64 = 0.3;
    /// Distances from a straight line, as a share of the angle's spread, and the least uncertainty of a gain.
    pub(crate) const STRAIGHT: f64 = 0.05;
    pub(crate) const LEAST_GAIN_STD: f64 = 0.01;
    /// A step that lasts leaves this share of the squares that a straight line leaves.
    pub(crate) const STEP_LEAVES: f64 = 1.0 / 6.0;
    pub(crate) const MIN_SIDE: usize = 2;
    /// More single jumps than this share of the views are no exceptions.
    pub(crate) const MAX_SINGLE: f64 = 0.4;
    /// A sensor is lost where its readings are off in so many views and in this share of those since the first of them.
    /// Assumed: single jumps, of one view in five, are no such row in one of a hundred recordings.
    pub(crate) const MIN_LOST: usize = 4;
    pub(crate) const LOST_SHARE: f64 = 0.75;
    /// Number of times that the line is drawn again through the readings that are not off. Assumed: one settles nearly
    /// all.
    pub(crate) const REFITS: usize = 3;
    /// So many right readings at the end show that the sensor is back. Assumed: a wrong one is right by chance in less
    /// than a quarter of the views, three times on end in less than two of a hundred.
    pub(crate) const MIN_BACK: usize = 3;
    /// A locked joint's sensor is right if it is off by less than this many of the datasheet's sigma.
    pub(crate) const RIGHT_SIGMAS: f64 = 4.0;
    /// A reading moved if it spans more sigma of its noise than this.
    pub(crate) const STILL_SIGMAS: f64 = 8.0;
    /// Fewer views with the same reading are chance.
    pub(crate) const MIN_STILL_VIEWS: usize = 4;
    /// A range that lacks no more than twice this to a whole turn holds some angles twice.
    pub(crate) const WHOLE_TURN_RAD: f64 = 0.05;
    /// Motion that the camera must show meanwhile, over its sigma or [`LOCKED_RAD`].
    pub(crate) const STUCK_SIGMAS: f64 = 5.0;
    pub(crate) const ROUNDS: usize = 60;
    pub(crate) const FLOOR_RAD: f64 = 1e-5;
    /// A step that lasts is larger than this many sigma of what it leaves.
    pub(crate) const STEP_SIGMAS: f64 = 3.0;
    /// Readings that are all alike have no line: the determinant's share of the squares is rounding.
    pub(crate) const ALL_ALIKE: f64 = 1e-12;
}

pub(crate) mod failures {
    /// A joint's error in one view that stands out: times the spread of the others (a robust sigma), and at all, rad.
    pub(crate) const FAR_SIGMAS: f64 = 6.0;
    pub(crate) const FAR_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;
    /// Fewer views show nothing of a joint's history.
    pub(crate) const MIN_VIEWS: usize = 5;
    /// Priors of a sensor of another scale than its datasheet's: gain, and offset in rad. Wide.
    pub(crate) const OTHER_GAIN_STD: f64 = 1.0;
    pub(crate) const OTHER_OFFSET_STD_RAD: f64 = 0.5;
}

pub(crate) mod model_selection {
    /// Evidence that a doubtful term must add to stay, nats: odds of 20 to one.
    pub(crate) const MIN_GAIN_NATS: f64 = 3.0;
    /// First guess of the error of positions by SLAM: translation m, rotation rad (assumed; the evidence fits both).
    pub(crate) const CAMERA_ERROR_STD: [f64; 2] = [0.005, 0.01];
    /// Sessions shorter than this do not drift, h.
    pub(crate) const MIN_SESSION_H: f64 = 0.2;
    /// Slower joints have no clock to tell, rad/s.
    pub(crate) const MIN_RATE_RAD_S: f64 = 0.01;
}

pub(crate) mod other_lens {
    /// What a lens of the other model must bring over the stated one, both estimated, nats. Assumed: the models have as
    /// many numbers, and within a narrow view explain the same.
    pub(crate) const MODEL_NATS: f64 = 10.0;
}

pub(crate) mod permutation_test {
    /// Permutations of one test: they resolve probabilities down to 5e-4.
    pub(crate) const N_PERMUTATIONS: usize = 1999;
    /// So many permutations above the observed statistic settle that it is chance (Besag and Clifford 1991).
    pub(crate) const ENOUGH_ABOVE: usize = 20;
    /// Views for each function of the configuration that is regressed on.
    pub(crate) const VIEWS_PER_FUNCTION: usize = 4;
    /// More functions cost time and explain little more.
    pub(crate) const MAX_FUNCTIONS: usize = 120;
    /// A view of which the regression leaves less than this share of the variance shows nothing beyond it.
    pub(crate) const LEAST_LEFT: f64 = 0.05;
    /// A function of which the others leave less than this share of its square is one of theirs.
    pub(crate) const LEAST_NEW: f64 = 1e-3;
}

pub(crate) mod moved_between {
    /// One sigma of how far camera or tags may move between two views, m and rad. Assumed.
    pub(crate) const MOVED_STD: [f64; 2] = [0.05, 0.1];
    /// Views on either side of a gap: fewer say nothing of a motion's six numbers beside a slip. Assumed.
    pub(crate) const MIN_SIDE: usize = 4;
    /// About so many gaps are tried first. Assumed.
    pub(crate) const FIRST_GAPS: usize = 8;
    /// More views do not tell the gap better at first; they would cost time.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// Evidence that a motion needs, nats: odds of e^30, as some hundred gaps of several movers are possible.
    pub(crate) const MIN_GAIN_NATS: f64 = 30.0;
    /// What the six numbers of a body of tags cost, nats: each is told to a hundredth of its size. Assumed.
    pub(crate) const BODY_NATS: f64 = 28.0;
}

pub(crate) mod reading_search_hypothesis {
    /// Added to the score of a camera hypothesis, twice the logarithm of odds (assumed): where it explains the views as
    /// well as a sensor's zero does, the zero is named first.
    pub(crate) const CAMERA_HANDICAP: f64 = 5.0;
    /// Handicap of the frame of the tag map, which has six numbers: a turn about the first joint's axis is named
    /// behind that joint's zero, and always with it (chi-square of 5 is below this in 99 of 100 cases).
    pub(crate) const FRAME_HANDICAP: f64 = 15.0;
    /// The same of a reading that is a sum of several angles, or of the other sign (assumed).
    pub(crate) const SUM_HANDICAP: f64 = 5.0;
    /// Excess over the half range from which a reading is on another turn, rad.
    pub(crate) const NEXT_TURN_RAD: f64 = 0.1;
    pub(crate) const ZERO_STD_RAD: f64 = 0.2;
    /// Scales are tried at these steps, up to about a thousandth and a thousand; one sigma of what is left.
    pub(crate) const SCALE_STEP: f64 = 1.6;
    pub(crate) const SCALE_STEPS: i32 = 15;
    pub(crate) const SCALE_STD: f64 = 0.2;
    /// A scale that is off by fewer steps shows in the sensor's line.
    pub(crate) const LEAST_SCALE_STEPS: i32 = 4;
    /// Axes within this angle are parallel, rad.
    pub(crate) const PARALLEL_RAD: f64 = 0.02;
}

pub(crate) mod reading_search_map_frame {
    /// Tags farther than this from where a motion of the map has them hardly pull at it, m.
    pub(crate) const WIDTH_M: f64 = 0.1;
    /// Rounds of weights and motions: the last ones change nothing that the estimate does not.
    pub(crate) const ROUNDS: usize = 20;
    /// One sigma of what the datasheet's arm leaves of the frame, m and rad. Wide.
    pub(crate) const FRAME_STD: [f64; 2] = [0.1, 0.1];
    /// Smaller motions are those of a base that is estimated, or named as the geometry, m and rad. Assumed.
    pub(crate) const LEAST_M: f64 = 0.05;
    pub(crate) const LEAST_RAD: f64 = 0.05;
}

pub(crate) mod reading_search {
    /// Evidence that a reading error needs, twice the logarithm of the odds: e^30, as about 500 are tried.
    pub(crate) const MARGIN: f64 = 60.0;
    /// Hypotheses within this of the best one are printed with it, in the same unit: odds of e^5.
    pub(crate) const ALTERNATIVE: f64 = 10.0;
    pub(crate) const MAX_ALTERNATIVES: usize = 2;
    /// More views do not change the answer; they would cost time.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// Hypotheses that are estimated: those under which the nominal arm places the tags nearest to their survey.
    pub(crate) const MAX_ESTIMATED: usize = 36;
    /// Hypotheses among them that move or turn the camera.
    pub(crate) const MAX_OF_CAMERA: usize = 6;
    /// Circles and sums that are estimated beyond those: the right one is among the first, where the rest is nominal.
    /// Assumed.
    pub(crate) const MAX_COMPOSITE: usize = 8;
    /// A zero error in stated sigmas below which a sensor is as stated.
    pub(crate) const MIN_SIGMAS: f64 = 4.0;
}

pub(crate) mod score_test {
    use armcal_core::joints::MAX_JOINTS;

    /// Size of an error of geometry that is worth a look: what the data cannot tell to that is not tested.
    pub(crate) const SIZE_M: f64 = 0.01;
    pub(crate) const SIZE_RAD: f64 = 0.0175;
    /// Two elements whose chi-square differs by less explain the same: a likelihood ratio of 20.
    pub(crate) const ALIKE_CHI2: f64 = 6.0;
    /// A sigma so many times smaller than another is the surer one. Assumed.
    pub(crate) const SURER: f64 = 2.0;
    /// First trial column of the mount: behind six of each joint.
    pub(crate) const MOUNT: usize = 6 * MAX_JOINTS;
}

pub(crate) mod slips {
    /// What a candidate must promise to be fitted: three to four good arms in a hundred have one.
    pub(crate) const WORTH_A_FIT: f64 = 16.0;
    /// Good arms have 18 at most in 200 (measured), and chi-square's quantile at 1e-4 over some hundred joints and
    /// change points is 24.
    pub(crate) const MIN_LIKELIHOOD_RATIO: f64 = 24.0;
    /// Probability of as large a step in a random order of the views, above which the step may be an effect of the
    /// configurations (`permutation_test`).
    pub(crate) const MAX_P: f64 = 0.01;
    /// Smaller steps are drift, and do no harm, rad.
    pub(crate) const MIN_STEP_RAD: f64 = 0.05 * std::f64::consts::PI / 180.0;
    pub(crate) const MAX_STEPS: usize = 3;
    /// How often a change point is moved.
    pub(crate) const MAX_MOVES: usize = 3;
    /// A further step that promises more than this may be the change point's being elsewhere.
    pub(crate) const MISPLACED: f64 = 6.0;
}

pub(crate) mod step_test {
    /// Views on each side of a change point: one or two are a jump, not a step.
    pub(crate) const MIN_SIDE: usize = 3;
    /// Views that tell less of a joint's error than this share of its variance are on no side.
    pub(crate) const LEAST_TOLD: f64 = 0.01;
    /// More of a joint's errors than this share is no longer told apart from all of them.
    pub(crate) const SATURATED: f64 = 1.0 - 1e-6;
}

pub(crate) mod tags_alike {
    /// A tag whose survey is better known than this is no suspect, m and rad.
    pub(crate) const LEAST_STD: f64 = 1e-7;
}

pub(crate) mod tags_departure {
    /// Share of the prior's variance that the data must take away for a direction to count.
    pub(crate) const TOLD_SHARE: f64 = 0.1;
    /// Over chi-square's quantile: corners have longer tails than a normal one, and sizes of errors are fitted.
    pub(crate) const TAILS: f64 = 1.5;
}

pub(crate) mod tags_freed {
    /// Prior of a freed tag, m and rad: anywhere.
    pub(crate) const FREED_STD: f64 = 1.0;
    /// Tags that must stay where the survey has them.
    pub(crate) const MIN_TRUSTED: usize = 3;
}

pub(crate) mod tags_group {
    /// One sigma of each tag's pose while all are freed: no tag is farther off by far.
    pub(crate) const LOOSE_STD_M: f64 = 0.1;
    pub(crate) const LOOSE_STD_RAD: f64 = 0.2;
    /// Up to so many tags every three are tried.
    pub(crate) const MAX_TRIED_ALL: usize = 16;
    /// What a tag's departure must save, chi-square of 6: by chance once in a hundred.
    pub(crate) const LEAST_SAVING: f64 = 16.8;
}

pub(crate) mod tags_identity {
    /// A tag is looked at where so many of its observations are rejected, or all the data have it elsewhere.
    pub(crate) const REJECTED_SHARE: f64 = 0.5;
    pub(crate) const MIN_OBSERVATIONS: usize = 3;
    /// The size of a tag that fits otherwise counts from so many observations and this ratio on: fewer have no spread
    /// to speak of, and a smaller one moves the tool by less than U95. Assumed.
    pub(crate) const MIN_SIZED: usize = 5;
    pub(crate) const LEAST_RATIO_OF_FITTING: f64 = 0.01;
    /// Exchanged ids: so near each other's places, m, and so much nearer than to their own.
    pub(crate) const SAME_PLACE_M: f64 = 0.05;
    pub(crate) const NEARER: f64 = 0.3;
    /// A size counts from this ratio on, and from so many of its standard errors.
    pub(crate) const LEAST_RATIO: f64 = 0.005;
    pub(crate) const SURE_SIGMAS: f64 = 4.0;
    /// Tags nearer to each other tell nothing of their size, m.
    pub(crate) const LEAST_DISTANCE_M: f64 = 0.1;
    /// It must bring the observations of its tag this much nearer to the survey.
    pub(crate) const CLOSER: f64 = 0.6;
}

pub(crate) mod unpaired {
    /// Fewer views show no relation between readings and tags. Of 4 arms each with 20 views in random order of all
    /// joints, all showed it.
    pub(crate) const MIN_VIEWS: usize = 12;
    /// The nominal arm's relation in as many views must be surer than the first; of the recorded ones chance must do as
    /// well more often than the second: of 12 arms with 20 to 40 views all were below 0.04, and nineteen of twenty
    /// random orders are above.
    pub(crate) const POWER_P: f64 = 0.005;
    pub(crate) const CHANCE_P: f64 = 0.05;
    /// Readings that span less than this stand still, rad. Assumed.
    pub(crate) const LEAST_SPREAD_RAD: f64 = 0.01;
}

pub(crate) mod walk {
    /// Fewer views do not tell a walk from anything else.
    pub(crate) const MIN_VIEWS: usize = 8;
    /// So few views tell little before columns are tried, and the trial is quick.
    pub(crate) const FEW_VIEWS: usize = 20;
    /// Columns are tried where offsets change with temperature by more than so many times what is stated: no good arm
    /// of 60.
    pub(crate) const WARMTH_WORTH_A_FIT: f64 = 1.6;
    /// Or where the score test's statistic lies so many of its standard deviations above its mean: one good arm of 60.
    pub(crate) const SCORE_WORTH_A_FIT: f64 = 3.0;
    /// A walk that is missed is an error beyond its bound, one too many a bound that is too wide. Good arms lose two
    /// nats or more by it (60 of 60); of 40 arms that walk by 0.29 deg in 14 views 34 gain some.
    pub(crate) const MIN_WALK_NATS: f64 = 0.0;
    /// Probability of the likeliest joint's errors in a random order of the views, times the number of joints: above it
    /// they may follow the configurations.
    pub(crate) const MAX_WALK_P: f64 = 0.05;
}

pub(crate) mod wrong_input_by_pairs {
    /// Above this a map is of other tags.
    pub(crate) const BAD: f64 = 0.3;
}

pub(crate) mod wrong_input_lens {
    /// Image sizes that are tried, over robot.toml's.
    pub(crate) const IMAGE_SCALES: [f64; 4] = [0.5, 2.0, 0.25, 4.0];
    /// Focal lengths that are tried, over robot.toml's: so many steps of a logarithm up and down, to 0.5 and 2.
    pub(crate) const FOCAL_STEP: f64 = 0.02;
    pub(crate) const FOCAL_STEPS: i32 = 35;
    /// Half of the field of view of a fisheye that nobody describes, rad.
    pub(crate) const FISHEYE_RAD: f64 = 1.5;
}

pub(crate) mod wrong_input {
    /// Mismatches below this are those of good maps and lenses: the tilt of a small tag is not seen better.
    pub(crate) const GOOD: f64 = 0.12;
    /// What puts an input right makes the mismatch this much smaller.
    pub(crate) const BETTER: f64 = 0.4;
    /// More views tell no more.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// A size within this of the stated one is not called wrong.
    pub(crate) const SIZE_TOLERANCE: f64 = 0.03;
}

pub(crate) mod wrong_input_map {
    /// A ratio of sizes within this of that of a print to its border is that one, relative.
    pub(crate) const PRINT_TOLERANCE: f64 = 0.02;
}

pub(crate) mod wrong_input_pairs {
    /// Fewer pairs determine no median.
    pub(crate) const MIN_PAIRS: usize = 6;
}

pub(crate) mod wrong_input_positions {
    /// Fewer positions determine no median. Assumed.
    pub(crate) const MIN_POSITIONS: usize = 6;
    /// The datasheet's arm and the tilt of a small tag place the camera to this share of its distance from the tag.
    /// Assumed.
    pub(crate) const NEAR_ARM: f64 = 0.25;
}

pub(crate) mod wrong_input_recording {
    /// A corner may lie so far outside of the stated image: detectors round.
    pub(crate) const BEYOND_IMAGE: f64 = 1.03;
    /// Rotations of one landmark: spread that says nothing, and that of good ones, rad.
    pub(crate) const SPREAD_RAD: f64 = 0.5;
    pub(crate) const GOOD_SPREAD_RAD: f64 = 0.25;
    pub(crate) const MIN_ROTATIONS: usize = 5;
}
