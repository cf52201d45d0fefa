//! Calibration methods: `bundle`, end stops, or a method on positions whose equations are in another crate.

use nalgebra::DMatrix;

use crate::model::parameters::{JointParameters, Parameter};
use crate::positions::position_problem::PositionProblem;
use crate::positions::solution::Solution;
use crate::positions::unobservable::Unobservable;
use crate::solve::covariance::{CommonErrors, ParameterCovariance};
use armcal_core::routine::Method;

/// A method, with its solver if it uses the tags' positions.
#[derive(Clone, Copy, Debug)]
pub enum CalibrationMethod {
    /// Maximum a posteriori over everything that the measurements depend on.
    Bundle,
    /// Joint limits from end stops, without a camera.
    JointLimits,
    /// Method on the positions of tags.
    Positions {
        /// Name of the method in files and reports.
        method: Method,
        /// Solver with the method's equations.
        solve: PositionSolver,
    },
}

/// Solver for the free parameters from a guess, under errors that all views share; returns `None` if it determines
/// none.
pub type PositionSolver =
    fn(&PositionProblem<'_>, &[Parameter], &JointParameters, &CommonErrors) -> Option<PositionSolution>;

/// Result of a [`PositionSolver`].
pub struct PositionSolution {
    /// Free parameters that the solver determines.
    pub determined: Vec<Parameter>,
    /// Parameters, and the outcome of the solver.
    pub solution: Solution,
    /// Covariance of the determined parameters.
    pub covariance: ParameterCovariance,
    /// d(parameter)/d(mount), six columns: translation m, rotation rad, on the right.
    pub by_mount: DMatrix<f64>,
    /// Parameters that the method itself cannot determine.
    pub unobservable: Vec<Unobservable>,
}

impl CalibrationMethod {
    /// Returns the name of the method in files and reports.
    #[must_use]
    pub fn method(self) -> Method {
        match self {
            Self::Bundle => Method::Bundle,
            Self::JointLimits => Method::JointLimits,
            Self::Positions { method, .. } => method,
        }
    }
}
