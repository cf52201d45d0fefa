//! Constants that decide something in `plan`: unit, source and effect of each, by the file that uses it.

pub(crate) mod bounds_ensemble {
    /// Arms drawn: the 99 % quantile is the tenth largest, exceeded with a probability of 1 % give or take 0.3 %.
    pub(crate) const N_ARMS: usize = 1000;
    /// Drawn from an estimate's normal density, to pick those arms from that the datasheet allows.
    pub(crate) const N_PROPOSED: usize = 8000;
    /// An estimate may come to lie a little beyond the datasheet's bounds before the arm does.
    pub(crate) const BOUNDS_EASE: f64 = 1.02;
}

pub(crate) mod bounds_estimate_bounds {
    /// Multiple of one sigma that is kept clear for.
    pub(crate) const SIGMAS: f64 = 4.0;
    /// Places over the range at which the envelope is fitted.
    pub(crate) const PLACES: usize = 41;
    /// A settled arm stands within this of its set-point by its own readings, rad.
    pub(crate) const AT_REST_RAD: f64 = 0.0016;
}

pub(crate) mod bounds_joint_bounds {
    /// The same for what temperature and time do to it afterwards.
    pub(crate) const AGE_SIGMAS: f64 = 3.0;
}

pub(crate) mod capture_plan {
    /// Joint step between the samples of a believed arm's path, rad: a link's end 2 m away moves 2 cm.
    pub(crate) const SAMPLE_RAD: f64 = 0.01;
    /// Proven clearances are known to this, m.
    pub(crate) const PROVEN_TO_M: f64 = 0.002;
}

pub(crate) mod certify_error_box {
    /// Regions that may be looked at for one pair of one stretch; then it counts as too near.
    pub(crate) const MAX_REGIONS: usize = 4000;
}

pub(crate) mod certify_sweep {
    /// Where shapes can move less than this and are still not certified, they count as too near, m.
    pub(crate) const FINEST_M: f64 = 0.006;
    /// The same where only the stretch of the edge is left to halve.
    pub(crate) const FINEST_ALONG_M: f64 = 0.001;
    /// Stretches that move a shape farther than this to either side are halved without a closer look, m.
    pub(crate) const LONG_STRETCH_M: f64 = 0.8;
    /// Stretches that are looked at from the coarse to the fine; from then on each is finished before the next.
    pub(crate) const BREADTH: usize = 64;
    /// Stretches of an edge that may be looked at; then it counts as too near.
    pub(crate) const MAX_STRETCHES: usize = 4000;
}

pub(crate) mod clearance_model {
    /// Distances beyond this are all the same to planning, m.
    pub(crate) const FAR_M: f64 = 0.4;
    /// Shapes that touch are never clear, whatever is asked for, m.
    pub(crate) const TOUCHING_M: f64 = 1e-6;
    /// Links of one arm neither sway against each other nor are surveyed: they need less water than the vehicle does.
    pub const SELF_MARGIN_REDUCTION_M: f64 = 0.03;
    /// A tool whose boxes stay this near to the axis that it turns about counts as round, m.
    pub(crate) const ROUND_TOOL_M: f64 = 0.07;
    /// Of the vehicle's position and attitude.
    pub(crate) const SWAY_SIGMAS: f64 = 3.0;
}

pub(crate) mod clearance_self_collision {
    /// Links that were never nearer than this are left out of the list, m: more than a margin asks for, and
    /// [`UNSEEN_M`].
    pub(crate) const NEAR_M: f64 = 0.2;
    /// What random configurations may have missed, m: links that were never nearer than a distance are taken to keep it
    /// less this.
    pub(crate) const UNSEEN_M: f64 = 0.05;
    /// Share of the configurations from which links that are near each other there are taken to be so by design, or by
    /// hulls that are larger than the links. The rule of MoveIt's setup assistant.
    pub(crate) const NEARLY_ALWAYS: f64 = 0.95;
}

pub(crate) mod clearance_shapes {
    /// Bodies nearer along the chain than this share a joint or a short link and always nearly touch.
    pub(crate) const MIN_BODY_GAP: usize = 2;
    /// Larger than any site, m.
    pub(crate) const EVERYWHERE_M: f64 = 1e6;
}

pub(crate) mod clearance_sight {
    /// The camera's own housing surrounds the start of the ray.
    pub(crate) const HOUSING_M: f64 = 0.08;
    /// A ray that passes a shape's box or sphere by more than this does not meet the shape, however its distance is
    /// rounded.
    pub(crate) const MISS_M: f64 = 1e-3;
    /// A ray that comes along an axis of a box by less than this share of its way passes it.
    pub(crate) const BESIDE: f64 = 1e-9;
}

pub(crate) mod file {
    /// Digits of the file: a millionth of a radian is a few micrometres at the tool.
    pub(crate) const RAD_DIGITS: f64 = 1e6;
    pub(crate) const COUNT_DIGITS: f64 = 1e3;
    pub(crate) const LENGTH_DIGITS: f64 = 1e5;
    pub(crate) const TIME_DIGITS: f64 = 1e3;
}

pub(crate) mod motion_edge {
    /// How much longer than needed an edge may take: what the joints stray by goes with their rates, so that a slower
    /// arm keeps clear where a quick one would not.
    pub(crate) const SLOWNESS: [f64; 5] = [1.0, 1.4, 2.0, 2.8, 4.0];
    /// The largest of them.
    pub(crate) const SLOWEST: f64 = {
        let [.., slowest] = SLOWNESS;
        slowest
    };
}

pub(crate) mod motion_timing {
    /// Share of rates and flow that set-points use; the rest is left to the controller.
    pub(crate) const RATE_SHARE: f64 = 0.7;
    /// How long an arm takes to come to rest after a path, s: 0.84 in the median and 1.14 in the 90 % quantile of a
    /// simulated arm's 58 rests, assumed for others.
    pub(crate) const SETTLE_S: f64 = 1.0;
    /// Largest rate of the cubic over its mean.
    pub(crate) const CUBIC_PEAK: f64 = 1.5;
    pub(crate) const S_PER_MIN: f64 = 60.0;
}

pub(crate) mod motion_tracking_error {
    /// Of the overshoot, the share by which a joint may be behind instead where its edge ends.
    pub(crate) const BEHIND: f64 = 0.25;
}

pub(crate) mod path_planner {
    /// Halvings of the straight way when an error names the nearest that works.
    pub(crate) const HALVINGS: u32 = 8;
    /// Places on the straight way where an error looks for what is nearest.
    pub(crate) const PLACES: u32 = 20;
    /// Angles this near a limit are within it, rad.
    pub(crate) const ROUNDING_RAD: f64 = 1e-9;
}

pub(crate) mod path_rrt_connect {
    /// Longest step by which a tree grows: of a joint that moves the arm's farthest point most, rad.
    pub(crate) const STEP_RAD: f64 = 0.5;
    /// Joints with short levers count for no less than this share of those with the longest.
    pub(crate) const LEAST_WEIGHT: f64 = 0.25;
    /// Samples about the straight way are off it by this at most, rad.
    pub(crate) const ABOUT_RAD: f64 = 0.8;
    /// Regions that a search may look at, and shortcuts after it: about 2 us each.
    pub(crate) const MAX_REGIONS: usize = 120_000;
    /// Samples that a search may try: each costs at least one region, and trees are searched one node after the other.
    pub(crate) const MAX_SAMPLES: usize = 4_000;
    pub(crate) const SHORTCUT_REGIONS: usize = 4_000;
    pub(crate) const MAX_SHORTCUTS: usize = 40;
    /// A shortcut that saves less than this share of the path's time is not worth looking at.
    pub(crate) const LEAST_GAIN: f64 = 0.02;
}

pub(crate) mod scene_check {
    /// Configurations drawn evenly, and camera poses drawn for each tag, in search of one that sees it.
    pub(crate) const EVEN_DRAWS: usize = 2000;
    pub(crate) const DRAWS_PER_TAG: usize = 60;
    /// A tag is drawn on the face that carries it, or just before it: deeper than this it is inside, m.
    pub(crate) const INSIDE_M: f64 = 0.003;
}

pub(crate) mod targets {
    /// Starts of the inverse kinematics beside the preferred ones.
    pub(crate) const RANDOM_SEEDS: usize = 24;
    /// A target of the task that none of those leads to is tried so many times more, from draws of its own.
    pub(crate) const SPARE_TRIES: usize = 8;
    /// Targets are reached to this, m; a joint whose axis passes the tool point as near as this does not move it.
    pub(crate) const IK_TOLERANCE_M: f64 = 1e-6;
}

pub(crate) mod view_planning_camera_ik {
    use armcal_core::numeric::Damping;

    /// Most steps of the inverse kinematics of the camera.
    pub(crate) const STEPS: usize = 12;
    /// Longest step of a joint, rad.
    pub(crate) const MAX_STEP_RAD: f64 = 0.4;
    /// Nearer and farther from a tag than this there is little to gain: corners leave the image, or are coarse.
    /// Assumed.
    pub(crate) const RANGES_M: [f64; 2] = [0.35, 1.5];
    /// Largest angle between the optical axis and the tag, rad.
    pub(crate) const BESIDE_RAD: f64 = 0.6;
    /// Added to the normal matrix, m^2/rad^2.
    pub(crate) const DAMPING: Damping =
        Damping { first: 1e-2, min: 1e-6, max: f64::INFINITY, down: 0.3, up: 8.0, min_after_rejection: 0.0 };
}

pub(crate) mod view_planning_candidates {
    /// More tags in view are counted as so many.
    pub(crate) const MOST_TAGS: usize = 31;
    pub(crate) const MAX_DRAWS: usize = 200_000;
    /// Poses that see enough and are not clear; then it is not for want of tags.
    pub(crate) const MAX_BLOCKED: usize = 20_000;
    /// Regions that all certificates may look at: under a belief that is wide, one pose may take thousands.
    pub(crate) const MAX_REGIONS: usize = 5_000_000;
    /// Capture poses keep their tool this far from every target, m.
    pub(crate) const TARGET_DISTANCE_M: f64 = 0.15;
    /// Nothing this near (largest joint difference) to a pose that failed is tried again, rad.
    pub(crate) const FAILED_RADIUS_RAD: f64 = 0.1;
    /// Smallest and largest of the boxes around the start, shares of the joint ranges.
    pub(crate) const BOX_SHARES: [f64; 2] = [0.03, 0.6];
    /// Arms that stand for the belief.
    pub(crate) const N_ARMS: usize = 16;
    /// Square root of 2 and its like for 8 dimensions: the positive root of x^9 = x + 1 (Roberts 2018, the R sequence).
    pub(crate) const R8: f64 = 1.085_070_245_491_45;
}

pub(crate) mod view_planning_criterion {
    use armcal_core::streams::MAX_JOINTS;

    /// Gains and offsets of the joints before the camera.
    pub(crate) const MAX_LINEAR: usize = 2 * MAX_JOINTS;
}

pub(crate) mod view_planning_forecast {
    /// What the joints at the edges of their reachable ranges count beside the task. Assumed: little, so that the task
    /// decides.
    pub(crate) const EDGE_SHARE: f64 = 0.3;
    /// Quantiles of the reachable angles that count as edges.
    pub(crate) const EDGES: [f64; 2] = [0.01, 0.99];
    /// Least standard deviation of what is said to be exact.
    pub(crate) const MIN_STD: f64 = 1e-6;
}

pub(crate) mod view_planning_parameter_prior {
    use armcal_core::sensor::N_SHAPE;

    /// Camera mount and survey.
    pub(crate) const N_COMMON: usize = 12;
    /// One sigma of what nobody knows at all: m and rad. Assumed; larger than any arm's site.
    pub(crate) const UNKNOWN_STD: f64 = 3.0;
    /// Parameters of one joint: gain, offset, nonlinearity.
    pub(crate) const WIDTH: usize = 2 + N_SHAPE;
}

pub(crate) mod view_planning_pool {
    /// Where tags have to be mapped first, one view in so many shows one whose place is known: the map hangs on that
    /// tag, and is turned about it by as much as its corners leave its direction open.
    pub(crate) const ANCHORED_EVERY: usize = 2;
    /// More candidates than this gain little.
    pub(crate) const CANDIDATES_PER_POSE: usize = 20;
    pub(crate) const MIN_CANDIDATES: usize = 300;
}

pub(crate) mod view_planning_selection {
    /// What the arm's time counts beside the measure.
    pub(crate) const TIME_POWER: f64 = 0.7;
    pub(crate) const MAX_ROUNDS: usize = 3;
    /// An exchange that gains less than this is not made.
    pub(crate) const LEAST_GAIN: f64 = 1e-3;
    /// Candidates that an exchange looks at: those that would gain most on top of all that is picked.
    pub(crate) const SHORTLIST: usize = 120;
    /// Of two stale gains the one that is larger by rounding is not larger.
    pub(crate) const ROUNDING: f64 = 1e-12;
}

pub(crate) mod view_planning_view_information {
    /// Images a second of a detector. Assumed: slow ones read as many.
    pub(crate) const FRAMES_PER_S: f64 = 5.0;
    /// Range at which robot.toml's corner noise is meant, facing the tag, m.
    pub(crate) const REFERENCE_RANGE_M: f64 = 1.0;
    /// Of each tag's own survey error, the share that counts as noise of a view when views are ranked: the rest is
    /// known as soon as a few views have tied the tags together. Assumed; the forecast has each tag by itself.
    pub(crate) const OWN_SURVEY_SHARE: f64 = 0.35;
}

pub(crate) mod view_planning_visit_order {
    /// Most sweeps of exchanges over the order of visits.
    pub(crate) const MAX_SWEEPS: usize = 30;
    /// Gains below this are rounding, s.
    pub(crate) const LEAST_GAIN_S: f64 = 1e-9;
}

pub(crate) mod visibility {
    /// Left out before a tag's corner, where its own plate is, m.
    pub(crate) const SIGHT_END_M: f64 = 0.01;
    /// Nearest and farthest tags that are read, m. A 0.15 m tag 2 m away spans 29 px: below that corners suffer.
    pub(crate) const RANGE_M: [f64; 2] = [0.25, 2.0];
    /// Between a tag's normal and the line to the camera, rad. Beyond 65 deg it is foreshortened to 0.4.
    pub(crate) const MAX_INCIDENCE_RAD: f64 = 1.13;
    /// Kept free at the edge of the lens's field of view, rad, and at the border of the image, px. Assumed.
    pub(crate) const EDGE_RAD: f64 = 0.1;
    pub(crate) const BORDER_PX: f64 = 12.0;
}
