//! Our tag map file.
//!
//! `version = 1`, `kind = "tag_map"`, `frame`, and one `[[tag]]` each with `id` (or `name`, for a landmark that is not
//! an AprilTag), `size_m`, `position_m`, `quaternion_wxyz` and `position_std_m`; all but the first may be absent.
//! Further optional keys: `base_tag`, `anchor_tag` (whose error all others share) and `default_size_m` (of tags without
//! an entry) at the top; `rotation_std_rad` and `frame` of a tag in another frame than the file's, such as a separate
//! group; `squares` and `square_m` of a chessboard or ChArUco board with a name, whose origin is an outer corner;
//! `[[body]]` with `name` and `moving`, for frames that move.

use crate::tagmap::constants::files_own::MAX_SQUARES;
use armcal_core::codes::Code;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::model::shared_survey_error::{SharedSurveyError, Weights};
use crate::tagmap::check::SIZE_RANGE_M;
use crate::tagmap::files::landmark::{FIRST_NAMED_ID, Landmark, LandmarkFile};
use crate::tagmap::files::tag_file::TagFile;
use crate::tagmap::files::written::WrittenGroup;
use crate::tagmap::types::{Body, TagPrior};
use armcal_core::document::{VERSION, parse_file};
use armcal_core::kind::Kind;
use armcal_core::optics::Chessboard;
use armcal_core::robot::{FileIssue, RobotError};
use armcal_core::schema::{first_line, schema_of};
use armcal_core::spatial::{Base, Pose, Tag};

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MapToml {
    #[serde(rename = "version")]
    _version: u32,
    #[serde(rename = "kind")]
    _kind: Option<Kind>,
    /// Frame of the poses, such as the base link of the URDF.
    frame: String,
    /// Number of the tag that defines the frame.
    base_tag: Option<u32>,
    /// Number of the tag whose error all others share; their sigmas include it.
    anchor_tag: Option<u32>,
    /// Edge of tags without an entry.
    #[schemars(range(min = 1e-3, max = 10.0))]
    default_size_m: Option<f64>,
    /// Frames that move.
    #[serde(default)]
    body: Vec<BodyToml>,
    /// Tags and boards.
    #[serde(default)]
    tag: Vec<TagToml>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BodyToml {
    /// Name of the frame.
    name: String,
    /// True for a frame that moves.
    moving: bool,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TagToml {
    /// Number of the tag.
    id: Option<u32>,
    /// Name of a landmark that is not an AprilTag.
    name: Option<String>,
    /// Edge of the black square.
    #[schemars(range(min = 1e-3, max = 10.0))]
    size_m: Option<f64>,
    /// Frame of the pose, where not the file's.
    frame: Option<String>,
    /// Position of the centre.
    #[schemars(inner(range(min = -1e4, max = 1e4)))]
    position_m: Option<[f64; 3]>,
    /// Attitude: x right, y up as printed, z out of the tag.
    quaternion_wxyz: Option<[f64; 4]>,
    /// Sigma of the position along x, y, z.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    position_std_m: Option<[f64; 3]>,
    /// Sigma of the attitude about x, y, z.
    #[schemars(inner(range(min = 0.0, max = 100.0)))]
    rotation_std_rad: Option<[f64; 3]>,
    /// Squares of a chessboard or ChArUco board along x and y.
    #[schemars(inner(range(min = 3, max = 100)))]
    squares: Option<[u32; 2]>,
    /// Edge of a square of the board.
    #[schemars(range(min = 1e-3, max = 10.0))]
    square_m: Option<f64>,
}

/// Returns the schema of a tag map.
#[must_use]
pub fn tag_map_schema() -> serde_json::Value {
    schema_of::<MapToml>(Kind::TagMap)
}

/// The landmarks in the file's frame; those of other frames are left out.
pub(super) fn parse_landmarks(file: &Path, text: &str) -> Result<LandmarkFile, RobotError> {
    let raw: MapToml = parse_file(Kind::TagMap, file, text)?;
    let mut landmarks = Vec::new();
    for (k, tag) in raw.tag.iter().enumerate() {
        let label = match (tag.id, &tag.name) {
            (Some(id), _) => format!("tag {id}"),
            (None, Some(name)) => format!("tag `{name}`"),
            (None, None) => {
                return Err(FileIssue::new(
                    Code::KeyMissing,
                    file,
                    format!("tag number {}", k + 1),
                    "has neither id nor name",
                )
                .into());
            }
        };
        let key = |of: &str| format!("{label}: {of}");
        let size_m = tag.size_m.or(raw.default_size_m.filter(|_| tag.id.is_some()));
        if let Some(size_m) = size_m {
            FileIssue::check_range(file, &key("size_m"), size_m, SIZE_RANGE_M)?;
        }
        if let (position, Some(wxyz)) = (tag.position_m, tag.quaternion_wxyz) {
            pose(file, &key("position_m, quaternion_wxyz"), position.unwrap_or_default(), wxyz)?;
        }
        for value in tag.position_m.iter().flatten() {
            FileIssue::check_range(file, &key("position_m"), *value, -1e4..=1e4)?;
        }
        let std = std(file, tag, &key)?.unwrap_or_default();
        if tag.frame.as_ref().is_some_and(|frame| *frame != raw.frame) {
            continue;
        }
        landmarks.push(Landmark {
            id: tag.id.unwrap_or(FIRST_NAMED_ID + k as u32),
            name: tag.name.clone(),
            size_m,
            position_m: tag.position_m,
            quaternion_wxyz: tag.quaternion_wxyz,
            position_std_m: std[0],
            rotation_std_rad: std[3..].iter().copied().fold(0.0, f64::max),
            board: board(file, tag, &key)?,
        });
    }
    Ok(LandmarkFile { frame: raw.frame, base_tag: raw.base_tag, anchor_tag: raw.anchor_tag, landmarks })
}

/// Returns the chessboard of an entry; `None` if it states no squares.
fn board(file: &Path, tag: &TagToml, key: &impl Fn(&str) -> String) -> Result<Option<Chessboard>, FileIssue> {
    let missing = |of: &str| {
        Err(FileIssue::new(Code::KeyMissing, file, key(of), "is missing; a board has `squares` and `square_m`"))
    };
    let (squares, square_m) = match (tag.squares, tag.square_m) {
        (None, None) => return Ok(None),
        (Some(_), None) => return missing("square_m"),
        (None, Some(_)) => return missing("squares"),
        (Some(squares), Some(square_m)) => (squares, square_m),
    };
    if tag.id.is_some() {
        return Err(FileIssue::new(
            Code::KeysConflict,
            file,
            key("squares"),
            "is for a board, which has a name and no id",
        ));
    }
    for n in squares {
        FileIssue::check_range(file, &key("squares"), f64::from(n), 3.0..=MAX_SQUARES)?;
    }
    FileIssue::check_range(file, &key("square_m"), square_m, SIZE_RANGE_M)?;
    Ok(Some(Chessboard { squares, square_m }))
}

pub(super) fn parse(file: &Path, text: &str) -> Result<TagFile, RobotError> {
    let raw: MapToml = parse_file(Kind::TagMap, file, text)?;
    let mut out = TagFile { frame: raw.frame.clone(), base_tag: raw.base_tag, ..TagFile::default() };
    body_of(&mut out, &raw.body, &raw.frame);
    for tag in &raw.tag {
        let Some(id) = tag.id else {
            // A landmark that is no tag has no corners.
            out.ignored_keys.push(format!("tag {}", tag.name.as_deref().unwrap_or("without id")));
            continue;
        };
        let key = |of: &str| format!("tag {id}: {of}");
        let Some(size_m) = tag.size_m.or(raw.default_size_m) else {
            return Err(FileIssue::new(
                Code::KeyMissing,
                file,
                key("size_m"),
                "is missing; a tag's corners need its size",
            )
            .into());
        };
        FileIssue::check_range(file, &key("size_m"), size_m, SIZE_RANGE_M)?;
        let body = body_of(&mut out, &raw.body, tag.frame.as_ref().unwrap_or(&raw.frame));
        let pose = match (tag.position_m, tag.quaternion_wxyz) {
            (Some(position), Some(wxyz)) => Some(pose(file, &key("position_m, quaternion_wxyz"), position, wxyz)?),
            _ => None,
        };
        out.tags.push(TagPrior { id, size_m, body, pose, std: std(file, tag, &key)? });
    }
    count_shared_error(&mut out.tags, raw.anchor_tag);
    if let Some(size_m) = raw.default_size_m {
        FileIssue::check_range(file, "default_size_m", size_m, SIZE_RANGE_M)?;
        out.default_tag = Some((size_m, 0));
    }
    Ok(out)
}

/// Gives the tags of a frame standard deviations under which they count as independent, although all of them share the
/// error of `anchor_tag`.
fn count_shared_error(tags: &mut [TagPrior], anchor_tag: Option<u32>) {
    let Some(anchor) = tags.iter().find(|tag| Some(tag.id) == anchor_tag) else { return };
    let (Some((place, std)), body) = (anchor.pose.zip(anchor.std), anchor.body) else { return };
    let largest = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
    let (position_std_m, rotation_std_rad) = (largest(&std[..3]), largest(&std[3..]));
    let shared = SharedSurveyError { anchor: place, position_std_m, rotation_std_rad };
    let n_known = tags.iter().filter(|tag| tag.body == body && tag.pose.is_some()).count();
    let weights = Weights::of(1, n_known - 1);
    for tag in tags.iter_mut().filter(|tag| tag.body == body) {
        if let (Some(pose), Some(std)) = (&tag.pose, &mut tag.std) {
            *std = weights.independent(&shared, (pose, Some(tag.id) == anchor_tag), std);
        }
    }
}

fn pose(file: &Path, key: &str, position: [f64; 3], wxyz: [f64; 4]) -> Result<Isometry3<f64>, RobotError> {
    let pose: Option<Pose<Base, Tag>> = Pose::from_position_quaternion_wxyz(position, wxyz);
    Ok(*pose
        .ok_or_else(|| FileIssue::new(Code::ValueInvalid, file, key, "must be finite, the quaternion not zero"))?
        .isometry())
}

/// Standard deviations of a tag; `None` (exact) if all are zero or absent. Those of the position are along the frame's
/// axes, so the largest counts for all of them.
fn std(file: &Path, tag: &TagToml, key: &impl Fn(&str) -> String) -> Result<Option<[f64; 6]>, RobotError> {
    let (position, rotation) = (tag.position_std_m.unwrap_or_default(), tag.rotation_std_rad.unwrap_or_default());
    for (name, values) in [("position_std_m", position), ("rotation_std_rad", rotation)] {
        for value in values {
            FileIssue::check_range(file, &key(name), value, 0.0..=100.0)?;
        }
    }
    let p = position.into_iter().fold(0.0, f64::max);
    let [a, b, c] = rotation;
    Ok((p > 0.0 || a + b + c > 0.0).then_some([p, p, p, a, b, c]))
}

fn body_of(out: &mut TagFile, bodies: &[BodyToml], frame: &str) -> usize {
    if let Some(known) = out.bodies.iter().position(|body| body.name == frame) {
        return known;
    }
    let is_static = !bodies.iter().any(|body| body.name == frame && body.moving);
    out.bodies.push(Body { name: frame.to_owned(), is_static, pose: None });
    out.bodies.len() - 1
}

pub(super) fn to_text(groups: &[WrittenGroup], anchor_tag: Option<u32>) -> String {
    let main = groups.first().map_or("base_link", |group| group.frame.as_str());
    let kind = Kind::TagMap.name();
    let mut out =
        format!("{}version = {VERSION}\nkind = \"{kind}\"\nframe = {}\n", first_line(Kind::TagMap), quoted(main));
    if let Some(id) = anchor_tag {
        let _ = writeln!(out, "anchor_tag = {id}");
    }
    for group in groups.iter().filter(|group| !group.is_static) {
        let _ = writeln!(out, "\n[[body]]\nname = {}\nmoving = true", quoted(&group.frame));
    }
    for group in groups {
        for tag in &group.tags {
            let _ = writeln!(out, "\n[[tag]]\nid = {}\nsize_m = {:?}", tag.id, tag.size_m);
            if group.frame != main {
                let _ = writeln!(out, "frame = {}", quoted(&group.frame));
            }
            let position: [f64; 3] = tag.pose.translation.vector.into();
            let q = tag.pose.rotation;
            let _ = writeln!(out, "position_m = {position:?}\nquaternion_wxyz = {:?}", [q.w, q.i, q.j, q.k]);
            let rotation = [3, 4, 5].map(|k| tag.covariance[(k, k)].max(0.0).sqrt());
            let _ = writeln!(out, "position_std_m = {:?}\nrotation_std_rad = {rotation:?}", tag.position_std_m);
        }
    }
    out
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
