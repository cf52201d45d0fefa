//! The whole plan of a capture before any motion: poses, the paths between them, and their clearances.
//!
//! It plans the session without the arm. The arm is assumed to stand at its stowed pose, with errors as large as the
//! datasheet, or an earlier calibration, allows.

use crate::plan::constants::capture_plan::{PROVEN_TO_M, SAMPLE_RAD};
use armcal_core::codes::{Code, Coded, Warning};
use rand_chacha::ChaCha8Rng;

use crate::file::calibration::Calibration;
use crate::file::file_error::CalibrationFileError;
use crate::plan::bounds::joint_bounds::JointErrorBounds;
use crate::plan::clearance::{ClearanceModel, ClosestPair};
use crate::plan::declared_failures::HeldArm;
use crate::plan::motion::edge::{Edge, Path};
use crate::plan::motion::timing::{SETTLE_S, Timing};
use crate::plan::path::PathPlanner;
use crate::plan::shortfalls::{KnownBefore, shortfalls};
use crate::plan::targets::{TargetRequest, plan_targets};
use crate::plan::view_planning::StopReason;
use crate::plan::view_planning::{PlannedPose, PoseRequest, choose_poses};
use crate::plan::visibility::VisibilityModel;
use crate::plan::{PathError, PlanError};
use armcal_core::kinematics::JointLimits;
use armcal_core::robot::Robot;
use armcal_core::routine::{CaptureSettings, Margins, MoveGoal, Routine, Step};
use armcal_core::sensor::ArmSensors;
use armcal_core::streams::JointAngles;

/// Belief about an arm that has not moved yet.
#[derive(Clone, Debug)]
pub struct ArmBelief {
    /// Believed sensors.
    pub sensors: ArmSensors,
    /// Bounds on the difference of the true angles and those of `sensors`.
    pub bounds: JointErrorBounds,
    /// Calibration that gave `sensors` and `bounds`; `None`: the datasheet.
    pub calibration: Option<Calibration>,
}

impl ArmBelief {
    /// Returns the datasheet's sensors and their worst case.
    #[must_use]
    pub fn datasheet(robot: &Robot) -> Self {
        Self { sensors: ArmSensors::nominal(robot), bounds: JointErrorBounds::datasheet(robot), calibration: None }
    }

    /// Returns the belief of an earlier calibration, as if it had been made just now.
    ///
    /// # Errors
    /// If the calibration is of another arm.
    pub fn of(robot: &Robot, calibration: Calibration) -> Result<Self, CalibrationFileError> {
        let sensors = calibration.sensors(robot)?;
        let bounds = JointErrorBounds::believed(&calibration.scaled_robot(robot), &calibration, &sensors);
        Ok(Self { sensors, bounds, calibration: Some(calibration) })
    }
}

/// Inputs of a capture plan.
pub struct ItineraryRequest<'a> {
    /// Nominal arm.
    pub robot: &'a Robot,
    /// Task, capture settings and script.
    pub routine: &'a Routine,
    /// Clearance model with the jaws at rest.
    pub clearance: &'a ClearanceModel<'a>,
    /// Clearance model with the jaws as they are at the task's targets.
    pub clearance_at_targets: &'a ClearanceModel<'a>,
    /// Sensors and error bounds of the arm.
    pub belief: &'a ArmBelief,
}

/// Poses in the order of visits, each with the path to it.
#[derive(Clone, Debug)]
pub struct CapturePlan {
    /// The stowed configuration, believed angles.
    pub start: JointAngles,
    /// Views that a path leads to, in the order of visits.
    pub visits: Vec<PlannedVisit>,
    /// Chosen poses that no path leads to.
    pub left_out: Vec<UnreachablePose>,
    /// Targets of the task that no pose reaches under this belief, assumptions, and what does not suffice.
    pub warnings: Vec<Warning>,
    /// Reason why there are no more views.
    pub stop: StopReason,
    /// Arm time from the start to the end of the last view, s; 0 without views.
    pub arm_time_s: f64,
}

/// One view and the path to it.
#[derive(Clone, Debug)]
pub struct PlannedVisit {
    /// Angles, tags and predicted tool error.
    pub pose: PlannedPose,
    /// Path from the visit before, or from the start.
    pub path: Path,
    /// Time of the path alone, s.
    pub duration_s: f64,
    /// Least clearance along the path.
    pub path_clearance: LeastClearance,
    /// Least clearance at the pose itself.
    pub clearance: LeastClearance,
    /// Closest pair of the believed arm at the pose.
    pub nearest: ClosestPair,
    /// Largest distance of each joint's true angle from the believed one, rad.
    pub error_bound_rad: JointAngles,
    /// Arm time since the start when the view is captured, s.
    pub arm_time_s: f64,
}

/// Clearance beyond the bound on the vehicle's motion, cut off at 0.4 m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeastClearance {
    /// Clearance of the believed arm, m; along a path, the least of samples.
    pub believed_m: f64,
    /// Certified clearance of every arm within the bounds, m.
    pub proven_m: f64,
}

impl LeastClearance {
    /// Returns the least clearance along a path that is known to keep `margin_m`.
    #[must_use]
    pub fn along(clearance: &ClearanceModel<'_>, bounds: &JointErrorBounds, path: &Path, margin_m: f64) -> Self {
        let all = path.edges().map(|edge| Self::on(clearance, bounds, &edge, margin_m));
        all.fold(Self { believed_m: f64::INFINITY, proven_m: f64::INFINITY }, |a, b| Self {
            believed_m: a.believed_m.min(b.believed_m),
            proven_m: a.proven_m.min(b.proven_m),
        })
    }

    /// Returns the least clearance along one edge that is known to keep `margin_m`.
    fn on(clearance: &ClearanceModel<'_>, bounds: &JointErrorBounds, edge: &Edge, margin_m: f64) -> Self {
        let Edge { from, to, .. } = edge;
        let samples = (from.max_abs_difference(to) / SAMPLE_RAD).ceil().max(1.0) as usize;
        let at = |k: usize| {
            let share = k as f64 / samples as f64;
            JointAngles::from_fn(from.len(), |j| from[j] + share * (to[j] - from[j]))
        };
        let believed_m = (0..=samples).map(|k| clearance.nearest(&at(k)).distance_m).fold(f64::INFINITY, f64::min);
        let (mut proven_m, mut beyond_m) = (margin_m.min(believed_m), believed_m);
        while beyond_m - proven_m > PROVEN_TO_M {
            let middle_m = 0.5 * (proven_m + beyond_m);
            let keeps = clearance.find_violation_along(edge, bounds, middle_m).is_none();
            if keeps { proven_m = middle_m } else { beyond_m = middle_m }
        }
        Self { believed_m, proven_m }
    }
}

/// A pose that no path leads to.
#[derive(Clone, Debug)]
pub struct UnreachablePose {
    /// Believed angles of the pose.
    pub angles: JointAngles,
    /// Reason why there is no path.
    pub why: PathError,
}

/// Reason why nothing could be planned.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "each variant's message says what it is")]
pub enum ItineraryError {
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error("none of the {n} targets can be reached; {first}")]
    NoTarget { n: usize, first: PlanError },
    #[error("step {step}: {problem}")]
    Move { step: usize, problem: String },
    #[error("no path leads to any of the {n} poses; {first}")]
    NoPath { n: usize, first: PathError },
}

/// Plans the first capture of a routine, from the stowed pose.
///
/// # Errors
/// [`ItineraryError`] if nothing can be planned. Single targets and poses that cannot be reached are listed in the
/// plan.
pub fn plan_itinerary(request: &ItineraryRequest<'_>, rng: &mut ChaCha8Rng) -> Result<CapturePlan, ItineraryError> {
    let capture = first_capture(request.routine);
    let calibration = request.belief.calibration.as_ref();
    let arm = HeldArm::new(request.robot, &request.belief.bounds, calibration);
    let bounds = match request.routine.capture.margins {
        Margins::Belief => arm.bounds.clone(),
        Margins::Off => JointErrorBounds::none(request.robot),
    };
    let planner = Planner { request, capture, limits: bounds.safe_limits(&arm.robot), bounds, arm };
    planner.check_start()?;
    planner.check_moves()?;
    let (targets, skipped) = planner.targets(rng)?;
    let poses = planner.poses(&targets, rng)?;
    let itinerary = planner.visit(poses, rng)?;
    let known = calibration.map_or(KnownBefore::Datasheet, |_| KnownBefore::Calibration);
    let planned = itinerary.visits.iter().map(|visit| &visit.pose);
    let mut warnings = planner.arm.warnings;
    warnings.extend(skipped);
    warnings.extend(shortfalls(planned, request.routine, request.robot, known));
    Ok(CapturePlan { warnings, ..itinerary })
}

/// Returns the first capture of the script: no calibration can come before it.
fn first_capture(routine: &Routine) -> &CaptureSettings {
    let captures = routine.steps.iter().filter_map(|step| match step {
        Step::Capture(capture) => Some(capture),
        _ => None,
    });
    captures.into_iter().next().unwrap_or(&routine.capture)
}

struct Planner<'a> {
    request: &'a ItineraryRequest<'a>,
    capture: &'a CaptureSettings,
    /// Arm with its failed joints held, and its error bounds.
    arm: HeldArm,
    /// Error bounds for which clearance is kept.
    bounds: JointErrorBounds,
    limits: Vec<JointLimits>,
}

impl Planner<'_> {
    fn margin_m(&self) -> f64 {
        self.capture.clearance_m
    }

    fn bounds(&self) -> &JointErrorBounds {
        &self.bounds
    }

    fn start(&self) -> JointAngles {
        self.arm.robot.stowed
    }

    fn check_start(&self) -> Result<(), PlanError> {
        let needed_m = self.margin_m();
        match self.request.clearance.find_violation(&self.start(), self.bounds(), needed_m) {
            None => Ok(()),
            Some(nearest) => Err(PlanError::StartTooClose {
                clearance_m: nearest.true_distance_m(),
                needed_m: nearest.needed_m(needed_m),
                nearest: nearest.to_string(),
            }),
        }
    }

    /// Checks that the script's moves before its first calibration lead to poses that every arm within the bounds can
    /// take.
    fn check_moves(&self) -> Result<(), ItineraryError> {
        let until = self.request.routine.steps.iter().position(|step| matches!(step, Step::Calibrate(_)));
        let steps = &self.request.routine.steps[..until.unwrap_or(self.request.routine.steps.len())];
        for (index, step) in steps.iter().enumerate() {
            let Step::Move(MoveGoal::Angles(angles)) = step else { continue };
            if let Some(problem) = self.impossible(&self.arm.with_held(&JointAngles::from_slice(angles))) {
                return Err(ItineraryError::Move { step: index + 1, problem });
            }
        }
        Ok(())
    }

    fn impossible(&self, angles: &JointAngles) -> Option<String> {
        for (joint, limits) in self.limits.iter().enumerate() {
            let has_stops = self.arm.robot.chain.joints()[joint].limits.is_some();
            if has_stops && !(limits.lower_rad..=limits.upper_rad).contains(&angles[joint]) {
                return Some(format!(
                    "{} at {:.4} rad may drive into its stop: within the sensors' error {:.4} .. {:.4} rad are safe",
                    self.request.robot.sensors[joint].joint, angles[joint], limits.lower_rad, limits.upper_rad
                ));
            }
        }
        let believed = self.request.clearance.nearest(angles);
        if believed.distance_m <= 0.0 {
            return Some(format!("the goal is inside something: {believed} touch or overlap there"));
        }
        let nearest = self.request.clearance.find_violation_arriving(angles, self.bounds(), self.margin_m())?;
        Some(format!(
            "the pose comes within {:.3} m of clearance between {nearest} for an arm within the sensors' error; \
             {:.3} m are needed",
            nearest.true_distance_m(),
            nearest.needed_m(self.margin_m())
        ))
    }

    /// Returns the believed angles at the targets that can be reached, and warnings about the others.
    fn targets(&self, rng: &mut ChaCha8Rng) -> Result<(Vec<JointAngles>, Vec<Warning>), ItineraryError> {
        let targets_m = &self.request.routine.task.targets_m;
        let asked = TargetRequest { targets_m, preferred: None, margin_m: self.margin_m() };
        let planned = plan_targets(&self.arm.robot, self.request.clearance_at_targets, self.bounds(), &asked, rng);
        let (mut reached, mut errors) = (Vec::new(), Vec::new());
        for target in planned {
            match target {
                Ok(angles) => reached.push(angles),
                Err(error) => errors.push(error),
            }
        }
        if reached.is_empty() && !errors.is_empty() {
            return Err(ItineraryError::NoTarget { n: errors.len(), first: errors.swap_remove(0) });
        }
        Ok((reached, errors.iter().map(|error| Warning::new(Code::TargetSkipped, error.to_string())).collect()))
    }

    fn poses(&self, targets: &[JointAngles], rng: &mut ChaCha8Rng) -> Result<Vec<PlannedPose>, PlanError> {
        let robot = &self.arm.robot;
        let request = PoseRequest {
            robot,
            clearance: self.request.clearance,
            bounds: self.bounds(),
            visibility: &VisibilityModel::default(),
            capture: self.capture,
            n_fit: self.capture.poses as usize,
            n_held_out: self.capture.held_out as usize,
            belief: self.request.belief.calibration.as_ref(),
            taken: &[],
            prior: None,
            known: None,
            detection_rate: &vec![1.0; robot.tags.len()],
            failed: &[],
            task: targets,
            targets_m: &self.request.routine.task.targets_m,
            start: &self.start(),
        };
        Ok(choose_poses(&request, rng)?.poses)
    }

    /// Plans the path to each pose in the order of visits, and skips those that no path leads to.
    fn visit(&self, poses: Vec<PlannedPose>, rng: &mut ChaCha8Rng) -> Result<CapturePlan, ItineraryError> {
        let path_planner = PathPlanner {
            clearance: self.request.clearance,
            bounds: self.bounds(),
            limits: &self.limits,
            margin_m: self.margin_m(),
        };
        let n = poses.len();
        let (mut visits, mut left_out) = (Vec::<PlannedVisit>::new(), Vec::new());
        let wanted = (self.capture.poses + self.capture.held_out) as usize;
        let (mut at, mut arm_time_s) = (self.start(), 0.0);
        let mut stop = if n < wanted { StopReason::NoPoseLeft } else { StopReason::Poses };
        for pose in poses {
            if let Some(reason) = self.enough(visits.last(), arm_time_s) {
                stop = reason;
                break;
            }
            match path_planner.plan(&at, &pose.angles, rng) {
                Ok(path) => {
                    at = pose.angles;
                    let visit = self.arrive(pose, path, arm_time_s);
                    arm_time_s = visit.arm_time_s + self.capture.dwell_s;
                    visits.push(visit);
                }
                Err(why) => left_out.push(UnreachablePose { angles: pose.angles, why }),
            }
        }
        if visits.is_empty() && !left_out.is_empty() {
            return Err(ItineraryError::NoPath { n, first: left_out.swap_remove(0).why });
        }
        Ok(CapturePlan { start: self.start(), visits, left_out, warnings: Vec::new(), stop, arm_time_s })
    }

    fn enough(&self, last: Option<&PlannedVisit>, arm_time_s: f64) -> Option<StopReason> {
        let predicted_m = last.map(|visit| visit.pose.predicted_tool_error_m)?;
        if self.capture.stop_at_tool_error_m.is_some_and(|limit_m| predicted_m <= limit_m) {
            return Some(StopReason::ToolError);
        }
        self.capture.max_time_s.is_some_and(|limit_s| arm_time_s >= limit_s).then_some(StopReason::Time)
    }

    fn arrive(&self, pose: PlannedPose, path: Path, since_s: f64) -> PlannedVisit {
        let nearest = self.request.clearance.nearest(&pose.angles);
        let angles = pose.angles;
        let (clearance, bounds, margin_m) = (self.request.clearance, self.bounds(), self.margin_m());
        let path_clearance = LeastClearance::along(clearance, bounds, &path, margin_m);
        let duration_s = Timing::new(&self.arm.robot).path_duration_s(&path);
        PlannedVisit {
            path,
            duration_s,
            path_clearance,
            clearance: LeastClearance::on(clearance, bounds, &Edge::at_full_speed(angles, angles), margin_m),
            nearest,
            error_bound_rad: JointAngles::from_fn(angles.len(), |j| self.arm.bounds.error_rad(j, angles[j])),
            arm_time_s: since_s + duration_s + SETTLE_S,
            pose,
        }
    }
}

impl Coded for ItineraryError {
    fn code(&self) -> Code {
        match self {
            Self::Plan(error) => error.code(),
            Self::NoTarget { .. } => Code::TargetOutOfReach,
            Self::Move { .. } => Code::StepImpossible,
            Self::NoPath { .. } => Code::PathNotFound,
        }
    }
}
