//! BELIEF: from a recording and a nominal robot to calibrated joint sensors.
//!
//! `calibrate` works through the calibrations that a recording marks. `views` turns messages into views of an arm at
//! rest; `bundle` is the default method, `methods` are the paper's; `cross_validation` and `refusal_conditions` judge
//! what comes out; `result` is calibration.toml. `interim` estimates during a capture. Nothing here knows of a
//! simulator.

mod angles_by_camera;
mod baseline_comparison;
mod body_motion;
pub mod bundle;
mod calibrate;
mod covariance;
mod cross_validation;
mod error;
#[cfg(test)]
pub(crate) mod fixture;
mod geometry_error;
mod interim;
mod methods;
pub mod online;
mod positions;
mod reading_error;
mod refusal;
mod refusal_conditions;
mod reservation;
mod result;
mod tag_mapping;
mod tool_error;
mod views;
mod wrong_input;

pub use baseline_comparison::{BaselineComparison, SIGNIFICANCE};
pub use calibrate::{MIN_VIEWS, calibrate, calibrate_data, calibrate_with_survey};
pub use covariance::{CommonErrors, JointAt, ParameterCovariance, ToolErrorPrediction};
pub use error::CalibError;
pub use geometry_error::{ErrorKind, GeometryError};
pub use interim::interim_estimate;
pub use methods::{
    EndStopFit, Gauge, Interpolation, PositionMethod, PositionSearch, Scaling, SearchOptions, VarianceObjective,
    determined_by_variance, fisher_information, fit_stops, free_parameters, least_squares, minimum_distance,
    mount_by_gripper_tag,
};
pub use positions::{MountEstimate, PositionProblem, Solution, Unobservable};
pub use reading_error::{JointZero, MisreadReadings, ReadingError};
pub use refusal::{InnovationQuantity, Refusal, in_files as refusals_in_files, with_advice};
pub use refusal_conditions::{MIN_HELD_OUT_VIEWS, MIN_VIEWS_PER_PARAMETER, fewest_views};
pub use reservation::Reservation;
pub use result::{
    CalibratedArm, Calibration, CalibrationFileError, CalibrationFiles, CameraMount, Check, CompactCalibration,
    CompactError, CompactJoint, CornerResidual, CovarianceTable, FailedJointTable, FitDetails, FitMetrics,
    FurtherCamera, HeldOutMetrics, JointCompliance, JointResult, LensResult, LinkResult, LookupTable,
    MAX_COMPACT_BYTES, MapResult, MapTag, ModelTable, ObservabilityTable, ObservedTag, PredictedToolError, PriorTable,
    ReferenceTable, SagTable, Status, SurveyCoverage, TargetPrediction, TermsTable, ValidRange, VerdictTable,
    ViewContainment, ViewResidual, calibration_schema, covariance_file, covariance_schema, metric,
};
pub(crate) use views::dropouts::replace_dropouts;
pub use views::{
    BoardPoint, BoardPoints, CalibrationData, CaptureData, ConditionHistory, EndStopReading, ExternalContext, HeldOut,
    IdentifiedScale, MarkedSpans, MeanCorners, ObservationRejection, PlainLandmark, TagMeasurement, TagObservation,
    TaskRests, View, associate, associate_within, check_joints, identify_scales, prepare_external, prepare_pooled,
    read_marked, surveyed,
};
pub use wrong_input::{WrongInput, WrongInputKind};
