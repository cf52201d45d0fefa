//! Constants that affect results of `follow`: unit, source and effect of each, by the file that uses it.

pub(crate) mod belief_log {
    /// Interval between two lines of the estimate, s of arm time.
    pub(crate) const EVERY_S: f64 = 60.0;
}

pub(crate) mod branch {
    /// Cost of a view under a hypothesis that rejects all its observations, nats per observation; that of a rejected
    /// one.
    pub(crate) const NOTHING_FITS_NATS: f64 = 30.0;
    /// Lead in evidence by which a view supports one hypothesis against another, nats.
    pub(crate) const SPEAKS_NATS: f64 = 1.0;
    /// Least difference from the datasheet's scale for a scale fault; a smaller one is sensor drift.
    pub(crate) const LEAST_SCALE: f64 = 0.2;
    /// Least height of a bump for a worn spot, rad: 0.15 deg. A lower one is the nonlinearity of a sound sensor.
    pub(crate) const LEAST_BUMP_RAD: f64 = 2.6e-3;
}

pub(crate) mod diagnosis {
    /// Quantile of the normal above which a view is suspicious by its cost (one in ten thousand).
    pub(crate) const SUSPICIOUS_Z: f64 = 3.719;
    /// Quantile above which a view is suspicious by a step of one joint's sensor; lower, because it is one direction
    /// among many.
    pub(crate) const SUSPICIOUS_STEP_Z: f64 = 3.3;
    /// Lead by which a hypothesis is accepted, nats.
    pub(crate) const LEAD_NATS: f64 = 5.0;
    /// Lead required over another hypothesis about the same sensor, nats: identifying the sensor matters more than the
    /// kind of failure.
    pub(crate) const LEAD_OF_SENSOR_NATS: f64 = 1.5;
    /// Lead by which a single view at rest shows a worn spot, nats; and that of one in motion, whose readings may be
    /// torn.
    pub(crate) const LONE_LEAD_NATS: f64 = 10.0;
    pub(crate) const LONE_LEAD_IN_MOTION_NATS: f64 = 20.0;
    /// Largest displacement of a tag at which a single view suffices, m, and the lead required then, nats.
    pub(crate) const LONE_TAG_M: f64 = 0.08;
    pub(crate) const LONE_TAG_LEAD_NATS: f64 = 1.5;
    /// Gain by which a shifted middle of a spot must explain more, nats: views of one place fit all middles nearby.
    pub(crate) const NEARER_NATS: f64 = 1.0;
    /// Largest number of hypotheses followed.
    pub(crate) const MAX_BRANCHES: usize = 8;
    /// Loss against the best hypothesis at which one is dropped, nats.
    pub(crate) const HOPELESS_NATS: f64 = 25.0;
    /// Time within which views are tested together, s, and the largest number of them.
    pub(crate) const RECENT_S: f64 = 60.0;
    pub(crate) const MAX_RECENT: usize = 6;
    /// Number of views after which the best hypothesis is accepted: if a fault is certain, if it may be drift, if a
    /// slip may be a worn spot, and in any case.
    pub(crate) const MAX_VIEWS_TO_NAME: usize = 2;
    pub(crate) const MAX_VIEWS_OF_DRIFT: usize = 3;
    pub(crate) const MAX_VIEWS_OF_SLIP: usize = 3;
    pub(crate) const MAX_VIEWS: usize = 5;
    /// Number of views after which a tie between worn sensors of two joints is decided, because later views of tags may
    /// decide it.
    pub(crate) const MAX_VIEWS_OF_TIE: usize = 20;
    /// Number of views after the first ones for which all hypotheses are opened.
    pub(crate) const OPEN_VIEWS: usize = 2;
    /// Least gain by a tag that moved with others, nats; and the least number of views that confirm a hypothesis.
    pub(crate) const JOINS_NATS: f64 = 3.0;
    pub(crate) const CONFIRMED_BY: usize = 2;
    /// Least number of views that confirm a scale fault, whose two parameters fit any two views, or a failed sensor,
    /// which fits any.
    pub(crate) const OPEN_SENSOR_CONFIRMED_BY: usize = 3;
}

pub(crate) mod estimator {
    /// Lags of the sensors' temperature behind the oil's, s. Assumed: from none to a housing full of oil. Views hardly
    /// distinguish neighbouring lags, and each costs as much as the first.
    pub(crate) const LAGS_S: [f64; 4] = [0.0, 200.0, 600.0, 1800.0];
    /// Temperature difference from the oil in a view, K, from which on a lag has its own belief. Before, it shares the
    /// belief without lag, with an error of some thousandths of a degree.
    pub(crate) const APART_K: f64 = 0.25;
    /// Loss of evidence at which a lag is abandoned, nats.
    pub(crate) const GIVEN_UP_NATS: f64 = 12.0;
    /// Age beyond which an event is not reported when its belief becomes the best one, ns.
    pub(crate) const TOLD_LATE_NANOS: i64 = 600_000_000_000;
}

pub(crate) mod doubts {
    /// Means of the same corners differ by rounding alone, px.
    pub(crate) const SAME_PX: f64 = 1e-6;
    /// A joint that is this far from where it was has moved, rad or m, and the image with it: ten pixels at a focal
    /// length of 1000 px. Assumed.
    pub(crate) const MOVED_RAD: f64 = 0.01;
    /// Views in a row with a repeated image before it is said. Assumed.
    pub(crate) const FROZEN_VIEWS: usize = 3;
    /// A base that moved farther than this share of the arm's reach would show no tag where it is looked for. Assumed:
    /// 0.3 m for an arm of 2 m.
    pub(crate) const MAX_BASE_SHARE: f64 = 0.15;
    /// Events this many views ago still belong together. Assumed.
    pub(crate) const RECENT_VIEWS: usize = 30;
    /// A base that moves so many times within these views moves on, or something else does. Assumed.
    pub(crate) const BASE_MOVES: usize = 2;
    /// So many events of a mount or several tags that had moved before are no accident. Assumed.
    pub(crate) const MOVED_AGAIN: usize = 2;
}

pub(crate) mod event {
    /// Lead below which an event also names the next hypothesis, nats (odds of twenty).
    pub(crate) const CLEAR_LEAD_NATS: f64 = 3.0;
}

pub(crate) mod filter {
    /// Largest number of steps per view; usually two are taken.
    pub(crate) const MAX_STEPS: usize = 8;
    /// Least decrease of the cost for another step, in units of the cost (sums of squares in sigmas).
    pub(crate) const LAST_GAIN: f64 = 1e-4;
    /// Factor on a step that does not lower the cost.
    pub(crate) const SHORTER: f64 = 0.3;
    /// Std of the pose of an unsurveyed tag, m and rad: no view of it is used.
    pub(crate) const UNKNOWN_STD: f64 = 100.0;
    /// Length of a step that ends the search even if the cost does not fall, in the parameters' units.
    pub(crate) const SHORTEST_STEP: f64 = 1e-12;
}

pub(crate) mod follower {
    /// Time ahead for which the error without further views is predicted, h.
    pub(crate) const AHEAD_H: f64 = 1.0;
}

pub(crate) mod hindsight {
    /// Number of views of a span; two spans are kept, so hindsight covers one to two of them.
    pub(crate) const VIEWS_OF_SPAN: usize = 40;
    /// Score of one place, in sigmas, above which it is tested.
    pub(crate) const SUSPICIOUS_Z: f64 = 4.0;
    /// Growth of the square of the score after which it is tested again.
    pub(crate) const GROWN_BY: f64 = 3.0;
    /// Lead of the spot over no fault, nats, above which other hypotheses are compared.
    pub(crate) const WORTH_COMPARING_NATS: f64 = 2.0;
    /// Middles of a spot to which a view may belong, in widths from the view's place, nearest first.
    pub(crate) const MIDDLES: [f64; 9] = [0.0, -0.5, 0.5, -1.0, 1.0, -1.5, 1.5, -2.0, 2.0];
    /// Gain by which a more distant middle must explain more, in squared sigmas: views of one place fit all of them.
    pub(crate) const FARTHER_BY: f64 = 1.0;
    /// Score of another joint, in sigmas, above which its spots are compared.
    pub(crate) const COMPARED_Z: f64 = 2.5;
    /// Least number of views of a spot or a tag.
    pub(crate) const LEAST_VIEWS: usize = 2;
    /// Score of a tag's position above which it is tested, chi-square of three degrees of freedom: by chance once in
    /// 15,000.
    pub(crate) const SUSPICIOUS_CHI2: f64 = 22.0;
    /// Score above which other tags are compared, once in 50.
    pub(crate) const COMPARED_CHI2: f64 = 10.0;
    /// Prior std of a tag's displacement, m. In a direction that the views determine less well, scores are rounding
    /// error.
    pub(crate) const A_LITTLE_ASIDE_M: f64 = 0.005;
}

pub(crate) mod hypothesis {
    /// Std of a displacement of a tag, the camera or the base by a knock, m and rad. Assumed: wide, so that the views
    /// determine it.
    pub(crate) const TAG_STD: [f64; 2] = [0.03, 0.06];
    pub(crate) const MOUNT_STD: [f64; 2] = [0.02, 0.1];
    pub(crate) const BASE_STD: [f64; 2] = [0.1, 0.1];
    pub(crate) const DRIFT_STD_RAD: f64 = 1.5e-3;
    pub(crate) const LN_PRIOR_OF_DRIFT: f64 = -2.0;
    pub(crate) const LN_PRIOR: f64 = -7.0;
    /// Log prior of a worn spot, lower than that of a slip by two terms: the gain of a tighter height prior, and the
    /// lead over the same sensor. If all views are at one place, the result is a slip.
    pub(crate) const LN_PRIOR_OF_WORN: f64 = -10.5;
    /// Largest number of tags that may have moved together; more cannot be distinguished from a moved base.
    pub(crate) const MOST_TAGS: usize = 12;
}

pub(crate) mod image_noise {
    /// Weight of robot.toml's corner noise, in coordinates.
    pub(crate) const KNOWN_COORDINATES: f64 = 64.0;
    /// Degrees of freedom of a view's own parameters, the camera's pose, which fit the noise.
    pub(crate) const POSE: f64 = 6.0;
    /// Ratio of the scatter of images to the usual noise above which the camera moved.
    pub(crate) const CREEPS: f64 = 2.0;
}

pub(crate) mod member {
    /// Factor per view on the evidence of earlier views.
    pub(crate) const FORGETTING: f64 = 0.98;
    /// Pause that ends the initial views, regardless of their number, s.
    pub(crate) const START_PAUSE_S: f64 = 300.0;
    /// Number of views of a moving arm that make a start without a view at rest.
    pub(crate) const MOVING_FOR_START: usize = 40;
    /// Numbers of views at which the batch of the initial views is repeated, to relinearize views that were linearized
    /// far from the solution.
    pub(crate) const START_AT: [usize; 15] = [1, 2, 3, 4, 6, 8, 12, 17, 24, 34, 48, 68, 96, 136, 192];
    /// Number of these batches if sensors drift, because the batch has no drift.
    pub(crate) const N_STARTS_OF_DRIFTING: usize = 9;
}

pub(crate) mod process_noise {
    /// Prior std of `ln` of a variance's factor: a standard deviation may be wrong by a factor of two.
    pub(crate) const LN_STD: f64 = 1.4;
    /// Bound on `ln` of a factor: this many prior sigmas.
    pub(crate) const LN_BOUND: f64 = 3.0 * LN_STD;
    /// Initial share of temperature and pressure effects by which a sensor lags. Assumed.
    pub(crate) const BEHIND_SHARE: f64 = 0.12;
    /// Factor per view on the information of earlier views, because noise may change within a day.
    pub(crate) const FORGETTING: f64 = 0.99;
    /// Weight of the initial std of a joint's error between views, in views.
    pub(crate) const ERROR_PRIOR_VIEWS: f64 = 12.0;
    /// Least std of a joint's error as a share of the initial one.
    pub(crate) const LEAST_OF_FIRST: f64 = 0.1;
}

pub(crate) mod settings {
    /// Factor on an effect's datasheet std, because the datasheet may be wrong.
    pub(crate) const WRONG_BY: f64 = 1.5;
}

pub(crate) mod view_stream {
    use crate::views::constants::conditions::{BACK_S, NEAR_S};

    /// Deviation beyond the noise from which on a joint moves, rad.
    pub(crate) const REST_RAD: f64 = 0.003;
    /// Time after a motion before the arm counts as at rest, s.
    pub(crate) const SETTLE_S: f64 = 0.5;
    /// Least remaining length of a rest, s.
    pub(crate) const SHORTEST_REST_S: f64 = 0.5;
    /// Time after which a rest becomes a view at the latest, s.
    pub(crate) const LONGEST_REST_S: f64 = 20.0;
    /// Angle between a tag's corners in the first and the last image of a span above which the arm did not rest, rad.
    pub(crate) const MOVES_RAD: f64 = 0.02;
    /// Largest delay of a mark after the span that it marks, s.
    pub(crate) const MARK_DELAY_S: f64 = 2.0;
    /// Time before and after an image within which readings make a view of a moving arm, s.
    pub(crate) const ABOUT_IMAGE_S: f64 = 0.06;
    /// Least motion of some joint between two views of a moving arm, rad.
    pub(crate) const APART_RAD: f64 = 0.15;
    /// Joint rate below which an arm rests, rad/s.
    pub(crate) const SLOWEST_RAD_S: f64 = 0.02;
    /// Largest number of images that wait for readings; without readings none becomes a view.
    pub(crate) const WAITING_IMAGES: usize = 1000;
    /// Largest number of messages kept, regardless of their rate.
    pub(crate) const WINDOW_MESSAGES: usize = 100_000;
    /// Length of the history that is kept, s: a rest, with the readings before it.
    pub(crate) const WINDOW_S: f64 = LONGEST_REST_S + BACK_S + NEAR_S + 10.0;
}
