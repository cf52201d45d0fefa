//! Likely roles of a table's columns, from their names.

use std::collections::{BTreeMap, BTreeSet};

use armcal_core::input::{TableColumn, TableContents, tag_number};
use armcal_core::robot::{Robot, likely_name};

/// Three columns of one position, or three or four of one rotation.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Columns {
    pub names: Vec<String>,
    /// Common part of the columns' names.
    stem: String,
}

/// Columns of the rotation, and its form as the input map names it.
pub(super) type Rotation = (Columns, &'static str);

/// Roles that the columns may have.
#[derive(Clone, Debug, Default)]
pub(super) struct Roles {
    /// Pairs of joint and column; without a robot the column's name is the joint.
    pub joints: Vec<(String, String)>,
    /// Joints of the robot without a column.
    pub missing_joints: Vec<String>,
    pub time: Option<String>,
    pub position: Option<Columns>,
    pub other_positions: Vec<Columns>,
    /// Several tags have columns of their own in one row.
    pub are_tags_side_by_side: bool,
    pub rotation: Option<Rotation>,
    pub pixel: Option<[String; 2]>,
    /// Column of a corner's number, where the tag's is in another column.
    pub corner: Option<String>,
    /// Columns of a tag's four corners.
    pub corners: Option<[String; 8]>,
    pub id: Option<String>,
}

/// Names of a column of times.
const TIMES: [&str; 8] = ["t", "time", "stamp", "timestamp", "secs", "seconds", "nanos", "time_s"];
const IDS: [&str; 9] = ["id", "tag", "tag_id", "tagid", "tag_number", "marker", "marker_id", "aruco_id", "landmark"];
const CORNERS: [&str; 5] = ["corner", "corner_id", "corner_index", "corner_idx", "point"];
/// Names of a corner's two columns, u and v.
const PIXELS: [[&str; 2]; 4] = [["u", "v"], ["x", "y"], ["px", "py"], ["u_px", "v_px"]];
/// Longest name of a column that is searched for roles.
const MAX_NAME: usize = 100;
const SEEN_WORDS: [&str; 10] =
    ["tag", "board", "marker", "target", "track", "cam", "object", "pattern", "aruco", "landmark"];
const ARM_WORDS: [&str; 6] = ["robot", "tool", "base", "flange", "tcp", "ee"];
const ROTATION_STEMS: [&str; 6] = ["r", "rot", "rvec", "rotation", "euler", "rotvec"];
/// Words before the numbers of columns.
const PLACE_WORDS: [&str; 5] = ["translation", "position", "pos", "tvec", "xyz"];
const TURN_WORDS: [&str; 2] = ["rvec", "rotvec"];
const QUATERNION_WORDS: [&str; 3] = ["quaternion", "quat", "orientation"];
/// Words before the number of a tag that has columns of its own.
const TAG_WORDS: [&str; 5] = ["tag", "tag_id", "marker", "aruco", "landmark"];

impl Roles {
    pub fn of(table: &TableContents, robot: Option<&Robot>) -> Self {
        let numbers: Vec<&TableColumn> = table.columns.iter().filter(|column| column.n_numbers > 0).collect();
        let names: Vec<String> = numbers.iter().map(|column| column.name.clone()).collect();
        let mut roles = Self { time: time(&table.columns), ..Self::default() };
        if let Some(robot) = robot {
            roles.match_joints(&names, &table.other_names, robot);
        }
        // A table of the tags alone may have columns with the names of some joints.
        let has_joints = roles.missing_joints.is_empty();
        let is_joint = |name: &String| has_joints && roles.joints.iter().any(|(_, column)| column == name);
        let names: Vec<String> = names.iter().filter(|name| !is_joint(name)).cloned().collect();
        let called = |words: &[&str]| names.iter().find(|name| words.contains(&last_part(name).as_str())).cloned();
        roles.corner = called(&CORNERS);
        let is_id = |column: &&TableColumn| is_of_tags(column) && IDS.contains(&last_part(&column.name).as_str());
        let of_names = table.columns.iter().find(is_id).map(|column| column.name.clone());
        roles.id = called(&IDS).or(of_names).or_else(|| roles.corner.take());
        roles.corners = four_corners(&names);
        let mut places = triples(&names);
        let rotations: Vec<Columns> = extracted(&mut places, is_rotation);
        places.sort_by_key(|columns| seen_rank(&columns.stem));
        roles.are_tags_side_by_side = roles.id.is_none() && side_by_side(places.iter());
        let mut places = places.into_iter();
        (roles.position, roles.other_positions) = (places.next(), places.collect());
        let stem = roles.position.as_ref().map_or("", |columns| &columns.stem);
        roles.rotation = rotation(&names, rotations, stem);
        roles.pixel = pixel(&names);
        match robot {
            None => roles.unmatched_joints(&names, &table.other_names),
            Some(robot) if roles.joints.is_empty() => roles.number_joints(&names, robot),
            Some(_) => {}
        }
        roles
    }

    fn used(&self) -> BTreeSet<&String> {
        let places = self.position.iter().chain(&self.other_positions).flat_map(|columns| &columns.names);
        let rotation = self.rotation.iter().flat_map(|(columns, _)| &columns.names);
        let pixels = self.pixel.iter().flatten().chain(self.corners.iter().flatten());
        places.chain(rotation).chain(&self.time).chain(&self.id).chain(&self.corner).chain(pixels).collect()
    }

    /// Columns with the names of the robot's joints.
    fn match_joints(&mut self, names: &[String], other_names: &BTreeMap<String, String>, robot: &Robot) {
        let all: BTreeSet<String> = names.iter().chain(other_names.keys()).cloned().collect();
        let n_needed = robot.camera.mount.n_joints;
        for (k, joint) in robot.joint_names().into_iter().enumerate() {
            match likely_name(&joint, &all) {
                Some(column) => {
                    let column = other_names.get(column).unwrap_or(column).clone();
                    self.joints.push((joint, column));
                }
                None if k < n_needed => self.missing_joints.push(joint),
                None => {}
            }
        }
    }

    /// Columns without another role that look like joints.
    fn unmatched_joints(&mut self, names: &[String], other_names: &BTreeMap<String, String>) {
        let used = self.used();
        let free = names.iter().filter(|name| !used.contains(name) && is_joint_name(name));
        let found: Vec<(String, String)> = match other_names.is_empty() {
            true => free.map(|name| (name.clone(), name.clone())).collect(),
            false => other_names.clone().into_iter().collect(),
        };
        self.joints = found;
    }

    /// Assigns columns called `q1`, `q2` .. to the joints in the robot's order, if their number is that of the joints.
    fn number_joints(&mut self, names: &[String], robot: &Robot) {
        let used = self.used();
        let free: Vec<&String> = names.iter().filter(|name| !used.contains(name) && is_joint_name(name)).collect();
        let joints = robot.joint_names();
        if free.len() == joints.len() || free.len() == robot.camera.mount.n_joints {
            self.joints = joints.into_iter().zip(free.into_iter().cloned()).collect();
            self.missing_joints.clear();
        }
    }

    /// The role of one column in words.
    pub fn of_column(&self, name: &String) -> &'static str {
        let is_of = |columns: &Columns| columns.names.contains(name);
        if self.joints.iter().any(|(_, column)| column == name) {
            "joint"
        } else if self.time.as_ref() == Some(name) {
            "time"
        } else if self.id.as_ref() == Some(name) {
            "number of a tag or corner"
        } else if self.corner.as_ref() == Some(name) {
            "number of a corner"
        } else if self.position.as_ref().is_some_and(is_of) {
            "position"
        } else if self.other_positions.iter().any(is_of) {
            "another position"
        } else if self.rotation.as_ref().is_some_and(|(columns, _)| is_of(columns)) {
            "rotation"
        } else if self.pixel.iter().flatten().chain(self.corners.iter().flatten()).any(|column| column == name) {
            "pixel"
        } else {
            ""
        }
    }
}

/// Column of times: one with such a name that holds numbers or dates, else the first column of dates.
fn time(columns: &[TableColumn]) -> Option<String> {
    let is_called = |column: &&TableColumn| {
        let name = column.name.to_lowercase();
        TIMES.contains(&name.as_str()) || name.starts_with("time") || name.starts_with("stamp")
    };
    let called = columns.iter().filter(|column| column.n_values() > 0).find(is_called);
    called.or_else(|| columns.iter().find(|column| column.n_dates > 0)).map(|column| column.name.clone())
}

/// True if the cells are names such as `tag36h11:3` instead of numbers.
pub(super) fn is_of_tags(column: &TableColumn) -> bool {
    column.n_numbers == 0 && column.first_other.as_deref().and_then(tag_number).is_some()
}

/// The last word of a path in the form for comparison: `Tag ID` and `tag.id [-]` become `tag_id` and `id`.
fn last_part(name: &str) -> String {
    let without_unit = name.split(['[', '(']).next().map_or("", str::trim);
    let last = without_unit.rsplit('.').next().unwrap_or(name);
    last.to_lowercase().replace([' ', '-'], "_")
}

/// The unit of a column of times, and its seconds; a date counts as seconds. Times since 1970 are about 2e9 s; others
/// are a few minutes apart at most.
pub(super) fn unit_of_time(column: &TableColumn) -> (&'static str, f64) {
    const UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
    const NAMES: [(&str, usize); 8] =
        [("nano", 3), ("nsec", 3), ("micro", 2), ("usec", 2), ("milli", 1), ("msec", 1), ("_ns", 3), ("_ms", 1)];
    const SINCE_1970_S: f64 = 1e9;
    const APART_S: f64 = 600.0;
    if column.n_dates > 0 {
        return ("iso8601", 1.0);
    }
    let name = column.name.to_lowercase();
    if let Some((_, unit)) = NAMES.iter().find(|(word, _)| name.contains(word)) {
        return UNITS[*unit];
    }
    let [first, last] = column.range.unwrap_or_default();
    let apart = (last - first) / column.n_steps.max(2).saturating_sub(1) as f64;
    let by_steps = UNITS.iter().find(|(_, unit_s)| apart * unit_s <= APART_S);
    let is_date = |time: f64, unit_s: f64| (SINCE_1970_S..10.0 * SINCE_1970_S).contains(&(time * unit_s));
    let by_date = UNITS.iter().find(|(_, unit_s)| is_date(first, *unit_s) && apart * unit_s <= APART_S);
    *by_date.or(by_steps).unwrap_or(&UNITS[3])
}

/// True if the name is `q1`, `j_2`, `joint3.position`, or only a number.
fn is_joint_name(name: &str) -> bool {
    let name = name.to_lowercase();
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let stem = stem.trim_end_matches(['_', '.', '-', '[']);
    let is_numbered = stem.len() < name.len();
    name.contains("joint")
        || (is_numbered && ["q", "j", "a", "axis", "theta", "angle", ""].contains(&stem))
        || (is_numbered && (stem.ends_with(".q") || stem.ends_with("joints")))
}

/// All sets of columns whose names differ only in x, y, z, including w where it exists.
fn triples(names: &[String]) -> Vec<Columns> {
    let has = |name: &String| names.contains(name);
    let mut found = Vec::new();
    for name in names {
        let lower = name.to_lowercase();
        let Some(at) = lower.rfind('x').filter(|_| name.is_ascii()) else { continue };
        // Inside a word, x is an ordinary letter.
        let is_end = at + 1 == name.len() || !name[at + 1..].starts_with(|c: char| c.is_ascii_alphanumeric());
        let upper = name[at..].starts_with('X');
        let with = |letter: char| {
            let letter = if upper { letter.to_ascii_uppercase() } else { letter };
            format!("{}{letter}{}", &name[..at], &name[at + 1..])
        };
        let all = ['x', 'y', 'z'].map(with);
        if is_end && all.iter().all(has) {
            let mut columns: Vec<String> = all.to_vec();
            columns.extend(Some(with('w')).filter(has));
            found.push(Columns { names: columns, stem: lower[..at].to_owned() });
        }
    }
    found.extend(names.iter().filter_map(|name| numbered(name, names)));
    found
}

/// Columns such as `target.translation.0` to `.2`, or `target.quaternion.0` to `.3`.
fn numbered(name: &str, names: &[String]) -> Option<Columns> {
    let stem = name.strip_suffix(".0")?;
    let word = last_part(stem);
    let n = [(&PLACE_WORDS[..], 3), (&TURN_WORDS, 3), (&QUATERNION_WORDS, 4)]
        .into_iter()
        .find_map(|(words, n)| words.contains(&word.as_str()).then_some(n))?;
    let all: Vec<String> = (0..n).map(|k| format!("{stem}.{k}")).collect();
    let are_all = all.iter().all(|column| names.contains(column)) && !names.contains(&format!("{stem}.{n}"));
    are_all.then(|| Columns { names: all, stem: format!("{}.", stem.to_lowercase()) })
}

/// Tags side by side in the columns of one row, by what stands before and behind their numbers: `tag3_x`, `tag5_x`.
fn side_by_side<'a>(places: impl Iterator<Item = &'a Columns>) -> bool {
    let number = |columns: &Columns| {
        let stem = columns.stem.trim_end_matches(['_', '.', '-']);
        let word = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        let is_of_tag = TAG_WORDS.iter().any(|tag| word.trim_end_matches(['_', '.', '-']).ends_with(tag));
        (is_of_tag && word.len() < stem.len()).then(|| stem.to_owned())
    };
    places.filter_map(number).collect::<BTreeSet<_>>().len() > 1
}

fn is_rotation(columns: &Columns) -> bool {
    let stem = columns.stem.trim_end_matches(['_', '.', '-']);
    let last = stem.rsplit(['_', '.', '-']).next().unwrap_or(stem);
    columns.names.len() == 4 || ROTATION_STEMS.contains(&last)
}

fn extracted(all: &mut Vec<Columns>, is: impl Fn(&Columns) -> bool) -> Vec<Columns> {
    let (found, rest) = std::mem::take(all).into_iter().partition(|columns| is(columns));
    *all = rest;
    found
}

/// Rank of a column for the camera's measurements: words for them rank before words for the arm.
fn seen_rank(stem: &str) -> u32 {
    let has = |words: &[&str]| words.iter().any(|word| stem.contains(word));
    match (has(&SEEN_WORDS), has(&ARM_WORDS)) {
        (true, _) => 0,
        (false, false) => 1,
        (false, true) => 2,
    }
}

/// The rotation whose names share most with the position's.
fn rotation(names: &[String], found: Vec<Columns>, position_stem: &str) -> Option<Rotation> {
    let shared = |stem: &str| stem.chars().zip(position_stem.chars()).take_while(|(a, b)| a == b).count();
    if let Some(columns) = found.into_iter().max_by_key(|columns| (shared(&columns.stem), columns.names.len())) {
        let form = if columns.names.len() == 4 { "quaternion_xyzw" } else { "rotation_vector" };
        return Some((columns, form));
    }
    if let Some(columns) = matrix(names) {
        return Some((columns, "matrix"));
    }
    let roll = names.iter().find(|name| last_part(name).ends_with("roll"))?;
    let lower = roll.to_lowercase();
    let at = lower.len() - "roll".len();
    let all = ["roll", "pitch", "yaw"]
        .map(|word| names.iter().find(|name| name.to_lowercase() == format!("{}{word}", &lower[..at])).cloned());
    let [Some(roll), Some(pitch), Some(yaw)] = all else { return None };
    Some((Columns { names: vec![roll, pitch, yaw], stem: lower[..at].to_owned() }, "fixed_xyz"))
}

/// Columns of a rotation matrix, such as `r11` to `r33`, or `r00` to `r22`.
fn matrix(names: &[String]) -> Option<Columns> {
    names.iter().find_map(|name| {
        let counted = [("11", 1), ("00", 0)].into_iter().find_map(|(end, from)| Some((name.strip_suffix(end)?, from)));
        let (stem, from) = counted?;
        let cells: Vec<String> = (0..9).map(|k| format!("{stem}{}{}", from + k / 3, from + k % 3)).collect();
        let columns = Columns { names: cells, stem: stem.to_lowercase() };
        columns.names.iter().all(|cell| names.contains(cell)).then_some(columns)
    })
}

fn pixel(names: &[String]) -> Option<[String; 2]> {
    let find = |words: [&str; 3]| names.iter().find(|name| words.contains(&last_part(name).as_str())).cloned();
    Some([find(["u", "px", "u_px"])?, find(["v", "py", "v_px"])?])
}

/// Columns of four corners, such as `u0`, `v0` to `u3`, `v3`, `corner1_x` to `corner4_y`, or `corners.0.0` to
/// `corners.3.1`.
fn four_corners(names: &[String]) -> Option<[String; 8]> {
    let all: BTreeSet<&str> = names.iter().map(String::as_str).collect();
    let with = |(before, after): (&str, &str), from: usize| {
        let at = |k: usize, letter: &str| format!("{before}{}{after}", k + from).replace('\0', letter);
        let pair = |letters: [&str; 2]| [0, 1, 2, 3].map(|k| letters.map(|letter| at(k, letter)));
        let letters = PIXELS.into_iter().chain([["0", "1"]]);
        let is_there = |columns: &[[String; 2]; 4]| columns.iter().flatten().all(|name| all.contains(name.as_str()));
        // Rows of a matrix have a third column.
        let found = letters.map(pair).find(is_there).filter(|_| !all.contains(at(0, "2").as_str()))?;
        let [[a, b], [c, d], [e, f], [g, h]] = found;
        Some([a, b, c, d, e, f, g, h])
    };
    names.iter().filter(|name| name.len() <= MAX_NAME).find_map(|name| {
        // The digit of the first corner's column, and the letter next to it or at the end.
        name.char_indices().filter(|(_, digit)| ['0', '1'].contains(digit)).find_map(|(at, digit)| {
            let (before, after) = (&name[..at], &name[at + 1..]);
            let letter_and_before = before.trim_end_matches(['_', '.', '-']);
            let between = &before[letter_and_before.len()..];
            let letters = PIXELS.iter().map(|pair| pair[0]).chain(["0"]);
            letters.into_iter().find_map(|letter| {
                let (end, start) = (after.strip_suffix(letter), letter_and_before.strip_suffix(letter));
                let behind = end.map(|end| (before.to_owned(), format!("{end}\0")));
                let ahead =
                    start.filter(|_| letter != "0").map(|start| (format!("{start}\0{between}"), after.to_owned()));
                let from = usize::from(digit == '1');
                behind.into_iter().chain(ahead).find_map(|(before, after)| with((&before, &after), from))
            })
        })
    })
}
