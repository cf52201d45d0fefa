//! Constants that decide something in `solve`: unit, source and effect of each, by the file that uses it.

pub(crate) mod covariance {
    /// Least distance in the objective's curvature, m: pixel noise causes distances below it.
    pub(crate) const DISTANCE_FLOOR_M: f64 = 1e-4;
}

pub(crate) mod estimate {
    /// Width of the Cauchy loss in the first solution, standard deviations of a measurement.
    pub(crate) const CORNER_WIDTH: f64 = 3.0;
    /// Cost per used measurement above which the model does not hold. Good views have about one (corner noise is not
    /// quite normal).
    pub(crate) const CONSISTENT_COST: f64 = 3.0;
    /// Largest number of rounds of estimates and scales.
    pub(crate) const MAX_ROUNDS: usize = 40;
    /// Change of the scales in a round below which they have settled.
    pub(crate) const CONVERGED_CHANGE: f64 = 0.01;
    /// Number of rounds after the last new scales, in which outliers may still change.
    pub(crate) const LAST_ROUNDS: usize = 5;
    /// Most rounds under given scales, where outliers alone come and go: good views settle in three (measured).
    pub(crate) const ROUNDS_AS_GIVEN: usize = 12;
    /// Most rounds where most observations are left out, under given scales and where scales are fitted: noise that is
    /// many times the stated lets observations in by and by. Assumed.
    pub(crate) const LITTLE_AS_GIVEN: usize = 8;
    pub(crate) const LITTLE_AS_FITTED: usize = 20;
}

pub(crate) mod evidence {
    /// Number of pseudo-observations that the first guess of each scale counts for.
    pub(crate) const NU_JOINT: f64 = 3.0;
    pub(crate) const NU_SHAPE: f64 = 2.0;
    pub(crate) const NU_TERM: f64 = 2.0;
    pub(crate) const NU_LINK: f64 = 2.0;
    pub(crate) const NU_NOISE: f64 = 20.0;
    pub(crate) const NU_CAMERA: f64 = 6.0;
    /// Bounds of the noise's factor; `SCALE_BOUNDS` are those of every other scale over its first guess.
    pub(crate) const NOISE_BOUNDS: [f64; 2] = [0.1, 30.0];
    /// Bounds of the noise of positions and rotations, relative to the first guess, if no noise is stated.
    pub(crate) const POSITION_BOUNDS: [f64; 2] = [1e-3, 1e3];
    pub(crate) const SCALE_BOUNDS: [f64; 2] = [0.02, 50.0];
    /// Least ratio of rows to nonzero rows at which only the nonzero ones are used: a view sees few of many tags.
    pub(crate) const FEW: usize = 4;
    pub(crate) const STEP: f64 = 1e-3;
}

pub(crate) mod levenberg_marquardt {
    use armcal_core::numeric::{Damping, StopRule};

    /// Cost increase that a step near the end may cause, relative: the rounding error of a sum of thousands of squares.
    pub(crate) const SLACK: f64 = 1e-13;
    pub(crate) const ROUNDING: f64 = 1e-11;
    /// Cost below which all parameters are within 1e-6 standard deviations of the priors. It ends a search in which
    /// every observation is rejected: the least cost is then zero, and no step ever saves too small a share of it.
    pub(crate) const COST_AT_PRIORS: f64 = 1e-12;
    /// Curvature from which a step has overshot: it saved less than half of the prediction.
    pub(crate) const OVERSHOT: f64 = 1.5;
    /// Cosine of the angle between two steps, the second of which goes back along the first.
    pub(crate) const GOES_BACK: f64 = -0.9;
    /// Least relative gain, as predicted, of a step that determines the curvature; smaller gains are lost in the last
    /// digits of the sum.
    pub(crate) const TELLING_GAIN: f64 = 1e2 * ROUNDING;
    /// Levenberg-Marquardt damping, relative to the normal equations' diagonal.
    pub(crate) const DAMPING: Damping =
        Damping { first: 1e-6, min: 1e-14, max: 1e12, down: 0.1, up: 10.0, min_after_rejection: 0.0 };
    /// Stop rule: until one more step would save less than a sum of squares can resolve.
    pub(crate) const TIGHT: StopRule =
        StopRule { predicted_gain: 1e-15, slack: SLACK, rounding: ROUNDING, ..StopRule::after(100) };
    /// Stop rule while scales or weights still change.
    pub(crate) const LOOSE: StopRule = StopRule { max_iterations: 20, predicted_gain: 1e-6, ..TIGHT };
}

pub(crate) mod model_for_views {
    /// Least number of views of the tag on the gripper that are used.
    pub const MIN_GRIPPER_VIEWS: usize = 4;
    /// Least changes of the oil's temperature, K, and of the pressure, Pa (20 m of water), over the views that make
    /// their effects observable. Assumed.
    pub(crate) const WARMED_K: f64 = 0.5;
    pub(crate) const DIVED_PA: f64 = 2e5;
}

pub(crate) mod outliers {
    /// Chi-square per coordinate above which an observation is rejected, and below which it is readmitted.
    pub(crate) const LIMITS: [f64; 2] = [7.5, 5.0];
    /// Chi-square of a corner at which it is rejected and readmitted. One of four normal corners exceeds them as often
    /// (5e-10, 3e-6) as an observation with eight coordinates exceeds its own: `4 exp(-x / 2) = P(chi-square of 8 > 60,
    /// 40)`.
    pub(crate) const CORNER_LIMITS: [f64; 2] = [45.7, 28.1];
    /// Least number of fitting corners of a tag; with fewer the tag is elsewhere, or it is another one.
    pub(crate) const MIN_CORNERS: usize = 3;
}

pub(crate) mod problem {
    use armcal_core::joints::MAX_JOINTS;

    /// Degrees of freedom of robot.toml's corner noise when it is combined with the scatter between a view's frames.
    pub(crate) const CORNER_PRIOR_DOF: f64 = 16.0;
    /// Number of a view's local parameters: an error of each joint, then the camera's six.
    pub(crate) const N_VIEW_PARAMETERS: usize = MAX_JOINTS + 6;
}

pub(crate) mod robust_start {
    /// Standard deviations of the tags' positions in the successive rounds of the robust start, m.
    pub(crate) const START_STD_M: [f64; 3] = [0.3, 0.1, 0.03];
    pub(crate) const START_WIDTH: f64 = 1.0;
}

pub(crate) mod schur {
    use armcal_core::joints::MAX_JOINTS;

    /// Indices of the common directions: each joint, then the mount's six, then the time offset.
    pub(crate) const MOUNT: usize = MAX_JOINTS;
    pub(crate) const TIME: usize = MOUNT + 6;
    pub(crate) const N_DIRECTIONS: usize = TIME + 1;
    /// Number of columns of all links that an arm may have, of their compliances, the base's and the tool load.
    pub(crate) const N_BODY_COLUMNS: usize = 7 * MAX_JOINTS + 4;
}

pub(crate) mod task_angles {
    /// Targets are reached to this, m.
    pub(crate) const TOLERANCE_M: f64 = 1e-4;
    /// Views whose angles the inverse kinematics is started at. Assumed.
    pub(crate) const N_NEAREST_VIEWS: usize = 8;
    /// Starts at random where no other leads to the target: nearly one in two of a six-axis arm does (measured).
    pub(crate) const N_RANDOM_STARTS: usize = 48;
}

pub(crate) mod time_error {
    /// Smallest variance of a moving arm's own joint error, rad^2; keeps the differences of inverses finite.
    pub(crate) const LEAST_OWN_VAR: f64 = 1e-14;
}
