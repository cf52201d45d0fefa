//! Joints of a URDF.

use nalgebra::Vector3;

use super::scan::{Scan, UrdfPose};
use crate::kinematics::JointLimits;
use crate::robot::xml_tree::Place;

/// Range above which a revolute joint counts as continuous, rad: 20 turns. Cables limit an arm's joint to about 4
/// turns; files write 999999 or 1e16 for a joint without stops.
const MAX_RANGE_RAD: f64 = 20.0 * std::f64::consts::TAU;
/// Range above which a slide counts as one without limits, m. The longest gantries have about 100 m.
const MAX_RANGE_M: f64 = 1000.0;
/// Smallest length of an axis that has a direction.
const MIN_AXIS: f64 = 1e-6;
/// Known elements of a joint.
const KNOWN: [&str; 10] =
    ["parent", "child", "origin", "axis", "limit", "mimic", "dynamics", "calibration", "safety_controller", "safety"];
/// Largest effort, N m or N.
const MAX_EFFORT: f64 = 1e7;

/// Kind of motion that a joint allows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JointType {
    Fixed,
    Revolute,
    Continuous,
    Prismatic,
    /// A type with more than one degree of freedom, or an unknown type.
    Other(String),
}

/// A wrong value that kinematics need.
#[derive(Clone, Debug)]
pub struct Defect {
    pub place: Place,
    /// Name of the element.
    pub key: &'static str,
    /// End of a sentence that begins with the element.
    pub problem: String,
}

/// Range of a joint as the file has it.
#[derive(Clone, Debug)]
pub enum Range {
    Limits(JointLimits),
    /// Unlimited motion by the joint's type.
    Endless,
    /// Limits with a larger range than that of any joint: lower and upper.
    Unlimited([f64; 2]),
    /// The file states no range, or an empty one; the text is the reason.
    Unknown(String),
}

/// A joint.
#[derive(Clone, Debug)]
pub struct UrdfJoint {
    pub name: String,
    pub place: Place,
    pub joint_type: JointType,
    pub parent: String,
    pub child: String,
    pub origin: UrdfPose,
    /// Axis of the joint; it has a direction unless `defects` states otherwise.
    pub axis: [f64; 3],
    pub range: Range,
    /// Effort; 0 if the file states none.
    pub effort: f64,
    /// Velocity; 0 if the file states none.
    pub velocity: f64,
    /// Name of the joint that this one follows.
    pub mimic: Option<String>,
    pub defects: Vec<Defect>,
}

impl UrdfJoint {
    pub fn is_fixed(&self) -> bool {
        self.joint_type == JointType::Fixed
    }

    /// Returns true for the types that a chain may have.
    pub fn is_single(&self) -> bool {
        matches!(self.joint_type, JointType::Revolute | JointType::Continuous | JointType::Prismatic)
    }
}

/// Reads one `<joint>`.
///
/// # Errors
/// A sentence with line and column if the joint does not name its links.
pub(super) fn read_joint(scan: &mut Scan<'_>, at: usize) -> Result<UrdfJoint, String> {
    let element = scan.element(at);
    let mut defects = Vec::new();
    let place = element.place;
    let mut defect =
        |key: &'static str, problem: &str| defects.push(Defect { place, key, problem: problem.to_owned() });
    let name = element.attribute("name").unwrap_or_default().to_owned();
    if name.is_empty() {
        defect("name", "is missing");
    }
    let joint_type = match element.attribute("type").unwrap_or_default() {
        "fixed" => JointType::Fixed,
        "revolute" => JointType::Revolute,
        "continuous" => JointType::Continuous,
        "prismatic" => JointType::Prismatic,
        "" => JointType::Other("without a type".to_owned()),
        other => JointType::Other(other.to_owned()),
    };
    let owner = format!("joint `{name}`");
    scan.skip_unknown(&owner, at, &KNOWN);
    let [parent, child] = ["parent", "child"].map(|end| link_name(scan, &owner, at, end));
    let origin = origin(scan, &owner, at, &mut defects);
    let axis = axis(scan, &owner, at, &joint_type, &mut defects);
    let limit = scan.only(&owner, at, "limit");
    let [velocity, effort] = ["velocity", "effort"].map(|key| figure(scan, &owner, limit, key, &joint_type));
    let range = range(scan, limit, &joint_type);
    note_range(scan, &owner, limit.unwrap_or(at), &range, &joint_type);
    let mimic = scan.only(&owner, at, "mimic");
    let mimic = mimic.map(|mimic| scan.element(mimic).attribute("joint").unwrap_or_default().to_owned());
    let (parent, child) = (parent?, child?);
    Ok(UrdfJoint { name, place, joint_type, parent, child, origin, axis, range, effort, velocity, mimic, defects })
}

fn link_name(scan: &mut Scan<'_>, owner: &str, at: usize, end: &str) -> Result<String, String> {
    let link = scan.only(owner, at, end).and_then(|at| scan.element(at).attribute("link"));
    let place = scan.element(at).place;
    link.map(str::to_owned).ok_or_else(|| format!("{place}: {owner} names no {end} link; add <{end} link=\"..\"/>"))
}

fn origin(scan: &mut Scan<'_>, owner: &str, at: usize, defects: &mut Vec<Defect>) -> UrdfPose {
    let Some(origin) = scan.only(owner, at, "origin") else { return UrdfPose::default() };
    if scan.element(origin).attribute("xyz").is_none() {
        scan.skip(owner, origin, "the origin has no xyz; 0 0 0 is used, as URDF has it".to_owned());
    }
    scan.pose(origin).unwrap_or_else(|problem| {
        defects.push(Defect { place: scan.element(origin).place, key: "origin", problem });
        UrdfPose::default()
    })
}

fn axis(scan: &mut Scan<'_>, owner: &str, at: usize, joint_type: &JointType, defects: &mut Vec<Defect>) -> [f64; 3] {
    const USUAL: [f64; 3] = [1.0, 0.0, 0.0];
    let Some(axis) = scan.only(owner, at, "axis") else { return USUAL };
    let found = scan.numbers::<3>(axis, "xyz");
    if found == Ok(None) {
        scan.skip(owner, axis, "the axis has no xyz; 1 0 0 is used, as URDF has it".to_owned());
    }
    let problem = match found {
        Ok(None) => return USUAL,
        Ok(Some(xyz)) if xyz.iter().any(|value| !value.is_finite()) => format!("{xyz:?} is not finite"),
        Ok(Some(xyz)) if Vector3::from(xyz).norm() < MIN_AXIS => {
            let [x, y, z] = xyz;
            format!("`{x} {y} {z}` has no direction; write the axis that the joint turns about or slides along")
        }
        Ok(Some(xyz)) => return xyz,
        Err(problem) => problem,
    };
    if *joint_type != JointType::Fixed {
        defects.push(Defect { place: scan.element(axis).place, key: "axis", problem });
    }
    USUAL
}

/// Returns velocity or effort of a joint that moves; 0 if the file states no usable one.
fn figure(scan: &mut Scan<'_>, owner: &str, limit: Option<usize>, key: &str, joint_type: &JointType) -> f64 {
    let (Some(limit), false) = (limit, *joint_type == JointType::Fixed) else { return 0.0 };
    let problem = match scan.number(limit, key) {
        Ok(Some(value)) if (0.0..=MAX_EFFORT).contains(&value) => return value,
        // Such a value means no limit.
        Ok(Some(value)) if value > MAX_EFFORT => return 0.0,
        Ok(Some(value)) => format!("the limit's {key} is {value}, and it must be 0 or more; it is ignored"),
        Ok(None) => format!("the limit has no {key}; calibration does not use it"),
        Err(problem) => format!("the limit's {problem}; it is ignored"),
    };
    scan.skip(owner, limit, problem);
    0.0
}

fn range(scan: &Scan<'_>, limit: Option<usize>, joint_type: &JointType) -> Range {
    let longest = match joint_type {
        JointType::Revolute => MAX_RANGE_RAD,
        JointType::Prismatic => MAX_RANGE_M,
        JointType::Fixed | JointType::Continuous | JointType::Other(_) => return Range::Endless,
    };
    let Some(limit) = limit else { return Range::Unknown("there is no <limit>".to_owned()) };
    let [lower, upper] = ["lower", "upper"].map(|key| scan.number(limit, key));
    let (lower, upper) = match (lower, upper) {
        (Ok(None), Ok(None)) => return Range::Unknown("the limit has neither lower nor upper".to_owned()),
        // An absent limit is 0, as in URDF.
        (Ok(lower), Ok(upper)) => (lower.unwrap_or(0.0), upper.unwrap_or(0.0)),
        (Err(problem), _) | (_, Err(problem)) => return Range::Unknown(format!("the limit's {problem}")),
    };
    if lower.is_nan() || upper.is_nan() || lower >= upper {
        return Range::Unknown(format!("the limit's lower {lower} is not below upper {upper}"));
    }
    if upper - lower > longest {
        return Range::Unlimited([lower, upper]);
    }
    Range::Limits(JointLimits { lower_rad: lower, upper_rad: upper })
}

fn note_range(scan: &mut Scan<'_>, owner: &str, at: usize, range: &Range, joint_type: &JointType) {
    let text = match (range, joint_type) {
        (Range::Unknown(why), JointType::Prismatic) => {
            format!("{why}; the slide is used without limits. Write lower and upper in m")
        }
        (Range::Unknown(why), _) => {
            format!("{why}; the joint is used as continuous. Write lower and upper in rad; `run` and `plan` need them")
        }
        (Range::Unlimited([lower, upper]), JointType::Prismatic) => {
            format!("limits of {lower:?} and {upper:?} m mean none: the slide is used without limits")
        }
        (Range::Unlimited([lower, upper]), _) => format!(
            "limits of {lower:?} and {upper:?} rad are more than 20 turns apart: the joint is used as continuous. \
             Write limits that are in degrees in rad"
        ),
        _ => return,
    };
    scan.skip(owner, at, text);
}
