//! How far each joint may truly be from where it is believed to be.

use crate::plan::constants::bounds_joint_bounds::AGE_SIGMAS;
use crate::plan::motion::tracking_error::TrackingErrorBound;
use armcal_core::kinematics::JointLimits;
use armcal_core::robot::{JointSensorSpec, Robot};

/// Per joint, how far it may be off: least at one angle, and more by a slope on either side of it.
///
/// Convex in the angle, so that the largest error of a stretch is at one of its ends.
#[derive(Clone, Debug, PartialEq)]
pub struct JointErrorBounds {
    pub(crate) joints: Vec<JointBound>,
}

/// `at_pivot_rad + slope |angle - pivot_rad|`.
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

/// What has passed since some bounds held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elapsed {
    /// Time since then; less than 0 counts as 0.
    pub seconds: f64,
    /// Change of the oil's temperature, K.
    pub warmed_k: f64,
}

/// A joint whose sensor's scale nobody knows, at a pose that is known otherwise (a mechanical rest).
#[derive(Clone, Copy, Debug)]
pub struct UnknownScale {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Where it rests, rad.
    pub rest_rad: f64,
    /// It turns at most this many times as far as believed, either way round.
    pub gain_max: f64,
}

impl JointErrorBounds {
    /// The datasheet's worst case.
    #[must_use]
    pub fn datasheet(robot: &Robot) -> Self {
        Self { joints: robot.sensors.iter().map(JointBound::datasheet).collect() }
    }

    /// The believed arm and no other: what a plan without any margin for wrong sensors keeps clear for.
    #[must_use]
    pub fn none(robot: &Robot) -> Self {
        let nothing = |spec: &JointSensorSpec| JointBound { pivot_rad: spec.center_rad, at_pivot_rad: 0.0, slope: 0.0 };
        Self { joints: robot.sensors.iter().map(nothing).collect() }
    }

    /// The same for all joints, about the middles of their ranges.
    #[cfg(test)]
    pub(crate) fn alike(robot: &Robot, at_pivot_rad: f64, slope: f64) -> Self {
        let bound = |spec: &JointSensorSpec| JointBound { pivot_rad: spec.center_rad, at_pivot_rad, slope };
        Self { joints: robot.sensors.iter().map(bound).collect() }
    }

    /// The datasheet's bounds, but for one joint that is believed to rest where it does and moves no one knows how far.
    ///
    /// A believed step `d` from the rest is a true one of `-gain_max d .. gain_max d`, so the error is at most
    /// `(gain_max + 1) |d|` and the rest's own.
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

    /// These bounds some time after they held: offsets change with the oil's temperature and walk with time.
    #[must_use]
    pub fn widened(&self, robot: &Robot, age: Elapsed) -> Self {
        let mut bounds = self.clone();
        for (bound, spec) in bounds.joints.iter_mut().zip(&robot.sensors) {
            let by_temperature_rad = spec.temperature_std_rad_per_k * age.warmed_k;
            let by_time_rad = spec.drift_std_rad_per_sqrt_h * (age.seconds.max(0.0) / 3600.0).sqrt();
            let aged_rad = bound.at_pivot_rad + AGE_SIGMAS * by_temperature_rad.hypot(by_time_rad);
            // The datasheet's worst case has all of it, unless these bounds were beyond it already.
            bound.at_pivot_rad = aged_rad.min(JointBound::datasheet(spec).at_pivot_rad.max(bound.at_pivot_rad));
        }
        bounds
    }

    /// A joint that stands within `bound_rad` of `angle_rad`, whatever its sensor says.
    pub fn hold(&mut self, joint: usize, angle_rad: f64, bound_rad: f64) {
        self.joints[joint] = JointBound { pivot_rad: angle_rad, at_pivot_rad: bound_rad, slope: 0.0 };
    }

    /// Largest distance of the true angle of `joint` from `believed_rad`, rad.
    #[must_use]
    pub fn error_rad(&self, joint: usize, believed_rad: f64) -> f64 {
        self.joints[joint].error_rad(believed_rad)
    }

    /// How much that changes with the believed angle at most, rad/rad.
    pub(crate) fn slope(&self, joint: usize) -> f64 {
        self.joints[joint].slope
    }

    /// The drawing's limits less the error there and what an arm overshoots that comes slowly: believed angles that no
    /// arm within the bounds drives into a stop. A joint that may be off by more than its range leaves none: it stays
    /// at the one farthest from both stops.
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

/// Their middle where they leave no angle.
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

    /// Targets are looked for between these limits, and a random angle between crossed ones is none.
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

    /// Every true scale up to the largest, either way round, keeps the joint within the bound.
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
