//! Errors of the arm or its survey, and their remedies.

use crate::say::constants::repair::LEAST_FOCAL;
use crate::say::finding::{Finding, FindingKind};
use armcal_core::codes::{Code, Coded};
use armcal_core::robot::FailedKind;

/// A joint that failed, or whose sensor did.
#[derive(Clone, Copy, Debug)]
pub struct FailedJoint<'a> {
    /// Name of the joint in the URDF.
    pub joint: &'a str,
    /// Kind of the failure.
    pub kind: FailedKind,
    /// Evidence of the failure.
    pub evidence: &'a str,
    /// True if the sensor slipped and is calibrated as it is since the slip.
    pub slipped: bool,
    /// True if the joint is held at one angle because its sensor says nothing.
    pub held: bool,
}

/// An error of the arm or its survey that the result corrects.
#[derive(Clone, Debug)]
pub struct Repair {
    /// Code for scripts.
    pub code: Code,
    /// Cause of the error.
    pub cause: String,
    /// Advice to remove the cause.
    pub remedy: String,
    /// Statement of the value that the result uses; empty where the remedy states it.
    taken: &'static str,
}

impl Repair {
    /// Remedy, and the value that an accepted result uses until then.
    #[must_use]
    pub fn remedy_and_result(&self) -> String {
        let colon = if self.taken.is_empty() { "" } else { ": " };
        format!("{}{colon}{}", self.remedy, self.taken)
    }
}

/// Errors that a user can act on, joints first; `since`: end of the sentence of a slip.
#[must_use]
pub fn repairs(findings: &[Finding], failed: &[FailedJoint<'_>], since: &str) -> Vec<Repair> {
    let is_told = |found: &&Finding| {
        found.kind == FindingKind::SensorSlip && failed.iter().any(|failed| failed.joint == found.name)
    };
    let repaired = findings.iter().filter(|found| found.repaired && !is_told(found));
    let mut placed: Vec<(usize, &Finding)> =
        repaired.filter_map(|found| Some((REPAIRS.iter().position(|kind| *kind == found.kind)?, found))).collect();
    placed.sort_by_key(|(place, _)| *place);
    failed.iter().map(of_joint).chain(placed.into_iter().filter_map(|(_, found)| of_finding(found, since))).collect()
}

/// Findings that a user can act on, in the order in which they are reported.
const REPAIRS: [FindingKind; 12] = [
    FindingKind::SensorScale,
    FindingKind::SensorSlip,
    FindingKind::TagMoved,
    FindingKind::TagsMoved,
    FindingKind::TagSwapped,
    FindingKind::TagSize,
    FindingKind::TagLeftOut,
    FindingKind::LensModel,
    FindingKind::Lens,
    FindingKind::CameraMount,
    FindingKind::Base,
    FindingKind::Link,
];

fn of_finding(found: &Finding, since: &str) -> Option<Repair> {
    let name = &found.name;
    let (cause, remedy, taken) = match found.kind {
        FindingKind::SensorSlip => (
            format!("the sensor of {name} slipped{}{since}", by(found)),
            format!("fasten the sensor of {name}"),
            "the result holds for the sensor after the slip",
        ),
        FindingKind::SensorScale => (
            format!("the sensor of {name} has {:.3} times its scale in robot.toml", found.size.unwrap_or(1.0).recip()),
            format!("correct the scale of {name} in robot.toml, or of stated angles its factor in the input map"),
            "the result uses the estimated scale",
        ),
        FindingKind::TagMoved
        | FindingKind::TagsMoved
        | FindingKind::TagSwapped
        | FindingKind::TagSize
        | FindingKind::TagLeftOut => of_tags(found),
        FindingKind::Lens => (
            match found.size {
                Some(ratio) if ratio.abs() < LEAST_FOCAL => {
                    "centre or distortion of the lens differ from robot.toml".to_owned()
                }
                _ => format!("the focal length is {} than robot.toml says", differs(found, ["longer", "shorter"])),
            },
            "measure the intrinsics again".to_owned(),
            "the result uses the estimated lens",
        ),
        FindingKind::LensModel => (
            "the lens has another model than robot.toml says (equidistant or pinhole)".to_owned(),
            "set the other one as model in [camera] of robot.toml, with the intrinsics measured for it".to_owned(),
            "the result uses the estimated lens",
        ),
        FindingKind::Base => (
            format!("the arm's base is displaced from the survey{}", by(found)),
            "check the frame of the tag map and the position of the base; correct the wrong one".to_owned(),
            "",
        ),
        FindingKind::CameraMount => (
            format!("the {name} differs from the nominal model{}", by(found)),
            "correct the camera mount in robot.toml, or fasten the camera".to_owned(),
            "the result uses the estimate",
        ),
        FindingKind::Link => (
            format!("{name} differs from the URDF{}", by(found)),
            format!("correct {name} in the URDF"),
            "the result uses the estimate",
        ),
        _ => return None,
    };
    Some(Repair { code: found.code(), cause, remedy, taken })
}

/// Cause, remedy and effect on the result of tags that differ from the survey.
fn of_tags(found: &Finding) -> (String, String, &'static str) {
    let name = &found.name;
    match found.kind {
        FindingKind::TagMoved => (
            format!("tag {name} is {} from its surveyed position", size(found)),
            format!("fasten tag {name}, or correct the survey"),
            "the result uses the estimated position",
        ),
        FindingKind::TagsMoved => (
            format!("tags {name} are {} (median) from their surveyed positions", size(found)),
            format!("fasten tags {name}, or correct the survey"),
            "the result uses the estimated positions",
        ),
        FindingKind::TagSwapped => (
            format!("tags {name} are exchanged"),
            "correct their ids in the survey".to_owned(),
            "the result uses the estimated positions",
        ),
        FindingKind::TagSize if name == "all" => (
            format!("all tags are {} than the survey says", differs(found, ["larger", "smaller"])),
            "measure the side of one black square, and correct the survey".to_owned(),
            "the result uses the estimated size",
        ),
        FindingKind::TagSize => (
            format!("tag {name} is {} than the survey says", differs(found, ["larger", "smaller"])),
            "measure the side of its black square, and correct the survey".to_owned(),
            "the result uses the estimated size",
        ),
        _ => (
            format!("tag {name} is left out: none of its observations fits the other tags"),
            format!("check id, size and pose of tag {name} in the tag map"),
            "the result does without it",
        ),
    }
}

/// `25.0 % larger`.
fn differs(found: &Finding, [more, less]: [&str; 2]) -> String {
    let percent = 100.0 * found.size.unwrap_or(0.0);
    format!("{:.1} % {}", percent.abs(), if percent < 0.0 { less } else { more })
}

fn size(found: &Finding) -> String {
    found.size_in_words().unwrap_or_else(|| "away".to_owned())
}

/// ` by 1.74 deg`; empty where the finding has no size.
fn by(found: &Finding) -> String {
    found.size_in_words().map_or_else(String::new, |size| format!(" by {size}"))
}

fn of_joint(failed: &FailedJoint<'_>) -> Repair {
    let FailedJoint { joint, kind, evidence, slipped, .. } = *failed;
    let colon = if evidence.is_empty() { "" } else { ": " };
    let cause = match evidence.strip_prefix("the sensor ").filter(|_| slipped) {
        Some(slipped) => format!("the sensor of {joint} {slipped}"),
        None if kind.stands_still() => format!("{joint} {}{colon}{evidence}", kind.predicate()),
        None => format!("the sensor of {joint} {}{colon}{evidence}", kind.predicate()),
    };
    let code = if slipped { Code::SensorSlip } else { Code::SensorFailed };
    Repair { code, cause, remedy: failed.remedy(), taken: "" }
}

impl FailedJoint<'_> {
    /// Advice to remove the failure.
    #[must_use]
    pub fn remedy(&self) -> String {
        let joint = self.joint;
        match (self.kind, self.slipped) {
            (_, true) => format!("fasten the sensor of {joint}: the result holds since the slip"),
            _ if self.held => {
                format!("replace the sensor of {joint}; targets that need {joint} are out of reach while it is held")
            }
            (FailedKind::Locked, _) => format!("targets that need {joint} are out of reach; free it"),
            (FailedKind::NotMoved, _) => {
                format!("capture views that move {joint}; it is calibrated at this angle only")
            }
            _ => format!("check the sensor of {joint}, its shaft and its cable"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::say::finding::FindingUnit;

    fn failed(kind: FailedKind, evidence: &str) -> FailedJoint<'_> {
        FailedJoint { joint: "elbow", kind, evidence, slipped: false, held: false }
    }

    fn after_slip(evidence: &str) -> FailedJoint<'_> {
        FailedJoint { slipped: true, ..failed(FailedKind::Jumps, evidence) }
    }

    #[test]
    fn a_repair_says_cause_joint_and_remedy() {
        let told = [
            after_slip("the sensor slipped by 1.00 deg"),
            failed(FailedKind::Dead, "it follows nothing"),
            failed(FailedKind::Locked, ""),
        ];
        let told = told.map(|failed| of_joint(&failed)).map(|one| format!("{}\n  {}\n", one.cause, one.remedy));
        insta::assert_snapshot!("failed_joints", told.concat());
    }

    #[test]
    fn a_dead_sensor_of_a_held_joint_is_replaced_and_the_joint_not_freed() {
        let held = FailedJoint { held: true, ..failed(FailedKind::Dead, "the joint is held at 3.0 deg") };
        let [told, locked] = [held, failed(FailedKind::Locked, "")].map(|failed| of_joint(&failed));
        assert!(told.cause.contains("sensor") && !told.cause.contains("locked"), "{}", told.cause);
        assert!(!told.remedy.contains("free") && locked.remedy.contains("free"), "{}", told.remedy);
    }

    #[test]
    fn slips_since_the_earlier_calibration_come_before_moved_tags() {
        let finding = |kind, name: &str, size, unit| Finding {
            kind,
            name: name.to_owned(),
            size: Some(size),
            unit: Some(unit),
            tool_error_m: None,
            time_s: None,
            repaired: true,
        };
        let mut findings = vec![
            finding(FindingKind::TagMoved, "1", 0.0423, FindingUnit::Metre),
            finding(FindingKind::SensorSlip, "wrist_pitch", 0.0303, FindingUnit::Radian),
        ];
        let causes = |findings: &[Finding], failed: &[FailedJoint<'_>]| -> Vec<String> {
            repairs(findings, failed, " since the earlier calibration").into_iter().map(|one| one.cause).collect()
        };
        let slipped = causes(&findings, &[]);
        let others = [
            finding(FindingKind::Link, "forearm_link", 0.05, FindingUnit::Metre),
            finding(FindingKind::TagSize, "all", 0.25, FindingUnit::One),
            finding(FindingKind::TagSwapped, "0, 2 and 1", 0.0, FindingUnit::One),
            finding(FindingKind::TagLeftOut, "3", 12.0, FindingUnit::One),
            finding(FindingKind::Lens, "camera", 0.0002, FindingUnit::One),
            finding(FindingKind::Lens, "camera", -0.02, FindingUnit::One),
            finding(FindingKind::Sag, "base", 0.1, FindingUnit::RadianPerNewtonMetre),
        ];
        let others = causes(&others, &[]);
        // A joint that is already reported is not reported twice; an error that was not repaired belongs to a refusal.
        findings[1].name = "elbow".to_owned();
        findings[0].repaired = false;
        let told = after_slip("the sensor slipped by 1.74 deg");
        let once = causes(&findings, &[told]);
        assert_eq!([slipped.len(), others.len(), once.len()], [2, 6, 1]);
        insta::assert_snapshot!("repairs", [slipped, others, once].concat().join("\n"));
    }
}
