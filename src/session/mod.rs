//! BELIEF: the closed loop, from first motion to a verified reach, on any [`Arm`].
//!
//! Reach as things are; plan poses; move, settle, capture; calibrate from the recording's bytes; reach again. It knows
//! the arm only through its messages. `motion` drives and waits, `recorder` keeps every message, `Progress` tells
//! whoever watches.

mod motion;
mod recorder;

pub use recorder::Recorder;

use rand_chacha::ChaCha8Rng;

use crate::calib::{CalibError, Calibration, Status, calibrate};
use crate::log::LogError;
use crate::plan::{
    ClearanceModel, JointErrorBounds, PathPlanner, PlanError, PosePlan, PoseRequest, TargetRequest, VisibilityModel,
    choose_poses, plan_targets,
};
use crate::robot::{Robot, Vehicle};
use crate::routine::Routine;
use crate::sensor::ArmSensors;
use crate::stats::stream_rng;
use crate::streams::{Arm, ArmError, JointAngles, LogLevel, MarkKind, Phase, ReachAttempt};
use motion::Driver;

/// Why a run broke off.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Arm(#[from] ArmError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Calib(#[from] CalibError),
    #[error("the arm sends no joint readings")]
    NoReadings,
    #[error(
        "none of the {planned} planned poses was captured: each was blocked, or the arm did not come to rest there"
    )]
    NothingCaptured { planned: usize },
}

/// Told how far the run is.
pub trait Progress {
    /// `done` of `total` steps of `phase` are over; `simulated_s` since the start by the arm's clock.
    fn update(&mut self, phase: Phase, done: usize, total: usize, simulated_s: f64);

    /// Seconds on the watcher's clock since any fixed moment; the loop itself has no clock but the arm's.
    fn wall_s(&self) -> f64;
}

/// What came out.
#[derive(Debug)]
pub struct Outcome {
    pub calibration: Calibration,
    /// Poses at which the arm settled and was recorded.
    pub poses: usize,
    /// Poses given up: no path, or the arm did not settle.
    pub poses_skipped: usize,
    /// Targets given up, over both attempts.
    pub targets_skipped: usize,
    pub duration_s: f64,
    /// Time for which the arm was moving, not standing, s.
    pub motion_s: f64,
    /// Time that the estimator itself took, by the watcher's clock.
    pub calibration_wall_s: f64,
    /// The sensors that the arm ends up believing in.
    pub sensors: ArmSensors,
}

/// All that a run needs to know beforehand.
pub struct Setup<'a> {
    pub robot: &'a Robot,
    pub vehicle: &'a Vehicle,
    pub routine: &'a Routine,
    /// For planning only; the arm has its own.
    pub seed: u64,
}

/// Samples that a path planner may try before it gives a pose up.
const MAX_PATH_SAMPLES: usize = 400;
/// How long the arm is watched at a target, s.
const REACH_DWELL_S: f64 = 0.6;

/// Runs the closed loop.
///
/// # Errors
/// [`SessionError`]; what was recorded until then stays readable.
pub fn run(
    setup: &Setup<'_>,
    arm: &mut dyn Arm,
    recorder: &mut Recorder,
    progress: &mut dyn Progress,
) -> Result<Outcome, SessionError> {
    let robot = setup.robot;
    let clearance = ClearanceModel::new(robot, setup.vehicle, &setup.routine.scene);
    let mut rng = stream_rng(setup.seed, "plan");
    let sensors = ArmSensors::nominal(robot);
    let driver = Driver::new(robot, arm, recorder, sensors)?;
    let mut run = Run { setup, clearance: &clearance, driver, progress, skipped_poses: 0, skipped_targets: 0 };

    run.driver.phase(Phase::Plan)?;
    let prior = JointErrorBounds::prior(robot);
    let plan = run.plan_all(&prior, &mut rng)?;
    run.driver.record_task(&setup.routine.task)?;

    let targets: Vec<_> = plan.targets.iter().copied().map(Some).collect();
    run.reach(ReachAttempt::Before, &targets, &prior, &mut rng)?;
    let poses = run.capture(&plan.poses, &prior, &mut rng)?;
    if poses == 0 {
        return Err(SessionError::NothingCaptured { planned: plan.poses.poses.len() });
    }
    run.driver.phase(Phase::Calibrate)?;
    run.progress_at(Phase::Calibrate, 0, 1);
    let recording = run.driver.recorder.read_back()?;
    let began_s = run.progress.wall_s();
    let calibration = calibrate(&recording, robot, setup.routine.method)?;
    let calibration_wall_s = run.progress.wall_s() - began_s;
    run.driver.log(LogLevel::Info, &verdict_line(&calibration))?;
    if calibration.status == Status::Accepted {
        run.driver.believe(calibration.sensors(robot).expect("made for this robot a moment ago"));
        let bounds = JointErrorBounds::calibrated(robot, &estimated(&calibration, robot));
        let request = TargetRequest {
            targets_m: &setup.routine.task.targets_m,
            preferred: Some(&plan.targets),
            margin_m: setup.routine.capture.clearance_m,
        };
        let targets = plan_targets(robot, &clearance, &bounds, &request, &mut rng);
        let targets: Vec<_> = targets.into_iter().map(|planned| run.or_skipped(planned)).collect::<Result<_, _>>()?;
        run.reach(ReachAttempt::After, &targets, &bounds, &mut rng)?;
    }
    run.driver.phase(Phase::Done)?;
    let duration_s = run.driver.elapsed_s();
    Ok(Outcome {
        poses,
        poses_skipped: run.skipped_poses,
        targets_skipped: run.skipped_targets,
        duration_s,
        motion_s: run.driver.motion_s,
        calibration_wall_s,
        sensors: run.driver.sensors.clone(),
        calibration,
    })
}

fn verdict_line(calibration: &Calibration) -> String {
    match &calibration.refusal {
        None => "calibration accepted".to_owned(),
        Some(why) => format!("calibration refused: {why}"),
    }
}

/// (gain sigma, offset sigma) of each joint, where estimated.
fn estimated(calibration: &Calibration, robot: &Robot) -> Vec<(Option<f64>, Option<f64>)> {
    let one = |(joint, spec): (&crate::calib::JointResult, &crate::robot::JointSensorSpec)| {
        let gain_std = joint.gain_std_rad_per_count * spec.counts_per_rad.abs();
        (joint.gain_estimated.then_some(gain_std), joint.offset_estimated.then_some(joint.offset_std_rad))
    };
    calibration.joint.iter().zip(&robot.sensors).map(one).collect()
}

struct Plans {
    targets: Vec<JointAngles>,
    poses: PosePlan,
}

struct Run<'a, 'b> {
    setup: &'a Setup<'a>,
    clearance: &'a ClearanceModel<'a>,
    driver: Driver<'b>,
    progress: &'b mut dyn Progress,
    skipped_poses: usize,
    skipped_targets: usize,
}

impl Run<'_, '_> {
    fn progress_at(&mut self, phase: Phase, done: usize, total: usize) {
        let elapsed_s = self.driver.elapsed_s();
        self.progress.update(phase, done, total, elapsed_s);
    }

    fn plan_all(&mut self, prior: &JointErrorBounds, rng: &mut ChaCha8Rng) -> Result<Plans, SessionError> {
        let (robot, routine) = (self.setup.robot, self.setup.routine);
        let margin_m = routine.capture.clearance_m;
        let start = self.driver.believed_angles()?;
        self.progress_at(Phase::Plan, 0, 2);
        let nearest = self.clearance.nearest_under(&start, prior, margin_m);
        if nearest.distance_m < margin_m {
            let clearance_m = nearest.distance_m;
            return Err(
                PlanError::StartTooClose { clearance_m, nearest: nearest.to_string(), needed_m: margin_m }.into()
            );
        }
        let request = TargetRequest { targets_m: &routine.task.targets_m, preferred: None, margin_m };
        let targets =
            plan_targets(robot, self.clearance, prior, &request, rng).into_iter().collect::<Result<Vec<_>, _>>()?;
        self.progress_at(Phase::Plan, 1, 2);
        let poses = choose_poses(
            &PoseRequest {
                robot,
                clearance: self.clearance,
                bounds: prior,
                visibility: &VisibilityModel::default(),
                capture: &routine.capture,
                task: &targets,
                targets_m: &routine.task.targets_m,
                start: &start,
            },
            rng,
        )?;
        self.driver.log(
            LogLevel::Info,
            &format!(
                "planned {} poses out of {} that see enough tags and keep clear ({} drawn); predicted tool error {:.1} mm",
                poses.poses.len(),
                poses.candidates,
                poses.tried,
                poses.predicted_tool_error_m * 1e3
            ),
        )?;
        self.progress_at(Phase::Plan, 2, 2);
        Ok(Plans { targets, poses })
    }

    /// Goes to believed angles by a certified path; `false` when there is none.
    fn go(&mut self, to: &JointAngles, bounds: &JointErrorBounds, rng: &mut ChaCha8Rng) -> Result<bool, SessionError> {
        let limits = bounds.safe_limits(self.setup.robot);
        let planner = PathPlanner {
            clearance: self.clearance,
            bounds,
            limits: &limits,
            margin_m: self.setup.routine.capture.clearance_m,
            max_samples: MAX_PATH_SAMPLES,
        };
        let from = self.driver.set_point();
        match planner.plan(&from, to, rng) {
            Ok(path) => {
                self.driver.follow(&path)?;
                Ok(true)
            }
            Err(blocked) => {
                self.driver.log(LogLevel::Warn, &format!("a pose is left out: {blocked}"))?;
                Ok(false)
            }
        }
    }

    /// A target that the new belief puts out of reach is no reason to lose the rest: it is named and left out.
    fn or_skipped(&mut self, planned: Result<JointAngles, PlanError>) -> Result<Option<JointAngles>, SessionError> {
        match planned {
            Ok(angles) => Ok(Some(angles)),
            Err(why) => {
                self.driver.log(LogLevel::Warn, &format!("a target is left out: {why}"))?;
                Ok(None)
            }
        }
    }

    fn reach(
        &mut self,
        attempt: ReachAttempt,
        targets: &[Option<JointAngles>],
        bounds: &JointErrorBounds,
        rng: &mut ChaCha8Rng,
    ) -> Result<(), SessionError> {
        self.driver.phase(Phase::Reach)?;
        for (target, angles) in targets.iter().enumerate() {
            self.progress_at(Phase::Reach, target, targets.len());
            let arrived = match angles {
                Some(angles) => self.go(angles, bounds, rng)? && self.driver.settle()?,
                None => false,
            };
            if !arrived {
                self.skipped_targets += 1;
                continue;
            }
            let kind = MarkKind::Reach { attempt, target_idx: target as u32 };
            self.driver.dwell(REACH_DWELL_S, kind)?;
        }
        Ok(())
    }

    /// Visits the poses; gives how many were captured.
    fn capture(
        &mut self,
        plan: &PosePlan,
        bounds: &JointErrorBounds,
        rng: &mut ChaCha8Rng,
    ) -> Result<usize, SessionError> {
        let mut captured = 0;
        for (pose, (set, angles)) in plan.poses.iter().enumerate() {
            self.progress_at(Phase::Capture, pose, plan.poses.len());
            self.driver.phase(Phase::Move)?;
            if !self.go(angles, bounds, rng)? {
                self.skipped_poses += 1;
                continue;
            }
            self.driver.phase(Phase::Settle)?;
            if !self.driver.settle()? {
                self.driver.log(LogLevel::Warn, &format!("pose {pose} is left out: the arm did not settle"))?;
                self.skipped_poses += 1;
                continue;
            }
            self.driver.phase(Phase::Capture)?;
            let kind = MarkKind::Capture { set: *set, pose_idx: pose as u32 };
            let tags = self.driver.dwell(self.setup.routine.capture.dwell_s, kind)?;
            if tags == 0 {
                self.driver.log(LogLevel::Warn, &format!("pose {pose} saw no tag"))?;
            }
            captured += 1;
        }
        Ok(captured)
    }
}
