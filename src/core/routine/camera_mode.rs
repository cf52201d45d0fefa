//! `[camera]` of a routine: the origin of the images.

use crate::codes::Code;
use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::robot::FileIssue;

/// Allowed values of `mode`.
const MODES: [&str; 2] = ["geometric", "rendered"];

#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraFile {
    /// `geometric`: corners are computed; `rendered`: a detector reads rendered images.
    #[schemars(extend("enum" = MODES))]
    mode: Option<String>,
}

impl CameraFile {
    /// Returns the table `[world]` with the mode in `[world.camera]`; only the simulator reads it.
    pub(super) fn into_world(self, file: &Path, mut world: toml::Table) -> Result<toml::Table, FileIssue> {
        let Some(mode) = self.mode else { return Ok(world) };
        if !MODES.contains(&mode.as_str()) {
            return Err(FileIssue::new(
                Code::NameUnknown,
                file,
                "camera.mode",
                format!("`{mode}` is none of {}", MODES.join(", ")),
            ));
        }
        let camera = world.entry("camera").or_insert_with(|| toml::Table::new().into());
        // The simulator refuses a `world.camera` that is not a table.
        if let Some(camera) = camera.as_table_mut() {
            match camera.get("mode").map(|other| other.as_str().unwrap_or_default()) {
                Some(other) if other != mode => {
                    let problem = format!("`{mode}`, but world.camera.mode is `{other}`: leave one of them out");
                    return Err(FileIssue::new(Code::KeysConflict, file, "camera.mode", problem));
                }
                _ => drop(camera.insert("mode".to_owned(), mode.into())),
            }
        }
        Ok(world)
    }
}
