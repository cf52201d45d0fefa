//! `armcal new-robot`: a robot folder for a URDF.

use armcal_core::codes::{Code, Coded};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;

use crate::cli::closing::say_wrapped;
use crate::cli::exit::{Exit, UsageError};
use crate::cli::file_kind::{FileKind, expect_kind};
use crate::cli::stdout::say;
use crate::export::parse_link_poses;
use crate::output;
use armcal_belief::plan::{always_near, clear_angles, sample_self_pairs};
use armcal_belief::tagmap::files::read_cameras;
use armcal_core::optics::CameraModel;
use armcal_core::robot::{
    self, DraftedMeshes, DraftedRobot, NewFile, NewRobot, Robot, RobotError, SELF_COLLISION_FILE, draft_robot,
};
use armcal_core::text::counted;

/// No arm reaches farther, m. Assumed: Canadarm2 on the space station has 17.6 m.
const MAX_REACH_M: f64 = 30.0;

#[derive(Debug, Args)]
pub(super) struct NewRobotArgs {
    /// URDF of the arm; meshes are searched in its folder and in the folders above
    #[arg(required_unless_present = "self_collision", conflicts_with = "self_collision")]
    urdf: Option<PathBuf>,
    /// Folder to write; it must be empty or absent
    #[arg(long, value_name = "DIR", required_unless_present = "self_collision")]
    out: Option<PathBuf>,
    /// In place of a new folder: find which links of an arm can come near each other, and store it in its folder
    #[arg(long, value_name = "DIR", exclusive = true)]
    self_collision: Option<PathBuf>,
    /// Link whose frame is the base frame; default: the root
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Link of the tool; default: the end of the longest chain of joints
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// Link of the camera's optical frame; default: a link named camera or optical, else that of the tool
    #[arg(long, value_name = "LINK")]
    camera_link: Option<String>,
    /// Link poses for the URDF: kinematics.yaml of Universal Robots (calibration.yaml) or of Franka
    #[arg(long, value_name = "FILE")]
    kinematics: Option<PathBuf>,
    /// Lens of the camera: camchain.yaml of Kalibr or cameras.yaml of TagSLAM
    #[arg(long, value_name = "FILE")]
    lens: Option<PathBuf>,
    /// Camera of that file, such as cam1; needed where it has several
    #[arg(long, value_name = "NAME", requires = "lens")]
    lens_camera: Option<String>,
}

pub(super) fn new_robot(args: &NewRobotArgs) -> Result<Exit> {
    match (&args.self_collision, &args.urdf, &args.out) {
        (Some(folder), _, _) => self_collision(folder),
        (None, Some(urdf), Some(out)) => new_folder(args, urdf, out),
        _ => Err(UsageError::new(Code::UsageInvalid, "a URDF and --out are needed").into()),
    }
}

/// Number of random configurations; pairs that are near each other only in rarer ones are missed.
const N_CONFIGURATIONS: u64 = 200_000;

/// Finds the links that can come near each other, and stores the pairs in the robot's folder.
fn self_collision(folder: &Path) -> Result<Exit> {
    let robot = robot::load_without_pairs(folder)?;
    let found = sample_self_pairs(&robot, N_CONFIGURATIONS, 1);
    let file = folder.join(SELF_COLLISION_FILE);
    let text = found.to_toml(&file, &robot)?;
    output::write_together(&[(file.as_path(), text.as_bytes())])?;
    let mut lines = String::new();
    for pair in &found.pairs {
        let [inner, outer] = pair.bodies.map(|body| robot.bodies[body].name.as_str());
        lines += &format!("{inner:<20} {outer:<20} {:>7.3} m\n", pair.nearest_m);
    }
    say(&format!("{lines}written      {}", file.display()))?;
    Ok(Exit::Ok)
}

fn new_folder(args: &NewRobotArgs, urdf: &Path, out: &Path) -> Result<Exit> {
    expect_kind(urdf, &[FileKind::Urdf])?;
    refuse_full(out)?;
    let text = args.kinematics.as_deref().map(|file| with_link_poses(urdf, file)).transpose()?;
    let lens = args.lens.as_deref().map(|file| lens(file, args.lens_camera.as_deref())).transpose()?;
    let wanted = NewRobot {
        urdf,
        text: text.as_deref(),
        base: args.base.as_deref(),
        tip: args.tip.as_deref(),
        camera: args.camera_link.as_deref(),
        lens: lens.as_ref().map(|(source, lens)| (source.as_str(), lens)),
        touching: &[],
        clear_rad: None,
    };
    let drafted = draft_robot(&wanted, DraftedMeshes::Read)?;
    let DraftedRobot { files, .. } = &drafted;
    let (files, robot) = match trial(files, out)? {
        Ok(robot) => with_shapes(&wanted, robot, out)?,
        Err(why) => {
            let without = draft_robot(&wanted, DraftedMeshes::Ignored(&why.to_string()))?.files;
            let robot = trial(&without, out)??;
            if robot.planning_issues.iter().all(|issue| issue.key != "collision_meshes") {
                return Err(why.into());
            }
            (without, robot)
        }
    };
    write(&files, out)?;
    say_wrapped(&described(&files, &robot, &drafted, out))?;
    Ok(Exit::Ok)
}

/// The named camera of a file, or its only one, and its source in words.
fn lens(file: &Path, wanted: Option<&str>) -> Result<(String, CameraModel)> {
    let cameras = read_cameras(file)?;
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    let problem = match wanted {
        Some(wanted) if !names.contains(&wanted) => format!("no camera is called `{wanted}`"),
        None if names.len() > 1 => format!("it has {}", counted(names.len(), "camera")),
        _ => {
            let camera = cameras.iter().find(|camera| wanted.is_none_or(|wanted| camera.name == wanted));
            let camera = camera.context("a file without cameras is refused")?;
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            return Ok((format!("{} of {name}", camera.name), camera.model));
        }
    };
    let file = file.display();
    let text = format!("{file}: {problem}; name one with --lens-camera: {}", names.join(", "));
    Err(UsageError::new(Code::NameUnknown, text).into())
}

/// The URDF's text with the link poses of a manufacturer's file.
fn with_link_poses(urdf: &Path, file: &Path) -> Result<String, RobotError> {
    let poses = parse_link_poses(file, &robot::read_text(file)?)?;
    poses.written_into(file, (urdf, &robot::read_text(urdf)?))
}

/// Number of random poses for two searches: links that are near each other at nearly all of them, and a pose without
/// near links.
const N_POSES: u32 = 500;
/// Margin of planning by default, m: a pair of links that always is nearer would leave no path.
const NEAR_M: f64 = 0.05;
/// Distance between links of the stowed arm, m.
const STOWED_MARGIN_M: f64 = 0.03;

/// Drafts the robot again with results from the arm's shapes: links that are near each other at nearly every pose, and
/// a pose with no other near links.
fn with_shapes(wanted: &NewRobot<'_>, robot: Robot, out: &Path) -> Result<(Vec<NewFile>, Robot)> {
    let read = |wanted: &NewRobot<'_>| -> Result<(Vec<NewFile>, Robot)> {
        let files = draft_robot(wanted, DraftedMeshes::Read)?.files;
        let robot = trial(&files, out)??;
        Ok((files, robot))
    };
    let touching = always_near(&robot, NEAR_M, N_POSES, 1);
    let wanted = NewRobot { touching: &touching, ..*wanted };
    let robot = if touching.is_empty() { robot } else { read(&wanted)?.1 };
    let clear = clear_angles(&robot, STOWED_MARGIN_M, N_POSES, 1);
    let clear: Option<Vec<f64>> = clear.map(|angles| (0..robot.n_joints()).map(|joint| angles[joint]).collect());
    read(&NewRobot { clear_rad: clear.as_deref(), ..wanted })
}

/// Refuses a folder that is not empty, because existing files are never overwritten.
fn refuse_full(folder: &Path) -> Result<()> {
    let is_free = !folder.exists() || folder.read_dir().is_ok_and(|mut entries| entries.next().is_none());
    if is_free {
        return Ok(());
    }
    Err(UsageError::new(
        Code::FileExists,
        format!("{}: is there and not an empty folder; name another --out", folder.display()),
    )
    .into())
}

/// The robot as it loads from a folder of these files, or the error.
fn trial(files: &[NewFile], out: &Path) -> Result<Result<Robot, UsageError>> {
    let folder = tempfile::tempdir().context("no temporary folder can be made")?;
    write(files, folder.path())?;
    let in_words = |error: RobotError| {
        let text = error.to_string().replace(&folder.path().display().to_string(), &out.display().to_string());
        UsageError::new(error.code(), text)
    };
    Ok(robot::load(folder.path()).map_err(in_words))
}

fn write(files: &[NewFile], folder: &Path) -> Result<()> {
    let placed: Vec<PathBuf> = files.iter().map(|file| folder.join(&file.path)).collect();
    for path in &placed {
        output::make_folder(output::parent(path))?;
    }
    let files: Vec<(&Path, &[u8])> =
        placed.iter().zip(files).map(|(path, file)| (path.as_path(), file.bytes.as_slice())).collect();
    Ok(output::write_together(&files)?)
}

/// True for a reach that no arm has, m.
fn is_beyond_arms(reach_m: f64) -> bool {
    reach_m > MAX_REACH_M
}

/// Line about the joints on the arm's path that are not the arm's; empty without any.
fn left_out(drafted: &DraftedRobot) -> String {
    let DraftedRobot { left_out, cut_at, .. } = drafted;
    let joints = left_out.join(", ");
    match (left_out.is_empty(), cut_at.is_empty()) {
        (true, _) => String::new(),
        (false, true) => format!(
            "\nassumed: left out as a gripper's or a carriage's joints: {joints}. Name --base and --tip to keep them"
        ),
        (false, false) => format!(
            "\nassumed: left out with {}, which moves in several ways, so that no chain continues over it: {joints}. \
             Where they are the arm's, draw it as joints that turn or slide",
            cut_at.join(", ")
        ),
    }
}

fn described(files: &[NewFile], robot: &Robot, drafted: &DraftedRobot, out: &Path) -> String {
    let camera = &robot.camera.name;
    let mut text = format!(
        "{}: robot `{}`, {} joints from `{}`: {}; camera `{camera}`; {} files",
        out.display(),
        robot.name,
        robot.n_joints(),
        robot.base_link,
        robot.joint_names().join(", "),
        files.len()
    );
    text.push_str(&left_out(drafted));
    let reach_m = robot.chain.joints().iter().map(|joint| joint.parent_from_joint.translation.vector.norm()).sum();
    if is_beyond_arms(reach_m) {
        text.push_str(&format!(
            "\nwarning: the joints lie {reach_m:.0} m apart in all, and lengths of a URDF are metres; divide them by \
             1000 where they are millimetres"
        ));
    }
    if !drafted.turned.is_empty() {
        let joints = drafted.turned.join(", ");
        text.push_str(&format!(
            "\nwarning: the rpy of {joints} is more than a turn, and angles of a URDF are radians; multiply them by \
             pi / 180 where they are degrees"
        ));
    }
    for warning in &robot.urdf_warnings {
        text.push_str(&format!("\nwarning: {warning}"));
    }
    for issue in &robot.planning_issues {
        text.push_str(&format!("\nleft for run and plan: {}: {}", issue.key, issue.problem));
    }
    text.push_str(&format!(
        "\nnext: look at what {} says is assumed, then `armcal check {}`",
        out.join("robot.toml").display(),
        out.display()
    ));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reaches in metres, and with millimetres taken for metres.
    #[test]
    fn lengths_in_millimetres_are_told_from_those_of_the_longest_arms() {
        for reach_m in [0.3, 0.9, 2.4, 17.6] {
            assert!(!is_beyond_arms(reach_m) && is_beyond_arms(1e3 * reach_m), "{reach_m}");
        }
    }
}
