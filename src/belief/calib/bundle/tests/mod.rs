//! On data of the estimator's own model: the equations against differences, the estimate against its bound.

mod alarm;
mod data;
mod equations;
mod failed;
mod statistics;
mod warm;
