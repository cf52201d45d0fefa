//! Conversion of a survey of tags to and from a recording's message.

use super::message::{RecordedSurvey, RecordedTag};
use crate::kinematics::Attachment;
use crate::robot::{Robot, SurveyedTag, TagSurvey};
use crate::spatial::{Base, Pose, Tag};
use crate::time::Stamp;

impl RecordedSurvey {
    /// Returns the message of `survey`, which has tags, at `stamp`. `link` carries the tags, if a link does. Unknown
    /// poses become the identity.
    #[must_use]
    pub fn new(stamp: Stamp, survey: &TagSurvey, link: Option<&str>) -> Self {
        // Not even the nominal pose of an unknown tag is recorded, so that nobody can use it by mistake.
        let unknown = Pose::<Base, Tag>::from_position_rpy([0.0; 3], [0.0; 3]);
        let tag = |tag: &SurveyedTag| {
            let pose = if tag.is_known() { &tag.base_from_tag } else { &unknown };
            RecordedTag {
                id: tag.id,
                size_m: tag.size_m,
                position_m: pose.origin().to_array(),
                quaternion_wxyz: pose.quaternion_wxyz(),
                position_std_m: tag.position_std_m,
                rotation_std_rad: tag.rotation_std_rad,
            }
        };
        Self {
            stamp,
            link: link.map(str::to_owned),
            base_tag: survey.base_tag.unwrap_or_default(),
            tags: survey.tags.iter().map(tag).collect(),
        }
    }

    /// Returns the survey around `robot` that the message holds. A tag without a direction is omitted; no recording
    /// returns such a tag.
    #[must_use]
    pub fn survey(&self, robot: &Robot) -> TagSurvey {
        let tag = |tag: &RecordedTag| {
            Some(SurveyedTag {
                id: tag.id,
                size_m: tag.size_m,
                base_from_tag: Pose::from_position_quaternion_wxyz(tag.position_m, tag.quaternion_wxyz)?,
                position_std_m: tag.position_std_m,
                rotation_std_rad: tag.rotation_std_rad,
            })
        };
        let carrier = self.link.as_ref().and_then(|link| robot.links.get(link)).copied();
        TagSurvey {
            base_tag: Some(self.base_tag),
            anchor_tag: None,
            frame: carrier.unwrap_or_else(Attachment::base),
            family: None,
            tags: self.tags.iter().filter_map(tag).collect(),
        }
    }
}
