//! Keys of a slide's table in calibration.toml: `_m` instead of `_rad`.
//!
//! The program holds a slide's values in metres under the names of angles; files name the right unit.

use armcal_core::codes::Code;
use std::path::Path;

use armcal_core::robot::FileIssue;

const MARK: &str = "moves = \"prismatic\"";

/// Note on slides at the head of a file that has any.
pub(crate) const SLIDE_HEAD: &str =
    "# Of a slide (moves = \"prismatic\") the unit is m instead of rad: keys end in _m instead of _rad.\n";

/// Returns `text` of a calibration with the keys of slides in metres.
pub(crate) fn in_metres(text: &str) -> String {
    if !text.contains(MARK) {
        return text.to_owned();
    }
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    // A joint's table ends at the next table that is not a part of it.
    let is_head = |line: &str| line.starts_with('[') && !line.starts_with("[joint.");
    let mut out = String::with_capacity(text.len());
    let mut rest = &lines[..];
    while let Some(first) = rest.first() {
        let n = 1 + rest[1..].iter().position(|line| is_head(line)).unwrap_or(rest.len() - 1);
        let is_slide = first.trim_end() == "[[joint]]" && rest[..n].iter().any(|line| line.trim_end() == MARK);
        for line in &rest[..n] {
            match line.split_once(" = ") {
                Some((key, value)) if is_slide => out += &format!("{} = {value}", metric(key)),
                _ => out += line,
            }
        }
        rest = &rest[n..];
    }
    out
}

/// Returns the tables of a calibration with the keys of slides as the program names them.
///
/// # Errors
/// [`FileIssue`] if a slide has a key in rad.
pub(crate) fn named_as_angles(file: &Path, mut calibration: toml::Table) -> Result<toml::Table, FileIssue> {
    let joints = calibration.get_mut("joint").and_then(toml::Value::as_array_mut);
    for joint in joints.into_iter().flatten().filter_map(toml::Value::as_table_mut) {
        if joint.get("moves").and_then(toml::Value::as_str) == Some("prismatic") {
            let name = joint.get("name").and_then(toml::Value::as_str).unwrap_or("?").to_owned();
            *joint = renamed(file, &name, joint)?;
        }
    }
    Ok(calibration)
}

fn renamed(file: &Path, joint: &str, table: &toml::Table) -> Result<toml::Table, FileIssue> {
    let mut out = toml::Table::new();
    for (key, value) in table {
        if metric(key) != *key {
            let problem = format!("the joint slides: write {} in its place, in metres", metric(key));
            return Err(FileIssue::new(Code::KeyUnknown, file, format!("joint `{joint}`: {key}"), problem));
        }
        let value = match value.as_table() {
            Some(inner) => toml::Value::Table(renamed(file, joint, inner)?),
            None => value.clone(),
        };
        out.insert(in_parts(key, "m", "rad"), value);
    }
    Ok(out)
}

/// Returns the key in metres.
#[must_use]
pub fn metric(key: &str) -> String {
    in_parts(key, "rad", "m")
}

fn in_parts(key: &str, from: &str, to: &str) -> String {
    let mut parts = key.split('_');
    let first = parts.next().unwrap_or_default();
    std::iter::once(first).chain(parts.map(|part| if part == from { to } else { part })).collect::<Vec<_>>().join("_")
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAD: &str = "robot = \"a\"\nhead_rad = 1\n\n[[joint]]\nname = \"lift\"\nmoves = \"prismatic\"\ncovered_rad = \
                       [0.0, 1.0]\ngain_std_rad_per_count = 2.0\n\n[joint.terms]\noffset_rad_per_mpa = 1.0\n\n\
                       [[joint]]\nname = \"turn\"\noffset_rad = 0.5\n\n[[link]]\nturn_rad = 3\n";
    const METRES: &str = "robot = \"a\"\nhead_rad = 1\n\n[[joint]]\nname = \"lift\"\nmoves = \"prismatic\"\ncovered_m \
                          = [0.0, 1.0]\ngain_std_m_per_count = 2.0\n\n[joint.terms]\noffset_m_per_mpa = 1.0\n\n\
                          [[joint]]\nname = \"turn\"\noffset_rad = 0.5\n\n[[link]]\nturn_rad = 3\n";

    #[test]
    fn keys_of_slides_alone_are_in_metres_and_come_back() {
        assert_eq!(in_metres(RAD), METRES);
        let turning = RAD.replace("moves = \"prismatic\"\n", "");
        assert_eq!(in_metres(&turning), turning);
        let table = |text: &str| text.parse::<toml::Table>().expect("TOML");
        let read = |text: &str| named_as_angles(Path::new("c.toml"), table(text));
        assert_eq!(read(METRES), Ok(table(RAD)));
        let refused = read(RAD).expect_err("rad of a slide").to_string();
        insta::assert_snapshot!("rad_of_a_slide", refused);
    }
}
