//! Whether joint sensors explain the data of a calibration by `bundle`: by the views that were left out, by what other geometry would
//! explain, by how large the sensors' errors would have to be.

use super::bundle::{
    BundleInput, ErrorKind, Estimate, GeometryElement, Innovations, JointInnovation, Observability, ScoreTestResult,
    observability,
};
use super::problem::ParameterKind;
use super::result::{Calibration, Status};
use super::uncertainty::task_angles;
use super::valid_range::not_covered;
use super::verdict_tables::{Check, ObservabilityTable, VerdictTable};
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::stats::chi_square_quantile;
use armcal_core::streams::ReachTask;

/// What a fit by `bundle` leaves to judge.
pub(super) struct VerdictInput<'a> {
    pub input: &'a BundleInput<'a>,
    pub found: &'a Estimate<'a>,
    /// Of each fold.
    pub innovations: &'a [Innovations],
    pub task: Option<&'a ReachTask>,
}

/// Probability that a good arm fails any one check by chance.
const FALSE_ALARM: f64 = 1e-4;
/// Geometry that would move the tool by less than this, and by less than the predicted error, is no reason to refuse, m.
const WORTH_M: f64 = 0.004;
/// A joint's error from view to view over its datasheet's linearity: sensors do not have more, after what is smooth is taken off.
const MAX_OVER_LINEARITY: f64 = 3.0;
/// Gains and offsets farther from the datasheet than this are no calibration any more; the paper's methods stop there, too.
const MAX_SIGMAS_OFF: f64 = 6.0;
/// Share of the sightings that may belong elsewhere.
const MAX_OUTLIERS: f64 = 0.25;
/// Over chi-square's quantile, for pixel noise has longer tails than a normal one and the tags' corners common errors. Measured.
const TAILS: f64 = 1.5;
/// So many times that limit is refused: innovations then are about three times as large as they should be.
const FAR_BEYOND: f64 = 4.0;
/// Standard deviation over the prior's above which the prior holds a parameter.
const HELD: f64 = 0.7;

/// A reason to refuse, in words.
type Reason = String;

impl VerdictInput<'_> {
    /// Writes the tables into `calibration`, and refuses it where something does not hold.
    pub(super) fn complete(&self, calibration: &mut Calibration) {
        let robot = self.input.robot;
        let targets = self.task.map(|task| task_angles(robot, task)).unwrap_or_default();
        // Without a task the views' own postures stand for it.
        let postures = if targets.is_empty() { self.found.view_angles() } else { targets.clone() };
        let mut table = VerdictTable { warnings: Vec::new(), not_covered: Vec::new(), checks: Vec::new() };
        let mut reasons: Vec<Reason> = Vec::new();
        reasons.extend(self.geometry(&postures, calibration, &mut table));
        reasons.extend(self.sensors(&mut table));
        reasons.extend(self.far_from_the_datasheet(&mut table));
        reasons.extend(self.outliers(calibration, &mut table));
        reasons.extend(self.innovations(&mut table));
        self.whiteness(&mut table);
        table.not_covered = not_covered(calibration, &targets);
        if self.found_behind_unseen() {
            table.warnings.push(
                "links behind the camera: an error of theirs cannot be seen without a tag on the gripper".to_owned(),
            );
        }
        calibration.verdict = Some(table);
        if let Some(found) = observability(self.input) {
            let wanted = found.null.iter().filter(|direction| !direction.is_of_terms);
            calibration.unobservable.extend(wanted.map(|direction| direction.words.clone()));
            calibration.observability = Some(self.table(&found));
        }
        let Some(reason) = reasons.into_iter().next() else { return };
        // What is not solved, or of too few views, says so first.
        calibration.refusal = Some(match calibration.refusal.take() {
            None => reason,
            Some(first) if calibration.fit.outcome != "converged" || first.contains("too few") => {
                format!("{first}; besides, {reason}")
            }
            Some(first) => format!("{reason}; besides, {first}"),
        });
        calibration.status = Status::Refused;
    }

    /// Whether other links would explain the data better.
    fn geometry(
        &self,
        postures: &[JointAngles],
        calibration: &Calibration,
        table: &mut VerdictTable,
    ) -> Option<Reason> {
        let robot = self.input.robot;
        let mut suspects = self.found.suspects(postures);
        if calibration.map.is_some() {
            // These views made the map: there is no survey that the base could disagree with.
            suspects.retain(|suspect| suspect.piece != GeometryElement::Joint(0));
        }
        let limit = FALSE_ALARM / suspects.len().max(1) as f64;
        let worth_m = calibration.predicted_tool_error_m.map_or(WORTH_M, |p| p.median.min(WORTH_M));
        let mut reason = None;
        for suspect in &suspects {
            let most = chi_square_quantile(1.0 - limit, suspect.dof);
            let what =
                format!("{}: chi-square of its {}", piece_name(robot, suspect.piece), change_name(suspect.change));
            let check = Check::at_most(what, suspect.chi2, most);
            let matters = suspect.tool_m > worth_m || suspect.piece == GeometryElement::Mount;
            if !check.holds && matters && reason.is_none() {
                reason = Some(in_words(robot, suspect, most));
            } else if !check.holds && reason.is_none() {
                table.warnings.push(in_words(robot, suspect, most));
            }
            table.checks.push(check);
        }
        reason
    }

    /// Whether the joints' errors are those of such sensors.
    fn sensors(&self, table: &mut VerdictTable) -> Option<Reason> {
        let robot = self.input.robot;
        let mut reason = None;
        for (joint, spec) in robot.sensors.iter().enumerate().take(robot.camera.mount.n_joints) {
            let std_rad = self.found.scales().joint_std_rad[joint];
            let limit_rad = MAX_OVER_LINEARITY * spec.linearity_std_rad.max(self.input.scales.joint_std_rad[joint]);
            let check = Check::at_most(format!("{}: error from view to view, rad", spec.joint), std_rad, limit_rad);
            if !check.holds && self.found.has_positions() {
                // Their noise has no datasheet, and one landmark a view cannot part it from the joints' errors.
                let (found, name) = (std_rad.to_degrees(), &spec.joint);
                table.warnings.push(format!(
                    "{name} errs by {found:.2} deg from view to view, or the positions do as much as that"
                ));
            } else if !check.holds && reason.is_none() {
                let (found, sheet) = (std_rad.to_degrees(), spec.linearity_std_rad.to_degrees());
                let name = &spec.joint;
                reason = Some(format!(
                    "joint sensors do not explain the data: {name} would have to err by {found:.2} deg from view to view, its \
                     datasheet has {sheet:.2} deg; a joint that slips, or links that are not as drawn"
                ));
            }
            table.checks.push(check);
        }
        reason
    }

    /// Gains and offsets beyond what a sensor of that datasheet can have: a joint that does not move, or another sensor.
    fn far_from_the_datasheet(&self, table: &mut VerdictTable) -> Option<Reason> {
        let (robot, at) = (self.input.robot, self.found.parameters());
        let linear = self.found.joint_parameters().iter().filter(|p| p.prior_std(robot) > 0.0);
        let of_sensor = linear.filter(|p| matches!(p.kind, ParameterKind::Gain | ParameterKind::Offset));
        let sigmas = of_sensor.map(|p| {
            let nominal = if p.kind == ParameterKind::Gain { 1.0 } else { 0.0 };
            (*p, (at.get(*p) - nominal).abs() / p.prior_std(robot))
        });
        let (worst, sigmas) = sigmas.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let name = worst.name(robot);
        let check = Check::at_most(format!("{name}: sigma from its datasheet"), sigmas, MAX_SIGMAS_OFF);
        let reason = (!check.holds).then(|| {
            format!("{name} would have to be {sigmas:.0} sigma from its datasheet: the joint or its sensor has failed, or it is another sensor")
        });
        table.checks.push(check);
        reason
    }

    fn outliers(&self, calibration: &Calibration, table: &mut VerdictTable) -> Option<Reason> {
        let (n, all) = (self.found.outliers.len(), calibration.fit.tags_seen);
        let check = Check::at_most("share of tags that belong elsewhere", n as f64 / all.max(1) as f64, MAX_OUTLIERS);
        let reason = (!check.holds).then(|| {
            format!(
                "{n} of {all} seen tags do not fit any arm of this drawing: other tags, or links that are not as drawn"
            )
        });
        table.checks.push(check);
        reason
    }

    /// Whether views that were left out are foretold as well as they should be: refused far beyond, else a warning.
    fn innovations(&self, table: &mut VerdictTable) -> Option<Reason> {
        let sum = |f: fn(&Innovations) -> (f64, usize)| {
            self.innovations.iter().map(f).fold((0.0, 0), |(chi2, dof), (c, d)| (chi2 + c, dof + d))
        };
        let mut reason = None;
        for (what, (chi2, dof)) in [
            ("held-out cameras: chi-square per degree of freedom", sum(|i| (i.camera_chi2, i.camera_dof))),
            ("held-out coordinates: chi-square per degree of freedom", sum(|i| (i.chi2, i.dof))),
        ] {
            if dof == 0 {
                continue;
            }
            let per_dof = chi2 / dof as f64;
            let limit = TAILS * chi_square_quantile(1.0 - FALSE_ALARM, dof) / dof as f64;
            let check = Check::at_most(what, per_dof, limit);
            if !check.holds {
                let lowest = chi_square_quantile(0.025, dof) / dof as f64;
                let highest = chi_square_quantile(0.975, dof) / dof as f64;
                let words = format!(
                    "{what} is {per_dof:.2}, above {limit:.2} (95 % of sound ones lie in {lowest:.2} .. {highest:.2}): views that the \
                     fit did not see are worse than it says"
                );
                if per_dof <= FAR_BEYOND * limit {
                    table.warnings.push(words);
                } else if reason.is_none() {
                    reason = Some(words);
                }
            }
            table.checks.push(check);
        }
        reason
    }

    /// Whether what is left of each joint's error has a pattern; a warning.
    fn whiteness(&self, table: &mut VerdictTable) {
        let robot = self.input.robot;
        let all: Vec<JointInnovation> = self.innovations.iter().flat_map(|fold| fold.joints.iter().copied()).collect();
        let limit = -normal_quantile(FALSE_ALARM / 10.0);
        for (joint, spec) in robot.sensors.iter().enumerate() {
            for (along, key) in [
                ("in time", (|i: &JointInnovation| i.view_idx as f64) as fn(&JointInnovation) -> f64),
                ("along its travel", |i| i.travel_rad),
            ] {
                let mut of_joint: Vec<&JointInnovation> = all.iter().filter(|i| i.joint == joint).collect();
                of_joint.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.view_idx.cmp(&b.view_idx)));
                let values: Vec<f64> = of_joint.iter().map(|i| i.normalised).collect();
                let Some(sigmas) = serial_sigmas(&values) else { continue };
                let check =
                    Check::at_most(format!("{}: serial correlation {along}, sigmas", spec.joint), sigmas, limit);
                if !check.holds {
                    let name = &spec.joint;
                    table.warnings.push(format!(
                        "{name}: errors of neighbouring views {along} are alike ({sigmas:.1} sigmas): something smooth is not in the model"
                    ));
                }
                table.checks.push(check);
            }
        }
    }

    fn found_behind_unseen(&self) -> bool {
        let robot = self.input.robot;
        robot.tool.mount.n_joints > robot.camera.mount.n_joints && !self.input.model.gripper_tag
    }

    fn table(&self, found: &Observability) -> ObservabilityTable {
        let covariance = self.found.joint_covariance();
        let robot = self.input.robot;
        let held = self.found.joint_parameters().iter().enumerate().filter_map(|(k, p)| {
            let prior_std = self.found.scales().prior_std(&robot.sensors[p.joint], p.joint, p.kind);
            let share = covariance[(k, k)].max(0.0).sqrt() / prior_std;
            let is_named = !matches!(p.kind, ParameterKind::Shape(_));
            (is_named && share > HELD).then(|| {
                format!("{}: {:.0} % of its prior's standard deviation are left", p.name(robot), 100.0 * share)
            })
        });
        let [o1, o2, o3, o4, o5] = found.o;
        ObservabilityTable {
            rank: found.rank,
            of: found.of,
            condition_number: Some(found.condition_number).filter(|c| c.is_finite()),
            o1,
            o2,
            o3,
            o4,
            o5,
            null: found.null.iter().map(|direction| direction.words.clone()).collect(),
            held_by_prior: held.collect(),
        }
    }
}

fn piece_name(robot: &Robot, piece: GeometryElement) -> String {
    match piece {
        GeometryElement::Joint(0) => "base (or all tags)".to_owned(),
        GeometryElement::Joint(joint) => robot.chain.joints()[joint - 1].child_link.clone(),
        GeometryElement::Mount => "camera mount".to_owned(),
    }
}

fn change_name(change: ErrorKind) -> &'static str {
    match change {
        ErrorKind::Shift => "length",
        ErrorKind::Turn => "twist",
    }
}

fn in_words(robot: &Robot, suspect: &ScoreTestResult, limit: f64) -> Reason {
    let name = piece_name(robot, suspect.piece);
    let v = suspect.size
        * match suspect.change {
            ErrorKind::Shift => 1e3,
            ErrorKind::Turn => 1f64.to_degrees(),
        };
    let (chi2, tool_mm) = (suspect.chi2, suspect.tool_m * 1e3);
    let next = match suspect.piece {
        GeometryElement::Joint(joint) => format!("{} sits", robot.chain.joints()[joint].name),
        GeometryElement::Mount => "the camera hangs".to_owned(),
    };
    let how = match suspect.change {
        ErrorKind::Shift => {
            format!("{next} {:.1} mm from where the drawing has it, ({:.1}, {:.1}, {:.1}) mm", v.norm(), v.x, v.y, v.z)
        }
        ErrorKind::Turn => {
            format!("{next} turned by {:.2} deg from the drawing, ({:.2}, {:.2}, {:.2}) deg", v.norm(), v.x, v.y, v.z)
        }
    };
    format!(
        "joint sensors do not explain the data, {name} would: {how} in its own axes (chi-square {chi2:.0}, by chance up to {limit:.0}; \
         {tool_mm:.1} mm at the tool)"
    )
}

/// How many of its own standard deviations von Neumann's ratio lies below 2 (von Neumann 1941): positive where neighbours are alike.
/// `None` below eight values.
fn serial_sigmas(values: &[f64]) -> Option<f64> {
    const LEAST: usize = 8;
    let n = values.len() as f64;
    if values.len() < LEAST {
        return None;
    }
    let squares: f64 = values.iter().map(|v| v * v).sum();
    let steps: f64 = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    // About zero, not the mean: the model says that it is zero. E = 2 (n - 1) / n, var = 4 (n - 2) / n^2 for unit normal values, nearly.
    let ratio = steps / squares;
    (squares > 0.0).then(|| (2.0 * (n - 1.0) / n - ratio) / (2.0 * (n - 2.0).sqrt() / n))
}

/// The standard normal's, by chi-square with one degree of freedom.
fn normal_quantile(p: f64) -> f64 {
    let side = chi_square_quantile((1.0 - 2.0 * p).abs(), 1).sqrt();
    if p < 0.5 { -side } else { side }
}
