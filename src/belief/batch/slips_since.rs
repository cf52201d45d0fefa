//! Sensors that slipped between an earlier calibration and this one.
//!
//! Where prior and new views contradict each other and the result uses only the new views, both calibrations are
//! compared. The mean change of a joint's angle at the same readings is taken over the angles that both cover. Its
//! variance holds both covariances and the sensor's drift over the time between. A change beyond [`MIN_SIGMAS`] of
//! that, and beyond drift, is a slip. Views determine only that it was before the first of them.

use crate::batch::constants::slips_since::{MIN_SIGMAS, MIN_SLIP_RAD, N_ANGLES};
use nalgebra::DVector;

use crate::explain::calibration_prior::drift_std_rad_per_sqrt_h;
use crate::file::calibration::Calibration;
use crate::model::parameters::{JointParameters, Parameter};
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use armcal_core::robot::Robot;
use armcal_core::sensor::ConditionChange;

/// One of the two calibrations in the comparison.
struct Side<'a> {
    calibration: &'a Calibration,
    parameters: JointParameters,
    /// Change of conditions from this calibration's reference to that of the later one.
    change: ConditionChange,
}

impl Side<'_> {
    /// Mean angle of a joint at `travels_rad`, and its variance.
    fn mean_angle(&self, robot: &Robot, joint: usize, travels_rad: &[f64]) -> (f64, f64) {
        let (spec, correction) = (&robot.sensors[joint], self.parameters.correction(joint));
        let mean = |f: &dyn Fn(f64) -> f64| travels_rad.iter().map(|t| f(*t)).sum::<f64>() / travels_rad.len() as f64;
        let angle_rad = mean(&|travel| correction.angle_rad(spec, travel, &self.change, 0.0));
        let covariance = self.calibration.parameter_covariance(robot);
        let by = |parameter: &Parameter| {
            let own = if parameter.joint == joint { 1.0 } else { 0.0 };
            own * mean(&|travel| parameter.kind.angle_derivative(spec, travel, &self.change, 0.0))
        };
        let by = DVector::from_iterator(covariance.parameters.len(), covariance.parameters.iter().map(by));
        (angle_rad, (&covariance.matrix * &by).dot(&by).max(0.0))
    }
}

/// Returns the slips between `before` and `now`; `robot` has the sensors of `now`.
pub(crate) fn slips_since(before: &Calibration, now: &Calibration, robot: &Robot) -> Vec<Finding> {
    let (old, new) = (before.parameters(robot), now.parameters(robot));
    let change = new.reference.departure_from(&old.reference);
    let old = Side { calibration: before, parameters: old, change };
    let new = Side { calibration: now, parameters: new, change: ConditionChange::default() };
    let elapsed_h = (now.valid.time_nanos - before.valid.time_nanos).max(0) as f64 / 3.6e12;
    let joints = 0..robot.n_seen_joints();
    let mut slips: Vec<Finding> = joints.filter_map(|joint| slip(robot, joint, (&old, &new), elapsed_h)).collect();
    slips.sort_by(|a, b| b.size.map(f64::abs).partial_cmp(&a.size.map(f64::abs)).unwrap_or(std::cmp::Ordering::Equal));
    slips
}

fn slip(robot: &Robot, joint: usize, (old, new): (&Side<'_>, &Side<'_>), elapsed_h: f64) -> Option<Finding> {
    let (a, b) = (old.calibration.joint.get(joint)?, new.calibration.joint.get(joint)?);
    if !(a.offset_estimated && b.offset_estimated) {
        return None;
    }
    let (low, high) = (a.covered_rad[0].max(b.covered_rad[0]), a.covered_rad[1].min(b.covered_rad[1]));
    if low >= high {
        return None;
    }
    let sensor = &new.parameters.sensors(robot).models[joint];
    let angle = |k: usize| low + (high - low) * k as f64 / (N_ANGLES - 1) as f64;
    let travels: Vec<f64> = (0..N_ANGLES).map(|k| sensor.travel_under_rad(angle(k), &new.change)).collect();
    let ((was_rad, was_var), (is_rad, is_var)) =
        (old.mean_angle(robot, joint, &travels), new.mean_angle(robot, joint, &travels));
    let drift_var = drift_std_rad_per_sqrt_h(&robot.sensors[joint]).powi(2) * elapsed_h;
    // The reading rose by as much as the angle at the same reading fell.
    let size_rad = was_rad - is_rad;
    let std_rad = (was_var + is_var + drift_var).sqrt();
    (size_rad.abs() > MIN_SLIP_RAD.max(MIN_SIGMAS * std_rad)).then(|| Finding {
        kind: FindingKind::SensorSlip,
        name: b.name.clone(),
        size: Some(size_rad),
        unit: Some(FindingUnit::of_joint(robot.sensors[joint].moves)),
        tool_error_m: None,
        // The slip was before the first view.
        time_s: Some(0.0),
        repaired: true,
    })
}
