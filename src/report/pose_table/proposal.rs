//! A proposed input map for a table.

use std::path::Path;

use super::roles::{Columns, Roles};
use super::text::missing;
use crate::report::proposed_map::{ProposalError, comment, quoted};
use armcal_core::input::{TableColumn, TableContents, TableFormat, parse_input_map};
use armcal_core::robot::Robot;

/// No joint of an arm turns more than two turns either way.
const MAX_RAD: f64 = 4.0 * std::f64::consts::PI;
/// A robot folder whose readings are radians has one count per radian.
const RADIANS_WITHIN: f64 = 1e-6;
/// No camera of an arm sees a tag farther away, m; larger numbers are millimetres. Assumed.
const MAX_DISTANCE_M: f64 = 20.0;
/// Rotation vectors and angles in radians are smaller.
const MAX_TURN_RAD: f64 = 7.0;

/// The text of an input map for a table; with `robot`, joints are matched to columns.
///
/// # Errors
/// [`ProposalError`] where the table lacks columns that an input map needs.
pub fn propose_table_map(path: &Path, table: &TableContents, robot: Option<&Robot>) -> Result<String, ProposalError> {
    let roles = Roles::of(table, robot);
    let file = path.display().to_string();
    let needs =
        missing(table, &roles).into_iter().filter(|what| what.starts_with("column") || what.starts_with("a column"));
    let needs: Vec<String> = needs.collect();
    if !needs.is_empty() {
        let columns: Vec<&String> = table.columns.iter().take(30).map(|column| &column.name).collect();
        let problem =
            format!("no input map can be proposed: it lacks {}; its columns are {columns:?}", needs.join("; "));
        return Err(ProposalError::Joints { file, problem });
    }
    let mut text = format!(
        "# Proposed by `armcal inspect --write-input` for {}.\n# Look at each choice; docs/reference/real-arms.md says \
         what the keys mean.\nversion = 1\nkind = \"input\"\n\n[table]\nformat = {}   # {} rows\n",
        comment(&file),
        if table.format == TableFormat::Csv { "\"csv\"" } else { "\"yaml\"" },
        table.n_rows
    );
    if !table.rows_at.is_empty() {
        text += &format!("rows = {}\n", quoted(&table.rows_at.join(".")));
    }
    text += &time(table, &roles);
    text += &joints(table, &roles, robot);
    text += &tags(table, &roles);
    parse_input_map(Path::new("proposed input map"), &text)?;
    Ok(text)
}

fn column<'a>(table: &'a TableContents, name: &String) -> Option<&'a TableColumn> {
    table.columns.iter().find(|column| column.name == *name)
}

/// The largest number in the columns, without its sign.
fn largest<'a>(table: &TableContents, names: impl IntoIterator<Item = &'a String>) -> f64 {
    let ranges = names.into_iter().filter_map(|name| column(table, name)?.range);
    ranges.flatten().map(f64::abs).fold(0.0, f64::max)
}

/// Times in s since 1970 are about 2e9; in other units they are so much larger.
fn time(table: &TableContents, roles: &Roles) -> String {
    let Some(name) = &roles.time else { return "# time: no column of times; rows count as 1 s apart\n".to_owned() };
    let Some(found) = column(table, name) else { return String::new() };
    let largest = found.range.map_or(0.0, |[_, high]| high);
    let unit = match largest {
        high if high > 1e17 => "ns",
        high if high > 1e14 => "us",
        high if high > 1e11 => "ms",
        _ => "s",
    };
    let line = format!("time = {{ column = {}, unit = \"{unit}\" }}   # up to {largest}\n", quoted(name));
    if found.is_rising && found.n_empty + found.n_others == 0 {
        return line;
    }
    format!("# {line}# the column has gaps or goes backwards; rows count as 1 s apart\n")
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
    let largest = largest(table, roles.joints.iter().map(|(_, column)| column));
    let in_rad =
        robot.map(|robot| robot.sensors.iter().all(|s| (s.counts_per_rad.abs() - 1.0).abs() <= RADIANS_WITHIN));
    let unit = match (largest <= MAX_RAD, in_rad) {
        (true, Some(false)) => "unit = \"rad\"",
        (false, Some(true)) => "unit = \"deg\"",
        _ => "# unit: as the robot's sensors count; or \"rad\", \"deg\"",
    };
    text + &format!("{unit}   # the largest value is {largest:.4}\n")
}

fn list(names: &[String]) -> String {
    names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(", ")
}

/// Corners of tags where a column has the tag's number, otherwise of a board.
fn corners(roles: &Roles) -> String {
    let pixel = roles.pixel.as_ref().map_or(String::new(), |pixel| list(pixel));
    let id = roles.id.as_ref().map_or(String::new(), |id| quoted(id));
    let order =
        "corner_order = \"apriltag\"   # bottom left first, counter-clockwise; or \"opencv\": top left, clockwise\n";
    let of_tag = match (&roles.corners, &roles.corner) {
        (Some(columns), _) => format!("corners = [{}]\n{order}", list(columns)),
        (None, Some(corner)) => format!("corner = {}\npixel = [{pixel}]\n{order}", quoted(corner)),
        (None, None) => {
            return format!(
                "\n[tags]\nchild_frame = \"board\"   # as the tag map calls it, with its squares and square_m\n\
                 use = \"board_corners\"\n\n[tags.columns]\nid = {id}\npixel = [{pixel}]\n"
            );
        }
    };
    format!("\n[tags]\nuse = \"corners\"\n\n[tags.columns]\nid = {id}   # the tag's number\n{of_tag}")
}

fn tags(table: &TableContents, roles: &Roles) -> String {
    let mut text = "\n[tags]\n".to_owned();
    let Some(position) = &roles.position else { return corners(roles) };
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
