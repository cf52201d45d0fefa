//! Constants that affect results of `plan`: unit, source and effect of each, by the file that uses it.

pub(crate) mod bounds_ensemble {
    /// Number of sampled arms: the 99 % quantile is the tenth largest, exceeded with a probability of 1 % ± 0.3 %.
    pub(crate) const N_ARMS: usize = 1000;
    /// Number of draws from an estimate's normal density, from which the datasheet's bounds then select those arms.
    pub(crate) const N_PROPOSED: usize = 8000;
    /// Factor on the datasheet's bounds: an estimate may exceed them slightly before the arm does.
    pub(crate) const BOUNDS_EASE: f64 = 1.02;
}

pub(crate) mod bounds_estimate_bounds {
    /// Multiple of the std for which clearance is kept.
    pub(crate) const SIGMAS: f64 = 4.0;
    /// Number of travel values over the range at which the envelope is fitted.
    pub(crate) const PLACES: usize = 41;
    /// Largest difference of a settled arm from its set-point by its own readings, rad.
    pub(crate) const AT_REST_RAD: f64 = 0.0016;
}

pub(crate) mod bounds_joint_bounds {
    /// Multiple of the std for the effects of temperature and time afterwards.
    pub(crate) const AGE_SIGMAS: f64 = 3.0;
}

pub(crate) mod capture_plan {
    /// Joint step between the samples of a believed arm's path, rad: a link's end 2 m away moves 2 cm.
    pub(crate) const SAMPLE_RAD: f64 = 0.01;
    /// Resolution of certified clearances, m.
    pub(crate) const PROVEN_TO_M: f64 = 0.002;
}

pub(crate) mod certify_error_box {
    /// Largest number of regions tested for one pair of one stretch; then it counts as too near.
    pub(crate) const MAX_REGIONS: usize = 4000;
}

pub(crate) mod certify_sweep {
    /// Least motion of shapes in a region, m; shapes that can move less and are still not certified count as too near.
    pub(crate) const FINEST_M: f64 = 0.006;
    /// Least motion of shapes, m, if only the stretch of the edge is left to halve.
    pub(crate) const FINEST_ALONG_M: f64 = 0.001;
    /// Motion of a shape to either side, m, above which a stretch is halved without a closer test.
    pub(crate) const LONG_STRETCH_M: f64 = 0.8;
    /// Number of stretches tested from coarse to fine; from then on each is finished before the next.
    pub(crate) const BREADTH: usize = 64;
    /// Largest number of tested stretches of an edge; then it counts as too near.
    pub(crate) const MAX_STRETCHES: usize = 4000;
}

pub(crate) mod clearance_model {
    /// Cut-off of distances, m: planning does not distinguish larger ones.
    pub(crate) const FAR_M: f64 = 0.4;
    /// Least clearance, m: shapes that touch are never clear, regardless of the margin.
    pub(crate) const TOUCHING_M: f64 = 1e-6;
    /// Reduction of the margin between two links, m: links of one arm neither sway against each other nor are surveyed.
    pub const SELF_MARGIN_REDUCTION_M: f64 = 0.03;
    /// Largest distance of a tool's boxes from its axis of rotation at which it counts as round, m.
    pub(crate) const ROUND_TOOL_M: f64 = 0.07;
    /// Multiple of the std of the vehicle's position and attitude.
    pub(crate) const SWAY_SIGMAS: f64 = 3.0;
}

pub(crate) mod clearance_self_collision {
    /// Distance above which links are left out of the list, m: more than a margin requires plus [`UNSEEN_M`].
    pub(crate) const NEAR_M: f64 = 0.2;
    /// Distance that random configurations may have missed, m: links are assumed to stay as far apart as the least
    /// sampled distance less this.
    pub(crate) const UNSEEN_M: f64 = 0.05;
    /// Share of the configurations above which two near links count as near by design, or because hulls exceed the
    /// links. The rule of MoveIt's setup assistant.
    pub(crate) const NEARLY_ALWAYS: f64 = 0.95;
}

pub(crate) mod clearance_shapes {
    /// Least number of joints between tested bodies: nearer ones share a joint or a short link and always nearly touch.
    pub(crate) const MIN_BODY_GAP: usize = 2;
    /// A length larger than any site, m.
    pub(crate) const EVERYWHERE_M: f64 = 1e6;
}

pub(crate) mod clearance_sight {
    /// Length skipped at the start of the ray, m: the camera's own housing surrounds it.
    pub(crate) const HOUSING_M: f64 = 0.08;
    /// Distance by which a ray must pass a shape's box or sphere to miss the shape despite rounding, m.
    pub(crate) const MISS_M: f64 = 1e-3;
    /// Least component of a ray along a box's axis, as a share of its length; rays with less are parallel to the faces.
    pub(crate) const BESIDE: f64 = 1e-9;
}

pub(crate) mod file {
    /// Digits of plan.toml: a millionth of a radian is a few micrometres at the tool.
    pub(crate) const RAD_DIGITS: f64 = 1e6;
    /// Least and most digits of a count: few where it is a small part of a radian.
    pub(crate) const COUNT_DIGITS: [usize; 2] = [LEFT_OUT_DIGITS, 9];
    /// Digits of a count that the table for people leaves out: it shows angles to a tenth of a degree.
    pub(crate) const LEFT_OUT_DIGITS: usize = 3;
    pub(crate) const LENGTH_DIGITS: f64 = 1e5;
    pub(crate) const TIME_DIGITS: f64 = 1e3;
}

pub(crate) mod motion_edge {
    /// Durations of an edge over the shortest one. Tracking errors grow with the rates, so a slow arm may keep clear
    /// where a fast one does not.
    pub(crate) const SLOWNESS: [f64; 5] = [1.0, 1.4, 2.0, 2.8, 4.0];
    /// Largest duration of an edge over the shortest one.
    pub(crate) const SLOWEST: f64 = {
        let [.., slowest] = SLOWNESS;
        slowest
    };
}

pub(crate) mod motion_timing {
    /// Share of rates and flow that set-points use; the rest is left to the controller.
    pub(crate) const RATE_SHARE: f64 = 0.7;
    /// Time to come to rest after a path, s: 0.84 is the median and 1.14 the 90 % quantile of a simulated arm's 58
    /// rests, assumed for others.
    pub(crate) const SETTLE_S: f64 = 1.0;
    /// Ratio of the cubic's largest rate to its mean rate.
    pub(crate) const CUBIC_PEAK: f64 = 1.5;
    pub(crate) const S_PER_MIN: f64 = 60.0;
}

pub(crate) mod motion_tracking_error {
    /// Ratio of the largest lag at the end of an edge to the overshoot.
    pub(crate) const BEHIND: f64 = 0.25;
}

pub(crate) mod path_planner {
    /// Number of halvings of the straight edge when an error names the nearest reachable point.
    pub(crate) const HALVINGS: u32 = 8;
    /// Number of points on the straight edge that an error tests for the nearest shapes.
    pub(crate) const PLACES: u32 = 20;
    /// Tolerance within which an angle counts as within its limit, rad.
    pub(crate) const ROUNDING_RAD: f64 = 1e-9;
}

pub(crate) mod path_rrt_connect {
    /// Longest step by which a tree grows, rad, for the joint that moves the arm's farthest point most.
    pub(crate) const STEP_RAD: f64 = 0.5;
    /// Least weight of joints with short levers, as a share of the largest weight.
    pub(crate) const LEAST_WEIGHT: f64 = 0.25;
    /// Largest deviation of samples from the straight edge, rad.
    pub(crate) const ABOUT_RAD: f64 = 0.8;
    /// Largest number of regions that a search tests, at about 2 us each.
    pub(crate) const MAX_REGIONS: usize = 120_000;
    /// Largest number of samples of a search: each costs at least one region and a linear search of the tree.
    pub(crate) const MAX_SAMPLES: usize = 4_000;
    pub(crate) const SHORTCUT_REGIONS: usize = 4_000;
    pub(crate) const MAX_SHORTCUTS: usize = 40;
    /// Least share of the path's time that a shortcut must save to be tested.
    pub(crate) const LEAST_GAIN: f64 = 0.02;
}

pub(crate) mod scene_check {
    /// Number of uniformly drawn configurations, and of camera poses per tag, in the search for a configuration that
    /// sees each tag.
    pub(crate) const EVEN_DRAWS: usize = 2000;
    pub(crate) const DRAWS_PER_TAG: usize = 60;
    /// Largest depth of a tag inside the face that carries it, m; deeper tags count as inside the part.
    pub(crate) const INSIDE_M: f64 = 0.003;
}

pub(crate) mod targets {
    /// Random starts of the inverse kinematics in addition to the preferred ones.
    pub(crate) const RANDOM_SEEDS: usize = 24;
    /// Number of further tries, each with its own draws, for a target of the task that no start reaches.
    pub(crate) const SPARE_TRIES: usize = 8;
    /// Tolerance at targets, m; a joint whose axis passes the tool point within it does not move the point.
    pub(crate) const IK_TOLERANCE_M: f64 = 1e-6;
}

pub(crate) mod view_planning_camera_ik {
    use armcal_core::numeric::Damping;

    /// Largest number of steps of the camera's inverse kinematics.
    pub(crate) const STEPS: usize = 12;
    /// Longest step of a joint, rad.
    pub(crate) const MAX_STEP_RAD: f64 = 0.4;
    /// Useful distances from a tag, m: nearer, corners leave the image; farther, they are coarse. Assumed.
    pub(crate) const RANGES_M: [f64; 2] = [0.35, 1.5];
    /// Largest angle between the optical axis and the tag, rad.
    pub(crate) const BESIDE_RAD: f64 = 0.6;
    /// Damping added to the normal matrix, m^2/rad^2.
    pub(crate) const DAMPING: Damping =
        Damping { first: 1e-2, min: 1e-6, max: f64::INFINITY, down: 0.3, up: 8.0, min_after_rejection: 0.0 };
}

pub(crate) mod view_planning_candidates {
    /// Largest number of tags in view that is counted; more count as this many.
    pub(crate) const MOST_TAGS: usize = 31;
    pub(crate) const MAX_DRAWS: usize = 200_000;
    /// Largest number of poses that see enough tags and are not clear. Beyond it, missing tags are not the cause.
    pub(crate) const MAX_BLOCKED: usize = 20_000;
    /// Largest number of regions for all certificates: under wide bounds, one pose may take thousands.
    pub(crate) const MAX_REGIONS: usize = 5_000_000;
    /// Least distance of the tool from every target at capture poses, m.
    pub(crate) const TARGET_DISTANCE_M: f64 = 0.15;
    /// Radius around a failed pose (largest joint difference) within which no pose is tried again, rad.
    pub(crate) const FAILED_RADIUS_RAD: f64 = 0.1;
    /// Smallest and largest half width of the boxes around the start, as shares of the joint ranges.
    pub(crate) const BOX_SHARES: [f64; 2] = [0.03, 0.6];
    /// Number of sampled arms that represent the belief.
    pub(crate) const N_ARMS: usize = 16;
    /// Generalisation of the golden ratio to 8 dimensions: the positive root of x^9 = x + 1 (Roberts 2018, the R
    /// sequence).
    pub(crate) const R8: f64 = 1.085_070_245_491_45;
}

pub(crate) mod view_planning_criterion {
    use armcal_core::streams::MAX_JOINTS;

    /// Largest number of gains and offsets of the joints before the camera.
    pub(crate) const MAX_LINEAR: usize = 2 * MAX_JOINTS;
}

pub(crate) mod view_planning_forecast {
    /// Weight of the joints at the edges of their reachable ranges, relative to the task. Assumed small, so that the
    /// task decides.
    pub(crate) const EDGE_SHARE: f64 = 0.3;
    /// Quantiles of the reachable angles that count as edges.
    pub(crate) const EDGES: [f64; 2] = [0.01, 0.99];
    /// Least std of values that are stated as exact.
    pub(crate) const MIN_STD: f64 = 1e-6;
}

pub(crate) mod view_planning_parameter_prior {
    use armcal_core::sensor::N_SHAPE;

    /// Number of parameters of camera mount and survey.
    pub(crate) const N_COMMON: usize = 12;
    /// Std of entirely unknown values, m and rad. Assumed; larger than any arm's site.
    pub(crate) const UNKNOWN_STD: f64 = 3.0;
    /// Number of parameters of one joint: gain, offset, nonlinearity.
    pub(crate) const WIDTH: usize = 2 + N_SHAPE;
}

pub(crate) mod view_planning_pool {
    /// Interval of views that show a tag with a known pose if tags must be mapped first. The map depends on that tag,
    /// and its rotation error follows from the tag's corners.
    pub(crate) const ANCHORED_EVERY: usize = 2;
    /// Number of candidates per pose beyond which more gain little.
    pub(crate) const CANDIDATES_PER_POSE: usize = 20;
    pub(crate) const MIN_CANDIDATES: usize = 300;
}

pub(crate) mod view_planning_selection {
    /// Exponent of the arm's time, relative to the measure.
    pub(crate) const TIME_POWER: f64 = 0.7;
    pub(crate) const MAX_ROUNDS: usize = 3;
    /// Least gain for which an exchange is made.
    pub(crate) const LEAST_GAIN: f64 = 1e-3;
    /// Number of candidates tested for an exchange: those with the largest gain on top of all picks.
    pub(crate) const SHORTLIST: usize = 120;
    /// Relative difference up to which a larger stale gain is larger only by rounding.
    pub(crate) const ROUNDING: f64 = 1e-12;
}

pub(crate) mod view_planning_view_information {
    /// Image rate of a detector, 1/s. Assumed: slow detectors read as many.
    pub(crate) const FRAMES_PER_S: f64 = 5.0;
    /// Range for which robot.toml states the corner noise, facing the tag, m.
    pub(crate) const REFERENCE_RANGE_M: f64 = 1.0;
    /// Share of each tag's own survey error that counts as noise of a view when views are ranked. The rest is known as
    /// soon as a few views have tied the tags together. Assumed; the forecast has each tag's error separately.
    pub(crate) const OWN_SURVEY_SHARE: f64 = 0.35;
}

pub(crate) mod view_planning_visit_order {
    /// Largest number of sweeps of exchanges over the order of visits.
    pub(crate) const MAX_SWEEPS: usize = 30;
    /// Gain below which a change is rounding, s.
    pub(crate) const LEAST_GAIN_S: f64 = 1e-9;
}

pub(crate) mod visibility {
    /// Length before a tag's corner that occlusion ignores, because the tag's own plate is there, m.
    pub(crate) const SIGHT_END_M: f64 = 0.01;
    /// Nearest and farthest range at which tags are read, m. A 0.15 m tag 2 m away spans 29 px: below that corners
    /// suffer.
    pub(crate) const RANGE_M: [f64; 2] = [0.25, 2.0];
    /// Largest angle between a tag's normal and the line to the camera, rad. Beyond 65 deg it is foreshortened to 0.4.
    pub(crate) const MAX_INCIDENCE_RAD: f64 = 1.13;
    /// Width kept free at the edge of the lens's field of view, rad, and at the border of the image, px. Assumed.
    pub(crate) const EDGE_RAD: f64 = 0.1;
    pub(crate) const BORDER_PX: f64 = 12.0;
}
