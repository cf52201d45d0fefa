//! May the result be used, why, and what to do next: the same words for report.html, the replay and the terminal.

use crate::report::summary::{Condition, RunSummary, VerdictSummary};
use armcal_belief::calib::{
    FailedJointTable, Finding, FindingKind, PriorTable, Refusal, Reservation, Status, with_advice,
};
use armcal_belief::judge::RULE;
use armcal_core::codes::{Code, Coded};
use armcal_core::robot::FailedKind;

/// How a verdict reads at a glance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grade {
    Green,
    Amber,
    Red,
}

impl Grade {
    /// As summary.json has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Green | Self::Amber => self.class(),
            Self::Red => "refused",
        }
    }

    /// The class of a page's box.
    pub fn class(self) -> &'static str {
        match self {
            Self::Green => "green",
            Self::Amber => "amber",
            Self::Red => "red",
        }
    }
}

pub(super) struct Verdict {
    pub grade: Grade,
    pub headline: &'static str,
    pub reasons: Vec<String>,
    pub next: Vec<String>,
    /// Codes of the reasons, in their order; some have none.
    pub codes: Vec<Code>,
}

/// Of a run, or of a calibration alone.
pub(super) fn verdict(summary: &RunSummary) -> Verdict {
    if summary.status == Status::Refused {
        let mut reasons: Vec<String> = summary.refusals.iter().map(|refusal| sentence(&refusal.cause())).collect();
        let mut next: Vec<String> = Vec::new();
        let beside = beside_refusal(summary);
        reasons.extend(beside.iter().map(|repair| sentence(&repair.cause)));
        let remedies = with_advice(&summary.refusals).iter().map(|refusal| sentence(&refusal.remedy()));
        for remedy in remedies.chain(beside.iter().map(|repair| sentence(&repair.remedy))) {
            if !next.contains(&remedy) {
                next.push(remedy);
            }
        }
        next.push("Keep the previous sensor parameters, and calibrate again.".to_owned());
        let codes = summary.refusals.iter().map(Coded::code).chain(beside.iter().map(|repair| repair.code)).collect();
        return Verdict { grade: Grade::Red, headline: "REFUSED: do not use this calibration", reasons, next, codes };
    }
    let repairs = repairs(summary);
    let mut reasons: Vec<String> = repairs.iter().map(|repair| sentence(&repair.cause)).collect();
    reasons.extend(attention(summary));
    let contradicted =
        summary.calibration.prior.as_ref().filter(|prior| !prior.agrees).map(|_| Code::PriorContradicted);
    let without_task = summary.calibration.u95.tolerance_m.is_none().then_some(Code::TaskMissing);
    let is_beyond = summary.calibration.verdict.as_ref().is_some_and(|verdict| !verdict.not_covered.is_empty());
    let not_covered = is_beyond.then_some(Code::NotCovered);
    let of_repairs = repairs.iter().map(|repair| repair.code);
    let not_included = (!summary.calibration.u95.not_included.is_empty()).then_some(Code::NotIncluded);
    let codes = of_repairs.chain(without_task).chain(contradicted).chain(not_covered).chain(not_included).collect();
    let load = "Load calibration.toml, or export it for the arm's driver (armcal export).".to_owned();
    if reasons.is_empty() {
        return Verdict { grade: Grade::Green, headline: "ACCEPTED: use it", reasons, next: vec![load], codes };
    }
    let mut next: Vec<String> = repairs.iter().map(|repair| sentence(&repair.remedy_and_result())).collect();
    next.extend([load, "Review each point above before you rely on the result.".to_owned()]);
    Verdict { grade: Grade::Amber, headline: "ACCEPTED, with points to look at", reasons, next, codes }
}

impl RunSummary {
    /// States the verdict, once all else is known.
    #[must_use]
    pub fn judged(mut self) -> Self {
        let found = verdict(&self);
        let (grade, codes) = (found.grade.name().to_owned(), found.codes);
        let calibration = &self.calibration;
        let condition = |reservation: &Reservation| Condition {
            code: reservation.code(),
            what: reservation.what.clone(),
            std: reservation.prior_std,
            unit: reservation.unit,
            tool_error_m: reservation.tool_error_m,
            included: reservation.included,
        };
        self.verdict = VerdictSummary {
            grade,
            codes,
            rule: RULE.to_owned(),
            tolerance_m: calibration.u95.tolerance_m,
            p_beyond_tolerance: calibration.u95.p_beyond_tolerance,
            conditions: calibration.reservations.iter().map(condition).collect(),
        };
        self
    }
}

/// What was wrong with the arm or its survey, and is taken as it was found.
pub(super) struct Repair {
    pub code: Code,
    pub cause: String,
    /// What to do.
    pub remedy: String,
    /// What the result has in its place; empty where the remedy says it.
    taken: &'static str,
}

impl Repair {
    /// What to do, and what an accepted result has meanwhile.
    pub fn remedy_and_result(&self) -> String {
        let colon = if self.taken.is_empty() { "" } else { ": " };
        format!("{}{colon}{}", self.remedy, self.taken)
    }
}

/// Of this result.
pub(super) fn repairs(summary: &RunSummary) -> Vec<Repair> {
    let calibration = &summary.calibration;
    let since = if calibration.prior.is_some() { " since the earlier calibration" } else { "" };
    repairs_of(&calibration.findings, &calibration.failed_joint, since)
}

/// What survey, lens and drawing have wrong, where a calibration is refused for its accuracy alone: the cause of that,
/// as likely as not.
pub(super) fn beside_refusal(summary: &RunSummary) -> Vec<Repair> {
    let is_of_accuracy =
        |refusal: &Refusal| matches!(refusal, Refusal::BeyondTolerance { .. } | Refusal::PriorsBeyondTolerance { .. });
    if !summary.refusals.iter().all(is_of_accuracy) {
        return Vec::new();
    }
    let mut found = repairs_of(&summary.calibration.findings, &[], "");
    found.truncate(MAX_BESIDE);
    found
}

/// Of what is said beside a refusal.
const MAX_BESIDE: usize = 3;

/// Joints first.
fn repairs_of(findings: &[Finding], failed: &[FailedJointTable], since: &str) -> Vec<Repair> {
    let is_told = |found: &&Finding| {
        found.kind == FindingKind::SensorSlip && failed.iter().any(|failed| failed.joint == found.name)
    };
    let repaired = findings.iter().filter(|found| found.repaired && !is_told(found));
    let mut placed: Vec<(usize, &Finding)> =
        repaired.filter_map(|found| Some((REPAIRS.iter().position(|kind| *kind == found.kind)?, found))).collect();
    placed.sort_by_key(|(place, _)| *place);
    failed.iter().map(of_joint).chain(placed.into_iter().filter_map(|(_, found)| of_finding(found, since))).collect()
}

/// Findings that a user can act on, in the order in which they are told.
const REPAIRS: [FindingKind; 11] = [
    FindingKind::SensorScale,
    FindingKind::SensorSlip,
    FindingKind::TagMoved,
    FindingKind::TagsMoved,
    FindingKind::TagSwapped,
    FindingKind::TagSize,
    FindingKind::TagLeftOut,
    FindingKind::Lens,
    FindingKind::CameraMount,
    FindingKind::Base,
    FindingKind::Link,
];

/// A focal length that is off by less is not what was found of a lens, relative.
const LEAST_FOCAL: f64 = 1e-3;

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
            format!("correct the scale of {name} in robot.toml"),
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

/// Cause, remedy and what the result does about tags that are not as surveyed.
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

/// ` by 1.74 deg`, where it has a size.
fn by(found: &Finding) -> String {
    found.size_in_words().map_or_else(String::new, |size| format!(" by {size}"))
}

fn of_joint(failed: &FailedJointTable) -> Repair {
    let FailedJointTable { joint, kind, evidence, since_pose, .. } = failed;
    let colon = if evidence.is_empty() { "" } else { ": " };
    let cause = match evidence.strip_prefix("the sensor ").filter(|_| since_pose.is_some()) {
        Some(slipped) => format!("the sensor of {joint} {slipped}"),
        None if kind.stands_still() => format!("{joint} {}{colon}{evidence}", kind.predicate()),
        None => format!("the sensor of {joint} {}{colon}{evidence}", kind.predicate()),
    };
    let code = if since_pose.is_some() { Code::SensorSlip } else { Code::SensorFailed };
    Repair { code, cause, remedy: joint_remedy(failed), taken: "" }
}

/// What to do about a failed joint.
pub(super) fn joint_remedy(failed: &FailedJointTable) -> String {
    let joint = &failed.joint;
    match (failed.kind, failed.since_pose) {
        (_, Some(_)) => format!("fasten the sensor of {joint}: the result holds since the slip"),
        (FailedKind::Locked, None) => format!("targets that need {joint} are out of reach; free it"),
        (FailedKind::NotMoved, None) => format!("capture views that move {joint}; it is calibrated at this angle only"),
        (_, None) => format!("check the sensor of {joint}, its shaft and its cable"),
    }
}

/// What else an accepted calibration leaves to be looked at.
pub(super) fn attention(summary: &RunSummary) -> Vec<String> {
    let mut points: Vec<String> = Vec::new();
    if summary.calibration.u95.tolerance_m.is_none() {
        points.push("No tolerance is given: name targets and tolerance with --task.".to_owned());
    }
    let unjudged = summary.calibration.u95.kept_by_failed_joint();
    if !unjudged.is_empty() {
        let numbers: Vec<String> = unjudged.iter().map(ToString::to_string).collect();
        points.push(format!("The failed joint keeps target {} out of reach: not judged.", numbers.join(", ")));
    }
    for limit in summary.asserts.iter().filter(|limit| !limit.holds) {
        points.push(format!("A limit of the script is not met: step {}, {}.", limit.step, limit.key));
    }
    if summary.online.as_ref().is_some_and(|online| online.is_good_enough == Some(false)) {
        points.push("The final online estimate is not accurate enough for the task.".to_owned());
    }
    points.extend(summary.stopped.iter().map(|why| sentence(&format!("the script stopped early: {why}"))));
    points.extend(summary.calibration.prior.as_ref().filter(|prior| !prior.agrees).map(against_prior));
    let not_covered = summary.calibration.verdict.iter().flat_map(|verdict| &verdict.not_covered);
    points.extend(not_covered.map(|line| sentence(line)));
    let not_included = &summary.calibration.u95.not_included;
    if !not_included.is_empty() {
        let keys = not_included.join(", ");
        points.push(format!("U95 does not include unobservable geometry: state {keys} in [geometry] of robot.toml."));
    }
    points
}

fn against_prior(prior: &PriorTable) -> String {
    let PriorTable { worst_joint: joint, moves, worst_off_rad, used, .. } = prior;
    let fate = if *used { "the result still includes it" } else { "the result uses only the new views" };
    let off = moves.unit().shown(worst_off_rad.abs(), 2);
    format!("The earlier calibration contradicts the new views, {joint} the most, by {off}: {fate}.")
}

/// A capital first, a full stop last; a name that begins with a small letter keeps it.
pub(super) fn sentence(text: &str) -> String {
    let first_word = text.split([' ', ':']).next().unwrap_or_default();
    let end = if text.ends_with(['.', '!', '?']) { "" } else { "." };
    if first_word.contains('_') {
        return format!("{text}{end}");
    }
    let mut letters = text.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}{end}", letters.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;
    use armcal_belief::calib::FindingUnit;

    #[test]
    fn reasons_are_sentences() {
        assert_eq!(sentence("capture more views"), "Capture more views.");
        assert_eq!(sentence("So it is."), "So it is.");
        assert_eq!(sentence("wrist_pitch is locked"), "wrist_pitch is locked.", "a name is a name");
        assert_eq!(sentence(""), ".");
    }

    fn failed(kind: FailedKind, evidence: &str, since_pose: Option<u32>) -> FailedJointTable {
        FailedJointTable {
            joint: "elbow".to_owned(),
            kind,
            found: "detected".to_owned(),
            evidence: evidence.to_owned(),
            poses: Vec::new(),
            since_pose,
            angle_rad: None,
            angle_std_rad: None,
            camera_std_rad: None,
            tool_error_m: None,
            tool_error_by_camera_m: None,
            tool_error_by_datasheet_m: None,
        }
    }

    #[test]
    fn a_repair_says_cause_joint_and_remedy() {
        let repairs = [
            failed(FailedKind::Jumps, "the sensor slipped by 1.00 deg", Some(9)),
            failed(FailedKind::Dead, "it follows nothing", None),
            failed(FailedKind::Locked, "", None),
        ];
        let told = repairs.map(|failed| of_joint(&failed)).map(|one| format!("{}\n  {}\n", one.cause, one.remedy));
        insta::assert_snapshot!("failed_joints", told.concat());
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
        let causes = |findings: &[Finding], failed: &[FailedJointTable]| -> Vec<String> {
            repairs_of(findings, failed, " since the earlier calibration").into_iter().map(|one| one.cause).collect()
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
        // Of a joint that is told of already nothing is said twice; what was not repaired is a refusal's.
        findings[1].name = "elbow".to_owned();
        findings[0].repaired = false;
        let told = failed(FailedKind::Jumps, "the sensor slipped by 1.74 deg", Some(3));
        let once = causes(&findings, &[told]);
        assert_eq!([slipped.len(), others.len(), once.len()], [2, 6, 1]);
        insta::assert_snapshot!("repairs", [slipped, others, once].concat().join("\n"));
    }
}
