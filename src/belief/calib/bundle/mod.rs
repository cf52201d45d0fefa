//! BUNDLE: maximum a posteriori over everything that the measurements depend on.
//!
//! `model` says what has a column and which sizes are not known; `problem` puts views and priors into form; `sighting` linearizes one
//! tag in one view, `linearize` sums the normal equations with the views' own parameters eliminated, `solve` is
//! Levenberg-Marquardt; `evidence` fits noise and prior sizes, `select` decides on doubtful terms; `estimate` is the way from a robust start to the answer.

mod alarm;
mod detect;
mod eliminated;
mod estimate;
mod evidence;
mod failed;
mod held_out;
mod linearize;
mod model;
mod observability;
mod prior;
mod prior_terms;
mod problem;
mod readings;
mod robust;
mod select;
mod sighting;
mod solve;

pub use alarm::{ErrorKind, GeometryElement, ScoreTestResult};
pub use detect::failures;
pub use estimate::{
    BundleInput, Estimate, HyperparameterMode, LeastSquares, MIN_GRIPPER_VIEWS, Outlier, estimate, least_squares,
    model_for, reference,
};
pub use failed::{Failure, FailureAdjusted, FailureSource, SensorUse, set_by_camera};
pub use held_out::{Innovations, JointInnovation};
pub use model::{Hyperparameters, Model, SHAPE_LENGTH};
pub use observability::{Observability, observability};
pub use prior::{CalibrationPrior, MOUNT_ROWS, PriorConsistency, with_mount_rows};
pub use select::{OptionalTerm, Selection, select_model};

#[cfg(test)]
mod tests;
