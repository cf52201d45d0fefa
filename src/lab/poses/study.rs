//! Estimates of the study: for each seed, criterion and number of poses.

use rayon::prelude::*;

use armcal_belief::calib::bundle::{BundleInput, Estimate, HyperparameterMode, estimate, model_for, reference};
use armcal_belief::calib::{ParameterCovariance, View};
use armcal_belief::model::{Hyperparameters, JointParameters};
use armcal_belief::plan::{
    ClearanceModel, JointErrorBounds, PlanError, PosePool, PoseRequest, TargetRequest, VisibilityModel, plan_targets,
};
use armcal_core::robot::{Robot, Vehicle};
use armcal_core::routine::{CaptureSettings, PoseCriterion, Routine, Step};
use armcal_core::stats::stream_rng;
use armcal_core::streams::{JointAngles, MAX_JOINTS};
use armcal_sim::WorldSpec;

use crate::poses::arm::TrueArm;

/// Result of one estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseRow {
    pub seed: u64,
    pub criterion: PoseCriterion,
    /// Number of chosen poses; views of no tag are not used.
    pub poses: usize,
    pub views: usize,
    /// True tool error, root mean square over the task's targets, m. `by_bundle_m` and `planned_m` are its predictions.
    pub true_m: f64,
    pub by_bundle_m: f64,
    pub planned_m: f64,
    /// Time of the whole tour, settling and dwell included, s.
    pub arm_time_s: f64,
}

/// Criteria in the order of tables and charts.
pub const CRITERIA: [PoseCriterion; 5] = [
    PoseCriterion::ToolError,
    PoseCriterion::DOptimal,
    PoseCriterion::AOptimal,
    PoseCriterion::EOptimal,
    PoseCriterion::Random,
];
/// Numbers of poses in the study.
pub const POSES: [usize; 11] = [3, 4, 5, 6, 8, 10, 12, 16, 20, 25, 30];
/// Number of candidates per seed.
const POOL: usize = 1000;

/// Reason that a study of poses has no result.
#[derive(Debug, thiserror::Error)]
pub enum PoseStudyError {
    #[error("{0}")]
    Scene(String),
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error("seed {seed}: {poses} poses determine nothing")]
    NotSolved { seed: u64, poses: usize },
}

/// Inputs that all seeds share.
struct Scene<'a> {
    robot: &'a Robot,
    clearance: &'a ClearanceModel<'a>,
    bounds: JointErrorBounds,
    capture: CaptureSettings,
    targets_m: &'a [[f64; 3]],
    task: Vec<JointAngles>,
    world: &'a WorldSpec,
    of: PoseGrid<'a>,
}

/// Criteria and numbers of poses; each estimate is independent of the others.
#[derive(Clone, Copy, Debug)]
pub struct PoseGrid<'a> {
    pub criteria: &'a [PoseCriterion],
    pub poses: &'a [usize],
}

impl PoseGrid<'static> {
    /// Whole grid of the table.
    pub const WHOLE: Self = Self { criteria: &CRITERIA, poses: &POSES };
}

/// Runs `seeds` of the routine's scene; returns rows by seed, criterion and number of poses.
///
/// # Errors
/// Where the routine captures nothing, a target is out of reach, or no pose is found.
pub fn pose_study(
    routine: &Routine,
    (robot, vehicle): (&Robot, &Vehicle),
    world: &WorldSpec,
    of: PoseGrid<'_>,
    seeds: std::ops::Range<u64>,
) -> Result<Vec<PoseRow>, PoseStudyError> {
    let capture = routine.steps.iter().find_map(|step| match step {
        Step::Capture(capture) => Some(*capture),
        _ => None,
    });
    let capture = capture.ok_or_else(|| PoseStudyError::Scene("the routine captures nothing".to_owned()))?;
    let clearance = ClearanceModel::new(robot, vehicle, &routine.scene);
    let bounds = JointErrorBounds::datasheet(robot);
    let targets_m = &routine.task.targets_m;
    let request = TargetRequest { targets_m, preferred: None, margin_m: capture.clearance_m };
    let mut rng = stream_rng(routine.seed, "targets of the study of poses");
    let task = plan_targets(robot, &clearance, &bounds, &request, &mut rng);
    let task = task.into_iter().collect::<Result<Vec<_>, _>>()?;
    let scene = Scene { robot, clearance: &clearance, bounds, capture, targets_m, task, world, of };
    let of_seed: Vec<Result<Vec<PoseRow>, PoseStudyError>> =
        seeds.into_par_iter().map(|seed| scene.of_seed(seed)).collect();
    let mut rows = Vec::new();
    for of_seed in of_seed {
        rows.extend(of_seed?);
    }
    Ok(rows)
}

impl Scene<'_> {
    fn of_seed(&self, seed: u64) -> Result<Vec<PoseRow>, PoseStudyError> {
        let visibility = VisibilityModel::default();
        let mut rng = stream_rng(seed, "poses of the study");
        let pool = PosePool::gather(&self.request(&visibility, &self.capture, POOL), POOL, &mut rng)?;
        let arm = TrueArm::draw(self.robot, self.clearance, self.world, seed);
        let mut rows = Vec::with_capacity(self.of.criteria.len() * self.of.poses.len());
        for &criterion in self.of.criteria {
            let capture = CaptureSettings { criterion, held_out: 0, ..self.capture };
            for &poses in self.of.poses {
                let name = format!("{criterion:?} {poses}");
                let request = self.request(&visibility, &capture, poses);
                let plan = pool.choose(&request, &mut stream_rng(seed, &name))?;
                let views = arm.views(&plan, &mut stream_rng(seed, &format!("views {name}")));
                let (true_m, by_bundle_m) =
                    self.fitted(&arm, &views).ok_or(PoseStudyError::NotSolved { seed, poses })?;
                let (planned_m, arm_time_s) = (plan.predicted_tool_error_m, plan.arm_time_s);
                let views = views.len();
                rows.push(PoseRow { seed, criterion, poses, views, true_m, by_bundle_m, planned_m, arm_time_s });
            }
        }
        Ok(rows)
    }

    fn request<'b>(
        &'b self,
        visibility: &'b VisibilityModel,
        capture: &'b CaptureSettings,
        n_fit: usize,
    ) -> PoseRequest<'b> {
        PoseRequest {
            robot: self.robot,
            clearance: self.clearance,
            bounds: &self.bounds,
            visibility,
            capture,
            n_fit,
            n_held_out: 0,
            belief: None,
            taken: &[],
            prior: None,
            known: None,
            detection_rate: &[],
            failed: &[],
            task: &self.task,
            targets_m: self.targets_m,
            start: &self.robot.stowed,
        }
    }

    /// Tool error, true and as `bundle` predicts it: root mean squares over the targets, m.
    fn fitted(&self, arm: &TrueArm<'_>, views: &[View]) -> Option<(f64, f64)> {
        let scales = Hyperparameters::datasheet(self.robot);
        let input = BundleInput {
            robot: self.robot,
            views,
            model: model_for(self.robot, views),
            scales,
            guess: JointParameters { reference: reference(views), ..JointParameters::default() },
            joint_prior: None,
            evidence: HyperparameterMode::Fitted,
        };
        let found = estimate(&input)?;
        let sensors = found.parameters().sensors(self.robot);
        let covariance = covariance(self.robot, &found);
        let rms = |variance: &dyn Fn(&JointAngles) -> f64| {
            (self.task.iter().map(variance).sum::<f64>() / self.task.len().max(1) as f64).sqrt()
        };
        let by_bundle_m = rms(&|at| covariance.tool_position_m2(self.robot, &sensors, at).trace());
        let true_m = rms(&|at| arm.tool_error_m(&sensors, at).powi(2));
        Some((true_m, by_bundle_m))
    }
}

fn covariance(robot: &Robot, found: &Estimate<'_>) -> ParameterCovariance {
    let parameters = found.joint_parameters().to_vec();
    let estimated = |joint: usize| parameters.iter().any(|p| p.joint == joint);
    let residual_std_rad: [f64; MAX_JOINTS] = std::array::from_fn(|joint| match robot.sensors.get(joint) {
        Some(spec) if !estimated(joint) => spec.linearity_std_rad,
        _ => found.scales().joint_std_rad[joint],
    });
    ParameterCovariance { matrix: found.joint_covariance(), parameters, residual_std_rad: Some(residual_std_rad) }
}
