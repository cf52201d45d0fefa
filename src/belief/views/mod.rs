//! Conversion of messages to views of an arm at rest.
//!
//! `association` finds the readings and corners of each captured view, `frame_consensus` its frames that agree.
//! `conditions` gives the temperatures and the pressure of the capture, and `dropouts` replaces invalid readings.
//! `external` does the same for recordings that mark no views, `pooling` for several recordings. `scale_identification`
//! measures the scale of an unknown sensor. `data_checks` refuses unusable recordings. `error` lists the errors before
//! any estimate. `marked_spans` reads the messages that views are made of and leaves the rest in the file. `motion`
//! keeps the readings of a moving arm around a view.

pub(crate) mod association;
pub(crate) mod calibration_data;
pub(crate) mod conditions;
pub(crate) mod constants;
pub(crate) mod data_checks;
pub(crate) mod dropouts;
pub(crate) mod error;
pub(crate) mod external;
pub(crate) mod frame_consensus;
pub(crate) mod marked_spans;
pub(crate) mod message_index;
pub(crate) mod motion;
pub(crate) mod pooling;
pub(crate) mod scale_identification;
pub(crate) mod view;

pub use association::{associate, surveyed};
pub use calibration_data::{CalibrationData, HeldOut};
pub use conditions::ConditionHistory;
pub use data_checks::check_joints;
pub use external::{ExternalContext, PlainLandmark, prepare_external};
pub use marked_spans::{MarkedSpans, read_marked};
pub use pooling::prepare_pooled;
pub use scale_identification::{IdentifiedScale, identify_scales};
pub use view::{
    BoardPoint, BoardPoints, CaptureData, EndStopReading, MeanCorners, ObservationRejection, TagMeasurement,
    TagObservation, TaskRests, View,
};
