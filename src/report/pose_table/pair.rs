//! Roles of two tables, one of the joints and one of the camera's measurements, and the columns that join their rows.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::roles::{Roles, unit_of_time};
use super::text::{missing_joints, missing_seen};
use crate::report::proposed_map::ProposalError;
use armcal_core::input::{TableContents, plain_key, read_table_contents, whole_key};
use armcal_core::robot::Robot;

/// An inspected table.
#[derive(Clone, Debug)]
pub struct LookedAt {
    /// Path of the table's file.
    pub path: PathBuf,
    /// Columns and first cells of the table.
    pub contents: TableContents,
}

/// Columns that join two tables.
pub(super) enum ProposedJoin {
    /// Join by time: the column of times in the tags' table.
    Time(String),
    /// Join by equal texts: the columns of the joints' and of the tags' table.
    Key([String; 2]),
}

/// A table of the joints and its table of the tags.
pub(super) struct TablePair<'a> {
    pub joints: &'a LookedAt,
    pub tags: &'a LookedAt,
    pub roles: [Roles; 2],
    pub join: ProposedJoin,
}

/// Words in the name of a column that names an image.
const IMAGES: [&str; 6] = ["image", "img", "frame", "file", "picture", "photo"];
/// Least share of the inspected tag rows whose key a joint row must have.
const MOST: f64 = 0.5;
/// Least share of the joint rows that must have a key of their own; `calibrate` names the others.
const ONCE: f64 = 0.9;
/// Number of tables in the same folder that are inspected.
const MAX_NEIGHBOURS: usize = 20;

/// Orders two tables and finds the columns that join them.
pub(super) fn pair<'a>([a, b]: [&'a LookedAt; 2], robot: Option<&Robot>) -> Result<TablePair<'a>, ProposalError> {
    let roles = |of: &LookedAt| Roles::of(&of.contents, robot);
    // The tag's position may have the names of a gantry's joints.
    let of_tags = |of: &LookedAt| {
        let with_joints = roles(of);
        if missing_seen(&with_joints).is_none() { with_joints } else { Roles::of(&of.contents, None) }
    };
    let sides = [(a, b, roles(a), of_tags(b)), (b, a, roles(b), of_tags(a))];
    let fits = |(_, _, of_joints, of_tags): &(_, _, Roles, Roles)| {
        missing_joints(of_joints).is_none() && missing_seen(of_tags).is_none()
    };
    let lacks = |of: &LookedAt| {
        let roles = roles(of);
        let what = [missing_joints(&roles), missing_seen(&roles)].into_iter().flatten().collect::<Vec<_>>();
        format!("{} lacks {}", of.path.display(), what.join("; "))
    };
    let file = || a.path.display().to_string();
    let has_joints = sides.iter().any(|(_, _, of_joints, _)| missing_joints(of_joints).is_none());
    let Some((joints, tags, of_joints, of_tags)) = sides.into_iter().find(fits) else {
        let problem = format!(
            "no input map can be proposed for the two tables: one needs the joints, the other what the camera saw; \
             {}; {}",
            lacks(a),
            lacks(b)
        );
        return Err(match has_joints {
            true => ProposalError::Columns { file: file(), problem },
            false => ProposalError::Joints { file: file(), problem },
        });
    };
    match join([joints, tags], [&of_joints, &of_tags]) {
        Some(join) => Ok(TablePair { joints, tags, roles: [of_joints, of_tags], join }),
        None => {
            if let Some(problem) = ambiguous([joints, tags], [&of_joints, &of_tags]) {
                return Err(ProposalError::Columns { file: joints.path.display().to_string(), problem });
            }
            let names = |of: &LookedAt| of.contents.columns.iter().take(20).map(|c| c.name.clone()).collect::<Vec<_>>();
            let problem = format!(
                "no input map can be proposed: no column joins it with {}: give both tables a column with the name of \
                 the image, the number of the pose or the time. Their columns are {:?} and {:?}",
                b.path.display(),
                names(a),
                names(b)
            );
            Err(ProposalError::Columns { file: file(), problem })
        }
    }
}

/// Join of two tables: an image's name, else times, else another column with the same texts.
fn join([joints, tags]: [&LookedAt; 2], [of_joints, of_tags]: [&Roles; 2]) -> Option<ProposedJoin> {
    let keys = keys([joints, tags], [of_joints, of_tags]);
    if let Some(key) = keys.iter().find(|[of_joints, of_tags]| is_image(of_joints) && is_image(of_tags)) {
        return Some(ProposedJoin::Key(key.clone()));
    }
    let is_whole = |of: &LookedAt, roles: &Roles| {
        let column = roles.time.as_ref().and_then(|name| of.contents.columns.iter().find(|c| c.name == *name));
        column
            .is_some_and(|column| column.n_values() == of.contents.n_rows && column.range.is_some_and(|r| r[0] >= 0.0))
    };
    match &of_tags.time {
        Some(time) if is_whole(joints, of_joints) && is_whole(tags, of_tags) && is_rising(joints, of_joints) => {
            Some(ProposedJoin::Time(time.clone()))
        }
        _ => keys.into_iter().next().map(ProposedJoin::Key),
    }
}

fn is_rising(joints: &LookedAt, roles: &Roles) -> bool {
    joints.contents.columns.iter().any(|column| Some(&column.name) == roles.time.as_ref() && column.is_rising)
}

/// Pairs of columns, one per table, whose first cells agree; those with the same name first. Whole texts are compared
/// before images' names without folder and extension.
fn keys(tables: [&LookedAt; 2], roles: [&Roles; 2]) -> Vec<[String; 2]> {
    let whole = keys_as(tables, roles, (whole_key, ONCE));
    if whole.is_empty() { keys_as(tables, roles, (plain_key, ONCE)) } else { whole }
}

/// Pairs of columns that agree by `key`, if at least `share` of the texts occur in one row of the joints only.
fn keys_as(
    [joints, tags]: [&LookedAt; 2],
    [of_joints, of_tags]: [&Roles; 2],
    (key, share): (fn(&str) -> String, f64),
) -> Vec<[String; 2]> {
    let free = |of: &LookedAt, roles: &Roles| {
        let is_free = |name: &String| ["", "time"].contains(&roles.of_column(name)) && !name.is_empty();
        let names = of.contents.columns.iter().map(|column| column.name.clone());
        names.filter(is_free).collect::<Vec<String>>()
    };
    let mut found = Vec::new();
    for of_joint in free(joints, of_joints) {
        let there: Vec<String> = joints.contents.first_cells(&of_joint).map(key).collect();
        let once: BTreeSet<&String> = there.iter().filter(|key| !key.is_empty()).collect();
        if once.len() < 2 || (once.len() as f64) < share * there.len() as f64 {
            continue;
        }
        for of_tag in free(tags, of_tags) {
            let here: Vec<String> = tags.contents.first_cells(&of_tag).map(key).collect();
            let n = here.iter().filter(|key| once.contains(key)).count();
            if n as f64 > MOST * here.len() as f64 && is_within(&joints.contents, [&of_joint, &of_tag], &tags.contents)
            {
                found.push([of_joint.clone(), of_tag]);
            }
        }
    }
    found.sort_by_key(|[a, b]| a != b);
    found
}

/// Says which image names would join the tables but are ambiguous without folder and extension.
fn ambiguous(tables: [&LookedAt; 2], roles: [&Roles; 2]) -> Option<String> {
    let found = keys_as(tables, roles, (plain_key, 0.0));
    let [of_joint, of_tag] = found.into_iter().find(|names| names.iter().all(|name| is_image(name)))?;
    let cells: Vec<&str> = tables[0].contents.first_cells(&of_joint).collect();
    let again = |k: &usize| cells[..*k].iter().find(|cell| plain_key(cell) == plain_key(cells[*k]));
    let (first, second) = (0..cells.len()).find_map(|k| Some((*again(&k)?, cells[k])))?;
    Some(format!(
        "no input map can be proposed: the names in its column `{of_joint}` are ambiguous without folder and ending, \
         {first:?} and {second:?}; write them with their folders in `{of_tag}` of the other table, too"
    ))
}

fn is_image(name: &str) -> bool {
    IMAGES.iter().any(|word| name.to_lowercase().contains(word))
}

/// True if the tags' keys stay within the joints' keys. Row numbers agree at first in any two tables, then exceed the
/// joints'.
fn is_within(joints: &TableContents, [of_joint, of_tag]: [&String; 2], tags: &TableContents) -> bool {
    let range = |table: &TableContents, name: &String| table.columns.iter().find(|c| c.name == *name)?.range;
    match (range(joints, of_joint), range(tags, of_tag)) {
        (Some([low, high]), Some([first, last])) => first >= low && last <= high,
        _ => true,
    }
}

/// Seconds between the first times of both tables, the joints' less the tags'; `None` where their times overlap.
pub(super) fn apart_s(pair: &TablePair<'_>) -> Option<f64> {
    let range = |of: &LookedAt, roles: &Roles| {
        let name = roles.time.as_ref()?;
        let column = of.contents.columns.iter().find(|column| column.name == *name)?;
        let unit_s = unit_of_time(column).1;
        Some(column.range?.map(|time| time * unit_s))
    };
    let of_joints = range(pair.joints, &pair.roles[0])?;
    let of_tags = range(pair.tags, &pair.roles[1])?;
    (of_tags[1] < of_joints[0] || of_tags[0] > of_joints[1]).then(|| of_joints[0] - of_tags[0])
}

/// Tables in the folder of `table` that have what it lacks; empty unless it lacks exactly one of joints and tags.
#[must_use]
pub fn neighbours(table: &LookedAt, robot: Option<&Robot>) -> Vec<LookedAt> {
    let roles = Roles::of(&table.contents, robot);
    if missing_joints(&roles).is_none() == missing_seen(&roles).is_none() {
        return Vec::new();
    }
    let folder = table.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(entries) = folder.read_dir() else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    let others = paths.into_iter().filter(|path| path.file_name() != table.path.file_name());
    let looked_at = others.filter_map(|path| {
        let contents = read_table_contents(&path)?.ok()?;
        // The path begins as the user named the folder.
        let path = table.path.with_file_name(path.file_name()?);
        Some(LookedAt { path, contents })
    });
    let fits = |other: &LookedAt| pair([table, other], robot).is_ok();
    looked_at.take(MAX_NEIGHBOURS).filter(fits).collect()
}
