//! The study: calibrates and scores each case of each seed.

use rayon::prelude::*;

use crate::falsified::capture::{Capture, Scene, TrueRest};
use crate::falsified::cases::{AXES, Case, CaseKind, Element};
use crate::falsified::classes::{Column, EquivalenceClasses, columns, equivalence_classes};
use crate::falsified::error::FalsifiedError;
use crate::falsified::naming::{causes_of_finding, first_causes, right_causes};
use crate::falsified::oracle::{Oracle, OracleEffect};
use crate::falsified::perturbation::{Perturbation, falsified_robot};
use armcal_belief::calib::{Calibration, CalibrationMethod, Status, calibrate_with_survey};
use armcal_belief::say::{Finding, FindingKind};
use armcal_belief::verify::{Belief, reaches};
use armcal_core::kinematics::LinkCorrections;
use armcal_core::log::Recording;
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::Routine;
use armcal_core::stats::Summary;

/// Relative tolerance within which a reservation's length per unit counts as right.
const RESERVATION_SHARE: f64 = 0.1;

/// Outcome of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunStatus {
    Accepted,
    Refused,
    /// The calibration gave no result.
    Failed,
}

/// One calibration under one falsification.
#[derive(Clone, Debug, PartialEq)]
pub struct FalsifiedRow {
    pub seed: u64,
    pub case: Case,
    pub element: String,
    pub status: RunStatus,
    /// Causes that the result names first; several for a group.
    pub named_first: Vec<String>,
    /// All findings, repaired ones with a `+`.
    pub findings: Vec<String>,
    pub repaired: usize,
    /// Reason of the refusal in words, or the reason that there is no calibration.
    pub reason: String,
    pub predicted_m: Option<Summary>,
    pub predicted_with_priors_m: Option<Summary>,
    /// Distance of the estimated tool from the true one over the task's targets, m.
    pub true_m: Option<Summary>,
    /// Oracle's effect of the falsification; `None` where nothing is wrong: for the good arm, and where the case only
    /// removes views.
    pub oracle: Option<OracleEffect>,
    /// True if the first named cause is the falsification, or one that the data cannot distinguish from it; `None`
    /// where there is nothing to name.
    pub is_named: Option<bool>,
    /// Tool shift per unit by the reservation about the element, m per rad or m per m.
    pub reserved_per_unit: Option<f64>,
}

/// All rows, and the causes that the data of the first seed cannot distinguish.
pub struct FalsifiedStudy {
    /// Rows by seed, in the order of the cases.
    pub rows: Vec<FalsifiedRow>,
    pub classes: EquivalenceClasses,
}

impl FalsifiedRow {
    /// True if the falsification is caught: the calibration is refused, or a finding is repaired.
    #[must_use]
    pub fn is_refused_or_repaired(&self) -> bool {
        self.status != RunStatus::Accepted || self.repaired > 0
    }

    /// True if the calibration is accepted with a true error (95 % of the targets) above three times the prediction,
    /// priors included. True as well for an accepted result whose sensors cannot be read.
    #[must_use]
    pub fn is_wrongly_accepted(&self) -> bool {
        let limit_m = self.predicted_with_priors_m.or(self.predicted_m).map_or(f64::INFINITY, |p| 3.0 * p.p95);
        self.status == RunStatus::Accepted && self.true_m.is_none_or(|error| error.p95 > limit_m)
    }

    /// True if it is accepted without a repair, and the tool error of 95 % of the targets exceeds `limit_m`.
    #[must_use]
    pub fn is_let_through(&self, limit_m: f64) -> bool {
        !self.is_refused_or_repaired() && self.true_m.is_none_or(|error| error.p95 > limit_m)
    }

    /// True if there is something to name: the views show the falsification, or touches refuse it.
    #[must_use]
    pub fn is_to_be_named(&self) -> bool {
        let is_told = self.case.n_touches > 0 && self.status != RunStatus::Accepted;
        self.is_named.is_some() && (self.is_seen() || is_told)
    }

    #[must_use]
    pub fn is_seen(&self) -> bool {
        self.oracle.is_some_and(|oracle| oracle.is_seen())
    }

    /// True if the falsification moves the tool by more than `factor` times `good_p95_m`, the error that the data
    /// predict for a good arm.
    #[must_use]
    pub fn matters(&self, factor: f64, good_p95_m: f64) -> bool {
        self.oracle.is_some_and(|oracle| oracle.tool_m > factor * good_p95_m)
    }

    /// True if a reservation has the tool's shift per unit within a tenth.
    #[must_use]
    pub fn is_reserved_rightly(&self) -> bool {
        let true_per_unit = self.oracle.map(|oracle| oracle.tool_m / self.case.size.abs());
        let pair = self.reserved_per_unit.zip(true_per_unit);
        pair.is_some_and(|(said, is)| (said - is).abs() <= RESERVATION_SHARE * is)
    }
}

/// Runs `seeds` of the routine's world under every case.
///
/// # Errors
/// Where a world cannot be made or driven, or a good arm's views determine nothing.
pub fn falsified_study(
    routine: &Routine,
    (robot, vehicle): (&Robot, &Vehicle),
    cases: &[Case],
    seeds: std::ops::Range<u64>,
) -> Result<FalsifiedStudy, FalsifiedError> {
    study_of(&Scene { routine, robot, vehicle }, cases, seeds, columns)
}

/// Runs the study with classes of only these directions.
pub(super) fn study_of(
    scene: &Scene<'_>,
    cases: &[Case],
    seeds: std::ops::Range<u64>,
    columns: fn(&Robot) -> Vec<Column>,
) -> Result<FalsifiedStudy, FalsifiedError> {
    let simulate = |seed: u64| -> Result<Capture, FalsifiedError> {
        let capture = Capture::simulate(scene, seed)?;
        check_touches(&capture, cases)?;
        Ok(capture)
    };
    let first = simulate(seeds.start)?;
    let first_oracle = Oracle::new(&first)?;
    let classes = equivalence_classes(&first_oracle, columns(first_oracle.robot()));
    let mut rows = rows_of(&first_oracle, &classes, cases);
    let of_seed = |seed: u64| -> Result<Vec<FalsifiedRow>, FalsifiedError> {
        Ok(rows_of(&Oracle::new(&simulate(seed)?)?, &classes, cases))
    };
    let others = seeds.start + 1..seeds.end;
    let by_seed: Vec<Result<Vec<FalsifiedRow>, FalsifiedError>> = others.into_par_iter().map(of_seed).collect();
    for of_seed in by_seed {
        rows.extend(of_seed?);
    }
    Ok(FalsifiedStudy { rows, classes })
}

/// Checks that the capture has as many touches as each case takes.
pub(super) fn check_touches(capture: &Capture, cases: &[Case]) -> Result<(), FalsifiedError> {
    let (seed, n) = (capture.seed, capture.n_touches());
    let n_touches = cases.iter().map(|case| case.n_touches).max().unwrap_or_default();
    if n < n_touches { Err(FalsifiedError::Touches { seed, n, n_touches }) } else { Ok(()) }
}

/// Rows for the oracle's capture, in the order of the cases.
pub(super) fn rows_of(oracle: &Oracle<'_>, classes: &EquivalenceClasses, cases: &[Case]) -> Vec<FalsifiedRow> {
    cases.par_iter().map(|case| row(oracle, classes, case)).collect()
}

fn row(oracle: &Oracle<'_>, classes: &EquivalenceClasses, case: &Case) -> FalsifiedRow {
    let capture = oracle.capture;
    let seed = capture.seed;
    let perturbations = case.perturbations(&capture.robot, seed);
    let robot = falsified_robot(&capture.robot, &perturbations);
    let fault = perturbations.iter().find_map(Perturbation::sensor_fault);
    let recording = capture.falsified(case, fault.as_ref());
    let effect = (!perturbations.is_empty()).then(|| oracle.effect(&perturbations));
    let blank = FalsifiedRow {
        seed,
        case: *case,
        element: case.element_name(&capture.robot, seed),
        status: RunStatus::Failed,
        named_first: Vec::new(),
        findings: Vec::new(),
        repaired: 0,
        reason: String::new(),
        predicted_m: None,
        predicted_with_priors_m: None,
        true_m: None,
        oracle: effect,
        is_named: None,
        reserved_per_unit: None,
    };
    let mut right = right_causes(&robot, case, seed);
    let is_nameable = !right.is_empty();
    right.extend(classes.of(&perturbations));
    let is_named = |first: &[String]| is_nameable.then(|| first.iter().any(|cause| right.contains(cause)));
    match calibrate_with_survey(&recording, &robot, CalibrationMethod::Bundle) {
        Err(error) => FalsifiedRow { reason: error.to_string(), is_named: is_named(&[]), ..blank },
        Ok(calibration) => {
            let named_first = first_causes(&robot, &calibration);
            FalsifiedRow {
                status: if calibration.status == Status::Accepted { RunStatus::Accepted } else { RunStatus::Refused },
                findings: findings(&robot, &calibration),
                repaired: calibration.findings.iter().filter(|finding| is_repair(finding)).count(),
                reason: calibration.refusal.clone().unwrap_or_default(),
                predicted_m: calibration.predicted_tool_error_m,
                predicted_with_priors_m: calibration.predicted_tool_error_with_priors_m,
                true_m: true_error(&capture.rests, &recording, &robot, &calibration),
                is_named: is_named(&named_first),
                reserved_per_unit: reserved_per_unit(&robot, case, &calibration),
                named_first,
                ..blank
            }
        }
    }
}

/// True if the finding is a repair of an element; every calibration rejects single outliers, so those do not count.
fn is_repair(finding: &Finding) -> bool {
    finding.repaired && finding.kind != FindingKind::Outliers
}

fn findings(robot: &Robot, calibration: &Calibration) -> Vec<String> {
    let words = calibration.findings.iter().map(|finding| {
        let causes = causes_of_finding(robot, finding).join("+");
        if finding.repaired { format!("{causes}(+)") } else { causes }
    });
    words.collect()
}

/// The estimated arm after a calibration with `robot` as input, including the repairs of the nominal model.
fn believed_robot(robot: &Robot, calibration: &Calibration) -> Robot {
    calibration.scaled_robot(robot)
}

/// Distance of the calibrated arm's estimated tool from the true one over the targets, m.
fn true_error(rests: &[TrueRest], recording: &Recording, robot: &Robot, calibration: &Calibration) -> Option<Summary> {
    let believed = believed_robot(robot, calibration);
    let sensors = calibration.sensors(&believed).ok()?;
    let first = rests.first()?.start;
    // The robot already includes the link corrections.
    let belief = Belief { from: first, sensors: &sensors, links: LinkCorrections::default() };
    let errors = reaches(recording, &believed, &[belief]).into_iter().filter_map(|rest| {
        let true_rest = rests.iter().find(|true_rest| true_rest.start == rest.start)?;
        Some((rest.believed_tool.origin().vector() - true_rest.tool_m).norm())
    });
    Summary::of(&errors.collect::<Vec<f64>>())
}

/// Tool shift per unit by the reservation about the case's element, if there is one.
fn reserved_per_unit(robot: &Robot, case: &Case, calibration: &Calibration) -> Option<f64> {
    let (stem, axis) = reserved_element(robot, case)?;
    calibration.reservations.iter().filter(|found| found.prior_std > 0.0).find_map(|found| {
        let axes = found.what.strip_prefix(&stem)?;
        let at = axes.split(", ").position(|name| name == axis);
        let of_axis_m = at.map(|at| found.by_axis_m.get(at).copied().unwrap_or(found.tool_error_m));
        let tool_m = of_axis_m.or_else(|| (axes == "any axis").then_some(found.tool_error_m))?;
        Some(tool_m / found.prior_std)
    })
}

/// Beginning of the text of a reservation about the case's element, and its axis.
fn reserved_element(robot: &Robot, case: &Case) -> Option<(String, &'static str)> {
    let place = |joint: usize| format!("pose of {}", robot.chain.joints()[joint].name);
    let (element, axis) = match (case.kind, case.element) {
        (CaseKind::MountTurned | CaseKind::MountShifted, Element::Axis(axis)) => ("camera mount".to_owned(), axis),
        (CaseKind::ToolShifted, Element::Axis(axis)) => ("tool point".to_owned(), axis),
        (CaseKind::SurveyTurned, Element::Axis(axis)) => ("tag survey".to_owned(), axis),
        (_, Element::JointAxis { joint, axis }) => (place(joint), axis),
        _ => return None,
    };
    let way = match case.kind.unit().1 {
        "deg" => "rotation about",
        _ => "shift along",
    };
    Some((format!("{element}, {way} "), AXES[axis]))
}
