//! Candidate poses: they show enough tags to most arms that the belief allows, and keep clear for every one.
//!
//! Draws come in turn from three sources. One is uniform over the narrowed joint ranges. One uses boxes of growing size
//! around the arm's configuration, because under wide bounds only poses near it are certified. One is the camera's
//! inverse kinematics at the tags. Cheap tests come first: field of view, clearance of the believed arm, probability of
//! the tags, the certificate, occlusion.

use crate::plan::constants::view_planning_candidates::{
    BOX_SHARES, FAILED_RADIUS_RAD, MAX_BLOCKED, MAX_DRAWS, MAX_REGIONS, MOST_TAGS, N_ARMS, R8, TARGET_DISTANCE_M,
};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::plan::PlanError;
use crate::plan::clearance::ClosestPair;
use crate::plan::clearance::sight::Sights;
use crate::plan::view_planning::camera_ik::CameraGoal;
use crate::plan::view_planning::request::PoseRequest;
use armcal_core::kinematics::{JointLimits, LinkPoses};
use armcal_core::robot::Robot;
use armcal_core::streams::{JointAngles, MAX_JOINTS};

/// A pose that may be chosen.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub angles: JointAngles,
    /// Index of each tag and the probability that the camera sees it.
    pub tags: Vec<(usize, f64)>,
    /// True if it shows a tag with a known pose to most arms within the bounds.
    pub shows_known_tag: bool,
    /// True for a configuration that was drawn uniformly over the joint ranges.
    pub is_even: bool,
}

/// Counts of the rejected draws, by reason.
#[derive(Clone, Debug, Default)]
pub(crate) struct InfeasibleCounts {
    pub tried: usize,
    /// Number of draws with 0, 1, ... tags in view; the last counts all beyond.
    by_tags: [usize; MOST_TAGS + 1],
    /// A tag in view of the pose that came nearest to being clear, and that pose's closest pair.
    nearest: Option<(u32, ClosestPair)>,
    /// Draws that show enough tags to the believed arm, but not to most arms that the belief allows.
    unsure: usize,
    /// Draws that show enough tags, with the tool at a target.
    at_target: usize,
    /// Names of shapes that hide tags of clear poses with enough tags in view, and the number of such poses.
    hidden: Vec<(String, usize)>,
    /// Draws that show enough tags, but some arm within the bounds comes too near.
    blocked: usize,
    /// True if the certificates' budget ended the search early.
    is_cut_short: bool,
}

/// Source of a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Uniform,
    Local,
    CameraIk,
}

impl Source {
    const ALL: [Self; 3] = [Self::Uniform, Self::Local, Self::CameraIk];

    /// Returns the cost of a failed draw, in candidates: sources have equal shares as long as they give any.
    fn draw_cost(self) -> f64 {
        match self {
            Self::Uniform | Self::Local => 0.02,
            Self::CameraIk => 0.1,
        }
    }
}

/// State of the search: draws and tests.
pub(crate) struct Search<'a> {
    request: &'a PoseRequest<'a>,
    limits: Vec<JointLimits>,
    /// Joint errors of the sampled arms in units of the bounds, -1 to 1.
    errors: [[f64; MAX_JOINTS]; N_ARMS],
    /// Sampled arms of the current draw.
    arms: Vec<DrawnArm>,
    /// Number of regions that certificates have tested.
    n_regions: usize,
    pub refused: InfeasibleCounts,
}

/// One of the sampled arms that represent the belief.
struct DrawnArm {
    poses: LinkPoses,
    /// Tags in view, before occlusion.
    in_view: Vec<usize>,
}

/// Returns the first joint from which on no joint moves camera and tags against each other. These joints keep their
/// angles, except those that turn a tag on the gripper.
fn n_seen(robot: &Robot) -> usize {
    robot.n_seen_joints()
}

/// True if a joint turns the tag on the gripper in the camera's view: then the views need many of its angles.
fn shows_gripper_tag(robot: &Robot, joint: usize) -> bool {
    robot.gripper_tag.is_some_and(|tag| tag.joints(&robot.camera.mount).contains(&joint))
}

impl<'a> Search<'a> {
    pub(crate) fn new(request: &'a PoseRequest<'a>) -> Self {
        let limits = request.bounds.safe_limits(request.robot);
        Self {
            request,
            limits,
            errors: errors(),
            arms: Vec::with_capacity(N_ARMS),
            n_regions: 0,
            refused: InfeasibleCounts::default(),
        }
    }

    /// Returns up to `enough` candidates.
    pub(crate) fn gather(&mut self, enough: usize, rng: &mut ChaCha8Rng) -> Vec<Candidate> {
        let mut found: Vec<Candidate> = Vec::with_capacity(enough);
        let mut spent = [0.0_f64; Source::ALL.len()];
        while found.len() < enough && self.may_go_on() {
            let source = Source::ALL.into_iter().min_by(|a, b| spent[*a as usize].total_cmp(&spent[*b as usize]));
            let source = source.unwrap_or(Source::Uniform);
            let angles = self.draw(source, &found, rng);
            self.refused.tried += 1;
            spent[source as usize] += source.draw_cost();
            if let Some(candidate) = self.assess(angles) {
                spent[source as usize] += 1.0;
                found.push(Candidate { is_even: source == Source::Uniform, ..candidate });
            }
        }
        self.refused.is_cut_short = self.n_regions >= MAX_REGIONS;
        tracing::debug!(
            "{} poses that may be taken, of {} drawn; {} regions were certified",
            found.len(),
            self.refused.tried,
            self.n_regions
        );
        found
    }

    fn may_go_on(&self) -> bool {
        let InfeasibleCounts { tried, blocked, .. } = self.refused;
        tried < MAX_DRAWS && blocked < MAX_BLOCKED && self.n_regions < MAX_REGIONS
    }

    fn draw(&self, source: Source, found: &[Candidate], rng: &mut ChaCha8Rng) -> JointAngles {
        match source {
            Source::Uniform => self.draw_in(None, rng),
            Source::Local => {
                let [least, most] = BOX_SHARES;
                let share = least * (most / least).powf(rng.random_range(0.0..1.0));
                self.draw_in(Some(share), rng)
            }
            Source::CameraIk => {
                let even = self.draw_in(None, rng);
                // Starts from a pose that is known to be good, or from anywhere.
                let seed = if found.is_empty() { even } else { found[rng.random_range(0..found.len())].angles };
                let n = n_seen(self.request.robot);
                let seed = JointAngles::from_fn(seed.len(), |j| if j < n { seed[j] } else { even[j] });
                let aim = CameraGoal::draw(self.request.robot, self.request.visibility, rng);
                aim.map_or(even, |aim| aim.solve(self.request.robot, &self.limits, &seed))
            }
        }
    }

    /// Draws uniformly over the ranges, or over a box around the start that extends by `share` of them to either side.
    fn draw_in(&self, share: Option<f64>, rng: &mut ChaCha8Rng) -> JointAngles {
        let robot = self.request.robot;
        let start = self.request.start;
        JointAngles::from_fn(robot.n_joints(), |j| {
            let part: f64 = rng.random_range(0.0..1.0);
            if j >= n_seen(robot) && !shows_gripper_tag(robot, j) {
                return start[j];
            }
            let JointLimits { lower_rad, upper_rad } = self.limits[j];
            let range_rad = (upper_rad - lower_rad).max(0.0);
            let (from, to) = match share {
                Some(share) if j < n_seen(robot) => {
                    let half_rad = share * range_rad;
                    ((start[j] - half_rad).max(lower_rad), (start[j] + half_rad).min(lower_rad + range_rad))
                }
                _ => (lower_rad, lower_rad + range_rad),
            };
            from + part * (to - from).max(0.0)
        })
    }

    /// Tests a draw; cheap tests come first, because most draws fail at the first.
    fn assess(&mut self, angles: JointAngles) -> Option<Candidate> {
        let request = self.request;
        let robot = request.robot;
        let min_tags = request.capture.min_tags as usize;
        let is_failed =
            |failed: &JointAngles| (0..n_seen(robot)).all(|j| (failed[j] - angles[j]).abs() < FAILED_RADIUS_RAD);
        if request.failed.iter().any(is_failed) {
            return None;
        }
        let poses = robot.chain.link_poses(&angles);
        let in_view = request.visibility.in_view(robot, &poses).count();
        self.refused.by_tags[in_view.min(MOST_TAGS)] += 1;
        if in_view < min_tags.max(1) {
            return None;
        }
        if robot
            .gripper_tag
            .is_some_and(|tag| !request.visibility.sees_gripper_tag(robot, &tag, request.clearance, &poses))
        {
            return None;
        }
        let tool = poses.frame(&robot.tool.mount).translation.vector;
        let near_target = |target: &[f64; 3]| (tool - Vector3::from(*target)).norm() < TARGET_DISTANCE_M;
        if request.targets_m.iter().any(near_target) {
            self.refused.at_target += 1;
            return None;
        }
        let margin_m = request.capture.clearance_m;
        if request.clearance.is_nearer_than(&angles, margin_m) {
            self.refused.blocked += 1;
            return None;
        }
        if self.expected_in_view(&angles) < min_tags as f64 {
            self.refused.unsure += 1;
            return None;
        }
        let certificate = request.clearance.certify_arriving(&angles, request.bounds, margin_m);
        self.n_regions += certificate.n_regions;
        if let Some((pair, distance_m)) = certificate.violation {
            let nearest = request.clearance.named(pair, distance_m);
            self.refused.blocked += 1;
            let tag = request.visibility.in_view(robot, &poses).next().map(|idx| robot.tags[idx].id);
            let best = |(_, most): &(u32, ClosestPair)| nearest.distance_m > most.distance_m;
            if let Some(tag) = tag.filter(|_| self.refused.nearest.as_ref().is_none_or(best)) {
                self.refused.nearest = Some((tag, nearest));
            }
            return None;
        }
        let tags = self.expected_tags();
        if tags.iter().map(|(_, share)| share).sum::<f64>() < min_tags as f64 {
            // The tags are in view for most arms, so a shape hides them.
            let blocker = request.visibility.hidden_by(robot, request.clearance, &angles).unwrap_or("the arm itself");
            self.refused.count_hidden(blocker);
            return None;
        }
        let shows_known_tag = tags.iter().any(|&(idx, share)| share > 0.5 && robot.tags[idx].is_known());
        Some(Candidate { angles, tags, shows_known_tag, is_even: false })
    }

    fn arm(&self, angles: &JointAngles, errors: &[f64; MAX_JOINTS]) -> JointAngles {
        let n = n_seen(self.request.robot);
        JointAngles::from_fn(angles.len(), |j| {
            if j < n { angles[j] + errors[j] * self.request.bounds.error_rad(j, angles[j]) } else { angles[j] }
        })
    }

    fn trust(&self, tag: usize) -> f64 {
        self.request.detection_rate.get(tag).copied().unwrap_or(1.0).clamp(0.0, 1.0)
    }

    /// Samples the arms and returns the expected number of tags in view, before occlusion.
    fn expected_in_view(&mut self, angles: &JointAngles) -> f64 {
        let (robot, visibility) = (self.request.robot, self.request.visibility);
        let mut arms = std::mem::take(&mut self.arms);
        for (n, errors) in self.errors.iter().enumerate() {
            let poses = robot.chain.link_poses(&self.arm(angles, errors));
            if n == arms.len() {
                arms.push(DrawnArm { poses, in_view: Vec::new() });
            }
            arms[n].poses = poses;
            arms[n].in_view.clear();
            arms[n].in_view.extend(visibility.in_view(robot, &poses));
        }
        self.arms = arms;
        let seen = self.arms.iter().flat_map(|arm| &arm.in_view);
        seen.map(|&tag| self.trust(tag)).sum::<f64>() / N_ARMS as f64
    }

    /// Returns each tag with the share of the sampled arms that see it, times the trust in that tag.
    fn expected_tags(&self) -> Vec<(usize, f64)> {
        let (robot, visibility) = (self.request.robot, self.request.visibility);
        let mut count = vec![0usize; robot.tags.len()];
        for DrawnArm { poses, in_view } in &self.arms {
            let sights = Sights::new(self.request.clearance, poses);
            for &tag in in_view.iter().filter(|&&tag| !visibility.is_hidden(robot, poses, &sights, tag)) {
                count[tag] += 1;
            }
        }
        let share = |(tag, n): (usize, usize)| (tag, self.trust(tag) * n as f64 / N_ARMS as f64);
        count.into_iter().enumerate().filter(|(_, n)| *n > 0).map(share).filter(|(_, share)| *share > 0.0).collect()
    }
}

/// Returns errors between the bounds with a triangular distribution, that of the sum of two uniform errors (gain and
/// offset).
fn errors() -> [[f64; MAX_JOINTS]; N_ARMS] {
    let mut step = 1.0;
    let steps: [f64; MAX_JOINTS] = std::array::from_fn(|_| {
        step /= R8;
        step
    });
    std::array::from_fn(|n| {
        std::array::from_fn(|joint| {
            let u = (0.5 + steps[joint] * (n + 1) as f64).fract();
            if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).sqrt() }
        })
    })
}

impl InfeasibleCounts {
    fn count_hidden(&mut self, blocker: &str) {
        match self.hidden.iter_mut().find(|(name, _)| name == blocker) {
            Some((_, n)) => *n += 1,
            None => self.hidden.push((blocker.to_owned(), 1)),
        }
    }

    /// Returns the error that there is no pose, with the nearest alternative that would work.
    pub(crate) fn no_pose(&self, request: &PoseRequest<'_>) -> PlanError {
        PlanError::NoUsefulPose {
            min_tags: request.capture.min_tags,
            n_tags: request.robot.tags.len(),
            clearance_m: request.capture.clearance_m,
            tried: self.tried,
            hint: self.hint(request),
        }
    }

    /// Describes the nearest alternative that would work.
    pub(crate) fn hint(&self, request: &PoseRequest<'_>) -> String {
        let min_tags = request.capture.min_tags as usize;
        if request.robot.tags.is_empty() {
            return "there is no tag to see".to_owned();
        }
        let enough: usize = self.by_tags[min_tags.clamp(1, MOST_TAGS)..].iter().sum();
        if enough == 0 {
            let most = (1..min_tags.min(MOST_TAGS + 1)).rev().find(|&n| self.by_tags[n] > 0);
            return match most {
                Some(n) => {
                    let poses: usize = self.by_tags[n..].iter().sum();
                    format!("{n} tags are in view from {poses} of the poses tried: min_tags = {n}")
                }
                None => "no tag comes into view of the camera from any pose tried".to_owned(),
            };
        }
        if self.is_cut_short {
            let poses =
                "every arm that the belief allows was to be clear at each of them, which took too long to prove";
            return format!("{poses}: the belief is very wide; check the joint sensors, and their noise in robot.toml");
        }
        // The last test that any draw reached.
        if let Some((blocker, n)) = self.hidden.iter().max_by_key(|(_, n)| *n) {
            return format!("{n} poses keep clear and have enough tags in view, but `{blocker}` hides them");
        }
        if let Some((tag, nearest)) = &self.nearest {
            let margin_m = request.capture.clearance_m;
            return format!(
                "tag {tag} comes into view at best with {:.3} m of clearance between {nearest} for every arm within \
                 the bounds; {:.3} m are needed",
                nearest.true_distance_m(),
                nearest.needed_m(margin_m)
            );
        }
        let poses = format!("{enough} poses have enough tags in view, but");
        if self.unsure > 0 {
            format!("{poses} {} of them only if the joints are where they are believed to be", self.unsure)
        } else if self.blocked > 0 {
            format!("{poses} the believed arm is too near to something there")
        } else if self.at_target > 0 {
            format!("{poses} their tool is at a target")
        } else {
            format!("{poses} the tag on the gripper is hidden there, or they were tried in vain")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::JointErrorBounds;
    use crate::plan::view_planning::fixture::Site;
    use armcal_core::stats::stream_rng;

    /// Within such bounds some arm collides at every pose; to prove it for each pose would take minutes.
    #[test]
    fn a_belief_that_is_very_wide_ends_the_search_by_budget() {
        let mut site = Site::titan();
        site.bounds = JointErrorBounds::alike(&site.robot, 0.6, 0.0);
        let clearance = site.clearance();
        let request = site.request(&clearance);
        let mut search = Search::new(&request);
        search.gather(300, &mut stream_rng(1, "plan"));
        // The last certificate may exceed the budget.
        assert!((MAX_REGIONS..MAX_REGIONS + 500_000).contains(&search.n_regions), "{}", search.n_regions);
        insta::assert_snapshot!("wide_bounds", search.refused.hint(&request));
    }

    #[test]
    fn the_arms_that_stand_for_the_belief_are_spread_as_a_triangle() {
        let arms = errors();
        for joint in 0..6 {
            let values: Vec<f64> = arms.iter().map(|errors| errors[joint]).collect();
            let mean = values.iter().sum::<f64>() / N_ARMS as f64;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / N_ARMS as f64;
            assert!(mean.abs() < 0.1 && (variance * 6.0 - 1.0).abs() < 0.35, "joint {joint}: {mean} {variance}");
            assert!(values.iter().all(|v| v.abs() < 1.0));
        }
    }
}
