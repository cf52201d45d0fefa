//! Parameters that a robot's calibration could take from the recording.

use std::path::Path;

use serde::Serialize;

use armcal_belief::calib::associate;
use armcal_belief::calib::{
    MIN_VIEWS, MIN_VIEWS_PER_PARAMETER, MarkedSpans, PositionProblem, View, free_parameters, identify_scales,
    mount_by_gripper_tag, surveyed,
};
use armcal_belief::model::{JointParameters, Parameter};
use armcal_core::log::{LogError, Recording, TopicMap, scan_recording};
use armcal_core::robot::Robot;

/// Counts of views and tags, and the parameters in words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObservableParameters {
    pub robot: String,
    /// Number of captured views for the fit that show a surveyed tag; `held_out_views` counts those for the verdict.
    pub views: usize,
    pub held_out_views: usize,
    /// Number of tags in the views for the fit.
    pub tags_used: usize,
    /// Ids in captured views that are not in the robot's survey.
    pub unknown_tags: Vec<u32>,
    /// Parameters that the views determine better than the datasheet does: `joint gain`, `joint offset`.
    pub parameters: Vec<String>,
    /// Parameters that would keep the datasheet's values, as `joint gain: why`.
    pub undetermined: Vec<String>,
    /// Requirements for an accepted calibration that the recording does not meet; empty if it meets all.
    pub missing: Vec<String>,
}

/// Determines the parameters from the recording at `path`; `marked` holds its marks.
pub(super) fn observable_parameters(
    path: &Path,
    robot: &Robot,
    marked: &Recording,
) -> Result<ObservableParameters, LogError> {
    let mut determined = ObservableParameters {
        robot: robot.name.clone(),
        views: 0,
        held_out_views: 0,
        tags_used: 0,
        unknown_tags: Vec::new(),
        parameters: Vec::new(),
        undetermined: Vec::new(),
        missing: Vec::new(),
    };
    if marked.joint_names != robot.joint_names() {
        let (found, wanted) = (marked.joint_names.join(", "), robot.joint_names().join(", "));
        determined.missing.push(format!("joint readings of this robot: the recording has [{found}], not [{wanted}]"));
        return Ok(determined);
    }
    let spans = MarkedSpans::of(marked);
    let (recording, _) = scan_recording(path, &TopicMap::default(), |_| {}, |_, message| spans.hold(message))?;
    let robot = &*surveyed(&recording, robot);
    let as_drawn = associate(&recording, robot);
    // A scale that cannot be measured keeps the datasheet's value; `calibrate` explains why, so nothing is said here.
    let scaled = identify_scales(&as_drawn, robot).map_or_else(|_| robot.clone(), |(scaled, _)| scaled);
    let (data, robot) = (associate(&recording, &scaled), &scaled);
    let with_tags = |views: &[View]| views.iter().filter(|view| !view.tags.is_empty()).count();
    determined.views = with_tags(&data.fit);
    determined.held_out_views = with_tags(&data.held_out);
    determined.unknown_tags = data.ids_seen.iter().copied().filter(|id| !knows(robot, *id)).collect();
    if determined.views > 0 {
        let problem = PositionProblem::new(robot, &data.fit);
        determined.tags_used = problem.n_observations();
        let (free, mut unobservable) = free_parameters(&problem, &JointParameters::default());
        let by_gripper_tag = behind_the_camera(robot, &data.fit);
        unobservable.retain(|left_out| !by_gripper_tag.contains(&left_out.parameter));
        determined.parameters = free.iter().chain(&by_gripper_tag).map(|parameter| parameter.name(robot)).collect();
        let line = |u: &armcal_belief::calib::Unobservable| format!("{}: {}", u.parameter.name(robot), u.reason);
        determined.undetermined = unobservable.iter().map(line).collect();
    }
    determined.missing = missing(&determined);
    Ok(determined)
}

fn knows(robot: &Robot, id: u32) -> bool {
    robot.tags.iter().map(|tag| tag.id).chain(robot.gripper_tag.map(|tag| tag.id)).any(|known| known == id)
}

/// Parameters that a tag on the gripper determines.
fn behind_the_camera(robot: &Robot, views: &[View]) -> Vec<Parameter> {
    let found = robot.gripper_tag.map(|tag| mount_by_gripper_tag(robot, &tag, views, &JointParameters::default()));
    found.and_then(Result::ok).map(|mount| mount.determined(robot)).unwrap_or_default()
}

fn missing(determined: &ObservableParameters) -> Vec<String> {
    let mut missing = Vec::new();
    let parameters = determined.parameters.len();
    let wanted = MIN_VIEWS.max((MIN_VIEWS_PER_PARAMETER * parameters as f64).ceil() as usize);
    // The default method fits all views, and cross-validates them for its verdict.
    let views = determined.views + determined.held_out_views;
    if views < wanted {
        let of = if views == 0 { String::new() } else { format!(" for {parameters} parameters") };
        missing.push(format!("views: {views} captured views show a surveyed tag, at least {wanted} are needed{of}"));
    }
    if determined.views > 0 && parameters == 0 {
        missing.push("a sensor that the views determine".to_owned());
    }
    missing
}
