//! The calibration file, its tables and its short form.
//!
//! `calibration` is the file's content; the other files are its tables. `calibration_file` reads and writes it, and
//! `covariance_file` the covariance next to it. `compact` is one line of less than 512 bytes, `lookup` a table from
//! counts to radians.

#[cfg(test)]
pub(crate) mod bare;
pub(crate) mod calibrated_arm;
pub(crate) mod calibration;
pub(crate) mod calibration_file;
pub(crate) mod camera_mount;
pub(crate) mod compact;
pub(crate) mod constants;
pub(crate) mod covariance_file;
pub(crate) mod failed_joint;
pub(crate) mod file_error;
pub(crate) mod joint_check;
pub(crate) mod lens_table;
pub(crate) mod link_table;
pub(crate) mod lookup;
pub(crate) mod map_table;
pub(crate) mod metrics;
pub(crate) mod model_table;
pub(crate) mod robot_match;
pub(crate) mod sag_table;
pub(crate) mod slide_keys;
pub(crate) mod terms_table;
pub(crate) mod valid_range;
pub(crate) mod validity;
pub(crate) mod verdict_tables;

pub use calibrated_arm::CalibratedArm;
pub use calibration::{Calibration, JointResult, Status, calibration_schema};
pub use camera_mount::{CameraMount, FurtherCamera};
pub use compact::{CompactCalibration, CompactError, CompactJoint, PredictedToolError};
pub use covariance_file::{CovarianceTable, covariance_file, covariance_schema};
pub use failed_joint::{FailedJointTable, PriorTable};
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
