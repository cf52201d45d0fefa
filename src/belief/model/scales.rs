//! Noise and prior scales: standard deviations that the data may correct.

use crate::model::constants::scales::{
    AS_STATED, DRIFT_STD_RAD_PER_H, FREE_JOINT_STD_RAD, GAIN_STD_PER_K, HALF_PLAY_STD_RAD, OFFSET_STD_RAD_PER_K,
    OFFSET_STD_RAD_PER_MPA, POSE_STD,
};
pub(crate) use crate::model::constants::scales::{BUMP_STD_RAD, STEP_STD_RAD, TIME_JITTER_STD_S};
pub use crate::model::constants::scales::{MAX_CAMERAS, SHAPE_LENGTH};
use crate::model::parameters::ParameterKind;
use crate::model::walk_modes::mode_std;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::sensor::shape_prior;

/// Standard deviations that the data themselves may tell.
#[derive(Clone, Debug, PartialEq)]
pub struct Hyperparameters {
    /// Error of each joint beyond its sensor's model, independent in each view, rad.
    pub joint_std_rad: [f64; MAX_JOINTS],
    /// Standard deviation of a joint whose sensor does not count, rad.
    pub free_joint_std_rad: f64,
    /// Size of each sensor's nonlinearity.
    pub shape_std_rad: [f64; MAX_JOINTS],
    /// Change of an offset with the oil temperature.
    pub offset_std_rad_per_k: f64,
    /// Change of a gain with the oil temperature.
    pub gain_std_per_k: f64,
    /// Change of an offset with the ambient pressure.
    pub offset_std_rad_per_mpa: f64,
    /// Drift of an offset.
    pub drift_std_rad_per_h: f64,
    /// Half of the backlash between joint and sensor shaft.
    pub half_play_std_rad: f64,
    /// Random walk of each joint's offset from the first view to the last, rad.
    pub walk_std_rad: [f64; MAX_JOINTS],
    /// Each joint's place on its parent link: shift m, turn rad.
    pub link_std: [[f64; 2]; MAX_JOINTS],
    /// Compliances of the joints, and of the base's mount, rad/(N m).
    pub compliance_std: [f64; 2],
    /// Load at the tool, N.
    pub tool_load_std_n: f64,
    /// Factor on robot.toml's sigmas of each camera's mount (by its number): shift, turn.
    pub mount_scale: [[f64; 2]; MAX_CAMERAS],
    /// Factor on the lenses' prior sigmas.
    pub lens_scale: f64,
    /// All measurements' standard deviations over what is stated for them.
    pub noise: f64,
    /// Noise of positions and of poses' positions, m.
    pub position_std_m: f64,
    /// Noise of poses' rotations, rad.
    pub rotation_std_rad: f64,
    /// The error that all tags of a view share (positions by SLAM have it): translation m, rotation rad. `None`: there
    /// is none.
    pub camera_error_std: Option<[f64; 2]>,
    /// Error of an image's stamp, s; times a joint's rate it is the joint's error in a moving view.
    pub time_jitter_std_s: f64,
}

impl Hyperparameters {
    /// Returns robot.toml's values, and usual ones where it states none (assumed; the data correct them).
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
        let [position_std_m, rotation_std_rad] = POSE_STD;
        Self {
            joint_std_rad,
            free_joint_std_rad: FREE_JOINT_STD_RAD,
            shape_std_rad,
            offset_std_rad_per_k: if known_per_k > 0.0 { known_per_k } else { OFFSET_STD_RAD_PER_K },
            gain_std_per_k: GAIN_STD_PER_K,
            offset_std_rad_per_mpa: OFFSET_STD_RAD_PER_MPA,
            drift_std_rad_per_h: DRIFT_STD_RAD_PER_H,
            half_play_std_rad: HALF_PLAY_STD_RAD,
            walk_std_rad: joint_std_rad,
            link_std: [[robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad]; MAX_JOINTS],
            compliance_std: [
                robot.geometry.joint_compliance_std_rad_per_nm,
                robot.geometry.mount_compliance_std_rad_per_nm,
            ],
            tool_load_std_n: robot.geometry.tool_load_std_n,
            mount_scale: [[AS_STATED; 2]; MAX_CAMERAS],
            lens_scale: AS_STATED,
            noise: AS_STATED,
            position_std_m,
            rotation_std_rad,
            camera_error_std: None,
            time_jitter_std_s: 0.0,
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
            ParameterKind::StepBefore(_) => STEP_STD_RAD,
            ParameterKind::WalkMode(k) => self.walk_std_rad[joint] * mode_std(k),
            ParameterKind::Bump(_) => BUMP_STD_RAD,
            ParameterKind::LinkShift(_) => self.link_std[joint][0],
            ParameterKind::LinkTurn(_) => self.link_std[joint][1],
            ParameterKind::Compliance => self.compliance_std[0],
            ParameterKind::MountCompliance(_) => self.compliance_std[1],
            ParameterKind::ToolLoad => self.tool_load_std_n,
        }
    }
}

/// A tenth of what a straight line leaves.
fn usual_joint_std_rad(spec: &JointSensorSpec) -> f64 {
    (0.1 * spec.linearity_std_rad).max(1e-5)
}
