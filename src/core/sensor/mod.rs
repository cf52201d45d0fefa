//! The model of a joint sensor: counts to an angle and back.
//!
//! `angle = center + gain * nominal_travel + offset`, with `nominal_travel` (rad) from the datasheet and measured from
//! the middle of the joint's range: the paper's `theta = k1 * eta + k2`, but with nearly uncorrelated gain and offset.
//! Gain 1 and offset 0 are the datasheet. Nonlinearity, temperature, pressure, drift and backlash are further terms,
//! zero where no method estimates them. Only the online estimator estimates a worn spot, as a bump of the curve.

mod model;

pub use model::wrap_symmetric;
pub use model::{
    ArmSensors, Bump, ConditionChange, Conditions, Correction, N_SHAPE, SensorModel, Terms, nonlinearity_basis,
    shape_prior,
};
