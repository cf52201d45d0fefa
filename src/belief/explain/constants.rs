//! Constants that decide something in `explain`: unit, source and effect of each, by the file that uses it.

pub(crate) mod angles_by_camera {
    /// Distance from the survey above which a tag hardly affects the search for an angle, m.
    pub(crate) const SEARCH_WIDTH_M: f64 = 0.1;
    /// Candidates of one joint over its range, by the number of joints searched for in one view.
    pub(crate) const CANDIDATES: [usize; 3] = [90, 40, 16];
    pub(crate) const FINEST_STEP_RAD: f64 = 1e-4;
    /// Largest stated standard deviations of a camera mount that still places the tags, m and rad.
    pub(crate) const KNOWN_MOUNT: [f64; 2] = [0.05, 0.2];
}

pub(crate) mod baseline {
    /// Number of baselines without a calibration of joints: the datasheet's arm, least squares, and joint errors by the
    /// evidence.
    pub(crate) const N_BASELINES: usize = 3;
    /// Largest number of passes over the scales of errors; each brings exact sensors down by a factor of three.
    pub(crate) const MAX_PASSES: usize = 8;
    /// Share of the previous scale above which a scale has settled.
    pub(crate) const SETTLED: f64 = 0.8;
}

pub(crate) mod calibration_prior {
    /// Drift of a sensor whose datasheet states none, rad per root of an hour. Assumed: the standard world's sensors.
    pub(crate) const USUAL_DRIFT_STD_RAD_PER_SQRT_H: f64 = 0.02 * std::f64::consts::PI / 180.0;
    /// Least standard deviation of a sensor's slip, if the datasheet states that it has no offset, rad. Assumed.
    pub(crate) const LEAST_SLIP_STD_RAD: f64 = 0.02;
    /// Share of the variances that is added so that the matrix has an inverse: the file's numbers are rounded to seven
    /// digits.
    pub(crate) const ROUNDING: f64 = 1e-6;
    /// The 0.999 quantile of the normal distribution; `Z_OF_JOINTS`: that of 0.001 shared by both sides of about eight
    /// joints.
    pub(crate) const Z_999: f64 = 3.090;
    pub(crate) const Z_OF_JOINTS: f64 = 3.9;
    /// Standard deviation of the pose of a camera that was mounted again, m and rad. Assumed.
    pub(crate) const REMOUNTED_STD: [f64; 2] = [0.05, 0.2];
    /// Share, reached in tenfold steps, from which no more is added and the matrix has no inverse. Assumed.
    pub(crate) const MAX_ROUNDING: f64 = 0.1;
}

pub(crate) mod drawing {
    /// Least evidence gain of an alternative, nats. Of 60 good arms one reached 5 (docs/theory/verdict.md).
    pub(crate) const MIN_GAIN_NATS: f64 = 6.0;
    /// Multiples of robot.toml's standard deviations to try for an error.
    pub(crate) const MULTIPLES: [f64; 5] = [2.0, 5.0, 10.0, 20.0, 40.0];
    /// Half width of the search for the scale of all tags, about the ratio of their distances, as a logarithm.
    /// `GOLDEN_STEPS` cut it to about 0.03 %.
    pub(crate) const LOG_RATIO_RANGE: f64 = 0.01;
    pub(crate) const GOLDEN_STEPS: usize = 8;
    /// Largest deviation of a lens that is not robot.toml's, in standard deviations of a measured lens.
    pub(crate) const LENS_SCALE: f64 = 10.0;
}

pub(crate) mod failure_detection {
    /// Error of a joint over all views above which, if it is also above twice the datasheet's linearity, the joint is
    /// examined, rad.
    pub(crate) const LARGE_STD_RAD: f64 = 0.15 * std::f64::consts::PI / 180.0;
    /// Share of rejected observations that wrong ids alone do not cause.
    pub(crate) const MANY_REJECTED: f64 = 0.1;
    /// Cost of giving up one reading: 2 ln(1 rad / 1 mrad).
    pub(crate) const PER_READING: f64 = 14.0;
    /// Cost of a step: 2 ln(0.1 rad / 1 mrad).
    pub(crate) const PER_STEP: f64 = 9.0;
    /// Evidence that a failure needs: odds of e^15 to one.
    pub(crate) const MARGIN: f64 = 30.0;
    /// Largest number of failures to search for beyond those that the readings alone show.
    pub(crate) const MAX_FOUND: usize = 2;
    /// Largest error of a joint between views over its datasheet's linearity: sensors do not have more, once smooth
    /// effects are removed.
    pub(crate) const MAX_OVER_LINEARITY: f64 = 3.0;
    /// Number of sensor pairs to estimate as failed: those that place the tags nearest to their survey. Assumed.
    pub(crate) const MAX_PAIRS: usize = 6;
    /// Number of views that rank those pairs, spread over all. Assumed.
    pub(crate) const RANKED_VIEWS: usize = 12;
}

pub(crate) mod failure_pattern {
    /// Spread of an angle, in its own standard deviations, below which it does not change; so does one below
    /// `LOCKED_RAD`.
    pub(crate) const LOCKED_SIGMAS: f64 = 3.0;
    pub(crate) const LOCKED_RAD: f64 = 0.2 * std::f64::consts::PI / 180.0;
    /// Spread of an angle that no locked joint has, with the creep of its brake or valve, rad; m of a slide.
    pub(crate) const MOVED_RAD: f64 = std::f64::consts::PI / 180.0;
    /// Largest distance of a working sensor from the angle, as a share of the angle's spread, with about the
    /// datasheet's slope.
    pub(crate) const FOLLOWS: f64 = 0.3;
    /// Distance from a straight line, as a share of the angle's spread; `LEAST_GAIN_STD`: the least uncertainty of a
    /// gain.
    pub(crate) const STRAIGHT: f64 = 0.05;
    pub(crate) const LEAST_GAIN_STD: f64 = 0.01;
    /// Share of a straight line's squares that a lasting step leaves.
    pub(crate) const STEP_LEAVES: f64 = 1.0 / 6.0;
    pub(crate) const MIN_SIDE: usize = 2;
    /// Share of the views above which single jumps are no exceptions.
    pub(crate) const MAX_SINGLE: f64 = 0.4;
    /// Least number of views in which a lost sensor's readings are off; `LOST_SHARE`: their share since the first of
    /// them. Assumed: single jumps, of one view in five, are no such row in one of a hundred recordings.
    pub(crate) const MIN_LOST: usize = 4;
    pub(crate) const LOST_SHARE: f64 = 0.75;
    /// Number of times that the line is fitted again to the readings that are not off. Assumed: one settles nearly all.
    pub(crate) const REFITS: usize = 3;
    /// Number of right readings at the end that show that the sensor is back. Assumed: a wrong reading is right by
    /// chance in less than a quarter of the views. Three in a row are so in less than two of a hundred.
    pub(crate) const MIN_BACK: usize = 3;
    /// Error, in the datasheet's standard deviations, below which a locked joint's sensor is right.
    pub(crate) const RIGHT_SIGMAS: f64 = 4.0;
    /// Span of a reading, in standard deviations of its noise, above which it moved.
    pub(crate) const STILL_SIGMAS: f64 = 8.0;
    /// Least number of views with the same reading: fewer are chance.
    pub(crate) const MIN_STILL_VIEWS: usize = 4;
    /// Half of the gap to a whole turn up to which a range holds some angles twice, rad.
    pub(crate) const WHOLE_TURN_RAD: f64 = 0.05;
    /// Motion that the camera must show meanwhile, over its standard deviation or [`LOCKED_RAD`].
    pub(crate) const STUCK_SIGMAS: f64 = 5.0;
    pub(crate) const ROUNDS: usize = 60;
    pub(crate) const FLOOR_RAD: f64 = 1e-5;
    /// Least size of a lasting step, in standard deviations of the remaining error.
    pub(crate) const STEP_SIGMAS: f64 = 3.0;
    /// Determinant's share of the squares below which readings are all alike and have no line: it is rounding.
    pub(crate) const ALL_ALIKE: f64 = 1e-12;
}

pub(crate) mod failures {
    /// Least outstanding error of a joint in one view, in robust standard deviations of the others; `FAR_RAD`: in rad.
    pub(crate) const FAR_SIGMAS: f64 = 6.0;
    pub(crate) const FAR_RAD: f64 = 0.3 * std::f64::consts::PI / 180.0;
    /// Least number of views to examine a joint's history.
    pub(crate) const MIN_VIEWS: usize = 5;
    /// Priors of a sensor of another scale than its datasheet's: gain, and offset in rad. Wide.
    pub(crate) const OTHER_GAIN_STD: f64 = 1.0;
    pub(crate) const OTHER_OFFSET_STD_RAD: f64 = 0.5;
}

pub(crate) mod model_selection {
    /// Evidence that an optional term must add to stay, nats: odds of 20 to one.
    pub(crate) const MIN_GAIN_NATS: f64 = 3.0;
    /// First guess of the error of positions by SLAM: translation m, rotation rad (assumed; the evidence fits both).
    pub(crate) const CAMERA_ERROR_STD: [f64; 2] = [0.005, 0.01];
    /// Length of a session below which it has no drift, h.
    pub(crate) const MIN_SESSION_H: f64 = 0.2;
    /// Joint rate below which no clock offset is observable, rad/s.
    pub(crate) const MIN_RATE_RAD_S: f64 = 0.01;
}

pub(crate) mod other_lens {
    /// Evidence that a lens of the other model needs over the stated one, both estimated, nats. Assumed: the models
    /// have as many numbers, and explain the same within a narrow view.
    pub(crate) const MODEL_NATS: f64 = 10.0;
}

pub(crate) mod permutation_test {
    /// Number of permutations of one test: they resolve probabilities down to 5e-4.
    pub(crate) const N_PERMUTATIONS: usize = 1999;
    /// Number of permutations above the observed statistic that settles that it is chance (Besag and Clifford 1991).
    pub(crate) const ENOUGH_ABOVE: usize = 20;
    /// Number of views for each function of the configuration in the regression.
    pub(crate) const VIEWS_PER_FUNCTION: usize = 4;
    /// Largest number of functions: more cost time and explain little more.
    pub(crate) const MAX_FUNCTIONS: usize = 120;
    /// Share of a view's variance left by the regression below which the view shows nothing beyond it.
    pub(crate) const LEAST_LEFT: f64 = 0.05;
    /// Share of a function's square left by the others below which it depends on them.
    pub(crate) const LEAST_NEW: f64 = 1e-3;
}

pub(crate) mod moved_between {
    /// Standard deviation of a motion of camera or tags between two views, m and rad. Assumed.
    pub(crate) const MOVED_STD: [f64; 2] = [0.05, 0.1];
    /// Least number of views on either side of a gap: fewer do not separate a motion's six numbers from a slip.
    /// Assumed.
    pub(crate) const MIN_SIDE: usize = 4;
    /// Approximate number of gaps to try first. Assumed.
    pub(crate) const FIRST_GAPS: usize = 8;
    /// Largest number of views in the first search: more do not locate the gap better, and cost time.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// Evidence that a motion needs, nats: odds of e^30, as some hundred gaps of several movers are possible.
    pub(crate) const MIN_GAIN_NATS: f64 = 30.0;
    /// Cost of the six numbers of a body of tags, nats: each is determined to a hundredth of its prior. Assumed.
    pub(crate) const BODY_NATS: f64 = 28.0;
}

pub(crate) mod reading_search_hypothesis {
    /// Handicap of a camera hypothesis in its score, twice the logarithm of odds (assumed). A sensor's zero that
    /// explains the views as well is named first.
    pub(crate) const CAMERA_HANDICAP: f64 = 5.0;
    /// Handicap of the frame of the tag map, which has six numbers. A turn about the first joint's axis is named after
    /// that joint's zero, and always with it. Chi-square of 5 is below this in 99 of 100 cases.
    pub(crate) const FRAME_HANDICAP: f64 = 15.0;
    /// Handicap of a reading that is a sum of several angles, or of the other sign (assumed).
    pub(crate) const SUM_HANDICAP: f64 = 5.0;
    /// Excess over half the range from which a reading is on another turn, rad.
    pub(crate) const NEXT_TURN_RAD: f64 = 0.1;
    pub(crate) const ZERO_STD_RAD: f64 = 0.2;
    /// Step factor of the scales to try, up to about a thousandth and a thousand; `SCALE_STD`: standard deviation of
    /// the rest.
    pub(crate) const SCALE_STEP: f64 = 1.6;
    pub(crate) const SCALE_STEPS: i32 = 15;
    pub(crate) const SCALE_STD: f64 = 0.2;
    /// Least number of steps of a scale error: a smaller one shows in the sensor's line.
    pub(crate) const LEAST_SCALE_STEPS: i32 = 4;
    /// Angle up to which axes are parallel, rad.
    pub(crate) const PARALLEL_RAD: f64 = 0.02;
}

pub(crate) mod reading_search_map_frame {
    /// Distance from a tag's place under the map's motion above which it hardly affects the motion, m.
    pub(crate) const WIDTH_M: f64 = 0.1;
    /// Number of rounds of weights and motions: the last ones are within the estimate's correction.
    pub(crate) const ROUNDS: usize = 20;
    /// Standard deviation of the frame's remaining error by the datasheet's arm, m and rad. Wide.
    pub(crate) const FRAME_STD: [f64; 2] = [0.1, 0.1];
    /// Motion below which it is that of an estimated base, or named as geometry, m; `LEAST_RAD`: rad. Assumed.
    pub(crate) const LEAST_M: f64 = 0.05;
    pub(crate) const LEAST_RAD: f64 = 0.05;
}

pub(crate) mod reading_search_map_scale {
    /// Logarithm of the least factor that is not a survey's error: maps are scaled by less than 3 %. Assumed.
    pub(crate) const LEAST: f64 = 0.03;
    /// Least number of positions of the camera for a line, and their least correlation.
    pub(crate) const MIN_POSITIONS: usize = 6;
    pub(crate) const MIN_CORRELATION: f64 = 0.8;
    /// Number of rounds of weights and lines.
    pub(crate) const ROUNDS: usize = 20;
    /// Farthest factor from the line's, as a logarithm: the datasheet's arm is within it. The steps between the factors
    /// begin with `FIRST_STEP`, and end before `LAST_STEP`: tags 2 m away are then within 1 mm.
    pub(crate) const FARTHEST: f64 = 0.12;
    pub(crate) const FIRST_STEP: f64 = 0.02;
    pub(crate) const LAST_STEP: f64 = 5e-4;
}

pub(crate) mod reading_search {
    /// Evidence that a reading error needs, twice the logarithm of the odds: e^30, as about 500 are tried.
    pub(crate) const MARGIN: f64 = 60.0;
    /// Hypotheses within this of the best one are printed with it, in the same unit: odds of e^5.
    pub(crate) const ALTERNATIVE: f64 = 10.0;
    pub(crate) const MAX_ALTERNATIVES: usize = 2;
    /// Largest number of views to use: more do not change the answer, and cost time.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// Number of hypotheses to estimate: those under which the nominal arm places the tags nearest to their survey.
    pub(crate) const MAX_ESTIMATED: usize = 36;
    /// Number of hypotheses among them that move or turn the camera.
    pub(crate) const MAX_OF_CAMERA: usize = 6;
    /// Number of circles and sums to estimate beyond those: the right one is among the first, if the rest is nominal.
    /// Assumed.
    pub(crate) const MAX_COMPOSITE: usize = 8;
    /// Zero error, in stated standard deviations, below which a sensor is as stated.
    pub(crate) const MIN_SIGMAS: f64 = 4.0;
}

pub(crate) mod score_test {
    use armcal_core::joints::MAX_JOINTS;

    /// Size of a geometry error that matters: directions that the data determine less well are not tested.
    pub(crate) const SIZE_M: f64 = 0.01;
    pub(crate) const SIZE_RAD: f64 = 0.0175;
    /// Chi-square difference below which two elements explain the same: a likelihood ratio of 20.
    pub(crate) const ALIKE_CHI2: f64 = 6.0;
    /// Ratio of two standard deviations from which the smaller one counts as more certain. Assumed.
    pub(crate) const SURER: f64 = 2.0;
    /// First trial column of the mount, after six of each joint.
    pub(crate) const MOUNT: usize = 6 * MAX_JOINTS;
}

pub(crate) mod slips {
    /// Least promised likelihood ratio of a candidate to be fitted: three to four good arms in a hundred have one.
    pub(crate) const WORTH_A_FIT: f64 = 16.0;
    /// Least likelihood ratio of a step. Good arms have 18 at most in 200 (measured); chi-square's quantile at 1e-4
    /// over about a hundred joints and change points is 24.
    pub(crate) const MIN_LIKELIHOOD_RATIO: f64 = 24.0;
    /// Probability of as large a step in a random order of the views, above which the step may be an effect of the
    /// configurations (`permutation_test`).
    pub(crate) const MAX_P: f64 = 0.01;
    /// Least size of a step, rad: smaller ones are drift, and do no harm.
    pub(crate) const MIN_STEP_RAD: f64 = 0.05 * std::f64::consts::PI / 180.0;
    pub(crate) const MAX_STEPS: usize = 3;
    /// Number of times that a change point may be moved.
    pub(crate) const MAX_MOVES: usize = 3;
    /// Likelihood ratio of a further step above which the change point may be elsewhere.
    pub(crate) const MISPLACED: f64 = 6.0;
}

pub(crate) mod step_test {
    /// Least number of views on each side of a change point: one or two are a jump, not a step.
    pub(crate) const MIN_SIDE: usize = 3;
    /// Least share of the variance of a joint's error that a view must determine to be on a side.
    pub(crate) const LEAST_TOLD: f64 = 0.01;
    /// Share of a joint's errors above which it is not distinguished from all of them.
    pub(crate) const SATURATED: f64 = 1.0 - 1e-6;
}

pub(crate) mod tags_alike {
    /// Standard deviation of a tag's survey below which the tag is no suspect, m and rad.
    pub(crate) const LEAST_STD: f64 = 1e-7;
}

pub(crate) mod tags_departure {
    /// Share of the prior's variance that the data must take away for a direction to count.
    pub(crate) const TOLD_SHARE: f64 = 0.1;
    /// Factor on chi-square's quantile: corners have longer tails than a normal distribution, and scales of errors are
    /// fitted.
    pub(crate) const TAILS: f64 = 1.5;
}

pub(crate) mod tags_freed {
    /// Prior standard deviation of a freed tag, m and rad: anywhere.
    pub(crate) const FREED_STD: f64 = 1.0;
    /// Least number of tags that must stay where the survey has them.
    pub(crate) const MIN_TRUSTED: usize = 3;
}

pub(crate) mod tags_group {
    /// Standard deviation of each tag's pose while all are freed: no tag has nearly as large an error.
    pub(crate) const LOOSE_STD_M: f64 = 0.1;
    pub(crate) const LOOSE_STD_RAD: f64 = 0.2;
    /// Largest number of tags for which every three are tried.
    pub(crate) const MAX_TRIED_ALL: usize = 16;
    /// Chi-square of 6 that a tag's departure must save: by chance once in a hundred.
    pub(crate) const LEAST_SAVING: f64 = 16.8;
}

pub(crate) mod tags_identity {
    /// Share of a tag's observations rejected above which the tag is examined; so is one that all the data have
    /// elsewhere.
    pub(crate) const REJECTED_SHARE: f64 = 0.5;
    pub(crate) const MIN_OBSERVATIONS: usize = 3;
    /// Least number of observations of a tag that fits for its size to count: fewer have almost no spread.
    /// `LEAST_RATIO_OF_FITTING`: least relative size error; a smaller one moves the tool by less than U95. Assumed.
    pub(crate) const MIN_SIZED: usize = 5;
    pub(crate) const LEAST_RATIO_OF_FITTING: f64 = 0.01;
    /// Distance from each other's places within which ids are exchanged, m; `NEARER`: relative to that from their own.
    pub(crate) const SAME_PLACE_M: f64 = 0.05;
    pub(crate) const NEARER: f64 = 0.3;
    /// Least relative size error; `SURE_SIGMAS`: in its standard errors.
    pub(crate) const LEAST_RATIO: f64 = 0.005;
    pub(crate) const SURE_SIGMAS: f64 = 4.0;
    /// Distance between tags below which they do not determine their size, m.
    pub(crate) const LEAST_DISTANCE_M: f64 = 0.1;
    /// Ratio to which a size must reduce the distance of its tag's observations from the survey.
    pub(crate) const CLOSER: f64 = 0.6;
}

pub(crate) mod unpaired {
    /// Least number of views: fewer show no relation between readings and tags. Of 4 arms each with 20 views in random
    /// order of all joints, all showed it.
    pub(crate) const MIN_VIEWS: usize = 12;
    /// Largest p-value of the nominal arm's relation in as many views. `CHANCE_P`: p-value of the recorded readings
    /// above which they are chance. Of 12 arms with 20 to 40 views all were below 0.04; nineteen of twenty random
    /// orders are above.
    pub(crate) const POWER_P: f64 = 0.005;
    pub(crate) const CHANCE_P: f64 = 0.05;
    /// Span below which readings stand still, rad. Assumed.
    pub(crate) const LEAST_SPREAD_RAD: f64 = 0.01;
}

pub(crate) mod walk {
    /// Least number of views to distinguish a walk from other effects.
    pub(crate) const MIN_VIEWS: usize = 8;
    /// Number of views below which columns are tried at once: the tests before are weak, and the trial is quick.
    pub(crate) const FEW_VIEWS: usize = 20;
    /// Change of offsets with temperature, as a multiple of the stated one, above which columns are tried: no good arm
    /// of 60.
    pub(crate) const WARMTH_WORTH_A_FIT: f64 = 1.6;
    /// Excess of the score test's statistic over its mean, in standard deviations, above which columns are tried: one
    /// good arm of 60.
    pub(crate) const SCORE_WORTH_A_FIT: f64 = 3.0;
    /// Least evidence gain of a walk, nats. A walk that is missed is an error beyond its bound; one too many makes a
    /// bound too wide. Good arms lose two nats or more by it (60 of 60). Of 40 arms that walk by 0.29 deg in 14 views,
    /// 34 gain some.
    pub(crate) const MIN_WALK_NATS: f64 = 0.0;
    /// Probability of the likeliest joint's errors in a random order of the views, times the number of joints: above it
    /// they may follow the configurations.
    pub(crate) const MAX_WALK_P: f64 = 0.05;
}

pub(crate) mod wrong_input_by_pairs {
    /// Mismatch above which a map is of other tags.
    pub(crate) const BAD: f64 = 0.3;
}

pub(crate) mod wrong_input_lens {
    /// Image sizes to try, over robot.toml's.
    pub(crate) const IMAGE_SCALES: [f64; 4] = [0.5, 2.0, 0.25, 4.0];
    /// Logarithmic step of the focal lengths to try, over robot.toml's; `FOCAL_STEPS` up and down reach 0.5 and 2.
    pub(crate) const FOCAL_STEP: f64 = 0.02;
    pub(crate) const FOCAL_STEPS: i32 = 35;
    /// Half of the field of view of a fisheye that is not described, rad.
    pub(crate) const FISHEYE_RAD: f64 = 1.5;
}

pub(crate) mod wrong_input {
    /// Mismatch of good maps and lenses: the tilt of a small tag is not seen better.
    pub(crate) const GOOD: f64 = 0.12;
    /// Ratio to which a correction of an input must reduce the mismatch.
    pub(crate) const BETTER: f64 = 0.4;
    /// Largest number of views to use: more do not help.
    pub(crate) const MAX_VIEWS: usize = 40;
    /// Relative size error up to which a size is not reported as wrong.
    pub(crate) const SIZE_TOLERANCE: f64 = 0.03;
}

pub(crate) mod wrong_input_map {
    /// Relative difference within which a ratio of sizes is that of a print to its border.
    pub(crate) const PRINT_TOLERANCE: f64 = 0.02;
}

pub(crate) mod wrong_input_pairs {
    /// Least number of pairs for a median.
    pub(crate) const MIN_PAIRS: usize = 6;
}

pub(crate) mod wrong_input_positions {
    /// Least number of positions for a median. Assumed.
    pub(crate) const MIN_POSITIONS: usize = 6;
    /// Camera position error by the datasheet's arm and the tilt of a small tag, as a share of the camera's distance
    /// from the tag. Assumed.
    pub(crate) const NEAR_ARM: f64 = 0.25;
}

pub(crate) mod wrong_input_recording {
    /// Largest position of a corner over the stated image size: detectors round.
    pub(crate) const BEYOND_IMAGE: f64 = 1.03;
    /// Spread of one landmark's rotations that is uninformative, rad; `GOOD_SPREAD_RAD`: that of good ones.
    pub(crate) const SPREAD_RAD: f64 = 0.5;
    pub(crate) const GOOD_SPREAD_RAD: f64 = 0.25;
    pub(crate) const MIN_ROTATIONS: usize = 5;
}
