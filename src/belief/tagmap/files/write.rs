//! Writers of tag maps.

use armcal_core::codes::Code;
use std::path::Path;

use crate::tagmap::files::read::extension;
use crate::tagmap::files::written::{WrittenGroup, WrittenTag};
use crate::tagmap::files::{own, tagslam};
use crate::tagmap::result::{GroupFrame, TagMap};
use crate::tagmap::types::MapInput;
use armcal_core::robot::FileIssue;

/// The text of a map in the form of the extension: our TOML, or a tagslam.yaml.
///
/// # Errors
/// [`FileIssue`] for another extension.
pub fn map_to_text(file: &Path, map: &TagMap, input: &MapInput<'_>) -> Result<String, FileIssue> {
    let groups = written(map, input);
    match extension(file).as_str() {
        "toml" => Ok(own::to_text(&groups)),
        "yaml" | "yml" => Ok(tagslam::to_text(&groups)),
        other => {
            let problem = format!("`.{other}` is not a format of tag maps; use .toml, or .yaml for TagSLAM's");
            Err(FileIssue::new(Code::FileFormat, file, "extension", problem))
        }
    }
}

fn written(map: &TagMap, input: &MapInput<'_>) -> Vec<WrittenGroup> {
    let tag = |id: &u32| {
        let tag = map.tag(*id)?;
        Some(WrittenTag {
            id: tag.id,
            size_m: tag.size_m,
            pose: tag.frame_from_tag,
            position_std_m: tag.position_std_m(),
            covariance: tag.covariance,
        })
    };
    map.groups
        .iter()
        .map(|group| WrittenGroup {
            frame: match &group.frame {
                GroupFrame::Body(name) => name.clone(),
                GroupFrame::Tag(id) => format!("tag_{id}"),
            },
            is_static: group.bodies.iter().all(|body| input.bodies[*body].is_static),
            tags: group.tags.iter().filter_map(tag).collect(),
        })
        .collect()
}
