//! `[map]` of calibration.toml: where the tags are, in place of a survey.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use armcal_core::document::VERSION;
use armcal_core::kind::Kind;
use armcal_core::schema::first_line;

/// The map that a calibration used in place of a survey.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapResult {
    /// What was known before.
    pub known: SurveyCoverage,
    /// The arm's base link, whose frame the tags' places are in.
    pub frame: String,
    /// Id of the tag beside the base.
    pub base_tag: u32,
    /// Views that it was made from.
    pub views: usize,
    /// Root mean square distance between measured and predicted corner, px.
    pub rms_px: f64,
    /// Detections that it did not use.
    pub rejected: usize,
    /// `tag N: why`; their detections are not used for the joints either.
    pub left_out: Vec<String>,
    /// Tags of the map, known ones included; those that are left out are missing.
    pub tag: Vec<MapTag>,
}

/// How much of the map was known before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SurveyCoverage {
    /// Where some tags are.
    Partly,
    /// Where the base tag is.
    BaseTagAlone,
}

/// A tag of the map, in the arm's base frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MapTag {
    /// Number of the tag.
    pub id: u32,
    /// Side of the black square.
    pub size_m: f64,
    /// Origin of the tag.
    pub position_m: [f64; 3],
    /// `base_from_tag`.
    pub quaternion_wxyz: [f64; 4],
    /// Along the base frame's axes, the anchor's own error included.
    pub position_std_m: [f64; 3],
    /// About the tag's axes.
    pub rotation_std_rad: [f64; 3],
    /// Number of views that show it.
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
    /// The map as a file of its own, in the frame of the arm's base.
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
