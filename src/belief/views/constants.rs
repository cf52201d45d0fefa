//! Constants that decide something in `views`: unit, source and effect of each, by the file that uses it.

pub(crate) mod association {
    /// Corners that fit a square worse than this are no tag: three times the worst that the lens prior allows.
    pub(crate) const MAX_SQUARE_RMS_PX: f64 = 3.0;
}

pub(crate) mod conditions {
    /// A reading farther from a span than this says nothing of it, s.
    pub(crate) const NEAR_S: f64 = 60.0;
    /// How far back a joint's last motion is looked for, s.
    pub(crate) const BACK_S: f64 = 30.0;
    /// A reading that is this many sigma of its noise from where the joint rests was taken before it came there, or
    /// since it left.
    pub(crate) const CLEAR_SIGMAS: f64 = 8.0;
    /// Readings in a row that must agree: one alone may be a jump of the sensor.
    pub(crate) const CLEAR_READINGS: usize = 2;
    /// One sigma of rounding to whole counts.
    pub(crate) const ROUNDING_COUNTS: f64 = 0.288_675;
    /// Fewer readings tell no rate.
    pub(crate) const MIN_READINGS_OF_RATE: usize = 3;
}

pub(crate) mod data_checks {
    /// Readings of two joints this near to one straight line, as a share of what they span, are of one sensor, and so
    /// many views show it. Assumed: rounding of a conversion is far below, noise of a sensor above.
    pub(crate) const ALIKE_SHARE: f64 = 1e-7;
    pub(crate) const MIN_ALIKE_VIEWS: usize = 5;
    /// The largest share of messages with numbers that are not finite. Assumed: a sensor that fails now and then still
    /// serves.
    pub(crate) const MAX_NOT_FINITE_SHARE: f64 = 0.01;
    /// Views count as of one pose where no joint moved by more than this many sigma of its noise. Assumed.
    pub(crate) const MOVED_SIGMAS: f64 = 6.0;
}

pub(crate) mod dropouts {
    /// A joint at rest is nowhere farther from its median, rad: vehicles rock an arm by a tenth of it.
    pub(crate) const AT_REST_RAD: f64 = 0.05;
}

pub(crate) mod external_board {
    /// Corners farther than this many sigma from where the others have them are another corner, or a shadow.
    pub(crate) const FAR_SIGMAS: f64 = 6.0;
    /// A sigma by the median of absolute values.
    pub(crate) const SIGMA_OF_MEDIAN: f64 = 1.4826;
    /// The share of a board's corners that may be left out.
    pub(crate) const MAX_LEFT_OUT: f64 = 0.25;
}

pub(crate) mod external_landmarks {
    /// Closer than this is never left out, m: what positions from tags are good for at best. Assumed.
    pub(crate) const NEVER_APART_M: f64 = 2e-3;
}

pub(crate) mod motion {
    /// Steps between readings, s: over them a parabola follows the swings of common arms to 0.001 deg. Assumed.
    pub(crate) const STEP_S: f64 = 0.05;
    /// Steps before and after a view: four sigmas of the offset between two clocks.
    pub(crate) const N_STEPS: usize = 4;
}

pub(crate) mod external_pairing {
    /// Readings this close to each other are a continuous stream, s. Assumed.
    pub(crate) const CONTINUOUS_WITHIN_S: f64 = 0.25;
    /// Rates are measured over this on either side, s: long against the noise of readings, short against a motion.
    /// Assumed.
    pub(crate) const RATE_WINDOW_S: f64 = 0.1;
}

pub(crate) mod external_views {
    /// Readings within this many sigma of each other are of one pose. Assumed.
    pub(crate) const SAME_POSE_SIGMAS: f64 = 5.0;
    /// Faster than this, beyond what noise makes of it, is on the way, rad/s: at a reach of 2 m and a camera clock 50
    /// ms late, 1 mm.
    pub(crate) const REST_RATE_RAD_S: f64 = 0.01;
    /// An attitude farther from a view than this says nothing of it, s: a vehicle leans another way within seconds.
    pub(crate) const ATTITUDE_WITHIN_S: f64 = 0.5;
    /// Attitudes whose mean is shorter contradict each other.
    pub(crate) const MIN_MEAN_UP: f64 = 0.5;
    /// Noise of a rate that counts as none, sigma.
    pub(crate) const RATE_SIGMAS: f64 = 5.0;
}

pub(crate) mod frame_consensus {
    /// Frames farther apart than this many sigma of a corner are looked at more closely.
    pub(crate) const CLOSE_SIGMAS: f64 = 10.0;
    /// The same in units of the usual distance between one frame and the next nearest, where that is more.
    pub(crate) const USUAL_DISTANCES: f64 = 6.0;
    /// However noisy the corners are: farther apart than this many sigma is elsewhere. Tags do not stand that close to
    /// each other.
    pub(crate) const ELSEWHERE_SIGMAS: f64 = 100.0;
}

pub(crate) mod pooling {
    /// Poses of one recording are numbered below this.
    pub(crate) const POSES_PER_RECORDING: u32 = 1_000_000;
}

pub(crate) mod scale_identification {
    use armcal_core::numeric::{Damping, StopRule};

    /// Fewer views have no residuals to speak of.
    pub(crate) const MIN_VIEWS: usize = 3;
    /// A slope less sure than this times its own size says nothing.
    pub(crate) const MAX_RELATIVE_STD: f64 = 0.2;
    /// What a camera mount and tags that are not quite where the drawing has them bend the slope by, relative.
    pub(crate) const DRAWING_STD: f64 = 1e-3;
    /// A camera's turn is not known better than this from corners a third of a pixel off, rad.
    pub(crate) const TURN_FLOOR_RAD: f64 = 3e-4;
    /// Readings whose squared departures from their mean sum up to less never changed, rad^2.
    pub(crate) const CONSTANT_RAD2: f64 = 1e-12;
    /// Undamped: the start is a tag's own pose, near enough for Gauss-Newton, and twelve steps end in the last digits.
    pub(crate) const DAMPING: Damping =
        Damping { first: 0.0, min: 0.0, max: 0.0, down: 0.0, up: 0.0, min_after_rejection: 0.0 };
    pub(crate) const STOP: StopRule = StopRule { slack: f64::INFINITY, ..StopRule::after(12) };
}

pub(crate) mod view {
    /// In a faster arm the readings about an image are too far apart for a line through them, and to be told from
    /// drop-outs, rad/s.
    pub(crate) const FASTEST_RAD_S: f64 = 0.5;
}
