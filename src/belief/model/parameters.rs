//! The parameters of the joint sensors: gain, offset, nonlinearity and what changes with temperature, pressure and
//! time.
//!
//! `theta_j = center_j + gain_j * travel_j + offset_j` (the paper's equation 2), and the terms of
//! [`armcal_core::sensor`].

use crate::model::constants::parameters::{FAR_WIDTHS, SHAPE_STD, SPOT_WIDTH_RAD};
use armcal_core::kinematics::LinkCorrections;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::sensor::{
    ArmSensors, Bump, ConditionChange, Conditions, Correction, N_SHAPE, Terms, nonlinearity_basis,
};
use armcal_core::streams::MAX_JOINTS;
use armcal_core::time::Stamp;

/// Gain (dimensionless, 1 = datasheet) and offset (rad) of every joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointParameters {
    /// Factor on the nominal travel, base first; 1 beyond the arm's joints.
    pub gain: [f64; MAX_JOINTS],
    /// Added to the angle, base first.
    pub offset_rad: [f64; MAX_JOINTS],
    /// Zero under methods that estimate straight sensors.
    pub terms: [Terms; MAX_JOINTS],
    /// Where joints sit on their parent links beyond the drawing; zero where that was not estimated.
    pub links: LinkCorrections,
    /// Conditions at which the terms are zero.
    pub reference: Conditions,
}

impl Default for JointParameters {
    fn default() -> Self {
        Self {
            gain: [1.0; MAX_JOINTS],
            offset_rad: [0.0; MAX_JOINTS],
            terms: [Terms::default(); MAX_JOINTS],
            links: LinkCorrections::default(),
            reference: Conditions::default(),
        }
    }
}

impl JointParameters {
    /// Value in the parameter's own unit.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> f64 {
        match parameter.kind {
            ParameterKind::Gain => self.gain[parameter.joint],
            ParameterKind::Offset => self.offset_rad[parameter.joint],
            ParameterKind::Shape(h) => self.terms[parameter.joint].nonlinearity_rad[usize::from(h)],
            ParameterKind::OffsetPerK => self.terms[parameter.joint].offset_rad_per_k,
            ParameterKind::GainPerK => self.terms[parameter.joint].gain_per_k,
            ParameterKind::OffsetPerMpa => self.terms[parameter.joint].offset_rad_per_mpa,
            ParameterKind::DriftPerH => self.terms[parameter.joint].drift_rad_per_h,
            ParameterKind::HalfBacklash => self.terms[parameter.joint].half_backlash_rad,
            // These are the sensors as they are now.
            ParameterKind::StepBefore(_) | ParameterKind::WalkMode(_) => 0.0,
            ParameterKind::Bump(_) => self.terms[parameter.joint].bump.height_rad,
            ParameterKind::LinkShift(axis) => self.links[parameter.joint].shift_m[usize::from(axis)],
            ParameterKind::LinkTurn(axis) => self.links[parameter.joint].turn_rad[usize::from(axis)],
            ParameterKind::Compliance => self.links.sag.joint_rad_per_nm[parameter.joint],
            ParameterKind::MountCompliance(axis) => self.links.sag.mount_rad_per_nm[usize::from(axis)],
            ParameterKind::ToolLoad => self.links.sag.tool_load_n,
        }
    }

    /// Sets the value in the parameter's own unit.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        match parameter.kind {
            ParameterKind::Gain => self.gain[parameter.joint] = value,
            ParameterKind::Offset => self.offset_rad[parameter.joint] = value,
            ParameterKind::Shape(h) => self.terms[parameter.joint].nonlinearity_rad[usize::from(h)] = value,
            ParameterKind::OffsetPerK => self.terms[parameter.joint].offset_rad_per_k = value,
            ParameterKind::GainPerK => self.terms[parameter.joint].gain_per_k = value,
            ParameterKind::OffsetPerMpa => self.terms[parameter.joint].offset_rad_per_mpa = value,
            ParameterKind::DriftPerH => self.terms[parameter.joint].drift_rad_per_h = value,
            ParameterKind::HalfBacklash => self.terms[parameter.joint].half_backlash_rad = value,
            ParameterKind::StepBefore(_) | ParameterKind::WalkMode(_) => {}
            ParameterKind::Bump(spot) => self.terms[parameter.joint].bump = spot.bump(value),
            ParameterKind::LinkShift(axis) => self.links[parameter.joint].shift_m[usize::from(axis)] = value,
            ParameterKind::LinkTurn(axis) => self.links[parameter.joint].turn_rad[usize::from(axis)] = value,
            ParameterKind::Compliance => self.links.sag.joint_rad_per_nm[parameter.joint] = value,
            ParameterKind::MountCompliance(axis) => self.links.sag.mount_rad_per_nm[usize::from(axis)] = value,
            ParameterKind::ToolLoad => self.links.sag.tool_load_n = value,
        }
    }

    /// All parameters of one joint.
    #[must_use]
    pub fn correction(&self, joint: usize) -> Correction {
        Correction { gain: self.gain[joint], offset_rad: self.offset_rad[joint], terms: self.terms[joint] }
    }

    /// True if there are only gains and offsets.
    #[must_use]
    pub fn are_linear(&self) -> bool {
        self.terms.iter().all(Terms::are_zero)
    }

    /// `robot` with its links as estimated.
    #[must_use]
    pub fn with_links(&self, mut robot: Robot) -> Robot {
        if self.links != LinkCorrections::default() {
            robot.chain = robot.chain.corrected(&self.links);
        }
        robot
    }

    /// The sensors of `robot` with these parameters.
    #[must_use]
    pub fn sensors(&self, robot: &Robot) -> ArmSensors {
        let mut sensors = ArmSensors::nominal(robot);
        for (joint, model) in sensors.models.iter_mut().enumerate() {
            model.correction = self.correction(joint);
        }
        sensors.reference = self.reference;
        sensors
    }
}

/// Kinds of parameters of a joint and its sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParameterKind {
    /// Factor on the nominal travel.
    Gain,
    /// Added to the angle, rad.
    Offset,
    /// A coefficient of the nonlinearity, 0 .. [`N_SHAPE`](armcal_core::sensor::N_SHAPE).
    Shape(u8),
    /// Change of the offset with the oil temperature, rad/K.
    OffsetPerK,
    /// Change of the gain with the oil temperature, 1/K.
    GainPerK,
    /// Change of the offset with the ambient pressure, rad/MPa.
    OffsetPerMpa,
    /// Change of the offset with time, rad/h.
    DriftPerH,
    /// Half of the backlash between joint and sensor shaft, rad.
    HalfBacklash,
    /// Angle at the same reading before the sensor slipped, less that after it, in views that end before this stamp, rad.
    StepBefore(Stamp),
    /// A mode of the random walk that led to the offset as it is at the last view, rad.
    WalkMode(u8),
    /// Height of a worn spot's bump, rad; one a joint.
    Bump(WornSpot),
    /// Shift of the joint's origin along an axis of its parent link, m.
    LinkShift(u8),
    /// Of the joint's attitude about an axis of its parent link, rad.
    LinkTurn(u8),
    /// Of the joint's angle behind its sensor by the torque of weight, rad/(N m).
    Compliance,
    /// Of the base's turn about one of its axes by the torque of weight, rad/(N m); of joint 0 alone.
    MountCompliance(u8),
    /// Weight at the tool that the drawing does not have, N; of joint 0 alone.
    ToolLoad,
}

impl ParameterKind {
    /// All that a sensor keeps, in their order.
    pub fn all() -> impl Iterator<Item = Self> {
        let shape = (0..N_SHAPE as u8).map(Self::Shape);
        let rest = [Self::OffsetPerK, Self::GainPerK, Self::OffsetPerMpa, Self::DriftPerH, Self::HalfBacklash];
        [Self::Gain, Self::Offset].into_iter().chain(shape).chain(rest)
    }

    /// All of a joint's place on its parent link, in their order.
    pub fn all_of_link() -> impl Iterator<Item = Self> {
        (0..3).map(Self::LinkShift).chain((0..3).map(Self::LinkTurn))
    }

    /// Whether it is of the link's geometry or of how the arm bends, not of a sensor.
    #[must_use]
    pub fn is_of_body(self) -> bool {
        matches!(self, Self::LinkShift(_) | Self::LinkTurn(_)) || self.is_of_sag()
    }

    /// Whether it is of how the arm bends under its weight.
    #[must_use]
    pub fn is_of_sag(self) -> bool {
        matches!(self, Self::Compliance | Self::MountCompliance(_) | Self::ToolLoad)
    }

    /// d(angle)/d(parameter) at `travel_rad`, in rad per the parameter's unit.
    #[must_use]
    pub fn angle_derivative(
        self,
        spec: &JointSensorSpec,
        travel_rad: f64,
        departure: &ConditionChange,
        approach: f64,
    ) -> f64 {
        match self {
            Self::Gain => travel_rad,
            Self::Offset => 1.0,
            Self::Shape(h) => nonlinearity_basis(travel_rad / spec.half_range_rad)[usize::from(h)],
            Self::OffsetPerK => departure.oil_k,
            Self::GainPerK => departure.oil_k * travel_rad,
            Self::OffsetPerMpa => departure.pressure_mpa,
            Self::DriftPerH => departure.elapsed_h,
            Self::HalfBacklash => approach,
            Self::StepBefore(_) | Self::WalkMode(_) => 0.0,
            Self::Bump(spot) => spot.bump(0.0).share(travel_rad),
            Self::LinkShift(_) | Self::LinkTurn(_) => 0.0,
            Self::Compliance | Self::MountCompliance(_) | Self::ToolLoad => 0.0,
        }
    }
}

/// Where a sensor's track is worn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct WornSpot {
    /// Travel of its middle from that of the joint's range, microradians: a whole number, so that kinds can be
    /// compared.
    at_urad: i32,
}

impl WornSpot {
    /// About `travel_rad` from the middle of the joint's range.
    #[must_use]
    pub fn about(travel_rad: f64) -> Self {
        Self { at_urad: (1e6 * travel_rad).round() as i32 }
    }

    /// Travel of its middle from that of the joint's range, rad.
    #[must_use]
    pub fn at_rad(self) -> f64 {
        1e-6 * f64::from(self.at_urad)
    }

    /// As high as that.
    #[must_use]
    pub fn bump(self, height_rad: f64) -> Bump {
        Bump { at_rad: self.at_rad(), width_rad: SPOT_WIDTH_RAD, height_rad }
    }

    /// What a track that is worn otherwise is off at a travel from the middle of the range, one sigma, as a share of
    /// the height: by the bump's slopes along its middle and its width, about a spot half as wide again.
    #[must_use]
    pub fn shape_error_share(self, travel_rad: f64) -> f64 {
        let widths = (travel_rad - self.at_rad()) / (1.5 * SPOT_WIDTH_RAD);
        SHAPE_STD * widths.abs() * (1.0 + widths * widths).sqrt() * (-0.5 * widths * widths).exp()
    }

    /// Whether a travel from the middle of the range is on it.
    #[must_use]
    pub fn is_about(self, travel_rad: f64) -> bool {
        (travel_rad - self.at_rad()).abs() < SPOT_WIDTH_RAD
    }

    /// Whether a view at a travel from the middle of the range tells of it: more than a tenth of its height.
    #[must_use]
    pub fn is_seen_from(self, travel_rad: f64) -> bool {
        (travel_rad - self.at_rad()).abs() < 2.0 * SPOT_WIDTH_RAD
    }

    /// Whether what happens at a travel from the middle of the range is about something else.
    #[must_use]
    pub fn is_far_from(self, travel_rad: f64) -> bool {
        (travel_rad - self.at_rad()).abs() > FAR_WIDTHS * SPOT_WIDTH_RAD
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// One number that may be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Parameter {
    /// Index of the joint, base first.
    pub joint: usize,
    /// Which of its parameters.
    pub kind: ParameterKind,
}

impl Parameter {
    /// All that a calibration may hold of an arm of `n_joints`: joint by joint its sensor's and its link's, then sag's.
    pub fn all(n_joints: usize) -> impl Iterator<Item = Self> {
        let of_joint = || ParameterKind::all().chain(ParameterKind::all_of_link());
        let of_joints = (0..n_joints).flat_map(move |joint| of_joint().map(move |kind| Self { joint, kind }));
        of_joints.chain(Self::all_of_sag(n_joints))
    }

    /// All of how an arm bends whose first `n_joints` give.
    pub fn all_of_sag(n_joints: usize) -> impl Iterator<Item = Self> {
        let of_arm = (0..3).map(ParameterKind::MountCompliance).chain([ParameterKind::ToolLoad]);
        let of_joints = (0..n_joints).map(|joint| Self { joint, kind: ParameterKind::Compliance });
        of_joints.chain(of_arm.map(|kind| Self { joint: 0, kind }))
    }

    /// One sigma of the datasheet's prior, in the parameter's unit; zero for terms that the datasheet does not know.
    #[must_use]
    pub fn prior_std(self, robot: &Robot) -> f64 {
        let spec = &robot.sensors[self.joint];
        match self.kind {
            ParameterKind::Gain => spec.gain_std,
            ParameterKind::Offset => spec.offset_std_rad,
            ParameterKind::OffsetPerK => spec.temperature_std_rad_per_k,
            _ => 0.0,
        }
    }

    /// Whether it tells of the sensor as it was, and not as it is at the last view.
    #[must_use]
    pub fn is_past(self) -> bool {
        self.is_step() || matches!(self.kind, ParameterKind::WalkMode(_))
    }

    /// Whether it tells of the sensor before it slipped.
    #[must_use]
    pub fn is_step(self) -> bool {
        matches!(self.kind, ParameterKind::StepBefore(_))
    }

    /// `shoulder_yaw gain`.
    #[must_use]
    pub fn name(self, robot: &Robot) -> String {
        let kind = match self.kind {
            ParameterKind::Gain => "gain",
            ParameterKind::Offset => "offset",
            ParameterKind::Shape(h) => return format!("{} shape {}", robot.sensors[self.joint].joint, h + 1),
            ParameterKind::OffsetPerK => "offset per K",
            ParameterKind::GainPerK => "gain per K",
            ParameterKind::OffsetPerMpa => "offset per MPa",
            ParameterKind::DriftPerH => "drift per h",
            ParameterKind::HalfBacklash => "half play",
            ParameterKind::StepBefore(_) => "step",
            ParameterKind::WalkMode(k) => return format!("{} walk {}", robot.sensors[self.joint].joint, k + 1),
            ParameterKind::Bump(_) => "bump",
            ParameterKind::LinkShift(axis) => {
                return format!("{} place {}", robot.sensors[self.joint].joint, AXES[usize::from(axis)]);
            }
            ParameterKind::LinkTurn(axis) => {
                return format!("{} place r{}", robot.sensors[self.joint].joint, AXES[usize::from(axis)]);
            }
            ParameterKind::Compliance => "compliance",
            ParameterKind::MountCompliance(axis) => return format!("mount compliance r{}", AXES[usize::from(axis)]),
            ParameterKind::ToolLoad => return "load at the tool".to_owned(),
        };
        format!("{} {kind}", robot.sensors[self.joint].joint)
    }
}
