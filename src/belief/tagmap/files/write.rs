//! Writers of tag maps.

use armcal_core::codes::Code;
use std::path::Path;

use nalgebra::{Isometry3, Matrix6, Vector6};

use crate::tagmap::files::read::extension;
use crate::tagmap::files::written::{WrittenGroup, WrittenTag};
use crate::tagmap::files::{own, tagslam};
use crate::tagmap::result::{GroupFrame, MappedTag, TagMap};
use crate::tagmap::types::MapInput;
use armcal_core::robot::FileIssue;
use armcal_core::spatial::adjoint;

/// Formats a map in the format of the extension: our TOML, or a tagslam.yaml.
///
/// # Errors
/// [`FileIssue`] for another extension.
pub fn map_to_text(file: &Path, map: &TagMap, input: &MapInput<'_>) -> Result<String, FileIssue> {
    let anchor = Anchor::of(map, input);
    let groups = written(map, input, anchor.as_ref());
    match extension(file).as_str() {
        "toml" => Ok(own::to_text(&groups, anchor.map(|anchor| anchor.id))),
        "yaml" | "yml" => Ok(tagslam::to_text(&groups)),
        other => {
            let problem = format!("`.{other}` is not a format of tag maps; use .toml, or .yaml for TagSLAM's");
            Err(FileIssue::new(Code::FileFormat, file, "extension", problem))
        }
    }
}

/// The tag whose error all tags of the first group share.
struct Anchor {
    id: u32,
    place: Isometry3<f64>,
    /// Covariance of the place at which the solver held it, on the right; zero if the map's covariances include it.
    held: Matrix6<f64>,
}

impl Anchor {
    /// Returns the held tag or, of several known ones, the one with the least variance. `None` for a map in the frame
    /// of a tag, or with several held tags, whose places are exact.
    fn of(map: &TagMap, input: &MapInput<'_>) -> Option<Self> {
        let group = map.groups.first().filter(|group| matches!(group.frame, GroupFrame::Body(_)))?;
        let tags: Vec<&MappedTag> = group.tags.iter().filter_map(|id| map.tag(*id)).collect();
        let held: Vec<&&MappedTag> = tags.iter().filter(|tag| tag.is_fixed).collect();
        let variance_m2 = |tag: &MappedTag| tag.position_covariance_m2().trace();
        let anchor = match held[..] {
            [] => tags.iter().min_by(|a, b| variance_m2(a).total_cmp(&variance_m2(b)))?,
            [only] => only,
            _ => return None,
        };
        let stated = input.tags.iter().find(|tag| tag.id == anchor.id).and_then(|tag| tag.std);
        let held = stated.filter(|_| anchor.is_fixed).map_or_else(Matrix6::zeros, |std| {
            Matrix6::from_diagonal(&Vector6::from(std).component_mul(&Vector6::from(std)))
        });
        Some(Self { id: anchor.id, place: anchor.frame_from_tag, held })
    }

    /// Contribution of a held anchor to the covariance of a tag of its group.
    fn shared(&self, tag: &MappedTag) -> Matrix6<f64> {
        let by_anchor = adjoint(&tag.frame_from_tag.inv_mul(&self.place));
        by_anchor * self.held * by_anchor.transpose()
    }
}

fn written(map: &TagMap, input: &MapInput<'_>, anchor: Option<&Anchor>) -> Vec<WrittenGroup> {
    let tag = |id: &u32| {
        let mut tag = map.tag(*id)?.clone();
        if let Some(anchor) = anchor.filter(|_| tag.group == 0) {
            tag.covariance += anchor.shared(&tag);
        }
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
