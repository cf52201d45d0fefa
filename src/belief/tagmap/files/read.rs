//! Readers of files about tags.

use armcal_core::codes::Code;
use std::collections::BTreeSet;
use std::path::Path;

use crate::tagmap::check::SIZE_RANGE_M;
use crate::tagmap::files::tag_file::{TagFile, check_number};
use crate::tagmap::files::{kalibr, own, tagslam};
use armcal_core::robot::{FileIssue, RobotError, read_text};

/// Reads our tag map (.toml), a tagslam.yaml or a Kalibr target (.yaml, .yml).
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_tags(file: &Path) -> Result<TagFile, RobotError> {
    let text = read_text(file)?;
    parse_tags(file, &text)
}

/// Parses the text of a file about tags; the extension of `file` selects the format, and errors name `file`.
///
/// # Errors
/// Fails as [`read_tags`] does.
pub fn parse_tags(file: &Path, text: &str) -> Result<TagFile, RobotError> {
    let tags = match extension(file).as_str() {
        "toml" => own::parse(file, text)?,
        "yaml" | "yml" if kalibr::is_target(text) => kalibr::parse(file, text)?,
        "yaml" | "yml" => tagslam::parse(file, text)?,
        other => {
            let problem = format!("`.{other}` is not a format of tag files; use .toml, or .yaml of TagSLAM or Kalibr");
            return Err(FileIssue::new(Code::FileFormat, file, "extension", problem).into());
        }
    };
    check(file, &tags)?;
    Ok(tags)
}

fn check(file: &Path, tags: &TagFile) -> Result<(), RobotError> {
    check_number(file, tags.tags.len())?;
    let mut seen = BTreeSet::new();
    for tag in &tags.tags {
        if !seen.insert(tag.id) {
            return Err(
                FileIssue::new(Code::ValueDuplicate, file, format!("tag {}: id", tag.id), "is defined twice").into()
            );
        }
        FileIssue::check_range(file, &format!("tag {}: size", tag.id), tag.size_m, SIZE_RANGE_M)?;
    }
    if let Some((size_m, _)) = tags.default_tag {
        FileIssue::check_range(file, "default tag size", size_m, SIZE_RANGE_M)?;
    }
    Ok(())
}

pub(super) fn extension(file: &Path) -> String {
    file.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}
