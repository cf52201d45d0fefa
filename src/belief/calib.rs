//! Calibrations as programs make and read them: what the rooms from `views` to `follow` offer.

pub use crate::batch::interim::interim_estimate;
pub use crate::batch::marked_calibrations::{MIN_VIEWS, calibrate, calibrate_data, calibrate_with_survey};
pub use crate::checks::refusal_conditions::MIN_VIEWS_PER_PARAMETER;
pub use crate::file::{
    CalibratedArm, Calibration, CalibrationFileError, CameraMount, Check, CompactCalibration, CompactError,
    CompactJoint, CovarianceTable, FailedJointTable, FitMetrics, FurtherCamera, HeldOutMetrics, JointCompliance,
    JointResult, LensResult, LinkResult, LookupTable, MapResult, MapTag, ModelTable, ObservabilityTable,
    PredictedToolError, PriorTable, ReferenceTable, SagTable, Status, SurveyCoverage, TermsTable, ValidRange,
    VerdictTable, ViewContainment, calibration_schema, covariance_file, covariance_schema, metric,
};
pub use crate::judge::baseline_comparison::BaselineComparison;
pub use crate::methods::{CalibrationMethod, PositionSolution, PositionSolver, free_parameters, mount_by_gripper_tag};
pub use crate::positions::{MountEstimate, PositionProblem, Solution, TagResidual, Unobservable};
pub use crate::say::geometry_error::{ErrorKind, GeometryError};
pub use crate::say::reading_error::{JointZero, MisreadReadings, ReadingError};
pub use crate::say::refusal::{InnovationQuantity, Refusal, in_files as refusals_in_files, with_advice};
pub use crate::say::reservation::Reservation;
pub use crate::say::wrong_input::{WrongInput, WrongInputKind};
pub use crate::solve::covariance::{CommonErrors, JointAt, ParameterCovariance, ToolErrorPrediction};
pub use crate::solve::details::{CornerResidual, FitDetails, ObservedTag, TargetPrediction, ViewResidual};
pub use crate::views::error::CalibError;
pub use crate::views::{
    BoardPoint, BoardPoints, CalibrationData, CaptureData, ConditionHistory, EndStopReading, ExternalContext, HeldOut,
    IdentifiedScale, MarkedSpans, MeanCorners, ObservationRejection, PlainLandmark, TagMeasurement, TagObservation,
    TaskRests, View, associate, check_joints, identify_scales, prepare_external, prepare_pooled, read_marked, surveyed,
};

/// The default method, step by step.
pub mod bundle {
    pub use crate::checks::innovations::{Innovations, JointInnovation};
    pub use crate::checks::observability::{Observability, observability};
    pub use crate::explain::failures::{Failure, FailureAdjusted, FailureSource, SensorLine, SensorUse};
    pub use crate::explain::model_selection::{OptionalTerm, Selection};
    pub use crate::explain::score_test::{GeometryElement, ScoreTestResult};
    pub use crate::solve::estimate::{Estimate, LeastSquares, estimate, least_squares};
    pub use crate::solve::input::{BundleInput, HyperparameterMode};
    pub use crate::solve::model_for_views::{model_for, reference};
    pub use crate::solve::outliers::Outlier;
}

/// The belief kept up through a dive.
pub mod online {
    pub use crate::follow::{
        Batch, BeliefLine, BeliefLog, BeliefRow, DriftModel, Fault, FaultSearch, Follower, OnlineEstimator,
        OnlineEvent, OnlineSettings, Oracle, OracleGain, TagSet, ViewStream,
    };
    pub use crate::say::doubt::Doubt;
}
