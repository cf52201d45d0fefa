//! Error bounds from an estimate: the joint error that its covariance allows, as an envelope that is convex in the
//! angle.
//!
//! Over the whole range the std `s(t)` of the joint's angle at travel t follows from the covariance of all of the
//! joint's parameters: `s^2 = b(t)^T P b(t)`, with b the derivative of the angle by them. A few views may determine the
//! joint at one angle, but hardly its gain. Then four sigma of a normal prior far exceed the error under the
//! datasheet's worst gain. There the worst gain times the distance from the known angle limits it. The bound is the
//! least `a + k |angle - pivot|` above the lesser of the two.

use crate::file::calibration::Calibration;
use crate::model::ParameterKind;
use crate::plan::bounds::joint_bounds::{JointBound, JointErrorBounds};
use crate::plan::constants::bounds_estimate_bounds::{AT_REST_RAD, PLACES, SIGMAS};
use crate::solve::covariance::{JointAt, ParameterCovariance};
use armcal_core::robot::Robot;
use armcal_core::sensor::{ArmSensors, ConditionChange, SensorModel};

impl JointErrorBounds {
    /// Returns the bounds of the sensors in `calibration`, accepted or not. Joints that it did not determine keep the
    /// datasheet's bounds.
    ///
    /// `sensors` are the calibration's own.
    #[must_use]
    pub fn believed(robot: &Robot, calibration: &Calibration, sensors: &ArmSensors) -> Self {
        Self::by_covariance(robot, &calibration.parameter_covariance(robot), sensors)
    }

    /// Returns the bounds of `sensors` whose parameters have the covariance `covariance`.
    #[must_use]
    pub fn by_covariance(robot: &Robot, covariance: &ParameterCovariance, sensors: &ArmSensors) -> Self {
        let mut bounds = Self::datasheet(robot);
        for (joint, bound) in bounds.joints.iter_mut().enumerate() {
            let Some(model) = sensors.models.get(joint) else { continue };
            if let Some(found) = AngleStd::new(covariance, robot, joint, model).and_then(|b| b.envelope()) {
                *bound = found;
            }
        }
        bounds
    }
}

/// Std of one joint's angle over its range.
struct AngleStd<'a> {
    model: &'a SensorModel,
    joint: usize,
    covariance: &'a ParameterCovariance,
    residual_std_rad: f64,
    /// Largest difference of true and estimated gain that the datasheet allows.
    gain_reach: f64,
    linearity_std_rad: f64,
}

impl<'a> AngleStd<'a> {
    fn new(covariance: &'a ParameterCovariance, robot: &Robot, joint: usize, model: &'a SensorModel) -> Option<Self> {
        let mut kinds = covariance.parameters.iter().filter(|p| p.joint == joint).map(|p| p.kind);
        kinds.clone().find(|kind| *kind == ParameterKind::Offset)?;
        let spec = &robot.sensors[joint];
        let has_shape = kinds.any(|kind| matches!(kind, ParameterKind::Shape(_)));
        let own_residual_rad = covariance.residual_std_rad.map_or(spec.linearity_std_rad, |std_rad| std_rad[joint]);
        let residual_std_rad = if has_shape { own_residual_rad } else { own_residual_rad.max(spec.linearity_std_rad) };
        // The reading's gain is 1 + g, the estimated gain its inverse.
        let (gain, g) = (model.correction.gain, spec.gain_bound);
        let gain_reach = (gain - 1.0 / (1.0 + g)).abs().max((1.0 / (1.0 - g) - gain).abs());
        let linearity_std_rad = spec.linearity_std_rad;
        Some(Self { model, joint, covariance, residual_std_rad, gain_reach, linearity_std_rad })
    }

    fn std_rad(&self, travel_rad: f64) -> f64 {
        let at = JointAt { spec: &self.model.spec, joint: self.joint, travel_rad };
        self.covariance.angle_var_rad2(at, &ConditionChange::default(), self.residual_std_rad.powi(2)).sqrt()
    }

    /// Returns `None` if the covariance is invalid.
    fn envelope(&self) -> Option<JointBound> {
        let half_range_rad = self.model.spec.half_range_rad;
        let travel = |k: usize| half_range_rad * (2.0 * k as f64 / (PLACES - 1) as f64 - 1.0);
        let stds: Vec<f64> = (0..PLACES).map(|k| self.std_rad(travel(k))).collect();
        if stds.iter().any(|std| !std.is_finite()) {
            return None;
        }
        let best = (0..PLACES).min_by(|&a, &b| stds[a].total_cmp(&stds[b]))?;
        let at_pivot_rad = SIGMAS * stds[best] + AT_REST_RAD;
        let beyond = |k: usize| {
            let way_rad = (travel(k) - travel(best)).abs();
            let by_gain_rad = self.gain_reach * way_rad + SIGMAS * self.linearity_std_rad;
            (SIGMAS * stds[k] + AT_REST_RAD - at_pivot_rad).min(by_gain_rad) / way_rad
        };
        let slope = (0..PLACES).filter(|&k| k != best).map(beyond).fold(0.0, f64::max);
        let gain = self.model.correction.gain;
        let pivot_rad =
            self.model.correction.angle_rad(&self.model.spec, travel(best), &ConditionChange::default(), 0.0);
        Some(JointBound { pivot_rad, at_pivot_rad, slope: slope / gain.abs().max(0.1) })
    }
}
