//! Landmarks of a tag map, and the survey for a calibration of joints.
//!
//! A landmark may have less data than an AprilTag: no size, no rotation, or a name instead of a number. The use of the
//! detections decides if that is enough.

pub use crate::tagmap::constants::files_landmark::FIRST_NAMED_ID;
use armcal_core::codes::Code;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use armcal_core::input::TagUse;
use armcal_core::kinematics::Attachment;
use armcal_core::optics::Chessboard;
use armcal_core::robot::{FileIssue, Robot, SurveyedTag, TagSurvey};
use armcal_core::spatial::{Base, Pose, Tag};

/// One sigma of an unknown rotation, rad: half a turn.
pub const UNKNOWN_ROTATION_STD_RAD: f64 = std::f64::consts::PI;

/// Everyday name of the tag with number `id` among `ids`: `tag 3`. A landmark with a name but no number is `board`, or
/// `board 2` if there are several.
#[must_use]
pub fn spoken_name(id: u32, ids: impl IntoIterator<Item = u32>) -> String {
    let Some(place) = id.checked_sub(FIRST_NAMED_ID) else { return format!("tag {id}") };
    match ids.into_iter().filter(|id| *id >= FIRST_NAMED_ID).max() {
        Some(last) if last > FIRST_NAMED_ID => format!("board {}", place + 1),
        _ => "board".to_owned(),
    }
}

/// A landmark of a tag map, in the frame of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmark {
    /// Number of the tag, or [`FIRST_NAMED_ID`] plus its place in the file for a landmark with only a name.
    pub id: u32,
    /// Name of the landmark; `None` if the file has only a number.
    pub name: Option<String>,
    /// Side of the black square; `None` where unknown.
    pub size_m: Option<f64>,
    /// Position in the file's frame; `None` if unknown.
    pub position_m: Option<[f64; 3]>,
    /// Rotation frame_from_tag; `None` if unknown.
    pub quaternion_wxyz: Option<[f64; 4]>,
    /// Standard deviation of the position, m; zero (exact) if the file states none.
    pub position_std_m: f64,
    /// Largest standard deviation of the rotation over the three axes; zero if the file states none.
    pub rotation_std_rad: f64,
    /// Squares of the landmark, if it is a chessboard with its own corners.
    pub board: Option<Chessboard>,
}

/// Landmarks of a tag map, and their frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LandmarkFile {
    /// Name of the landmarks' frame.
    pub frame: String,
    /// Number of the base tag; `None` if the file names none.
    pub base_tag: Option<u32>,
    /// The tag whose error all others share ([`TagSurvey::anchor_tag`]).
    pub anchor_tag: Option<u32>,
    /// Landmarks in the order of the file, each id once.
    pub landmarks: Vec<Landmark>,
}

/// A survey for one use, and the names in it.
#[derive(Clone, Debug)]
pub struct NamedSurvey {
    /// Surveyed tags in the base frame.
    pub survey: TagSurvey,
    /// Names by id, of the landmarks that have one.
    pub names: BTreeMap<u32, String>,
    /// Boards by id.
    pub boards: BTreeMap<u32, Chessboard>,
}

impl LandmarkFile {
    /// Returns the survey around `robot` for this use of the tags.
    ///
    /// A landmark that is used by its position only may have an unknown rotation (half a turn of sigma) and an unknown
    /// size (NaN). A tag without a place can be used by its corners: the views determine its place.
    ///
    /// # Errors
    /// [`FileIssue`] naming `file`, the landmark and the key.
    pub fn survey(&self, file: &Path, robot: &Robot, tag_use: TagUse) -> Result<NamedSurvey, FileIssue> {
        let frame = self.on_arm(file, robot)?;
        let tags: Vec<SurveyedTag> =
            self.landmarks.iter().map(|landmark| landmark.surveyed(file, tag_use)).collect::<Result<_, _>>()?;
        let ids: Vec<u32> = tags.iter().map(|tag| tag.id).collect();
        let base_tag = self.base_tag.or(robot.base_tag).filter(|id| ids.contains(id)).or(ids.first().copied());
        if base_tag.is_none() {
            return Err(FileIssue::new(Code::ValueInvalid, file, "tag", "holds no tag in that frame"));
        }
        let named = self.landmarks.iter().filter_map(|landmark| Some((landmark.id, landmark.name.clone()?)));
        let boards = self.landmarks.iter().filter_map(|landmark| Some((landmark.id, landmark.board?))).collect();
        let anchor_tag = self.anchor_tag.filter(|id| ids.contains(id));
        let survey = TagSurvey { base_tag, anchor_tag, frame, family: None, tags };
        Ok(NamedSurvey { survey, names: named.collect(), boards })
    }
}

impl LandmarkFile {
    /// Attachment of the file's frame: the base, or a link that moves in front of a fixed camera.
    fn on_arm(&self, file: &Path, robot: &Robot) -> Result<Attachment, FileIssue> {
        let issue = |problem: String| {
            Err(FileIssue::new(Code::ValueInvalid, file, "frame", format!("is `{}`; {problem}", self.frame)))
        };
        if self.frame == robot.base_link {
            return Ok(Attachment::base());
        }
        match robot.links.get(&self.frame) {
            None => issue(format!("the arm's base is `{}`, and no link that it carries is called so", robot.base_link)),
            Some(link) if link.n_joints == 0 => {
                issue(format!("the arm's base is `{}`: give the places in its frame", robot.base_link))
            }
            Some(_) if robot.camera.mount.n_joints > 0 => issue(format!(
                "tags on the arm are for a camera that stands still, and the arm moves this one ([camera] link); give \
                 the places in the frame of the base, `{}`",
                robot.base_link
            )),
            Some(_) if robot.gripper_tag.is_some() => {
                issue("tags on the arm and [gripper_tag] do not go together: name that tag here, too".to_owned())
            }
            Some(link) => Ok(*link),
        }
    }
}

impl Landmark {
    fn surveyed(&self, file: &Path, tag_use: TagUse) -> Result<SurveyedTag, FileIssue> {
        let label = self.name.as_ref().map_or_else(|| format!("tag {}", self.id), |name| format!("tag `{name}`"));
        let missing = |key: &str, why: &str| {
            FileIssue::new(Code::KeyMissing, file, format!("{label}: {key}"), format!("is missing; {why}"))
        };
        let is_board = tag_use == TagUse::BoardCorners && self.board.is_some();
        if is_board && self.quaternion_wxyz.is_none() {
            return Err(missing("quaternion_wxyz", "a board's place and rotation in the frame of the file are needed"));
        }
        if tag_use == TagUse::Corners && self.size_m.is_none() {
            return Err(missing("size_m", "a tag's corners need its size"));
        }
        let is_unknown = self.position_m.is_none() && self.quaternion_wxyz.is_none();
        if tag_use != TagUse::Corners && self.position_m.is_none() {
            return Err(missing("position_m", "a landmark that is used by its position or pose needs it"));
        }
        if matches!(tag_use, TagUse::Corners | TagUse::Pose) && self.quaternion_wxyz.is_none() && !is_unknown {
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
