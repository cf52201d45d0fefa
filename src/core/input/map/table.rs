//! The part of an input map that describes a table: the meaning of the columns of a CSV or YAML file.

use crate::codes::Code;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::{ChildFrame, TagUse};
use crate::robot::FileIssue;

/// Form of a table's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TableFormat {
    /// A line of names, then one line per pose; separated by comma, semicolon or tab.
    Csv,
    /// A list or a map with one entry per pose; columns are paths such as `pose.x` or `joints.0`.
    Yaml,
}

/// Form of a rotation's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RotationForm {
    /// Hamilton quaternion, the real part first.
    QuaternionWxyz,
    /// Hamilton quaternion, the real part last.
    QuaternionXyzw,
    /// Rotation matrix, nine numbers row by row.
    Matrix,
    /// Rotation vector: axis times angle.
    RotationVector,
    /// Angles about the fixed axes x, y, z in that order: Rz Ry Rx.
    FixedXyz,
}

impl RotationForm {
    fn n_columns(self) -> usize {
        match self {
            Self::QuaternionWxyz | Self::QuaternionXyzw => 4,
            Self::Matrix => 9,
            Self::RotationVector | Self::FixedXyz => 3,
        }
    }

    /// Returns the name that the input map uses.
    fn name(self) -> &'static str {
        match self {
            Self::QuaternionWxyz => "quaternion_wxyz",
            Self::QuaternionXyzw => "quaternion_xyzw",
            Self::Matrix => "matrix",
            Self::RotationVector => "rotation_vector",
            Self::FixedXyz => "fixed_xyz",
        }
    }

    fn is_of_angles(self) -> bool {
        matches!(self, Self::RotationVector | Self::FixedXyz)
    }
}

/// Pose that a row holds, of the two; `a_from_b` maps coordinates in b to coordinates in a.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// The tag's (board's) pose in the camera's frame.
    CameraFromTag,
    /// The camera's pose in the frame of the tag (board).
    TagFromCamera,
}

/// First corner of a tag and direction of the others, as the tag is printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CornerOrder {
    /// Bottom left, bottom right, top right, top left: AprilRobotics/apriltag 1c21707, apriltag.h, line 220.
    #[default]
    Apriltag,
    /// Top left, top right, bottom right, bottom left: OpenCV's `ArucoDetector::detectMarkers` (clockwise).
    Opencv,
}

impl CornerOrder {
    /// Index of the corner `number`, 0 to 3, in the order of AprilTag.
    #[must_use]
    pub fn place(self, number: usize) -> usize {
        if self == Self::Apriltag { number } else { 3 - number }
    }
}

/// Columns of a row's rotation.
#[derive(Clone, Debug, PartialEq)]
pub struct RotationColumns {
    /// Names of the columns, in the number that the form requires.
    pub columns: Vec<String>,
    /// Form of the numbers.
    pub form: RotationForm,
    /// Radians of one unit of the columns; 1 for quaternions and matrices.
    pub unit_rad: f64,
}

/// Column of a row's time.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeColumn {
    /// Name of the column.
    pub column: String,
    /// Unit of its cells.
    pub unit: TimeUnit,
}

/// Columns of a CSV or YAML file in which each row is a pose at rest.
///
/// ```toml
/// version = 1
/// kind = "input"
/// [table]
/// format = "csv"                           # optional: "csv" or "yaml"; absent: by the end of the file's name
/// rows = "poses"                           # optional, only for YAML: keys that lead to the rows, joined by dots
/// time = { column = "t", unit = "s" }      # optional: "s", "ms", "us", "ns", "iso8601"; absent: rows are 1 s apart
/// [joint_sensors]
/// names = { elbow = "q3" }                 # columns whose name differs from the robot's joint
/// unit = "rad"                             # optional: "counts" | "rad" | "deg"
/// [tags]
/// child_frame = "board"                    # the landmark; absent if a column has the tags' ids
/// use = "pose"                             # "position" | "pose"
/// [tags.columns]
/// direction = "tag_from_camera"            # or "camera_from_tag"
/// position = ["x", "y", "z"]
/// position_unit = "m"                      # optional: "m" | "mm"
/// rotation = ["rx", "ry", "rz"]
/// rotation_form = "fixed_xyz"              # or "quaternion_wxyz", "quaternion_xyzw", "matrix", "rotation_vector"
/// rotation_unit = "rad"                    # optional: "rad" | "deg"
/// id = "tag"                               # optional: column of the tag's number
/// ```
///
/// A row is one inner corner of the board with `use = "board_corners"`:
///
/// ```toml
/// [tags.columns]
/// id = "corner"                            # column of the corner's number
/// pixel = ["u", "v"]                       # columns of its place in the image, px
/// ```
///
/// A row is one corner of a tag, or the four of one tag, with `use = "corners"`:
///
/// ```toml
/// [tags.columns]
/// id = "tag"                               # column of the tag's number
/// corner = "corner"                        # column of the corner's number, 0 to 3
/// pixel = ["u", "v"]                       # columns of its place in the image, px
/// # corners = ["u0", "v0", "u1", "v1", "u2", "v2", "u3", "v3"]   # instead of corner and pixel
/// corner_order = "apriltag"                # optional: "apriltag" | "opencv"
/// ```
///
/// If the tags are in a table of their own, `[table]` is the table of the joints:
///
/// ```toml
/// [tags]
/// table = { file = "corners.csv", key = "image" }   # rows with the same text in this column of both tables
/// # table = { file = "corners.csv", time = { column = "t", unit = "s" } }   # or the nearest time, within max_gap_s
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TableLayout {
    /// Format of the file; `None`: the format of its name's ending.
    pub format: Option<TableFormat>,
    /// Keys that lead to the rows in YAML; empty for the whole file.
    pub rows: Vec<String>,
    /// Column of the time; `None`: rows are 1 s apart.
    pub time: Option<TimeColumn>,
    /// Columns of the measurement.
    pub seen: SeenColumns,
    /// Column of the tag's id, or of the board's corner.
    pub id: Option<String>,
    /// Table of the tags; `None` if one table has joints and tags.
    pub tags: Option<TagTable>,
}

/// Table of the tags, if that of the joints is another file.
#[derive(Clone, Debug, PartialEq)]
pub struct TagTable {
    /// Path of the file, relative to the input map.
    pub file: PathBuf,
    /// Format of the file; `None`: the format of its name's ending.
    pub format: Option<TableFormat>,
    /// Keys that lead to the rows in YAML; empty for the whole file.
    pub rows: Vec<String>,
    /// Rule that joins rows of both tables.
    pub join: TableJoin,
}

/// Columns that join rows of two tables.
#[derive(Clone, Debug, PartialEq)]
pub enum TableJoin {
    /// Join with the joints' row nearest in time, within `max_gap_s`.
    Time {
        /// Time column in the table of the tags.
        time: TimeColumn,
        /// Joints' clock less the camera's, s.
        clock_offset_s: f64,
    },
    /// Join of rows with the same text.
    Key {
        /// Column of the tags' table.
        tags: String,
        /// Column of the joints' table.
        joints: String,
    },
}

/// Measurement of the landmark that a row's columns hold.
#[derive(Clone, Debug, PartialEq)]
pub enum SeenColumns {
    /// Columns of the position or pose.
    Pose(PoseColumns),
    /// Columns of u and v of one corner of a board, raw pixels.
    Pixel([String; 2]),
    /// Columns of one corner of a tag.
    TagCorner {
        /// Column of the corner's number, 0 to 3.
        corner: String,
        /// Columns of u and v, raw pixels.
        pixel: [String; 2],
        /// Order of the numbers.
        order: CornerOrder,
    },
    /// Columns of the four corners of a tag.
    TagCorners {
        /// Columns of u and v, corner by corner, raw pixels.
        columns: [String; 8],
        /// Order of the corners.
        order: CornerOrder,
    },
}

/// Columns of a row's pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseColumns {
    /// Pose that the columns hold.
    pub direction: Direction,
    /// Columns of x, y, z.
    pub position: [String; 3],
    /// Metres of one unit of the position.
    pub position_unit_m: f64,
    /// Columns of the rotation; `None` if only positions are used.
    pub rotation: Option<RotationColumns>,
}

/// Unit of a column of times, or `iso8601` for dates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TimeUnit {
    /// Seconds.
    #[default]
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
    /// A date and time such as `2026-03-01T12:00:00.250+01:00`; without an offset it is UTC.
    Iso8601,
}

impl TimeUnit {
    /// Nanoseconds of one unit; `None` for dates.
    #[must_use]
    pub fn nanos(self) -> Option<f64> {
        match self {
            Self::S => Some(1e9),
            Self::Ms => Some(1e6),
            Self::Us => Some(1e3),
            Self::Ns => Some(1.0),
            Self::Iso8601 => None,
        }
    }

    /// Returns the name that the input map uses.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::S => "s",
            Self::Ms => "ms",
            Self::Us => "us",
            Self::Ns => "ns",
            Self::Iso8601 => "iso8601",
        }
    }
}

#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum LengthUnit {
    /// Metres.
    #[default]
    M,
    /// Millimetres.
    Mm,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum AngleUnit {
    /// Radians.
    Rad,
    /// Degrees.
    Deg,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TimeToml {
    /// Name of the column.
    column: String,
    /// Unit of its numbers; `iso8601` for dates such as `2026-03-01T12:00:00.250Z`, which are UTC without an offset.
    #[serde(default)]
    unit: TimeUnit,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TableToml {
    /// Form of the file; absent: the form of its name's ending.
    format: Option<TableFormat>,
    /// Keys that lead to the rows of a YAML file, joined by dots.
    rows: Option<String>,
    /// Column of the time; absent: rows are 1 s apart.
    time: Option<TimeToml>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TagTableToml {
    /// File of the tags, relative to the folder of this file.
    file: String,
    /// Form of the file; absent: the form of its name's ending.
    format: Option<TableFormat>,
    /// Keys that lead to the rows of a YAML file, joined by dots.
    rows: Option<String>,
    /// Column of the time; a row joins the joints' row nearest in time.
    time: Option<TimeToml>,
    /// Column with the same text in both tables.
    key: Option<String>,
    /// Name of that column in the joints' table; absent: the same name.
    joints_key: Option<String>,
}

/// Keys of `[tags]` for a table.
pub(super) struct TagsOfTable<'a> {
    pub tag_use: TagUse,
    pub child_frame: Option<&'a ChildFrame>,
    pub table: Option<TagTableToml>,
    pub clock_offset_s: f64,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TagColumnsToml {
    /// Pose that a row holds.
    direction: Option<Direction>,
    /// Columns of x, y, z.
    position: Option<[String; 3]>,
    /// Columns of u and v of one corner.
    pixel: Option<[String; 2]>,
    /// Column of the corner's number, 0 to 3.
    corner: Option<String>,
    /// Columns of u and v of the four corners of a tag.
    corners: Option<[String; 8]>,
    /// Order of a tag's corners.
    corner_order: Option<CornerOrder>,
    /// Unit of the position.
    #[serde(default)]
    position_unit: LengthUnit,
    /// Columns of the rotation, in the number of its form.
    rotation: Option<Vec<String>>,
    /// Form of the rotation.
    rotation_form: Option<RotationForm>,
    /// Unit of the rotation's angles.
    rotation_unit: Option<AngleUnit>,
    /// Column of the tag's id, or of the board's corner.
    id: Option<String>,
}

/// Returns the layout by `[table]` and `[tags.columns]`.
pub(super) fn layout(
    file: &Path,
    table: TableToml,
    columns: Option<TagColumnsToml>,
    tags: TagsOfTable<'_>,
) -> Result<TableLayout, FileIssue> {
    let issue = |key: &str, problem: &str| FileIssue::new(Code::KeyMissing, file, key, problem);
    let Some(columns) = columns else {
        return Err(issue("tags.columns", "is missing; a [table] needs it: direction, position, rotation"));
    };
    let TagsOfTable { tag_use, child_frame, table: other, clock_offset_s } = tags;
    if tag_use == TagUse::Corners && child_frame.is_some() {
        let problem = "is for the one landmark of a table; corners have the tags' numbers: leave it out";
        return Err(FileIssue::new(Code::KeysConflict, file, "tags.child_frame", problem));
    }
    if tag_use == TagUse::Corners && columns.id.is_none() {
        return Err(issue("tags.columns.id", "is missing; name the column of the tag's number"));
    }
    let time = table.time.map(time_column);
    if other.is_none() && clock_offset_s != 0.0 {
        let problem = "is for tags with a clock of their own: a recording's, or those of tags.table; leave it out";
        return Err(FileIssue::new(Code::KeysConflict, file, "tags.clock_offset_s", problem));
    }
    let other = other.map(|other| tag_table(file, other, clock_offset_s)).transpose()?;
    let is_by_time = |other: &TagTable| matches!(other.join, TableJoin::Time { .. });
    if time.is_none() && other.as_ref().is_some_and(is_by_time) {
        return Err(issue("table.time", "is missing; tags.table.time needs the column of the joints' times"));
    }
    let rows = path_of_rows(table.rows);
    let of = |seen, id| Ok(TableLayout { format: table.format, rows, time, seen, id, tags: other });
    if tag_use == TagUse::BoardCorners {
        return of(SeenColumns::Pixel(pixel(file, &columns)?), columns.id);
    }
    if columns.id.is_some() != child_frame.is_none() || matches!(child_frame, Some(ChildFrame::Numbered { .. })) {
        let problem = "a table has either child_frame, the plain name of its one landmark, or tags.columns.id";
        return Err(issue("tags.child_frame", problem));
    }
    let seen = match tag_use {
        TagUse::Corners => tag_corners(file, &columns)?,
        _ => SeenColumns::Pose(pose(file, &columns, tag_use)?),
    };
    of(seen, columns.id)
}

fn path_of_rows(rows: Option<String>) -> Vec<String> {
    rows.map(|rows| rows.split('.').map(str::to_owned).collect()).unwrap_or_default()
}

fn tag_table(map: &Path, raw: TagTableToml, clock_offset_s: f64) -> Result<TagTable, FileIssue> {
    let issue = |code, problem: &str| Err(FileIssue::new(code, map, "tags.table", problem));
    let join = match (raw.time, raw.key) {
        (Some(time), None) if raw.joints_key.is_none() => TableJoin::Time { time: time_column(time), clock_offset_s },
        (None, Some(tags)) => TableJoin::Key { joints: raw.joints_key.unwrap_or_else(|| tags.clone()), tags },
        (None, None) => {
            let problem = "needs `key`, the column that both tables have, or `time`, the column of the tags' times";
            return issue(Code::KeyMissing, problem);
        }
        _ => return issue(Code::KeysConflict, "has `time` and `key` or `joints_key`; rows are joined by one of them"),
    };
    let file = map.parent().unwrap_or(Path::new("")).join(&raw.file);
    Ok(TagTable { file, format: raw.format, rows: path_of_rows(raw.rows), join })
}

fn time_column(TimeToml { column, unit }: TimeToml) -> TimeColumn {
    TimeColumn { column, unit }
}

/// Refuses keys that belong to another `tags.use`.
fn refuse(file: &Path, keys: &[(&str, bool)], problem: &str) -> Result<(), FileIssue> {
    match keys.iter().find(|(_, is_given)| *is_given) {
        Some((key, _)) => Err(FileIssue::new(Code::ValueInvalid, file, format!("tags.columns.{key}"), problem)),
        None => Ok(()),
    }
}

fn of_poses(columns: &TagColumnsToml) -> [(&'static str, bool); 3] {
    let TagColumnsToml { direction, position, rotation, .. } = columns;
    [("direction", direction.is_some()), ("position", position.is_some()), ("rotation", rotation.is_some())]
}

fn of_tags(columns: &TagColumnsToml) -> [(&'static str, bool); 3] {
    let TagColumnsToml { corner, corners, corner_order, .. } = columns;
    [("corner", corner.is_some()), ("corners", corners.is_some()), ("corner_order", corner_order.is_some())]
}

fn pixel(file: &Path, columns: &TagColumnsToml) -> Result<[String; 2], FileIssue> {
    let issue = |key: &str, problem: &str| {
        Err(FileIssue::new(Code::ValueInvalid, file, format!("tags.columns.{key}"), problem))
    };
    refuse(file, &of_poses(columns), "is for poses; \"board_corners\" has id and pixel alone")?;
    refuse(file, &of_tags(columns), "is for corners of tags; set use = \"corners\"")?;
    match (&columns.pixel, &columns.id) {
        (Some(pixel), Some(_)) => Ok(pixel.clone()),
        (None, _) => issue("pixel", "is missing; name the columns of a corner's u and v, px"),
        (_, None) => issue("id", "is missing; name the column of the corner's number on the board"),
    }
}

fn tag_corners(file: &Path, columns: &TagColumnsToml) -> Result<SeenColumns, FileIssue> {
    let issue =
        |code, key: &str, problem: &str| Err(FileIssue::new(code, file, format!("tags.columns.{key}"), problem));
    refuse(file, &of_poses(columns), "is for poses; \"corners\" has id with corner and pixel, or with corners")?;
    let order = columns.corner_order.unwrap_or_default();
    match (&columns.corners, &columns.corner, &columns.pixel) {
        (Some(columns), None, None) => Ok(SeenColumns::TagCorners { columns: columns.clone(), order }),
        (None, Some(corner), Some(pixel)) => {
            Ok(SeenColumns::TagCorner { corner: corner.clone(), pixel: pixel.clone(), order })
        }
        (Some(_), ..) => issue(Code::KeysConflict, "corners", "has a tag's four corners; leave corner and pixel out"),
        (None, None, _) => {
            issue(Code::KeyMissing, "corner", "is missing; name the column of the corner's number, 0 to 3, or corners")
        }
        (None, Some(_), None) => issue(Code::KeyMissing, "pixel", "is missing; name the columns of u and v, px"),
    }
}

fn pose(file: &Path, columns: &TagColumnsToml, tag_use: TagUse) -> Result<PoseColumns, FileIssue> {
    let issue =
        |key: &str, problem: &str| FileIssue::new(Code::KeyMissing, file, format!("tags.columns.{key}"), problem);
    if columns.pixel.is_some() {
        return Err(issue("pixel", "is for corners of a board; set use = \"board_corners\""));
    }
    refuse(file, &of_tags(columns), "is for corners of tags; set use = \"corners\"")?;
    let (Some(direction), Some(position)) = (columns.direction, columns.position.clone()) else {
        let key = if columns.direction.is_none() { "direction" } else { "position" };
        return Err(issue(key, "is missing; which pose the columns hold, and the columns of x, y, z"));
    };
    let rotation = rotation(file, columns)?;
    if rotation.is_none() && (tag_use == TagUse::Pose || direction == Direction::TagFromCamera) {
        let problem = "is missing; only positions with direction = \"camera_from_tag\" can do without";
        return Err(issue("rotation", problem));
    }
    let position_unit_m = if matches!(columns.position_unit, LengthUnit::Mm) { 1e-3 } else { 1.0 };
    Ok(PoseColumns { direction, position, position_unit_m, rotation })
}

fn rotation(file: &Path, raw: &TagColumnsToml) -> Result<Option<RotationColumns>, FileIssue> {
    let issue = |key: &str, problem: String| {
        Err(FileIssue::new(Code::ValueInvalid, file, format!("tags.columns.{key}"), problem))
    };
    let (columns, form) = match (&raw.rotation, raw.rotation_form) {
        (Some(columns), Some(form)) => (columns, form),
        (None, None) => return Ok(None),
        (Some(_), None) => return issue("rotation_form", "is missing; say what the rotation's columns are".to_owned()),
        (None, Some(_)) => return issue("rotation", "is missing; name the columns of `rotation_form`".to_owned()),
    };
    if columns.len() != form.n_columns() {
        return issue("rotation", format!("has {} columns; {} needs {}", columns.len(), form.name(), form.n_columns()));
    }
    if raw.rotation_unit.is_some() && !form.is_of_angles() {
        return issue("rotation_unit", "is for angles; quaternions and matrices have no unit".to_owned());
    }
    let unit_rad = if raw.rotation_unit == Some(AngleUnit::Deg) { 1_f64.to_radians() } else { 1.0 };
    Ok(Some(RotationColumns { columns: columns.clone(), form, unit_rad }))
}

#[cfg(test)]
mod tests {
    use crate::input::map::tests::{parse, told};
    use crate::input::map::{CornerOrder, SeenColumns, Source, TableJoin, TimeUnit};

    const GOOD: &str = "version = 1\nkind = \"input\"\n\
        [table]\n[joint_sensors]\n[tags]\nchild_frame = \"board\"\nuse = \"pose\"\n\
        [tags.columns]\ndirection = \"tag_from_camera\"\nposition = [\"x\", \"y\", \"z\"]\n\
        rotation = [\"a\", \"b\", \"c\"]\nrotation_form = \"fixed_xyz\"\nrotation_unit = \"deg\"\n";

    #[test]
    fn what_is_wrong_with_a_table_is_named_with_file_and_key() {
        let Source::Table(layout) = parse(GOOD).expect("good").source else { panic!("a table") };
        let SeenColumns::Pose(pose) = layout.seen else { panic!("poses") };
        assert_eq!((pose.rotation.expect("angles").unit_rad, pose.position_unit_m), (1_f64.to_radians(), 1.0));
        let faults = [
            ("[table]\n", "[table]\nformat = \"xls\"\n"),
            ("[table]\n", "[table]\ntime = { column = \"t\", unit = \"h\" }\n"),
            ("[table]\n", ""),
            ("[joint_sensors]\n", "[joint_sensors]\ntopic = \"/j\"\n"),
            ("[joint_sensors]\n", "[joint_sensors]\nunit = \"gon\"\n"),
            ("\"pose\"", "\"corners\""),
            ("\"deg\"\n", "\"deg\"\ncorner = \"k\"\n"),
            ("\"c\"]", "\"c\", \"d\"]"),
            ("rotation_form = \"fixed_xyz\"\n", ""),
            ("fixed_xyz", "rotation_matrix"),
            ("\"c\"]\nrotation_form = \"fixed_xyz", "\"c\", \"d\"]\nrotation_form = \"quaternion_xyzw"),
            ("rotation = [\"a\", \"b\", \"c\"]\n", ""),
            ("child_frame = \"board\"\n", ""),
        ];
        insta::assert_snapshot!("pose_columns", told(GOOD, &faults));
    }

    #[test]
    fn a_row_may_be_a_corner_of_a_board() {
        const BOARD: &str = "version = 1\nkind = \"input\"\n[table]\n[joint_sensors]\n[tags]\nchild_frame = \"board\"\n\
            use = \"board_corners\"\n[tags.columns]\nid = \"corner\"\npixel = [\"u\", \"v\"]\n";
        let Source::Table(layout) = parse(BOARD).expect("good").source else { panic!("a table") };
        assert_eq!(layout.seen, SeenColumns::Pixel(["u".to_owned(), "v".to_owned()]));
        let faults = [
            ("id = \"corner\"\n", ""),
            ("pixel = [\"u\", \"v\"]\n", ""),
            ("id = \"corner\"", "id = \"corner\"\nposition = [\"x\", \"y\", \"z\"]"),
            ("\"board\"", "\"tag:{id}\""),
            ("board_corners", "pose"),
        ];
        insta::assert_snapshot!("board_columns", told(BOARD, &faults));
    }
    #[test]
    fn a_row_may_be_a_corner_of_a_tag_or_all_four() {
        const TAGS: &str = "version = 1\nkind = \"input\"\n[table]\n[joint_sensors]\n[tags]\nuse = \"corners\"\n\
            [tags.columns]\nid = \"tag\"\ncorner = \"k\"\npixel = [\"u\", \"v\"]\n";
        let Source::Table(layout) = parse(TAGS).expect("good").source else { panic!("a table") };
        assert!(matches!(layout.seen, SeenColumns::TagCorner { order: CornerOrder::Apriltag, .. }));
        let columns = "corners = [\"a\", \"b\", \"c\", \"d\", \"e\", \"f\", \"g\", \"h\"]\n";
        let all = TAGS.replace("corner = \"k\"\npixel = [\"u\", \"v\"]\n", columns);
        let Source::Table(layout) = parse(&all).expect("good").source else { panic!("a table") };
        assert!(matches!(layout.seen, SeenColumns::TagCorners { .. }));
        let faults = [
            ("id = \"tag\"\n", ""),
            ("corner = \"k\"\n", ""),
            ("pixel = [\"u\", \"v\"]\n", ""),
            ("pixel = [\"u\", \"v\"]\n", columns),
            ("corner = \"k\"\n", "corner = \"k\"\ncorner_order = \"clockwise\"\n"),
            ("corner = \"k\"\n", "direction = \"camera_from_tag\"\n"),
            ("use = \"corners\"", "use = \"corners\"\nchild_frame = \"board\""),
        ];
        insta::assert_snapshot!("tag_corner_columns", told(TAGS, &faults));
    }

    #[test]
    fn tags_may_be_in_a_table_of_their_own() {
        const TWO: &str = "version = 1\n[table]\ntime = { column = \"t\" }\n[joint_sensors]\n[tags]\n\
            table = { file = \"corners.csv\", time = { column = \"s\", unit = \"ns\" } }\nclock_offset_s = 2.5\n\
            use = \"corners\"\n[tags.columns]\nid = \"tag\"\ncorner = \"k\"\npixel = [\"u\", \"v\"]\n";
        let Source::Table(layout) = parse(TWO).expect("good").source else { panic!("a table") };
        let tags = layout.tags.expect("a table of its own");
        let TableJoin::Time { time, clock_offset_s } = tags.join else { panic!("by time") };
        assert_eq!((time.unit.nanos(), clock_offset_s), (Some(1.0), 2.5));
        let dated = TWO.replace("\"ns\"", "\"iso8601\"");
        let Source::Table(layout) = parse(&dated).expect("good").source else { panic!("a table") };
        let TableJoin::Time { time, .. } = layout.tags.expect("a table of its own").join else { panic!("by time") };
        assert_eq!((time.unit, time.unit.nanos()), (TimeUnit::Iso8601, None));
        let by_key = TWO.replace("time = { column = \"s\", unit = \"ns\" }", "key = \"image\"");
        let Source::Table(layout) = parse(&by_key).expect("good").source else { panic!("a table") };
        let join = TableJoin::Key { tags: "image".to_owned(), joints: "image".to_owned() };
        assert_eq!(layout.tags.expect("a table of its own").join, join);
        let faults = [
            ("time = { column = \"t\" }\n", ""),
            (", time = { column = \"s\", unit = \"ns\" }", ""),
            ("unit = \"ns\" } }", "unit = \"ns\" }, key = \"image\" }"),
            ("unit = \"ns\" } }", "unit = \"ns\" }, joints_key = \"image\" }"),
            ("file = \"corners.csv\", ", ""),
            ("table = { file = \"corners.csv\", time = { column = \"s\", unit = \"ns\" } }\n", ""),
            ("[table]\ntime = { column = \"t\" }\n", ""),
        ];
        insta::assert_snapshot!("tag_table", told(TWO, &faults));
    }
}
