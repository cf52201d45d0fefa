//! Contenders on the same draws, and their tool errors.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::least_squares::fisher_information;
use crate::study::PaperStudyError;
use crate::study::contender::MethodVariant;
use crate::study::experiments::Experiment;
use crate::study::scene::{Draw, Setting};
use armcal_belief::calib::PositionProblem;
use armcal_core::numeric::Outcome;
use armcal_core::robot::Robot;
use armcal_core::stats::quantile;

/// Results of one contender over all draws of a setting.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperRow {
    pub experiment: &'static str,
    pub setting: Setting,
    pub contender: &'static str,
    pub draws: usize,
    /// Root mean square, over the draws, of each draw's tool error, m. A draw's tool error is the root mean square over
    /// random poses. `tool_median_m` and `tool_p95_m` are its median and 95th percentile.
    pub tool_rms_m: f64,
    pub tool_median_m: f64,
    pub tool_p95_m: f64,
    /// Cramer-Rao bound of `tool_rms_m` with the map known, m; `None` without noise.
    pub bound_rms_m: Option<f64>,
    pub before_rms_m: f64,
    /// Ratio of `tool_rms_m` to that of least squares on the same draws, where it takes part.
    pub over_least_squares: Option<f64>,
    pub evaluations_median: f64,
    pub cost_initial_median: f64,
    pub cost_final_median: f64,
    pub converged: usize,
    /// The paper's own figure.
    pub paper: &'static str,
}

/// Result of one solution.
struct Trial {
    tool_rms_m: f64,
    evaluations: f64,
    cost_initial: f64,
    cost_final: f64,
    is_converged: bool,
}

/// All solutions on one draw.
struct Paired {
    trials: Vec<Trial>,
    bound_m2: Option<f64>,
    before_m: f64,
}

/// Runs every contender of `experiment` on the same draws; returns rows in the order of settings and contenders.
///
/// # Errors
/// [`PaperStudyError`] when a scene cannot be drawn.
pub fn run_experiment(robot: &Robot, experiment: &Experiment, seed: u64) -> Result<Vec<PaperRow>, PaperStudyError> {
    let mut rows = Vec::new();
    for setting in &experiment.settings {
        let draws = experiment.draws;
        let paired = (0..draws as u64)
            .into_par_iter()
            .map(|number| pair(robot, setting, &experiment.contenders, seed, number))
            .collect::<Result<Vec<_>, _>>()?;
        rows.extend(summed_up(experiment, setting, &paired));
    }
    Ok(rows)
}

fn pair(
    robot: &Robot,
    setting: &Setting,
    contenders: &[MethodVariant],
    seed: u64,
    number: u64,
) -> Result<Paired, PaperStudyError> {
    let draw = Draw::new(robot, setting, seed, number)?;
    let trial = |contender: &MethodVariant| {
        let solution = contender.solve(&draw, setting, &mut |_| {});
        Trial {
            tool_rms_m: draw.tool_rms_m(&solution.parameters),
            evaluations: solution.evaluations as f64,
            cost_initial: solution.cost_initial,
            cost_final: solution.cost_final,
            is_converged: solution.outcome == Outcome::Converged,
        }
    };
    Ok(Paired {
        trials: contenders.iter().map(trial).collect(),
        bound_m2: (setting.noise_m > 0.0).then(|| bound_m2(&draw, setting.noise_m)).flatten(),
        before_m: draw.tool_rms_m(&armcal_belief::model::JointParameters::default()),
    })
}

/// The least mean square of the tool error over the tool poses for any unbiased estimator on this draw, m^2. It is `J C
/// J^T` with the inverse of the Fisher information for `C` (Cramer-Rao).
fn bound_m2(draw: &Draw, noise_m: f64) -> Option<f64> {
    let problem = PositionProblem::new(&draw.robot, &draw.views);
    let free = draw.parameters();
    let covariance = fisher_information(&problem, &free, &draw.truth, noise_m).try_inverse()?;
    let sum: f64 = draw
        .tool_poses
        .iter()
        .map(|angles| {
            let poses = draw.robot.chain.link_poses(angles);
            let tool = poses.frame(&draw.robot.tool.mount).translation.vector;
            let mut jacobian = DMatrix::zeros(3, free.len());
            for (column, parameter) in free.iter().enumerate() {
                let (joint, spec) = (parameter.joint, &draw.robot.sensors[parameter.joint]);
                let travel = (angles[joint] - spec.center_rad - draw.truth.offset_rad[joint]) / draw.truth.gain[joint];
                let by_angle = poses.point_jacobian(joint, &tool);
                let by_parameter = by_angle * parameter.kind.angle_derivative(spec, travel, &Default::default(), 0.0);
                jacobian.fixed_view_mut::<3, 1>(0, column).copy_from(&by_parameter);
            }
            (&jacobian * &covariance * jacobian.transpose()).trace()
        })
        .sum();
    Some(sum / draw.tool_poses.len() as f64)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), value| (sum + value * value, n + 1));
    (sum / n.max(1) as f64).sqrt()
}

fn summed_up(experiment: &Experiment, setting: &Setting, paired: &[Paired]) -> Vec<PaperRow> {
    let tool = |k: usize| -> Vec<f64> { paired.iter().map(|p| p.trials[k].tool_rms_m).collect() };
    let median = |k: usize, of: fn(&Trial) -> f64| {
        let values: Vec<f64> = paired.iter().map(|p| of(&p.trials[k])).collect();
        quantile(&values, 0.5).unwrap_or(f64::NAN)
    };
    let reference = experiment.contenders.iter().position(|c| c.name == MethodVariant::least_squares().name);
    let bounds: Option<Vec<f64>> = paired.iter().map(|p| p.bound_m2).collect();
    let row = |(k, contender): (usize, &MethodVariant)| {
        let errors = tool(k);
        let tool_rms_m = rms(errors.iter().copied());
        PaperRow {
            experiment: experiment.name,
            setting: *setting,
            contender: contender.name,
            draws: paired.len(),
            tool_rms_m,
            tool_median_m: quantile(&errors, 0.5).unwrap_or(f64::NAN),
            tool_p95_m: quantile(&errors, 0.95).unwrap_or(f64::NAN),
            bound_rms_m: bounds.as_ref().map(|bounds| rms(bounds.iter().map(|m2| m2.sqrt()))),
            before_rms_m: rms(paired.iter().map(|p| p.before_m)),
            over_least_squares: reference.map(|k| tool_rms_m / rms(tool(k).into_iter())),
            evaluations_median: median(k, |t| t.evaluations),
            cost_initial_median: median(k, |t| t.cost_initial),
            cost_final_median: median(k, |t| t.cost_final),
            converged: paired.iter().filter(|p| p.trials[k].is_converged).count(),
            paper: experiment.paper_says(setting, contender),
        }
    };
    experiment.contenders.iter().enumerate().map(row).collect()
}
