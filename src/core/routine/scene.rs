//! The scene: surroundings of the vehicle as the operator describes them.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::RoutineError;
use super::site::SiteFile;
use crate::document::{VERSION, parse_file};
use crate::kind::Kind;
use crate::robot::{FileIssue, Part, PartFile, check_parts, read_text};
use crate::schema::schema_of;

/// The site: a flat seafloor and obstacles, placed in the world frame (z up, origin at the vehicle's station).
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Height of the seafloor in the world frame; `None` in open water.
    pub seafloor_z_m: Option<f64>,
    /// Obstacles with poses in the world frame.
    pub obstacles: Vec<Part>,
}

/// The tables `[site]` and `[[obstacle]]` of a routine, as a file that travels with a recording.
#[derive(Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    version: u32,
    #[serde(default = "Kind::scene")]
    kind: Kind,
    /// Seafloor and tags.
    #[serde(default)]
    pub(super) site: SiteFile,
    /// Obstacles fixed in the world.
    #[serde(default)]
    pub(super) obstacle: Vec<PartFile>,
}

impl SceneFile {
    pub(super) fn new(site: SiteFile, obstacle: Vec<PartFile>) -> Self {
        Self { version: VERSION, kind: Kind::Scene, site, obstacle }
    }

    /// Returns the scene, and this file without the files of meshes.
    pub(super) fn check(self, file: &Path) -> Result<(Scene, Self), RoutineError> {
        if let Some(z) = self.site.seafloor_z_m {
            FileIssue::check_range(file, "site.seafloor_z_m", z, -1e4..=0.0)?;
        }
        let (obstacles, plain) = check_parts(&self.obstacle, file, "obstacle")?;
        Ok((Scene { seafloor_z_m: self.site.seafloor_z_m, obstacles }, Self { obstacle: plain, ..self }))
    }
}

/// Returns the schema of a recording's scene.
#[must_use]
pub fn scene_schema() -> serde_json::Value {
    schema_of::<SceneFile>(Kind::Scene)
}

/// Reads the scene that travels with a recording.
///
/// # Errors
/// [`RoutineError`] naming file, key and allowed range.
pub fn load_scene(file: &Path) -> Result<Scene, RoutineError> {
    Ok(parse_file::<SceneFile>(Kind::Scene, file, &read_text(file)?)?.check(file)?.0)
}
