//! `[[further_camera]]` of robot.toml: cameras in addition to the first one, which `calibrate` uses if a recording has
//! them.

use crate::codes::Code;
use std::path::Path;

use super::{CameraFile, CameraSpec, CameraTable, check_camera};
use crate::robot::error::{FileIssue, RobotError};
use crate::robot::urdf::UrdfChain;

/// Maximum number of cameras of an arm in addition to the first.
pub const MAX_FURTHER_CAMERAS: usize = 7;

/// Checks the further cameras. No joint may come between tags and such a camera that does not for the first: `first` is
/// the most distal.
///
/// # Errors
/// [`RobotError`] naming the table's number and key.
pub(in crate::robot) fn check_further_cameras(
    file: &Path,
    raw: &[CameraFile],
    arm: &UrdfChain<'_>,
    first: &CameraSpec,
) -> Result<Vec<CameraSpec>, RobotError> {
    if raw.len() > MAX_FURTHER_CAMERAS {
        let problem = format!("has {} entries, at most {MAX_FURTHER_CAMERAS} are allowed", raw.len());
        return Err(FileIssue::new(Code::ValueCount, file, "further_camera", problem).into());
    }
    let mut names = vec![&first.name];
    let mut found = Vec::with_capacity(raw.len());
    for (number, camera) in raw.iter().enumerate() {
        let name = format!("further_camera[{}]", number + 1);
        let issue =
            |key: &str, problem: String| FileIssue::new(Code::ValueInvalid, file, format!("{name}.{key}"), problem);
        if camera.name.is_empty() || names.contains(&&camera.name) {
            let problem = format!("is `{}`; each camera needs a name of its own", camera.name);
            return Err(issue("name", problem).into());
        }
        names.push(&camera.name);
        let spec = check_camera(CameraTable { file, name: &name }, camera, arm.attachment(&camera.link)?)?;
        let [n_joints, n_first] = [spec.mount.n_joints, first.mount.n_joints];
        if n_joints > n_first {
            let problem = format!(
                "is `{}`, which more joints move than the link of [camera]: the camera farthest out on the arm is the \
                 first, so exchange the two",
                camera.link
            );
            return Err(issue("link", problem).into());
        }
        if n_joints == 0 && n_first > 0 {
            let problem = format!(
                "is `{}`, which no joint moves, while the arm moves [camera]: both see the same tags, and of tags \
                 beside the arm a camera beside it tells nothing",
                camera.link
            );
            return Err(issue("link", problem).into());
        }
        found.push(spec);
    }
    Ok(found)
}
