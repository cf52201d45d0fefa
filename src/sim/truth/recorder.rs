//! Writer of truth.mcap.

use std::collections::BTreeMap;
use std::path::Path;

use crate::truth::messages::{self, Clearance, Contact, FaultMessage};
use crate::truth::records::{TruthClearance, TruthContact, TruthFault, TruthHeader, TruthSink, TruthState};
use armcal_core::log::ros::{
    Header, JointState, Pose as RosPose, PoseStamped, Quaternion, StringMessage, Temperature, Time,
};
use armcal_core::log::{LogError, RecordingHeader, RecordingWriter, RosMessage};
use armcal_core::spatial::{Frame, Pose};
use armcal_core::streams::SinkError;
use armcal_core::time::{SIMULATION_EPOCH, Stamp};

const BASE: &str = "base_link";

/// Recorder of the truth in its own file.
pub struct TruthRecorder {
    writer: RecordingWriter,
    joint_names: Vec<String>,
}

impl TruthRecorder {
    /// Creates the file, replacing one of that name. The directory must exist.
    ///
    /// # Errors
    /// [`LogError`] when it cannot be created.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, LogError> {
        // The header serves messages of `streams`, of which this file has none.
        let writer = RecordingWriter::create(path, RecordingHeader::new(Vec::new()))?;
        Ok(Self { writer, joint_names: Vec::new() })
    }

    fn write<T: RosMessage>(&mut self, topic: &str, stamp: Stamp, message: &T) -> Result<(), SinkError> {
        Ok(self.writer.write_ros(topic, &T::SCHEMA, stamp, message)?)
    }

    fn write_pose<A: Frame, B: Frame>(
        &mut self,
        topic: &str,
        header: Header,
        pose: &Pose<A, B>,
        stamp: Stamp,
    ) -> Result<(), SinkError> {
        let pose = RosPose {
            position: pose.origin().to_array().into(),
            orientation: Quaternion::from_wxyz(pose.quaternion_wxyz()),
        };
        self.write(topic, stamp, &PoseStamped { header, pose })
    }

    fn write_temperature(&mut self, topic: &str, stamp: Stamp, temperature: f64) -> Result<(), SinkError> {
        let header = header(stamp, "vehicle")?;
        self.write(topic, stamp, &Temperature { header, temperature, variance: 0.0 })
    }
}

impl TruthSink for TruthRecorder {
    fn begin(&mut self, truth: &TruthHeader) -> Result<(), SinkError> {
        self.joint_names.clone_from(&truth.joint_names);
        let as_built = toml::to_string(&truth.as_built)?;
        let metadata = BTreeMap::from([
            ("robot".to_owned(), truth.robot.clone()),
            ("vehicle".to_owned(), truth.vehicle.clone()),
            ("seed".to_owned(), truth.seed.to_string()),
            ("world".to_owned(), truth.spec_toml.clone()),
            ("as_built".to_owned(), as_built),
        ]);
        // For people and other tools; `read_truth` reads the message, whose loss would be noticed.
        self.writer.metadata("world", metadata)?;
        let text = toml::to_string(truth)?;
        self.write(messages::WORLD, SIMULATION_EPOCH, &StringMessage { data: text })
    }

    fn state(&mut self, state: &TruthState) -> Result<(), SinkError> {
        let stamp = state.stamp;
        let joints = JointState {
            header: header(stamp, BASE)?,
            name: self.joint_names.clone(),
            position: state.angles.to_vec(),
            velocity: state.rates.to_vec(),
            effort: state.torques.to_vec(),
        };
        self.write(messages::JOINT_STATES, stamp, &joints)?;
        self.write_pose(messages::TOOL_POSE, header(stamp, BASE)?, &state.base_from_tool, stamp)?;
        self.write_pose(messages::CAMERA_POSE, header(stamp, BASE)?, &state.base_from_camera, stamp)?;
        self.write_pose(messages::VEHICLE_POSE, header(stamp, "world")?, &state.world_from_vehicle, stamp)?;
        self.write_temperature(messages::OIL_TEMPERATURE, stamp, state.oil_c)?;
        self.write_temperature(messages::WATER_TEMPERATURE, stamp, state.water_c)
    }

    fn contact(&mut self, contact: &TruthContact) -> Result<(), SinkError> {
        let TruthContact { stamp, part_a, part_b } = contact.clone();
        self.write(messages::CONTACTS, stamp, &Contact { header: header(stamp, BASE)?, part_a, part_b })
    }

    fn clearance(&mut self, clearance: &TruthClearance) -> Result<(), SinkError> {
        let TruthClearance { stamp, distance_m, part_a, part_b } = clearance.clone();
        let message = Clearance { header: header(stamp, BASE)?, distance_m, part_a, part_b };
        self.write(messages::CLEARANCE, stamp, &message)
    }

    fn fault(&mut self, fault: &TruthFault) -> Result<(), SinkError> {
        let TruthFault { stamp, kind, details } = fault.clone();
        self.write(messages::FAULTS, stamp, &FaultMessage { header: header(stamp, BASE)?, kind, details })
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        Ok(self.writer.finish()?)
    }
}

fn header(stamp: Stamp, frame_id: &str) -> Result<Header, SinkError> {
    Ok(Header { stamp: Time::try_from(stamp)?, frame_id: frame_id.to_owned() })
}
