//! The arm in a URDF: its longest serial chain of revolute joints and slides, without a gripper's fingers.

use crate::codes::Code;

use super::error::{FileIssue, RobotError};
use super::urdf::UrdfModel;
use super::urdf_file::{JointType, Range, UrdfJoint};
use crate::joints::MAX_JOINTS;

/// Minimum number of joints before a branch of the chain for the following joints to count as fingers. Also the minimum
/// number of its own joints that makes another chain another arm.
const FEW_JOINTS: usize = 3;
/// Number of branches next to each other that only a hand has: a parallelogram has two rods.
const MANY_FINGERS: usize = 3;
/// Travel of a slide at the end of an arm below which it is a gripper's jaw, m. Assumed: the strokes of SCARA arms
/// begin there.
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
    /// Link that is called a camera; `None` if the chain has none.
    pub camera: Option<String>,
    /// Joints on the same path that were taken for those of a gripper or of the arm's carrier.
    pub left_out: Vec<String>,
    /// Joints among them that move in several ways, each with its type: no chain continues over them.
    pub cut_at: Vec<String>,
}

/// A chain of joints that may be the arm.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Candidate {
    base: String,
    /// Numbers of the joints.
    joints: Vec<usize>,
    tip: String,
    /// Numbers of the joints on the same path that are not the arm's.
    left_out: Vec<usize>,
}

/// Returns the arm of `urdf` between the links that the user names, as far as they are named.
///
/// # Errors
/// [`RobotError`] if there is none, if there are several and no tip is named, or if a named link is missing.
pub(super) fn find_arm(urdf: &UrdfModel, ends: &Ends<'_>) -> Result<FoundArm, RobotError> {
    check_named(urdf, ends)?;
    check_roots(urdf, ends)?;
    let mut candidates: Vec<Candidate> = match ends.tip {
        Some(tip) => candidate(urdf, tip, ends).into_iter().collect(),
        None => leaves(urdf).filter_map(|leaf| candidate(urdf, leaf, ends)).collect(),
    };
    candidates.sort_by_key(|candidate| std::cmp::Reverse(candidate.joints.len()));
    let best = single_arm(urdf, &candidates, ends)?;
    let camera = ends.camera.map(str::to_owned).or_else(|| camera_link(urdf, best));
    let left_out = best.left_out.iter().map(|&joint| urdf.robot.joints[joint].name.clone()).collect();
    let several = |&joint: &usize| match &urdf.robot.joints[joint] {
        UrdfJoint { name, joint_type: JointType::Other(kind), .. } => Some(format!("`{name}` ({kind})")),
        _ => None,
    };
    let cut_at = best.left_out.iter().filter_map(several).collect();
    Ok(FoundArm { base: best.base.clone(), tip: best.tip.clone(), camera, left_out, cut_at })
}

fn issue(urdf: &UrdfModel, key: &str, problem: String) -> RobotError {
    FileIssue::new(Code::ValueInvalid, &urdf.file, key, problem).into()
}

fn check_named(urdf: &UrdfModel, ends: &Ends<'_>) -> Result<(), RobotError> {
    for (option, link) in [("--base", ends.base), ("--tip", ends.tip), ("--camera-link", ends.camera)] {
        if let Some(link) = link.filter(|link| !urdf.has_link(link)) {
            let ends = leaves(urdf).take(20).collect::<Vec<_>>().join(", ");
            return Err(issue(urdf, option, format!("`{link}` is not a link of the URDF; some that are: {ends}")));
        }
    }
    if let (Some(base), Some(tip)) = (ends.base, ends.tip) {
        urdf.path(base, tip)?;
    }
    Ok(())
}

/// Requests an option if moving joints are on several trees: one of them may be a detached part of the other.
fn check_roots(urdf: &UrdfModel, ends: &Ends<'_>) -> Result<(), RobotError> {
    if ends.base.is_some() || ends.tip.is_some() {
        return Ok(());
    }
    let has_joints = |root: &&str| {
        let mut moving = urdf.robot.joints.iter().filter(|joint| joint.is_single());
        moving.any(|joint| root_of(urdf, &joint.parent) == *root)
    };
    let roots: Vec<&str> = urdf.roots().filter(has_joints).collect();
    if roots.len() < 2 {
        return Ok(());
    }
    let problem = format!(
        "{} separate trees of links have moving joints, from {}. Connect them by a joint, or name one with --base",
        roots.len(),
        roots.join(", ")
    );
    Err(issue(urdf, "link", problem))
}

fn root_of<'a>(urdf: &'a UrdfModel, link: &'a str) -> &'a str {
    path(urdf, link).first().map_or(link, |joint| urdf.robot.joints[*joint].parent.as_str())
}

/// Returns the longest candidate, if no other one is an arm of its own.
fn single_arm<'a>(urdf: &UrdfModel, candidates: &'a [Candidate], ends: &Ends<'_>) -> Result<&'a Candidate, RobotError> {
    let Some(best) = candidates.first() else {
        let problem = match (ends.base, ends.tip) {
            (Some(base), Some(tip)) => {
                format!("no revolute, continuous or prismatic joint lies between `{base}` and `{tip}`")
            }
            (Some(base), None) => format!("no revolute, continuous or prismatic joint is carried by `{base}`"),
            (None, Some(tip)) => format!("no revolute, continuous or prismatic joint carries `{tip}`"),
            (None, None) => "no chain of revolute, continuous or prismatic joints was found".to_owned(),
        };
        let other = urdf.robot.joints.iter().find_map(|joint| match &joint.joint_type {
            JointType::Other(of) => Some(format!("{problem}; joint `{}` is of the type {of:?}", joint.name)),
            _ => None,
        });
        let problem = other.unwrap_or(problem);
        return Err(issue(urdf, "joint", problem));
    };
    let mut arms: Vec<&Candidate> = vec![best];
    for other in candidates {
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
        return Err(issue(urdf, "joint", problem));
    }
    Ok(best)
}

fn is_slide(urdf: &UrdfModel, joint: usize) -> bool {
    urdf.robot.joints[joint].joint_type == JointType::Prismatic
}

fn is_jaw(urdf: &UrdfModel, joint: usize) -> bool {
    let is_short = match &urdf.robot.joints[joint].range {
        Range::Limits(limits) => limits.upper_rad - limits.lower_rad < JAW_TRAVEL_M,
        Range::Endless | Range::Unlimited(_) | Range::Unknown(_) => false,
    };
    is_slide(urdf, joint) && is_short
}

fn leaves(urdf: &UrdfModel) -> impl Iterator<Item = &str> {
    let is_leaf = |link: &&str| urdf.robot.joints.iter().all(|joint| joint.parent != **link);
    urdf.robot.links.iter().map(|link| link.name.as_str()).filter(is_leaf)
}

/// Joints from the root down to `link`.
fn path(urdf: &UrdfModel, link: &str) -> Vec<usize> {
    let mut path = Vec::new();
    let mut at = link;
    while let Some(&joint) = urdf.joint_of_child.get(at) {
        path.push(joint);
        at = &urdf.robot.joints[joint].parent;
    }
    path.reverse();
    path
}

/// Returns the longest chain on the path from the root to `leaf`. It is the last one to a named leaf, or the first one
/// from a named base.
fn candidate(urdf: &UrdfModel, leaf: &str, ends: &Ends<'_>) -> Option<Candidate> {
    let mut path = path(urdf, leaf);
    if let Some(base) = ends.base {
        let is_first = |joint: &usize| urdf.robot.joints[*joint].parent == base;
        let first = path.iter().position(is_first)?;
        path.drain(..first);
    }
    let root = path.first().map(|joint| urdf.robot.joints[*joint].parent.clone())?;
    let (mut base, mut joints) = piece(urdf, &path, root.clone(), ends)?;
    let first = &urdf.robot.joints[*path.first()?];
    if ends.base.is_none() && base == root && root == "world" && first.is_fixed() {
        base.clone_from(&first.child);
    }
    if ends.tip.is_none() {
        if let Some(n) = (FEW_JOINTS..joints.len()).find(|n| is_hand_after(urdf, &joints, *n)) {
            joints.truncate(n);
        }
        while joints.len() > FEW_JOINTS && is_jaw(urdf, *joints.last()?) {
            joints.pop();
        }
    }
    // Slides that carry too long an arm do not belong to the arm.
    while ends.base.is_none()
        && joints.len() > MAX_JOINTS
        && let Some(slide) = joints.iter().position(|joint| is_slide(urdf, *joint))
    {
        base.clone_from(&urdf.robot.joints[joints[slide]].child);
        joints.drain(..=slide);
    }
    let last = *joints.last()?;
    let tip = ends.tip.map_or_else(|| deepest_fixed(urdf, &urdf.robot.joints[last].child), str::to_owned);
    let is_left_out = |joint: &usize| !urdf.robot.joints[*joint].is_fixed() && !joints.contains(joint);
    let left_out = path.iter().copied().filter(is_left_out).collect();
    Some(Candidate { base, joints, tip, left_out })
}

/// Cuts the path at joints of several degrees of freedom and returns the base and the joints of one piece. Between two
/// named links nothing is cut, so that such a joint is refused.
fn piece(urdf: &UrdfModel, path: &[usize], root: String, ends: &Ends<'_>) -> Option<(String, Vec<usize>)> {
    let mut pieces = vec![(root, Vec::new())];
    for &joint in path {
        let of_urdf = &urdf.robot.joints[joint];
        let is_whole = ends.base.is_some() && ends.tip.is_some();
        if of_urdf.is_single() || (is_whole && !of_urdf.is_fixed()) {
            pieces.last_mut()?.1.push(joint);
        } else if !of_urdf.is_fixed() {
            pieces.push((of_urdf.child.clone(), Vec::new()));
        }
    }
    match (ends.base, ends.tip) {
        (Some(_), _) => pieces.into_iter().next(),
        (None, Some(_)) => pieces.pop(),
        (None, None) => pieces.into_iter().rev().max_by_key(|(_, joints)| joints.len()),
    }
}

/// Links that are fixed to `link`, including itself, each with the number of joints between.
fn fixed_to<'a>(urdf: &'a UrdfModel, link: &'a str) -> Vec<(usize, &'a str)> {
    let mut found = vec![(0, link)];
    let mut at = 0;
    while let Some(&(depth, parent)) = found.get(at) {
        let is_held = |joint: &&UrdfJoint| joint.is_fixed() && joint.parent == parent && joint.defects.is_empty();
        found.extend(urdf.robot.joints.iter().filter(is_held).map(|joint| (depth + 1, joint.child.as_str())));
        at += 1;
    }
    found
}

/// Returns true if the first `n` joints carry a hand: joints of similar number next to those that follow. A short
/// branch next to a longer chain is a balancer or a cable guide; so is one that follows a joint of the arm.
fn is_hand_after(urdf: &UrdfModel, joints: &[usize], n: usize) -> bool {
    let n_following = joints.len() - n;
    if n_following > n {
        return false;
    }
    let carried = fixed_to(urdf, &urdf.robot.joints[joints[n - 1]].child);
    let of_arm = |name: &str| joints[..n].iter().any(|joint| urdf.robot.joints[*joint].name == name);
    let is_finger = |&joint: &usize| {
        let of_urdf = &urdf.robot.joints[joint];
        let follows_arm = of_urdf.mimic.as_ref().is_some_and(|leader| of_arm(leader));
        joint != joints[n] && !follows_arm && carried.iter().any(|(_, link)| *link == of_urdf.parent)
    };
    let moving = (0..urdf.robot.joints.len()).filter(|&joint| !urdf.robot.joints[joint].is_fixed());
    let lengths: Vec<usize> = moving.filter(is_finger).map(|joint| n_joints_from(urdf, joint)).collect();
    let Some(&longest) = lengths.iter().max() else { return false };
    if lengths.len() >= MANY_FINGERS {
        return true;
    }
    // Fingers of one hand differ by a joint at most.
    longest >= n_following || (longest + 1 == n_following && (longest > 1 || lengths.len() > 1))
}

/// Returns the largest number of moving joints on a path from `joint` on, including itself.
fn n_joints_from(urdf: &UrdfModel, joint: usize) -> usize {
    let mut most = 0;
    let mut open = vec![(joint, 0)];
    while let Some((at, before)) = open.pop() {
        let of_urdf = &urdf.robot.joints[at];
        let n = before + usize::from(!of_urdf.is_fixed());
        most = most.max(n);
        let next = urdf.robot.joints.iter().enumerate().filter(|(next, joint)| {
            joint.parent == of_urdf.child && urdf.joint_of_child.get(&joint.child) == Some(next)
        });
        open.extend(next.map(|(next, _)| (next, n)));
    }
    most
}

/// Returns the link farthest along fixed joints, preferably not a camera's.
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

/// Returns a link on the chain that is called a camera: preferably one with an optical frame, then the most distal.
fn camera_link(urdf: &UrdfModel, arm: &Candidate) -> Option<String> {
    let carried = arm.joints.iter().rev().flat_map(|joint| fixed_to(urdf, &urdf.robot.joints[*joint].child));
    let cameras: Vec<&str> = carried.map(|(_, name)| name).filter(|name| is_camera(name)).collect();
    let optical = cameras.iter().find(|name| name.to_lowercase().contains("optical"));
    optical.or(cameras.first()).map(|name| (*name).to_owned())
}
