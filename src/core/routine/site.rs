//! `[site]` of a routine: the seafloor, the tags that are present, and the knowledge of their poses.

use crate::codes::Code;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::robot::{BaseTagStd, FileIssue, MapKnowledge};

#[derive(Clone, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SiteFile {
    /// Height of the seafloor in the world frame; absent: open water.
    #[schemars(range(min = -1e4, max = 0.0))]
    pub(super) seafloor_z_m: Option<f64>,
    /// Ids of the tags that are present; absent: all of the vehicle's (or robot's).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) tags: Option<Vec<u32>>,
    /// Tags with known poses.
    #[serde(skip_serializing_if = "Option::is_none")]
    map: Option<MapFile>,
    /// Ids of the tags with known poses; with map = "partly".
    #[serde(skip_serializing_if = "Option::is_none")]
    known_tags: Option<Vec<u32>>,
    /// Standard deviation of the base tag's position, if better known than its file states.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    base_tag_position_std_m: Option<f64>,
    /// Standard deviation of the base tag's attitude, if better known than its file states.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 1.0))]
    base_tag_rotation_std_rad: Option<f64>,
}

/// Tags with known poses, as files write it.
#[derive(Clone, Copy, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum MapFile {
    /// All tags.
    Known,
    /// The base tag and `known_tags`.
    Partly,
    /// The base tag only.
    Unknown,
}

impl SiteFile {
    pub(super) fn map(&self, file: &Path) -> Result<MapKnowledge, FileIssue> {
        let tracking_error = || {
            FileIssue::new(Code::KeysConflict, file, "site.known_tags", "goes with map = \"partly\", and that with it")
        };
        match (self.map.unwrap_or(MapFile::Known), &self.known_tags) {
            (MapFile::Known, None) => Ok(MapKnowledge::Known),
            (MapFile::Unknown, None) => Ok(MapKnowledge::Unknown),
            (MapFile::Partly, Some(known)) => Ok(MapKnowledge::Partly(known.clone())),
            _ => Err(tracking_error()),
        }
    }

    pub(super) fn base_tag_std(&self, file: &Path) -> Result<BaseTagStd, FileIssue> {
        let check = |key: &str, value: Option<f64>| match value {
            Some(value) => FileIssue::check_range(file, key, value, 0.0..=1.0).map(Some),
            None => Ok(None),
        };
        Ok(BaseTagStd {
            position_std_m: check("site.base_tag_position_std_m", self.base_tag_position_std_m)?,
            rotation_std_rad: check("site.base_tag_rotation_std_rad", self.base_tag_rotation_std_rad)?,
        })
    }
}
