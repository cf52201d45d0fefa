//! Bounds on the difference of true and believed joint angles.

use crate::plan::constants::bounds_joint_bounds::AGE_SIGMAS;
use crate::plan::motion::tracking_error::TrackingErrorBound;
use armcal_core::kinematics::JointLimits;
use armcal_core::robot::{JointSensorSpec, Robot};

/// Error bound of each joint: least at one angle, rising with a slope on either side of it.
///
/// The bound is convex in the angle, so that the largest error of a stretch is at one of its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct JointErrorBounds {
    pub(crate) joints: Vec<JointBound>,
}

/// Error bound of one joint: `at_pivot_rad + slope |angle - pivot_rad|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct JointBound {
    pub pivot_rad: f64,
    pub at_pivot_rad: f64,
    pub slope: f64,
}

impl JointBound {
    /// A sensor that reads `r = m + (1 + g)(theta - m) + o` is at `theta - m = (r - m - o) / (1 + g)`, so
    /// `|theta - r| <= (G |r - m| + O) / (1 - G)` for `|g| <= G`, `|o| <= O`.
    fn datasheet(spec: &JointSensorSpec) -> Self {
        let rest = 1.0 - spec.gain_bound;
        Self { pivot_rad: spec.center_rad, at_pivot_rad: spec.offset_bound_rad / rest, slope: spec.gain_bound / rest }
    }

    pub fn error_rad(&self, believed_rad: f64) -> f64 {
        self.at_pivot_rad + self.slope * (believed_rad - self.pivot_rad).abs()
    }
}

/// Time and temperature change since some bounds held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elapsed {
    /// Time since then, s; less than 0 counts as 0.
    pub seconds: f64,
    /// Change of the oil's temperature, K.
    pub warmed_k: f64,
}

/// A joint with an unknown sensor scale at a pose that is otherwise known (a mechanical rest).
#[derive(Clone, Copy, Debug)]
pub struct UnknownScale {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Rest angle of the joint, rad.
    pub rest_rad: f64,
    /// Largest ratio of true to believed motion, in either direction.
    pub gain_max: f64,
}

impl JointErrorBounds {
    /// Returns the datasheet's worst case.
    #[must_use]
    pub fn datasheet(robot: &Robot) -> Self {
        Self { joints: robot.sensors.iter().map(JointBound::datasheet).collect() }
    }

    /// Returns zero bounds: only the believed arm, without any margin for wrong sensors.
    #[must_use]
    pub fn none(robot: &Robot) -> Self {
        let nothing = |spec: &JointSensorSpec| JointBound { pivot_rad: spec.center_rad, at_pivot_rad: 0.0, slope: 0.0 };
        Self { joints: robot.sensors.iter().map(nothing).collect() }
    }

    /// Returns equal bounds for all joints, each with its pivot at mid-range.
    #[cfg(test)]
    pub(crate) fn alike(robot: &Robot, at_pivot_rad: f64, slope: f64) -> Self {
        let bound = |spec: &JointSensorSpec| JointBound { pivot_rad: spec.center_rad, at_pivot_rad, slope };
        Self { joints: robot.sensors.iter().map(bound).collect() }
    }

    /// Returns the datasheet's bounds, except for one joint with a known rest angle and an unknown scale.
    ///
    /// For a believed step `d` from the rest, the true step is between `-gain_max d` and `gain_max d`. So the error is
    /// at most `(gain_max + 1) |d|` plus the error at rest.
    #[must_use]
    pub fn with_unknown_scale(robot: &Robot, unknown: &UnknownScale) -> Self {
        let mut bounds = Self::datasheet(robot);
        bounds.joints[unknown.joint] = JointBound {
            pivot_rad: unknown.rest_rad,
            at_pivot_rad: robot.sensors[unknown.joint].offset_bound_rad,
            slope: unknown.gain_max + 1.0,
        };
        bounds
    }

    /// Returns these bounds some time after they held: offsets change with the oil's temperature and drift with time.
    #[must_use]
    pub fn widened(&self, robot: &Robot, age: Elapsed) -> Self {
        let mut bounds = self.clone();
        for (bound, spec) in bounds.joints.iter_mut().zip(&robot.sensors) {
            let by_temperature_rad = spec.temperature_std_rad_per_k * age.warmed_k;
            let by_time_rad = spec.drift_std_rad_per_sqrt_h * (age.seconds.max(0.0) / 3600.0).sqrt();
            let aged_rad = bound.at_pivot_rad + AGE_SIGMAS * by_temperature_rad.hypot(by_time_rad);
            // The datasheet's worst case includes all of it, unless these bounds already exceeded the worst case.
            bound.at_pivot_rad = aged_rad.min(JointBound::datasheet(spec).at_pivot_rad.max(bound.at_pivot_rad));
        }
        bounds
    }

    /// Sets the bound of a joint that stands within `bound_rad` of `angle_rad`, regardless of its sensor.
    pub fn hold(&mut self, joint: usize, angle_rad: f64, bound_rad: f64) {
        self.joints[joint] = JointBound { pivot_rad: angle_rad, at_pivot_rad: bound_rad, slope: 0.0 };
    }

    /// Returns the largest distance of the true angle of `joint` from `believed_rad`, rad.
    #[must_use]
    pub fn error_rad(&self, joint: usize, believed_rad: f64) -> f64 {
        self.joints[joint].error_rad(believed_rad)
    }

    /// Returns the largest change of that error per change of the believed angle, rad/rad.
    pub(crate) fn slope(&self, joint: usize) -> f64 {
        self.joints[joint].slope
    }

    /// Returns the nominal limits less the error there and the overshoot of an arm that arrives slowly. At these
    /// believed angles no arm within the bounds is driven into a stop. A joint whose error may exceed its range gets a
    /// single angle, the one farthest from both stops.
    #[must_use]
    pub fn safe_limits(&self, robot: &Robot) -> Vec<JointLimits> {
        let arriving = TrackingErrorBound::arriving(robot);
        robot
            .chain
            .joints()
            .iter()
            .enumerate()
            .map(|(joint, spec)| match spec.limits {
                Some(limits) if limits.are_locked() => limits,
                None => JointLimits { lower_rad: -std::f64::consts::PI, upper_rad: std::f64::consts::PI },
                Some(limits) => uncrossed(JointLimits {
                    lower_rad: limits.lower_rad + self.error_rad(joint, limits.lower_rad) + arriving.end_rad(joint),
                    upper_rad: limits.upper_rad - self.error_rad(joint, limits.upper_rad) - arriving.end_rad(joint),
                }),
            })
            .collect()
    }
}

/// Returns the limits, or their middle if no angle lies between them.
fn uncrossed(limits: JointLimits) -> JointLimits {
    if limits.lower_rad <= limits.upper_rad {
        return limits;
    }
    let middle_rad = 0.5 * (limits.lower_rad + limits.upper_rad);
    JointLimits { lower_rad: middle_rad, upper_rad: middle_rad }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn titan() -> Robot {
        armcal_core::robot::load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4"))
            .expect("the robot reads")
    }

    #[test]
    fn bounds_grow_with_temperature_and_time_up_to_the_datasheets() {
        let robot = titan();
        let pivot_rad = robot.sensors[0].center_rad;
        let mut fresh = JointErrorBounds::datasheet(&robot);
        fresh.joints[0] = JointBound { pivot_rad, at_pivot_rad: 0.01, slope: 0.004 };
        let at = |age: Elapsed| fresh.widened(&robot, age).error_rad(0, pivot_rad);
        let (now, cold, late) = (
            at(Elapsed::default()),
            at(Elapsed { seconds: 0.0, warmed_k: -20.0 }),
            at(Elapsed { seconds: 4.0 * 3600.0, warmed_k: 0.0 }),
        );
        assert!((cold - now - 3.0 * 20.0 * 0.00035).abs() < 1e-9, "{now} {cold}");
        assert!((late - now - 3.0 * 2.0 * 0.00035).abs() < 1e-9, "{now} {late}");
        let worst = at(Elapsed { seconds: 1e9, warmed_k: 1e3 });
        assert!((worst - robot.sensors[0].offset_bound_rad / 0.95).abs() < 1e-9, "{worst}");
    }

    /// Targets are searched between these limits, and no random angle can be drawn between crossed ones.
    #[test]
    fn a_joint_that_may_be_off_by_more_than_its_range_has_one_angle_left() {
        let robot = titan();
        let usual = JointErrorBounds::datasheet(&robot).safe_limits(&robot);
        let mut bounds = JointErrorBounds::datasheet(&robot);
        bounds.hold(1, robot.sensors[1].center_rad, 5.0);
        let limits = bounds.safe_limits(&robot);
        let drawn = robot.chain.joints()[1].limits.expect("the shoulder has stops");
        assert!(limits[1].are_locked() && !usual[1].are_locked());
        assert!((limits[1].lower_rad - 0.5 * (drawn.lower_rad + drawn.upper_rad)).abs() < 1e-12);
        assert_eq!((limits[0].lower_rad, limits[0].upper_rad), (usual[0].lower_rad, usual[0].upper_rad));
    }

    /// Every true scale up to the largest, in either direction, keeps the joint within the bound.
    #[test]
    fn an_unknown_scale_is_bounded_by_the_farthest_that_the_joint_may_turn() {
        let robot = titan();
        let unknown = UnknownScale { joint: 2, rest_rad: -0.36, gain_max: 4.0 };
        let bounds = JointErrorBounds::with_unknown_scale(&robot, &unknown);
        let at_rest = bounds.error_rad(2, -0.36);
        assert!((at_rest - robot.sensors[2].offset_bound_rad).abs() < 1e-12, "{at_rest}");
        for step in [-0.02, 0.01, 0.03_f64] {
            for gain in [-4.0, -1.0, 0.3, 4.0] {
                let error = (gain * step - step).abs() + at_rest;
                assert!(error <= bounds.error_rad(2, -0.36 + step) + 1e-12);
            }
        }
        assert_eq!(bounds.error_rad(0, 0.1), JointErrorBounds::datasheet(&robot).error_rad(0, 0.1));
    }
}
