//! Target file of Kalibr: an aprilgrid is a board of tags with known places.

use armcal_core::codes::Code;
use std::path::Path;

use nalgebra::{Isometry3, Translation3};
use serde::Deserialize;

use crate::tagmap::check::SIZE_RANGE_M;
use crate::tagmap::files::tag_file::TagFile;
use crate::tagmap::files::yaml;
use crate::tagmap::types::{Body, TagPrior};
use armcal_core::robot::{FileIssue, RobotError};

/// Target file as Kalibr documents it: `tagSpacing` is the gap between tags over their size.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct TargetYaml {
    #[serde(rename = "target_type")]
    target_type: String,
    tag_cols: Option<u32>,
    tag_rows: Option<u32>,
    tag_size: Option<f64>,
    tag_spacing: Option<f64>,
}

pub(super) fn is_target(text: &str) -> bool {
    text.lines().any(|line| line.trim_start().starts_with("target_type"))
}

/// Parses a target. Tags are numbered from the lower left by rows. The board's frame has its origin at the first tag's
/// lower left corner, x right, y up, z out of the board.
pub(super) fn parse(file: &Path, text: &str) -> Result<TagFile, RobotError> {
    let raw: TargetYaml = yaml::parse(file, text)?;
    if raw.target_type != "aprilgrid" {
        let problem = format!("`{}` is not supported; use aprilgrid", raw.target_type);
        return Err(FileIssue::new(Code::NameUnknown, file, "target_type", problem).into());
    }
    let missing = |key: &str| FileIssue::new(Code::KeyMissing, file, key, "is missing");
    let size_m = raw.tag_size.ok_or_else(|| missing("tagSize"))?;
    FileIssue::check_range(file, "tagSize", size_m, SIZE_RANGE_M)?;
    let spacing = raw.tag_spacing.ok_or_else(|| missing("tagSpacing"))?;
    FileIssue::check_range(file, "tagSpacing", spacing, 0.0..=100.0)?;
    let count = |key: &str, value: Option<u32>| -> Result<u32, RobotError> {
        let value = value.ok_or_else(|| missing(key))?;
        FileIssue::check_range(file, key, f64::from(value), 1.0..=100.0)?;
        Ok(value)
    };
    let (columns, rows) = (count("tagCols", raw.tag_cols)?, count("tagRows", raw.tag_rows)?);
    let step_m = size_m * (1.0 + spacing);
    let place = |row: u32, column: u32| {
        let along = |k: u32| f64::from(k) * step_m + 0.5 * size_m;
        Isometry3::from_parts(Translation3::new(along(column), along(row), 0.0), nalgebra::UnitQuaternion::identity())
    };
    let tags = (0..rows).flat_map(|row| {
        (0..columns).map(move |column| TagPrior {
            id: row * columns + column,
            size_m,
            body: 0,
            pose: Some(place(row, column)),
            std: None,
        })
    });
    Ok(TagFile {
        frame: "target".to_owned(),
        bodies: vec![Body { name: "target".to_owned(), is_static: true, pose: None }],
        tags: tags.collect(),
        ..TagFile::default()
    })
}
