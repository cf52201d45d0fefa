//! The cause that a result names first, and the names that count as right.
//!
//! A cause is a word and a name, as `link:forearm_pitch`, `tag:3` or `lens`, for every spelling in a finding or a
//! refusal.

use serde_json::Value;

use crate::falsified::cases::{Case, CaseKind, Element};
use armcal_belief::calib::{Calibration, Refusal};
use armcal_belief::say::{Finding, FindingKind};
use armcal_core::robot::Robot;

/// Causes that a result names first: those of its first finding, or else of its first refusal. Empty for a result
/// without any.
pub(super) fn first_causes(robot: &Robot, calibration: &Calibration) -> Vec<String> {
    let of_touches = calibration.refusals.iter().find_map(causes_of_touches);
    let finding = calibration.findings.first().map(|finding| match (finding.kind, &of_touches) {
        (FindingKind::Tool, Some(causes)) => causes.clone(),
        _ => causes_of_finding(robot, finding),
    });
    finding.or_else(|| calibration.refusals.first().map(|refusal| cause_of_refusal(robot, refusal))).unwrap_or_default()
}

/// Causes in a refusal by touches; `None` for other refusals.
fn causes_of_touches(refusal: &Refusal) -> Option<Vec<String>> {
    let Refusal::Touch { causes, .. } = refusal else { return None };
    let word = |cause: &String| match cause.split(' ').next() {
        Some("tool") => "tool".to_owned(),
        Some("the") if cause.contains("camera") => "camera_mount".to_owned(),
        Some("a") if cause.contains("tag survey") => "base".to_owned(),
        _ => cause.replace(' ', "_"),
    };
    Some(causes.iter().map(word).collect())
}

/// Causes of a finding; a group of tags or joints has one for each.
pub(super) fn causes_of_finding(robot: &Robot, finding: &Finding) -> Vec<String> {
    let kind = serde_json::to_value(finding.kind).ok();
    let kind = kind.as_ref().and_then(Value::as_str).unwrap_or_default();
    let each = |word: &str| names_in(&finding.name).map(|name| format!("{word}:{name}")).collect();
    match kind {
        "tag_moved" | "tags_moved" => each("tag"),
        "tag_size" | "tag_swapped" => each(kind),
        "link" => vec![format!("link:{}", joint_of_link(robot, &finding.name))],
        "camera_mount" | "base" | "lens" | "tool" | "outliers" => vec![kind.to_owned()],
        _ => vec![format!("{kind}:{}", finding.name)],
    }
}

/// Names in a list in words: `3 and 5`, `3, 5`, `all`.
fn names_in(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_')
        .filter(|word| !["", "and", "tag", "tags", "together"].contains(word))
}

/// The joint on a link: a link's error is an error of the next joint's pose.
fn joint_of_link(robot: &Robot, name: &str) -> String {
    let joints = robot.chain.joints();
    let next = joints.iter().position(|joint| joint.child_link == name).map(|parent| parent + 1);
    next.and_then(|joint| joints.get(joint)).map_or_else(|| name.to_owned(), |joint| joint.name.clone())
}

fn cause_of_refusal(robot: &Robot, refusal: &Refusal) -> Vec<String> {
    let value = serde_json::to_value(refusal).unwrap_or_default();
    let text = |key: &str| value.get(key).and_then(Value::as_str).unwrap_or_default().to_owned();
    let cause = text("cause");
    match cause.as_str() {
        "geometry" => match text("element").as_str() {
            "camera mount" => vec!["camera_mount".to_owned()],
            element if element.starts_with("base") => vec!["base".to_owned()],
            element => vec![format!("link:{}", joint_of_link(robot, element))],
        },
        "sensor_error" => vec![format!("sensor_worn:{}", text("joint"))],
        _ => {
            let name = ["joint", "parameter", "tag", "element"].map(text).into_iter().find(|name| !name.is_empty());
            vec![name.map_or(cause.clone(), |name| format!("{cause}:{name}"))]
        }
    }
}

/// Causes that correctly name a case's falsification; empty where there is nothing to name.
pub(super) fn right_causes(robot: &Robot, case: &Case, seed: u64) -> Vec<String> {
    let tag_ids = || case.tags(robot.tags.len(), seed).into_iter().map(|idx| robot.tags[idx].id);
    let tags = |word: &str| tag_ids().map(|id| format!("{word}:{id}")).collect::<Vec<String>>();
    let joint = match case.element {
        Element::Joint(joint) | Element::JointAxis { joint, .. } => robot.chain.joints()[joint].name.as_str(),
        _ => "",
    };
    let one = |word: &str| vec![word.to_owned()];
    let of_joint = |word: &str| vec![format!("{word}:{joint}")];
    match case.kind {
        CaseKind::GoodArm | CaseKind::FewViews | CaseKind::AlikeViews => Vec::new(),
        CaseKind::MountTurned | CaseKind::MountShifted => one("camera_mount"),
        CaseKind::TagMoved | CaseKind::TagsMoved => tags("tag"),
        CaseKind::TagSize => tags("tag_size"),
        CaseKind::AllTagSizes => one("tag_size:all"),
        CaseKind::IdsSwapped => tags("tag_swapped"),
        CaseKind::FocalLength | CaseKind::ImageCentre => one("lens"),
        // The links beyond the camera and the tool point are one cause.
        CaseKind::LinkShifted | CaseKind::LinkTurned => match case.element {
            Element::JointAxis { joint, .. } if joint >= robot.camera.mount.n_joints => {
                vec![format!("link:{}", robot.chain.joints()[joint].name), "tool".to_owned()]
            }
            _ => of_joint("link"),
        },
        CaseKind::GripperAxisTurned => vec![format!("link:{joint}"), "tool".to_owned()],
        CaseKind::ToolShifted => one("tool"),
        CaseKind::BaseShifted | CaseKind::BaseTurned | CaseKind::SurveyTurned => one("base"),
        CaseKind::SensorStuck | CaseKind::SensorDead => of_joint("sensor_failed"),
        CaseKind::SensorReversed => of_joint("sensor_reversed"),
        CaseKind::SensorRescaled => of_joint("sensor_scale"),
        CaseKind::SensorSlipped => of_joint("sensor_slip"),
    }
}
