//! Surveyed tags of robot.toml or of the vehicle that carries them.

use crate::codes::Code;
use std::collections::BTreeSet;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{FileIssue, RobotError};
use super::part::check_place;
use crate::kinematics::Attachment;
use crate::optics::TagFamily;
use crate::spatial::{Base, Frame, Pose, Tag};

/// Limit of the tags of one file; the largest family has 587.
pub const MAX_TAGS: usize = 5_000;

/// A tag with a surveyed pose, or with an unknown one.
#[derive(Clone, Debug)]
pub struct SurveyedTag {
    /// Id of the tag in the family of its survey.
    pub id: u32,
    /// Side of the black square. NaN if it is unknown, for a landmark of which only position or pose is used.
    pub size_m: f64,
    /// Pose of the tag; a nominal pose at best if it is unknown. It is in the frame of [`TagSurvey::frame`], which
    /// differs from the base's only in front of a stationary camera.
    pub base_from_tag: Pose<Base, Tag>,
    /// Standard deviation of the position, per axis; infinite if the pose is unknown.
    pub position_std_m: f64,
    /// Standard deviation of the rotation, per axis; infinite if the pose is unknown.
    pub rotation_std_rad: f64,
}

impl SurveyedTag {
    /// Returns true if the tag's pose is known.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.position_std_m.is_finite() && self.rotation_std_rad.is_finite()
    }
}

/// The part of a survey that the arm may use.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum MapKnowledge {
    /// The poses of all tags are known.
    #[default]
    Known,
    /// The poses of these tags and of the base tag are known; of the others only the size.
    Partly(Vec<u32>),
    /// The pose of the base tag is known; of the others only the size.
    Unknown,
}

/// Standard deviations of the base tag's pose that replace those of its file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BaseTagStd {
    /// Standard deviation of the position, per axis; `None` keeps the file's.
    pub position_std_m: Option<f64>,
    /// Standard deviation of the rotation, per axis; `None` keeps the file's.
    pub rotation_std_rad: Option<f64>,
}

/// All tags around an arm.
#[derive(Clone, Debug)]
pub struct TagSurvey {
    /// Id of the tag next to the base, which the replay shows; `None` if there are no tags.
    pub base_tag: Option<u32>,
    /// Id of the tag whose error all others share, as the tags of a map do; their standard deviations include it.
    /// `None` if each tag was surveyed independently.
    pub anchor_tag: Option<u32>,
    /// Frame of the poses.
    pub frame: Attachment,
    /// Family of all tags; `None` if the source of the survey does not state it.
    pub family: Option<TagFamily>,
    /// Surveyed tags, each id once; the base tag is one of them.
    pub tags: Vec<SurveyedTag>,
}

impl TagSurvey {
    /// Returns the survey with only these tags. Without the base tag, the first of them takes its role.
    pub fn only(&self, ids: &[u32]) -> Result<Self, String> {
        let known: Vec<u32> = self.tags.iter().map(|tag| tag.id).collect();
        match ids.iter().find(|id| !known.contains(id)) {
            Some(id) => return Err(format!("tag {id} is none of {known:?}")),
            None if ids.is_empty() => return Err("needs one tag or more".to_owned()),
            None => {}
        }
        let base_tag = self.base_tag.filter(|id| ids.contains(id)).or(ids.first().copied());
        let tags = self.tags.iter().filter(|tag| ids.contains(&tag.id)).cloned().collect();
        Ok(Self { base_tag, tags, ..*self })
    }

    /// Returns the survey limited to `knowledge`: the other tags get infinite standard deviations.
    pub fn with_knowledge(mut self, knowledge: &MapKnowledge, base: BaseTagStd) -> Result<Self, String> {
        let known: &[u32] = match knowledge {
            MapKnowledge::Partly(known) => known,
            MapKnowledge::Known | MapKnowledge::Unknown => &[],
        };
        if let Some(id) = known.iter().find(|id| self.tags.iter().all(|tag| tag.id != **id)) {
            let ids: Vec<u32> = self.tags.iter().map(|tag| tag.id).collect();
            return Err(format!("tag {id} is none of {ids:?}"));
        }
        for tag in &mut self.tags {
            if Some(tag.id) == self.base_tag {
                tag.position_std_m = base.position_std_m.unwrap_or(tag.position_std_m);
                tag.rotation_std_rad = base.rotation_std_rad.unwrap_or(tag.rotation_std_rad);
            } else if *knowledge != MapKnowledge::Known && !known.contains(&tag.id) {
                (tag.position_std_m, tag.rotation_std_rad) = (f64::INFINITY, f64::INFINITY);
            }
        }
        Ok(self)
    }
}

/// `[[tag]]` of a file, with its pose in the owner's frame.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TagFile {
    /// Id of the tag.
    id: u32,
    /// Family of the tag, such as `36h11`; one for all tags of an arm.
    family: String,
    /// Edge of the black square.
    #[schemars(range(min = 1e-3, max = 10.0))]
    size_m: f64,
    /// Position of the tag's centre in its owner's frame.
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    position_m: [f64; 3],
    /// Attitude of the tag in its owner's frame: x right, y up as printed, z out of the tag.
    quaternion_wxyz: [f64; 4],
    /// Standard deviation of the surveyed position, per axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    position_std_m: f64,
    /// Standard deviation of the surveyed attitude, per axis.
    #[schemars(range(min = 0.0, max = 1.0))]
    rotation_std_rad: f64,
}

/// Checks the tags of `file`, whose poses are in the frame `Owner`, and that they are of one family.
pub(super) fn check_tags<Owner: Frame>(
    file: &Path,
    raw: &[TagFile],
    base_tag: Option<u32>,
    base_from_owner: &Pose<Base, Owner>,
) -> Result<(Vec<SurveyedTag>, Option<TagFamily>), RobotError> {
    if raw.len() > MAX_TAGS {
        return Err(FileIssue::new(
            Code::ValueCount,
            file,
            "tag",
            format!("{} tags, 0 .. {MAX_TAGS} allowed", raw.len()),
        )
        .into());
    }
    let (mut seen, mut family) = (BTreeSet::new(), None);
    let mut tags = Vec::new();
    for tag in raw {
        let key = |name: &str| format!("tag {}: {name}", tag.id);
        if !seen.insert(tag.id) {
            return Err(FileIssue::new(Code::ValueDuplicate, file, key("id"), "is defined twice").into());
        }
        let own: TagFamily =
            tag.family.parse().map_err(|problem| FileIssue::new(Code::NameUnknown, file, key("family"), problem))?;
        if *family.get_or_insert(own) != own {
            let problem = format!("is {own}, that of tag {} is {}; one family an arm", raw[0].id, raw[0].family);
            return Err(FileIssue::new(Code::KeysConflict, file, key("family"), problem).into());
        }
        check_place(file, &key("position_m"), &tag.position_m)?;
        let owner_from_tag: Pose<Owner, Tag> = Pose::from_position_quaternion_wxyz(tag.position_m, tag.quaternion_wxyz)
            .ok_or_else(|| {
                FileIssue::new(Code::ValueInvalid, file, key("position_m, quaternion_wxyz"), "must be finite, not zero")
            })?;
        tags.push(SurveyedTag {
            id: tag.id,
            size_m: FileIssue::check_range(file, &key("size_m"), tag.size_m, 1e-3..=10.0)?,
            base_from_tag: *base_from_owner * owner_from_tag,
            position_std_m: FileIssue::check_range(file, &key("position_std_m"), tag.position_std_m, 0.0..=1.0)?,
            rotation_std_rad: FileIssue::check_range(file, &key("rotation_std_rad"), tag.rotation_std_rad, 0.0..=1.0)?,
        });
    }
    match base_tag {
        None if !tags.is_empty() => {
            let problem = "is missing; it is the id of the [[tag]] beside the base, or of any other";
            return Err(FileIssue::new(Code::KeyMissing, file, "base_tag", problem).into());
        }
        Some(id) if !tags.is_empty() && !seen.contains(&id) => {
            return Err(FileIssue::new(
                Code::NameUnknown,
                file,
                "base_tag",
                format!("tag {id} is not among the [[tag]]s"),
            )
            .into());
        }
        _ => {}
    }
    Ok((tags, family))
}
