//! Stream of the truth: reference of the score, in a file that the estimator never opens.

mod messages;
mod reader;
mod recorder;
mod records;

pub use messages::{
    CAMERA_POSE, CLEARANCE, CONTACTS, Clearance, Contact, FAULTS, JOINT_STATES, OIL_TEMPERATURE, TOOL_POSE,
    VEHICLE_POSE, WATER_TEMPERATURE, WORLD,
};
pub use reader::{Truth, read_truth};
pub use recorder::TruthRecorder;
pub use records::{TruthClearance, TruthContact, TruthFault, TruthHeader, TruthSink, TruthState};
