//! Constants that decide something in `views`: unit, source and effect of each, by the file that uses it.

pub(crate) mod association {
    /// Corners with a larger residual of a square are no tag: three times the worst that the lens prior allows.
    pub(crate) const MAX_SQUARE_RMS_PX: f64 = 3.0;
}

pub(crate) mod conditions {
    /// Largest time from a span to a reading that is used for it, s.
    pub(crate) const NEAR_S: f64 = 60.0;
    /// Time before a rest in which a joint's last motion is searched, s.
    pub(crate) const BACK_S: f64 = 30.0;
    /// Distance of a reading from the rest, in standard deviations of its noise, beyond which it was taken before or
    /// after the rest.
    pub(crate) const CLEAR_SIGMAS: f64 = 8.0;
    /// Number of readings in a row that must agree: a single one may be a jump of the sensor.
    pub(crate) const CLEAR_READINGS: usize = 2;
    /// Standard deviation of rounding to whole counts.
    pub(crate) const ROUNDING_COUNTS: f64 = 0.288_675;
    /// Least number of readings that give a rate.
    pub(crate) const MIN_READINGS_OF_RATE: usize = 3;
}

pub(crate) mod data_checks {
    /// Largest distance of two joints' readings from one straight line, as a share of their span, that means one
    /// sensor. At least `MIN_ALIKE_VIEWS` views must show it. Assumed: rounding of a conversion is far below, noise of
    /// a sensor above.
    pub(crate) const ALIKE_SHARE: f64 = 1e-7;
    pub(crate) const MIN_ALIKE_VIEWS: usize = 5;
    /// Largest share of messages with numbers that are not finite. Assumed: a sensor that seldom fails is still usable.
    pub(crate) const MAX_NOT_FINITE_SHARE: f64 = 0.01;
    /// Largest motion of any joint, in standard deviations of its noise, between views that count as one pose. Assumed.
    pub(crate) const MOVED_SIGMAS: f64 = 6.0;
}

pub(crate) mod dropouts {
    /// Largest distance of a joint at rest from its median, rad: vehicles rock an arm by a tenth of it.
    pub(crate) const AT_REST_RAD: f64 = 0.05;
}

pub(crate) mod external_board {
    /// Distance from the other corners' prediction, in standard deviations, beyond which a detection is another corner
    /// or a shadow.
    pub(crate) const FAR_SIGMAS: f64 = 6.0;
    /// Ratio of the standard deviation to the median of absolute values.
    pub(crate) const SIGMA_OF_MEDIAN: f64 = 1.4826;
    /// Largest share of a board's corners that may be rejected.
    pub(crate) const MAX_LEFT_OUT: f64 = 0.25;
}

pub(crate) mod clock_shift {
    /// Motion of a tag over its distance, between two images, below which it stands still: beyond the noise.
    pub(crate) const STILL_RAD: f64 = 0.02;
    /// Distance of tags that are seen in pixels, as if: only their directions are compared.
    pub(crate) const DISTANCE_M: f64 = 1.0;
    /// Offsets that are compared, s, and the distance between them: shorter than the rest of an arm for one image.
    pub(crate) const LONGEST_S: f64 = 60.0;
    pub(crate) const STEP_S: f64 = 0.1;
    /// Offset up to which the estimate finds it, s: four sigmas of the clocks of one vehicle.
    pub(crate) const MIN_SHIFT_S: f64 = 0.2;
    /// Offsets so near to the best count as the same, s: shorter than the time between two poses. Assumed.
    pub(crate) const NEIGHBOUR_S: f64 = 1.0;
    /// Correlation of the motions as stamped above which no other offset is searched for. Assumed: that of good
    /// recordings is 0.8 to 1.
    pub(crate) const MAX_AS_STAMPED: f64 = 0.6;
    /// Least correlation that proves an offset: chance alone gives less over all offsets (a test).
    pub(crate) const MIN_CORRELATION: f64 = 0.8;
    /// Share of the best correlation above which an offset is as good by when the arm moved.
    pub(crate) const AS_GOOD: f64 = 0.9;
    /// Ratio of the angles between tags as seen and as the nominal arm predicts them, best offset over any other.
    pub(crate) const NEARER: f64 = 0.5;
    /// Standard deviations by which the sizes of the motions must prefer an offset to the others.
    pub(crate) const SURE: f64 = 3.0;
    /// Largest correlation of sizes that counts: no camera's motion predicts a tag's better.
    pub(crate) const MOST: f64 = 0.99;
    /// Least number of pairs in which the tags moved, and the joints: chance alone does not align so many.
    pub(crate) const MIN_MOVED: usize = 8;
    /// Share of the pairs that need readings at an offset.
    pub(crate) const MIN_SHARE: f64 = 0.5;
    /// Pairs that are compared at most: of longer recordings, every second or third one and so on.
    pub(crate) const MAX_PAIRS: usize = 500;
}

pub(crate) mod external_landmarks {
    /// Distance up to which a position is never rejected, m: the best accuracy of positions from tags. Assumed.
    pub(crate) const NEVER_APART_M: f64 = 2e-3;
}

pub(crate) mod motion {
    /// Steps between readings, s: over them a parabola follows the swings of common arms to 0.001 deg. Assumed.
    pub(crate) const STEP_S: f64 = 0.05;
    /// Steps before and after a view: four sigmas of the offset between two clocks.
    pub(crate) const N_STEPS: usize = 4;
}

pub(crate) mod external_pairing {
    /// Largest time between readings of a continuous stream, s. Assumed.
    pub(crate) const CONTINUOUS_WITHIN_S: f64 = 0.25;
    /// Half width of the window in which rates are measured, s: long against the noise of readings, short against a
    /// motion. Assumed.
    pub(crate) const RATE_WINDOW_S: f64 = 0.1;
}

pub(crate) mod external_views {
    /// Largest difference of readings of one pose, in standard deviations. Assumed.
    pub(crate) const SAME_POSE_SIGMAS: f64 = 5.0;
    /// Rate, beyond its noise, above which the arm is moving, rad/s: 1 mm at a reach of 2 m and a camera clock 50 ms
    /// late.
    pub(crate) const REST_RATE_RAD_S: f64 = 0.01;
    /// Largest time from a view to an attitude that is used for it, s: a vehicle changes its tilt within seconds.
    pub(crate) const ATTITUDE_WITHIN_S: f64 = 0.5;
    /// Least length of the mean of attitudes; a shorter mean shows that they contradict each other.
    pub(crate) const MIN_MEAN_UP: f64 = 0.5;
    /// Largest rate that counts as zero, in standard deviations of its noise.
    pub(crate) const RATE_SIGMAS: f64 = 5.0;
}

pub(crate) mod frame_consensus {
    /// Distance between frames, in standard deviations of a corner, above which outliers among them are searched for.
    pub(crate) const CLOSE_SIGMAS: f64 = 10.0;
    /// Gate of that search in units of the usual distance between a frame and the next nearest, if that is larger.
    pub(crate) const USUAL_DISTANCES: f64 = 6.0;
    /// Distance, in standard deviations, beyond which a tag is elsewhere, however noisy the corners are: tags are not
    /// that close to each other.
    pub(crate) const ELSEWHERE_SIGMAS: f64 = 100.0;
}

pub(crate) mod pooling {
    /// Poses of one recording have numbers below this.
    pub(crate) const POSES_PER_RECORDING: u32 = 1_000_000;
}

pub(crate) mod scale_identification {
    use armcal_core::numeric::{Damping, StopRule};

    /// Fewer views have no meaningful residuals.
    pub(crate) const MIN_VIEWS: usize = 3;
    /// Largest standard deviation of a usable slope, relative to the slope.
    pub(crate) const MAX_RELATIVE_STD: f64 = 0.2;
    /// Relative error of the slope from camera mount and tags that differ from their nominal poses.
    pub(crate) const DRAWING_STD: f64 = 1e-3;
    /// Least standard deviation of a camera's rotation, rad: from corners with an error of a third of a pixel.
    pub(crate) const TURN_FLOOR_RAD: f64 = 3e-4;
    /// Sum of squared deviations from the mean below which readings count as constant, rad^2.
    pub(crate) const CONSTANT_RAD2: f64 = 1e-12;
    /// Damping: none. The start is a tag's own pose, near enough for Gauss-Newton; twelve steps reach the last digits.
    pub(crate) const DAMPING: Damping =
        Damping { first: 0.0, min: 0.0, max: 0.0, down: 0.0, up: 0.0, min_after_rejection: 0.0 };
    pub(crate) const STOP: StopRule = StopRule { slack: f64::INFINITY, ..StopRule::after(12) };
}

pub(crate) mod view {
    /// Largest rate, rad/s. In a faster arm the readings around an image are too far apart to interpolate, and to
    /// distinguish from drop-outs.
    pub(crate) const FASTEST_RAD_S: f64 = 0.5;
}
