//! Edits to the text of a URDF: origins of joints are replaced, elements are added, and the rest of the text stays.

use std::ops::Range;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use quick_xml::Reader;
use quick_xml::escape::{escape, unescape};
use quick_xml::events::{BytesStart, Event};

/// A joint in the text.
#[derive(Debug)]
pub(super) struct JointText {
    pub(super) name: String,
    pub(super) parent: String,
    pub(super) child: String,
    pub(super) is_fixed: bool,
    /// Pose of the joint's frame in the parent link's.
    pub(super) origin: Isometry3<f64>,
    tag: OriginTag,
}

/// The `origin` of a joint in the text.
#[derive(Debug)]
struct OriginTag {
    /// Bytes of its tag; for a joint without one empty, at the place for a new one.
    range: Range<usize>,
    /// Attributes other than `xyz` and `rpy`, as written.
    others: String,
    end: &'static str,
}

/// The text of a URDF and the positions of its joints in it.
#[derive(Debug, Default)]
pub(super) struct UrdfText {
    text: String,
    pub(super) joints: Vec<JointText>,
    pub(super) links: Vec<String>,
    /// Bytes between the root's start tag and its end tag.
    body: Range<usize>,
}

/// State of the scan: the depth of open elements, and whether the one at depth 2 is a joint.
#[derive(Default)]
struct Scan {
    depth: usize,
    is_in_joint: bool,
}

impl UrdfText {
    /// Reads a text that has already been read as a URDF. Its line ends become those of Unix.
    ///
    /// # Errors
    /// The fault of the text, in words.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        let text = text.trim_start_matches('\u{feff}').replace("\r\n", "\n").replace('\r', "\n");
        let mut urdf = Self::default();
        let mut reader = Reader::from_str(&text);
        let mut scan = Scan::default();
        loop {
            let event = reader.read_event().map_err(|error| error.to_string())?;
            let end = usize::try_from(reader.buffer_position()).map_err(|error| error.to_string())?;
            match &event {
                // <tag>, <tag/>, </tag>
                Event::Start(tag) => urdf.open(&mut scan, tag, end - tag.len() - 2..end)?,
                Event::Empty(tag) => {
                    urdf.open(&mut scan, tag, end - tag.len() - 3..end)?;
                    scan.depth -= 1;
                }
                Event::End(tag) => {
                    scan.depth = scan.depth.saturating_sub(1);
                    if scan.depth == 0 {
                        urdf.body.end = end - tag.len() - 3;
                        break;
                    }
                }
                Event::Eof => return Err("the file ends within an element".to_owned()),
                _ => {}
            }
        }
        urdf.text = text;
        Ok(urdf)
    }

    fn open(&mut self, scan: &mut Scan, tag: &BytesStart<'_>, range: Range<usize>) -> Result<(), String> {
        scan.depth += 1;
        let name = tag.name();
        match (scan.depth, name.as_ref()) {
            (1, _) => self.body.start = range.end,
            (2, b"joint") => {
                scan.is_in_joint = true;
                let is_fixed = attribute(tag, "type")?.as_deref() == Some("fixed");
                self.joints.push(JointText {
                    name: attribute(tag, "name")?.unwrap_or_default(),
                    parent: String::new(),
                    child: String::new(),
                    is_fixed,
                    origin: Isometry3::identity(),
                    tag: OriginTag { range: range.end..range.end, others: String::new(), end: "/>" },
                });
            }
            (2, other) => {
                scan.is_in_joint = false;
                if other == b"link" {
                    self.links.extend(attribute(tag, "name")?);
                }
            }
            (3, part) if scan.is_in_joint => {
                let Some(joint) = self.joints.last_mut() else { return Ok(()) };
                match part {
                    b"parent" => joint.parent = attribute(tag, "link")?.unwrap_or_default(),
                    b"child" => joint.child = attribute(tag, "link")?.unwrap_or_default(),
                    b"origin" => joint.read_origin(tag, range, self.body.start)?,
                    _ => {}
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The text with `origins` for the joints of these indices. `first` becomes the first lines of the root element,
    /// `last` its last ones.
    pub(super) fn edited(&self, origins: &[(usize, Isometry3<f64>)], first: &str, last: &str) -> String {
        let mut edits: Vec<(Range<usize>, String)> =
            origins.iter().map(|(joint, pose)| self.joints[*joint].tag.replaced(pose)).collect();
        edits.push((self.body.start..self.body.start, format!("\n{first}")));
        edits.push((self.body.end..self.body.end, last.to_owned()));
        edits.sort_by_key(|(range, _)| range.start);
        let mut edited = self.text.clone();
        for (range, text) in edits.iter().rev() {
            edited.replace_range(range.clone(), text);
        }
        edited
    }
}

impl JointText {
    fn read_origin(&mut self, tag: &BytesStart<'_>, range: Range<usize>, body_start: usize) -> Result<(), String> {
        debug_assert!(range.start >= body_start);
        let [roll, pitch, yaw] = numbers(tag, "rpy")?;
        self.origin = Isometry3::from_parts(
            Translation3::from(Vector3::from(numbers(tag, "xyz")?)),
            UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        );
        let mut others = String::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|error| error.to_string())?;
            let key = utf8(attribute.key.as_ref())?;
            if !["xyz", "rpy"].contains(&key) {
                let value = unescape(utf8(&attribute.value)?).map_err(|error| error.to_string())?;
                others += &format!(" {key}=\"{}\"", escape(&*value));
            }
        }
        // `<origin/>` has one character more between its brackets than `<origin>`.
        let end = if range.len() == tag.len() + 3 { "/>" } else { ">" };
        self.tag = OriginTag { range, others, end };
        Ok(())
    }
}

impl OriginTag {
    fn replaced(&self, pose: &Isometry3<f64>) -> (Range<usize>, String) {
        let indent = if self.range.is_empty() { "\n    " } else { "" };
        (self.range.clone(), format!("{indent}<origin {}{}{}", xyz_rpy(pose), self.others, self.end))
    }
}

/// Attributes of an `origin`: m, and fixed-axis roll, pitch and yaw in rad.
pub(super) fn xyz_rpy(pose: &Isometry3<f64>) -> String {
    // Adding 0 removes the sign of a zero.
    let [x, y, z] = <[f64; 3]>::from(pose.translation.vector).map(|value| value + 0.0);
    let [roll, pitch, yaw] = roll_pitch_yaw(&pose.rotation).map(|value| value + 0.0);
    format!("xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"")
}

/// Angles of `Rz(yaw) Ry(pitch) Rx(roll)`. At a pitch of a quarter turn only a combination of roll and yaw is
/// determined; yaw then compensates for any roll.
pub(super) fn roll_pitch_yaw(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let turn = rotation.to_rotation_matrix();
    let m = turn.matrix();
    let roll = m[(2, 1)].atan2(m[(2, 2)]);
    let (sin, cos) = roll.sin_cos();
    let pitch = (-m[(2, 0)]).atan2(m[(2, 1)] * sin + m[(2, 2)] * cos);
    let yaw = (m[(0, 2)] * sin - m[(0, 1)] * cos).atan2(m[(1, 1)] * cos - m[(1, 2)] * sin);
    [roll, pitch, yaw]
}

/// The text for a comment, which must not have two hyphens in a row.
pub(super) fn comment_text(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if c == '-' && shown.ends_with('-') {
            shown.push(' ');
        }
        shown.push(c);
    }
    shown
}

fn numbers(tag: &BytesStart<'_>, key: &str) -> Result<[f64; 3], String> {
    let Some(text) = attribute(tag, key)? else { return Ok([0.0; 3]) };
    let parsed: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    let values = parsed.ok().and_then(|values| <[f64; 3]>::try_from(values).ok());
    values.ok_or_else(|| format!("origin: {key} = `{text}` is not three numbers"))
}

fn attribute(tag: &BytesStart<'_>, key: &str) -> Result<Option<String>, String> {
    let found = tag.try_get_attribute(key).map_err(|error| error.to_string())?;
    let Some(found) = found else { return Ok(None) };
    let value = unescape(utf8(&found.value)?).map_err(|error| error.to_string())?;
    Ok(Some(value.into_owned()))
}

fn utf8(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\u{feff}<?xml version=\"1.0\"?>\r\n<!-- <joint name=\"no\"/> -->\r\n\
        <robot name='r' xmlns:x=\"u\">\r\n\
        <x:joint name=\"no\"><origin xyz=\"9 9 9\"/></x:joint><link name=\"a\"/><link name=\"b&amp;c\"/>\
        <link name=\"d\"/>\n\
        <joint name=\"one\" type=\"fixed\"><parent link=\"a\"/><child link=\"b&amp;c\"/>\n\
        <origin x:k='\"' rpy=\"0 0 0.5\" xyz=\"1 2 3\" /></joint>\n\
        <joint name=\"two\" type=\"revolute\"><!-- kept --><child link=\"d\"/><parent link=\"b&amp;c\"/></joint>\n\
        <gazebo><joint name=\"three\"><origin xyz=\"5 5 5\"/></joint></gazebo></robot><!-- end -->";

    fn pose(xyz: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), turn)
    }

    #[test]
    fn joints_are_found_where_a_urdf_has_them() {
        let urdf = UrdfText::read(TEXT).expect("it reads");
        assert_eq!(urdf.links, ["a", "b&c", "d"]);
        let found: Vec<[&str; 3]> =
            urdf.joints.iter().map(|j| [j.name.as_str(), j.parent.as_str(), j.child.as_str()]).collect();
        assert_eq!(found, [["one", "a", "b&c"], ["two", "b&c", "d"]]);
        assert_eq!([0, 1].map(|joint| urdf.joints[joint].is_fixed), [true, false]);
        let apart = urdf.joints[0].origin.inverse() * pose([1.0, 2.0, 3.0], [0.0, 0.0, 0.5]);
        assert!(apart.translation.vector.norm() < 1e-15 && apart.rotation.angle() < 1e-15);
        assert_eq!(urdf.joints[1].origin, Isometry3::identity());
    }

    #[test]
    fn only_what_is_edited_changes() {
        let urdf = UrdfText::read(TEXT).expect("it reads");
        let [new, added] = [pose([0.1, 0.2, 0.3], [0.0; 3]), pose([4.0, 5.0, 6.0], [0.0; 3])];
        let edited = urdf.edited(&[(0, new), (1, added)], "<!-- first -->", "<link name=\"e\"/>\n");
        let expected = TEXT
            .trim_start_matches('\u{feff}')
            .replace("\r\n", "\n")
            .replace("xmlns:x=\"u\">", "xmlns:x=\"u\">\n<!-- first -->")
            .replace(
                "<origin x:k='\"' rpy=\"0 0 0.5\" xyz=\"1 2 3\" />",
                "<origin xyz=\"0.1 0.2 0.3\" rpy=\"0 0 0\" x:k=\"&quot;\"/>",
            )
            .replace("<!-- kept -->", "\n    <origin xyz=\"4 5 6\" rpy=\"0 0 0\"/><!-- kept -->")
            .replace("</gazebo>", "</gazebo><link name=\"e\"/>\n");
        assert_eq!(edited, expected);
    }

    #[test]
    fn a_comment_cannot_be_ended_from_within() {
        assert_eq!(comment_text("a-b--->"), "a-b- - ->");
    }

    /// At a pitch of 90 deg the usual formulas lose half of the digits.
    #[test]
    fn angles_give_their_rotation_back_at_any_pitch() {
        let quarter = std::f64::consts::FRAC_PI_2;
        for pitch in [0.0, 1.0, quarter, -quarter, quarter - 1e-9, 1.571, quarter + 1e-12, 3.0] {
            for (roll, yaw) in [(0.3, -2.0), (2.356, 0.393), (-3.1, 3.1)] {
                let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                let [r, p, y] = roll_pitch_yaw(&turn);
                let off = turn.rotation_to(&UnitQuaternion::from_euler_angles(r, p, y)).angle();
                assert!(off < 1e-14, "{roll} {pitch} {yaw}: {off}");
            }
        }
    }
}
