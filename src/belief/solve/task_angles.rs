//! Joint angles at the task's targets, at which the tool error is predicted.
//!
//! A pose that the task states is used unchanged. For a position, inverse kinematics starts from several configurations
//! where a solution is likely. First are the rest of the arm at it (as a `reach` moves there), the stowed pose and the
//! other rests. Then come the views with the nearest tool, and random ones. A single start may end at a joint limit
//! although the target is within reach.

use crate::solve::constants::task_angles::{N_NEAREST_VIEWS, N_RANDOM_STARTS, TOLERANCE_M};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::views::view::{TaskRests, View};
use armcal_core::kinematics::{IkGoal, IkSettings, JointLimits, solve_position};
use armcal_core::robot::Robot;
use armcal_core::stats::stream_rng;
use armcal_core::streams::JointAngles;

/// Returns the joint angles at each target that is within reach.
#[must_use]
pub fn task_angles(robot: &Robot, task: TaskRests<'_>) -> Vec<JointAngles> {
    numbered_task_angles(robot, task).into_iter().map(|(_, angles)| angles).collect()
}

/// Returns [`task_angles`] with the number of each target, from 0.
pub(crate) fn numbered_task_angles(robot: &Robot, task: TaskRests<'_>) -> Vec<(u32, JointAngles)> {
    let search = TargetSearch::new(robot, task);
    let numbered = (0..).zip(&task.task.targets_m);
    numbered.filter_map(|(target_idx, target_m)| Some((target_idx, search.angles(target_idx, *target_m)?))).collect()
}

/// Random angles within the limits, uniformly distributed; locked joints are stowed.
pub(crate) fn random_start(robot: &Robot, settings: &IkSettings, rng: &mut ChaCha8Rng) -> JointAngles {
    JointAngles::from_fn(robot.n_joints(), |j| {
        let limits = settings.limits[j];
        if settings.locked[j] { robot.stowed[j] } else { rng.random_range(limits.lower_rad..=limits.upper_rad) }
    })
}

struct TargetSearch<'a> {
    robot: &'a Robot,
    task: TaskRests<'a>,
    settings: IkSettings,
}

impl<'a> TargetSearch<'a> {
    fn new(robot: &'a Robot, task: TaskRests<'a>) -> Self {
        let open = JointLimits { lower_rad: -std::f64::consts::TAU, upper_rad: std::f64::consts::TAU };
        let settings = IkSettings {
            limits: robot.chain.joints().iter().map(|joint| joint.limits.unwrap_or(open)).collect(),
            locked: (0..robot.n_joints()).map(|j| j >= robot.tool.mount.n_joints || robot.is_locked(j)).collect(),
            tolerance_m: TOLERANCE_M,
            max_iterations: 200,
        };
        Self { robot, task, settings }
    }

    fn angles(&self, target_idx: u32, target_m: [f64; 3]) -> Option<JointAngles> {
        let target_m = Vector3::from(target_m);
        let (rests, pose) = (self.task.rests, self.task.task.pose(target_idx as usize));
        if let Some(pose) = pose.filter(|pose| self.takes(pose)) {
            return Some(*pose);
        }
        let from = |start: &JointAngles| self.solve(&target_m, start);
        let own = pose.or_else(|| rests.get(&target_idx)).and_then(from);
        let by_rests = own.or_else(|| from(&self.robot.stowed)).or_else(|| rests.values().find_map(from));
        if by_rests.is_some() || !self.robot.is_long_enough_for(&target_m) {
            return by_rests;
        }
        let by_views = self.nearest_views(&target_m).iter().find_map(from);
        by_views.or_else(|| self.random_starts(target_idx).find_map(|start| from(&start)))
    }

    /// Returns true if no joint up to the tool is locked at another angle.
    fn takes(&self, pose: &JointAngles) -> bool {
        let n = self.robot.tool.mount.n_joints;
        (0..n).all(|j| !self.settings.locked[j] || pose[j] == self.robot.stowed[j])
    }

    fn solve(&self, target_m: &Vector3<f64>, start: &JointAngles) -> Option<JointAngles> {
        let Self { robot, settings, .. } = self;
        let start = JointAngles::from_fn(start.len(), |j| if settings.locked[j] { robot.stowed[j] } else { start[j] });
        let goal = IkGoal { position_m: *target_m };
        solve_position(&robot.chain, &robot.tool.mount, &goal, &start, settings).ok()
    }

    /// Measured angles of the views whose tool is nearest to the target, nearest first.
    fn nearest_views(&self, target_m: &Vector3<f64>) -> Vec<JointAngles> {
        let off_m = |angles: &JointAngles| {
            let tool = self.robot.chain.link_poses(angles).frame(&self.robot.tool.mount);
            (tool.translation.vector - target_m).norm()
        };
        let read = self.task.views.iter().map(|view| self.angles_read(view));
        let mut near: Vec<(f64, JointAngles)> = read.map(|angles| (off_m(&angles), angles)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.into_iter().take(N_NEAREST_VIEWS).map(|(_, angles)| angles).collect()
    }

    fn angles_read(&self, view: &View) -> JointAngles {
        let sensors = &self.robot.sensors;
        JointAngles::from_fn(self.robot.n_joints(), |j| match sensors.get(j) {
            Some(spec) if j < view.travel_rad.len() => spec.center_rad + view.travel_rad[j],
            _ => self.robot.stowed[j],
        })
    }

    /// Random starts for a target; other targets do not change them.
    fn random_starts(&self, target_idx: u32) -> impl Iterator<Item = JointAngles> + '_ {
        let mut rng = stream_rng(u64::from(target_idx), "starts of a target");
        (0..N_RANDOM_STARTS).map(move |_| random_start(self.robot, &self.settings, &mut rng))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::titan;
    use armcal_core::robot::{FailedJoint, FailedKind};
    use armcal_core::streams::ReachTask;
    use armcal_core::time::SIMULATION_EPOCH;
    use std::collections::BTreeMap;

    /// A target is predicted at the arm's rest for it. Without a rest, or if no solution leads from it, the stowed
    /// pose's solution counts.
    #[test]
    fn a_target_is_predicted_where_the_arm_rested_for_it() {
        let robot = titan();
        let tool_m = |at: &JointAngles| robot.chain.frame(at, &robot.tool.mount).translation.vector;
        let mut rested = robot.stowed;
        for (joint, by_rad) in [(0, -0.6), (1, -0.5), (2, 0.8), (3, -0.9), (4, 0.5)] {
            rested[joint] += by_rad;
        }
        // The sensors are wrong: the arm rested next to the target.
        let mut at_target = rested;
        (0..5).for_each(|joint| at_target[joint] += 0.02);
        let task = ReachTask {
            stamp: Default::default(),
            targets_m: vec![tool_m(&at_target).into()],
            tolerance_m: 0.01,
            poses: Vec::new(),
        };
        let angles = |rests: &[(u32, JointAngles)]| {
            let rests: BTreeMap<u32, JointAngles> = rests.iter().copied().collect();
            task_angles(&robot, TaskRests { task: &task, rests: &rests, views: &[] })
        };
        let [by_rest] = angles(&[(0, rested)])[..] else { panic!("one target") };
        let by_stowed = angles(&[]);
        assert!(by_rest.max_abs_difference(&rested) < 0.12, "{by_rest:?}");
        assert!((tool_m(&by_rest) - tool_m(&at_target)).norm() < 1e-3);
        assert!(by_stowed[0].max_abs_difference(&rested) > 0.2, "{by_stowed:?}");
        assert_eq!(angles(&[(1, rested)]), by_stowed);
    }

    /// Random poses within the limits, and the task of their tool positions.
    fn random_task(robot: &Robot, seed: u64, n: usize) -> (Vec<JointAngles>, ReachTask) {
        let task = ReachTask { stamp: Default::default(), targets_m: Vec::new(), tolerance_m: 0.01, poses: Vec::new() };
        let rests = BTreeMap::new();
        let search = TargetSearch::new(robot, TaskRests { task: &task, rests: &rests, views: &[] });
        let mut rng = stream_rng(seed, "poses");
        let poses: Vec<JointAngles> = (0..n).map(|_| random_start(robot, &search.settings, &mut rng)).collect();
        let tool_m = |at: &JointAngles| robot.chain.frame(at, &robot.tool.mount).translation.vector.into();
        let targets_m = poses.iter().map(tool_m).collect();
        (poses, ReachTask { targets_m, ..task })
    }

    /// A single start reaches a part of the targets within reach. Starts at views reach all of them; random ones reach
    /// more than a single start.
    #[test]
    fn a_target_within_reach_is_found_without_rests() {
        let (robot, rests) = (titan(), BTreeMap::new());
        let [mut missed_from_stowed, mut missed_without_views] = [0; 2];
        for seed in 0..3 {
            let (poses, task) = random_task(&robot, seed, 40);
            let travel = |at: &JointAngles| JointAngles::from_fn(at.len(), |j| at[j] - robot.sensors[j].center_rad);
            let views: Vec<View> = poses.iter().map(|at| View::of_reading(0, SIMULATION_EPOCH, travel(at))).collect();
            let numbered = |views| numbered_task_angles(&robot, TaskRests { task: &task, rests: &rests, views });
            assert_eq!(numbered(&views).len(), poses.len(), "seed {seed}");
            let without_views = numbered(&[]);
            assert_eq!(without_views, numbered(&[]), "seed {seed}");
            missed_without_views += poses.len() - without_views.len();
            let search = TargetSearch::new(&robot, TaskRests { task: &task, rests: &rests, views: &[] });
            let from_stowed = |target: &&[f64; 3]| search.solve(&Vector3::from(**target), &robot.stowed).is_none();
            missed_from_stowed += task.targets_m.iter().filter(from_stowed).count();
        }
        assert!(missed_without_views < missed_from_stowed, "{missed_without_views} of {missed_from_stowed}");
    }

    #[test]
    fn a_target_beyond_the_links_in_one_line_has_no_angles() {
        let robot = titan();
        let (_, mut task) = random_task(&robot, 5, 2);
        let stowed = robot.chain.frame(&robot.stowed, &robot.tool.mount);
        task.targets_m = vec![[2.0 * robot.reach_m(), 0.0, 0.0], stowed.translation.vector.into()];
        let numbered = numbered_task_angles(&robot, TaskRests { task: &task, rests: &BTreeMap::new(), views: &[] });
        assert_eq!(numbered.iter().map(|(idx, _)| *idx).collect::<Vec<_>>(), [1]);
    }

    /// A pose is judged at its own angles, even if another configuration leads there; a joint locked elsewhere stays
    /// there.
    #[test]
    fn a_pose_of_the_task_is_taken_as_it_is() {
        for seed in 10..14 {
            let robot = titan();
            let (poses, mut task) = random_task(&robot, seed, 6);
            task.poses = poses[2..].to_vec();
            let angles = |robot: &Robot| {
                numbered_task_angles(robot, TaskRests { task: &task, rests: &BTreeMap::new(), views: &[] })
            };
            let as_given: Vec<(u32, JointAngles)> = (2..).zip(task.poses.iter().copied()).collect();
            let of_poses = angles(&robot).into_iter().filter(|(target_idx, _)| *target_idx >= 2);
            assert_eq!(of_poses.collect::<Vec<_>>(), as_given, "seed {seed}");
            let locked = robot.clone().with_failed(&[FailedJoint { joint: 0, kind: FailedKind::Locked }]);
            assert!(angles(&locked).iter().all(|(_, at)| at[0] == locked.stowed[0]), "seed {seed}");
        }
    }
}
