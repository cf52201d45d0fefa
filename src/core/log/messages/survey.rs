//! Surveyed tags.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::basic::{Header, Pose, Quaternion};
use super::checks::{finite, unit_quaternion_wxyz};
use crate::log::error::{DecodeRejection, EncodeError};
use crate::log::header::{BASE_FRAME, RecordingHeader};
use crate::log::schema::{RosMessage, RosSchema};
use crate::streams::{RecordedSurvey, RecordedTag};

/// armcal_msgs/msg/SurveyedTag: `pose` in the frame of the survey's header, m; standard deviations per axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurveyedTag {
    /// Id of the tag in the family.
    pub id: u32,
    /// Side of the black square.
    pub size_m: f64,
    /// Pose of the tag; the identity if it is unknown.
    pub pose: Pose,
    /// Standard deviation of the position; infinite if the pose is unknown.
    pub position_std_m: f64,
    /// Standard deviation of the rotation; infinite if the pose is unknown.
    pub rotation_std_rad: f64,
}

/// armcal_msgs/msg/TagSurvey: poses of the tags.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TagSurvey {
    /// Stamp, and the frame of the arm's base, or of the link that carries the tags.
    pub header: Header,
    /// Id of the tag next to the base; one of `tags`.
    pub base_tag: u32,
    /// Surveyed tags, each id once.
    pub tags: Vec<SurveyedTag>,
}

message!(
    TagSurvey,
    "armcal_msgs/msg/TagSurvey",
    "std_msgs/Header header\nuint32 base_tag\narmcal_msgs/SurveyedTag[] tags\n",
    header!(),
    dependency!(
        "armcal_msgs/SurveyedTag",
        "uint32 id\nfloat64 size_m\ngeometry_msgs/Pose pose\nfloat64 position_std_m\nfloat64 rotation_std_rad\n"
    ),
    dependency!("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    point!(),
    quaternion!(),
);

pub(in crate::log) fn to_ros(m: &RecordedSurvey, header: &RecordingHeader) -> Result<TagSurvey, EncodeError> {
    let tag = |tag: &RecordedTag| SurveyedTag {
        id: tag.id,
        size_m: tag.size_m,
        pose: Pose { position: tag.position_m.into(), orientation: Quaternion::from_wxyz(tag.quaternion_wxyz) },
        position_std_m: tag.position_std_m,
        rotation_std_rad: tag.rotation_std_rad,
    };
    Ok(TagSurvey {
        header: Header::new(m.stamp, m.link.as_ref().unwrap_or(&header.base_frame))?,
        base_tag: m.base_tag,
        tags: m.tags.iter().map(tag).collect(),
    })
}

/// Converts a survey. One unusable tag rejects the whole survey: a wrong pose would bias the others.
pub(in crate::log) fn from_ros(m: &TagSurvey) -> Result<RecordedSurvey, DecodeRejection> {
    let tags = m.tags.iter().map(tag_from_ros).collect::<Result<Vec<_>, _>>()?;
    let ids: BTreeSet<u32> = tags.iter().map(|tag| tag.id).collect();
    if ids.len() != tags.len() {
        return Err(DecodeRejection::TagTwice);
    }
    if !ids.contains(&m.base_tag) {
        return Err(DecodeRejection::NoBaseTag);
    }
    let frame = &m.header.frame_id;
    // An empty frame, or that of our own recordings, is the base's.
    let link = (!frame.is_empty() && frame != BASE_FRAME).then(|| frame.clone());
    Ok(RecordedSurvey { stamp: m.header.stamp.try_into()?, link, base_tag: m.base_tag, tags })
}

fn tag_from_ros(tag: &SurveyedTag) -> Result<RecordedTag, DecodeRejection> {
    let position_m = tag.pose.position.into();
    finite("position", position_m)?;
    finite("size_m", [tag.size_m])?;
    // Both are infinite if only the tag's size is known.
    let is_unknown = tag.position_std_m == f64::INFINITY && tag.rotation_std_rad == f64::INFINITY;
    if !is_unknown {
        finite("standard deviation", [tag.position_std_m, tag.rotation_std_rad])?;
    }
    if tag.size_m <= 0.0 {
        return Err(DecodeRejection::TagSize);
    }
    if tag.position_std_m < 0.0 || tag.rotation_std_rad < 0.0 {
        return Err(DecodeRejection::NegativeVariance);
    }
    Ok(RecordedTag {
        id: tag.id,
        size_m: tag.size_m,
        position_m,
        quaternion_wxyz: unit_quaternion_wxyz(&tag.pose.orientation)?,
        position_std_m: tag.position_std_m,
        rotation_std_rad: tag.rotation_std_rad,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sets the message of a tag of which only the size is known.
    fn forget_pose(tag: &mut SurveyedTag) {
        (tag.position_std_m, tag.rotation_std_rad) = (f64::INFINITY, f64::INFINITY);
    }

    fn n_tags(edit: fn(&mut TagSurvey)) -> Result<usize, DecodeRejection> {
        let mut tag = SurveyedTag { id: 3, size_m: 0.1, ..Default::default() };
        tag.pose.orientation.w = 1.0;
        let tags = vec![tag.clone(), SurveyedTag { id: 4, ..tag }];
        let mut survey = TagSurvey { base_tag: 3, tags, ..Default::default() };
        edit(&mut survey);
        from_ros(&survey).map(|m| m.tags.len())
    }

    #[test]
    fn survey_with_an_unusable_tag_is_rejected() {
        assert_eq!(n_tags(|_| ()), Ok(2));
        assert_eq!(n_tags(|m| m.base_tag = 5), Err(DecodeRejection::NoBaseTag));
        assert_eq!(n_tags(|m| m.tags[1].id = 3), Err(DecodeRejection::TagTwice));
        assert_eq!(n_tags(|m| m.tags[1].size_m = 0.0), Err(DecodeRejection::TagSize));
        assert_eq!(n_tags(|m| m.tags[0].position_std_m = -1.0), Err(DecodeRejection::NegativeVariance));
        assert_eq!(n_tags(|m| m.tags.iter_mut().for_each(forget_pose)), Ok(2));
        assert!(n_tags(|m| m.tags[0].position_std_m = f64::INFINITY).is_err(), "half of a pose");
        assert!(n_tags(|m| m.tags[0].rotation_std_rad = f64::NAN).is_err());
        assert_eq!(n_tags(|m| m.tags[0].pose.orientation.w = 0.0), Err(DecodeRejection::QuaternionLength));
        let no_position = n_tags(|m| m.tags[0].pose.position.x = f64::NAN);
        assert_eq!(no_position, Err(DecodeRejection::NotFinite { field: "position" }));
    }
}
