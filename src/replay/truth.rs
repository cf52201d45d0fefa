//! Reader of the parts of the simulator's truth file that can be drawn.

use std::path::Path;

use nalgebra::Isometry3;
use serde::Deserialize;

use crate::error::ReplayError;
use crate::fault_words::{Fault, FaultOf, sentence};
use crate::tracks::{TimeSeries, Tracks, blend_angles, blend_poses};
use armcal_core::log::{CdrError, RawMessage, decode, for_each_raw, ros};
use armcal_core::robot::Robot;
use armcal_core::spatial::{Base, Frame, Pose, Tool, Vehicle, World};
use armcal_core::streams::JointAngles;
use armcal_core::time::Stamp;

const JOINT_STATES: &str = "/truth/joint_states";
const VEHICLE_POSE: &str = "/truth/vehicle_pose";
const TOOL_POSE: &str = "/truth/tool_pose";
const CLEARANCE: &str = "/truth/clearance";
const FAULTS: &str = "/truth/faults";

/// True states over time; any series may be empty.
#[derive(Default)]
pub(super) struct Truth {
    joints: TimeSeries<JointAngles>,
    world_from_vehicle: TimeSeries<Isometry3<f64>>,
    base_from_tool: TimeSeries<Isometry3<f64>>,
    /// Nearest parts over time.
    pub clearances: Vec<Clearance>,
    /// Faults with their times, s, as sentences.
    pub faults: Vec<Fault>,
}

/// Two nearest parts at one time.
#[derive(Clone)]
pub(super) struct Clearance {
    pub time_s: f64,
    /// Distance between the parts; at most 0 if they touch.
    pub distance_m: f64,
    /// Names of a link and of the part nearest to it.
    pub parts: [String; 2],
}

/// armcal_msgs/msg/Clearance.
#[derive(Deserialize)]
struct ClearanceMessage {
    header: ros::Header,
    distance_m: f64,
    part_a: String,
    part_b: String,
}

/// armcal_msgs/msg/Fault.
#[derive(Deserialize)]
struct FaultMessage {
    header: ros::Header,
    kind: String,
    details: String,
}

impl Truth {
    /// Reads `path` onto the timeline of `tracks`.
    pub fn read(path: &Path, robot: &Robot, tracks: &Tracks) -> Result<Self, ReplayError> {
        let mut reader = Reader { path, robot, tracks, truth: Self::default(), topics: 0 };
        let mut failure = None;
        for_each_raw(path, |message| {
            if failure.is_none() {
                failure = reader.take(message).err();
            }
        })?;
        match failure {
            Some(error) => Err(error),
            None if reader.topics == 0 => Err(ReplayError::NoTruth { path: path.to_owned() }),
            None => Ok(reader.sorted()),
        }
    }

    pub fn angles(&self, time_s: f64) -> Option<JointAngles> {
        self.joints.between(time_s, blend_angles)
    }

    pub fn world_from_vehicle(&self, time_s: f64) -> Option<Pose<World, Vehicle>> {
        self.world_from_vehicle.between(time_s, blend_poses).map(Pose::from_isometry)
    }

    /// Returns the true pose of the tool.
    pub fn base_from_tool(&self, time_s: f64) -> Option<Pose<Base, Tool>> {
        self.base_from_tool.between(time_s, blend_poses).map(Pose::from_isometry)
    }
}

struct Reader<'a> {
    path: &'a Path,
    robot: &'a Robot,
    tracks: &'a Tracks<'a>,
    truth: Truth,
    /// Number of messages on topics under /truth/.
    topics: u64,
}

impl Reader<'_> {
    /// Sorts the series, because a least clearance is recorded after its time.
    fn sorted(mut self) -> Truth {
        self.truth.clearances.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        self.truth
    }

    fn take(&mut self, message: &RawMessage<'_>) -> Result<(), ReplayError> {
        self.topics += u64::from(message.topic().starts_with("/truth/"));
        let failed = |source| self.failed(message, source);
        match message.topic() {
            JOINT_STATES => {
                let joints: ros::JointState = decode(message.data).map_err(failed)?;
                let angles = self.angles(message, &joints)?;
                let time_s = self.time_s(message, joints.header.stamp);
                self.truth.joints.push(time_s, angles);
            }
            VEHICLE_POSE => {
                let pose: ros::PoseStamped = decode(message.data).map_err(failed)?;
                let time_s = self.time_s(message, pose.header.stamp);
                if let Some(pose) = isometry::<World, Vehicle>(&pose.pose) {
                    self.truth.world_from_vehicle.push(time_s, pose);
                }
            }
            TOOL_POSE => {
                let pose: ros::PoseStamped = decode(message.data).map_err(failed)?;
                let time_s = self.time_s(message, pose.header.stamp);
                if let Some(pose) = isometry::<Base, Tool>(&pose.pose) {
                    self.truth.base_from_tool.push(time_s, pose);
                }
            }
            CLEARANCE => {
                let ClearanceMessage { header, distance_m, part_a, part_b } = decode(message.data).map_err(failed)?;
                let (time_s, parts) = (self.time_s(message, header.stamp), [part_a, part_b]);
                self.truth.clearances.push(Clearance { time_s, distance_m, parts });
            }
            FAULTS => {
                let fault: FaultMessage = decode(message.data).map_err(failed)?;
                let time_s = self.time_s(message, fault.header.stamp);
                let sentence = sentence(&fault.kind, &fault.details);
                self.truth.faults.push(Fault { time_s, of: FaultOf::of(&fault.kind), sentence });
            }
            _ => {}
        }
        Ok(())
    }

    fn time_s(&self, message: &RawMessage<'_>, time: ros::Time) -> f64 {
        let log_time = message.log_time();
        self.tracks.place_s(log_time, Stamp::try_from(time).unwrap_or(log_time))
    }

    /// Returns the angles in the order of the robot's joints.
    fn angles(&self, message: &RawMessage<'_>, joints: &ros::JointState) -> Result<JointAngles, ReplayError> {
        let expected = self.robot.joint_names();
        let find = |name: &String| {
            let position = joints.name.iter().position(|other| other == name)?;
            joints.position.get(position).copied().filter(|angle| angle.is_finite())
        };
        match expected.iter().map(find).collect::<Option<Vec<f64>>>() {
            Some(angles) => Ok(JointAngles::from_slice(&angles)),
            None => Err(ReplayError::TruthJoints {
                path: self.path.to_owned(),
                topic: message.topic().to_owned(),
                got: joints.name.clone(),
                expected,
            }),
        }
    }

    fn failed(&self, message: &RawMessage<'_>, source: CdrError) -> ReplayError {
        ReplayError::TruthMessage { path: self.path.to_owned(), topic: message.topic().to_owned(), source }
    }
}

fn isometry<A: Frame, B: Frame>(pose: &ros::Pose) -> Option<Isometry3<f64>> {
    let named = Pose::<A, B>::from_position_quaternion_wxyz(pose.position.into(), pose.orientation.wxyz())?;
    Some(*named.isometry())
}
