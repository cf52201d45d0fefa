//! Constants that affect results of `session`: unit, source and effect of each, by the file that uses it.

pub(crate) mod annotations {
    use armcal_core::log::ros::Color;

    /// Marker type of a closed line.
    pub(crate) const LINE_LOOP: u8 = 2;
    /// Colour of a detected tag's outline and number; shares of red, green, blue and opacity.
    pub(crate) const OUTLINE: Color = Color { r: 0.1, g: 0.9, b: 0.3, a: 1.0 };
}

pub(crate) mod approval {
    /// Time that a held arm waits before it asks again, s.
    pub(crate) const HOLD_S: f64 = 5.0;
    /// Least joint motion that is displayed to an operator, rad: the displayed digits hide smaller ones.
    pub(crate) const TOLD_RAD: f64 = 5e-4;
}

pub(crate) mod capture {
    /// Number of views after which the first update comes early, because the first few views have the most information.
    pub(crate) const FIRST_RENEWAL: usize = 3;
    /// Number of tries, in addition to the wanted poses, after which a capture ends.
    pub(crate) const SPARE_TRIES: usize = 10;
    /// Number of consecutive poses without settling, or with a contact on the way, that end a capture.
    pub(crate) const MOST_IN_VAIN: usize = 6;
    /// Prior number of detections as predicted that each tag is credited with.
    pub(crate) const TRUST_IN_ADVANCE: f64 = 2.0;
}

pub(crate) mod contact {
    /// Least duration of a deviation for a contact, s: spikes of a worn sensor are shorter.
    pub(crate) const PERSISTS_S: f64 = 0.08;
    /// Largest number of past periods that are checked.
    pub(crate) const MAX_PERIODS: usize = 32;
    /// Multiple of the usual deviation above which a deviation is unusual.
    pub(crate) const UNUSUAL: f64 = 2.5;
    /// Share of the distance at which a joint counts as at its set-point: no smaller deviation is a contact.
    pub(crate) const NO_TOUCH: f64 = 0.5;
    /// Initial usual deviations: lag behind a moving set-point, s, and distance from a resting one, rad.
    pub(crate) const FIRST_LAG_S: f64 = 0.3;
    pub(crate) const FIRST_REST_RAD: f64 = 0.02;
    /// Number of edges by which the initial values are weighted, and number of edges that are remembered.
    pub(crate) const FIRST_WEIGHT: f64 = 2.0;
    pub(crate) const REMEMBERED: f64 = 30.0;
    /// Time constant with which the effect of a set-point's rate decays, s.
    pub(crate) const RATE_MEMORY_S: f64 = 0.4;
    /// Shares of the joint's largest rate: a lag is learnt above the first, an error at rest below the second.
    pub(crate) const MOVING: f64 = 0.15;
    pub(crate) const RESTING: f64 = 0.01;
    /// Multiple of the noise std that a jump of the reading must exceed.
    pub(crate) const NOISE_SIGMAS: f64 = 8.0;
}

pub(crate) mod flow {
    /// Length of the span over which flow is averaged, s.
    pub(crate) const SPAN_S: f64 = 0.5;
    /// Least share of the requested oil flow that a sound arm moves in spite of its lag.
    pub(crate) const SOUND_SHARE: f64 = 0.6;
}

pub(crate) mod following {
    /// Time for which a reading stays the same, while the set-point leaves by `LEFT_RAD`, before it counts as stuck, s.
    pub(crate) const SAME_S: f64 = 0.15;
    pub(crate) const LEFT_RAD: f64 = 0.03;
    /// Time for which a reading stands still after a jump before it counts as dead, s: spikes are shorter.
    pub(crate) const LEAPT_S: f64 = 0.3;
    /// Time for which reading and set-point stand still near each other before the joint counts as at rest, s.
    pub(crate) const REST_S: f64 = 0.3;
    /// Multiple of the noise std, in addition to two counts, within which readings of a joint at rest lie.
    pub(crate) const NOISE_SIGMAS: f64 = 10.0;
    /// Multiple of its largest rate that no joint exceeds.
    pub(crate) const REACHABLE: f64 = 3.0;
    /// Noise below which a sensor may read the same for long, counts. So may one whose reading changed in fewer than
    /// `FLICKERS` periods at rest.
    pub(crate) const NOISY_COUNTS: f64 = 1.0;
    pub(crate) const FLICKERS: u32 = 30;
    /// Number of suspected contacts of a joint that has not moved, after which it is probed.
    pub(crate) const SUSPECTED: u32 = 2;
    /// Set-point travel, rad, and multiple of the noise range, after which a joint that has not moved counts as locked.
    pub(crate) const DECISIVE_RAD: f64 = 0.1;
    pub(crate) const DECISIVE_OVER_NOISE: f64 = 3.0;
    /// Time for which a reading stands still, with its set-point that far away, before it is named as the cause of a
    /// failed capture, s. Assumed: longer than the wait for a rest.
    pub(crate) const LONG_STILL_S: f64 = 20.0;
    /// Least change of a set-point per period that counts as motion, counts.
    pub(crate) const SET_STANDS_COUNTS: f64 = 1e-6;
}

pub(crate) mod grip {
    /// Tolerance of the jaws' opening, m.
    pub(crate) const ARRIVED_M: f64 = 1e-3;
    /// Waiting time in addition to twice the closing time, s.
    pub(crate) const PATIENCE_S: f64 = 2.0;
    /// Tolerance within which commanded jaws count as at rest, m.
    pub(crate) const AS_AT_REST_M: f64 = 1e-6;
}

pub(crate) mod held_joint {
    /// Std of the creep rate of a joint with a shut valve: 1 deg an hour. Assumed.
    pub(crate) const CREEP_RAD_PER_S: f64 = 4.85e-6;
    /// Age after which a located joint is located again where it matters, s.
    pub(crate) const OLD_S: f64 = 1800.0;
}

pub(crate) mod keeping_up {
    /// Number of poses that locate a joint, and suffice for a verdict.
    pub(crate) const LOCATING_POSES: u32 = 14;
}

pub(crate) mod motion {
    /// Ratio of the duration of backing out to that of the same motion forward.
    pub(crate) const BACK_OUT_SLOWNESS: f64 = 2.5;
    /// Time for which the arm must stand to count as settled, s.
    pub(crate) const REST_S: f64 = 0.4;
    /// Interval at which a long wait asks whether to continue, s.
    pub(crate) const WAIT_STRIDE_S: f64 = 600.0;
    pub(crate) const SETTLE_LIMIT_S: f64 = 12.0;
    /// Number of control periods between two records of believed angles and commands.
    pub(crate) const BELIEF_EVERY: u64 = 4;
}

pub(crate) mod reach {
    /// Dwell at a target, s.
    pub(crate) const REACH_DWELL_S: f64 = 0.6;
}

pub(crate) mod scale_identification {
    /// Dwell at each view of an excursion, s.
    pub(crate) const DWELL_S: f64 = 1.0;
    /// Largest relative effect of the sensor's nonlinearity on the slope over a short excursion.
    pub(crate) const LOCAL_SLOPE: f64 = 0.03;
    /// Multiple of the std for which clearance is kept.
    pub(crate) const SIGMAS: f64 = 3.0;
    /// Factor on the size of an excursion that is not clear.
    pub(crate) const SHRINK: f64 = 0.75;
    /// Least share of its wanted size at which an excursion determines a scale.
    pub(crate) const LEAST_SHARE: f64 = 0.1;
}

pub(crate) mod script {
    /// Shares of the clearance, in the order of tries, for a path from a pose that the arm cannot leave with the whole
    /// clearance.
    pub(crate) const START_SHARES: [f64; 3] = [0.5, 0.2, 0.05];
    /// Largest distance of the arm's points from a joint whose link rotates, m.
    pub(crate) const LINK_REACH_M: f64 = 2.0;
}

pub(crate) mod settling {
    /// Largest motion of a smoothed reading beyond its noise at which the arm stands, rad ...
    pub(crate) const STILL_RAD: f64 = 0.0008;
    /// ... within this distance of its set-point (a controller may leave a steady error), rad.
    pub(crate) const NEAR_RAD: f64 = 0.02;
    /// Share of a new reading in the smoothed one: a tenth of a second at 100 Hz.
    pub(crate) const SMOOTHING: f64 = 0.1;
    /// Multiple of a smoothed reading's std that does not count as motion.
    pub(crate) const NOISE_SIGMAS: f64 = 4.0;
}

pub(crate) mod touch {
    /// Largest distance that the tip moves beyond the nominal surface, m.
    pub(crate) const BEYOND_M: f64 = 0.05;
    /// Distance before the nominal surface up to which the usual deviation is learnt, m.
    pub(crate) const LEARNT_BEFORE_M: f64 = 0.035;
    /// Speed of the tip on its way to the surface, and back, m/s.
    pub(crate) const SPEED_M_S: f64 = 0.006;
    pub(crate) const BACK_SPEED_M_S: f64 = 0.02;
    /// Distance between the solved configurations on the way, m.
    pub(crate) const STRIDE_M: f64 = 0.005;
    /// Largest change of a joint over such a stride, rad: a larger one shows that the way has two branches.
    pub(crate) const MAX_STRIDE_RAD: f64 = 0.05;
    /// Clearance of the believed arm on the slow way, m: of the touched part to all but the tip, and of the rest.
    pub(crate) const PART_CLEARANCE_M: f64 = 0.008;
    pub(crate) const REST_CLEARANCE_M: f64 = 0.004;
    /// Number of random starts of the inverse kinematics, in addition to the present configuration.
    pub(crate) const RANDOM_SEEDS: usize = 40;
    /// Time until the pressed arm stands, s.
    pub(crate) const REST_S: f64 = 1.0;
    /// Weight of directions that no touch has determined yet, relative to those that one has.
    pub(crate) const UNTOLD: f64 = 100.0;
    /// Deviation of the tool beyond the usual that counts as held up, m ...
    pub(crate) const HELD_UP_M: f64 = 0.0015;
    /// ... if it exceeds this multiple of the std on the free way ...
    pub(crate) const HELD_UP_SIGMAS: f64 = 6.0;
    /// ... for this long, s.
    pub(crate) const LASTS_S: f64 = 0.1;
    /// Time constant of the smoothing, s.
    pub(crate) const SMOOTHING_S: f64 = 0.1;
}

pub(crate) mod transforms {
    /// Least time between two messages, s: viewers draw no faster.
    pub(crate) const SPACING_S: f64 = 0.1;
    /// Largest time between two messages of a resting arm, s.
    pub(crate) const REST_SPACING_S: f64 = 2.0;
    /// Largest joint change since the last drawing at which an arm is at rest, rad: 1 mm at 2 m.
    pub(crate) const STEP_RAD: f64 = 5e-4;
}
