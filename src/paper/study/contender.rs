//! A method with its settings.

use crate::minimum_variance::Gauge;
use crate::position_method::PositionMethod;
use crate::search::{PositionSearch, Scaling, SearchOptions};
use crate::study::scene::{Draw, Guess, Setting};
use armcal_belief::calib::bundle::{BundleInput, HyperparameterMode, estimate};
use armcal_belief::calib::{PositionProblem, Solution};
use armcal_belief::model::{Hyperparameters, JointParameters, Model, Parameter, ParameterKind};
use armcal_core::numeric::Outcome;

/// Solver of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    Position(PositionMethod),
    /// Maximum a posteriori on positions, noise fitted; the model of this study's data: gains and offsets, exact mount
    /// and map.
    Bundle,
}

/// A method with its settings: one line of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MethodVariant {
    pub name: &'static str,
    pub solver: Solver,
    pub gauge: Gauge,
    pub options: SearchOptions,
}

impl MethodVariant {
    fn of(name: &'static str, method: PositionMethod, gauge: Gauge) -> Self {
        Self { name, solver: Solver::Position(method), gauge, options: SearchOptions::default() }
    }

    #[must_use]
    pub fn minimum_distance() -> Self {
        Self::of("minimum distance", PositionMethod::MinimumDistance, Gauge::Free)
    }

    #[must_use]
    pub fn minimum_variance(gauge: Gauge) -> Self {
        let name = match gauge {
            Gauge::Free => "minimum variance, gauge free",
            Gauge::Fixed => "minimum variance, gauge fixed",
        };
        Self::of(name, PositionMethod::MinimumVariance, gauge)
    }

    #[must_use]
    pub fn least_squares() -> Self {
        Self::of("least squares", PositionMethod::LeastSquares, Gauge::Free)
    }

    #[must_use]
    pub fn bundle() -> Self {
        Self { name: "bundle", solver: Solver::Bundle, gauge: Gauge::Free, options: SearchOptions::default() }
    }

    #[must_use]
    pub fn named(self, name: &'static str, options: SearchOptions) -> Self {
        Self { name, options, ..self }
    }

    #[must_use]
    pub fn raw(self, name: &'static str) -> Self {
        Self { name, options: SearchOptions { scaling: Scaling::Raw, ..self.options }, ..self }
    }

    /// Solves `draw`. With the gauge fixed, the first joint's offset is held at its true value, which a tag next to the
    /// base would determine.
    #[must_use]
    pub fn solve(&self, draw: &Draw, setting: &Setting, watch: &mut dyn FnMut(f64)) -> Solution {
        let problem = PositionProblem::new(&draw.robot, &draw.views);
        let mut free = draw.parameters();
        let mut guess = match setting.guess {
            Guess::Datasheet => JointParameters::default(),
            Guess::Truth => draw.truth,
        };
        if self.gauge == Gauge::Fixed {
            let first = Parameter { joint: 0, kind: ParameterKind::Offset };
            free.retain(|parameter| *parameter != first);
            guess.set(first, draw.truth.get(first));
        }
        match self.solver {
            Solver::Position(method) => {
                let (problem, free, guess, options) = (&problem, &free[..], &guess, &self.options);
                method.solve_watched(&PositionSearch { problem, free, guess, options }, watch)
            }
            Solver::Bundle => bundle(draw, &guess),
        }
    }
}

fn bundle(draw: &Draw, guess: &JointParameters) -> Solution {
    let n_seen = draw.robot.camera.mount.n_joints;
    let kinds = |joint| if joint < n_seen { vec![ParameterKind::Gain, ParameterKind::Offset] } else { Vec::new() };
    let joints = (0..draw.robot.n_joints()).map(kinds).collect();
    let model = Model { joints, ..Model::of_blocks(0, []) };
    let input = BundleInput {
        robot: &draw.robot,
        views: &draw.views,
        model,
        scales: Hyperparameters::datasheet(&draw.robot),
        guess: *guess,
        joint_prior: None,
        evidence: HyperparameterMode::Fitted,
    };
    match estimate(&input) {
        Some(found) => Solution {
            parameters: found.parameters(),
            outcome: found.outcome(),
            evaluations: found.iterations,
            cost_initial: found.cost_initial,
            cost_final: found.cost_final,
        },
        None => Solution {
            parameters: *guess,
            outcome: Outcome::Degenerate,
            evaluations: 0,
            cost_initial: f64::NAN,
            cost_final: f64::NAN,
        },
    }
}
