//! Warnings about a URDF, and the data that planning lacks in it.

use super::{MAX_COLLISION_SHAPES, UrdfChain};
use crate::codes::{Code, Warning};
use crate::kinematics::ChainJoint;
use crate::robot::error::FileIssue;
use crate::robot::urdf_file::{Range, Skipped, UrdfJoint};

/// Maximum number of links or joints that one warning names.
const MAX_NAMED: usize = 8;
/// Maximum number of warnings about one file.
const MAX_WARNINGS: usize = 40;

/// Returns one warning per problem, each with the links or joints that have it.
pub fn warnings(arm: &UrdfChain<'_>) -> Vec<Warning> {
    let mut groups: Vec<(&str, Vec<&Skipped>)> = Vec::new();
    let off_chain = defects_off_chain(arm);
    for skipped in arm.urdf.robot.skipped.iter().chain(&off_chain) {
        match groups.iter_mut().find(|(text, _)| *text == skipped.text) {
            Some((_, owners)) => owners.push(skipped),
            None => groups.push((&skipped.text, vec![skipped])),
        }
    }
    let n_more = groups.len().saturating_sub(MAX_WARNINGS);
    let file = arm.urdf.file.file_name().unwrap_or_default().to_string_lossy();
    let unshaped = unshaped_warning(arm, &file);
    let told = groups.iter().take(MAX_WARNINGS).map(|(text, owners)| format!("{file}: {}: {text}", named(owners)));
    let more = (n_more > 0).then(|| format!("{file}: {n_more} further kinds of problems were skipped"));
    told.chain(more).chain(unshaped).map(|text| Warning::new(Code::UrdfSkipped, text)).collect()
}

/// Returns a warning about moving links that are drawn and have no collision shape, where others have one.
fn unshaped_warning(arm: &UrdfChain<'_>, file: &str) -> Option<String> {
    let moving = MovingLinks::of(arm);
    let unshaped = moving.unshaped();
    if unshaped.is_empty() || moving.are_all_unshaped() {
        return None;
    }
    let names = unshaped.iter().take(MAX_NAMED).map(|link| format!("`{link}`")).collect::<Vec<_>>().join(", ");
    let more = unshaped.len().saturating_sub(MAX_NAMED);
    let more = if more == 0 { String::new() } else { format!(" and {more} more") };
    Some(format!(
        "{file}: links {names}{more}: they have a <visual> and no <collision>, so nothing keeps paths clear of them. \
         Draw boxes, cylinders or spheres, or name meshes"
    ))
}

/// Links that the joints of the chain move, each with all that is fixed to it.
struct MovingLinks<'a> {
    links: Vec<MovingLink<'a>>,
}

struct MovingLink<'a> {
    name: &'a str,
    is_drawn: bool,
    has_shape: bool,
}

impl<'a> MovingLinks<'a> {
    fn of(arm: &'a UrdfChain<'_>) -> Self {
        let moved = |joint: &'a ChainJoint| MovingLink { name: &joint.child_link, is_drawn: false, has_shape: false };
        let mut links: Vec<MovingLink<'a>> = arm.chain.joints().iter().map(moved).collect();
        for link in arm.links() {
            let body = arm.attachment(&link.name).ok().and_then(|attachment| attachment.n_joints.checked_sub(1));
            let Some(body) = body.and_then(|body| links.get_mut(body)) else { continue };
            body.is_drawn |= !link.visual.is_empty();
            body.has_shape |= !link.collision.is_empty() || link.lost.is_some();
        }
        Self { links }
    }

    /// Returns the names of those that are drawn and have no collision shape.
    fn unshaped(&self) -> Vec<&'a str> {
        let is_unshaped = |link: &&MovingLink<'a>| link.is_drawn && !link.has_shape;
        self.links.iter().filter(is_unshaped).map(|link| link.name).collect()
    }

    /// True if none of them has a collision shape.
    fn are_all_unshaped(&self) -> bool {
        self.links.iter().all(|link| !link.has_shape)
    }
}

fn named(owners: &[&Skipped]) -> String {
    let each = owners.iter().take(MAX_NAMED).map(|skipped| format!("{} ({})", skipped.owner, skipped.place));
    let each = each.collect::<Vec<_>>().join(", ");
    match owners.len().saturating_sub(MAX_NAMED) {
        0 => each,
        n_more => format!("{each} and {n_more} more"),
    }
}

/// Returns the wrong values of joints that are not on the arm's chain.
fn defects_off_chain(arm: &UrdfChain<'_>) -> Vec<Skipped> {
    let is_on_chain = |joint: &&UrdfJoint| arm.chain.joints().iter().any(|other| other.name == joint.name);
    let joints = arm.urdf.robot.joints.iter().filter(|joint| !is_on_chain(joint));
    let defects = joints.flat_map(|joint| joint.defects.iter().map(move |defect| (joint, defect)));
    let skipped = defects.map(|(joint, defect)| Skipped {
        owner: format!("joint `{}`", joint.name),
        place: defect.place,
        text: format!("the {} is unusable: {}. The joint is not on the chain: skipped", defect.key, defect.problem),
    });
    skipped.collect()
}

/// Returns the data that planning needs of the URDF and cannot use.
pub fn planning_issues(arm: &UrdfChain<'_>) -> Vec<FileIssue> {
    let file = &arm.urdf.file;
    let mut issues = Vec::new();
    for joint in arm.chain.joints() {
        if let Some(Range::Unknown(why)) = arm.urdf.joint(&joint.name).map(|joint| &joint.range) {
            let problem = format!("{why}; planning must know where the joint ends. Write lower below upper");
            issues.push(FileIssue::new(Code::ValueInvalid, file, format!("joint `{}`: limit", joint.name), problem));
        }
    }
    for link in arm.links() {
        if let Some(why) = &link.lost {
            let problem = format!("{why}; nothing would keep paths clear of it. Correct the shape");
            issues.push(FileIssue::new(Code::ValueInvalid, file, format!("link `{}`: collision", link.name), problem));
        }
    }
    for joint in arm.urdf.robot.joints.iter().filter(|joint| joint.is_fixed()) {
        let Some(defect) = joint.defects.first().filter(|_| arm.attachment(&joint.parent).is_ok()) else { continue };
        let key = format!("joint `{}`: {}", joint.name, defect.key);
        let problem = format!("{}; nothing would keep paths clear of the link that it holds", defect.problem);
        issues.push(FileIssue::new(Code::ValueInvalid, file, key, problem));
    }
    let n_shapes = arm.n_primitives();
    if n_shapes > MAX_COLLISION_SHAPES {
        let problem = format!(
            "{n_shapes} shapes are on the chain, and planning takes {MAX_COLLISION_SHAPES} at most, so all are left \
             out. Draw fewer, larger shapes"
        );
        issues.push(FileIssue::new(Code::ValueCount, file, "collision", problem));
    }
    issues
}

/// Returns the issue of an arm none of whose moving links has a collision shape: any path would count as clear.
pub fn unshaped_issue(arm: &UrdfChain<'_>) -> Option<FileIssue> {
    let problem = "none that the joints move has a <collision>, so no clearance can be certified. Draw boxes, \
                   cylinders or spheres for them, or name meshes";
    let is_unshaped = MovingLinks::of(arm).are_all_unshaped();
    is_unshaped.then(|| FileIssue::new(Code::KeyMissing, &arm.urdf.file, "links", problem))
}
