//! Levenberg-Marquardt: damped Gauss-Newton steps, the damping lowered after a step that helps and raised after one
//! that does not (Levenberg 1944, Marquardt 1963).
//!
//! The loop knows neither matrices nor states. A [`LeastSquares`] problem solves its own normal equations: dense,
//! sparse or with marginalised blocks. It keeps its memory, so that a step allocates only what the problem allocates.

/// A cost lowered by damped Gauss-Newton steps. The problem holds a linearized current state and one trial state.
pub trait LeastSquares {
    /// Cost at the current state.
    fn cost(&self) -> f64;

    /// Solves the damped normal equations and makes the trial state; `None` if they have no factor.
    fn propose(&mut self, damping: f64) -> Option<Proposal>;

    /// Cost at the trial state; `None` if it has none, for example with a point behind the camera.
    fn trial_cost(&mut self) -> Option<f64>;

    /// Makes the trial state the current one, and linearizes there.
    fn accept(&mut self);
}

/// A proposed step. A value that the problem does not know is infinite.
#[derive(Clone, Copy, Debug)]
pub struct Proposal {
    /// Length of the step, in the unit of [`StopRule::step_length`].
    pub length: f64,
    /// Decrease of the cost that the linearized problem predicts for the step.
    pub predicted_gain: f64,
}

/// Schedule of the damping.
#[derive(Clone, Copy, Debug)]
pub struct Damping {
    /// Damping at the start; after equations without a factor the damping is at least this.
    pub first: f64,
    /// Smallest damping after a step that lowers the cost.
    pub min: f64,
    /// Largest damping; the search ends above it.
    pub max: f64,
    /// Factor after a step that lowers the cost.
    pub down: f64,
    /// Factor after a step that does not lower the cost, or equations without a factor.
    pub up: f64,
    /// Smallest damping after a step that does not lower the cost.
    pub min_after_rejection: f64,
}

/// Rules that stop the search. A rule with the value zero never stops it.
#[derive(Clone, Copy, Debug)]
pub struct StopRule {
    /// Maximum number of proposed steps.
    pub max_iterations: usize,
    /// Limit of the predicted gain over the cost.
    pub predicted_gain: f64,
    /// Limit of the gain of a step over the cost before it.
    pub gain: f64,
    /// Limit of the length of an accepted step, in the problem's own unit.
    pub step_length: f64,
    /// Limit of the cost.
    pub cost: f64,
    /// Share of the cost by which a step may raise the cost and still be accepted.
    pub slack: f64,
    /// Gain over the cost that is within the rounding of a sum. A step that should gain no more than this, and does
    /// not, ends the search.
    pub rounding: f64,
}

impl StopRule {
    /// Returns the rule that stops only after this number of iterations.
    #[must_use]
    pub const fn after(max_iterations: usize) -> Self {
        Self { max_iterations, predicted_gain: 0.0, gain: 0.0, step_length: 0.0, cost: 0.0, slack: 0.0, rounding: 0.0 }
    }
}

/// Result of a solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// A rule for a minimum stopped the search.
    Converged,
    /// The budget of evaluations ran out, or a parameter came to rest on its bound.
    Stalled,
    /// The data determine no minimum.
    Degenerate,
}

impl Outcome {
    /// Returns the name that files use.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Stalled => "stalled",
            Self::Degenerate => "degenerate",
        }
    }
}

/// Reason why the loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// A step gains too little: [`StopRule::gain`], [`StopRule::predicted_gain`].
    Gain,
    /// The step was shorter than [`StopRule::step_length`].
    StepLength,
    /// The cost was below [`StopRule::cost`].
    Cost,
    /// No step gains more than the rounding of the cost.
    Rounding,
    /// The number of steps reached [`StopRule::max_iterations`].
    Iterations,
    /// No step lowers the cost, not even a very short one.
    Damping,
    /// The normal equations have no factor at any damping.
    Singular,
    /// The cost is not finite.
    NotFinite,
}

/// Record of a search.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// Reason for the end of the search.
    pub stop: Stop,
    /// Number of steps proposed.
    pub iterations: usize,
    /// Gain over the cost before it of the last step that lowered the cost; 1 if none did.
    pub last_gain: f64,
}

impl Report {
    /// Returns the outcome that the stop implies.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        match self.stop {
            Stop::Gain | Stop::StepLength | Stop::Cost | Stop::Rounding => Outcome::Converged,
            Stop::Iterations | Stop::Damping => Outcome::Stalled,
            Stop::Singular | Stop::NotFinite => Outcome::Degenerate,
        }
    }
}

/// Cost that counts as zero and cannot be lowered.
const TINY_COST: f64 = 1e-300;

/// Lowers the cost of `problem`, starting from its current state.
pub fn minimize(problem: &mut impl LeastSquares, damping: &Damping, stop: &StopRule) -> Report {
    let mut level = damping.first;
    let mut report = Report { stop: Stop::Iterations, iterations: 0, last_gain: 1.0 };
    let mut last_predicted_gain = f64::INFINITY;
    while report.iterations < stop.max_iterations {
        let cost = problem.cost();
        if cost < stop.cost {
            return Report { stop: Stop::Cost, ..report };
        }
        let Some(Proposal { length, predicted_gain }) = problem.propose(level) else {
            report.iterations += 1;
            level = (level * damping.up).max(damping.first);
            if level > damping.max || level == 0.0 {
                return Report { stop: Stop::Singular, ..report };
            }
            continue;
        };
        if predicted_gain.abs() <= stop.predicted_gain * cost.max(TINY_COST) {
            let stop = if cost.is_finite() { Stop::Gain } else { Stop::NotFinite };
            return Report { stop, ..report };
        }
        report.iterations += 1;
        last_predicted_gain = predicted_gain.abs();
        let trial = problem.trial_cost();
        // NaN is no lower cost either.
        if let Some(trial) = trial.filter(|trial| *trial <= cost * (1.0 + stop.slack)) {
            problem.accept();
            level = (level * damping.down).max(damping.min);
            report.last_gain = (cost - trial) / cost;
            if length < stop.step_length {
                return Report { stop: Stop::StepLength, ..report };
            }
            if stop.gain > 0.0 && cost - trial <= stop.gain * cost {
                return Report { stop: Stop::Gain, ..report };
            }
            continue;
        }
        let is_rounding = predicted_gain.abs() <= stop.rounding * cost
            || trial.is_some_and(|trial| stop.gain > 0.0 && trial - cost <= stop.rounding * cost);
        if is_rounding {
            return Report { stop: Stop::Rounding, ..report };
        }
        level = (level * damping.up).max(damping.min_after_rejection);
        if level > damping.max {
            let stop = if length < stop.step_length { Stop::Rounding } else { Stop::Damping };
            return Report { stop, ..report };
        }
    }
    if problem.cost() < stop.cost {
        report.stop = Stop::Cost;
    } else if last_predicted_gain <= stop.rounding * problem.cost() {
        // The steps alternate between states that differ only by rounding.
        report.stop = Stop::Rounding;
    }
    report
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    const DAMPING: Damping =
        Damping { first: 1e-3, min: 1e-12, max: 1e12, down: 0.1, up: 10.0, min_after_rejection: 0.0 };

    /// Rosenbrock's valley: residuals `10 (y - x^2)` and `1 - x`.
    struct Valley {
        at: Vector2<f64>,
        trial: Vector2<f64>,
        evaluations: usize,
    }

    impl Valley {
        fn residual(at: &Vector2<f64>) -> Vector2<f64> {
            Vector2::new(10.0 * (at.y - at.x * at.x), 1.0 - at.x)
        }
    }

    impl LeastSquares for Valley {
        fn cost(&self) -> f64 {
            Self::residual(&self.at).norm_squared()
        }

        fn propose(&mut self, damping: f64) -> Option<Proposal> {
            let jacobian = Matrix2::new(-20.0 * self.at.x, 10.0, -1.0, 0.0);
            let mut normal = jacobian.transpose() * jacobian;
            for k in 0..2 {
                normal[(k, k)] *= 1.0 + damping;
            }
            let right = -jacobian.transpose() * Self::residual(&self.at);
            let step = normal.cholesky()?.solve(&right);
            self.trial = self.at + step;
            Some(Proposal { length: step.norm(), predicted_gain: step.dot(&right) })
        }

        fn trial_cost(&mut self) -> Option<f64> {
            self.evaluations += 1;
            Some(Self::residual(&self.trial).norm_squared())
        }

        fn accept(&mut self) {
            self.at = self.trial;
        }
    }

    fn valley() -> Valley {
        Valley { at: Vector2::new(-1.2, 1.0), trial: Vector2::zeros(), evaluations: 0 }
    }

    #[test]
    fn each_stop_rule_ends_at_the_minimum_or_says_that_it_did_not() {
        for (rule, expected) in [
            (StopRule { predicted_gain: 1e-15, ..StopRule::after(200) }, Stop::Gain),
            (StopRule { gain: 1e-15, ..StopRule::after(200) }, Stop::Gain),
            (StopRule { step_length: 1e-9, ..StopRule::after(200) }, Stop::StepLength),
            (StopRule { cost: 1e-20, ..StopRule::after(200) }, Stop::Cost),
        ] {
            let mut problem = valley();
            let report = minimize(&mut problem, &DAMPING, &rule);
            assert_eq!((report.stop, report.outcome()), (expected, Outcome::Converged));
            assert!((problem.at - Vector2::new(1.0, 1.0)).norm() < 1e-6, "{rule:?}: {}", problem.at);
            assert!(problem.evaluations <= report.iterations);
        }
        let report = minimize(&mut valley(), &DAMPING, &StopRule { gain: 1e-15, ..StopRule::after(3) });
        assert_eq!((report.stop, report.iterations, report.outcome()), (Stop::Iterations, 3, Outcome::Stalled));
    }

    /// A problem whose cost no step lowers, or whose equations have no factor.
    struct Wall {
        has_factor: bool,
    }

    impl LeastSquares for Wall {
        fn cost(&self) -> f64 {
            1.0
        }

        fn propose(&mut self, _: f64) -> Option<Proposal> {
            self.has_factor.then_some(Proposal { length: 1.0, predicted_gain: 1.0 })
        }

        fn trial_cost(&mut self) -> Option<f64> {
            None
        }

        fn accept(&mut self) {
            unreachable!("no trial helps");
        }
    }

    #[test]
    fn what_cannot_be_lowered_stalls_and_what_has_no_factor_is_degenerate() {
        for (has_factor, stop, outcome) in
            [(true, Stop::Damping, Outcome::Stalled), (false, Stop::Singular, Outcome::Degenerate)]
        {
            let report = minimize(&mut Wall { has_factor }, &DAMPING, &StopRule::after(1000));
            assert_eq!((report.stop, report.outcome()), (stop, outcome));
        }
    }

    /// A problem that steps between two states whose costs differ only by rounding.
    struct Swing {
        cost: f64,
    }

    impl LeastSquares for Swing {
        fn cost(&self) -> f64 {
            self.cost
        }

        fn propose(&mut self, _: f64) -> Option<Proposal> {
            Some(Proposal { length: f64::INFINITY, predicted_gain: 1e-13 })
        }

        fn trial_cost(&mut self) -> Option<f64> {
            Some(1.0 + 1e-14 - (self.cost - 1.0))
        }

        fn accept(&mut self) {
            self.cost = 1.0 + 1e-14 - (self.cost - 1.0);
        }
    }

    #[test]
    fn swinging_within_rounding_is_converged() {
        let rule = StopRule { predicted_gain: 1e-15, slack: 1e-13, rounding: 1e-11, ..StopRule::after(20) };
        let report = minimize(&mut Swing { cost: 1.0 }, &DAMPING, &rule);
        assert_eq!((report.stop, report.iterations, report.outcome()), (Stop::Rounding, 20, Outcome::Converged));
        let report = minimize(&mut Swing { cost: 1.0 }, &DAMPING, &StopRule { rounding: 0.0, ..rule });
        assert_eq!(report.outcome(), Outcome::Stalled);
    }
}
