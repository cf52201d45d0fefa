//! Constants that decide something in `follow`: unit, source and effect of each, by the file that uses it.

pub(crate) mod belief_log {
    /// Between two lines of the belief, s of the arm's time.
    pub(crate) const EVERY_S: f64 = 60.0;
}

pub(crate) mod branch {
    /// What a view costs an explanation under which none of its observations belongs, per observation; that of a
    /// rejected one.
    pub(crate) const NOTHING_FITS_NATS: f64 = 30.0;
    /// A view that makes one explanation more probable than another by this speaks for it, nats.
    pub(crate) const SPEAKS_NATS: f64 = 1.0;
    /// A scale this close to the datasheet's is the drift of a sensor, not another sensor.
    pub(crate) const LEAST_SCALE: f64 = 0.2;
    /// A lower bump is the nonlinearity of a sound sensor, rad: 0.15 deg.
    pub(crate) const LEAST_BUMP_RAD: f64 = 2.6e-3;
}

pub(crate) mod diagnosis {
    /// A view is suspicious beyond this quantile of the normal by its cost (one in ten thousand).
    pub(crate) const SUSPICIOUS_Z: f64 = 3.719;
    /// The same of a step of one joint's sensor: looked at more often, for it is one direction among many.
    pub(crate) const SUSPICIOUS_STEP_Z: f64 = 3.3;
    /// What leads by this is taken for true, in nats.
    pub(crate) const LEAD_NATS: f64 = 5.0;
    /// The same over another explanation by the same sensor: which one it is matters more than how it failed.
    pub(crate) const LEAD_OF_SENSOR_NATS: f64 = 1.5;
    /// What one view at rest tells by this is taken for a worn spot, in nats; one in motion, whose readings may be
    /// torn.
    pub(crate) const LONE_LEAD_NATS: f64 = 10.0;
    pub(crate) const LONE_LEAD_IN_MOTION_NATS: f64 = 20.0;
    /// What one view tells of a tag is taken for true where it is not farther from its place than this, m.
    pub(crate) const LONE_TAG_M: f64 = 0.08;
    pub(crate) const LONE_TAG_LEAD_NATS: f64 = 1.5;
    /// A middle of a spot aside must explain more by this, in nats: views of one place fit all that are near.
    pub(crate) const NEARER_NATS: f64 = 1.0;
    /// Explanations followed at most.
    pub(crate) const MAX_BRANCHES: usize = 8;
    /// What is less probable than the best one by this is not followed any more, in nats.
    pub(crate) const HOPELESS_NATS: f64 = 25.0;
    /// Views this close to each other are looked at together, s, and how many of them.
    pub(crate) const RECENT_S: f64 = 60.0;
    pub(crate) const MAX_RECENT: usize = 6;
    /// Views after which the best explanation is taken where it is clear that something happened, where it may have
    /// been drift, where a slip may be a worn spot, and in any case; and those that one needs.
    pub(crate) const MAX_VIEWS_TO_NAME: usize = 2;
    pub(crate) const MAX_VIEWS_OF_DRIFT: usize = 3;
    pub(crate) const MAX_VIEWS_OF_SLIP: usize = 3;
    pub(crate) const MAX_VIEWS: usize = 5;
    /// The same where it may be one joint's sensor that is worn or another's: the next look at tags may tell.
    pub(crate) const MAX_VIEWS_OF_TIE: usize = 20;
    /// Views after the first ones for which all explanations are opened.
    pub(crate) const OPEN_VIEWS: usize = 2;
    /// What a tag that moved with others explains at least, in nats.
    pub(crate) const JOINS_NATS: f64 = 3.0;
    pub(crate) const CONFIRMED_BY: usize = 2;
    /// The same for another scale, whose two numbers explain any two views, and for a sensor that says nothing, which
    /// explains any.
    pub(crate) const OPEN_SENSOR_CONFIRMED_BY: usize = 3;
}

pub(crate) mod estimator {
    /// Lags of the sensors' temperature behind the oil's, s. Assumed: from none to a housing full of oil. Views hardly
    /// tell neighbours apart, and each costs as much as the first.
    pub(crate) const LAGS_S: [f64; 4] = [0.0, 200.0, 600.0, 1800.0];
    /// A lag has a belief of its own once its temperature was this far from the oil's in a view, K: before that the
    /// belief without any lag is its own, to some thousandths of a degree.
    pub(crate) const APART_K: f64 = 0.25;
    /// A lag whose views are less probable by this is given up, in nats.
    pub(crate) const GIVEN_UP_NATS: f64 = 12.0;
    /// What a belief decided longer ago than this is not told any more where it becomes the best one, ns.
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
    /// An explanation that leads by less than this is told with the next one, in nats (odds of twenty).
    pub(crate) const CLEAR_LEAD_NATS: f64 = 3.0;
}

pub(crate) mod filter {
    /// Steps of a view at most; two are the rule.
    pub(crate) const MAX_STEPS: usize = 8;
    /// A step that would save less than this is not taken any more, in units of the cost (sums of squares in sigmas).
    pub(crate) const LAST_GAIN: f64 = 1e-4;
    /// Where a step does not lower the cost, this share of it is tried next.
    pub(crate) const SHORTER: f64 = 0.3;
    /// Of the place of a tag that nobody surveyed, m and rad: no view of it is used.
    pub(crate) const UNKNOWN_STD: f64 = 100.0;
    /// A step this short ends the search even where the cost does not fall, in the parameters' units.
    pub(crate) const SHORTEST_STEP: f64 = 1e-12;
}

pub(crate) mod follower {
    /// How far ahead the error without any further view is predicted, h.
    pub(crate) const AHEAD_H: f64 = 1.0;
}

pub(crate) mod hindsight {
    /// Views of a span; two spans are kept, so that one to two of them are looked back on.
    pub(crate) const VIEWS_OF_SPAN: usize = 40;
    /// Scores of one place are looked into beyond this, in sigmas.
    pub(crate) const SUSPICIOUS_Z: f64 = 4.0;
    /// And again where their square grew by this.
    pub(crate) const GROWN_BY: f64 = 3.0;
    /// Other explanations are looked at where the spot is more probable than nothing by this, in nats.
    pub(crate) const WORTH_COMPARING_NATS: f64 = 2.0;
    /// Middles of a spot that a view may be of, in widths from where it stands, the nearest first.
    pub(crate) const MIDDLES: [f64; 9] = [0.0, -0.5, 0.5, -1.0, 1.0, -1.5, 1.5, -2.0, 2.0];
    /// One farther away must explain more by this, in squared sigmas: views of one place fit all of them.
    pub(crate) const FARTHER_BY: f64 = 1.0;
    /// Other joints' spots are compared where their own scores are beyond this, in sigmas.
    pub(crate) const COMPARED_Z: f64 = 2.5;
    /// Views of a spot or a tag at least.
    pub(crate) const LEAST_VIEWS: usize = 2;
    /// Scores of a tag's place are looked into beyond this, chi-square of three: by chance once in 15,000.
    pub(crate) const SUSPICIOUS_CHI2: f64 = 22.0;
    /// Other tags are compared from this on, once in 50.
    pub(crate) const COMPARED_CHI2: f64 = 10.0;
    /// One sigma of how far aside a tag is that no view tells alone, m. In a direction of which the views tell less
    /// than this, scores are rounding.
    pub(crate) const A_LITTLE_ASIDE_M: f64 = 0.005;
}

pub(crate) mod hypothesis {
    /// How far a tag, the camera or the base may be knocked aside: one sigma, m and rad. Assumed: wide, the views find
    /// it.
    pub(crate) const TAG_STD: [f64; 2] = [0.03, 0.06];
    pub(crate) const MOUNT_STD: [f64; 2] = [0.02, 0.1];
    pub(crate) const BASE_STD: [f64; 2] = [0.1, 0.1];
    pub(crate) const DRIFT_STD_RAD: f64 = 1.5e-3;
    pub(crate) const LN_PRIOR_OF_DRIFT: f64 = -2.0;
    pub(crate) const LN_PRIOR: f64 = -7.0;
    /// Less than a slip's by what a tighter height makes up for, and by the lead over the same sensor: where all views
    /// are at one place it is a slip.
    pub(crate) const LN_PRIOR_OF_WORN: f64 = -10.5;
    /// Tags that may have moved together; more are not told apart from a moved base.
    pub(crate) const MOST_TAGS: usize = 12;
}

pub(crate) mod image_noise {
    /// Coordinates that robot.toml's figure counts for.
    pub(crate) const KNOWN_COORDINATES: f64 = 64.0;
    /// A view's own parameters, the camera's pose, fit themselves to the noise.
    pub(crate) const POSE: f64 = 6.0;
    /// Images that scatter by more than this many times the usual noise are of a camera that moved.
    pub(crate) const CREEPS: f64 = 2.0;
}

pub(crate) mod member {
    /// Evidence of views of before counts less by this factor a view.
    pub(crate) const FORGETTING: f64 = 0.98;
    /// After a pause this long the first views are over, however many they were, s.
    pub(crate) const START_PAUSE_S: f64 = 300.0;
    /// Views of a moving arm that make a start where no view at rest comes.
    pub(crate) const MOVING_FOR_START: usize = 40;
    /// Numbers of views at which the batch of the first ones is made anew: what was linearized far from the end is
    /// again.
    pub(crate) const START_AT: [usize; 15] = [1, 2, 3, 4, 6, 8, 12, 17, 24, 34, 48, 68, 96, 136, 192];
    /// The first so many where sensors drift: the batch knows nothing of that.
    pub(crate) const N_STARTS_OF_DRIFTING: usize = 9;
}

pub(crate) mod process_noise {
    /// One sigma of `ln` of a variance's factor before any view: a standard deviation may be wrong by two.
    pub(crate) const LN_STD: f64 = 1.4;
    /// A factor stays within its prior's this many sigmas.
    pub(crate) const LN_BOUND: f64 = 3.0 * LN_STD;
    /// The share of temperature and pressure effects that a sensor is behind by, at first. Assumed.
    pub(crate) const BEHIND_SHARE: f64 = 0.12;
    /// Views of before count less by this factor a view: figures may change in a day.
    pub(crate) const FORGETTING: f64 = 0.99;
    /// Information that the first guess of a joint's error from view to view counts for.
    pub(crate) const ERROR_PRIOR_VIEWS: f64 = 12.0;
    /// A joint's error is never less than this share of the first guess.
    pub(crate) const LEAST_OF_FIRST: f64 = 0.1;
}

pub(crate) mod settings {
    /// How much larger an effect may be than its datasheet's figure.
    pub(crate) const WRONG_BY: f64 = 1.5;
}

pub(crate) mod view_stream {
    use crate::views::constants::conditions::{BACK_S, NEAR_S};

    /// A joint that leaves this, beyond what its noise makes of it, moves, rad.
    pub(crate) const REST_RAD: f64 = 0.003;
    /// What comes after a motion before the arm counts as at rest, s.
    pub(crate) const SETTLE_S: f64 = 0.5;
    /// A rest of which less than this is left is none, s.
    pub(crate) const SHORTEST_REST_S: f64 = 0.5;
    /// A rest becomes a view after this at the latest, s.
    pub(crate) const LONGEST_REST_S: f64 = 20.0;
    /// Where the tags are this far apart in the first image and the last of a rest it is none, rad.
    pub(crate) const MOVES_RAD: f64 = 0.02;
    /// A mark may come this much later than the span it marks, s.
    pub(crate) const MARK_DELAY_S: f64 = 2.0;
    /// Readings this far about an image make a view of a moving arm, s.
    pub(crate) const ABOUT_IMAGE_S: f64 = 0.06;
    /// Between two views of a moving arm some joint moves this far at least, rad.
    pub(crate) const APART_RAD: f64 = 0.15;
    /// An arm all of whose joints are slower rests, rad/s.
    pub(crate) const SLOWEST_RAD_S: f64 = 0.02;
    /// Images that wait for readings at most: without any nothing is made of them.
    pub(crate) const WAITING_IMAGES: usize = 1000;
    /// Messages kept at most, whatever their rate.
    pub(crate) const WINDOW_MESSAGES: usize = 100_000;
    /// Length of the past that is kept: a rest, with the readings before it, s.
    pub(crate) const WINDOW_S: f64 = LONGEST_REST_S + BACK_S + NEAR_S + 10.0;
}
