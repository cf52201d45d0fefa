//! Check of a fault against the routine's robot: names, ids and allowed ranges.

use crate::fault::kinds::Fault;
use armcal_core::codes::Code;
use armcal_core::robot::{FileIssue, Robot, SensorKind};
use armcal_core::routine::Routine;

/// Routine and robot against which faults are checked.
pub(crate) struct RobotCheck<'a> {
    pub routine: &'a Routine,
    pub robot: &'a Robot,
}

impl RobotCheck<'_> {
    pub(crate) fn check_fault(&self, key: &str, fault: &Fault) -> Result<(), FileIssue> {
        match fault {
            Fault::SensorJump { joint, by_rad } => {
                self.check_joint(key, joint)?;
                self.check_range(key, "by_rad", *by_rad, -3.2..=3.2)
            }
            Fault::SensorStuck { joint }
            | Fault::SensorDead { joint }
            | Fault::SensorReversed { joint }
            | Fault::JointLocked { joint } => self.check_joint(key, joint),
            Fault::SensorWorn { joint, at_rad, by_rad, width_rad } => {
                self.check_joint(key, joint)?;
                self.check_range(key, "at_rad", *at_rad, -6.3..=6.3)?;
                self.check_range(key, "width_rad", *width_rad, 1e-3..=1.0)?;
                self.check_range(key, "by_rad (at most the width)", *by_rad, -width_rad..=*width_rad)
            }
            Fault::SensorDying { joint, dropout_per_s } => {
                self.check_joint(key, joint)?;
                let sensor = self.robot.sensors.iter().find(|sensor| sensor.joint == *joint);
                if sensor.is_some_and(|sensor| sensor.kind != SensorKind::Potentiometer) {
                    let problem = format!("`{joint}` has no potentiometer, and so no wiper that loses contact");
                    return Err(FileIssue::new(Code::ValueInvalid, &self.routine.file, key, problem));
                }
                self.check_range(key, "dropout_per_s", *dropout_per_s, 0.0..=100.0)
            }
            Fault::CameraSlipped { by_m, by_rad } => {
                self.check_vector(key, "by_m", by_m, 0.5)?;
                self.check_vector(key, "by_rad", by_rad, 3.2)
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
                    return Err(FileIssue::new(Code::ValueInvalid, &self.routine.file, key, problem));
                }
                // The recording's ids are signed words of 32 bits.
                self.check_range(key, "as_id", f64::from(*as_id), 0.0..=f64::from(i32::MAX))
            }
            Fault::Silt { seconds } => self.check_range(key, "seconds", *seconds, 0.0..=1e6),
            Fault::VehicleImpulse { force_n, duration_s, at_m } => {
                self.check_vector(key, "force_n", force_n, 1e6)?;
                self.check_range(key, "duration_s", *duration_s, 0.01..=10.0)?;
                self.check_vector(key, "at_m", at_m, 10.0)
            }
            Fault::ArmImpulse { link, force_n, duration_s } => {
                self.check_link(key, link)?;
                self.check_vector(key, "force_n", force_n, 1e5)?;
                self.check_range(key, "duration_s", *duration_s, 0.01..=10.0)
            }
        }
    }

    pub(crate) fn check_range(
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

    pub(crate) fn check_joint(&self, key: &str, joint: &str) -> Result<(), FileIssue> {
        self.check_name(key, "joint", joint, &self.robot.joint_names())
    }

    /// Refuses the base as a link that can be struck or pulled, because it does not move on the vehicle.
    pub(crate) fn check_link(&self, key: &str, link: &str) -> Result<(), FileIssue> {
        let links: Vec<String> = self.robot.bodies[1..].iter().map(|body| body.name.clone()).collect();
        self.check_name(key, "link", link, &links)
    }

    fn check_name(&self, key: &str, what: &str, name: &str, known: &[String]) -> Result<(), FileIssue> {
        if known.iter().any(|other| other == name) {
            return Ok(());
        }
        Err(FileIssue::new(Code::NameUnknown, &self.routine.file, key, format!("{what} `{name}` is none of {known:?}")))
    }

    fn check_tag(&self, key: &str, id: u32) -> Result<(), FileIssue> {
        if self.robot.tag(id).is_some() {
            return Ok(());
        }
        let ids: Vec<u32> = self.robot.tags.iter().map(|tag| tag.id).collect();
        Err(FileIssue::new(Code::NameUnknown, &self.routine.file, key, format!("tag {id} is none of {ids:?}")))
    }
}
