//! What is estimated, and how large the things are that are not known exactly.

use crate::calib::parameters::ParameterKind;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::sensor::{N_SHAPE, shape_prior};

/// Which parameters have a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Of each joint of the arm, base first.
    pub joints: Vec<Vec<ParameterKind>>,
    /// The camera's mount, about the drawing's.
    pub mount: bool,
    /// Focal lengths, centre and distortion, about robot.toml's.
    pub lens: bool,
    /// The tags' poses, about the survey's.
    pub tags: bool,
    pub gripper_tag: bool,
    /// How much later the joint sensors' stamps are than the camera's.
    pub time_offset: bool,
}

/// Standard deviations that the data themselves may tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Hyperparameters {
    /// What each joint is off in each view anew, rad: what the sensor's model leaves.
    pub joint_std_rad: [f64; MAX_JOINTS],
    /// Of a joint whose sensor says nothing.
    pub free_joint_std_rad: f64,
    /// Size of each sensor's nonlinearity.
    pub shape_std_rad: [f64; MAX_JOINTS],
    pub offset_std_rad_per_k: f64,
    pub gain_std_per_k: f64,
    pub offset_std_rad_per_mpa: f64,
    pub drift_std_rad_per_h: f64,
    pub half_play_std_rad: f64,
    /// All measurements' standard deviations over what is stated for them.
    pub noise: f64,
    /// Of positions and poses that a recording gives in place of corners.
    pub position_std_m: f64,
    pub rotation_std_rad: f64,
    /// The error that all tags of a view share (positions by SLAM have it): translation m, rotation rad. `None`: there is none.
    pub camera_error_std: Option<[f64; 2]>,
}

/// Correlation length of a sensor's nonlinearity, half ranges. Assumed: four waves over the range are then still half as likely
/// as one.
pub const SHAPE_LENGTH: f64 = 0.16;

impl Hyperparameters {
    /// What robot.toml says, and where it is silent what is usual (assumed; the data correct it).
    #[must_use]
    pub fn datasheet(robot: &Robot) -> Self {
        let mut joint_std_rad = [1e-3; MAX_JOINTS];
        let mut shape_std_rad = [1e-3; MAX_JOINTS];
        let mut known_per_k = 0.0_f64;
        for (joint, spec) in robot.sensors.iter().enumerate() {
            joint_std_rad[joint] = usual_joint_std_rad(spec);
            shape_std_rad[joint] = spec.linearity_std_rad.max(1e-5);
            known_per_k = known_per_k.max(spec.temperature_std_rad_per_k);
        }
        Self {
            joint_std_rad,
            free_joint_std_rad: 1.0,
            shape_std_rad,
            offset_std_rad_per_k: if known_per_k > 0.0 { known_per_k } else { 3e-4 },
            gain_std_per_k: 3e-5,
            offset_std_rad_per_mpa: 1e-4,
            drift_std_rad_per_h: 1e-3,
            half_play_std_rad: 2e-4,
            noise: 1.0,
            position_std_m: 0.005,
            rotation_std_rad: 0.02,
            camera_error_std: None,
        }
    }

    /// One sigma of a joint parameter's prior, in its own unit.
    #[must_use]
    pub fn prior_std(&self, spec: &JointSensorSpec, joint: usize, kind: ParameterKind) -> f64 {
        match kind {
            ParameterKind::Gain => spec.gain_std,
            ParameterKind::Offset => spec.offset_std_rad,
            ParameterKind::Shape(h) => self.shape_std_rad[joint] * shape_prior(SHAPE_LENGTH)[usize::from(h)],
            ParameterKind::OffsetPerK => self.offset_std_rad_per_k,
            ParameterKind::GainPerK => self.gain_std_per_k,
            ParameterKind::OffsetPerMpa => self.offset_std_rad_per_mpa,
            ParameterKind::DriftPerH => self.drift_std_rad_per_h,
            ParameterKind::HalfBacklash => self.half_play_std_rad,
        }
    }
}

/// A tenth of what a straight line leaves.
fn usual_joint_std_rad(spec: &JointSensorSpec) -> f64 {
    (0.1 * spec.linearity_std_rad).max(1e-5)
}

/// All coefficients of the nonlinearity.
pub(crate) fn shape_kinds() -> impl Iterator<Item = ParameterKind> {
    (0..N_SHAPE).map(|h| ParameterKind::Shape(h as u8))
}
