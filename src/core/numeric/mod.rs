//! Numerical methods that know no arm: nonlinear least squares and robust losses.
//!
//! `levenberg_marquardt` is the one loop of all least-squares fits, `loss` the family of losses by which far residuals count less.

mod levenberg_marquardt;
mod loss;

pub use levenberg_marquardt::{Damping, LeastSquares, Outcome, Proposal, Report, Stop, StopRule, minimize};
pub use loss::Loss;
