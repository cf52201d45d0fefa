//! `[map]` of calibration.toml: tag poses, used instead of a survey.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use armcal_core::document::VERSION;
use armcal_core::kind::Kind;
use armcal_core::schema::first_line;

/// Tag map that a calibration used instead of a survey.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapResult {
    /// Part of the tag poses that was known before.
    pub known: SurveyCoverage,
    /// Base link of the arm; the tags' poses are in its frame.
    pub frame: String,
    /// Id of the tag at the base.
    pub base_tag: u32,
    /// Number of views that the map was made from.
    pub views: usize,
    /// Root mean square distance between measured and predicted corners, px.
    pub rms_px: f64,
    /// Number of detections that the map did not use.
    pub rejected: usize,
    /// Omitted tags as `tag N: why`; their detections are not used for the joints either.
    pub left_out: Vec<String>,
    /// Tags of the map, known ones included, omitted ones not.
    pub tag: Vec<MapTag>,
}

/// Part of the tag poses that was known before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurveyCoverage {
    /// The poses of some tags are known.
    Partly,
    /// Only the pose of the base tag is known.
    BaseTagAlone,
}

/// A tag of the map, in the arm's base frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapTag {
    /// Id of the tag.
    pub id: u32,
    /// Side length of the black square.
    pub size_m: f64,
    /// Position of the tag's origin.
    pub position_m: [f64; 3],
    /// Rotation of `base_from_tag`.
    pub quaternion_wxyz: [f64; 4],
    /// Standard deviation of the position along the base frame's axes, the anchor's own error included.
    pub position_std_m: [f64; 3],
    /// Standard deviation of the rotation about the tag's axes.
    pub rotation_std_rad: [f64; 3],
    /// Number of views that show the tag.
    pub n_views: usize,
}

/// A tag map file, as `armcal tagmap` writes it and `armcal calibrate --tag-map` reads it.
#[derive(Serialize)]
struct MapFile<'a> {
    version: u32,
    kind: Kind,
    frame: &'a str,
    base_tag: u32,
    tag: Vec<MapFileTag>,
}

#[derive(Serialize)]
struct MapFileTag {
    id: u32,
    size_m: f64,
    position_m: [f64; 3],
    quaternion_wxyz: [f64; 4],
    position_std_m: [f64; 3],
    rotation_std_rad: [f64; 3],
}

impl MapResult {
    /// Returns the map as a separate file, in the frame of the arm's base.
    ///
    /// # Panics
    /// Never: numbers and names have a TOML form.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let tag = self.tag.iter().map(|tag| MapFileTag {
            id: tag.id,
            size_m: tag.size_m,
            position_m: tag.position_m,
            quaternion_wxyz: tag.quaternion_wxyz,
            position_std_m: tag.position_std_m,
            rotation_std_rad: tag.rotation_std_rad,
        });
        let file = MapFile {
            version: VERSION,
            kind: Kind::TagMap,
            frame: &self.frame,
            base_tag: self.base_tag,
            tag: tag.collect(),
        };
        let body = toml::to_string(&file).expect("plain tables and finite numbers have a TOML form");
        format!("{}{body}", first_line(Kind::TagMap))
    }
}
