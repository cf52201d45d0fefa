//! The parameters of the joint sensors: gain, offset, nonlinearity and what changes with temperature, pressure and
//! time.
//!
//! `theta_j = center_j + gain_j * travel_j + offset_j` (the paper's equation 2), and the terms of
//! [`armcal_core::sensor`].

use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::sensor::{ArmSensors, ConditionChange, Conditions, Correction, N_SHAPE, Terms, nonlinearity_basis};
use armcal_core::streams::MAX_JOINTS;
use armcal_core::time::Stamp;

/// Gain (dimensionless, 1 = datasheet) and offset (rad) of every joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointParameters {
    pub gain: [f64; MAX_JOINTS],
    pub offset_rad: [f64; MAX_JOINTS],
    /// Zero under methods that estimate straight sensors.
    pub terms: [Terms; MAX_JOINTS],
    /// What the terms are counted from.
    pub reference: Conditions,
}

impl Default for JointParameters {
    fn default() -> Self {
        Self {
            gain: [1.0; MAX_JOINTS],
            offset_rad: [0.0; MAX_JOINTS],
            terms: [Terms::default(); MAX_JOINTS],
            reference: Conditions::default(),
        }
    }
}

impl JointParameters {
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
            ParameterKind::StepBefore(_) => 0.0,
        }
    }

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
            ParameterKind::StepBefore(_) => {}
        }
    }

    #[must_use]
    pub fn correction(&self, joint: usize) -> Correction {
        Correction { gain: self.gain[joint], offset_rad: self.offset_rad[joint], terms: self.terms[joint] }
    }

    /// Whether there is nothing but gains and offsets.
    #[must_use]
    pub fn are_linear(&self) -> bool {
        self.terms.iter().all(Terms::are_zero)
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ParameterKind {
    Gain,
    Offset,
    /// A coefficient of the nonlinearity, 0 .. [`N_SHAPE`](armcal_core::sensor::N_SHAPE).
    Shape(u8),
    OffsetPerK,
    GainPerK,
    OffsetPerMpa,
    DriftPerH,
    HalfBacklash,
    /// What the angle was more at the same reading before the sensor slipped: in views that end before this stamp, rad.
    StepBefore(Stamp),
}

impl ParameterKind {
    /// All that a sensor keeps, in their order.
    pub fn all() -> impl Iterator<Item = Self> {
        let shape = (0..N_SHAPE as u8).map(Self::Shape);
        let rest = [Self::OffsetPerK, Self::GainPerK, Self::OffsetPerMpa, Self::DriftPerH, Self::HalfBacklash];
        [Self::Gain, Self::Offset].into_iter().chain(shape).chain(rest)
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
            Self::StepBefore(_) => 0.0,
        }
    }
}

/// One number that may be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Parameter {
    pub joint: usize,
    pub kind: ParameterKind,
}

impl Parameter {
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

    /// Whether it tells of the sensor before it slipped, and not of the sensor as it is.
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
        };
        format!("{} {kind}", robot.sensors[self.joint].joint)
    }
}
