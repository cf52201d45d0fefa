//! Belief's model of a joint sensor: counts to an angle and back.
//!
//! `angle = center + gain * nominal_travel + offset`, where `nominal_travel` (rad) is what the datasheet makes of the
//! counts, measured from the middle of the joint's range: the paper's `theta = k1 * eta + k2` with `k2` taken where
//! it matters, so that gain and offset hardly correlate. Gain 1 and offset 0 are the datasheet itself. What a straight line leaves
//! (nonlinearity, temperature, pressure, drift, play) are further terms, zero where no method estimates them.

mod model;

pub use model::wrap_symmetric;
pub use model::{
    ArmSensors, ConditionChange, Conditions, Correction, N_SHAPE, SensorModel, Terms, nonlinearity_basis, shape_prior,
};
