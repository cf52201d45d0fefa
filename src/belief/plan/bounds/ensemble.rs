//! Arms sampled from the belief: true link positions for given sensor readings.
//!
//! Quantiles of the links' displacement are counted over these arms with the exact kinematics. Under the datasheet the
//! errors are uniform and large, so neither a normal distribution nor a linearization gives a valid 99 % quantile.

use crate::plan::constants::bounds_ensemble::{BOUNDS_EASE, N_ARMS, N_PROPOSED};
use nalgebra::{DVector, Point3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::file::calibration::Calibration;
use crate::model::{Parameter, ParameterKind};
use armcal_core::kinematics::LinkPoses;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::sensor::{ArmSensors, ConditionChange, Conditions};
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// Equally likely arms sampled from the belief.
pub struct ArmEnsemble {
    sensors: ArmSensors,
    arms: Vec<Arm>,
    /// Parameter of each row of `Arm::deviation`.
    parameters: Vec<Parameter>,
    n_joints: usize,
    departure: ConditionChange,
}

/// Deviation of one sampled arm from the believed arm.
struct Arm {
    deviation: DVector<f64>,
    /// Error of each joint that no parameter describes, rad.
    residual_rad: [f64; MAX_JOINTS],
}

impl ArmEnsemble {
    /// Samples gains and offsets uniformly within their datasheet bounds.
    #[must_use]
    pub fn datasheet(robot: &Robot, rng: &mut ChaCha8Rng) -> Self {
        let joints = 0..robot.n_joints();
        let kinds = [ParameterKind::Gain, ParameterKind::Offset];
        let parameters: Vec<Parameter> =
            joints.flat_map(|joint| kinds.map(move |kind| Parameter { joint, kind })).collect();
        let arms = (0..N_ARMS)
            .map(|_| {
                let mut deviation = DVector::zeros(parameters.len());
                for (joint, spec) in robot.sensors.iter().enumerate() {
                    let gain = rng.random_range(-1.0..=1.0) * spec.gain_bound;
                    let offset_rad = rng.random_range(-1.0..=1.0) * spec.offset_bound_rad;
                    // A joint with reading r has the travel (r - o) / (1 + g).
                    deviation[2 * joint] = 1.0 / (1.0 + gain) - 1.0;
                    deviation[2 * joint + 1] = -offset_rad / (1.0 + gain);
                }
                let std_rad = |joint: usize| {
                    let spec = &robot.sensors[joint];
                    spec.linearity_std_rad.hypot(reading_std_rad(spec))
                };
                Arm { deviation, residual_rad: residual(rng, std_rad, robot) }
            })
            .collect();
        let (sensors, departure) = (ArmSensors::nominal(robot), ConditionChange::default());
        Self { sensors, arms, parameters, n_joints: robot.n_joints(), departure }
    }

    /// Samples arms from an estimate under the conditions `now`: from its covariance, within the datasheet's bounds.
    /// Joints that the estimate did not determine are sampled from the datasheet.
    #[must_use]
    pub fn believed(robot: &Robot, calibration: &Calibration, now: &Conditions, rng: &mut ChaCha8Rng) -> Self {
        let robot = calibration.scaled_robot(robot);
        let mut ensemble = Self::datasheet(&robot, rng);
        let Ok(sensors) = calibration.sensors(&robot) else { return ensemble };
        let covariance = calibration.parameter_covariance(&robot);
        let n = covariance.parameters.len();
        let Some(root) = root_of(&covariance.matrix) else { return ensemble };
        let is_known = |joint: usize| covariance.parameters.iter().any(|p| p.joint == joint);
        let departure = now.departure_from(&sensors.reference);
        let residual_std_rad = |joint: usize| {
            let spec = &robot.sensors[joint];
            let left_rad = covariance.residual_std_rad.map_or(spec.linearity_std_rad, |std_rad| std_rad[joint]);
            let has = |kind| covariance.parameters.contains(&Parameter { joint, kind });
            // Temperature and time effects for which the estimate has no term.
            let warmed_rad =
                if has(ParameterKind::OffsetPerK) { 0.0 } else { spec.temperature_std_rad_per_k * departure.oil_k };
            let wandered_rad = spec.drift_std_rad_per_sqrt_h * departure.elapsed_h.abs().sqrt();
            let play_rad = sensors.models[joint].correction.terms.half_backlash_rad;
            [reading_std_rad(spec), warmed_rad, wandered_rad, play_rad].into_iter().fold(left_rad, f64::hypot)
        };
        let mut parameters = covariance.parameters.clone();
        let unknown: Vec<usize> =
            (0..ensemble.parameters.len()).filter(|&k| !is_known(ensemble.parameters[k].joint)).collect();
        parameters.extend(unknown.iter().map(|&k| ensemble.parameters[k]));
        let datasheet = Datasheet::new(&robot, &covariance.parameters, &sensors);
        let drawn: Vec<(DVector<f64>, f64)> = (0..N_PROPOSED)
            .map(|_| {
                let deviation = &root * DVector::from_fn(n, |_, _| StandardNormal.sample(rng));
                let weight = datasheet.weight(&deviation);
                (deviation, weight)
            })
            .collect();
        let picked = resampled(&drawn, ensemble.arms.len());
        for (arm, pick) in ensemble.arms.iter_mut().zip(picked) {
            let kept = unknown.iter().map(|&k| arm.deviation[k]);
            let all: Vec<f64> = drawn[pick].0.iter().copied().chain(kept).collect();
            arm.deviation = DVector::from_vec(all);
            arm.residual_rad = residual(rng, residual_std_rad, &robot);
        }
        Self { sensors, parameters, departure, ..ensemble }
    }

    /// Returns the true angles of each sampled arm when its sensors read `believed`.
    pub fn arms<'a>(&'a self, believed: &'a JointAngles) -> impl Iterator<Item = JointAngles> + 'a {
        let travel: Vec<f64> =
            (0..self.n_joints).map(|j| self.sensors.models[j].travel_under_rad(believed[j], &self.departure)).collect();
        let by: Vec<f64> = self
            .parameters
            .iter()
            .map(|p| p.kind.angle_derivative(&self.sensors.models[p.joint].spec, travel[p.joint], &self.departure, 0.0))
            .collect();
        self.arms.iter().map(move |arm| {
            let mut error_rad = arm.residual_rad;
            for ((parameter, by), deviation) in self.parameters.iter().zip(&by).zip(arm.deviation.iter()) {
                error_rad[parameter.joint] += by * deviation;
            }
            JointAngles::from_fn(self.n_joints, |joint| believed[joint] + error_rad[joint])
        })
    }

    /// Returns the `quantile` of the distance between true and believed end of each link, m, from the first joint's
    /// link on.
    #[must_use]
    pub fn link_displacement_quantiles_m(&self, robot: &Robot, believed: &JointAngles, quantile: f64) -> Vec<f64> {
        let there = link_ends(robot, &robot.chain.link_poses(believed));
        let mut distances: Vec<Vec<f64>> = vec![Vec::with_capacity(self.arms.len()); there.len()];
        for arm in self.arms(believed) {
            let ends = link_ends(robot, &robot.chain.link_poses(&arm));
            for ((list, end), believed_end) in distances.iter_mut().zip(&ends).zip(&there) {
                list.push((end - believed_end).norm());
            }
        }
        distances.iter_mut().map(|list| order_statistic(list, quantile)).collect()
    }
}

/// Datasheet density of gains and offsets, which replaces the normal prior of the estimate.
///
/// The estimate's density is the likelihood times that normal prior. The belief is the likelihood times a uniform
/// density within the datasheet's bounds. The two differ where the views determine little.
struct Datasheet {
    joints: Vec<DatasheetJoint>,
}

/// One joint whose gain and offset were estimated.
struct DatasheetJoint {
    gain_row: usize,
    offset_row: usize,
    /// Estimated gain.
    gain: f64,
    offset_rad: f64,
    spec: JointSensorSpec,
}

impl Datasheet {
    fn new(robot: &Robot, parameters: &[Parameter], sensors: &ArmSensors) -> Self {
        let row = |joint, kind| parameters.iter().position(|p| *p == Parameter { joint, kind });
        let joints = robot.sensors.iter().enumerate().filter_map(|(joint, spec)| {
            let correction = &sensors.models[joint].correction;
            Some(DatasheetJoint {
                gain_row: row(joint, ParameterKind::Gain)?,
                offset_row: row(joint, ParameterKind::Offset)?,
                gain: correction.gain,
                offset_rad: correction.offset_rad,
                spec: spec.clone(),
            })
        });
        Self { joints: joints.collect() }
    }

    /// Returns the importance weight, up to a factor: belief density over sampling density.
    fn weight(&self, deviation: &DVector<f64>) -> f64 {
        let mut exponent = 0.0;
        for joint in &self.joints {
            let spec = &joint.spec;
            let gain = joint.gain + deviation[joint.gain_row];
            let offset_rad = joint.offset_rad + deviation[joint.offset_row];
            // The reading's own gain and offset: r = m + (1 + g)(theta - m) + o.
            let (g, o) = (1.0 / gain - 1.0, -offset_rad / gain);
            if g.abs() > spec.gain_bound * BOUNDS_EASE || o.abs() > spec.offset_bound_rad * BOUNDS_EASE {
                return 0.0;
            }
            exponent += 0.5 * (((gain - 1.0) / spec.gain_std).powi(2) + (offset_rad / spec.offset_std_rad).powi(2));
        }
        exponent.exp()
    }
}

/// Returns the indices of `n` draws, each as often as its weight requires (systematic resampling). If no draw has any
/// weight, all draws are equally frequent.
fn resampled(drawn: &[(DVector<f64>, f64)], n: usize) -> Vec<usize> {
    let total: f64 = drawn.iter().map(|(_, weight)| weight).sum();
    if !(total > 0.0 && total.is_finite()) {
        return (0..n).map(|k| k % drawn.len()).collect();
    }
    let (mut at, mut sum) = (0, drawn[0].1);
    (0..n)
        .map(|k| {
            let wanted = (k as f64 + 0.5) / n as f64 * total;
            while sum < wanted && at + 1 < drawn.len() {
                at += 1;
                sum += drawn[at].1;
            }
            at
        })
        .collect()
}

/// Returns the end of each link that joints move: the next joint's origin, and the tool point after the last joint.
#[must_use]
pub fn link_ends(robot: &Robot, poses: &LinkPoses) -> Vec<Point3<f64>> {
    let n = robot.n_joints();
    let mut ends: Vec<Point3<f64>> = (1..n).map(|joint| Point3::from(poses.joint_origin(joint))).collect();
    ends.push(Point3::from(poses.frame(&robot.tool.mount).translation.vector));
    ends
}

/// Returns the value that a new draw exceeds with a probability of `1 - quantile`.
fn order_statistic(values: &mut [f64], quantile: f64) -> f64 {
    let rank = (quantile * (values.len() + 1) as f64).ceil() as usize;
    let at = rank.clamp(1, values.len()) - 1;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// Noise std of the one reading that locates the joint, rad.
fn reading_std_rad(spec: &JointSensorSpec) -> f64 {
    spec.noise_std_counts / spec.counts_per_rad.abs()
}

fn residual(rng: &mut ChaCha8Rng, std_rad: impl Fn(usize) -> f64, robot: &Robot) -> [f64; MAX_JOINTS] {
    let mut residual_rad = [0.0; MAX_JOINTS];
    for (joint, residual_rad) in residual_rad.iter_mut().enumerate().take(robot.n_joints()) {
        let normal: f64 = StandardNormal.sample(rng);
        *residual_rad = std_rad(joint) * normal;
    }
    residual_rad
}

/// Returns `L` with `L L^T = matrix`, with eigenvalues that rounding made negative set to zero; `None` if nothing was
/// determined.
fn root_of(matrix: &nalgebra::DMatrix<f64>) -> Option<nalgebra::DMatrix<f64>> {
    if matrix.is_empty() || matrix.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let eigen = nalgebra::SymmetricEigen::new(matrix.clone());
    let scale = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    Some(eigen.eigenvectors * nalgebra::DMatrix::from_diagonal(&scale))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{estimate, titan, with_terms};
    use crate::plan::JointErrorBounds;
    use armcal_core::stats::stream_rng;

    const DRAWS: usize = 60;
    const POSTURES: usize = 12;
    const ESTIMATES: usize = 12;

    fn posture(robot: &Robot, rng: &mut ChaCha8Rng) -> JointAngles {
        let limits = JointErrorBounds::datasheet(robot).safe_limits(robot);
        JointAngles::from_fn(robot.n_joints(), |j| rng.random_range(limits[j].lower_rad..=limits[j].upper_rad))
    }

    /// Returns the share of links, over sampled arms and configurations, whose displacement exceeds the quantile.
    fn share_beyond(robot: &Robot, ensemble: &ArmEnsemble, truth: &ArmEnsemble, rng: &mut ChaCha8Rng) -> f64 {
        let (mut links, mut beyond) = (0, 0);
        for _ in 0..POSTURES {
            let believed = posture(robot, rng);
            let there = link_ends(robot, &robot.chain.link_poses(&believed));
            let q99_m = ensemble.link_displacement_quantiles_m(robot, &believed, 0.99);
            for arm in truth.arms(&believed) {
                let ends = link_ends(robot, &robot.chain.link_poses(&arm));
                for ((end, believed_end), q99_m) in
                    ends.iter().zip(&there).zip(&q99_m).filter(|(_, q99_m)| **q99_m > 1e-9)
                {
                    links += 1;
                    beyond += usize::from((end - believed_end).norm() > *q99_m);
                }
            }
        }
        beyond as f64 / links as f64
    }

    /// Newly sampled arms, under the datasheet and under an estimate, exceed the 99 % quantile in about 1 % of the
    /// cases.
    #[test]
    fn the_quantile_is_exceeded_as_often_as_it_says() {
        let robot = titan();
        let mut rng = stream_rng(7, "quantile of links");
        let (first, second) = (ArmEnsemble::datasheet(&robot, &mut rng), ArmEnsemble::datasheet(&robot, &mut rng));
        let share = share_beyond(&robot, &first, &second, &mut rng);
        assert!((0.005..0.015).contains(&share), "datasheet: {share}");
        let of_estimate = |rng: &mut ChaCha8Rng| {
            let (parameters, covariance) = estimate(&robot, 5, 1e-3, rng);
            let calibration = with_terms(&robot, &parameters, &covariance);
            let now = calibration.sensors(&robot).expect("the sample's sensors").reference;
            let first = ArmEnsemble::believed(&robot, &calibration, &now, rng);
            let second = ArmEnsemble::believed(&robot, &calibration, &now, rng);
            share_beyond(&robot, &first, &second, rng)
        };
        // A quantile of 1000 arms is itself drawn; over several estimates that averages out.
        let shares: Vec<f64> = (0..ESTIMATES).map(|_| of_estimate(&mut rng)).collect();
        let share = shares.iter().sum::<f64>() / shares.len() as f64;
        assert!((0.005..0.015).contains(&share), "estimates: {share} {shares:?}");
    }

    /// After a first view that determined nothing, the sampled arms are the datasheet's.
    #[test]
    fn an_estimate_that_determined_nothing_leaves_the_datasheets_arms() {
        let robot = titan();
        let (parameters, nothing) = estimate(&robot, 0, 0.0, &mut stream_rng(1, "nothing"));
        assert!(nothing.parameters.is_empty());
        let calibration = with_terms(&robot, &parameters, &nothing);
        let rng = || stream_rng(2, "arms");
        let believed = ArmEnsemble::believed(&robot, &calibration, &Conditions::default(), &mut rng());
        let datasheet = ArmEnsemble::datasheet(&robot, &mut rng());
        let at = posture(&robot, &mut stream_rng(3, "posture"));
        let arms = |ensemble: &ArmEnsemble| ensemble.arms(&at).collect::<Vec<JointAngles>>();
        assert_eq!(arms(&believed), arms(&datasheet));
    }

    /// Every arm of an estimate is within the bounds for which planning keeps clear, except for the noise of its
    /// reading.
    #[test]
    fn bounds_hold_the_arms_that_the_estimate_allows() {
        let robot = titan();
        let (mut joints, mut beyond) = (0, 0);
        for seed in 0..DRAWS as u64 {
            let mut rng = stream_rng(seed, "bounds of an estimate");
            let (parameters, covariance) = estimate(&robot, 5, 1e-3, &mut rng);
            let calibration = with_terms(&robot, &parameters, &covariance);
            let sensors = calibration.sensors(&robot).expect("the sample's sensors");
            let bounds = JointErrorBounds::believed(&robot, &calibration, &sensors);
            let ensemble = ArmEnsemble::believed(&robot, &calibration, &sensors.reference, &mut rng);
            let believed = posture(&robot, &mut rng);
            for arm in ensemble.arms(&believed) {
                for joint in 0..5 {
                    let error_rad = bounds.error_rad(joint, believed[joint]);
                    joints += 1;
                    beyond += usize::from((arm[joint] - believed[joint]).abs() > error_rad);
                    let datasheet_rad = JointErrorBounds::datasheet(&robot).error_rad(joint, believed[joint]);
                    assert!(error_rad < 0.5 * datasheet_rad, "an estimate of a millirad leaves little: {error_rad}");
                }
            }
        }
        assert!(beyond * 1000 < joints, "{beyond} of {joints}");
    }
}
