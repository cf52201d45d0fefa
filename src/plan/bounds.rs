//! How far each joint may truly be from where it is believed to be.

use crate::kinematics::JointLimits;
use crate::robot::Robot;
use crate::streams::JointAngles;

/// Per joint, the worst gain error about the middle of the range and the worst offset.
#[derive(Clone, Debug)]
pub struct JointErrorBounds {
    gain: Vec<f64>,
    offset_rad: Vec<f64>,
    center_rad: Vec<f64>,
}

/// What has passed since some bounds held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Age {
    pub seconds: f64,
    /// Change of the oil's temperature, K.
    pub warmed_k: f64,
}

/// A joint whose sensor's scale nobody knows, at a pose that is known otherwise (a mechanical rest).
#[derive(Clone, Copy, Debug)]
pub struct UnknownScale {
    pub joint: usize,
    /// Where it rests, rad.
    pub rest_rad: f64,
    /// It turns at most this many times as far as believed, either way round.
    pub gain_max: f64,
}

/// What no calibrated linear model explains: nonlinearity, temperature and rest error of the controller, rad.
const UNMODELLED_RAD: f64 = 0.01;
/// Multiple of one sigma that a calibrated parameter is kept clear for.
const SIGMAS: f64 = 4.0;
/// The same for what temperature and time do to it afterwards.
const AGE_SIGMAS: f64 = 3.0;

impl JointErrorBounds {
    /// The datasheet's worst case.
    #[must_use]
    pub fn prior(robot: &Robot) -> Self {
        Self {
            gain: robot.sensors.iter().map(|s| s.gain_bound).collect(),
            offset_rad: robot.sensors.iter().map(|s| s.offset_bound_rad).collect(),
            center_rad: robot.sensors.iter().map(|s| s.center_rad).collect(),
        }
    }

    /// After calibration: four sigma and a floor where a parameter was estimated, the datasheet's where not.
    ///
    /// `estimated` gives (gain sigma, offset sigma in rad) of each joint, `None` where it kept its datasheet value.
    #[must_use]
    pub fn calibrated(robot: &Robot, estimated: &[(Option<f64>, Option<f64>)]) -> Self {
        let mut bounds = Self::prior(robot);
        for (joint, (gain_std, offset_std)) in estimated.iter().enumerate() {
            if let Some(std) = gain_std {
                bounds.gain[joint] = bounds.gain[joint].min(SIGMAS * std);
            }
            if let Some(std) = offset_std {
                bounds.offset_rad[joint] = bounds.offset_rad[joint].min(SIGMAS * std + UNMODELLED_RAD);
            }
        }
        bounds
    }

    /// The datasheet's bounds, but for one joint that is believed to rest where it does and moves no one knows how far.
    ///
    /// A believed step `d` from the rest is a true one of `-gain_max d .. gain_max d`, so the error is at most
    /// `(gain_max + 1) |d|` and the rest's own.
    #[must_use]
    pub fn with_unknown_scale(robot: &Robot, unknown: &UnknownScale) -> Self {
        let mut bounds = Self::prior(robot);
        // error_rad divides by 1 - gain: g / (1 - g) = s for g = s / (1 + s).
        let slope = unknown.gain_max + 1.0;
        bounds.gain[unknown.joint] = slope / (1.0 + slope);
        bounds.offset_rad[unknown.joint] *= 1.0 - bounds.gain[unknown.joint];
        bounds.center_rad[unknown.joint] = unknown.rest_rad;
        bounds
    }

    /// These bounds some time after they held: offsets change with the oil's temperature and walk with time.
    #[must_use]
    pub fn aged(&self, robot: &Robot, age: Age) -> Self {
        let mut bounds = self.clone();
        let datasheet = Self::prior(robot);
        for (joint, spec) in robot.sensors.iter().enumerate() {
            let by_temperature_rad = spec.temperature_std_rad_per_k * age.warmed_k;
            let by_time_rad = spec.drift_std_rad_per_sqrt_h * (age.seconds.max(0.0) / 3600.0).sqrt();
            let aged_rad = bounds.offset_rad[joint] + AGE_SIGMAS * by_temperature_rad.hypot(by_time_rad);
            // The datasheet's worst case has all of it, unless these bounds were beyond it already.
            bounds.offset_rad[joint] = aged_rad.min(datasheet.offset_rad[joint].max(bounds.offset_rad[joint]));
        }
        bounds
    }

    /// Largest distance of the true angle of `joint` from `believed_rad`, rad.
    ///
    /// A sensor that reads `r = m + (1 + g)(theta - m) + o` is at `theta - m = (r - m - o) / (1 + g)`, so
    /// `|theta - r| <= (g |r - m| + o) / (1 - g)`.
    #[must_use]
    pub fn error_rad(&self, joint: usize, believed_rad: f64) -> f64 {
        let (gain, offset_rad) = (self.gain[joint], self.offset_rad[joint]);
        (gain * (believed_rad - self.center_rad[joint]).abs() + offset_rad) / (1.0 - gain)
    }

    /// The most that a true step may exceed a believed one: `1 / (1 - g)` of the worst gain.
    #[must_use]
    pub fn step_factor(&self) -> f64 {
        1.0 / (1.0 - self.gain.iter().copied().fold(0.0, f64::max))
    }

    /// The drawing's limits less the error there: believed angles that no arm within the bounds drives into a stop.
    #[must_use]
    pub fn safe_limits(&self, robot: &Robot) -> Vec<JointLimits> {
        robot
            .chain
            .joints()
            .iter()
            .enumerate()
            .map(|(joint, spec)| match spec.limits {
                None => JointLimits { lower_rad: -std::f64::consts::PI, upper_rad: std::f64::consts::PI },
                Some(limits) => JointLimits {
                    lower_rad: limits.lower_rad + self.error_rad(joint, limits.lower_rad),
                    upper_rad: limits.upper_rad - self.error_rad(joint, limits.upper_rad),
                },
            })
            .collect()
    }

    /// Believed angles to the corner `corner` of the error box over the first `n_joints` joints (bit set: upper end).
    #[must_use]
    pub fn corner(&self, believed: &JointAngles, n_joints: usize, corner: usize) -> JointAngles {
        JointAngles::from_fn(believed.len(), |joint| {
            if joint >= n_joints {
                return believed[joint];
            }
            let error_rad = self.error_rad(joint, believed[joint]);
            if corner >> joint & 1 == 1 { believed[joint] + error_rad } else { believed[joint] - error_rad }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn titan() -> Robot {
        crate::robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/titan4")).expect("the robot reads")
    }

    #[test]
    fn bounds_grow_with_temperature_and_time_up_to_the_datasheets() {
        let robot = titan();
        let fresh = JointErrorBounds::calibrated(&robot, &[(Some(1e-3), Some(1e-3)); 6]);
        let at = |age: Age| fresh.aged(&robot, age).error_rad(0, robot.sensors[0].center_rad);
        let (now, cold, late) = (
            at(Age::default()),
            at(Age { seconds: 0.0, warmed_k: -20.0 }),
            at(Age { seconds: 4.0 * 3600.0, warmed_k: 0.0 }),
        );
        let gain = 1.0 / (1.0 - 4e-3);
        assert!((cold - now - 3.0 * 20.0 * 0.00035 * gain).abs() < 1e-9, "{now} {cold}");
        assert!((late - now - 3.0 * 2.0 * 0.00035 * gain).abs() < 1e-9, "{now} {late}");
        let worst = at(Age { seconds: 1e9, warmed_k: 1e3 });
        assert!((worst - robot.sensors[0].offset_bound_rad * gain).abs() < 1e-9, "{worst}");
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
        assert_eq!(bounds.error_rad(0, 0.1), JointErrorBounds::prior(&robot).error_rad(0, 0.1));
    }
}
