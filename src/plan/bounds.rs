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

/// What no calibrated linear model explains: nonlinearity, temperature and rest error of the controller, rad.
const UNMODELLED_RAD: f64 = 0.01;
/// Multiple of one sigma that a calibrated parameter is kept clear for.
const SIGMAS: f64 = 4.0;

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
