//! Warnings about a URDF, and the data that planning lacks in it.

use super::{MAX_COLLISION_SHAPES, UrdfChain};
use crate::codes::{Code, Warning};
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
    let told = groups.iter().take(MAX_WARNINGS).map(|(text, owners)| format!("{file}: {}: {text}", named(owners)));
    let more = (n_more > 0).then(|| format!("{file}: {n_more} further kinds of problems were skipped"));
    told.chain(more).map(|text| Warning::new(Code::UrdfSkipped, text)).collect()
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
