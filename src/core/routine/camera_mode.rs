//! `[camera]` of a routine: the origin of the images.

use std::path::Path;

use serde::Deserialize;

use crate::robot::FileIssue;

/// What the routine says of the camera as a user sees it.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    mode: Option<String>,
}

impl CameraFile {
    /// The world's table with the mode in it: where images come from is the truth's business.
    fn into_world(self, file: &Path, mut world: toml::Table) -> Result<toml::Table, FileIssue> {
        const MODES: [&str; 2] = ["geometric", "rendered"];
        let Some(mode) = self.mode else { return Ok(world) };
        if !MODES.contains(&mode.as_str()) {
            return Err(FileIssue::new(file, "camera.mode", format!("`{mode}` is none of {}", MODES.join(", "))));
        }
        let camera = world.entry("camera").or_insert_with(|| toml::Table::new().into());
        // What is no table is refused where the world is read.
        if let Some(camera) = camera.as_table_mut() {
            match camera.get("mode").map(|other| other.as_str().unwrap_or_default()) {
                Some(other) if other != mode => {
                    let problem = format!("`{mode}`, but world.camera.mode is `{other}`: leave one of them out");
                    return Err(FileIssue::new(file, "camera.mode", problem));
                }
                _ => drop(camera.insert("mode".to_owned(), mode.into())),
            }
        }
        Ok(world)
    }
}
