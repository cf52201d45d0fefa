//! Tags that differ from their survey: two exchanged ids, a tag of another size, or all of another size.
//!
//! The camera's poses T_i come from the other tags. A tag that is seen at m_i (camera frame, by its stated size) and
//! surveyed at p seems to be at `q_i = T_i m_i`. If the median of q_i is the place of another tag that does not fit,
//! and the reverse holds, too, their ids are exchanged. A tag of another size is seen too far or too near by the ratio
//! of the sizes. The ratio is the median of `|T_i^-1 p| / |m_i|`, if it brings the tag's observations together. If all
//! tags are of another size, so is each distance between two of them in one view. The ratio is the median of
//! `|p_a - p_b| / |m_a - m_b|`, which no joint affects.

use crate::explain::constants::tags_identity::{
    CLOSER, LEAST_DISTANCE_M, LEAST_RATIO, LEAST_RATIO_OF_FITTING, MIN_OBSERVATIONS, MIN_SIZED, REJECTED_SHARE,
    SURE_SIGMAS,
};
pub(crate) use crate::explain::constants::tags_identity::{NEARER, SAME_PLACE_M};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::measure::WeightedMeasurement;
use crate::model::blocks::Block;
use crate::solve::estimate::Estimate;
use crate::views::constants::external_board::SIGMA_OF_MEDIAN;
use crate::views::view::{TagObservation, View};
use armcal_core::robot::Robot;
use armcal_core::spatial::Pose;
use armcal_core::stats::quantile;

/// Fault of a tag's survey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TagFault {
    /// Two tags with exchanged ids: indices into the robot's tags.
    Swapped([usize; 2]),
    /// True size of one tag over the stated one.
    Size { tag_idx: usize, ratio: f64 },
    /// True size of all tags over the stated one: printed at another scale.
    AllSizes { ratio: f64 },
    /// Moved with others, with prior standard deviations in m and rad (module `group`).
    Moved { tag_idx: usize, std: [f64; 2] },
    /// Moved with others, by one motion of the base frame; `cost_nats`: its share of the motion's cost (module
    /// `alike`).
    Alike { tag_idx: usize, base_motion: Isometry3<f64>, cost_nats: f64 },
}

impl TagFault {
    /// Changes `robot`'s survey to that under this fault.
    pub(crate) fn apply(&self, robot: &mut Robot) {
        match *self {
            Self::Swapped([a, b]) => {
                let place = robot.tags[a].base_from_tag;
                robot.tags[a].base_from_tag = robot.tags[b].base_from_tag;
                robot.tags[b].base_from_tag = place;
            }
            Self::Size { tag_idx, ratio } => robot.tags[tag_idx].size_m *= ratio,
            Self::AllSizes { ratio } => {
                robot.tags.iter_mut().for_each(|tag| tag.size_m *= ratio);
                robot.gripper_tag.iter_mut().for_each(|tag| tag.size_m *= ratio);
            }
            Self::Moved { tag_idx, std } => {
                let tag = &mut robot.tags[tag_idx];
                [tag.position_std_m, tag.rotation_std_rad] = std;
            }
            Self::Alike { tag_idx, base_motion, .. } => {
                let tag = &mut robot.tags[tag_idx];
                tag.base_from_tag = Pose::from_isometry(base_motion * tag.base_from_tag.isometry());
            }
        }
    }

    fn tags(&self) -> Vec<usize> {
        match *self {
            Self::Swapped(pair) => pair.to_vec(),
            Self::Size { tag_idx, .. } | Self::Moved { tag_idx, .. } | Self::Alike { tag_idx, .. } => vec![tag_idx],
            Self::AllSizes { .. } => Vec::new(),
        }
    }

    /// Cost of the fault beyond that in the evidence of an estimate under it, nats.
    pub(crate) fn cost_nats(&self) -> f64 {
        match *self {
            Self::Alike { cost_nats, .. } => cost_nats,
            _ => 0.0,
        }
    }

    /// Tag of this fault, if it is one of several that were moved together.
    pub(crate) fn moved_tag(&self) -> Option<usize> {
        match *self {
            Self::Moved { tag_idx, .. } | Self::Alike { tag_idx, .. } => Some(tag_idx),
            _ => None,
        }
    }

    /// Returns true if both faults concern one tag.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        self.tags().iter().any(|tag| other.tags().contains(tag))
    }
}

/// Observations of one tag in all views.
struct SeenTag {
    tag_idx: usize,
    /// Pose base_from_camera and position in the camera frame, m, per observation.
    observations: Vec<(Isometry3<f64>, Vector3<f64>)>,
}

impl Estimate<'_> {
    /// Possible tag faults by `views`; an estimate has to confirm each.
    pub(crate) fn tag_faults(&self, views: &[View]) -> Vec<TagFault> {
        let doubtful = self.doubtful_tags();
        let seen: Vec<SeenTag> = doubtful.into_iter().map(|tag_idx| self.seen(tag_idx, views)).collect();
        let seen: Vec<&SeenTag> = seen.iter().filter(|tag| tag.observations.len() >= MIN_OBSERVATIONS).collect();
        let robot = self.problem.robot;
        let mut faults = Vec::new();
        for (k, a) in seen.iter().enumerate() {
            let exchanged = seen[k + 1..].iter().find(|b| a.is_at(robot, b.tag_idx) && b.is_at(robot, a.tag_idx));
            faults.extend(exchanged.map(|b| TagFault::Swapped([a.tag_idx, b.tag_idx])));
        }
        faults.extend(seen.iter().filter_map(|tag| tag.size(robot)));
        let has_size = faults.iter().any(|fault| matches!(fault, TagFault::Size { .. }));
        faults.extend(if has_size { None } else { self.surest_size(views) });
        faults
    }

    /// Most significant size error of the tags that fit so far. If seen from all sides, such a tag stays where it is,
    /// and its observations are off here and there.
    fn surest_size(&self, views: &[View]) -> Option<TagFault> {
        let robot = self.problem.robot;
        let all = (0..robot.tags.len()).map(|tag_idx| self.seen(tag_idx, views));
        let often = all.filter(|tag| tag.observations.len() >= MIN_SIZED);
        let sizes = often.filter_map(|tag| tag.size(robot)).filter_map(|fault| match fault {
            TagFault::Size { ratio, .. } => Some(((ratio - 1.0).abs(), fault)),
            _ => None,
        });
        let large = sizes.filter(|(off, _)| *off > LEAST_RATIO_OF_FITTING);
        large.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, fault)| fault)
    }

    /// Tag most of whose observations are rejected but agree on another place, and that place, base frame, m.
    pub(crate) fn rejected_tag(&self, views: &[View]) -> Option<(usize, Vector3<f64>)> {
        let robot = self.problem.robot;
        let rejected = (0..robot.tags.len()).filter(|tag| self.rejected_share(*tag) > REJECTED_SHARE);
        let seen = rejected.map(|tag_idx| self.seen(tag_idx, views));
        let elsewhere = seen.filter(|tag| tag.observations.len() >= MIN_OBSERVATIONS && tag.is_elsewhere(robot));
        let most = elsewhere.max_by_key(|tag| tag.observations.len())?;
        Some((most.tag_idx, most.place(1.0)))
    }

    /// Tags without a fitting observation, with the number of their observations.
    pub(crate) fn left_out_tags(&self) -> impl Iterator<Item = (usize, usize)> {
        let observations = &self.problem.observations;
        let n_of = |tag: usize| observations.iter().filter(|observation| observation.block == Block::Tag(tag)).count();
        let is_unused = |tag: &usize| !observations.iter().any(|seen| seen.block == Block::Tag(*tag) && seen.is_used);
        let unused = (0..self.problem.robot.tags.len()).filter(is_unused);
        unused.map(move |tag| (tag, n_of(tag))).filter(|(_, n)| *n >= MIN_OBSERVATIONS)
    }

    /// Tags that do not fit, or that the data displace from their survey.
    pub(crate) fn doubtful_tags(&self) -> Vec<usize> {
        let elsewhere = self.departed_tags();
        let is_doubtful = |tag: &usize| self.rejected_share(*tag) > REJECTED_SHARE || elsewhere.contains(tag);
        (0..self.problem.robot.tags.len()).filter(is_doubtful).collect()
    }

    /// Share of a tag's observations that are rejected.
    fn rejected_share(&self, tag_idx: usize) -> f64 {
        let of_tag = || self.problem.observations.iter().filter(|observation| observation.block == Block::Tag(tag_idx));
        of_tag().filter(|observation| !observation.is_used).count() as f64 / of_tag().count().max(1) as f64
    }

    /// Observations of a tag in the views that other tags locate.
    fn seen(&self, tag_idx: usize, views: &[View]) -> SeenTag {
        let problem = &self.problem;
        let mut observations = Vec::new();
        for (view_idx, (data, view)) in problem.views.iter().zip(views).enumerate() {
            let of_view = &problem.observations[data.observations.clone()];
            let is_placed = of_view.iter().any(|other| other.is_used && other.block != Block::Tag(tag_idx));
            let Some(tag) = view.tags.iter().find(|tag| tag.tag_idx == tag_idx).filter(|_| is_placed) else { continue };
            let is_image = of_view.iter().all(|other| matches!(other.data, WeightedMeasurement::Corners(_)));
            if is_image {
                let state = &self.solved.state;
                let camera = problem.robot.camera_at(view.camera);
                let link = *problem.link_poses(view_idx, state).link(camera.mount.n_joints);
                let base_from_camera = link * state.pose(Block::Mount(view.camera)) * state.camera_error[view_idx];
                observations.push((base_from_camera, tag.center_in_camera_m));
            }
        }
        SeenTag { tag_idx, observations }
    }
}

/// True size of all tags over the stated one, by the distances between tags of one view. `None` if the stated size
/// explains them, or no view has two tags.
pub(crate) fn common_size_ratio(views: &[View], robot: &Robot) -> Option<f64> {
    let place = |tag: &TagObservation| robot.tags[tag.tag_idx].base_from_tag.isometry().translation.vector;
    let (mut ratios, mut n_views) = (Vec::new(), 0);
    for view in views {
        let tags: Vec<&TagObservation> = view.tags.iter().filter(|tag| tag.corners().is_some()).collect();
        n_views += u32::from(tags.len() > 1);
        for (n, a) in tags.iter().enumerate() {
            let others = tags[n + 1..].iter().map(|b| ((place(a) - place(b)).norm(), a, b));
            let seen_m = |a: &TagObservation, b: &TagObservation| (a.center_in_camera_m - b.center_in_camera_m).norm();
            ratios.extend(others.filter(|(m, ..)| *m > LEAST_DISTANCE_M).map(|(m, a, b)| m / seen_m(a, b)));
        }
    }
    let ratio = quantile(&ratios, 0.5)?;
    let spread: Vec<f64> = ratios.iter().map(|r| (r - ratio).abs()).collect();
    let std = SIGMA_OF_MEDIAN * quantile(&spread, 0.5)? / f64::from(n_views).sqrt();
    ((ratio - 1.0).abs() > LEAST_RATIO.max(SURE_SIGMAS * std)).then_some(ratio)
}

impl SeenTag {
    /// Median position of the tag by its observations, base frame, m, for a size of `ratio` times the stated one.
    fn place(&self, ratio: f64) -> Vector3<f64> {
        let along = |axis: usize| {
            let all = self
                .observations
                .iter()
                .map(|(base_from_camera, at)| (base_from_camera * Point3::from(at * ratio))[axis]);
            quantile(&all.collect::<Vec<f64>>(), 0.5).unwrap_or(0.0)
        };
        Vector3::new(along(0), along(1), along(2))
    }

    /// Returns true if the observations are nearer to one another than to the survey.
    fn is_elsewhere(&self, robot: &Robot) -> bool {
        let place = self.place(1.0);
        let off = self.observations.iter().map(|(base_from_camera, at)| base_from_camera * Point3::from(*at) - place);
        let spread_m: Vec<f64> = off.map(|off| off.coords.norm()).collect();
        let survey = robot.tags[self.tag_idx].base_from_tag.isometry().translation.vector;
        quantile(&spread_m, 0.5).is_some_and(|spread_m| spread_m < NEARER * (place - survey).norm())
    }

    fn is_at(&self, robot: &Robot, other: usize) -> bool {
        let place = |tag_idx: usize| robot.tags[tag_idx].base_from_tag.isometry().translation.vector;
        let there_m = (self.place(1.0) - place(other)).norm();
        there_m < SAME_PLACE_M && there_m < NEARER * (self.place(1.0) - place(self.tag_idx)).norm()
    }

    fn size(&self, robot: &Robot) -> Option<TagFault> {
        let survey = robot.tags[self.tag_idx].base_from_tag.isometry().translation.vector;
        let ratios: Vec<f64> = self
            .observations
            .iter()
            .map(|(base_from_camera, at)| {
                base_from_camera.inverse_transform_point(&survey.into()).coords.norm() / at.norm()
            })
            .collect();
        let ratio = quantile(&ratios, 0.5)?;
        let spread: Vec<f64> = ratios.iter().map(|r| (r - ratio).abs()).collect();
        let std = SIGMA_OF_MEDIAN * quantile(&spread, 0.5)? / (ratios.len() as f64).sqrt();
        let distance_m = |ratio: f64| {
            let off = self.observations.iter().map(|(base_from_camera, at)| {
                (base_from_camera * Point3::from(at * ratio) - Point3::from(survey)).norm()
            });
            quantile(&off.collect::<Vec<f64>>(), 0.5).unwrap_or(f64::INFINITY)
        };
        let is_sure = (ratio - 1.0).abs() > LEAST_RATIO.max(SURE_SIGMAS * std);
        let is_closer = distance_m(ratio) < CLOSER * distance_m(1.0);
        (is_sure && is_closer).then_some(TagFault::Size { tag_idx: self.tag_idx, ratio })
    }
}
