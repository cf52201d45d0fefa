//! tagslam.yaml: bodies and their tags, as TagSLAM (Pfrommer and Daniilidis 2019) reads them.

use crate::tagmap::constants::files_tagslam::HELD;
use armcal_core::codes::Code;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use serde::Deserialize;

use crate::tagmap::check::SIZE_RANGE_M;
use crate::tagmap::files::tag_file::{Remap, TagFile, check_number};
use crate::tagmap::files::written::WrittenGroup;
use crate::tagmap::files::yaml::{self, PoseYaml};
use crate::tagmap::types::{Body, TagPrior};
use armcal_core::robot::{FileIssue, RobotError};
use armcal_core::time::Stamp;

#[derive(Debug, Deserialize)]
struct TagslamYaml {
    #[serde(default)]
    body_defaults: Option<BodyDefaults>,
    default_body: Option<String>,
    bodies: Vec<BTreeMap<String, BodyYaml>>,
    #[serde(default)]
    squash: Vec<SquashYaml>,
    #[serde(default)]
    tag_id_remap: Vec<RemapYaml>,
    // Other measurements of TagSLAM; they are only reported.
    plane_measurements: Option<serde::de::IgnoredAny>,
    distance_measurements: Option<serde::de::IgnoredAny>,
    coordinate_measurements: Option<serde::de::IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
struct BodyDefaults {
    position_noise: Option<f64>,
    rotation_noise: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct BodyYaml {
    #[serde(rename = "type")]
    kind: Option<String>,
    #[serde(default)]
    is_static: bool,
    default_tag_size: Option<f64>,
    max_hamming_distance: Option<i32>,
    #[serde(default)]
    ignore_tags: Vec<u32>,
    /// Noise that replaces that of each tag's pose, m and rad; both or none.
    override_tag_position_noise: Option<f64>,
    override_tag_rotation_noise: Option<f64>,
    pose: Option<PoseYaml>,
    #[serde(default)]
    tags: Vec<TagYaml>,
    board: Option<BoardYaml>,
    staggered_board: Option<BoardYaml>,
    odom_topic: Option<String>,
}

#[derive(Debug, Deserialize)]
struct TagYaml {
    id: u32,
    size: Option<f64>,
    pose: Option<PoseYaml>,
}

#[derive(Debug, Deserialize)]
struct BoardYaml {
    tag_start_id: u32,
    tag_size: f64,
    tag_spacing: f64,
    tag_rows: u32,
    tag_columns: u32,
    #[serde(default)]
    tag_rotation_noise: f64,
    #[serde(default)]
    tag_position_noise: f64,
    pose: Option<PoseYaml>,
}

#[derive(Debug, Deserialize)]
struct SquashYaml {
    time: String,
    tags: Vec<u32>,
}

#[derive(Debug, Deserialize)]
struct RemapYaml {
    id: u32,
    remaps: Vec<OneRemapYaml>,
}

#[derive(Debug, Deserialize)]
struct OneRemapYaml {
    remap_id: u32,
    camera: Option<String>,
    start_time: String,
    end_time: String,
}

pub(super) fn parse(file: &Path, text: &str) -> Result<TagFile, RobotError> {
    let raw: TagslamYaml = yaml::parse(file, text)?;
    let defaults = raw.body_defaults.unwrap_or_default();
    let noise = (defaults.position_noise.unwrap_or(0.05), defaults.rotation_noise.unwrap_or(0.01));
    let mut out = TagFile::default();
    for (name, body) in raw.bodies.iter().flatten() {
        add_body(file, &mut out, name, body, noise)?;
    }
    if let Some(name) = &raw.default_body {
        let Some(body) = out.bodies.iter().position(|body| body.name == *name) else {
            let names: Vec<&str> = out.bodies.iter().map(|body| body.name.as_str()).collect();
            return Err(FileIssue::new(
                Code::NameUnknown,
                file,
                "default_body",
                format!("`{name}` is none of {names:?}"),
            )
            .into());
        };
        let size = raw.bodies.iter().flatten().nth(body).and_then(|(_, body)| body.default_tag_size);
        out.default_tag = size.map(|size| (size, body));
    }
    out.frame = out.default_tag.map_or_else(
        || out.bodies.first().map(|body| body.name.clone()).unwrap_or_default(),
        |(_, body)| out.bodies[body].name.clone(),
    );
    for squash in &raw.squash {
        out.squashed.push((stamp(file, "squash.time", &squash.time)?, squash.tags.iter().copied().collect()));
    }
    for (id, remap) in raw.tag_id_remap.iter().flat_map(|remap| remap.remaps.iter().map(|one| (remap.id, one))) {
        out.remaps.push(Remap {
            id,
            as_id: remap.remap_id,
            camera: remap.camera.clone(),
            from: stamp(file, "tag_id_remap.start_time", &remap.start_time)?,
            to: stamp(file, "tag_id_remap.end_time", &remap.end_time)?,
        });
    }
    let measured = [
        ("plane_measurements", raw.plane_measurements.is_some()),
        ("distance_measurements", raw.distance_measurements.is_some()),
        ("coordinate_measurements", raw.coordinate_measurements.is_some()),
    ];
    out.ignored_keys.extend(measured.iter().filter(|(_, is_there)| *is_there).map(|(key, _)| (*key).to_owned()));
    Ok(out)
}

fn add_body(file: &Path, out: &mut TagFile, name: &str, raw: &BodyYaml, noise: (f64, f64)) -> Result<(), RobotError> {
    let body = out.bodies.len();
    let key = |of: &str| format!("bodies.{name}.{of}");
    if let Some(size_m) = raw.default_tag_size {
        FileIssue::check_range(file, &key("default_tag_size"), size_m, SIZE_RANGE_M)?;
    }
    let pose = raw.pose.map(|pose| pose.pose(file, &key("pose"))).transpose()?;
    check_number(file, out.tags.len())?;
    out.bodies.push(Body { name: name.to_owned(), is_static: raw.is_static, pose: pose.filter(|_| raw.is_static) });
    out.ignored.extend(&raw.ignore_tags);
    if let Some(most) = raw.max_hamming_distance {
        out.max_hamming = Some(out.max_hamming.map_or(most, |other: i32| other.min(most)));
    }
    if raw.odom_topic.is_some() {
        out.ignored_keys.push(key("odom_topic"));
    }
    let first = out.tags.len();
    for tag in &raw.tags {
        let of_tag = |of: &str| key(&format!("tags: id {}: {of}", tag.id));
        let Some(size_m) = tag.size.or(raw.default_tag_size) else {
            return Err(FileIssue::new(
                Code::KeyMissing,
                file,
                of_tag("size"),
                "is missing, and so is the body's default_tag_size",
            )
            .into());
        };
        FileIssue::check_range(file, &of_tag("size"), size_m, SIZE_RANGE_M)?;
        let pose = tag.pose.map(|pose| pose.pose(file, &of_tag("pose"))).transpose()?;
        let std = tag.pose.map(|pose| pose.std(file, &of_tag("pose"), noise)).transpose()?;
        out.tags.push(TagPrior { id: tag.id, size_m, body, pose, std });
    }
    match (raw.kind.as_deref().unwrap_or("simple"), &raw.board, &raw.staggered_board) {
        ("simple", ..) => {}
        ("board", Some(board), _) => out.tags.extend(board_tags(file, body, &key("board"), board, Rows::Full)?),
        ("staggered_board", _, Some(board)) => {
            out.tags.extend(board_tags(file, body, &key("staggered_board"), board, Rows::Staggered)?);
        }
        ("board" | "staggered_board", ..) => {
            return Err(FileIssue::new(Code::KeyMissing, file, key("board"), "is missing").into());
        }
        (other, ..) => {
            let problem = format!("`{other}` is not supported; use simple, board or staggered_board");
            return Err(FileIssue::new(Code::NameUnknown, file, key("type"), problem).into());
        }
    }
    if let Some(std) = raw.overriding_std(file, &key)? {
        out.tags[first..].iter_mut().filter(|tag| tag.pose.is_some()).for_each(|tag| tag.std = Some(std));
    }
    Ok(())
}

impl BodyYaml {
    /// Standard deviations that TagSLAM assigns to every tag of the body with a known pose, if both are above zero.
    fn overriding_std(&self, file: &Path, key: &dyn Fn(&str) -> String) -> Result<Option<[f64; 6]>, RobotError> {
        let noises = [
            ("override_tag_position_noise", self.override_tag_position_noise),
            ("override_tag_rotation_noise", self.override_tag_rotation_noise),
        ];
        for (name, noise) in noises {
            // TagSLAM writes -1 for none.
            FileIssue::check_range(file, &key(name), noise.unwrap_or(-1.0), -1.0..=1e6)?;
        }
        let [position, rotation] = noises.map(|(_, noise)| noise.filter(|noise| *noise > 0.0));
        Ok(position.zip(rotation).map(|(p, r)| [p, p, p, r, r, r]))
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Rows {
    /// Upwards, every column.
    Full,
    /// Downwards, every other column.
    Staggered,
}

fn board_tags(file: &Path, body: usize, key: &str, raw: &BoardYaml, rows: Rows) -> Result<Vec<TagPrior>, RobotError> {
    FileIssue::check_range(file, &format!("{key}.tag_size"), raw.tag_size, SIZE_RANGE_M)?;
    FileIssue::check_range(file, &format!("{key}.tag_spacing"), raw.tag_spacing, 0.0..=1000.0)?;
    for (name, n) in [("tag_rows", raw.tag_rows), ("tag_columns", raw.tag_columns)] {
        FileIssue::check_range(file, &format!("{key}.{name}"), f64::from(n), 1.0..=1000.0)?;
    }
    check_number(file, raw.tag_rows as usize * raw.tag_columns as usize)?;
    for (name, value) in [("position", raw.tag_position_noise), ("rotation", raw.tag_rotation_noise)] {
        FileIssue::check_range(file, &format!("{key}.tag_{name}_noise"), value, 0.0..=1e6)?;
    }
    let board = raw.pose.map(|pose| pose.pose(file, key)).transpose()?.unwrap_or_else(Isometry3::identity);
    let step_m = raw.tag_size * (1.0 + raw.tag_spacing);
    let (position, rotation) = (raw.tag_position_noise, raw.tag_rotation_noise);
    let std = (position + rotation > 0.0).then_some([position, position, position, rotation, rotation, rotation]);
    let mut id = raw.tag_start_id;
    let mut tags = Vec::new();
    for row in 0..raw.tag_rows {
        let (first, step, up) = match rows {
            Rows::Full => (0, 1, 1.0),
            Rows::Staggered => (row % 2, 2, -1.0),
        };
        for column in (first..raw.tag_columns).step_by(step) {
            let center = Translation3::new(f64::from(column) * step_m, up * f64::from(row) * step_m, 0.0);
            let pose = board.inverse() * Isometry3::from_parts(center, UnitQuaternion::identity());
            tags.push(TagPrior { id, size_m: raw.tag_size, body, pose: Some(pose), std });
            id = id.saturating_add(1);
        }
    }
    Ok(tags)
}

/// Parses seconds with a fraction, to the nanosecond.
fn stamp(file: &Path, key: &str, text: &str) -> Result<Stamp, RobotError> {
    let wrong = || FileIssue::new(Code::ValueInvalid, file, key, format!("`{text}` is no time in seconds"));
    let (whole, fraction) = text.trim().split_once('.').unwrap_or((text.trim(), ""));
    let seconds: i64 = whole.parse().map_err(|_| wrong())?;
    let digits: String = fraction.chars().chain(std::iter::repeat('0')).take(9).collect();
    let nanos: i64 = digits.parse().map_err(|_| wrong())?;
    let total = seconds.checked_mul(1_000_000_000).and_then(|s| s.checked_add(nanos)).ok_or_else(wrong)?;
    Ok(Stamp { nanos: total })
}

/// Formats a map as tagslam.yaml: one body for each group.
pub(super) fn to_text(groups: &[WrittenGroup]) -> String {
    let mut out = String::new();
    if let Some(first) = groups.first() {
        let _ = writeln!(out, "default_body: {}", first.frame);
    }
    out.push_str("bodies:\n");
    for group in groups {
        let _ = writeln!(out, "  - {}:\n      type: simple\n      is_static: {}", group.frame, group.is_static);
        out.push_str("      tags:\n");
        for tag in &group.tags {
            let _ = writeln!(out, "        - id: {}\n          size: {:?}\n          pose:", tag.id, tag.size_m);
            let std = |k: usize| tag.covariance[(k, k)].max(0.0).sqrt();
            let position = tag.pose.translation.vector.into();
            let rotation = tag.pose.rotation.scaled_axis().into();
            xyz(&mut out, "position", position);
            xyz(&mut out, "rotation", rotation);
            xyz(&mut out, "position_noise", [0, 1, 2].map(|k| std(k).max(HELD.0)));
            xyz(&mut out, "rotation_noise", [3, 4, 5].map(|k| std(k).max(HELD.1)));
        }
    }
    out
}

fn xyz(out: &mut String, key: &str, [x, y, z]: [f64; 3]) {
    let _ = writeln!(out, "            {key}:\n              x: {x:?}\n              y: {y:?}\n              z: {z:?}");
}
