//! For the tests: the sample's calibration with terms added that are drawn at random.

use nalgebra::DMatrix;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::file::calibration::Calibration;
use crate::file::covariance_file::CovarianceTable;
use crate::file::terms_table::{ReferenceTable, TermsTable};
use crate::model::{JointParameters, Parameter, ParameterKind};
use crate::solve::covariance::ParameterCovariance;
use armcal_core::robot::Robot;
use armcal_core::sensor::{Conditions, Terms, shape_prior};
use armcal_core::time::SIMULATION_EPOCH;

pub fn titan() -> Robot {
    let folder = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4");
    armcal_core::robot::load(&folder).expect("the robot reads")
}

pub fn sample() -> Calibration {
    let file =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("recordings/sample/calibration.toml");
    Calibration::read(&file).expect("the sample reads")
}

/// Parameters of all terms of `n` joints as an estimator could find them; nonlinearity up to about `nonlinearity` of
/// the range.
pub fn estimate(
    robot: &Robot,
    n: usize,
    nonlinearity: f64,
    rng: &mut ChaCha8Rng,
) -> (JointParameters, ParameterCovariance) {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let stamp = Some(SIMULATION_EPOCH.plus_s(321.0));
    let reference = Conditions { oil_c: Some(17.234), pressure_pa: Some(3.004e7), stamp };
    let mut parameters = JointParameters { reference, ..JointParameters::default() };
    let std = shape_prior(0.16);
    for (joint, spec) in robot.sensors.iter().enumerate().take(n) {
        parameters.gain[joint] = 1.0 + 0.02 * normal();
        parameters.offset_rad[joint] = 0.03 * normal();
        parameters.terms[joint] = Terms {
            nonlinearity_rad: std.map(|std| nonlinearity * spec.half_range_rad * std * normal()),
            offset_rad_per_k: 3.5e-4 * normal(),
            gain_per_k: 2e-5 * normal(),
            offset_rad_per_mpa: 3e-5 * normal(),
            drift_rad_per_h: 5e-4 * normal(),
            half_backlash_rad: 2e-4 * normal(),
            ..Terms::default()
        };
    }
    let all = (0..n).flat_map(|joint| ParameterKind::all().map(move |kind| Parameter { joint, kind }));
    let all: Vec<Parameter> = all.collect();
    let root = DMatrix::from_fn(all.len(), all.len(), |_, _| 1e-4 * normal());
    let matrix = &root * root.transpose();
    let residual_std_rad = Some(std::array::from_fn(|_| 1e-4 * (1.0 + rng.random_range(0.0..1.0))));
    (parameters, ParameterCovariance { parameters: all, matrix, residual_std_rad })
}

/// The sample as if that had been its result.
pub fn with_terms(robot: &Robot, parameters: &JointParameters, covariance: &ParameterCovariance) -> Calibration {
    let mut calibration = sample();
    calibration.reference = ReferenceTable::of(parameters, covariance);
    for (j, model) in parameters.sensors(robot).models.iter().enumerate() {
        let joint = &mut calibration.joint[j];
        let gain = model.correction.gain;
        (joint.gain_rad_per_count, joint.gain_over_datasheet) = (gain / model.spec.counts_per_rad, Some(gain));
        joint.offset_rad = model.correction.offset_rad;
        joint.residual_std_rad = covariance.residual_std_rad.map(|std_rad| std_rad[j]);
        joint.terms = TermsTable::of(j, model, covariance);
    }
    let names = covariance.parameters.iter().map(|p| p.name(robot)).collect();
    calibration.covariance_hash = None;
    calibration.covariance = CovarianceTable::new(names, &covariance.matrix);
    calibration
}
