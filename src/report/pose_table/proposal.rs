//! A proposed input map for a table.

use std::path::{Path, PathBuf};

use super::pair::{LookedAt, ProposedJoin, TablePair, apart_s, pair};
use super::roles::{Columns, Roles, unit_of_time};
use super::text::{cell_of, gaps, missing_joints, missing_seen};
use super::winding::Windings;
use crate::report::proposed_map::joint_units::{JointUnits, StatedUnits};
use crate::report::proposed_map::{ProposalError, comment, quoted};
use armcal_core::input::{MIN_APART_S, TableColumn, TableContents, TableFormat, parse_input_map};
use armcal_core::kind::Kind;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::schema::first_line;

/// Units in the names of columns.
const DEGREES: [&str; 2] = ["deg", "\u{b0}"];
const MILLIMETRES: [&str; 3] = ["[mm", "(mm", "_mm"];
/// Line for a unit that the table does not show.
const AS_SENSORS: &str = "# unit: as the robot's sensors count; or \"rad\", \"deg\"";
/// Largest distance of a tag from the camera, m; larger numbers are millimetres. Assumed.
const MAX_DISTANCE_M: f64 = 20.0;
/// Limit of rotation vectors and angles in radians; larger numbers are degrees.
const MAX_TURN_RAD: f64 = 7.0;

/// The text of an input map for a table, or for two that hold joints and tags; with `robot`, joints are matched to
/// columns. `map` is the file that it goes to.
///
/// # Errors
/// [`ProposalError`] where the tables lack columns that an input map needs.
pub fn propose_table_map(
    tables: (&LookedAt, Option<&LookedAt>),
    robot: Option<&Robot>,
    map: &Path,
) -> Result<ProposedTableMap, ProposalError> {
    let (table, other) = tables;
    let (text, recording) = match other {
        None => (of_one(table, robot)?, &table.path),
        Some(other) => {
            let pair = pair([table, other], robot)?;
            (of_two(&pair, robot, map)?, &pair.joints.path)
        }
    };
    parse_input_map(Path::new("proposed input map"), &text)?;
    Ok(ProposedTableMap { text, recording: recording.clone() })
}

/// A proposed input map.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposedTableMap {
    /// The map as TOML.
    pub text: String,
    /// Path of the table that `calibrate` takes.
    pub recording: PathBuf,
}

fn of_one(table: &LookedAt, robot: Option<&Robot>) -> Result<String, ProposalError> {
    let (file, contents) = (table.path.display().to_string(), &table.contents);
    let roles = Roles::of(contents, robot);
    let needs: Vec<String> = [missing_joints(&roles), missing_seen(&roles)].into_iter().flatten().collect();
    if !needs.is_empty() {
        let columns: Vec<&String> = contents.columns.iter().take(30).map(|column| &column.name).collect();
        let lists = contents.columns.iter().filter_map(|column| column.first_other.as_deref());
        let remedy = match lists.into_iter().any(|cell| cell.starts_with(['[', '('])) {
            true => "give each number of a list in a cell its column",
            false => "where joints and tags are in two tables, name both: `armcal inspect ONE OTHER`",
        };
        let problem = format!(
            "no input map can be proposed: it lacks {}; its columns are {columns:?}; {remedy}",
            needs.join("; ")
        );
        return Err(match missing_joints(&roles) {
            Some(_) => ProposalError::Joints { file, problem },
            None => ProposalError::Columns { file, problem },
        });
    }
    let mut text = head(&comment(&file), &[(contents, &roles)]);
    text += &table_of(contents, &roles);
    text += &joints(contents, &roles, robot);
    text += "\n[tags]\n";
    Ok(text + &tags(contents, &roles))
}

fn of_two(pair: &TablePair<'_>, robot: Option<&Robot>, map: &Path) -> Result<String, ProposalError> {
    let [of_joints, of_tags] = &pair.roles;
    let files = [pair.joints, pair.tags].map(|table| comment(&table.path.display().to_string()));
    let sides = [(&pair.joints.contents, of_joints), (&pair.tags.contents, of_tags)];
    let mut text = head(
        &format!("{} (joints, the recording that `calibrate` takes)\n# and {} (tags)", files[0], files[1]),
        &sides,
    );
    text += &table_of(&pair.joints.contents, of_joints);
    text += &joints(&pair.joints.contents, of_joints, robot);
    let file = quoted(&beside(&pair.tags.path, map));
    let rows_at = match pair.tags.contents.rows_at.join(".") {
        rows if rows.is_empty() => String::new(),
        rows => format!(", rows = {}", quoted(&rows)),
    };
    let (join, why) = match &pair.join {
        ProposedJoin::Time(column) => {
            let unit = column_of(&pair.tags.contents, column).map_or("s", |column| unit_of_time(column).0);
            let join = format!("time = {{ column = {}, unit = \"{unit}\" }}", quoted(column));
            (join, "the joints' row nearest in time, within max_gap_s".to_owned())
        }
        ProposedJoin::Key([of_joints, of_tags]) if of_joints == of_tags => {
            (format!("key = {}", quoted(of_tags)), "rows with the same text in this column".to_owned())
        }
        ProposedJoin::Key([of_joints, of_tags]) => {
            let join = format!("key = {}, joints_key = {}", quoted(of_tags), quoted(of_joints));
            (join, "rows with the same text in these columns".to_owned())
        }
    };
    text += &format!("\n[tags]\ntable = {{ file = {file}{rows_at}, {join} }}   # {why}\n");
    if let (ProposedJoin::Time(_), Some(apart_s)) = (&pair.join, apart_s(pair)) {
        text += &format!(
            "clock_offset_s = {apart_s}   # the times of the tables do not overlap: as if both began together\n"
        );
    }
    Ok(text + &tags(&pair.tags.contents, of_tags))
}

/// The path of `table` as a map at `map` names it.
fn beside(table: &Path, map: &Path) -> String {
    let folder = |path: &Path| std::path::absolute(path).ok().and_then(|path| Some(path.parent()?.to_owned()));
    let is_beside = folder(table).is_some_and(|of_table| Some(of_table) == folder(map));
    let name = if is_beside { table.file_name().map(PathBuf::from) } else { std::path::absolute(table).ok() };
    name.unwrap_or_else(|| table.to_owned()).display().to_string()
}

fn head(files: &str, sides: &[(&TableContents, &Roles)]) -> String {
    let mut text = format!(
        "{}# Proposed by `armcal inspect --write-input` for {files}.\n# Look at each choice; \
         docs/reference/real-arms.md says what the keys mean.\nversion = 1\nkind = \"input\"\n",
        first_line(Kind::Input)
    );
    let gaps: Vec<String> = sides
        .iter()
        .flat_map(|(table, roles)| gaps(table, roles))
        .map(|column| format!("{} in {}", column.n_empty + column.n_others, comment(&column.name)))
        .collect();
    if !gaps.is_empty() {
        text += &format!("not_finite = \"leave_out\"   # rows that lack a number: {}\n", gaps.join(", "));
    }
    text
}

fn table_of(table: &TableContents, roles: &Roles) -> String {
    let format = if table.format == TableFormat::Csv { "csv" } else { "yaml" };
    let mut text = format!("\n[table]\nformat = \"{format}\"   # {} rows\n", table.n_rows);
    if !table.rows_at.is_empty() {
        text += &format!("rows = {}\n", quoted(&table.rows_at.join(".")));
    }
    text + &time(table, roles)
}

fn column_of<'a>(table: &'a TableContents, name: &String) -> Option<&'a TableColumn> {
    table.columns.iter().find(|column| column.name == *name)
}

/// The largest absolute value in the columns.
fn largest<'a>(table: &TableContents, names: impl IntoIterator<Item = &'a String>) -> f64 {
    let ranges = names.into_iter().filter_map(|name| column_of(table, name)?.range);
    ranges.flatten().map(f64::abs).fold(0.0, f64::max)
}

fn time(table: &TableContents, roles: &Roles) -> String {
    let Some(name) = &roles.time else { return "# time: no column of times; rows count as 1 s apart\n".to_owned() };
    let Some(found) = column_of(table, name) else { return String::new() };
    let largest = found.range.map_or_else(String::new, |[_, high]| cell_of(found.n_dates, high));
    let unit = unit_of_time(found).0;
    let line = format!("time = {{ column = {}, unit = \"{unit}\" }}   # up to {largest}\n", quoted(name));
    let is_whole = found.n_empty + found.n_others == 0;
    if found.is_rising && is_whole {
        return line;
    }
    if is_whole && are_poses(table, roles, (name, unit_of_time(found).1)) {
        return format!("{line}# `calibrate` sorts the rows, some of which are out of the order of time\n");
    }
    format!("# {line}# the column has gaps or goes backwards; rows count as 1 s apart\n")
}

/// True where rows of one time have the same joints, and others are apart as poses at rest are.
fn are_poses(table: &TableContents, roles: &Roles, (name, unit_s): (&String, f64)) -> bool {
    let columns: Vec<Vec<&str>> =
        roles.joints.iter().map(|(_, column)| table.first_cells(column).collect::<Vec<_>>()).collect();
    let joints = |row: usize| columns.iter().map(move |cells| cells.get(row).copied()).collect::<Vec<_>>();
    let times = table.first_cells(name).enumerate();
    let mut rows: Vec<(f64, usize)> = times.filter_map(|(row, cell)| Some((cell.parse().ok()?, row))).collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_pose = |two: &[(f64, usize)]| match unit_s * (two[1].0 - two[0].0) {
        0.0 => joints(two[0].1) == joints(two[1].1),
        apart_s => apart_s >= MIN_APART_S,
    };
    rows.len() > 1 && rows.windows(2).all(is_pose)
}

fn joints(table: &TableContents, roles: &Roles, robot: Option<&Robot>) -> String {
    let renamed: Vec<String> = roles
        .joints
        .iter()
        .filter(|(joint, column)| joint != column)
        .map(|(joint, column)| format!("{} = {}", quoted(joint), quoted(column)))
        .collect();
    let columns: Vec<String> = roles.joints.iter().map(|(_, column)| comment(column)).collect();
    let mut text = format!("\n[joint_sensors]\n# columns: {}\n", columns.join(", "));
    if !renamed.is_empty() {
        text += &format!("names = {{ {} }}   # the robot's joint = its column\n", renamed.join(", "));
    }
    let Some(robot) = robot else {
        let says_deg = !roles.joints.is_empty() && roles.joints.iter().all(|(_, column)| says(column, &DEGREES));
        let line = if says_deg { "unit = \"deg\"" } else { AS_SENSORS };
        let largest = largest(table, roles.joints.iter().map(|(_, column)| column));
        return text + &format!("{line}   # the largest value is {largest:.4}\n");
    };
    let column = |spec: &JointSensorSpec| roles.joints.iter().find(|(joint, _)| *joint == spec.joint).map(|(_, c)| c);
    let say = |is_slide: bool, words: &[&str]| {
        let of_kind = robot.sensors.iter().filter(|spec| spec.moves.is_slide() == is_slide);
        let columns: Vec<&String> = of_kind.filter_map(column).collect();
        !columns.is_empty() && columns.into_iter().all(|column| says(column, words))
    };
    let stated = StatedUnits { deg: say(false, &DEGREES), mm: say(true, &MILLIMETRES) };
    let units = JointUnits::of(robot, stated, |spec| column(spec).map(|column| largest(table, [column])));
    let line = units.unit.map_or_else(|| AS_SENSORS.to_owned(), |unit| format!("unit = \"{unit}\""));
    text + &format!("{line}   # the largest value is {:.4}\n", units.largest) + units.slide_line()
}

/// A column whose name has one of these words.
fn says(column: &str, words: &[&str]) -> bool {
    let name = column.to_lowercase();
    words.iter().any(|word| name.contains(word))
}

fn list(names: &[String]) -> String {
    names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", ")
}

/// Lines for corners: of tags where a column has the tag's number, otherwise of a board.
fn corners(table: &TableContents, roles: &Roles) -> String {
    let pixel = roles.pixel.as_ref().map_or(String::new(), |pixel| list(pixel));
    let id = roles.id.as_ref().map_or(String::new(), |id| quoted(id));
    let of_tag = match (&roles.corners, &roles.corner) {
        (Some(columns), _) => format!("corners = [{}]\n", list(columns)),
        (None, Some(corner)) => format!("corner = {}\npixel = [{pixel}]\n", quoted(corner)),
        (None, None) => {
            return format!(
                "child_frame = \"board\"   # as the tag map calls it, with its squares and square_m\n\
                 use = \"board_corners\"\n\n[tags.columns]\nid = {id}\npixel = [{pixel}]\n"
            );
        }
    };
    let order = Windings::of(table, roles).corner_order();
    format!("use = \"corners\"\n\n[tags.columns]\nid = {id}   # the tag's number\n{of_tag}{order}")
}

/// Lines of `[tags]`.
fn tags(table: &TableContents, roles: &Roles) -> String {
    let Some(position) = &roles.position else { return corners(table, roles) };
    let mut text = String::new();
    if roles.id.is_none() {
        text += "child_frame = \"board\"   # as the tag map calls the landmark\n";
    }
    let tag_use = if roles.rotation.is_some() { "pose" } else { "position" };
    text += &format!(
        "use = \"{tag_use}\"\n# position_std_m = 0.003       # noise of a tag's position, one sigma per axis\n\n\
         [tags.columns]\ndirection = \"camera_from_tag\"   # the tag in the camera's frame; or \"tag_from_camera\"\n\
         position = [{}]\n",
        list(&position.names)
    );
    if largest(table, &position.names) > MAX_DISTANCE_M {
        text += "position_unit = \"mm\"\n";
    }
    let others = |Columns { names, .. }: &Columns| format!("# other positions: {}\n", comment(&names.join(", ")));
    text.extend(roles.other_positions.iter().map(others));
    if let Some((columns, form)) = &roles.rotation {
        let or = match *form {
            "rotation_vector" => "   # or \"fixed_xyz\", angles about the fixed axes x, y, z",
            "fixed_xyz" => "   # roll, pitch, yaw",
            "quaternion_xyzw" if columns.names[0].ends_with(".0") => "   # or \"quaternion_wxyz\"",
            _ => "",
        };
        text += &format!("rotation = [{}]\nrotation_form = \"{form}\"{or}\n", list(&columns.names));
        if !["quaternion_xyzw", "matrix"].contains(form) && largest(table, &columns.names) > MAX_TURN_RAD {
            text += "rotation_unit = \"deg\"\n";
        }
    }
    if let Some(id) = &roles.id {
        text += &format!("id = {}   # the tag's number\n", quoted(id));
    }
    text
}
