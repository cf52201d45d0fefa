//! Joint limits: calibrates a joint's sensor from its readings at its nominal end stops (Williams 1991, the starting
//! point of the paper).
//!
//! `angle = center + gain travel + offset` (the paper's equation 1 about the middle of the range) through two stops or
//! more: the straight line of least squares. Cost: sum of squared differences between nominal and fitted angle, rad^2.
//! It needs no camera, and depends entirely on the stops' nominal angles. If the vehicle blocks the way to a stop,
//! there is no reading at it.

use crate::methods::constants::joint_limits::{LEAST_TRAVEL_SHARE, SAME_STOP_RAD, STOP_STD_RAD};
use nalgebra::{DMatrix, Matrix2, Vector2};

use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::positions::solution::Solution;
use crate::positions::unobservable::Unobservable;
use crate::solve::covariance::ParameterCovariance;
use crate::views::view::EndStopReading;
use armcal_core::numeric::Outcome;
use armcal_core::robot::Robot;

/// Fit of the sensors to their end stops.
#[derive(Clone, Debug)]
pub struct EndStopFit {
    /// Gains and offsets of the fitted joints; the others keep the guess.
    pub solution: Solution,
    /// Covariance of the fitted joints' gains and offsets.
    pub covariance: ParameterCovariance,
    /// Parameters of joints without two stops, and the reasons.
    pub left_out: Vec<Unobservable>,
}

/// Fits every joint of `robot` that has two different stops among `readings`; the others keep `guess`.
///
/// # Errors
/// The reason why no joint at all can be fitted.
pub fn fit_stops(robot: &Robot, readings: &[EndStopReading], guess: &JointParameters) -> Result<EndStopFit, String> {
    if readings.is_empty() {
        return Err("it holds no readings at end stops (marks `stop ANGLE_RAD` on /marks)".to_owned());
    }
    let mut parameters = *guess;
    let mut fitted: Vec<(usize, Matrix2<f64>)> = Vec::new();
    let mut left_out = Vec::new();
    for joint in 0..robot.n_joints() {
        let own: Vec<EndStopReading> = readings.iter().copied().filter(|reading| reading.joint == joint).collect();
        match line(robot.sensors[joint].center_rad, &own) {
            Ok(Line { gain, offset_rad, covariance }) => {
                (parameters.gain[joint], parameters.offset_rad[joint]) = (gain, offset_rad);
                fitted.push((joint, covariance));
            }
            Err(reason) => left_out.extend(of_joint(joint).map(|parameter| {
                let reason = reason.clone();
                Unobservable { parameter, reason }
            })),
        }
    }
    if fitted.is_empty() {
        let names = left_out.iter().step_by(2);
        let reasons: Vec<String> =
            names.map(|u| format!("{}: {}", robot.sensors[u.parameter.joint].joint, u.reason)).collect();
        return Err(format!("no joint stood at two of its stops: {}", reasons.join("; ")));
    }
    let is_fitted = |reading: &&EndStopReading| fitted.iter().any(|(joint, _)| *joint == reading.joint);
    let cost = |at: &JointParameters| -> f64 {
        readings.iter().filter(is_fitted).map(|r| difference_rad(robot, at, r).powi(2)).sum()
    };
    let solution = Solution {
        parameters,
        outcome: Outcome::Converged,
        evaluations: 1,
        cost_initial: cost(guess),
        cost_final: cost(&parameters),
    };
    Ok(EndStopFit { solution, covariance: joined(&fitted), left_out })
}

fn of_joint(joint: usize) -> [Parameter; 2] {
    [ParameterKind::Gain, ParameterKind::Offset].map(|kind| Parameter { joint, kind })
}

/// Returns the fitted minus the nominal angle, rad.
fn difference_rad(robot: &Robot, at: &JointParameters, reading: &EndStopReading) -> f64 {
    let joint = reading.joint;
    let center_rad = robot.sensors[joint].center_rad;
    center_rad + at.gain[joint] * reading.travel_rad + at.offset_rad[joint] - reading.angle_rad
}

fn joined(fitted: &[(usize, Matrix2<f64>)]) -> ParameterCovariance {
    let mut matrix = DMatrix::zeros(2 * fitted.len(), 2 * fitted.len());
    for (k, (_, block)) in fitted.iter().enumerate() {
        matrix.fixed_view_mut::<2, 2>(2 * k, 2 * k).copy_from(block);
    }
    let parameters = fitted.iter().flat_map(|(joint, _)| of_joint(*joint)).collect();
    ParameterCovariance { parameters, matrix, residual_std_rad: None }
}

/// `angle = center + gain travel + offset`, with the covariance of (gain, offset).
struct Line {
    gain: f64,
    offset_rad: f64,
    covariance: Matrix2<f64>,
}

fn line(center_rad: f64, readings: &[EndStopReading]) -> Result<Line, String> {
    let Some(first) = readings.first() else { return Err("it never rested at an end stop".to_owned()) };
    let apart = |r: &&EndStopReading| (r.angle_rad - first.angle_rad).abs() > SAME_STOP_RAD;
    let Some(other) = readings.iter().find(apart) else {
        return Err(format!(
            "it rested at one end stop only, {:.4} rad; two different ones are needed",
            first.angle_rad
        ));
    };
    let (turned, read) = (other.angle_rad - first.angle_rad, other.travel_rad - first.travel_rad);
    if read.abs() < LEAST_TRAVEL_SHARE * turned.abs() {
        let problem = format!(
            "between its end stops at {:.4} and {:.4} rad its reading changed by {read:.4} rad only",
            first.angle_rad, other.angle_rad
        );
        return Err(problem);
    }
    let row = |r: &EndStopReading| Vector2::new(r.travel_rad, 1.0);
    let normal: Matrix2<f64> = readings.iter().map(|r| row(r) * row(r).transpose()).sum();
    let right: Vector2<f64> = readings.iter().map(|r| row(r) * (r.angle_rad - center_rad)).sum();
    let inverse = normal.try_inverse().ok_or("its readings at the end stops are all the same")?;
    let solved = inverse * right;
    let left_rad = |r: &EndStopReading| (row(r).dot(&solved) - (r.angle_rad - center_rad)).powi(2);
    let (n, sum_rad2) = (readings.len(), readings.iter().map(left_rad).sum::<f64>());
    let scatter_rad2 = if n > 2 { sum_rad2 / (n - 2) as f64 } else { 0.0 };
    // All readings at one stop share the stop's own error.
    let by_stops: Matrix2<f64> = stops(readings)
        .iter()
        .map(|of_stop| {
            let sum: Vector2<f64> = of_stop.iter().map(&row).sum();
            sum * sum.transpose() * STOP_STD_RAD.powi(2).max(scatter_rad2)
        })
        .sum();
    Ok(Line { gain: solved.x, offset_rad: solved.y, covariance: inverse * by_stops * inverse })
}

/// Returns the readings grouped by stop.
fn stops(readings: &[EndStopReading]) -> Vec<Vec<EndStopReading>> {
    let mut sorted = readings.to_vec();
    sorted.sort_by(|a, b| a.angle_rad.total_cmp(&b.angle_rad));
    let near = |a: &EndStopReading, b: &EndStopReading| b.angle_rad - a.angle_rad <= SAME_STOP_RAD;
    sorted.chunk_by(near).map(<[EndStopReading]>::to_vec).collect()
}
