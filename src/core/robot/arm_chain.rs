//! The arm in a URDF: its longest serial chain of revolute joints and slides, without a gripper's fingers.

use crate::codes::Code;
use urdf_rs::JointType;

use super::error::FileIssue;
use super::urdf::UrdfModel;
use crate::joints::MAX_JOINTS;

/// Joints before a place where a chain branches, at the least, for what follows to be taken for fingers; and joints of
/// its own that make another chain another arm.
const FEW_JOINTS: usize = 3;
/// A slide of less travel at the end of an arm is a gripper's jaw, m. Assumed: the strokes of SCARA arms begin there.
const JAW_TRAVEL_M: f64 = 0.12;

/// Links that a user names.
#[derive(Clone, Copy, Default)]
pub(super) struct Ends<'a> {
    pub base: Option<&'a str>,
    pub tip: Option<&'a str>,
    pub camera: Option<&'a str>,
}

/// An arm in a URDF.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FoundArm {
    pub base: String,
    pub tip: String,
    /// `None` where no link of the chain is called a camera.
    pub camera: Option<String>,
}

/// One chain of joints.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Candidate {
    base: String,
    /// Numbers of the joints.
    joints: Vec<usize>,
    tip: String,
}

/// The arm of `urdf`.
///
/// # Errors
/// [`FileIssue`] where there is none, where there are several and no tip is named, or where a named link is missing.
pub(super) fn find_arm(urdf: &UrdfModel, ends: &Ends<'_>) -> Result<FoundArm, FileIssue> {
    for (option, link) in [("--base", ends.base), ("--tip", ends.tip), ("--camera-link", ends.camera)] {
        if let Some(link) = link.filter(|link| !urdf.has_link(link)) {
            let ends = leaves(urdf).take(20).collect::<Vec<_>>().join(", ");
            let problem = format!("`{link}` is not a link of the URDF; some that are: {ends}");
            return Err(FileIssue::new(Code::ValueInvalid, &urdf.file, option, problem));
        }
    }
    let mut candidates: Vec<Candidate> = match ends.tip {
        Some(tip) => candidate(urdf, tip, ends).into_iter().collect(),
        None => leaves(urdf).filter_map(|leaf| candidate(urdf, leaf, ends)).collect(),
    };
    candidates.sort_by_key(|candidate| std::cmp::Reverse(candidate.joints.len()));
    let Some(best) = candidates.first() else {
        let problem = match (ends.base, ends.tip) {
            (Some(base), Some(tip)) => {
                format!("no revolute, continuous or prismatic joint lies between `{base}` and `{tip}`")
            }
            _ => "no chain of revolute, continuous or prismatic joints was found".to_owned(),
        };
        return Err(FileIssue::new(Code::ValueInvalid, &urdf.file, "joint", problem));
    };
    let mut arms: Vec<&Candidate> = vec![best];
    for other in &candidates {
        let is_apart = |arm: &&Candidate| {
            let own = other.joints.iter().filter(|joint| !arm.joints.contains(joint)).count();
            own >= FEW_JOINTS && 2 * other.joints.len() >= best.joints.len()
        };
        if arms.iter().all(is_apart) {
            arms.push(other);
        }
    }
    if arms.len() > 1 {
        let each = arms.iter().map(|arm| format!("{} ({} joints)", arm.tip, arm.joints.len())).collect::<Vec<_>>();
        let problem = format!("{} arms end at {}: name one with --tip", arms.len(), each.join(", "));
        return Err(FileIssue::new(Code::ValueInvalid, &urdf.file, "joint", problem));
    }
    let camera = ends.camera.map(str::to_owned).or_else(|| camera_link(urdf, best));
    Ok(FoundArm { base: best.base.clone(), tip: best.tip.clone(), camera })
}

fn is_moving(urdf: &UrdfModel, joint: usize) -> bool {
    urdf.robot.joints[joint].joint_type != JointType::Fixed
}

/// Revolute, continuous or prismatic, and not driven by another joint.
fn is_of_arm(urdf: &UrdfModel, joint: usize) -> bool {
    let joint = &urdf.robot.joints[joint];
    let turns_or_slides =
        matches!(joint.joint_type, JointType::Revolute | JointType::Continuous | JointType::Prismatic);
    turns_or_slides && joint.mimic.is_none()
}

fn is_slide(urdf: &UrdfModel, joint: usize) -> bool {
    urdf.robot.joints[joint].joint_type == JointType::Prismatic
}

fn is_jaw(urdf: &UrdfModel, joint: usize) -> bool {
    let limit = &urdf.robot.joints[joint].limit;
    is_slide(urdf, joint) && limit.upper - limit.lower < JAW_TRAVEL_M
}

fn leaves(urdf: &UrdfModel) -> impl Iterator<Item = &str> {
    let is_leaf = |link: &&str| urdf.robot.joints.iter().all(|joint| joint.parent.link != **link);
    urdf.robot.links.iter().map(|link| link.name.as_str()).filter(is_leaf)
}

/// Joints from the root down to `link`.
fn path(urdf: &UrdfModel, link: &str) -> Vec<usize> {
    let mut path = Vec::new();
    let mut at = link;
    while let Some(&joint) = urdf.joint_of_child.get(at) {
        path.push(joint);
        at = &urdf.robot.joints[joint].parent.link;
    }
    path.reverse();
    path
}

/// The longest chain on the way from the root to `leaf`; to a leaf that was named, the last one.
fn candidate(urdf: &UrdfModel, leaf: &str, ends: &Ends<'_>) -> Option<Candidate> {
    let mut path = path(urdf, leaf);
    if let Some(base) = ends.base {
        let is_first = |joint: &usize| urdf.robot.joints[*joint].parent.link == base;
        let first = path.iter().position(is_first)?;
        path.drain(..first);
    }
    let root = path.first().map(|joint| urdf.robot.joints[*joint].parent.link.clone())?;
    // Cut at joints that are no joints of an arm.
    let mut pieces = vec![(root.clone(), Vec::new())];
    for &joint in &path {
        if is_of_arm(urdf, joint) {
            pieces.last_mut()?.1.push(joint);
        } else if is_moving(urdf, joint) {
            pieces.push((urdf.robot.joints[joint].child.link.clone(), Vec::new()));
        }
    }
    let (mut base, mut joints) = match ends.tip {
        Some(_) => pieces.pop()?,
        None => pieces.into_iter().rev().max_by_key(|(_, joints)| joints.len())?,
    };
    if ends.base.is_none() && base == root && root == "world" {
        base.clone_from(&urdf.robot.joints[*path.first()?].child.link);
    }
    if ends.tip.is_none()
        && let Some(n) =
            (FEW_JOINTS..joints.len()).find(|n| branches_after(urdf, joints[n - 1]) && joints.len() <= 2 * n)
    {
        joints.truncate(n);
    }
    while ends.tip.is_none() && joints.len() > FEW_JOINTS && is_jaw(urdf, *joints.last()?) {
        joints.pop();
    }
    // What carries too long an arm on slides is not of the arm.
    while ends.base.is_none()
        && joints.len() > MAX_JOINTS
        && let Some(slide) = joints.iter().position(|joint| is_slide(urdf, *joint))
    {
        base.clone_from(&urdf.robot.joints[joints[slide]].child.link);
        joints.drain(..=slide);
    }
    let last = *joints.last()?;
    let tip = ends.tip.map_or_else(|| deepest_fixed(urdf, &urdf.robot.joints[last].child.link), str::to_owned);
    Some(Candidate { base, joints, tip })
}

/// Links that are fixed to `link`, itself included, each with the number of joints between.
fn fixed_to<'a>(urdf: &'a UrdfModel, link: &'a str) -> Vec<(usize, &'a str)> {
    let mut found = vec![(0, link)];
    let mut at = 0;
    while let Some(&(depth, parent)) = found.get(at) {
        let fixed = urdf.robot.joints.iter().filter(|j| j.joint_type == JointType::Fixed && j.parent.link == parent);
        found.extend(fixed.map(|joint| (depth + 1, joint.child.link.as_str())));
        at += 1;
    }
    found
}

/// Whether several moving joints hang on what `joint` carries.
fn branches_after(urdf: &UrdfModel, joint: usize) -> bool {
    let carried = fixed_to(urdf, &urdf.robot.joints[joint].child.link);
    let hangs_there = |joint: &&urdf_rs::Joint| {
        joint.joint_type != JointType::Fixed && carried.iter().any(|(_, link)| *link == joint.parent.link)
    };
    urdf.robot.joints.iter().filter(hangs_there).count() > 1
}

/// The link farthest along fixed joints, no camera's where there is another.
fn deepest_fixed(urdf: &UrdfModel, link: &str) -> String {
    let found = fixed_to(urdf, link);
    let no_camera = found.iter().filter(|(_, name)| !is_camera(name));
    let deepest = no_camera.rev().max_by_key(|(depth, _)| *depth);
    deepest.map_or(link, |(_, name)| *name).to_owned()
}

fn is_camera(link: &str) -> bool {
    let name = link.to_lowercase();
    name.contains("camera") || name.contains("optical")
}

/// A link on the chain that is called a camera; one with an optical frame first, then the most distal.
fn camera_link(urdf: &UrdfModel, arm: &Candidate) -> Option<String> {
    let carried = arm.joints.iter().rev().flat_map(|joint| fixed_to(urdf, &urdf.robot.joints[*joint].child.link));
    let cameras: Vec<&str> = carried.map(|(_, name)| name).filter(|name| is_camera(name)).collect();
    let optical = cameras.iter().find(|name| name.to_lowercase().contains("optical"));
    optical.or(cameras.first()).map(|name| (*name).to_owned())
}
