//! Detection of sensors that slipped on their shafts during a capture; the slips are fitted as steps.
//!
//! The score test of steps proposes a joint and a change point. The fit is repeated with that step as a column, and the
//! change point moves if the test of further steps requires it. A step stays if two figures exceed
//! [`MIN_LIKELIHOOD_RATIO`] and what other links, mounts or tags would explain. The first is twice the logarithm of the
//! evidences' ratio, plus `2 ln(prior std / posterior std)` for the cost of the step's wide prior: a ratio of
//! likelihoods. The second is the square of the step in its standard deviations.

use crate::explain::constants::slips::{
    MAX_MOVES, MAX_P, MAX_STEPS, MIN_LIKELIHOOD_RATIO, MIN_STEP_RAD, MISPLACED, WORTH_A_FIT,
};
use crate::explain::failure_detection::FailureSearch;
use crate::explain::failures::Failure;
use crate::explain::model_selection::log_evidence_of_all;
use crate::explain::step_test::{MIN_SIDE, OffsetPrior, StepCandidate};
use crate::model::parameters::{Parameter, ParameterKind};
use crate::model::prior::steps_of;
use crate::model::scales::STEP_STD_RAD;
use crate::solve::estimate::Estimate;
use crate::solve::problem::past_derivative;
use crate::views::view::View;
use armcal_core::joints::MAX_JOINTS;
use armcal_core::time::Stamp;

/// Reference that a step is compared with.
struct Baseline {
    /// Logarithm of the evidence without the step.
    log_evidence: f64,
    /// Largest reduction of the cost by one other link, mount or tag.
    by_others: f64,
}

impl FailureSearch<'_> {
    /// Adds to `known` the slips that the views show; `found` is the estimate under `known`.
    pub(crate) fn with_slips(&self, known: Vec<Failure>, found: &Estimate<'_>) -> Vec<Failure> {
        if known.iter().filter(|failure| failure.is_step()).count() >= MAX_STEPS {
            return known;
        }
        let candidates = self.candidates(found).into_iter().filter(|step| step.likelihood_ratio > WORTH_A_FIT);
        let Some(step) = candidates.max_by(|a, b| a.likelihood_ratio.total_cmp(&b.likelihood_ratio)) else {
            return known;
        };
        if self.p_of_step(found, step.joint) > MAX_P {
            return known;
        }
        let baseline = Baseline { log_evidence: log_evidence_of_all(found), by_others: found.largest_other_chi2() };
        self.with_step(&known, &step, &baseline, (f64::NEG_INFINITY, MAX_MOVES)).unwrap_or(known)
    }

    /// Adds to `known` this step, or one of the same joint at a better change point, and further ones. `None` if the
    /// step is not significant, or not above `least`.
    fn with_step(
        &self,
        known: &[Failure],
        step: &StepCandidate,
        baseline: &Baseline,
        (least, moves): (f64, usize),
    ) -> Option<Vec<Failure>> {
        let mut with = known.to_vec();
        with.push(self.slip(step));
        let setup = self.setup(&with);
        let (better, _) = setup.estimate()?;
        let (size_rad, std_rad) = better.step(step.joint, self.views[step.since].end)?;
        let likelihood_ratio =
            2.0 * (log_evidence_of_all(&better) - baseline.log_evidence) + 2.0 * (STEP_STD_RAD / std_rad).ln();
        // An estimate that is better for another reason does not support the step.
        let likelihood_ratio = likelihood_ratio.min((size_rad / std_rad).powi(2));
        if likelihood_ratio <= least {
            return None;
        }
        let elsewhere = self.candidates(&better).into_iter().filter(|other| {
            other.joint == step.joint && other.since != step.since && other.likelihood_ratio > MISPLACED && moves > 0
        });
        let moved =
            elsewhere.filter_map(|other| self.with_step(known, &other, baseline, (likelihood_ratio, moves - 1))).next();
        if moved.is_some() {
            return moved;
        }
        let is_clear = likelihood_ratio > MIN_LIKELIHOOD_RATIO.max(baseline.by_others) && size_rad.abs() > MIN_STEP_RAD;
        is_clear.then(|| self.with_slips(with, &better))
    }

    /// Probability of as large a step of that joint's errors in a random order of the views.
    fn p_of_step(&self, found: &Estimate<'_>, joint: usize) -> f64 {
        let errors = found.joint_errors(&self.in_time());
        found.time_order(joint, &errors[joint]).p_of_step(MIN_SIDE)
    }

    fn in_time(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.views.len()).collect();
        order.sort_by_key(|&view_idx| (self.views[view_idx].end, view_idx));
        order
    }

    fn candidates(&self, found: &Estimate<'_>) -> Vec<StepCandidate> {
        let offsets = if self.prior.is_some() { OffsetPrior::Calibrated } else { OffsetPrior::Datasheet };
        found.likeliest_steps(&self.in_time(), offsets)
    }

    fn slip(&self, step: &StepCandidate) -> Failure {
        Failure::slip((step.joint, self.robot.sensors[step.joint].unit()), step.size_rad, self.views, step.since)
    }
}

impl Estimate<'_> {
    /// Estimate of a step that has a column, and its standard deviation, rad.
    pub(crate) fn step(&self, joint: usize, since: Stamp) -> Option<(f64, f64)> {
        let step = Parameter { joint, kind: ParameterKind::StepBefore(since) };
        let column = self.problem.layout.parameters.iter().position(|p| *p == step)?;
        Some((self.solved.state.joint[column], self.posterior.covariance[(column, column)].max(0.0).sqrt()))
    }

    /// Value of `parameter` before the sensor slipped, which the datasheet states.
    pub(crate) fn before_slips(&self, parameter: Parameter) -> f64 {
        let now = self.parameters().get(parameter);
        if parameter.kind != ParameterKind::Offset {
            return now;
        }
        let steps = steps_of(&self.problem.layout.parameters, parameter.joint);
        now + steps.into_iter().map(|column| self.solved.state.joint[column]).sum::<f64>()
    }

    /// Returns `views` with the readings before slips and walks changed to those of the sensors as they are at the last
    /// view.
    pub(crate) fn as_read_now(&self, views: &[View]) -> Vec<View> {
        let mut views = views.to_vec();
        let parameters = self.parameters();
        let sensors = parameters.sensors(self.problem.robot);
        let past = self.joint_parameters().iter().zip(self.solved.state.joint.iter()).filter(|(p, _)| p.is_past());
        let past: Vec<_> = past.collect();
        let mut off = [0.0; MAX_JOINTS];
        for view in &mut views {
            off.fill(0.0);
            for (parameter, value) in &past {
                let by = past_derivative(parameter.kind, self.model.walk, view.end).unwrap_or(0.0);
                off[parameter.joint] += by * *value;
            }
            let change = view.conditions.departure_from(&parameters.reference);
            for (joint, off_rad) in off.iter().enumerate().filter(|(_, off_rad)| **off_rad != 0.0) {
                let sensor = &sensors.models[joint];
                let angle_rad = sensor.correction.angle_rad(&sensor.spec, view.travel_rad[joint], &change, 0.0);
                view.travel_rad[joint] = sensor.travel_under_rad(angle_rad + off_rad, &change);
            }
        }
        views
    }

    /// Largest reduction of the cost by a change of one link, of the mount or of one tag.
    pub(crate) fn largest_other_chi2(&self) -> f64 {
        let by_links = self.score_tests(&self.view_angles()).into_iter().map(|result| result.chi2);
        let tags = 0..self.problem.robot.tags.len();
        let by_tags = tags.filter_map(|tag_idx| self.tag_departure(tag_idx)).map(|departure| departure.chi2);
        by_links.chain(by_tags).fold(0.0, f64::max)
    }
}
