//! A routine's `[world]` and faults, read and checked against its robot.

use armcal_core::codes::Code;
use std::path::Path;

use crate::error::SimError;
use crate::fault::{Fault, LATEST_FAULT_S, RobotCheck, ScheduledFault, list_key, read_one};
use crate::hydraulics::{Hydraulics, actuator_inputs};
use crate::spec::WorldSpec;
use armcal_core::robot::{FileIssue, Robot};
use armcal_core::routine::{Routine, Step};

impl WorldSpec {
    /// Reads a routine's `[world]` and the tables of its `fault` steps, and checks them against its robot. The steps'
    /// faults come first in the list, then those with a time.
    ///
    /// # Errors
    /// [`SimError::Spec`] naming file, key and what is allowed.
    pub fn from_routine(routine: &Routine, robot: &Robot) -> Result<Self, SimError> {
        let mut spec = Self::from_table(&routine.world, &routine.file)?;
        let is_said = |key| routine.world.get("joint_sensors").is_some_and(|sensors| sensors.get(key).is_some());
        spec.by_datasheet = ["gain_error_max", "offset_error_max_rad"].map(|key| !is_said(key));
        spec.read_motion(routine.file.parent().unwrap_or(Path::new(".")))?;
        check_step(&spec, robot, &routine.file)?;
        let check = RobotCheck { routine, robot };
        for joint in spec.gear_ratio.keys() {
            check.check_joint("world.gear_ratio", joint)?;
        }
        let structure = &spec.structure;
        for joint in structure.joint_compliance_rad_per_nm.keys().chain(structure.bearing_play_rad.keys()) {
            check.check_joint("world.structure", joint)?;
        }
        if structure.hose_stiffness_n_m > 0.0 {
            check.check_link("world.structure.hose_link", &structure.hose_link)?;
        }
        for (index, scheduled) in spec.fault.iter().enumerate() {
            let key = list_key(index);
            let Some(at_s) = scheduled.at_s else {
                let problem = "needs at_s, the time when it happens; faults without one are steps of the script: \
                               [[step]] do = \"fault\"";
                return Err(FileIssue::new(Code::KeyMissing, &routine.file, key, problem).into());
            };
            check.check_range(&key, "at_s", at_s, 0.0..=LATEST_FAULT_S)?;
            check.check_fault(&key, &scheduled.fault)?;
        }
        let steps = routine.steps.iter().enumerate().filter(|(_, step)| matches!(step, Step::Fault { .. }));
        let mut of_steps: Vec<ScheduledFault> = Vec::new();
        for (table, (index, _)) in routine.faults.iter().zip(steps) {
            let key = format!("step {} (fault)", index + 1);
            let fault: Fault = read_one(toml::Value::Table(table.clone()), &routine.file, &key)?;
            check.check_fault(&key, &fault)?;
            of_steps.push(fault.into());
        }
        spec.fault.splice(0..0, of_steps);
        Ok(spec)
    }
}

/// Checks that the step is short enough for the oil's stiffness.
///
/// # Errors
/// [`SimError::Spec`] with the longest step; the errors of [`actuator_inputs`].
fn check_step(spec: &WorldSpec, robot: &Robot, file: &Path) -> Result<(), SimError> {
    let longest_s = Hydraulics::new(&spec.hydraulics, &actuator_inputs(robot)?, spec.physics.step_s).longest_step_s();
    if spec.physics.step_s <= longest_s {
        return Ok(());
    }
    let problem = format!(
        "{} s is too large for the oil's stiffness (bulk_modulus_pa, dead_volume_ratio): at most {longest_s:.2e} s",
        spec.physics.step_s
    );
    Err(FileIssue::new(Code::ValueOutOfRange, file, "world.physics.step_s", problem).into())
}
