//! What breaks at a routine's `fault` steps.

use serde::{Deserialize, Serialize};

use super::error::SimError;
use super::spec::WorldSpec;
use crate::robot::{FileIssue, Robot};
use crate::routine::{Routine, Step};

/// One thing that breaks, and stays broken unless it says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Fault {
    /// The sensor slips on its shaft: it reads `by_rad` more from now on.
    SensorJump { joint: String, by_rad: f64 },
    /// The sensor keeps the word that it reads now.
    SensorStuck { joint: String },
    /// The tag falls off.
    TagLost { id: u32 },
    /// The camera sees nothing for a while.
    Silt { seconds: f64 },
}

const KINDS: &str = "sensor_jump (joint, by_rad), sensor_stuck (joint), tag_lost (id), silt (seconds)";

impl WorldSpec {
    /// Reads a routine's `[world]` and the tables of its `fault` steps, and checks them against its robot.
    ///
    /// # Errors
    /// [`SimError::Spec`] naming file, key and what is allowed.
    pub fn from_routine(routine: &Routine, robot: &Robot) -> Result<Self, SimError> {
        let mut spec = Self::from_table(&routine.world, &routine.file)?;
        if !spec.fault.is_empty() {
            let problem = "faults happen at steps of the script: [[step]] do = \"fault\"";
            return Err(FileIssue::new(&routine.file, "world.fault", problem).into());
        }
        let joints = robot.joint_names();
        let known = |key: &str, joint: &str| {
            let problem = || format!("joint `{joint}` is none of {joints:?}");
            if joints.iter().any(|name| name == joint) {
                Ok(())
            } else {
                Err(FileIssue::new(&routine.file, key, problem()))
            }
        };
        for joint in spec.gear_ratio.keys() {
            known("world.gear_ratio", joint)?;
        }
        let steps = routine.steps.iter().enumerate().filter(|(_, step)| matches!(step, Step::Fault { .. }));
        for (table, (index, _)) in routine.faults.iter().zip(steps) {
            let key = format!("step {} (fault)", index + 1);
            let fault: Fault = toml::Value::Table(table.clone()).try_into().map_err(|error: toml::de::Error| {
                let problem = format!("{}; kinds: {KINDS}", error.message().trim_end());
                FileIssue::new(&routine.file, &key, problem)
            })?;
            match &fault {
                Fault::SensorJump { joint, by_rad } => {
                    known(&key, joint)?;
                    FileIssue::check_range(&routine.file, &format!("{key}: by_rad"), *by_rad, -3.2..=3.2)?;
                }
                Fault::SensorStuck { joint } => known(&key, joint)?,
                Fault::TagLost { id } if robot.tag(*id).is_none() => {
                    let ids: Vec<u32> = robot.tags.iter().map(|tag| tag.id).collect();
                    let problem = format!("tag {id} is none of {ids:?}");
                    return Err(FileIssue::new(&routine.file, key, problem).into());
                }
                Fault::TagLost { .. } => {}
                Fault::Silt { seconds } => {
                    FileIssue::check_range(&routine.file, &format!("{key}: seconds"), *seconds, 0.0..=1e6)?;
                }
            }
            spec.fault.push(fault);
        }
        Ok(spec)
    }
}
