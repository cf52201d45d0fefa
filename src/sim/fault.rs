//! What breaks, and when: at a routine's `fault` steps, or at a time of `[[world.fault]]` whatever the script does.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::error::SimError;
use super::spec::WorldSpec;
use armcal_core::robot::{FileIssue, Robot};
use armcal_core::routine::{Routine, Step};

/// One thing that breaks, and stays broken unless it says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Fault {
    /// The sensor slips on its shaft: it reads `by_rad` more from now on.
    SensorJump { joint: String, by_rad: f64 },
    /// The sensor keeps the word that it reads now.
    SensorStuck { joint: String },
    /// The sensor's wire breaks: its word says nothing about the joint any more.
    SensorDead { joint: String },
    /// The valve jams shut: the oil holds the joint where it is.
    JointLocked { joint: String },
    /// This share of the supply pressure is lost, of one joint's valve (a hose leaks) or of the pump.
    PressureLost {
        #[serde(default, skip_serializing_if = "Option::is_none")]
        joint: Option<String>,
        /// 0: none is lost, 1: all of it.
        ratio: f64,
    },
    /// The tag falls off.
    TagLost { id: u32 },
    /// The tag is knocked out of its place, by a shift and a turn (rotation vector) in its own axes.
    TagMoved {
        id: u32,
        #[serde(default)]
        by_m: [f64; 3],
        #[serde(default)]
        by_rad: [f64; 3],
    },
    /// The detector takes the tag for another one.
    TagMisread { id: u32, as_id: u32 },
    /// The camera sees nothing for a while.
    Silt { seconds: f64 },
    /// Something strikes the vehicle: a force in vehicle axes for a moment, at a point of it (its origin, if left out).
    VehicleKnocked {
        force_n: [f64; 3],
        duration_s: f64,
        #[serde(default)]
        at_m: [f64; 3],
    },
    /// Something strikes a link at its centre of mass: a force in base axes for a moment.
    ArmBumped { link: String, force_n: [f64; 3], duration_s: f64 },
}

const KINDS: &str = "sensor_jump (joint, by_rad), sensor_stuck (joint), sensor_dead (joint), joint_locked (joint), \
     pressure_lost (ratio; joint), tag_lost (id), tag_moved (id; by_m, by_rad), tag_misread (id, as_id), silt (seconds), \
     vehicle_knocked (force_n, duration_s; at_m), arm_bumped (link, force_n, duration_s)";

/// A fault and when it happens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScheduledFault {
    /// Seconds after the start; `None`: at its step of the script.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_s: Option<f64>,
    #[serde(flatten)]
    pub fault: Fault,
}

impl From<Fault> for ScheduledFault {
    /// At a step of the script.
    fn from(fault: Fault) -> Self {
        Self { at_s: None, fault }
    }
}

/// A blow to the vehicle, in vehicle axes about the vehicle's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Impulse {
    pub impulse_n_s: [f64; 3],
    pub angular_impulse_n_m_s: [f64; 3],
}

impl Impulse {
    /// Of a force at a point; short against the vehicle's motion, so that only its impulse counts.
    pub(super) fn new(force_n: [f64; 3], duration_s: f64, at_m: [f64; 3]) -> Self {
        let impulse_n_s = force_n.map(|force| force * duration_s);
        let ([x, y, z], [fx, fy, fz]) = (at_m, impulse_n_s);
        Self { impulse_n_s, angular_impulse_n_m_s: [y * fz - z * fy, z * fx - x * fz, x * fy - y * fx] }
    }
}

impl Fault {
    /// As routines name it.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::SensorJump { .. } => "sensor_jump",
            Self::SensorStuck { .. } => "sensor_stuck",
            Self::SensorDead { .. } => "sensor_dead",
            Self::JointLocked { .. } => "joint_locked",
            Self::PressureLost { .. } => "pressure_lost",
            Self::TagLost { .. } => "tag_lost",
            Self::TagMoved { .. } => "tag_moved",
            Self::TagMisread { .. } => "tag_misread",
            Self::Silt { .. } => "silt",
            Self::VehicleKnocked { .. } => "vehicle_knocked",
            Self::ArmBumped { .. } => "arm_bumped",
        }
    }

    /// What routines say of it beside its kind: `by_rad = 0.05, joint = "wrist_yaw"`.
    #[must_use]
    pub fn details(&self) -> String {
        let mut table = toml::Table::try_from(self).unwrap_or_default();
        table.remove("kind");
        table.iter().map(|(key, value)| format!("{key} = {value}")).collect::<Vec<_>>().join(", ")
    }
}

/// The list `[[world.fault]]`, its values not yet held against a robot.
///
/// # Errors
/// [`FileIssue`] naming the entry, counted from 0 as `--set` does.
pub(super) fn read_list(table: &toml::Table, file: &Path) -> Result<Vec<ScheduledFault>, FileIssue> {
    let entries = match table.get("fault") {
        None => return Ok(Vec::new()),
        Some(toml::Value::Array(entries)) => entries,
        Some(_) => return Err(FileIssue::new(file, "world.fault", "must be a list of tables: [[world.fault]]")),
    };
    let read = |(index, entry): (usize, &toml::Value)| read_one(entry.clone(), file, &list_key(index));
    entries.iter().enumerate().map(read).collect()
}

fn list_key(index: usize) -> String {
    format!("world.fault.{index}")
}

fn read_one<T: serde::de::DeserializeOwned>(entry: toml::Value, file: &Path, key: &str) -> Result<T, FileIssue> {
    entry.try_into().map_err(|error: toml::de::Error| {
        FileIssue::new(file, key, format!("{}; kinds: {KINDS}", error.message().trim_end()))
    })
}

impl WorldSpec {
    /// Reads a routine's `[world]` and the tables of its `fault` steps, and checks them against its robot. The steps' faults
    /// come first in the list, then those with a time.
    ///
    /// # Errors
    /// [`SimError::Spec`] naming file, key and what is allowed.
    pub fn from_routine(routine: &Routine, robot: &Robot) -> Result<Self, SimError> {
        let mut spec = Self::from_table(&routine.world, &routine.file)?;
        spec.read_motion(routine.file.parent().unwrap_or(Path::new(".")))?;
        super::world::check_step(&spec, robot, &routine.file)?;
        let drawing = Drawing { routine, robot };
        for joint in spec.gear_ratio.keys() {
            drawing.check_joint("world.gear_ratio", joint)?;
        }
        for (index, scheduled) in spec.fault.iter().enumerate() {
            let key = list_key(index);
            let Some(at_s) = scheduled.at_s else {
                let problem = "needs at_s, the time when it happens; faults without one are steps of the script: \
                               [[step]] do = \"fault\"";
                return Err(FileIssue::new(&routine.file, key, problem).into());
            };
            drawing.check_range(&key, "at_s", at_s, 0.0..=1e6)?;
            drawing.check(&key, &scheduled.fault)?;
        }
        let steps = routine.steps.iter().enumerate().filter(|(_, step)| matches!(step, Step::Fault { .. }));
        let mut of_steps: Vec<ScheduledFault> = Vec::new();
        for (table, (index, _)) in routine.faults.iter().zip(steps) {
            let key = format!("step {} (fault)", index + 1);
            let fault: Fault = read_one(toml::Value::Table(table.clone()), &routine.file, &key)?;
            drawing.check(&key, &fault)?;
            of_steps.push(fault.into());
        }
        spec.fault.splice(0..0, of_steps);
        Ok(spec)
    }
}

/// What faults are held against.
struct Drawing<'a> {
    routine: &'a Routine,
    robot: &'a Robot,
}

impl Drawing<'_> {
    fn check(&self, key: &str, fault: &Fault) -> Result<(), FileIssue> {
        match fault {
            Fault::SensorJump { joint, by_rad } => {
                self.check_joint(key, joint)?;
                self.check_range(key, "by_rad", *by_rad, -3.2..=3.2)
            }
            Fault::SensorStuck { joint } | Fault::SensorDead { joint } | Fault::JointLocked { joint } => {
                self.check_joint(key, joint)
            }
            Fault::PressureLost { joint, ratio } => {
                joint.as_ref().map_or(Ok(()), |joint| self.check_joint(key, joint))?;
                self.check_range(key, "ratio", *ratio, 0.0..=1.0)
            }
            Fault::TagLost { id } => self.check_tag(key, *id),
            Fault::TagMoved { id, by_m, by_rad } => {
                self.check_tag(key, *id)?;
                self.check_vector(key, "by_m", by_m, 2.0)?;
                self.check_vector(key, "by_rad", by_rad, 3.2)
            }
            Fault::TagMisread { id, as_id } => {
                self.check_tag(key, *id)?;
                if id == as_id {
                    let problem = format!("as_id: {as_id} is the tag's own id, which is no misreading");
                    return Err(FileIssue::new(&self.routine.file, key, problem));
                }
                // The recording's ids are signed words of 32 bits.
                self.check_range(key, "as_id", f64::from(*as_id), 0.0..=f64::from(i32::MAX))
            }
            Fault::Silt { seconds } => self.check_range(key, "seconds", *seconds, 0.0..=1e6),
            Fault::VehicleKnocked { force_n, duration_s, at_m } => {
                self.check_vector(key, "force_n", force_n, 1e6)?;
                self.check_range(key, "duration_s", *duration_s, 0.01..=10.0)?;
                self.check_vector(key, "at_m", at_m, 10.0)
            }
            Fault::ArmBumped { link, force_n, duration_s } => {
                self.check_link(key, link)?;
                self.check_vector(key, "force_n", force_n, 1e5)?;
                self.check_range(key, "duration_s", *duration_s, 0.01..=10.0)
            }
        }
    }

    fn check_range(
        &self,
        key: &str,
        name: &str,
        value: f64,
        range: std::ops::RangeInclusive<f64>,
    ) -> Result<(), FileIssue> {
        FileIssue::check_range(&self.routine.file, &format!("{key}: {name}"), value, range).map(|_| ())
    }

    fn check_vector(&self, key: &str, name: &str, vector: &[f64; 3], limit: f64) -> Result<(), FileIssue> {
        vector.iter().try_for_each(|value| self.check_range(key, name, *value, -limit..=limit))
    }

    fn check_joint(&self, key: &str, joint: &str) -> Result<(), FileIssue> {
        self.check_name(key, "joint", joint, &self.robot.joint_names())
    }

    /// The base does not move on the vehicle: it is no link that can be bumped.
    fn check_link(&self, key: &str, link: &str) -> Result<(), FileIssue> {
        let links: Vec<String> = self.robot.bodies[1..].iter().map(|body| body.name.clone()).collect();
        self.check_name(key, "link", link, &links)
    }

    fn check_name(&self, key: &str, what: &str, name: &str, known: &[String]) -> Result<(), FileIssue> {
        if known.iter().any(|other| other == name) {
            return Ok(());
        }
        Err(FileIssue::new(&self.routine.file, key, format!("{what} `{name}` is none of {known:?}")))
    }

    fn check_tag(&self, key: &str, id: u32) -> Result<(), FileIssue> {
        if self.robot.tag(id).is_some() {
            return Ok(());
        }
        let ids: Vec<u32> = self.robot.tags.iter().map(|tag| tag.id).collect();
        Err(FileIssue::new(&self.routine.file, key, format!("tag {id} is none of {ids:?}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_of_the_list_reads_back_and_misspelt_keys_are_refused() {
        let text = "[[fault]]\nat_s = 120\nkind = \"tag_moved\"\nid = 3\nby_m = [0.01, 0, 0]\n[[fault]]\nkind = \"silt\"\nseconds = 2.5\n";
        let read = |text: &str| read_list(&text.parse().expect("TOML"), Path::new("r.toml"));
        let faults = read(text).expect("valid");
        let moved = Fault::TagMoved { id: 3, by_m: [0.01, 0.0, 0.0], by_rad: [0.0; 3] };
        assert_eq!(faults[0], ScheduledFault { at_s: Some(120.0), fault: moved });
        assert_eq!(faults[1], Fault::Silt { seconds: 2.5 }.into());
        let spec = WorldSpec { fault: faults.clone(), ..WorldSpec::default() };
        assert_eq!(read(&spec.to_toml().expect("text")).expect("it reads back"), faults);
        let problem = |text: &str| read(text).expect_err("refused").to_string();
        let misspelt = problem("[[fault]]\nkind = \"silt\"\nseconds = 1.0\nat = 3.0");
        assert!(misspelt.contains("r.toml") && misspelt.contains("world.fault.0"), "{misspelt}");
        assert!(misspelt.contains("`at`") && misspelt.contains("sensor_dead"), "{misspelt}");
        assert!(problem("[[fault]]\nkind = \"flood\"").contains("unknown variant `flood`"));
        assert!(problem("[fault]\nkind = \"silt\"").contains("[[world.fault]]"));
    }

    #[test]
    fn details_are_what_a_routine_says() {
        let fault = Fault::SensorJump { joint: "wrist_yaw".into(), by_rad: 0.05 };
        assert_eq!((fault.kind(), fault.details().as_str()), ("sensor_jump", "by_rad = 0.05, joint = \"wrist_yaw\""));
    }

    #[test]
    fn a_blow_beside_the_origin_turns_the_vehicle() {
        let knock = Impulse::new([0.0, 100.0, 0.0], 0.5, [2.0, 0.0, 0.0]);
        assert_eq!(knock.impulse_n_s, [0.0, 50.0, 0.0]);
        assert_eq!(knock.angular_impulse_n_m_s, [0.0, 0.0, 100.0]);
    }
}
