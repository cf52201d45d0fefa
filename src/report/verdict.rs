//! The verdict, its reasons and the next step: the same words for report.html, the replay and the terminal.

use crate::report::summary::{Condition, RunSummary, VerdictSummary};
use armcal_belief::calib::{FailedJointTable, PriorTable, Refusal, Reservation, Status, with_advice};
use armcal_belief::judge::RULE;
use armcal_belief::say::{self, FailedJoint, Repair, sentence};
use armcal_core::codes::{Code, Coded};

/// Grade of a result, for a reader's first glance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grade {
    Green,
    Amber,
    Red,
}

impl Grade {
    /// Name of the grade in summary.json.
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

/// Verdict of a run, or of a calibration without a run.
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
    /// Fills in the verdict, once all other fields are known.
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

/// Repairs that this result's findings and failed joints ask for.
pub(super) fn repairs(summary: &RunSummary) -> Vec<Repair> {
    let calibration = &summary.calibration;
    let since = if calibration.prior.is_some() { " since the earlier calibration" } else { "" };
    let failed: Vec<FailedJoint<'_>> = calibration.failed_joint.iter().map(FailedJointTable::told).collect();
    say::repairs(&calibration.findings, &failed, since)
}

/// Faults of survey, lens and nominal model, where accuracy is the only reason of a refusal. They are its likely cause.
pub(super) fn beside_refusal(summary: &RunSummary) -> Vec<Repair> {
    let is_of_accuracy =
        |refusal: &Refusal| matches!(refusal, Refusal::BeyondTolerance { .. } | Refusal::PriorsBeyondTolerance { .. });
    if !summary.refusals.iter().all(is_of_accuracy) {
        return Vec::new();
    }
    let mut found = say::repairs(&summary.calibration.findings, &[], "");
    found.truncate(MAX_BESIDE);
    found
}

/// Largest number of faults that are named with a refusal.
const MAX_BESIDE: usize = 3;

/// Points of an accepted calibration that still need attention.
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
