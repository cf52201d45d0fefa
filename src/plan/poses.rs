//! Chooses calibration poses: visible, reachable, clear, and the most telling for the task.
//!
//! Candidates are drawn over the joint ranges and kept if they are expected to see enough tags and every arm within the
//! bounds stays clear. From these the views are picked greedily for the least predicted tool variance at the task's
//! targets, the test-pose criterion of Klimchik et al. (2014); the held-out views are drawn from what remains.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::PlanError;
use super::bounds::JointErrorBounds;
use super::clearance::ClearanceModel;
use super::visibility::VisibilityModel;
use crate::robot::Robot;
use crate::routine::CaptureSettings;
use crate::streams::{CaptureSet, JointAngles};

/// Poses in the order of their visit.
#[derive(Clone, Debug)]
pub struct PosePlan {
    pub poses: Vec<(CaptureSet, JointAngles)>,
    /// Predicted root mean square tool error at the targets, m: corner noise, and 3 mm across each line of sight for what
    /// does not average out. It ranks poses; the calibration's own prediction is the one to believe.
    pub predicted_tool_error_m: f64,
    pub candidates: usize,
    pub tried: usize,
}

/// What the choice is made for.
pub struct PoseRequest<'a> {
    pub robot: &'a Robot,
    pub clearance: &'a ClearanceModel<'a>,
    pub bounds: &'a JointErrorBounds,
    pub visibility: &'a VisibilityModel,
    pub capture: &'a CaptureSettings,
    /// Joint angles of the arm at the task's targets.
    pub task: &'a [JointAngles],
    /// Tool positions of the task, kept free of capture poses so that the task tests what the fit has not seen.
    pub targets_m: &'a [[f64; 3]],
    pub start: &'a JointAngles,
}

struct Candidate {
    angles: JointAngles,
    /// Information on the parameters in prior units.
    information: DMatrix<f64>,
    /// Whether it shows a tag whose place is known, to most arms within the bounds.
    shows_known_tag: bool,
}

const MAX_DRAWS: usize = 400_000;
/// More candidates than this gain little.
const CANDIDATES_PER_POSE: usize = 8;
/// Capture poses keep their tool this far from every target, m.
const TARGET_DISTANCE_M: f64 = 0.15;
/// Errors of a seen tag that do not average out (mount, survey), across the line of sight, m.
const LATERAL_STD_M: f64 = 0.003;
/// Joints from this one on do not move the camera; they stay where they are, but for those that turn a tag on the gripper.
fn n_seen(robot: &Robot) -> usize {
    robot.camera.mount.n_joints
}

/// Where tags have to be mapped first, one view in so many shows one whose place is known: the map hangs on that tag, and is turned
/// about it by as much as its corners leave its direction open.
const ANCHORED_EVERY: usize = 2;

/// Whether a joint turns the tag on the gripper in the camera's view: then the views need many of its angles.
fn shows_gripper_tag(robot: &Robot, joint: usize) -> bool {
    robot.gripper_tag.is_some_and(|tag| tag.joints(&robot.camera.mount).contains(&joint))
}

/// Chooses `capture.poses` views for the fit and `capture.held_out` for the verdict.
///
/// # Errors
/// [`PlanError::NoUsefulPose`], [`PlanError::TooFewPoses`].
pub fn choose_poses(request: &PoseRequest<'_>, rng: &mut ChaCha8Rng) -> Result<PosePlan, PlanError> {
    let (n_fit, n_held_out) = (request.capture.poses as usize, request.capture.held_out as usize);
    let wanted = n_fit + n_held_out;
    let (mut candidates, tried) = draw_candidates(request, wanted * CANDIDATES_PER_POSE, rng);
    let found = candidates.len();
    if found == 0 {
        return Err(PlanError::NoUsefulPose {
            min_tags: request.capture.min_tags,
            n_tags: request.robot.tags.len(),
            clearance_m: request.capture.clearance_m,
            tried,
        });
    }
    if found < wanted {
        return Err(PlanError::TooFewPoses { found, wanted, min_tags: request.capture.min_tags });
    }
    let task = task_jacobians(request);
    let anchored_every = if request.robot.tags.iter().all(|tag| tag.is_known()) { 1 } else { ANCHORED_EVERY };
    let (mut poses, variance_m2) = pick_greedily(&mut candidates, n_fit, &task, anchored_every);
    for _ in 0..n_held_out {
        let k = rng.random_range(0..candidates.len());
        poses.push((CaptureSet::HeldOut, candidates.swap_remove(k).angles));
    }
    Ok(PosePlan {
        poses: ordered(poses, request.start),
        predicted_tool_error_m: variance_m2.sqrt(),
        candidates: found,
        tried,
    })
}

fn draw_candidates(request: &PoseRequest<'_>, enough: usize, rng: &mut ChaCha8Rng) -> (Vec<Candidate>, usize) {
    let robot = request.robot;
    let limits = request.bounds.safe_limits(robot);
    let mut candidates = Vec::new();
    for tried in 0..MAX_DRAWS {
        if candidates.len() == enough {
            return (candidates, tried);
        }
        let angles = JointAngles::from_fn(robot.n_joints(), |j| {
            let drawn = rng.random_range(0.0..1.0) * (limits[j].upper_rad - limits[j].lower_rad) + limits[j].lower_rad;
            if j < n_seen(robot) || shows_gripper_tag(robot, j) { drawn } else { request.start[j] }
        });
        if let Some(candidate) = assess(request, angles) {
            candidates.push(candidate);
        }
    }
    (candidates, MAX_DRAWS)
}

/// Cheap tests first; most draws fail at the first.
fn assess(request: &PoseRequest<'_>, angles: JointAngles) -> Option<Candidate> {
    let robot = request.robot;
    let min_tags = request.capture.min_tags as usize;
    let poses = robot.chain.link_poses(&angles);
    request.visibility.in_view(robot, &poses).nth(min_tags.saturating_sub(1))?;
    if robot.gripper_tag.is_some_and(|tag| !request.visibility.sees_gripper_tag(robot, &tag, request.clearance, &poses))
    {
        return None;
    }
    let tool = poses.frame(&robot.tool.mount).translation.vector;
    let near_target = |target: &[f64; 3]| (tool - Vector3::from(*target)).norm() < TARGET_DISTANCE_M;
    if request.targets_m.iter().any(near_target) {
        return None;
    }
    let margin_m = request.capture.clearance_m;
    if request.clearance.is_nearer_than(&angles, margin_m) {
        return None;
    }
    let seen = expected_tags(request, &angles);
    if seen.iter().map(|(_, share)| share).sum::<f64>() < min_tags as f64 {
        return None;
    }
    if request.clearance.too_near(&angles, request.bounds, margin_m).is_some() {
        return None;
    }
    let information = information(request, &angles, &seen);
    let shows_known_tag = seen.iter().any(|&(idx, share)| share > 0.5 && robot.tags[idx].is_known());
    Some(Candidate { angles, information, shows_known_tag })
}

/// Tags with the share of arms within the bounds that see them there.
fn expected_tags(request: &PoseRequest<'_>, angles: &JointAngles) -> Vec<(usize, f64)> {
    // A spread of corners of the error box, each joint both ways equally often, and the middle.
    const CORNERS: [usize; 6] = [0b00000, 0b11111, 0b10101, 0b01010, 0b00110, 0b11001];
    let n = n_seen(request.robot);
    let mut count = vec![0usize; request.robot.tags.len()];
    let halfway = |corner: usize| {
        let extreme = request.bounds.corner(angles, n, corner);
        // Half of the worst error of every joint at once is already rare.
        JointAngles::from_fn(angles.len(), |j| 0.5 * (angles[j] + extreme[j]))
    };
    for arm in CORNERS.map(halfway).iter().chain([angles]) {
        for idx in request.visibility.visible(request.robot, request.clearance, arm) {
            count[idx] += 1;
        }
    }
    let arms = (CORNERS.len() + 1) as f64;
    count.into_iter().enumerate().filter(|(_, n)| *n > 0).map(|(idx, n)| (idx, n as f64 / arms)).collect()
}

/// Fisher information of a view on gains and offsets of the seen joints, in prior units.
fn information(request: &PoseRequest<'_>, angles: &JointAngles, seen: &[(usize, f64)]) -> DMatrix<f64> {
    let robot = request.robot;
    let n = n_seen(robot);
    let poses = robot.chain.link_poses(angles);
    let eye = poses.frame(&robot.camera.mount).translation.vector;
    let mut information = DMatrix::zeros(2 * n, 2 * n);
    for &(idx, share) in seen {
        let tag = &robot.tags[idx];
        let point = tag.base_from_tag.origin().vector();
        let weight = position_weight(robot, tag.size_m, &(point - eye)) * share;
        let mut jacobian = DMatrix::zeros(3, 2 * n);
        for (joint, spec) in robot.sensors.iter().enumerate().take(n) {
            let by_angle = poses.point_jacobian(joint, &point);
            let travel = angles[joint] - spec.center_rad;
            jacobian.fixed_view_mut::<3, 1>(0, 2 * joint).copy_from(&(by_angle * travel * spec.gain_std));
            jacobian.fixed_view_mut::<3, 1>(0, 2 * joint + 1).copy_from(&(by_angle * spec.offset_std_rad));
        }
        information += jacobian.transpose() * weight * jacobian;
    }
    information
}

/// Inverse covariance of a tag position from corners: its range comes from its apparent size, `r^2 sigma / (f s)`.
fn position_weight(robot: &Robot, size_m: f64, sight: &Vector3<f64>) -> Matrix3<f64> {
    let range = sight.norm();
    let unit = sight / range.max(1e-6);
    let along_std =
        (range * range * robot.camera.corner_std_px / (robot.camera.lens.focal_px[0] * size_m)).hypot(LATERAL_STD_M);
    let across = Matrix3::identity() / LATERAL_STD_M.powi(2);
    across + unit * unit.transpose() * (1.0 / along_std.powi(2) - 1.0 / LATERAL_STD_M.powi(2))
}

/// Tool position by the parameters in prior units, at each task pose.
fn task_jacobians(request: &PoseRequest<'_>) -> Vec<DMatrix<f64>> {
    let robot = request.robot;
    let n = n_seen(robot);
    let jacobian = |angles: &JointAngles| {
        let poses = robot.chain.link_poses(angles);
        let tool = poses.frame(&robot.tool.mount).translation.vector;
        let mut jacobian = DMatrix::zeros(3, 2 * n);
        for (joint, spec) in robot.sensors.iter().enumerate().take(n) {
            let by_angle = poses.point_jacobian(joint, &tool);
            let travel = angles[joint] - spec.center_rad;
            jacobian.fixed_view_mut::<3, 1>(0, 2 * joint).copy_from(&(by_angle * travel * spec.gain_std));
            jacobian.fixed_view_mut::<3, 1>(0, 2 * joint + 1).copy_from(&(by_angle * spec.offset_std_rad));
        }
        jacobian
    };
    request.task.iter().map(jacobian).collect()
}

/// Takes `n` candidates one by one, each the best beside those taken; gives them with the final mean tool variance, m^2. The first of
/// every `anchored_every` shows a known tag, as long as there are such candidates.
fn pick_greedily(
    candidates: &mut Vec<Candidate>,
    n: usize,
    task: &[DMatrix<f64>],
    anchored_every: usize,
) -> (Vec<(CaptureSet, JointAngles)>, f64) {
    let size = candidates[0].information.nrows();
    // The prior: one sigma each, in prior units.
    let mut total: DMatrix<f64> = DMatrix::identity(size, size);
    let mut variance_m2 = tool_variance_m2(&total, task);
    let mut picked = Vec::new();
    for turn in 0..n {
        let is_anchored = anchored_every > 1
            && turn % anchored_every == 0
            && candidates.iter().any(|candidate| candidate.shows_known_tag);
        let best = candidates
            .iter()
            .enumerate()
            .filter(|(_, candidate)| !is_anchored || candidate.shows_known_tag)
            .map(|(k, candidate)| (k, tool_variance_m2(&(&total + &candidate.information), task)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, variance)) = best else { break };
        variance_m2 = variance;
        let candidate = candidates.swap_remove(k);
        total += &candidate.information;
        picked.push((CaptureSet::Fit, candidate.angles));
    }
    (picked, variance_m2)
}

fn tool_variance_m2(information: &DMatrix<f64>, task: &[DMatrix<f64>]) -> f64 {
    let Some(cholesky) = information.clone().cholesky() else { return f64::INFINITY };
    let sum: f64 = task.iter().map(|jacobian| (jacobian * cholesky.solve(&jacobian.transpose())).trace()).sum();
    sum / task.len().max(1) as f64
}

/// Visits the nearest remaining pose next, by the largest joint movement.
fn ordered(mut poses: Vec<(CaptureSet, JointAngles)>, start: &JointAngles) -> Vec<(CaptureSet, JointAngles)> {
    let mut order: Vec<(CaptureSet, JointAngles)> = Vec::with_capacity(poses.len());
    while !poses.is_empty() {
        let at = order.last().map_or(*start, |(_, angles)| *angles);
        let distance = |pose: &(CaptureSet, JointAngles)| pose.1.max_abs_difference(&at);
        let nearest = (0..poses.len()).min_by(|&a, &b| distance(&poses[a]).total_cmp(&distance(&poses[b])));
        order.push(poses.swap_remove(nearest.unwrap_or(0)));
    }
    order
}
