//! BOBYQA in a box about the datasheet: Powell (2009), port of PRIMA.
//!
//! Parameters are rescaled by their initial uncertainty (the paper's preconditioning), so that all need steps of about
//! one; bounds keep them within the range of a working sensor. Without it the search uses the numbers of the paper's
//! equation 1, `theta = k1 eta + k2`, directly: rad per count and rad.

use crate::constants::search::{BOUND_SIGMAS, ON_BOUND};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use armcal_belief::calib::PositionProblem;
use armcal_belief::calib::Solution;
use armcal_belief::model::{JointParameters, Parameter, ParameterKind};
use armcal_core::numeric::Outcome;
use armcal_core::robot::Robot;
use armcal_core::sensor::wrap_symmetric;
use armcal_core::stats::stream_rng;

/// Units of the search's variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scaling {
    /// Preconditioned: every parameter in units of its prior sigma.
    PriorSigma,
    /// `k1` in rad per count and `k2` in rad, the angle where the signed reading is zero. Radii of the trust region are
    /// in units of the narrowest sigma, because no larger one fits into the box.
    Raw,
}

/// Number of interpolation points of BOBYQA's quadratic model, for `n` parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// `2 n + 1`, as Powell advises.
    TwiceAndOne,
    /// `n + 2`, the minimum, as in the paper.
    AndTwo,
}

/// Settings of the search in the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// Units of the search's variables.
    pub scaling: Scaling,
    /// Number of starts: the first is the guess, the others are drawn from the prior; the lowest cost wins.
    pub n_starts: usize,
    /// Seed of the drawn starts.
    pub seed: u64,
    /// First trust-region radius, in prior sigma.
    pub rho_begin: f64,
    /// Last trust-region radius, in prior sigma.
    pub rho_end: f64,
    /// Largest number of evaluations per start.
    pub max_evaluations: usize,
    /// Number of points of the quadratic model.
    pub interpolation: Interpolation,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            scaling: Scaling::PriorSigma,
            n_starts: 1,
            seed: 0,
            rho_begin: 0.5,
            rho_end: 1e-7,
            max_evaluations: 10_000,
            interpolation: Interpolation::TwiceAndOne,
        }
    }
}

impl SearchOptions {
    /// The settings of the paper's authors, as far as a box allows: rho to 1e-6, n + 2 points, 10 000 evaluations.
    /// Their first radius of 10 sigma is wider than the box; the largest that fits is 6.
    #[must_use]
    pub fn of_the_paper() -> Self {
        Self { rho_begin: BOUND_SIGMAS, rho_end: 1e-6, interpolation: Interpolation::AndTwo, ..Self::default() }
    }
}

/// Problem and settings of a search.
#[derive(Clone, Copy, Debug)]
pub struct PositionSearch<'a> {
    /// Views and landmarks.
    pub problem: &'a PositionProblem<'a>,
    /// Gains and offsets that are estimated; the other parameters keep the value in `guess`.
    pub free: &'a [Parameter],
    /// Start of the first search, and the middle of the box.
    pub guess: &'a JointParameters,
    /// Settings of the search.
    pub options: &'a SearchOptions,
}

/// Minimizes `objective` over `free`. `watch` receives the objective of every evaluation.
pub(crate) fn minimize(
    search: &PositionSearch<'_>,
    mut objective: impl FnMut(&JointParameters) -> f64,
    watch: &mut dyn FnMut(f64),
) -> Solution {
    let PositionSearch { problem, free, guess, options } = search;
    let robot = problem.robot;
    let space = Space::new(robot, free, guess, options.scaling);
    let cost_initial = objective(guess);
    let mut rng = stream_rng(options.seed, "starts of the search");
    let mut best: Option<Solution> = None;
    let mut evaluations = 0;
    for start in 0..options.n_starts.max(1) {
        let mut x = if start == 0 { vec![0.0; free.len()] } else { space.draw(&mut rng) };
        let mut cost = |x: &[f64]| {
            let value = objective(&space.at(x));
            watch(value);
            value
        };
        let result = bobyqa::bobyqa(&mut cost, &mut x, &space.lower, &space.upper, space.config(options));
        evaluations += result.n_eval;
        let outcome = match result.status {
            bobyqa::Status::Converged if !space.on_bound(&x) && result.found_finite() => Outcome::Converged,
            bobyqa::Status::Converged | bobyqa::Status::MaxFunReached if result.found_finite() => Outcome::Stalled,
            _ => Outcome::Degenerate,
        };
        if best.as_ref().is_none_or(|best| result.f < best.cost_final) {
            let parameters = space.at(&x);
            best = Some(Solution { parameters, outcome, evaluations: 0, cost_initial, cost_final: result.f });
        }
    }
    let nothing = Solution {
        parameters: **guess,
        outcome: Outcome::Degenerate,
        evaluations: 0,
        cost_initial,
        cost_final: cost_initial,
    };
    Solution { evaluations, ..best.unwrap_or(nothing) }
}

/// Variables of the search: `x = 0` is the guess.
struct Space<'a> {
    robot: &'a Robot,
    free: &'a [Parameter],
    guess: &'a JointParameters,
    scaling: Scaling,
    /// Prior sigma of each `x`.
    sigma: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl<'a> Space<'a> {
    fn new(robot: &'a Robot, free: &'a [Parameter], guess: &'a JointParameters, scaling: Scaling) -> Self {
        let sigma: Vec<f64> = free
            .iter()
            .map(|&parameter| match scaling {
                Scaling::PriorSigma => 1.0,
                Scaling::Raw => raw_sigma(robot, free, parameter),
            })
            .collect();
        let upper: Vec<f64> = sigma.iter().map(|sigma| BOUND_SIGMAS * sigma).collect();
        let lower = upper.iter().map(|bound| -bound).collect();
        Self { robot, free, guess, scaling, sigma, lower, upper }
    }

    fn at(&self, x: &[f64]) -> JointParameters {
        let mut parameters = *self.guess;
        match self.scaling {
            Scaling::PriorSigma => {
                for (&parameter, &scaled) in self.free.iter().zip(x) {
                    let std = parameter.prior_std(self.robot);
                    parameters.set(parameter, self.guess.get(parameter) + scaled * std);
                }
            }
            Scaling::Raw => {
                for (&parameter, &step) in self.free.iter().zip(x) {
                    let joint = parameter.joint;
                    match parameter.kind {
                        ParameterKind::Gain => {
                            let gain_step = step * self.robot.sensors[joint].counts_per_rad;
                            parameters.gain[joint] += gain_step;
                            if is_free(self.free, joint, ParameterKind::Offset) {
                                // k2 stays constant, so a gain step changes the offset about the middle of the range.
                                parameters.offset_rad[joint] += gain_step * middle_rad(self.robot, joint);
                            }
                        }
                        ParameterKind::Offset => parameters.offset_rad[joint] += step,
                        _ => {}
                    }
                }
            }
        }
        parameters
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let one = |sigma: &f64| {
            let normal: f64 = StandardNormal.sample(rng);
            sigma * normal.clamp(-0.5 * BOUND_SIGMAS, 0.5 * BOUND_SIGMAS)
        };
        self.sigma.iter().map(one).collect()
    }

    fn on_bound(&self, x: &[f64]) -> bool {
        x.iter().zip(&self.upper).any(|(x, bound)| x.abs() > bound * ON_BOUND)
    }

    fn config(&self, options: &SearchOptions) -> bobyqa::Config {
        let n = self.free.len();
        let narrowest = self.sigma.iter().copied().fold(f64::INFINITY, f64::min);
        let mut config = bobyqa::Config::new(n);
        config.rho_begin = options.rho_begin.min(BOUND_SIGMAS) * narrowest;
        config.rho_end = options.rho_end * narrowest;
        config.max_fun = options.max_evaluations;
        if options.interpolation == Interpolation::AndTwo {
            config.npt = n + 2;
        }
        config
    }
}

fn is_free(free: &[Parameter], joint: usize, kind: ParameterKind) -> bool {
    free.contains(&Parameter { joint, kind })
}

/// The datasheet's travel from the reading zero of the signed word to the middle of the range, rad.
fn middle_rad(robot: &Robot, joint: usize) -> f64 {
    let spec = &robot.sensors[joint];
    let center_counts = spec.offset_counts + spec.counts_per_rad * spec.center_rad;
    // theta = center + gain (eta - eta_center) / counts_per_rad + offset, so that k2 = center + offset - gain * this.
    wrap_symmetric(center_counts, spec.wrap_counts) / spec.counts_per_rad
}

/// Prior sigma of `k1` (rad per count) or `k2` (rad).
fn raw_sigma(robot: &Robot, free: &[Parameter], parameter: Parameter) -> f64 {
    let joint = parameter.joint;
    let std = parameter.prior_std(robot);
    match parameter.kind {
        ParameterKind::Gain => std / robot.sensors[joint].counts_per_rad.abs(),
        ParameterKind::Offset if is_free(free, joint, ParameterKind::Gain) => {
            let gain_std = Parameter { joint, kind: ParameterKind::Gain }.prior_std(robot);
            std.hypot(gain_std * middle_rad(robot, joint))
        }
        _ => std,
    }
}
