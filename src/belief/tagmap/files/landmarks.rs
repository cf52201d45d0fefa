//! A tag map as a survey that joints are calibrated by.
//!
//! Landmarks there may be less than AprilTags: without a size, without a rotation, with a name instead of a number. What a
//! recording's tags are used for decides whether that is enough.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use nalgebra::Isometry3;

use crate::tagmap::files::{TagFile, extension, own, read_tags};
use armcal_core::input::TagUse;
use armcal_core::robot::{FileIssue, Robot, RobotError, SurveyedTag, TagSurvey, read_text};
use armcal_core::spatial::{Base, Pose, Tag};

/// Numbers of landmarks that have a name and no number: this plus their place in the file, from 0.
pub const FIRST_NAMED_ID: u32 = 1_000_000;
/// One sigma of a rotation of which nothing is known, rad: half a turn.
pub const UNKNOWN_ROTATION_STD_RAD: f64 = std::f64::consts::PI;

/// A landmark as a tag map has it, in the frame of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmark {
    pub id: u32,
    pub name: Option<String>,
    pub size_m: Option<f64>,
    pub position_m: Option<[f64; 3]>,
    pub quaternion_wxyz: Option<[f64; 4]>,
    /// Zero where the file says nothing: exact.
    pub position_std_m: f64,
    pub rotation_std_rad: f64,
}

/// What a tag map says of landmarks in its frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LandmarkFile {
    pub frame: String,
    pub base_tag: Option<u32>,
    pub landmarks: Vec<Landmark>,
}

/// A survey for one use, and the names in it.
#[derive(Clone, Debug)]
pub struct NamedSurvey {
    pub survey: TagSurvey,
    pub names: BTreeMap<u32, String>,
}

/// Reads a tag map of ours (.toml), a tagslam.yaml or a Kalibr target (.yaml, .yml).
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_landmarks(file: &Path) -> Result<LandmarkFile, RobotError> {
    let landmarks = match extension(file).as_str() {
        "toml" => own::parse_landmarks(file, &read_text(file)?)?,
        _ => of_tags(&read_tags(file)?),
    };
    check(file, &landmarks)?;
    Ok(landmarks)
}

fn of_tags(tags: &TagFile) -> LandmarkFile {
    let landmark = |tag: &crate::tagmap::TagPrior| {
        let pose: Option<Pose<Base, Tag>> = tag.pose.map(Pose::from_isometry);
        let std = tag.std.unwrap_or_default();
        Landmark {
            id: tag.id,
            name: None,
            size_m: Some(tag.size_m),
            position_m: pose.map(|pose| pose.origin().to_array()),
            quaternion_wxyz: pose.map(|pose| pose.quaternion_wxyz()),
            position_std_m: std[0],
            rotation_std_rad: std[3..].iter().copied().fold(0.0, f64::max),
        }
    };
    let landmarks = tags.tags.iter().filter(|tag| tag.body == 0).map(landmark).collect();
    LandmarkFile { frame: tags.frame.clone(), base_tag: tags.base_tag, landmarks }
}

fn check(file: &Path, map: &LandmarkFile) -> Result<(), FileIssue> {
    let (mut ids, mut names) = (BTreeSet::new(), BTreeSet::new());
    for landmark in &map.landmarks {
        if !ids.insert(landmark.id) {
            return Err(FileIssue::new(file, format!("tag {}: id", landmark.id), "stands twice"));
        }
        if let Some(name) = &landmark.name
            && !names.insert(name)
        {
            return Err(FileIssue::new(file, format!("tag `{name}`: name"), "stands twice"));
        }
    }
    Ok(())
}

impl LandmarkFile {
    /// The survey around `robot` for tags that are used so.
    ///
    /// Of a landmark that is used by its position alone the rotation may be unknown (half a turn of sigma) and the size too (NaN).
    /// A tag without any place can be used by its corners: its place is found from the views.
    ///
    /// # Errors
    /// [`FileIssue`] naming `file`, the landmark and the key.
    pub fn survey(&self, file: &Path, robot: &Robot, tag_use: TagUse) -> Result<NamedSurvey, FileIssue> {
        if self.frame != robot.base_link {
            let problem = format!("is `{}`; the arm's base is `{}`", self.frame, robot.base_link);
            return Err(FileIssue::new(file, "frame", problem));
        }
        let tags: Vec<SurveyedTag> =
            self.landmarks.iter().map(|landmark| landmark.surveyed(file, tag_use)).collect::<Result<_, _>>()?;
        let ids: Vec<u32> = tags.iter().map(|tag| tag.id).collect();
        let base_tag = self.base_tag.or(Some(robot.base_tag)).filter(|id| ids.contains(id)).or(ids.first().copied());
        let base_tag = base_tag.ok_or_else(|| FileIssue::new(file, "tag", "holds no tag in that frame"))?;
        let named = self.landmarks.iter().filter_map(|landmark| Some((landmark.id, landmark.name.clone()?)));
        Ok(NamedSurvey { survey: TagSurvey { base_tag, tags }, names: named.collect() })
    }
}

impl Landmark {
    fn surveyed(&self, file: &Path, tag_use: TagUse) -> Result<SurveyedTag, FileIssue> {
        let label = self.name.as_ref().map_or_else(|| format!("tag {}", self.id), |name| format!("tag `{name}`"));
        let missing =
            |key: &str, why: &str| FileIssue::new(file, format!("{label}: {key}"), format!("is missing; {why}"));
        if tag_use == TagUse::Corners && self.size_m.is_none() {
            return Err(missing("size_m", "a tag's corners need its size"));
        }
        let is_unknown = self.position_m.is_none() && self.quaternion_wxyz.is_none();
        if tag_use != TagUse::Corners && self.position_m.is_none() {
            return Err(missing("position_m", "a landmark that is used by its position or pose needs it"));
        }
        if tag_use != TagUse::Position && self.quaternion_wxyz.is_none() && !is_unknown {
            return Err(missing("quaternion_wxyz", "without it a landmark can be used by its position alone"));
        }
        let (position_std_m, rotation_std_rad) = match (self.position_m, self.quaternion_wxyz) {
            (Some(_), Some(_)) => (self.position_std_m, self.rotation_std_rad),
            (Some(_), None) => (self.position_std_m, UNKNOWN_ROTATION_STD_RAD),
            _ => (f64::INFINITY, f64::INFINITY),
        };
        let pose = Pose::from_position_quaternion_wxyz(
            self.position_m.unwrap_or_default(),
            self.quaternion_wxyz.unwrap_or([1.0, 0.0, 0.0, 0.0]),
        );
        let pose: Pose<Base, Tag> = pose.unwrap_or_else(|| Pose::from_isometry(Isometry3::identity()));
        Ok(SurveyedTag {
            id: self.id,
            size_m: self.size_m.unwrap_or(f64::NAN),
            base_from_tag: pose,
            position_std_m,
            rotation_std_rad,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = "version = 1\nframe = \"base_link\"\n[[tag]]\nid = 2\nsize_m = 0.16\nposition_m = [0.0, 0.0, 1.0]\n\
        quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\nposition_std_m = [0.001, 0.002, 0.003]\n\
        [[tag]]\nname = \"board\"\nposition_m = [0.1, 0.2, 0.3]\n";

    fn survey(text: &str, tag_use: TagUse) -> Result<NamedSurvey, String> {
        let file = Path::new("map.toml");
        let robot =
            armcal_core::robot::load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4"))
                .expect("it reads");
        let map = own::parse_landmarks(file, text).map_err(|error| error.to_string())?;
        check(file, &map).and_then(|()| map.survey(file, &robot, tag_use)).map_err(|error| error.to_string())
    }

    #[test]
    fn a_landmark_without_number_size_and_rotation_is_used_by_its_position() {
        let named = survey(TWO, TagUse::Position).expect("good");
        let [tag, board] = &named.survey.tags[..] else { panic!("two landmarks") };
        assert_eq!((tag.id, tag.size_m, tag.position_std_m, tag.rotation_std_rad), (2, 0.16, 0.003, 0.0));
        assert_eq!(board.id, FIRST_NAMED_ID + 1);
        assert_eq!(named.names[&board.id], "board");
        assert!(board.size_m.is_nan() && board.rotation_std_rad == UNKNOWN_ROTATION_STD_RAD && board.is_known());
        assert_eq!(board.base_from_tag.origin().to_array(), [0.1, 0.2, 0.3]);
        assert_eq!(named.survey.base_tag, 2, "the robot's own base tag, 0, is not there");
    }

    #[test]
    fn what_is_missing_for_a_use_is_named() {
        let faults: [(&str, &str, TagUse, &[&str]); 8] = [
            ("", "", TagUse::Pose, &["board", "quaternion_wxyz", "position alone"]),
            ("", "", TagUse::Corners, &["board", "size_m", "corners"]),
            ("position_m = [0.1, 0.2, 0.3]", "size_m = 0.1", TagUse::Position, &["board", "position_m"]),
            ("id = 2\n", "", TagUse::Position, &["tag number 1", "neither id nor name"]),
            ("name = \"board\"", "id = 2", TagUse::Position, &["tag 2", "twice"]),
            ("base_link", "world", TagUse::Position, &["frame", "world", "base_link"]),
            ("0.002", "-0.002", TagUse::Position, &["position_std_m", "0 .. 100"]),
            ("[1.0, 0.0, 0.0, 0.0]", "[0.0, 0.0, 0.0, 0.0]", TagUse::Position, &["tag 2", "quaternion"]),
        ];
        for (from, to, tag_use, words) in faults {
            assert!(TWO.contains(from), "{from}");
            let problem = survey(&TWO.replacen(from, to, 1), tag_use).expect_err(to);
            for word in words.iter().chain(&["map.toml"]) {
                assert!(problem.contains(word), "{to}: no `{word}` in {problem}");
            }
        }
    }

    #[test]
    fn a_tag_without_place_is_mapped_by_its_corners() {
        let text = "version = 1\nframe = \"base_link\"\n[[tag]]\nid = 5\nsize_m = 0.1\n";
        let named = survey(text, TagUse::Corners).expect("good");
        assert!(!named.survey.tags[0].is_known());
    }
}
