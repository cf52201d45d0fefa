//! The answer: calibration.toml, its tables and its short form.
//!
//! `calibration` is the file's content, `assemble` fills it; the other files are its tables. `file` reads and writes
//! it, `covariance_file` the covariance beside it, `compact` is one line of less than 512 bytes, `lookup` a table from
//! counts to radians. `details` has no file: residuals view by view, for reports.

pub(crate) mod assemble;
#[cfg(test)]
pub(in crate::calib) mod bare;
mod calibrated_arm;
pub(crate) mod calibration;
pub(crate) mod camera_mount;
mod compact;
pub(crate) mod covariance_file;
pub(crate) mod details;
pub(crate) mod failed_joint;
mod file;
mod file_error;
pub(crate) mod lens_table;
pub(crate) mod link_table;
mod lookup;
pub(crate) mod map_table;
pub(crate) mod metrics;
pub(crate) mod model_table;
pub(crate) mod sag_table;
mod slide_keys;
pub(crate) mod terms_table;
pub(crate) mod valid_range;
pub(crate) mod validity;
pub(crate) mod verdict_tables;

pub use calibrated_arm::CalibratedArm;
pub use calibration::{Calibration, JointResult, Status, calibration_schema};
pub use camera_mount::{CameraMount, FurtherCamera};
pub use compact::{CompactCalibration, CompactError, CompactJoint, MAX_COMPACT_BYTES, PredictedToolError};
pub use covariance_file::{CovarianceTable, covariance_file, covariance_schema};
pub use details::{CornerResidual, FitDetails, ObservedTag, TargetPrediction, ViewResidual};
pub use failed_joint::{FailedJointTable, PriorTable};
pub use file::CalibrationFiles;
pub use file_error::CalibrationFileError;
pub use lens_table::LensResult;
pub use link_table::LinkResult;
pub use lookup::LookupTable;
pub use map_table::{MapResult, MapTag, SurveyCoverage};
pub use metrics::{FitMetrics, HeldOutMetrics, ViewContainment};
pub use model_table::ModelTable;
pub use sag_table::{JointCompliance, SagTable};
pub use slide_keys::metric;
pub use terms_table::{ReferenceTable, TermsTable};
pub use valid_range::ValidRange;
pub use verdict_tables::{Check, ObservabilityTable, VerdictTable};
