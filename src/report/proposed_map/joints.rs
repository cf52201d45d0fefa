//! The choice of the joint readings.

use std::cmp::Reverse;

use armcal_core::log::topics;
use armcal_core::robot::{Robot, likely_name};

use super::contents::{Contents, Kind, Topic};
use super::{others, quoted};

/// Largest angle in rad: no joint of an arm turns more than two turns either way.
const MAX_RAD: f64 = 4.0 * std::f64::consts::PI;
/// Tolerance of a scale of one count per radian, as a robot folder with readings in radians has it.
const RADIANS_WITHIN: f64 = 1e-6;

/// Returns the topic and the text of `[joint_sensors]`. The error is `None` without a topic of joints, else the fault
/// of all such topics.
pub(super) fn choose_joints(contents: &Contents, robot: Option<&Robot>) -> Result<(String, String), Option<String>> {
    let wanted = robot.map(Robot::joint_names).unwrap_or_default();
    let n_needed = robot.map_or(0, |robot| robot.camera.mount.n_joints);
    let n_matched = |topic: &Topic| wanted.iter().filter(|joint| likely_name(joint, &topic.joints).is_some()).count();
    let rank = |(name, topic): &(&String, &Topic)| {
        (n_matched(topic), *name == topics::JOINT_SENSORS, topic.joints.len(), topic.messages, Reverse((*name).clone()))
    };
    let (name, topic) = contents.of_kind(Kind::Joints).max_by_key(rank).ok_or(None)?;
    let missing: Vec<&String> =
        wanted[..n_needed].iter().filter(|joint| likely_name(joint, &topic.joints).is_none()).collect();
    if !missing.is_empty() {
        return Err(Some(format!(
            "no topic has the joints {missing:?} of the robot; nearest is {name} with {:?}. Write \
             `joint_sensors.names` by hand, or give another --robot",
            topic.joints
        )));
    }
    let renamed: Vec<String> = wanted
        .iter()
        .filter_map(|joint| Some((joint, likely_name(joint, &topic.joints)?)))
        .filter(|(joint, recorded)| joint != recorded)
        .map(|(joint, recorded)| format!("{} = {}", quoted(joint), quoted(recorded)))
        .collect();
    let mut text = format!("\n[joint_sensors]\ntopic = {}   # {} messages\n", quoted(name), topic.messages);
    text += &others("joints there", topic.joints.iter());
    if !renamed.is_empty() {
        text += &format!("names = {{ {} }}   # the robot's joint = the recorded name\n", renamed.join(", "));
    }
    text += &unit(topic, robot);
    text +=
        &others("other joint readings", contents.of_kind(Kind::Joints).map(|(other, _)| other).filter(|o| *o != name));
    Ok((name.clone(), text))
}

fn unit(topic: &Topic, robot: Option<&Robot>) -> String {
    let looks_like_rad = topic.largest <= MAX_RAD;
    let is_in_rad =
        |robot: &Robot| robot.sensors.iter().all(|spec| (spec.counts_per_rad.abs() - 1.0).abs() <= RADIANS_WITHIN);
    let values = format!("the largest value is {:.4}", topic.largest);
    match robot {
        Some(robot) if looks_like_rad && !is_in_rad(robot) => {
            format!("unit = \"rad\"   # {values}; robot.toml counts otherwise. Raw readings would be \"counts\"\n")
        }
        _ if looks_like_rad => format!("# unit: {values}, as radians have it; taken as the robot's sensors count\n"),
        _ => format!("# unit: {values}, as raw counts or degrees have it; for degrees write unit = \"deg\"\n"),
    }
}
