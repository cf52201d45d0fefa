//! Reader of truth.mcap, for the score.

use std::path::Path;

use crate::error::SimError;
use crate::truth::messages::{self, Clearance, Contact, FaultMessage};
use crate::truth::records::{TruthClearance, TruthContact, TruthFault, TruthHeader, TruthState};
use armcal_core::log::ros::{self, JointState, PoseStamped, StringMessage, Temperature};
use armcal_core::log::{Completeness, RawMessage, decode, for_each_raw};
use armcal_core::spatial::{Base, Camera, Frame, Pose, Tool, Vehicle, World};
use armcal_core::streams::{JointAngles, MAX_JOINTS};
use armcal_core::time::Stamp;

/// Largest interval of states between which the truth is interpolated, s.
const MAX_GAP_S: f64 = 0.25;

/// Contents of truth.mcap.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Constants of the run.
    pub header: TruthHeader,
    /// States in the order of time, at the truth's rate.
    pub states: Vec<TruthState>,
    /// Contacts in the order of time.
    pub contacts: Vec<TruthContact>,
    /// Clearances in the order of time, at their own rate.
    pub clearances: Vec<TruthClearance>,
    /// Faults in the order of time.
    pub faults: Vec<TruthFault>,
    /// Completeness of the file.
    pub completeness: Completeness,
}

/// Reads the file that a `TruthRecorder` wrote.
///
/// # Errors
/// [`SimError::TruthFile`] when it cannot be read, holds no world, or a message of it is not what its topic says.
pub fn read_truth(path: impl AsRef<Path>) -> Result<Truth, SimError> {
    let path = path.as_ref();
    let failed = |problem: String| SimError::TruthFile { path: path.to_owned(), problem };
    let mut reader = Reader::default();
    let mut first_problem = None;
    let summary = for_each_raw(path, |message| {
        if let Err(problem) = reader.take(message) {
            first_problem.get_or_insert(format!("{}: {problem}", message.topic()));
        }
    })
    .map_err(|error| failed(error.to_string()))?;
    if let Some(problem) = first_problem {
        return Err(failed(problem));
    }
    let header = reader.header.ok_or_else(|| failed(format!("has no message on {}", messages::WORLD)))?;
    Ok(Truth {
        header,
        states: reader.states,
        contacts: reader.contacts,
        clearances: reader.clearances,
        faults: reader.faults,
        completeness: summary.completeness,
    })
}

impl Truth {
    /// Returns the state at `stamp`, interpolated between its neighbours. `None` before the first and after the last,
    /// and where the neighbours are too far apart to assume uniform motion.
    #[must_use]
    pub fn state_at(&self, stamp: Stamp) -> Option<TruthState> {
        let next = self.states.partition_point(|state| state.stamp < stamp);
        let after = self.states.get(next)?;
        if after.stamp == stamp {
            return Some(*after);
        }
        let before = self.states.get(next.checked_sub(1)?)?;
        let gap_s = after.stamp.since_s(before.stamp);
        let share = stamp.since_s(before.stamp) / gap_s;
        (gap_s <= MAX_GAP_S).then(|| interpolated(before, after, share, stamp))
    }

    /// Returns the smallest distance of any two watched parts, m; `None` if none was measured.
    #[must_use]
    pub fn min_clearance_m(&self) -> Option<f64> {
        self.clearances.iter().map(|clearance| clearance.distance_m).reduce(f64::min)
    }
}

fn interpolated(a: &TruthState, b: &TruthState, share: f64, stamp: Stamp) -> TruthState {
    let linear = |x: f64, y: f64| x + share * (y - x);
    let joints = |x: &JointAngles, y: &JointAngles| JointAngles::from_fn(x.len(), |j| linear(x[j], y[j]));
    TruthState {
        stamp,
        angles: joints(&a.angles, &b.angles),
        rates: joints(&a.rates, &b.rates),
        torques: joints(&a.torques, &b.torques),
        base_from_tool: between(&a.base_from_tool, &b.base_from_tool, share),
        base_from_camera: between(&a.base_from_camera, &b.base_from_camera, share),
        world_from_vehicle: between(&a.world_from_vehicle, &b.world_from_vehicle, share),
        oil_c: linear(a.oil_c, b.oil_c),
        water_c: linear(a.water_c, b.water_c),
    }
}

/// Interpolates positions on a line, orientations on the shortest arc.
fn between<A: Frame, B: Frame>(a: &Pose<A, B>, b: &Pose<A, B>, share: f64) -> Pose<A, B> {
    Pose::from_isometry(a.isometry().lerp_slerp(b.isometry(), share))
}

#[derive(Default)]
struct Reader {
    header: Option<TruthHeader>,
    states: Vec<TruthState>,
    contacts: Vec<TruthContact>,
    clearances: Vec<TruthClearance>,
    faults: Vec<TruthFault>,
    joints: Option<JointState>,
    tool: Option<Pose<Base, Tool>>,
    camera: Option<Pose<Base, Camera>>,
    vehicle: Option<Pose<World, Vehicle>>,
    oil_c: Option<f64>,
}

impl Reader {
    fn take(&mut self, message: &RawMessage) -> Result<(), String> {
        match message.topic() {
            messages::WORLD => {
                let text: StringMessage = decoded(message)?;
                self.header = Some(toml::from_str(&text.data).map_err(|error| error.to_string())?);
            }
            messages::JOINT_STATES => self.joints = Some(decoded(message)?),
            messages::TOOL_POSE => self.tool = Some(pose(message)?),
            messages::CAMERA_POSE => self.camera = Some(pose(message)?),
            messages::VEHICLE_POSE => self.vehicle = Some(pose(message)?),
            messages::OIL_TEMPERATURE => self.oil_c = Some(decoded::<Temperature>(message)?.temperature),
            messages::WATER_TEMPERATURE => self.complete_state(&decoded(message)?)?,
            messages::CONTACTS => {
                let Contact { header, part_a, part_b } = decoded(message)?;
                self.contacts.push(TruthContact { stamp: stamp(header.stamp)?, part_a, part_b });
            }
            messages::CLEARANCE => {
                let Clearance { header, distance_m, part_a, part_b } = decoded(message)?;
                self.clearances.push(TruthClearance { stamp: stamp(header.stamp)?, distance_m, part_a, part_b });
            }
            messages::FAULTS => {
                let FaultMessage { header, kind, details } = decoded(message)?;
                self.faults.push(TruthFault { stamp: stamp(header.stamp)?, kind, details });
            }
            _ => {}
        }
        Ok(())
    }

    /// Completes a state: the water's temperature is its last message.
    fn complete_state(&mut self, water: &Temperature) -> Result<(), String> {
        let parts = (self.joints.take(), self.tool.take(), self.camera.take(), self.vehicle.take(), self.oil_c.take());
        let (Some(joints), Some(base_from_tool), Some(base_from_camera), Some(world_from_vehicle), Some(oil_c)) = parts
        else {
            return Err("a state lacks parts".to_owned());
        };
        self.states.push(TruthState {
            stamp: stamp(joints.header.stamp)?,
            angles: array(&joints.position)?,
            rates: array(&joints.velocity)?,
            torques: array(&joints.effort)?,
            base_from_tool,
            base_from_camera,
            world_from_vehicle,
            oil_c,
            water_c: water.temperature,
        });
        Ok(())
    }
}

fn decoded<T: serde::de::DeserializeOwned>(message: &RawMessage) -> Result<T, String> {
    decode(message.data).map_err(|error| error.to_string())
}

fn pose<A: Frame, B: Frame>(message: &RawMessage) -> Result<Pose<A, B>, String> {
    let pose = decoded::<PoseStamped>(message)?.pose;
    Pose::from_position_quaternion_wxyz(pose.position.into(), pose.orientation.wxyz())
        .ok_or_else(|| "a pose is not finite".to_owned())
}

fn stamp(time: ros::Time) -> Result<Stamp, String> {
    Stamp::try_from(time).map_err(|error| error.to_string())
}

fn array(values: &[f64]) -> Result<JointAngles, String> {
    if values.len() > MAX_JOINTS {
        return Err(format!("{} joints exceed {MAX_JOINTS}", values.len()));
    }
    Ok(JointAngles::from_slice(values))
}
