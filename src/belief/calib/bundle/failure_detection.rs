//! Which joint failed, and how: one joint at a time is freed in all views, and the angles that the camera then shows
//! are held against its readings.
//!
//! A hypothesis must explain the data better than a sound arm by far: with the datasheet's scales, the sum of the
//! observations' chi-squares (each cut where a observation would be rejected), plus the joints' own and their
//! parameters' prior, plus `2 ln(prior std / posterior std)` for each reading that is given up (Laplace's approximation
//! of the evidence, MacKay 1992, with a round figure), must fall by `MARGIN`.

use crate::calib::bundle::estimate::Estimate;
use crate::calib::bundle::failure_pattern::{FailurePattern, Readings};
use crate::calib::bundle::failures::{
    FAR_RAD, FAR_SIGMAS, Failure, FailureAdjusted, FailureSource, MIN_VIEWS, SensorUse,
};
use crate::calib::bundle::input::HyperparameterMode;
use crate::calib::parameters::{JointParameters, ParameterKind};
use crate::calib::views::view::View;
use armcal_core::robot::{FailedKind, Robot};
use armcal_core::stats::quantile;

/// A joint whose errors over all views are larger than this and than twice the datasheet's linearity is looked at, rad.
const LARGE_STD_RAD: f64 = 0.15 * std::f64::consts::PI / 180.0;
/// A share of rejected observations that wrong ids alone do not make.
const MANY_REJECTED: f64 = 0.1;
/// What giving up one reading costs: 2 ln(1 rad / 1 mrad).
const PER_READING: f64 = 14.0;
/// A observation costs no more than this per coordinate: beyond it, it is rejected.
const MAX_PER_COORDINATE: f64 = 7.5;
/// The evidence that a failure needs: odds of e^15 to one.
const MARGIN: f64 = 30.0;
/// A reading moved if it spans more sigma of its noise than this.
const STILL_SIGMAS: f64 = 8.0;
/// At most this many failures are looked for beyond those that the readings alone show.
const MAX_FOUND: usize = 2;

/// The failures that `views` show beside the `declared` ones, which come first and with what was found of them; `found`
/// is the estimate under the declared ones alone.
pub fn failures(robot: &Robot, views: &[View], declared: &[Failure], found: Option<&Estimate<'_>>) -> Vec<Failure> {
    let mut known = declared.to_vec();
    let shown = views.iter().filter(|view| !view.tags.is_empty()).count();
    if shown < MIN_VIEWS {
        return known;
    }
    let search = Search { robot, views };
    let unclear: Vec<usize> = known.iter().filter(|f| f.kind == FailedKind::Jumps).map(|f| f.joint).collect();
    search.look_into_jumps(&mut known, &unclear);
    let n_before = robot.camera.mount.n_joints;
    let is_failed = |known: &[Failure], joint: usize| known.iter().any(|failure| failure.joint == joint);
    let still: Vec<usize> = (0..n_before).filter(|&j| !is_failed(&known, j) && search.is_still(j)).collect();
    if still.len() < n_before {
        search.classify_still(&mut known, &still);
    }
    if still.is_empty() && unclear.is_empty() && !found.is_none_or(|found| is_suspicious(robot, found)) {
        return known;
    }
    for _ in 0..MAX_FOUND {
        let without = search.score(&known);
        let candidates = (0..n_before).filter(|&joint| !is_failed(&known, joint));
        let mut best: Option<(f64, Failure)> = None;
        for failure in candidates.filter_map(|joint| search.hypothesis(&known, joint, FailureSource::Detected)) {
            let with: Vec<Failure> = known.iter().cloned().chain([failure.clone()]).collect();
            let score = search.score(&with);
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

struct Search<'a> {
    robot: &'a Robot,
    views: &'a [View],
}

impl Search<'_> {
    fn applied(&self, failures: &[Failure]) -> FailureAdjusted {
        FailureAdjusted::new(self.robot, self.views, failures, &JointParameters::default())
    }

    /// Whether the reading stands still over all views.
    fn is_still(&self, joint: usize) -> bool {
        let spec = &self.robot.sensors[joint];
        let travel = self.views.iter().filter(|view| !view.tags.is_empty()).map(|view| view.travel_rad[joint]);
        let (low, high) = travel.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), t| (l.min(t), h.max(t)));
        high - low <= STILL_SIGMAS * spec.noise_std_counts / spec.counts_per_rad.abs()
    }

    /// Angles of a joint by the camera, with its readings, under the `known` failures and this joint's sensor ignored.
    fn readings(&self, known: &[Failure], joint: usize) -> Option<Readings> {
        let mut freed: Vec<Failure> = known.iter().filter(|failure| failure.joint != joint).cloned().collect();
        freed.push(Failure::without_sensor(joint, FailedKind::Dead, FailureSource::Detected, self.views.len()));
        let applied = self.applied(&freed);
        let found = applied.estimate(HyperparameterMode::Given)?;
        Some(Readings::new(self.robot, self.views, joint, &found)).filter(|readings| readings.len() >= MIN_VIEWS)
    }

    fn hypothesis(&self, known: &[Failure], joint: usize, found: FailureSource) -> Option<Failure> {
        let readings = self.readings(known, joint)?;
        let pattern = readings.pattern(self.robot)?;
        Some(self.failure(joint, &pattern, found, &readings))
    }

    fn failure(&self, joint: usize, pattern: &FailurePattern, found: FailureSource, readings: &Readings) -> Failure {
        let all = Failure::without_sensor(joint, FailedKind::Dead, found, self.views.len());
        let evidence = readings.in_words(pattern, self.views);
        match pattern {
            FailurePattern::Locked(SensorUse::Used) => {
                let (kind, reading) = (FailedKind::Locked, SensorUse::Used);
                Failure { kind, reading, views: Vec::new(), evidence, ..all }
            }
            FailurePattern::Locked(SensorUse::Ignored) => Failure { kind: FailedKind::Locked, evidence, ..all },
            FailurePattern::Stuck => Failure { kind: FailedKind::Stuck, evidence, ..all },
            FailurePattern::Dead => Failure { evidence, ..all },
            FailurePattern::Single(views) => {
                let (kind, reading, views) = (FailedKind::Jumps, SensorUse::Used, views.clone());
                Failure { kind, reading, views, evidence, ..all }
            }
            FailurePattern::Lasting { before, since } => {
                let (kind, reading, views, since) = (FailedKind::Jumps, SensorUse::Used, before.clone(), Some(*since));
                Failure { kind, reading, views, since, step_rad: readings.step_rad(before.len()), evidence, ..all }
            }
        }
    }

    /// Declared jumps: when they were, where the views show it.
    fn look_into_jumps(&self, known: &mut [Failure], joints: &[usize]) {
        for &joint in joints {
            let found = self.hypothesis(known, joint, FailureSource::Declared);
            let Some(failure) = known.iter_mut().find(|failure| failure.joint == joint) else { continue };
            match found {
                Some(found) if found.kind == FailedKind::Jumps => *failure = found,
                _ => "no view shows a jump".clone_into(&mut failure.evidence),
            }
        }
    }

    /// Joints whose readings stand still: all sensors ignored first, then each by what the camera shows.
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
        applied.estimate(HyperparameterMode::Given).map_or(f64::MAX, |found| score(&found))
    }
}

/// What the data cost under an estimate, see the module.
fn score(found: &Estimate<'_>) -> f64 {
    let problem = &found.problem;
    let observations = problem.observations.iter().zip(&found.solved.normal.chi2);
    let mut sum: f64 =
        observations.map(|(seen, chi2)| chi2.min(MAX_PER_COORDINATE * seen.data.n_coordinates() as f64)).sum();
    let off = &found.solved.state.joint - &problem.prior.joint_mean;
    sum += (&problem.prior.joint_info * &off).dot(&off);
    for (view, errors) in problem.views.iter().zip(&found.solved.state.joint_error) {
        for (joint, error) in errors.iter().enumerate().take(problem.n_camera_joints) {
            let by_sensor = error.powi(2) / problem.joint_error_var(view, joint);
            sum += if view.is_free[joint] { PER_READING } else { by_sensor };
        }
    }
    sum
}

/// A gain or offset that no sensor of the datasheet has: a locked joint looks like one of gain zero.
fn is_beyond_datasheet(robot: &Robot, found: &Estimate<'_>) -> bool {
    let (sound, at) = (JointParameters::default(), found.parameters());
    found.joint_parameters().iter().any(|p| {
        let is_known = matches!(p.kind, ParameterKind::Gain | ParameterKind::Offset) && p.prior_std(robot) > 0.0;
        is_known && (at.get(*p) - sound.get(*p)).abs() > FAR_SIGMAS * p.prior_std(robot)
    })
}

/// Whether an estimate looks as if some sensor did not belong.
fn is_suspicious(robot: &Robot, found: &Estimate<'_>) -> bool {
    let problem = &found.problem;
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
        || (0..problem.n_camera_joints).any(|joint| {
            let large = LARGE_STD_RAD.max(2.0 * robot.sensors[joint].linearity_std_rad);
            if found.scales().joint_std_rad[joint] > large {
                return true;
            }
            let views = problem.views.iter().zip(&found.solved.state.joint_error);
            let errors: Vec<f64> =
                views.filter(|(view, _)| !view.is_free[joint]).map(|(_, errors)| errors[joint].abs()).collect();
            let sigma = 1.4826 * quantile(&errors, 0.5).unwrap_or(0.0);
            errors.iter().any(|error| *error > FAR_RAD.max(FAR_SIGMAS * sigma))
        })
}
