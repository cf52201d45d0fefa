//! Numerical methods: nonlinear least squares, robust losses, factors of matrices.
//!
//! `levenberg_marquardt` solves all least-squares fits; `loss` has the robust loss functions (Huber, Cauchy).
//! `cholesky` factors matrices of a hundred columns by blocks; `whole_part` turns floats into bytes.

mod cholesky;
mod levenberg_marquardt;
mod loss;
mod whole_part;

pub use cholesky::{cholesky, solve_lower};
pub use levenberg_marquardt::{Damping, LeastSquares, Outcome, Proposal, Report, Stop, StopRule, minimize};
pub use loss::Loss;
pub use whole_part::{NO_FRACTION, whole_part};
