//! Readers of landmarks from the files of tag maps.

use armcal_core::codes::Code;
use std::collections::BTreeSet;
use std::path::Path;

use crate::tagmap::files::landmark::{Landmark, LandmarkFile};
use crate::tagmap::files::own;
use crate::tagmap::files::read::{extension, read_tags};
use crate::tagmap::files::tag_file::{TagFile, check_number};
use armcal_core::robot::{FileIssue, RobotError, read_text};
use armcal_core::spatial::{Base, Pose, Tag};

/// Reads our tag map (.toml), a tagslam.yaml or a Kalibr target (.yaml, .yml).
///
/// # Errors
/// [`RobotError`] with file, key and allowed range.
pub fn read_landmarks(file: &Path) -> Result<LandmarkFile, RobotError> {
    let landmarks = match extension(file).as_str() {
        "toml" => own::parse_landmarks(file, &read_text(file)?)?,
        _ => of_tags(&read_tags(file)?),
    };
    check(file, &landmarks)?;
    Ok(landmarks)
}

fn of_tags(tags: &TagFile) -> LandmarkFile {
    let landmark = |tag: &crate::tagmap::TagPrior| {
        let pose: Option<Pose<Base, Tag>> = tag.pose.map(Pose::from_isometry);
        let std = tag.std.unwrap_or_default();
        Landmark {
            id: tag.id,
            name: None,
            size_m: Some(tag.size_m),
            position_m: pose.map(|pose| pose.origin().to_array()),
            quaternion_wxyz: pose.map(|pose| pose.quaternion_wxyz()),
            position_std_m: std[0],
            rotation_std_rad: std[3..].iter().copied().fold(0.0, f64::max),
            board: None,
        }
    };
    let landmarks = tags.tags.iter().filter(|tag| tag.body == 0).map(landmark).collect();
    LandmarkFile { frame: tags.frame.clone(), base_tag: tags.base_tag, anchor_tag: None, landmarks }
}

fn check(file: &Path, map: &LandmarkFile) -> Result<(), FileIssue> {
    check_number(file, map.landmarks.len())?;
    let (mut ids, mut names) = (BTreeSet::new(), BTreeSet::new());
    for landmark in &map.landmarks {
        if !ids.insert(landmark.id) {
            return Err(FileIssue::new(Code::ValueDuplicate, file, format!("tag {}: id", landmark.id), "stands twice"));
        }
        if let Some(name) = &landmark.name
            && !names.insert(name)
        {
            return Err(FileIssue::new(Code::ValueDuplicate, file, format!("tag `{name}`: name"), "stands twice"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tagmap::files::landmark::{FIRST_NAMED_ID, NamedSurvey, UNKNOWN_ROTATION_STD_RAD, spoken_name};
    use armcal_core::input::TagUse;

    const TWO: &str = "version = 1\nkind = \"tag_map\"\n\
        frame = \"base_link\"\n[[tag]]\nid = 2\nsize_m = 0.16\nposition_m = [0.0, 0.0, \
        1.0]\n\
        quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]\nposition_std_m = [0.001, 0.002, 0.003]\n\
        [[tag]]\nname = \"board\"\nposition_m = [0.1, 0.2, 0.3]\n";

    fn survey(text: &str, tag_use: TagUse) -> Result<NamedSurvey, String> {
        let file = Path::new("map.toml");
        let robot =
            armcal_core::robot::load(&Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("robots/titan4"))
                .expect("it reads");
        let map = own::parse_landmarks(file, text).map_err(|error| error.to_string())?;
        check(file, &map).and_then(|()| map.survey(file, &robot, tag_use)).map_err(|error| error.to_string())
    }

    #[test]
    fn a_landmark_without_number_size_and_rotation_is_used_by_its_position() {
        let named = survey(TWO, TagUse::Position).expect("good");
        let [tag, board] = &named.survey.tags[..] else { panic!("two landmarks") };
        assert_eq!((tag.id, tag.size_m, tag.position_std_m, tag.rotation_std_rad), (2, 0.16, 0.003, 0.0));
        assert_eq!(board.id, FIRST_NAMED_ID + 1);
        assert_eq!(named.names[&board.id], "board");
        assert!(board.size_m.is_nan() && board.rotation_std_rad == UNKNOWN_ROTATION_STD_RAD && board.is_known());
        assert_eq!(board.base_from_tag.origin().to_array(), [0.1, 0.2, 0.3]);
        assert_eq!(named.survey.base_tag, Some(2), "the robot's own base tag, 0, is not there");
    }

    #[test]
    fn what_is_missing_for_a_use_is_named() {
        let faults = [
            ("", "", TagUse::Pose),
            ("", "", TagUse::Corners),
            ("position_m = [0.1, 0.2, 0.3]", "size_m = 0.1", TagUse::Position),
            ("id = 2\n", "", TagUse::Position),
            ("name = \"board\"", "id = 2", TagUse::Position),
            ("base_link", "world", TagUse::Position),
            ("0.002", "-0.002", TagUse::Position),
            ("[1.0, 0.0, 0.0, 0.0]", "[0.0, 0.0, 0.0, 0.0]", TagUse::Position),
        ];
        let problems = faults.map(|(from, to, tag_use)| {
            assert!(TWO.contains(from), "{from}");
            survey(&TWO.replacen(from, to, 1), tag_use).expect_err(to)
        });
        insta::assert_snapshot!("landmarks", problems.join("\n"));
    }

    #[test]
    fn a_tag_without_place_is_mapped_by_its_corners() {
        let text = "version = 1\nkind = \"tag_map\"\nframe = \"base_link\"\n[[tag]]\nid = 5\nsize_m = 0.1\n";
        let named = survey(text, TagUse::Corners).expect("good");
        assert!(!named.survey.tags[0].is_known());
    }

    #[test]
    fn what_has_a_name_and_no_number_is_a_board() {
        let [first, second] = [FIRST_NAMED_ID, FIRST_NAMED_ID + 1];
        assert_eq!(spoken_name(7, [7, first]), "tag 7");
        assert_eq!(spoken_name(first, [7, first]), "board");
        assert_eq!([first, second].map(|id| spoken_name(id, [first, second])), ["board 1", "board 2"]);
    }
}
