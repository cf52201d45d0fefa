//! Reader of fault tables: `[[world.fault]]` and the `fault` steps of a script.

use armcal_core::codes::Code;
use std::path::Path;

use crate::fault::kinds::ScheduledFault;
use armcal_core::robot::{FileIssue, toml_problem};

const KINDS: &str = "sensor_jump (joint, by_rad), sensor_stuck (joint), sensor_dead (joint), joint_locked (joint), \
     pressure_lost (ratio; joint), tag_lost (id), tag_moved (id; by_m, by_rad), tag_misread (id, as_id), \
     silt (seconds), vehicle_knocked (force_n, duration_s; at_m), arm_bumped (link, force_n, duration_s)";

/// Reads the list `[[world.fault]]`, without checking its values against a robot.
///
/// # Errors
/// [`FileIssue`] naming the entry, counted from 0 as `--set` does.
pub(crate) fn read_list(table: &toml::Table, file: &Path) -> Result<Vec<ScheduledFault>, FileIssue> {
    let entries = match table.get("fault") {
        None => return Ok(Vec::new()),
        Some(toml::Value::Array(entries)) => entries,
        Some(_) => {
            return Err(FileIssue::new(
                Code::ValueType,
                file,
                "world.fault",
                "must be a list of tables: [[world.fault]]",
            ));
        }
    };
    let read = |(index, entry): (usize, &toml::Value)| read_one(entry.clone(), file, &list_key(index));
    entries.iter().enumerate().map(read).collect()
}

pub(crate) fn list_key(index: usize) -> String {
    format!("world.fault.{index}")
}

pub(crate) fn read_one<T: serde::de::DeserializeOwned>(
    entry: toml::Value,
    file: &Path,
    key: &str,
) -> Result<T, FileIssue> {
    entry.try_into().map_err(|error: toml::de::Error| {
        FileIssue::syntax(file, key, format!("{}; kinds: {KINDS}", toml_problem(&error)))
    })
}
