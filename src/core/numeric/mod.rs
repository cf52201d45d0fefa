//! Numerical methods: nonlinear least squares and robust losses.
//!
//! `levenberg_marquardt` solves all least-squares fits; `loss` has the robust loss functions (Huber, Cauchy).

mod levenberg_marquardt;
mod loss;

pub use levenberg_marquardt::{Damping, LeastSquares, Outcome, Proposal, Report, Stop, StopRule, minimize};
pub use loss::Loss;
