//! What is estimated, and how large the things are that are not known exactly.

use crate::calib::bundle::walk_modes::mode_std;
use crate::calib::parameters::{Parameter, ParameterKind};
use crate::calib::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::robot::{CameraSpec, JointSensorSpec, MAX_FURTHER_CAMERAS, Robot};
use armcal_core::sensor::{Conditions, N_SHAPE, shape_prior};
use armcal_core::time::Stamp;

/// Which parameters have a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Of each joint of the arm, base first.
    pub joints: Vec<Vec<ParameterKind>>,
    /// How many joints, base first, have columns of their place on the parent link, about the drawing's.
    pub n_links: usize,
    /// How many joints, base first, have a column of their compliance, with the base's and a load at the tool; 0: none
    /// of these.
    pub n_compliant: usize,
    /// The camera's mount, about the drawing's.
    pub mount: bool,
    /// The same of each further camera; those beyond its end have none.
    pub further_mounts: Vec<bool>,
    /// Focal lengths, centre and distortion, about robot.toml's.
    pub lens: bool,
    /// The tags' poses, about the survey's.
    pub tags: bool,
    /// Pose of the tag on the gripper, about the drawing's.
    pub gripper_tag: bool,
    /// How much later the joint sensors' stamps are than the camera's.
    pub time_offset: bool,
    /// Random walk of the offsets during the views; `None`: they do not walk.
    pub walk: Option<Walk>,
}

/// A random walk of every joint's offset during the views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Ends of the first and the last view.
    pub span: [Stamp; 2],
    /// Probability of each joint's errors in time where its offset does not walk (`permutation_test`); one where no
    /// view constrains the joint.
    pub p_value: [f64; MAX_JOINTS],
    /// Log evidence of all joints' walks over none.
    pub gain_nats: f64,
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
    /// Of the random walk of each joint's offset from the first view to the last, rad.
    pub walk_std_rad: [f64; MAX_JOINTS],
    /// Of each joint's place on its parent link: shift m, turn rad.
    pub link_std: [[f64; 2]; MAX_JOINTS],
    /// Of the joints' compliances, and of the base's on what carries it, rad/(N m).
    pub compliance_std: [f64; 2],
    /// Of the load at the tool, N.
    pub tool_load_std_n: f64,
    /// Of the camera mount, over what robot.toml says of it: shift, turn.
    pub mount_scale: [f64; 2],
    /// The same of each further camera.
    pub further_mount_scale: [[f64; 2]; MAX_FURTHER_CAMERAS],
    /// Of the lens, over its prior's.
    pub lens_scale: f64,
    /// All measurements' standard deviations over what is stated for them.
    pub noise: f64,
    /// Of positions and poses that a recording gives in place of corners.
    pub position_std_m: f64,
    /// Of poses that a recording gives in place of corners.
    pub rotation_std_rad: f64,
    /// The error that all tags of a view share (positions by SLAM have it): translation m, rotation rad. `None`: there
    /// is none.
    pub camera_error_std: Option<[f64; 2]>,
    /// Of an image's stamp about the camera's clock, s: what a moving arm's angles are off by, times its rates.
    pub time_jitter_std_s: f64,
}

/// Correlation length of a sensor's nonlinearity, half ranges. Assumed: four waves over the range are then still half
/// as likely as one.
pub const SHAPE_LENGTH: f64 = 0.16;

/// Of an image's stamp about the camera's clock, with what sensors of moving joints are late by, s. Assumed.
pub(crate) const TIME_JITTER_STD_S: f64 = 0.005;

/// How far a sensor may slip on its shaft, rad. Assumed: wide, the views tell it.
pub(crate) const STEP_STD_RAD: f64 = 0.1;

/// Height of a worn spot's bump, rad. Assumed: wide, the views tell it.
pub(crate) const BUMP_STD_RAD: f64 = 0.03;

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
            walk_std_rad: joint_std_rad,
            link_std: [[robot.geometry.link_position_std_m, robot.geometry.link_rotation_std_rad]; MAX_JOINTS],
            compliance_std: [
                robot.geometry.joint_compliance_std_rad_per_nm,
                robot.geometry.mount_compliance_std_rad_per_nm,
            ],
            tool_load_std_n: robot.geometry.tool_load_std_n,
            mount_scale: [1.0; 2],
            further_mount_scale: [[1.0; 2]; MAX_FURTHER_CAMERAS],
            lens_scale: 1.0,
            noise: 1.0,
            position_std_m: 0.005,
            rotation_std_rad: 0.02,
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

impl Model {
    /// The joints' parameters in the order of their columns: sensors joint by joint, links joint by joint, sag.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let of_sensors =
            self.joints.iter().enumerate().flat_map(|(joint, kinds)| kinds.iter().map(move |&kind| (joint, kind)));
        let of_links = (0..self.n_links).flat_map(|joint| ParameterKind::all_of_link().map(move |kind| (joint, kind)));
        let of_sag = Parameter::all_of_sag(self.n_compliant).filter(|_| self.n_compliant > 0);
        of_sensors.chain(of_links).map(|(joint, kind)| Parameter { joint, kind }).chain(of_sag).collect()
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

/// Fewer views of the tag on the gripper are not used.
pub const MIN_GRIPPER_VIEWS: usize = 4;

/// Model by what the recording can tell: terms whose cause did not change have no column.
#[must_use]
pub fn model_for(robot: &Robot, views: &[View]) -> Model {
    let spread = |f: &dyn Fn(&Conditions) -> Option<f64>| {
        let values = views.iter().filter_map(|v| f(&v.conditions));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if high > low { high - low } else { 0.0 }
    };
    let warmed = spread(&|c| c.oil_c) > 0.5;
    let dived = spread(&|c| c.pressure_pa) > 2e5;
    let gripper_tag = views.iter().filter(|view| view.gripper_tag.is_some()).count() >= MIN_GRIPPER_VIEWS;
    let from_both_sides =
        |joint: usize| [-1.0, 1.0].iter().all(|side| views.iter().any(|v| v.approach[joint] == *side));
    let scope = Scope { warmed, dived, gripper_tag, from_both_sides: &from_both_sides, time_offset: false };
    Model { further_mounts: further_mounts(robot, views), ..model_of(robot, &scope) }
}

/// What a recording can tell of.
pub(crate) struct Scope<'a> {
    /// The oil's temperature and the pressure change.
    pub warmed: bool,
    pub dived: bool,
    /// There are views of a tag on the gripper.
    pub gripper_tag: bool,
    /// Whether a joint came to rest from both sides.
    pub from_both_sides: &'a dyn Fn(usize) -> bool,
    /// Images are taken while the arm moves.
    pub time_offset: bool,
}

/// By number, whether a further camera has views and a mount that is not exact.
pub(crate) fn further_mounts(robot: &Robot, views: &[View]) -> Vec<bool> {
    let has_views = |number: usize| views.iter().any(|view| view.camera == number && !view.tags.is_empty());
    let further = robot.further_cameras.iter().enumerate();
    further.map(|(at, camera)| is_loose(camera) && has_views(at + 1)).collect()
}

/// Whether the drawing leaves anything of a camera's mount open.
pub(crate) fn is_loose(camera: &CameraSpec) -> bool {
    camera.mount_std_m > 0.0 || camera.mount_std_rad > 0.0
}

/// Sensors before the camera, or before the tag on the gripper, with the mount and the tags.
pub(crate) fn model_of(robot: &Robot, scope: &Scope<'_>) -> Model {
    let gripper_joints = robot.gripper_tag.filter(|_| scope.gripper_tag).map_or(0, |tag| tag.mount.n_joints);
    let last = gripper_joints.max(robot.n_seen_joints());
    let joint = |joint: usize| {
        let spec = &robot.sensors[joint];
        // A datasheet that leaves nothing open leaves nothing to estimate.
        if joint >= last || (spec.gain_std <= 0.0 && spec.offset_std_rad <= 0.0) {
            return Vec::new();
        }
        let wanted = [
            (spec.gain_std > 0.0, ParameterKind::Gain),
            (spec.offset_std_rad > 0.0, ParameterKind::Offset),
            (scope.warmed, ParameterKind::OffsetPerK),
            (scope.warmed, ParameterKind::GainPerK),
            (scope.dived, ParameterKind::OffsetPerMpa),
            ((scope.from_both_sides)(joint), ParameterKind::HalfBacklash),
        ];
        let kinds = wanted.into_iter().filter(|(wanted, _)| *wanted).map(|(_, kind)| kind);
        kinds.chain(shape_kinds().filter(|_| spec.linearity_std_rad > 0.0)).collect()
    };
    Model {
        joints: (0..robot.n_joints()).map(joint).collect(),
        n_links: 0,
        n_compliant: 0,
        mount: is_loose(&robot.camera),
        further_mounts: Vec::new(),
        lens: false,
        tags: true,
        gripper_tag: scope.gripper_tag,
        time_offset: scope.time_offset,
        walk: None,
    }
}

/// The middle of the views' conditions.
#[must_use]
pub fn reference(views: &[View]) -> Conditions {
    let mean = |f: &dyn Fn(&Conditions) -> Option<f64>| {
        let values: Vec<f64> = views.iter().filter_map(|v| f(&v.conditions)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let stamps = views.iter().filter_map(|v| v.conditions.stamp);
    let (first, last) = (stamps.clone().min(), stamps.max());
    let middle = first.zip(last).map(|(a, b)| a.plus_s(0.5 * b.since_s(a)));
    Conditions { oil_c: mean(&|c| c.oil_c), pressure_pa: mean(&|c| c.pressure_pa), stamp: middle }
}
