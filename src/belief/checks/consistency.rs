//! Checks whether joint sensors explain the data of a calibration by `bundle`: score test of the link geometry, size of
//! the sensors' errors, outliers, and innovations of held-out views.

use crate::checks::block_measurements::LengthInnovation;
use crate::checks::constants::consistency::{
    FAR_BEYOND, HELD, LEAST, MAX_NONLINEARITY, MAX_UNCONFIRMED, NAMED_SIGMAS, NAMED_WALK_NATS, WALK_SIGNIFICANCE,
    WALKED, WORN, WORTH_M,
};
pub(crate) use crate::checks::constants::consistency::{MAX_OUTLIERS, MAX_SIGMAS_OFF};
use crate::checks::innovations::{Innovations, JointInnovation};
use crate::checks::marginal::FromDatasheet;
use crate::checks::observability::{NullDirection, Observability, observability};
use crate::explain::constants::tags_departure::TAILS;
use crate::explain::failure_detection::most_unsteady_rad;
use crate::explain::score_test::{GeometryElement, ScoreTestResult};
use crate::file::calibration::Calibration;
use crate::file::validity::Extrapolation;
use crate::file::verdict_tables::{Check, ObservabilityTable, VerdictTable};
use crate::judge::baseline_comparison::SIGNIFICANCE;
use crate::judge::constants::FALSE_ALARM;
use crate::model::blocks::Block;
use crate::model::estimated::Walk;
use crate::model::parameters::{Parameter, ParameterKind};
use crate::model::scales::Hyperparameters;
use crate::say;
use crate::say::finding::{Finding, FindingKind, FindingUnit};
use crate::say::geometry_error::{BASE, ErrorKind, GeometryError};
use crate::say::refusal::{InnovationQuantity, Refusal};
use crate::solve::estimate::Estimate;
use crate::solve::input::BundleInput;
use crate::solve::task_angles::numbered_task_angles;
use crate::views::view::TaskRests;
use armcal_core::codes::{Code, Warning};
use armcal_core::input::TagNoise;
use armcal_core::joints::JointAngles;
use armcal_core::robot::{JointSensorSpec, Robot};
use armcal_core::sensor::ConditionChange;
use armcal_core::stats::chi_square_quantile;

/// Input of the verdict on an estimate.
pub(crate) struct VerdictInput<'a> {
    pub input: &'a BundleInput<'a>,
    pub found: &'a Estimate<'a>,
    /// Innovations of each fold.
    pub innovations: &'a [Innovations],
    pub lengths: &'a [LengthInnovation],
    pub task: Option<TaskRests<'a>>,
    /// Noise of positions and poses that the input map states.
    pub tag_noise: Option<TagNoise>,
}

/// Warning for every arm without a gripper tag; touches resolve it.
const UNSEEN_LINKS: &str = "links distal to the camera: errors are unobservable without a gripper tag";

impl VerdictInput<'_> {
    /// Writes tables and findings into `calibration`, and refuses it if a check fails.
    pub(crate) fn judge(&self, calibration: &mut Calibration) {
        let robot = self.input.robot;
        let numbered = self.task.map(|task| numbered_task_angles(robot, task)).unwrap_or_default();
        let targets: Vec<JointAngles> = numbered.iter().map(|(_, angles)| *angles).collect();
        // Without a task the views' own configurations stand for it.
        let configurations = if targets.is_empty() { self.found.view_angles() } else { targets.clone() };
        let mut table = VerdictTable { warnings: Vec::new(), not_covered: Vec::new(), checks: Vec::new() };
        let refusals = [
            self.understated_corner_noise(calibration.fit.tags_seen),
            self.found.judge_lengths(self.lengths, &mut table),
            self.walks(calibration),
            self.geometry(&configurations, calibration, &mut table),
            self.baseline(&configurations, calibration, &mut table),
            self.sensors(calibration, &mut table),
            self.nonlinearity(calibration, &mut table),
            self.corner_noise(&mut table),
            self.rotation_noise(&mut table),
            self.beyond_datasheet(calibration, &mut table),
            self.outliers(calibration, &mut table),
            self.innovations(&mut table),
        ];
        self.whiteness(&mut table);
        table.warnings.extend(self.scales_at_bounds());
        let extrapolation = Extrapolation::new(calibration, robot, &numbered);
        table.not_covered = extrapolation.in_words();
        let targets = extrapolation.not_judged();
        if !targets.is_empty() {
            calibration.refuse_for([Refusal::TargetsNotCovered { targets, ranges: table.not_covered.clone() }]);
        }
        if self.has_unseen_links() {
            table.warnings.push(Warning::new(Code::LinksUnobservable, UNSEEN_LINKS));
        }
        calibration.verdict = Some(table);
        if let Some(found) = observability(self.input) {
            let shares = self.shares_of_priors();
            let is_open = |direction: &&NullDirection| !direction.is_of_terms && !direction.is_determined(&shares);
            let wanted = found.null_space.iter().filter(is_open);
            calibration.unobservable.extend(wanted.map(|direction| direction.words.clone()));
            calibration.observability = Some(self.table(&found));
        }
        calibration.refuse_first_for(refusals.into_iter().flatten().take(1));
    }

    /// Returns a refusal if walking offsets make the tool error exceed the task's tolerance.
    fn walks(&self, calibration: &Calibration) -> Option<Refusal> {
        self.found.model.walk?;
        let (u95_m, tolerance_m) = calibration.refusals.iter().find_map(|refusal| match refusal {
            Refusal::BeyondTolerance { u95_m, tolerance_m, .. } => Some((*u95_m, *tolerance_m)),
            _ => None,
        })?;
        let (robot, walks) = (self.input.robot, self.found.scales().walk_std_rad);
        let walking = (0..robot.n_seen_joints()).filter(|&joint| self.walks_surely(joint));
        let most = walking.max_by(|a, b| walks[*a].total_cmp(&walks[*b]))?;
        let (joint, moves) = (robot.sensors[most].joint.clone(), robot.sensors[most].moves);
        Some(Refusal::OffsetsWalk { joint, walked_rad: walks[most], moves, u95_m, tolerance_m })
    }

    /// Returns true if this joint's walk is significant: the views in a random order would not show it.
    fn walks_surely(&self, joint: usize) -> bool {
        let is_sure = |walk: Walk| walk.gain_nats > NAMED_WALK_NATS && walk.p_value[joint] < WALK_SIGNIFICANCE;
        self.found.model.walk.is_some_and(is_sure)
    }

    /// Returns a refusal if other link geometry explains the data better and matters at the tool; else warns of it.
    fn geometry(
        &self,
        configurations: &[JointAngles],
        calibration: &mut Calibration,
        table: &mut VerdictTable,
    ) -> Option<Refusal> {
        let mut results = self.found.score_tests(configurations);
        if calibration.map.is_some() {
            // The map was made from these views, so there is no survey that the base could contradict.
            results.retain(|result| result.element != GeometryElement::Joint(0));
        }
        let false_alarm = FALSE_ALARM / results.len().max(1) as f64;
        // Unexplained errors inflate the predicted error, so the stated figures bound it.
        let predicted_m = calibration.predicted_tool_error_m.map(|p| {
            self.found
                .stated_tool_error_m(self.input, configurations)
                .map_or(p.median, |stated_m| stated_m.min(p.median))
        });
        let worth_m = predicted_m.map_or(WORTH_M, |predicted_m| predicted_m.min(WORTH_M));
        let mut refusal = None;
        for result in &results {
            let limit = chi_square_quantile(1.0 - false_alarm, result.dof);
            let geometry = geometry_error(self.input.robot, result, limit);
            let what = format!("{}: chi-square of its {}", geometry.element, error_name(result.error));
            let check = Check::at_most(what, result.chi2, limit);
            let matters = result.tool_m > worth_m || result.element == GeometryElement::Mount;
            if !check.holds && refusal.is_none() {
                calibration.findings.push(geometry_finding(result, &geometry));
                if matters {
                    refusal = Some(Refusal::Geometry(geometry));
                } else {
                    table.warnings.push(Warning::new(Code::GeometryDoubtful, geometry.to_string()));
                }
            }
            table.checks.push(check);
        }
        refusal
    }

    /// Returns a refusal if the views do not confirm the change of the sensors. Held-out views confirm it if they fit
    /// better than with only mount and map fitted. A change up to `MAX_UNCONFIRMED` times its predicted error needs no
    /// confirmation.
    fn baseline(
        &self,
        configurations: &[JointAngles],
        calibration: &Calibration,
        table: &mut VerdictTable,
    ) -> Option<Refusal> {
        let (held_out_m, baseline) = calibration.held_out.rms_m.zip(calibration.held_out.baseline)?;
        let change = self.change_at_tool(configurations)?;
        table.checks.push(Check {
            what: "held out against mount and map alone: probability that it is no better".to_owned(),
            value: baseline.p_value,
            limit: SIGNIFICANCE,
            holds: baseline.is_beaten(),
        });
        if baseline.is_beaten() {
            return None;
        }
        let check = Check::at_most("change at the tool over its predicted error", change, MAX_UNCONFIRMED);
        let refusal =
            Refusal::NoBetterThanBaseline { held_out_m, baseline_m: baseline.rms_m, p_value: baseline.p_value };
        let is_confirmed = check.holds;
        table.checks.push(check);
        if !is_confirmed {
            return Some(refusal);
        }
        table.warnings.push(Warning::new(
            Code::SensorsUnconfirmed,
            format!(
                "the views do not show that the sensors need calibration: held-out tag error {:.1} mm rms calibrated, \
             {:.1} mm with datasheet sensors, fitted mount and fitted map (p = {:.2})",
                1e3 * held_out_m,
                1e3 * baseline.rms_m,
                baseline.p_value
            ),
        ));
        None
    }

    /// Tool displacement between the estimated and the datasheet's sensors at the same readings, over the error
    /// predicted by the stated figures. Both are root mean squares over the configurations.
    fn change_at_tool(&self, configurations: &[JointAngles]) -> Option<f64> {
        let robot = self.input.robot;
        let covariance = self.found.stated_covariance(self.input)?;
        let sensors = self.found.parameters().sensors(robot);
        let tool = |angles: &JointAngles| robot.chain.link_poses(angles).frame(&robot.tool.mount).translation.vector;
        let (mut moved_m2, mut predicted_m2) = (0.0, 0.0);
        for angles in configurations {
            let by_datasheet = JointAngles::from_fn(angles.len(), |j| {
                robot.sensors[j].center_rad + sensors.models[j].travel_under_rad(angles[j], &ConditionChange::default())
            });
            moved_m2 += (tool(angles) - tool(&by_datasheet)).norm_squared();
            predicted_m2 += covariance.tool_position_m2(robot, &sensors, angles).trace().max(0.0);
        }
        Some((moved_m2 / predicted_m2).sqrt())
    }

    /// Returns a refusal if a joint's error between views is too large for its sensor; reports walking offsets.
    fn sensors(&self, calibration: &mut Calibration, table: &mut VerdictTable) -> Option<Refusal> {
        let robot = self.input.robot;
        let stated = Hyperparameters::datasheet(robot);
        let mut refusal = None;
        for (joint, spec) in robot.sensors.iter().enumerate().take(robot.n_seen_joints()) {
            let scales = self.found.scales();
            let walked_rad = if self.found.model.walk.is_some() { scales.walk_std_rad[joint] } else { 0.0 };
            let std_rad = scales.joint_std_rad[joint];
            let limit_rad = most_unsteady_rad(robot, joint, &stated);
            let check = Check::at_most(
                format!("{}: error from view to view, {}", spec.joint, spec.moves.si()),
                std_rad,
                limit_rad,
            );
            if !check.holds && self.found.has_positions() {
                // The noise of positions has no datasheet, and one landmark per view cannot separate it from the
                // joints' errors.
                let (found, name) = (spec.unit().shown(std_rad, 2), &spec.joint);
                table.warnings.push(Warning::new(
                    Code::JointNoise,
                    format!("{name} varies by {found} between views, or the measured positions do"),
                ));
            } else if !check.holds && refusal.is_none() {
                let (joint, datasheet_std_rad) = (spec.joint.clone(), spec.linearity_std_rad);
                calibration.findings.push(worn(spec, std_rad));
                refusal = Some(Refusal::SensorError { joint, std_rad, datasheet_std_rad, moves: spec.moves });
            } else if self.walks_surely(joint) && walked_rad > WALKED * stated.joint_std_rad[joint] {
                let kind = FindingKind::OffsetWalks;
                calibration.findings.push(Finding { kind, repaired: true, ..worn(spec, walked_rad) });
                table.warnings.push(Warning::new(
                    Code::OffsetWalks,
                    say::offset_walks(&spec.joint, &spec.unit().shown(walked_rad, 2)),
                ));
            }
            table.checks.push(check);
        }
        refusal
    }

    /// Returns a refusal if a sensor's nonlinearity is far beyond its datasheet; up to that limit, it is estimated.
    fn nonlinearity(&self, calibration: &mut Calibration, table: &mut VerdictTable) -> Option<Refusal> {
        let robot = self.input.robot;
        let mut refusal = None;
        for (joint, spec) in robot.sensors.iter().enumerate() {
            let is_shape = |p: &Parameter| p.joint == joint && matches!(p.kind, ParameterKind::Shape(_));
            if !self.found.joint_parameters().iter().any(is_shape) {
                continue;
            }
            let (std_rad, datasheet_std_rad) = (self.found.scales().shape_std_rad[joint], spec.linearity_std_rad);
            let what = format!("{}: nonlinearity over its datasheet's", spec.joint);
            let check = Check::at_most(what, std_rad / datasheet_std_rad, WORN);
            let is_refused = check.value > MAX_NONLINEARITY && !self.found.has_positions();
            if !check.holds && self.found.has_positions() {
                table.warnings.push(Warning::new(
                    Code::JointNoise,
                    format!(
                        "{} has a nonlinearity of {}, or the measured positions do",
                        spec.joint,
                        spec.unit().shown(std_rad, 2)
                    ),
                ));
            } else if !check.holds {
                calibration.findings.push(Finding { repaired: !is_refused, ..worn(spec, std_rad) });
                table.warnings.push(Warning::new(
                    Code::SensorWorn,
                    format!(
                        "{} is worn: its nonlinearity is {}, {:.1} times its datasheet; the estimate includes it",
                        spec.joint,
                        spec.unit().shown(std_rad, 2),
                        check.value
                    ),
                ));
            }
            if is_refused && refusal.is_none() {
                let joint = spec.joint.clone();
                refusal = Some(Refusal::Nonlinearity { joint, std_rad, datasheet_std_rad, moves: spec.moves });
            }
            table.checks.push(check);
        }
        refusal
    }

    /// Returns a refusal if a gain or offset is beyond its sensor's datasheet: the joint does not move, or the sensor
    /// is another. Reports one that is unusual but not refused.
    fn beyond_datasheet(&self, calibration: &mut Calibration, table: &mut VerdictTable) -> Option<Refusal> {
        let robot = self.input.robot;
        let apart = self.found.apart_from_datasheet();
        let FromDatasheet { parameter, sigmas, off } =
            apart.into_iter().max_by(|a, b| a.sigmas.total_cmp(&b.sigmas))?;
        let name = parameter.name(robot);
        let unit = match parameter.kind {
            ParameterKind::Gain => FindingUnit::One,
            _ => FindingUnit::of_joint(robot.sensors[parameter.joint].moves),
        };
        let check = Check::at_most(format!("{name}: sigma from its datasheet"), sigmas, MAX_SIGMAS_OFF);
        if check.holds && sigmas > NAMED_SIGMAS {
            calibration.findings.push(Finding {
                kind: FindingKind::SensorUnusual,
                name: name.clone(),
                size: Some(off),
                unit: Some(unit),
                tool_error_m: None,
                time_s: None,
                repaired: true,
            });
        }
        let refusal = (!check.holds).then_some(Refusal::BeyondDatasheet { parameter: name, sigmas, off, unit });
        table.checks.push(check);
        refusal
    }

    fn outliers(&self, calibration: &mut Calibration, table: &mut VerdictTable) -> Option<Refusal> {
        let (outliers, observations) = (self.found.outliers.len(), calibration.fit.tags_seen);
        let share = outliers as f64 / observations.max(1) as f64;
        if outliers > 0 {
            calibration.findings.push(Finding {
                kind: FindingKind::Outliers,
                name: "tag observations".to_owned(),
                size: Some(outliers as f64),
                unit: Some(FindingUnit::One),
                tool_error_m: None,
                time_s: None,
                repaired: share <= MAX_OUTLIERS,
            });
        }
        let check = Check::at_most("share of outliers among the tag observations", share, MAX_OUTLIERS);
        let refusal = (!check.holds).then_some(Refusal::Outliers { outliers, observations });
        table.checks.push(check);
        refusal
    }

    /// Compares the innovations of held-out views with their predicted size; refuses far beyond the limit, else warns.
    fn innovations(&self, table: &mut VerdictTable) -> Option<Refusal> {
        let sum = |f: fn(&Innovations) -> (f64, usize)| {
            self.innovations.iter().map(f).fold((0.0, 0), |(chi2, dof), (c, d)| (chi2 + c, dof + d))
        };
        let mut refusal = None;
        for (quantity, (chi2, dof)) in [
            (InnovationQuantity::CameraPoses, sum(|i| (i.camera_chi2, i.camera_dof))),
            (InnovationQuantity::Coordinates, sum(|i| (i.chi2, i.dof))),
        ] {
            if dof == 0 {
                continue;
            }
            let quantile = |p: f64| chi_square_quantile(p, dof) / dof as f64;
            let (per_dof, limit) = (chi2 / dof as f64, TAILS * quantile(1.0 - FALSE_ALARM));
            let what = format!("{}: chi-square per degree of freedom", quantity.name());
            let check = Check::at_most(what, per_dof, limit);
            if !check.holds {
                let expected = [quantile(0.025), quantile(0.975)];
                let found = Refusal::Innovations { quantity, per_dof, limit, expected };
                if per_dof <= FAR_BEYOND * limit {
                    let words = format!("{}; {}", found.cause(), found.remedy());
                    table.warnings.push(Warning::new(Code::InnovationsLarge, words));
                } else if refusal.is_none() {
                    refusal = Some(found);
                }
            }
            table.checks.push(check);
        }
        refusal
    }

    /// Warns if the remaining errors of a joint are correlated, in time or along its travel.
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
                    table.warnings.push(Warning::new(Code::ErrorsCorrelated, format!(
                        "{name}: errors of neighbouring views {along} are correlated ({sigmas:.1} sigma): the model \
                         lacks a smooth effect"
                    )));
                }
                table.checks.push(check);
            }
        }
    }

    /// Returns true if no tag shows the links between camera and tool.
    fn has_unseen_links(&self) -> bool {
        let robot = self.input.robot;
        robot.tool.mount.n_joints > robot.n_seen_joints() && !self.input.model.has(Block::GripperTag)
    }

    /// Standard deviation of each joint parameter over its prior's.
    fn shares_of_priors(&self) -> Vec<(Parameter, f64)> {
        let (covariance, sensors) = (self.found.joint_covariance(), &self.input.robot.sensors);
        let share = |(k, p): (usize, &Parameter)| {
            let prior_std = self.found.scales().prior_std(&sensors[p.joint], p.joint, p.kind);
            (*p, covariance[(k, k)].max(0.0).sqrt() / prior_std)
        };
        self.found.joint_parameters().iter().enumerate().map(share).collect()
    }

    fn table(&self, found: &Observability) -> ObservabilityTable {
        let robot = self.input.robot;
        let held = self.shares_of_priors().into_iter().filter_map(|(p, share)| {
            let is_named = !matches!(p.kind, ParameterKind::Shape(_)) && !p.is_past();
            (is_named && share > HELD)
                .then(|| format!("{}: {:.0} % of its prior's standard deviation remain", p.name(robot), 100.0 * share))
        });
        let [o1, o2, o3, o4, o5] = found.o;
        ObservabilityTable {
            rank: found.rank,
            n_parameters: found.n_parameters,
            condition_number: Some(found.condition_number).filter(|c| c.is_finite()),
            o1,
            o2,
            o3,
            o4,
            o5,
            null_space: found.null_space.iter().map(|direction| direction.words.clone()).collect(),
            held_by_prior: held.collect(),
        }
    }
}

fn error_name(error: ErrorKind) -> &'static str {
    match error {
        ErrorKind::Shift => "length",
        ErrorKind::Turn => "twist",
    }
}

fn geometry_error(robot: &Robot, result: &ScoreTestResult, limit: f64) -> GeometryError {
    let (element, joint) = match result.element {
        GeometryElement::Joint(0) => (BASE.to_owned(), Some(0)),
        GeometryElement::Joint(joint) => (robot.chain.joints()[joint - 1].child_link.clone(), Some(joint)),
        GeometryElement::Mount => ("camera mount".to_owned(), None),
    };
    GeometryError {
        element,
        joint: joint.map(|joint| robot.chain.joints()[joint].name.clone()),
        error: result.error,
        size: result.size.into(),
        chi2: result.chi2,
        limit,
        tool_error_m: result.tool_m,
    }
}

fn geometry_finding(result: &ScoreTestResult, geometry: &GeometryError) -> Finding {
    Finding {
        kind: match result.element {
            GeometryElement::Joint(0) => FindingKind::Base,
            GeometryElement::Joint(_) => FindingKind::Link,
            GeometryElement::Mount => FindingKind::CameraMount,
        },
        name: geometry.element.clone(),
        size: Some(result.size.norm()),
        unit: Some(match result.error {
            ErrorKind::Shift => FindingUnit::Metre,
            ErrorKind::Turn => FindingUnit::Radian,
        }),
        tool_error_m: Some(result.tool_m),
        time_s: None,
        repaired: false,
    }
}

fn worn(spec: &JointSensorSpec, std_rad: f64) -> Finding {
    Finding {
        kind: FindingKind::SensorWorn,
        name: spec.joint.clone(),
        size: Some(std_rad),
        unit: Some(FindingUnit::of_joint(spec.moves)),
        tool_error_m: None,
        time_s: None,
        repaired: false,
    }
}

/// Standard deviations by which von Neumann's ratio lies below 2 (von Neumann 1941): positive if neighbours are alike.
/// `None` below eight values.
fn serial_sigmas(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    if values.len() < LEAST {
        return None;
    }
    let squares: f64 = values.iter().map(|v| v * v).sum();
    let steps: f64 = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    // Squares about zero, not the mean, because the model's mean is zero. E = 2 (n - 1) / n, var = 4 (n - 2) / n^2 for
    // unit normal values, approximately.
    let ratio = steps / squares;
    (squares > 0.0).then(|| (2.0 * (n - 1.0) / n - ratio) / (2.0 * (n - 2.0).sqrt() / n))
}

/// Quantile of the standard normal distribution, by chi-square with one degree of freedom.
fn normal_quantile(p: f64) -> f64 {
    let side = chi_square_quantile((1.0 - 2.0 * p).abs(), 1).sqrt();
    if p < 0.5 { -side } else { side }
}
