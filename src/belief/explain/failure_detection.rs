//! Detection of the joint that failed, and of the failure. One joint at a time is free in all views; the angles that
//! the camera then shows are compared with its readings.
//!
//! A hypothesis must explain the data far better than a sound arm: its score must be lower by `MARGIN`. The score, with
//! the datasheet's scales, is the sum of the observations' chi-squares, each cut at the rejection threshold, and of
//! three more terms. These are the joints' own prior, the prior of their parameters, and
//! `2 ln(prior std / posterior std)` for each reading that is given up. The last is Laplace's approximation of the
//! evidence (MacKay 1992), with a rounded value.

use crate::explain::angles_by_camera::{distance_cost, has_known_mount, seen_angles};
use crate::explain::constants::failure_detection::{
    LARGE_STD_RAD, MANY_REJECTED, MARGIN, MAX_FOUND, MAX_OVER_LINEARITY, MAX_PAIRS, PER_READING, PER_STEP, RANKED_VIEWS,
};
use crate::explain::drawing::Drawing;
use crate::explain::failure_pattern::{FailurePattern, MIN_STILL_VIEWS, Readings, n_still};
use crate::explain::failures::{FAR_RAD, FAR_SIGMAS, Failure, FailureAdjusted, FailureSource, MIN_VIEWS, SensorUse};
use crate::explain::model_selection::log_evidence_of_all;
use crate::explain::setup::BundleSetup;
use crate::file::calibration::Calibration;
use crate::measure::ObservationTerm;
use crate::model::parameters::{JointParameters, Parameter, ParameterKind};
use crate::model::prior::steps_of;
use crate::model::scales::Hyperparameters;
use crate::solve::constants::outliers::LIMITS;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::HyperparameterMode;
use crate::solve::outliers::rejected;
use crate::views::constants::external_board::SIGMA_OF_MEDIAN;
use crate::views::view::View;
use armcal_core::robot::{FailedKind, Robot};
use armcal_core::stats::quantile;

/// Arm and views in which failures are searched for.
pub(crate) struct FailureSearch<'a> {
    pub robot: &'a Robot,
    pub views: &'a [View],
    /// Prior of the estimates, in addition to the datasheet.
    pub prior: Option<&'a Calibration>,
    /// Departures from the nominal model that are estimated, too.
    pub drawing: &'a Drawing,
}

impl FailureSearch<'_> {
    /// Failures that the views show in addition to the `declared` ones, which come first and include new evidence.
    /// `found` is the estimate under the declared ones only.
    pub(crate) fn failures(&self, declared: &[Failure], found: Option<&Estimate<'_>>) -> Vec<Failure> {
        let mut known = declared.to_vec();
        let shown = self.views.iter().filter(|view| !view.tags.is_empty()).count();
        if shown < MIN_VIEWS {
            return known;
        }
        let unclear: Vec<usize> = known.iter().filter(|f| f.kind == FailedKind::Jumps).map(|f| f.joint).collect();
        self.look_into_jumps(&mut known, &unclear);
        let n_before = self.robot.n_seen_joints();
        let still: Vec<usize> = (0..n_before).filter(|&j| !is_failed(&known, j) && self.is_still(j)).collect();
        if still.len() < n_before {
            self.classify_still(&mut known, &still);
        }
        if known == declared {
            return self.failures_beside(known, found);
        }
        self.failures_beside(known.clone(), self.setup(&known).estimate().as_ref().map(|(found, _)| found))
    }

    /// Returns a joint that is declared locked although its readings and the camera show it move, and the range of the
    /// readings, rad.
    pub(crate) fn moves_though_locked(&self, declared: &[Failure]) -> Option<(usize, f64)> {
        let locked = declared.iter().filter(|failure| failure.kind == FailedKind::Locked);
        locked.map(|failure| failure.joint).find_map(|joint| {
            let readings = self.shown_with_free(declared, joint, f64::INFINITY)?;
            Some((joint, readings.moved_rad()?))
        })
    }

    /// Adds to `known` the failures that the estimate under them shows: slips, then sensors without a reading, one at a
    /// time, then two at once.
    fn failures_beside(&self, known: Vec<Failure>, found: Option<&Estimate<'_>>) -> Vec<Failure> {
        let is_sound = found.is_some_and(|found| !is_suspicious(found));
        let slips = found.map_or_else(|| known.clone(), |found| self.with_slips(known.clone(), found));
        if slips == known && is_sound || slips != known && !self.is_suspicious_under(&slips) {
            return slips;
        }
        let mut best = self.one_by_one(&known);
        if slips != known {
            best = self.likelier(best, self.one_by_one(&slips));
        }
        if self.is_suspicious_under(&best)
            && let Some(both) = self.two_at_once(&known)
        {
            best = self.likelier(best, both);
        }
        if best == known {
            return known;
        }
        let setup = self.setup(&best);
        let Some((better, _)) = setup.estimate() else { return known };
        if found.is_some_and(|found| !explains_most(found, &better)) {
            return known;
        }
        self.with_slips(best, &better)
    }

    pub(crate) fn setup(&self, known: &[Failure]) -> BundleSetup {
        BundleSetup::new(self.robot, self.views, known, self.prior).with_drawing(self.drawing)
    }

    fn is_suspicious_under(&self, known: &[Failure]) -> bool {
        self.setup(known).estimate().is_none_or(|(found, _)| is_suspicious(&found))
    }

    fn likelier(&self, a: Vec<Failure>, b: Vec<Failure>) -> Vec<Failure> {
        if a == b || self.score(&a) <= self.score(&b) { a } else { b }
    }

    fn one_by_one(&self, known: &[Failure]) -> Vec<Failure> {
        let mut known = known.to_vec();
        for _ in 0..MAX_FOUND {
            let without = self.score(&known);
            let candidates = (0..self.robot.n_seen_joints()).filter(|&joint| !is_failed(&known, joint));
            let mut best: Option<(f64, Failure)> = None;
            let of_joint = |joint| self.hypothesis_below(&known, joint, FailureSource::Detected, without - MARGIN);
            for failure in candidates.filter_map(of_joint) {
                let with: Vec<Failure> = known.iter().cloned().chain([failure.clone()]).collect();
                let score = self.score(&with);
                if best.as_ref().is_none_or(|(least, _)| score < *least) {
                    best = Some((score, failure));
                }
            }
            match best {
                Some((score, failure)) if without - score > MARGIN => known.push(failure),
                _ => break,
            }
        }
        known
    }

    /// Two sensors whose failures together explain the most, each by the angles that the camera shows with both
    /// ignored.
    fn two_at_once(&self, known: &[Failure]) -> Option<Vec<Failure>> {
        let most = self.score(known) - 2.0 * MARGIN;
        let both = self.likely_pairs(known).into_iter().filter_map(|pair| {
            let mut with = known.to_vec();
            with.extend(self.hypotheses(known, pair, most)?);
            Some((self.score(&with), with))
        });
        let (score, with) = both.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (score < most).then_some(with)
    }

    /// Pairs of joints that place the tags nearest to their survey when turned to the angles that the camera shows. All
    /// pairs if the mount is not known.
    pub(crate) fn likely_pairs(&self, known: &[Failure]) -> Vec<[usize; 2]> {
        let n = self.robot.n_seen_joints();
        let free: Vec<usize> = (0..n).filter(|&joint| !is_failed(known, joint)).collect();
        let pairs = free.iter().enumerate().flat_map(|(k, &a)| free[k + 1..].iter().map(move |&b| [a, b]));
        let pairs: Vec<[usize; 2]> = pairs.collect();
        if pairs.len() <= MAX_PAIRS || !has_known_mount(self.robot) {
            return pairs;
        }
        let FailureAdjusted { robot, views, .. } = self.applied(known);
        let shown: Vec<&View> = views.iter().filter(|view| !view.tags.is_empty()).collect();
        let stride = shown.len().div_ceil(RANKED_VIEWS).max(1);
        let cost = |pair: [usize; 2]| -> f64 {
            let of_view = |view: &&View| {
                let joints = (0..n).filter(|&joint| view.is_free[joint] || pair.contains(&joint));
                let angles = seen_angles(&robot, view, &joints.collect::<Vec<_>>(), &JointParameters::default());
                distance_cost(&robot, view, &angles)
            };
            shown.iter().step_by(stride).map(of_view).sum()
        };
        let mut with_costs: Vec<(f64, [usize; 2])> = pairs.into_iter().map(|pair| (cost(pair), pair)).collect();
        with_costs.sort_by(|a, b| a.0.total_cmp(&b.0));
        with_costs.into_iter().take(MAX_PAIRS).map(|(_, pair)| pair).collect()
    }

    /// Failures of both joints; `None` if none scores below `most`.
    fn hypotheses(&self, known: &[Failure], pair: [usize; 2], most: f64) -> Option<[Failure; 2]> {
        let ignored = pair
            .map(|joint| Failure::without_sensor(joint, FailedKind::Dead, FailureSource::Detected, self.views.len()));
        let mut freed = known.to_vec();
        freed.extend(ignored);
        let applied = self.applied(&freed);
        let found = self.estimate(&applied).filter(|found| self.may_score(found, pair.len(), most))?;
        let [a, b] = pair.map(|joint| self.failure_of(joint, &found, FailureSource::Detected));
        Some([a?, b?])
    }

    fn applied(&self, failures: &[Failure]) -> FailureAdjusted {
        FailureAdjusted::new(self.robot, self.views, failures, &JointParameters::default())
    }

    /// Estimates under the datasheet's scales.
    fn estimate<'b>(&self, applied: &'b FailureAdjusted) -> Option<Estimate<'b>> {
        let mut input = applied.input(HyperparameterMode::Given);
        self.drawing.apply(&mut input);
        estimate(&input)
    }

    /// Returns true if the reading stands still over all views, or since one of them.
    fn is_still(&self, joint: usize) -> bool {
        let mut shown: Vec<&View> = self.views.iter().filter(|view| !view.tags.is_empty()).collect();
        shown.sort_by_key(|view| view.end);
        let travel_rad: Vec<f64> = shown.iter().map(|view| view.travel_rad[joint]).collect();
        n_still(&travel_rad, &self.robot.sensors[joint]) >= MIN_STILL_VIEWS.min(travel_rad.len())
    }

    /// Returns true if failures of the `n` joints that `found` has free may score below `most`. Free joints fit the
    /// views best, and a failure only saves the cost of readings that it does not give up.
    fn may_score(&self, found: &Estimate<'_>, n: usize, most: f64) -> bool {
        score(found) - PER_READING * (n * self.views.len()) as f64 <= most
    }

    /// Failure of a joint's sensor under the `known` failures, with this sensor ignored.
    fn hypothesis(&self, known: &[Failure], joint: usize, source: FailureSource) -> Option<Failure> {
        self.hypothesis_below(known, joint, source, f64::INFINITY)
    }

    /// Failure as by `hypothesis`; `None` if no failure of that joint scores below `most`.
    fn hypothesis_below(&self, known: &[Failure], joint: usize, source: FailureSource, most: f64) -> Option<Failure> {
        self.failure_by(&self.shown_with_free(known, joint, most)?, source)
    }

    /// Readings of a joint and the angles that the camera shows with its sensor ignored; `None` if no failure of it
    /// scores below `most`.
    fn shown_with_free(&self, known: &[Failure], joint: usize, most: f64) -> Option<Readings> {
        let mut freed: Vec<Failure> = known.iter().filter(|failure| failure.joint != joint).cloned().collect();
        freed.push(Failure::without_sensor(joint, FailedKind::Dead, FailureSource::Detected, self.views.len()));
        let applied = self.applied(&freed);
        let found = self.estimate(&applied).filter(|found| self.may_score(found, 1, most))?;
        Some(Readings::new(self.robot, self.views, joint, &found))
    }

    /// Failure of a joint's sensor by an estimate in which the joint is free.
    fn failure_of(&self, joint: usize, found: &Estimate<'_>, source: FailureSource) -> Option<Failure> {
        self.failure_by(&Readings::new(self.robot, self.views, joint, found), source)
    }

    /// Failure that readings and angles of a joint show, if enough views do.
    fn failure_by(&self, readings: &Readings, source: FailureSource) -> Option<Failure> {
        if readings.len() < MIN_VIEWS {
            return None;
        }
        let pattern = readings.pattern(self.robot)?;
        Some(self.failure(&pattern, source, readings))
    }

    fn failure(&self, pattern: &FailurePattern, found: FailureSource, readings: &Readings) -> Failure {
        let joint = readings.joint();
        let all = Failure::without_sensor(joint, FailedKind::Dead, found, self.views.len());
        let evidence = readings.in_words(&self.robot.sensors[joint], pattern, self.views);
        match pattern {
            FailurePattern::Still(kind, SensorUse::Used) => {
                Failure { kind: *kind, reading: SensorUse::Used, views: Vec::new(), evidence, ..all }
            }
            FailurePattern::Still(kind, SensorUse::Ignored) => Failure { kind: *kind, evidence, ..all },
            FailurePattern::Reversed(line) => Failure { line: Some(*line), evidence, ..all },
            FailurePattern::Scaled(line) => {
                Failure { line: Some(*line), reading: SensorUse::Used, views: Vec::new(), evidence, ..all }
            }
            FailurePattern::Stuck(_) => Failure { kind: FailedKind::Stuck, evidence, ..all },
            FailurePattern::Dead => Failure { evidence, ..all },
            FailurePattern::Single(views) => {
                let (kind, reading, views) = (FailedKind::Jumps, SensorUse::Used, views.clone());
                Failure { kind, reading, views, evidence, ..all }
            }
            FailurePattern::Lost { since, .. } => {
                let (reading, first) = (SensorUse::Used, self.views[*since].end);
                let views = (0..self.views.len()).filter(|&k| self.views[k].end >= first).collect();
                Failure { reading, views, lost_since: Some(*since), evidence, ..all }
            }
            FailurePattern::Lasting { since, step_rad } => Failure {
                found,
                ..Failure::slip((joint, self.robot.sensors[joint].unit()), *step_rad, self.views, *since)
            },
        }
    }

    /// Finds the views of declared jumps, if the views show them.
    fn look_into_jumps(&self, known: &mut [Failure], joints: &[usize]) {
        for &joint in joints {
            let found = self.hypothesis(known, joint, FailureSource::Declared);
            let Some(failure) = known.iter_mut().find(|failure| failure.joint == joint) else { continue };
            match found {
                Some(found) if found.kind == FailedKind::Jumps || found.lost_since.is_some() => *failure = found,
                _ => "no view shows a jump".clone_into(&mut failure.evidence),
            }
        }
    }

    /// Classifies joints whose readings stand still: ignores all these sensors first, then judges each by what the
    /// camera shows.
    fn classify_still(&self, known: &mut Vec<Failure>, joints: &[usize]) {
        let ignored = |&joint: &usize| {
            Failure::without_sensor(joint, FailedKind::Dead, FailureSource::Detected, self.views.len())
        };
        let mut all = known.clone();
        all.extend(joints.iter().map(ignored));
        for &joint in joints {
            if let Some(failure) = self.hypothesis(&all, joint, FailureSource::Detected) {
                known.push(failure);
            }
        }
    }

    fn score(&self, failures: &[Failure]) -> f64 {
        let applied = self.applied(failures);
        self.estimate(&applied).map_or(f64::MAX, |found| score(&found))
    }
}

fn is_failed(known: &[Failure], joint: usize) -> bool {
    known.iter().any(|failure| failure.joint == joint)
}

/// Returns true if `better` is likelier than `without` by more than other links, mounts or tags would be.
fn explains_most(without: &Estimate<'_>, better: &Estimate<'_>) -> bool {
    2.0 * (log_evidence_of_all(better) - log_evidence_of_all(without)) > MARGIN.max(without.largest_other_chi2())
}

/// Score of the data under an estimate, see the module.
pub(crate) fn score(found: &Estimate<'_>) -> f64 {
    let problem = &found.problem;
    let observations = problem.observations.iter().zip(&found.solved.normal.chi2);
    let [limit, _] = LIMITS;
    let of_observation = |(seen, chi2): (&ObservationTerm, &f64)| {
        let of_corners = if seen.is_used { rejected(seen).chi2 } else { 0.0 };
        chi2.min(limit * seen.data.n_coordinates() as f64) + of_corners
    };
    let mut sum: f64 = observations.map(of_observation).sum();
    let off = &found.solved.state.joint - &problem.prior.joint_mean;
    sum += (&problem.prior.information.matrix * &off).dot(&off);
    sum += PER_STEP * problem.layout.parameters.iter().filter(|p| p.is_step()).count() as f64;
    for (view, errors) in problem.views.iter().zip(&found.solved.state.joint_error) {
        for (joint, error) in errors.iter().enumerate().take(problem.n_seen_joints) {
            let by_sensor = error.powi(2) / problem.joint_error_var(view, joint);
            sum += if view.is_free[joint] { PER_READING } else { by_sensor };
        }
    }
    sum
}

/// Returns true if a gain or offset is beyond any sensor of the datasheet: a locked joint looks like one of gain zero.
fn is_beyond_datasheet(robot: &Robot, found: &Estimate<'_>) -> bool {
    let sound = JointParameters::default();
    found.joint_parameters().iter().enumerate().any(|(column, p)| {
        let is_known = matches!(p.kind, ParameterKind::Gain | ParameterKind::Offset) && p.prior_std(robot) > 0.0;
        let limit = FAR_SIGMAS * p.prior_std(robot);
        // The nonlinearity may have taken up what the gain did not.
        let slope_off = if p.kind == ParameterKind::Gain { (found.slope(*p, column) - 1.0).abs() } else { 0.0 };
        is_known && ((found.before_slips(*p) - sound.get(*p)).abs() > limit || slope_off > limit)
    })
}

impl Estimate<'_> {
    /// Slope of the joint's estimated angles by its readings, without its sensor's slips; one if the readings do not
    /// move.
    fn slope(&self, gain: Parameter, column: usize) -> f64 {
        let problem = &self.problem;
        let views = (0..problem.views.len()).filter(|&view_idx| self.uses(view_idx));
        let steps = steps_of(&problem.layout.parameters, gain.joint);
        let point = |k: usize| {
            let (basis, state) = (&problem.views[k].basis, &self.solved.state);
            let slipped_rad: f64 = steps.iter().map(|&step| basis[step] * state.joint[step]).sum();
            [basis[column], problem.angles(k, state)[gain.joint] - slipped_rad]
        };
        let points: Vec<[f64; 2]> = views.map(point).collect();
        let n = points.len().max(1) as f64;
        let mean = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / n);
        let sum = |axis: usize| points.iter().map(|p| (p[0] - mean[0]) * (p[axis] - mean[axis])).sum::<f64>();
        let squares = sum(0);
        if squares > 0.0 { sum(1) / squares } else { 1.0 }
    }
}

/// Error between views above which a joint's sensor does not match its datasheet, rad; `stated`: the datasheet's
/// scales.
pub(crate) fn most_unsteady_rad(robot: &Robot, joint: usize, stated: &Hyperparameters) -> f64 {
    let spec = &robot.sensors[joint];
    // Reading noise is not a sensor error. It is the least limit, for a datasheet that states zero linearity.
    let noise_rad = (spec.noise_std_counts / spec.counts_per_rad).abs();
    MAX_OVER_LINEARITY * spec.linearity_std_rad.max(noise_rad).max(stated.joint_std_rad[joint])
}

/// Returns true if the sensor of a joint would be refused for its errors between views.
pub(crate) fn has_unsteady_sensor(found: &Estimate<'_>) -> bool {
    let robot = found.problem.robot;
    let stated = Hyperparameters::datasheet(robot);
    let is_unsteady = |joint: usize| found.scales().joint_std_rad[joint] > most_unsteady_rad(robot, joint, &stated);
    (0..found.problem.n_seen_joints).any(is_unsteady)
}

/// Returns true if an estimate looks as if some sensor failed.
pub(crate) fn is_suspicious(found: &Estimate<'_>) -> bool {
    let (problem, robot) = (&found.problem, found.problem.robot);
    let used = |observations: &std::ops::Range<usize>| {
        problem.observations[observations.clone()].iter().filter(|observation| observation.is_used).count()
    };
    let (mut n, mut n_used) = (0, 0);
    for view in problem.views.iter().filter(|view| !view.observations.is_empty()) {
        let n_here = used(&view.observations);
        if n_here == 0 {
            return true;
        }
        (n, n_used) = (n + view.observations.len(), n_used + n_here);
    }
    if (n - n_used) as f64 > MANY_REJECTED * n as f64 {
        return true;
    }
    is_beyond_datasheet(robot, found)
        || (0..problem.n_seen_joints).any(|joint| {
            let large = LARGE_STD_RAD.max(2.0 * robot.sensors[joint].linearity_std_rad);
            if found.scales().joint_std_rad[joint] > large {
                return true;
            }
            let views = problem.views.iter().zip(&found.solved.state.joint_error);
            let errors: Vec<f64> =
                views.filter(|(view, _)| !view.is_free[joint]).map(|(_, errors)| errors[joint].abs()).collect();
            let sigma = SIGMA_OF_MEDIAN * quantile(&errors, 0.5).unwrap_or(0.0);
            errors.iter().any(|error| *error > FAR_RAD.max(FAR_SIGMAS * sigma))
        })
}
