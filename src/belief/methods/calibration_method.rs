//! How a calibration is made: by `bundle`, or by a method on positions whose equations are elsewhere.

use nalgebra::DMatrix;

use crate::model::parameters::{JointParameters, Parameter};
use crate::positions::position_problem::PositionProblem;
use crate::positions::solution::Solution;
use crate::positions::unobservable::Unobservable;
use crate::solve::covariance::{CommonErrors, ParameterCovariance};
use armcal_core::routine::Method;

/// A method, with the solver of those that go by the tags' positions.
#[derive(Clone, Copy, Debug)]
pub enum CalibrationMethod {
    /// Maximum a posteriori over everything that the measurements depend on.
    Bundle,
    /// End stops; needs no camera.
    JointLimits,
    /// Positions of tags.
    Positions {
        /// As files and reports name it.
        method: Method,
        /// Its equations.
        solve: PositionSolver,
    },
}

/// Solves for the free parameters from a guess, under errors that all views share; `None` where it determines none.
pub type PositionSolver =
    fn(&PositionProblem<'_>, &[Parameter], &JointParameters, &CommonErrors) -> Option<PositionSolution>;

/// Answer of a [`PositionSolver`].
pub struct PositionSolution {
    /// Those of the free parameters that it determines.
    pub determined: Vec<Parameter>,
    /// The parameters, and how the search went.
    pub solution: Solution,
    /// Of the determined parameters.
    pub covariance: ParameterCovariance,
    /// d(parameter)/d(mount), six columns: translation m, rotation rad, on the right.
    pub by_mount: DMatrix<f64>,
    /// What the method itself cannot determine.
    pub unobservable: Vec<Unobservable>,
}

impl CalibrationMethod {
    /// As files and reports name it.
    #[must_use]
    pub fn method(self) -> Method {
        match self {
            Self::Bundle => Method::Bundle,
            Self::JointLimits => Method::JointLimits,
            Self::Positions { method, .. } => method,
        }
    }
}
