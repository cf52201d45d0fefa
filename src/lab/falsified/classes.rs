//! Causes that the data cannot distinguish.
//!
//! Each cause has columns: the directions in which it can be wrong. With `c(z)` of the oracle's twin, the information
//! about two columns is `I_ab = (c(a + b) - c(a) - c(b)) / 2`, all other parameters marginalised. For a direction a and
//! a cause with the columns N, the score correlation is `rho^2 = I_aN I_NN^-1 I_Na / I_aa` (the canonical correlation
//! of their scores). Above [`ALIKE`] no test on these views can distinguish the two.

use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use crate::falsified::cases::AXES;
use crate::falsified::oracle::Oracle;
use crate::falsified::perturbation::{Perturbation, SensorFault, WrongReading};
use armcal_core::robot::Robot;

/// Score correlation above which causes are alike.
const ALIKE: f64 = 0.98;
/// Non-centrality that columns are scaled to.
const SCALED_TO: f64 = 4.0;
/// Largest size of a column, m, rad, or relative; a column that needs more to reach [`SCALED_TO`] is omitted.
const MAX_SIZE: f64 = 0.02;
/// Size from which the scaling starts.
const FIRST_SIZE: f64 = 1e-3;
/// Least eigenvalue of a cause's scaled information that counts, as a share of the largest.
const MIN_EIGENVALUE: f64 = 1e-3;

/// One direction in which a cause can be wrong.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub cause: String,
    pub words: String,
    /// Perturbation of size one; after scaling, of the non-centrality [`SCALED_TO`].
    unit: Perturbation,
}

/// Information of the views about every column.
#[derive(Clone, Debug)]
pub struct EquivalenceClasses {
    /// Columns that the views can observe.
    columns: Vec<Column>,
    information: DMatrix<f64>,
}

/// Computes the classes of the columns from the views of one capture.
pub(super) fn equivalence_classes(oracle: &Oracle<'_>, columns: Vec<Column>) -> EquivalenceClasses {
    let columns: Vec<Column> = columns.into_par_iter().filter_map(|c| scaled(oracle, c)).collect();
    let cost = |of: &[Perturbation]| oracle.effect(of).non_centrality;
    let own: Vec<f64> = columns.par_iter().map(|column| cost(&[column.unit])).collect();
    let n = columns.len();
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|a| (0..a).map(move |b| (a, b))).collect();
    let common = |&(a, b): &(usize, usize)| 0.5 * (cost(&[columns[a].unit, columns[b].unit]) - own[a] - own[b]);
    let crossed: Vec<f64> = pairs.par_iter().map(common).collect();
    let mut information = DMatrix::from_diagonal(&DVector::from_vec(own));
    for ((a, b), value) in pairs.into_iter().zip(crossed) {
        (information[(a, b)], information[(b, a)]) = (value, value);
    }
    EquivalenceClasses { columns, information }
}

/// Scales a column to the non-centrality [`SCALED_TO`]; `None` where that size is too large to have a meaning.
fn scaled(oracle: &Oracle<'_>, column: Column) -> Option<Column> {
    let mut size = FIRST_SIZE;
    for _ in 0..2 {
        let cost = oracle.effect(&[column.unit.scaled(size)]).non_centrality;
        size *= (SCALED_TO / cost.max(f64::MIN_POSITIVE)).sqrt();
        if size > MAX_SIZE {
            return None;
        }
    }
    Some(Column { unit: column.unit.scaled(size), ..column })
}

/// All directions of all causes, each of size one.
pub(super) fn columns(robot: &Robot) -> Vec<Column> {
    use Perturbation as P;
    let mut all = Vec::new();
    let mut add = |cause: &str, words: String, unit: P| all.push(Column { cause: cause.to_owned(), words, unit });
    for (axis, name) in AXES.into_iter().enumerate() {
        let along = Vector3::ith(axis, 1.0);
        let (shift, turn) = (format!("shift along {name}"), format!("turn about {name}"));
        add("camera_mount", shift.clone(), P::MountShift(along));
        add("camera_mount", turn.clone(), P::MountTurn(along));
        for (joint, drawn) in robot.chain.joints().iter().enumerate() {
            let cause = if joint == 0 { "base".to_owned() } else { format!("link:{}", drawn.name) };
            add(&cause, shift.clone(), P::LinkShift(joint, along));
            add(&cause, turn.clone(), P::LinkTurn(joint, along));
        }
        for (tag, surveyed) in robot.tags.iter().enumerate() {
            let cause = format!("tag:{}", surveyed.id);
            add(&cause, shift.clone(), P::TagShift(tag, along));
            add(&cause, turn.clone(), P::TagTurn(tag, along));
        }
        if axis < 2 {
            let one: [f64; 2] = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
            add("lens", format!("focal length {name}"), P::FocalLength(one));
            // Sizes of 100 px are of the same order as the others' sizes.
            add("lens", format!("centre {name}"), P::ImageCentre(one.map(|one| 100.0 * one)));
        }
    }
    for (tag, surveyed) in robot.tags.iter().enumerate() {
        add(&format!("tag_size:{}", surveyed.id), String::new(), P::TagSize(tag, 1.0));
    }
    add("tag_size:all", String::new(), P::AllTagSizes(1.0));
    for joint in 0..robot.camera.mount.n_joints {
        let slip = SensorFault { joint, reading: WrongReading::Slipped(1.0) };
        let cause = format!("sensor_slip:{}", robot.chain.joints()[joint].name);
        add(&cause, "in the middle".to_owned(), P::Sensor(slip));
    }
    // Sorting puts a cause's columns next to each other.
    all.sort_by(|a, b| a.cause.cmp(&b.cause));
    all
}

impl EquivalenceClasses {
    /// Causes that explain the effect of `perturbations` on the data; empty where they are no combination of columns.
    pub(super) fn of(&self, perturbations: &[Perturbation]) -> Vec<String> {
        let mut direction = DVector::zeros(self.columns.len());
        for perturbation in perturbations {
            if !self.add(perturbation, &mut direction) {
                return Vec::new();
            }
        }
        self.alike(&direction).into_iter().map(|(cause, _)| cause).collect()
    }

    /// Adds `perturbation` to a direction in scaled columns; returns true if it is a combination of them.
    fn add(&self, perturbation: &Perturbation, direction: &mut DVector<f64>) -> bool {
        let mut is_any = false;
        for (column, at) in self.columns.iter().zip(direction.iter_mut()) {
            if let Some(coefficient) = coefficient(perturbation, &column.unit) {
                *at += coefficient;
                is_any = true;
            }
        }
        is_any
    }

    /// Causes whose scores correlate with that of `direction` above [`ALIKE`], with the correlation.
    fn alike(&self, direction: &DVector<f64>) -> Vec<(String, f64)> {
        let by_column = &self.information * direction;
        let own = by_column.dot(direction);
        if own <= 0.0 {
            return Vec::new();
        }
        let mut causes: Vec<&str> = self.columns.iter().map(|column| column.cause.as_str()).collect();
        causes.dedup();
        let correlation = |cause: &str| {
            let of: Vec<usize> = (0..self.columns.len()).filter(|&k| self.columns[k].cause == cause).collect();
            let block = DMatrix::from_fn(of.len(), of.len(), |i, k| self.information[(of[i], of[k])]);
            let cross = DVector::from_fn(of.len(), |i, _| by_column[of[i]]);
            let eigen = block.symmetric_eigen();
            let limit = MIN_EIGENVALUE * eigen.eigenvalues.max();
            let pairs = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
            let told = pairs.filter(|(value, _)| **value > limit);
            (told.map(|(value, vector)| vector.dot(&cross).powi(2) / value).sum::<f64>() / own).max(0.0).sqrt()
        };
        let each = causes.into_iter().map(|cause| (cause.to_owned(), correlation(cause)));
        each.filter(|(_, correlation)| *correlation > ALIKE).collect()
    }

    /// Table of the directions, each with the other causes that the data cannot distinguish from it.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut out = format!("score correlation above {ALIKE}:\n\n| direction | not told from |\n|---|---|\n");
        for (k, column) in self.columns.iter().enumerate() {
            let mut direction = DVector::zeros(self.columns.len());
            direction[k] = 1.0;
            let others = self.alike(&direction).into_iter().filter(|(cause, _)| *cause != column.cause);
            let others: Vec<String> = others.map(|(cause, rho)| format!("{cause} ({rho:.3})")).collect();
            if !others.is_empty() {
                out += &format!("| {} {} | {} |\n", column.cause, column.words, others.join(", "));
            }
        }
        out
    }
}

/// Component of `perturbation` along `column`, in multiples of `column`; `None` for another sort of perturbation.
fn coefficient(perturbation: &Perturbation, column: &Perturbation) -> Option<f64> {
    use Perturbation as P;
    // Columns that are vectors lie along one axis.
    let along = |by: &Vector3<f64>, column: &Vector3<f64>| Some(by.dot(column) / column.norm_squared());
    let plane = |by: &[f64; 2], column: &[f64; 2]| {
        Some((by[0] * column[0] + by[1] * column[1]) / (column[0] * column[0] + column[1] * column[1]))
    };
    match (perturbation, column) {
        (P::MountShift(by), P::MountShift(column)) | (P::MountTurn(by), P::MountTurn(column)) => along(by, column),
        (P::LinkShift(a, by), P::LinkShift(b, column))
        | (P::LinkTurn(a, by), P::LinkTurn(b, column))
        | (P::TagShift(a, by), P::TagShift(b, column))
        | (P::TagTurn(a, by), P::TagTurn(b, column))
            if a == b =>
        {
            along(by, column)
        }
        (P::TagSize(a, by), P::TagSize(b, column)) if a == b => Some(by / column),
        (P::AllTagSizes(by), P::AllTagSizes(column)) => Some(by / column),
        (P::FocalLength(by), P::FocalLength(column)) | (P::ImageCentre(by), P::ImageCentre(column)) => {
            plane(by, column)
        }
        (
            P::Sensor(SensorFault { joint: a, reading: WrongReading::Slipped(by) }),
            P::Sensor(SensorFault { joint: b, reading: WrongReading::Slipped(column) }),
        ) if a == b => Some(by / column),
        _ => None,
    }
}
