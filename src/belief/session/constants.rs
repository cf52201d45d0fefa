//! Constants that decide something in `session`: unit, source and effect of each, by the file that uses it.

pub(crate) mod annotations {
    use armcal_core::log::ros::Color;

    /// A closed line.
    pub(crate) const LINE_LOOP: u8 = 2;
    /// Colour of a found tag's outline and number; shares of red, green, blue and opacity.
    pub(crate) const OUTLINE: Color = Color { r: 0.1, g: 0.9, b: 0.3, a: 1.0 };
}

pub(crate) mod approval {
    /// How long a held arm waits before it asks again, s.
    pub(crate) const HOLD_S: f64 = 5.0;
    /// An operator is told of the joints that move by more, rad: less is nothing at the digits that are told.
    pub(crate) const TOLD_RAD: f64 = 5e-4;
}

pub(crate) mod capture {
    /// A second look at the margins comes early: the first few views tell most.
    pub(crate) const FIRST_RENEWAL: usize = 3;
    /// Tries at poses, beside those wanted, after which a capture goes no further.
    pub(crate) const SPARE_TRIES: usize = 10;
    /// So many poses in a row at which the arm did not settle, or met something on its way, end a capture.
    pub(crate) const MOST_IN_VAIN: usize = 6;
    /// Sightings as predicted that a tag is given in advance.
    pub(crate) const TRUST_IN_ADVANCE: f64 = 2.0;
}

pub(crate) mod contact {
    /// A joint must be off for this long: spikes of a worn sensor are shorter, s.
    pub(crate) const PERSISTS_S: f64 = 0.08;
    /// Periods that are looked back at most.
    pub(crate) const MAX_PERIODS: usize = 32;
    /// Multiple of what has been usual that is no longer usual.
    pub(crate) const UNUSUAL: f64 = 2.5;
    /// Share of the distance within which a joint counts as at its set-point that is no touch, whatever has been usual.
    pub(crate) const NO_TOUCH: f64 = 0.5;
    /// What is taken for usual until something has been learnt: seconds behind a moving set-point, and distance from a
    /// resting one.
    pub(crate) const FIRST_LAG_S: f64 = 0.3;
    pub(crate) const FIRST_REST_RAD: f64 = 0.02;
    /// Edges that this first guess weighs as much as, and edges that are remembered.
    pub(crate) const FIRST_WEIGHT: f64 = 2.0;
    pub(crate) const REMEMBERED: f64 = 30.0;
    /// A set-point's rate is still felt for about this long after it has gone down, s.
    pub(crate) const RATE_MEMORY_S: f64 = 0.4;
    /// Shares of the joint's rate above which a lag is learnt, and below which an error at rest is.
    pub(crate) const MOVING: f64 = 0.15;
    pub(crate) const RESTING: f64 = 0.01;
    /// Nor do they by noise, standard deviations.
    pub(crate) const NOISE_SIGMAS: f64 = 8.0;
}

pub(crate) mod flow {
    /// Flow is that of a span of so long, s.
    pub(crate) const SPAN_S: f64 = 0.5;
    /// A sound arm lags, and yet moves most of the oil that it is asked to move.
    pub(crate) const SOUND_SHARE: f64 = 0.6;
}

pub(crate) mod following {
    /// A word that is the same for this long, while the set-point leaves by `LEFT_RAD`, is stuck, s.
    pub(crate) const SAME_S: f64 = 0.15;
    pub(crate) const LEFT_RAD: f64 = 0.03;
    /// A word that leapt and stood still for so long is dead: spikes are shorter, s.
    pub(crate) const LEAPT_S: f64 = 0.3;
    /// A joint has been at rest when reading and set-point stood still, near each other, for so long, s.
    pub(crate) const REST_S: f64 = 0.3;
    /// Readings of a joint at rest lie within so many standard deviations of the noise, and two counts.
    pub(crate) const NOISE_SIGMAS: f64 = 10.0;
    /// No joint turns faster than this many times its rate.
    pub(crate) const REACHABLE: f64 = 3.0;
    /// A sensor with less noise may read the same for long, counts; as may one whose word did not flicker for so many
    /// periods at rest.
    pub(crate) const NOISY_COUNTS: f64 = 1.0;
    pub(crate) const FLICKERS: u32 = 30;
    /// Suspected contacts of a joint that has not moved, after which it is probed.
    pub(crate) const SUSPECTED: u32 = 2;
    /// A joint that has not moved while its set-point went so far, rad, and so many times as far as noise does, is
    /// locked.
    pub(crate) const DECISIVE_RAD: f64 = 0.1;
    pub(crate) const DECISIVE_OVER_NOISE: f64 = 3.0;
    /// A set-point that changes by less in a period stands, counts.
    pub(crate) const SET_STANDS_COUNTS: f64 = 1e-6;
}

pub(crate) mod grip {
    /// The jaws are where they were told within this, m.
    pub(crate) const ARRIVED_M: f64 = 1e-3;
    /// Waited beyond twice the closing time, s.
    pub(crate) const PATIENCE_S: f64 = 2.0;
    /// Jaws that are told less than this beyond rest are at rest, m.
    pub(crate) const AS_AT_REST_M: f64 = 1e-6;
}

pub(crate) mod held_joint {
    /// How far a joint may creep while its valve is shut, one sigma: 1 deg an hour. Assumed.
    pub(crate) const CREEP_RAD_PER_S: f64 = 4.85e-6;
    /// Where a joint was found this long ago is looked for again where it matters, s.
    pub(crate) const OLD_S: f64 = 1800.0;
}

pub(crate) mod keeping_up {
    /// Poses that tell where a joint stands, and enough for a verdict.
    pub(crate) const LOCATING_POSES: u32 = 14;
}

pub(crate) mod motion {
    /// Backing out takes so many times as long as coming did.
    pub(crate) const BACK_OUT_SLOWNESS: f64 = 2.5;
    /// The arm counts as settled when it has stood for this long, s.
    pub(crate) const REST_S: f64 = 0.4;
    /// A long wait is asked at this distance whether it shall go on, s.
    pub(crate) const WAIT_STRIDE_S: f64 = 600.0;
    pub(crate) const SETTLE_LIMIT_S: f64 = 12.0;
    /// Believed angles and commands are recorded each so many control periods.
    pub(crate) const BELIEF_EVERY: u64 = 4;
}

pub(crate) mod reach {
    /// How long the arm is watched at a target, s.
    pub(crate) const REACH_DWELL_S: f64 = 0.6;
}

pub(crate) mod scale_identification {
    /// How long each view of an excursion is watched, s.
    pub(crate) const DWELL_S: f64 = 1.0;
    /// What the sensor's nonlinearity may bend the slope by over a short excursion, relative.
    pub(crate) const LOCAL_SLOPE: f64 = 0.03;
    /// Multiple of one sigma that is kept clear for.
    pub(crate) const SIGMAS: f64 = 3.0;
    /// An excursion that is not clear is tried again at this share of its size.
    pub(crate) const SHRINK: f64 = 0.75;
    /// An excursion of no more than this share of its wanted size tells no scale.
    pub(crate) const LEAST_SHARE: f64 = 0.1;
}

pub(crate) mod script {
    /// Shares of the clearance that are tried in this order for a path from a place that the whole of it does not let
    /// the arm leave.
    pub(crate) const START_SHARES: [f64; 3] = [0.5, 0.2, 0.05];
    /// How far from a joint the arm may be that its link's turn moves, m.
    pub(crate) const LINK_REACH_M: f64 = 2.0;
}

pub(crate) mod settling {
    /// No sensor, smoothed, has moved by more than this, rad, and by what its own noise leaves of it ...
    pub(crate) const STILL_RAD: f64 = 0.0008;
    /// ... while it was this near to its set-point (a controller may leave a steady error), rad.
    pub(crate) const NEAR_RAD: f64 = 0.02;
    /// Share of a new reading in the smoothed one: a tenth of a second at 100 Hz.
    pub(crate) const SMOOTHING: f64 = 0.1;
    /// Multiple of a smoothed reading's own deviation that is no motion.
    pub(crate) const NOISE_SIGMAS: f64 = 4.0;
}

pub(crate) mod touch {
    /// The tip goes on behind the drawn surface by at most this much, m.
    pub(crate) const BEYOND_M: f64 = 0.05;
    /// What is usual is learnt up to here before the drawn surface, m.
    pub(crate) const LEARNT_BEFORE_M: f64 = 0.035;
    /// Of the tip on its way to the surface, and back, m/s.
    pub(crate) const SPEED_M_S: f64 = 0.006;
    pub(crate) const BACK_SPEED_M_S: f64 = 0.02;
    /// Distance of the configurations that are solved for on the way, m.
    pub(crate) const STRIDE_M: f64 = 0.005;
    /// Largest change of a joint over such a stride, rad: else the way has two branches.
    pub(crate) const MAX_STRIDE_RAD: f64 = 0.05;
    /// What the believed arm keeps clear on the slow way, m: of the touched part with all but its tip, and of the rest.
    pub(crate) const PART_CLEARANCE_M: f64 = 0.008;
    pub(crate) const REST_CLEARANCE_M: f64 = 0.004;
    /// Starts of the inverse kinematics beside where the arm is.
    pub(crate) const RANDOM_SEEDS: usize = 40;
    /// Until the pressed arm stands, s.
    pub(crate) const REST_S: f64 = 1.0;
    /// Weight of directions that no touch has told yet over those that one has.
    pub(crate) const UNTOLD: f64 = 100.0;
    /// A tool this far behind what is usual has been held up, m ...
    pub(crate) const HELD_UP_M: f64 = 0.0015;
    /// ... if it is more than so many standard deviations of the free way ...
    pub(crate) const HELD_UP_SIGMAS: f64 = 6.0;
    /// ... for this long, s.
    pub(crate) const LASTS_S: f64 = 0.1;
    /// Of the smoothing, s.
    pub(crate) const SMOOTHING_S: f64 = 0.1;
}

pub(crate) mod transforms {
    /// Least time between two messages, s: viewers draw no more.
    pub(crate) const SPACING_S: f64 = 0.1;
    /// Most time between two of a resting arm, s.
    pub(crate) const REST_SPACING_S: f64 = 2.0;
    /// An arm of which no joint left its drawn angle by more is at rest, rad: 1 mm at 2 m.
    pub(crate) const STEP_RAD: f64 = 5e-4;
}
