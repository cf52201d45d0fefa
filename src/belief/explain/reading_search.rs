//! Searches for a way to read the joints, to carry the camera, or to place the tag map, that explains views which no
//! arm of this URDF explains as they are read.
//!
//! Each [`Hypothesis`] changes the readings of all views alike, the nominal mount or the map's frame; the joints are
//! then estimated by the datasheet's scales. The score is that of
//! [`failure_detection`](crate::explain::failure_detection). A hypothesis is named if it is likelier than the
//! readings as they are by [`MARGIN`], and if its estimate leaves no sensor suspicious.

mod hypothesis;
mod map_frame;
mod map_scale;

use crate::explain::constants::reading_search::{
    ALTERNATIVE, MARGIN, MAX_ALTERNATIVES, MAX_COMPOSITE, MAX_ESTIMATED, MAX_OF_CAMERA, MAX_VIEWS, MIN_SIGMAS,
};
use std::f64::consts::TAU;

use crate::explain::angles_by_camera::{distance_cost, has_known_mount};
use crate::explain::constants::reading_search_hypothesis::NEXT_TURN_RAD;
use crate::explain::drawing::Drawing;
use crate::explain::failure_detection::{is_suspicious, score};
use crate::explain::failures::{Failure, FailureAdjusted};
use crate::explain::reading_search::hypothesis::{Hypothesis, SCALE_STD, ZERO_STD_RAD};
use crate::explain::reading_search::map_scale::MapScale;
use crate::explain::wrong_input::map::margin_hint;
use crate::model::parameters::JointParameters;
use crate::positions::position_problem::PositionProblem;
use crate::say::reading_error::{JointZero, MisreadReadings, ReadingError, SignedJoint};
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::HyperparameterMode;
use crate::views::view::{TagObservation, View};
use armcal_core::joints::JointAngles;
use armcal_core::robot::{JointSensorSpec, Robot, SurveyedTag};
use armcal_core::sensor::wrap_symmetric;

/// Hypothesis and its score.
struct Tried {
    hypothesis: Hypothesis,
    score: f64,
    fits: bool,
    sensors: JointParameters,
    tag_error_m: Option<f64>,
}

impl Tried {
    fn of(hypothesis: Hypothesis, found: &Estimate<'_>, views: &[View]) -> Self {
        Self {
            score: score(found) + hypothesis.handicap(),
            hypothesis,
            fits: !is_suspicious(found),
            sensors: found.parameters(),
            tag_error_m: tag_error_m(found, views),
        }
    }

    /// Returns true if it explains the views nearly as well as the best one. A frame that is turned about a joint's
    /// axis looks like that joint's zero. The handicap of the frame only decides the order; what the frame explains
    /// better is a part of the base's error that the zero lacks.
    fn is_near(&self, best: &Self) -> bool {
        if best.hypothesis.is_of_map() && matches!(self.hypothesis, Hypothesis::Zeros(_)) {
            return true;
        }
        let of_order = if self.hypothesis.is_of_map() { self.hypothesis.handicap() } else { 0.0 };
        self.score - of_order - best.score < ALTERNATIVE
    }
}

/// Arm whose views no calibration explains.
#[derive(Clone, Copy)]
pub(crate) struct ReadingSearch<'a> {
    pub robot: &'a Robot,
    /// Views as they were read.
    pub views: &'a [View],
    /// Failed sensors as detected: the alternative that a reading error must beat.
    pub failures: &'a [Failure],
    /// Repaired geometry, another alternative.
    pub drawing: &'a Drawing,
    /// Tags as they were given; `None` if the views made the map, which then is in the base's frame.
    pub map: Option<&'a [SurveyedTag]>,
}

impl ReadingSearch<'_> {
    /// Reading error that explains the views, if the readings as they are do not.
    pub(crate) fn find(&self) -> Option<MisreadReadings> {
        let stride = self.stride();
        let views: Vec<View> = self.views.iter().step_by(stride).cloned().collect();
        let before_m = PositionProblem::new(self.robot, &views).rms_m(&JointParameters::default())?;
        let as_read = self.score_as_read(&views, stride);
        let turned = Hypothesis::other_turns(self.robot, self.views).and_then(|hypothesis| self.attempt(hypothesis));
        if let Some(turned) = turned.filter(|turned| turned.fits && turned.score < as_read) {
            return Some(self.misread_turns(&turned, before_m));
        }
        let is_good = |tried: &Tried| tried.fits && as_read - tried.score > MARGIN && self.is_large(tried);
        let frame = self.attempt_map_frame(&views).filter(is_good);
        // In the wrong frame tags seem to have moved or to have other sizes: findings on them are invalid.
        let given = frame.as_ref().and(self.map).map(|map| map_frame::as_given(self.robot, map, self.views));
        let search = given.as_ref().map_or(*self, |(robot, views)| ReadingSearch { robot, views, ..*self });
        let scale = self.attempt_map_scale(&views).filter(is_good);
        let tried = search.likely().into_iter().filter_map(|hypothesis| search.attempt(hypothesis));
        let mut tried: Vec<Tried> = tried.filter(is_good).chain(frame).chain(scale).collect();
        tried.sort_by(|a, b| a.score.total_cmp(&b.score));
        let best = tried.first()?;
        let found = self.named(best);
        let alternatives = self.alternatives(best, &tried[1..]);
        Some(MisreadReadings { found, alternatives, tag_error_m: before_m, corrected_m: best.tag_error_m })
    }

    /// Alternatives that explain the views nearly as well as the best one, the frame of the map first.
    fn alternatives(&self, best: &Tried, others: &[Tried]) -> Vec<ReadingError> {
        let mut near: Vec<&Tried> = others.iter().filter(|other| other.is_near(best)).collect();
        near.sort_by_key(|other| !other.hypothesis.is_of_map());
        let found = self.named(best);
        let mut alternatives: Vec<ReadingError> = Vec::new();
        for error in near.into_iter().map(|other| self.named(other)) {
            let is_new = !concerns_same(&error, &found) && !alternatives.iter().any(|one| concerns_same(one, &error));
            if is_new && alternatives.len() < MAX_ALTERNATIVES {
                alternatives.push(error);
            }
        }
        alternatives
    }

    /// Joints that are beyond their limits in most views, and fit as well on a turn within them.
    pub(crate) fn find_other_turns(&self) -> Option<MisreadReadings> {
        let hypothesis = Hypothesis::other_turns_in_most(self.robot, self.views)?;
        let before_m = PositionProblem::new(self.robot, self.views).rms_m(&JointParameters::default())?;
        let turned = self.attempt(hypothesis).filter(|turned| turned.fits)?;
        Some(self.misread_turns(&turned, before_m))
    }

    fn misread_turns(&self, turned: &Tried, tag_error_m: f64) -> MisreadReadings {
        let (found, alternatives) = (self.named(turned), Vec::new());
        MisreadReadings { found, alternatives, tag_error_m, corrected_m: turned.tag_error_m }
    }

    /// Step between the views that are used.
    fn stride(&self) -> usize {
        self.views.len().div_ceil(MAX_VIEWS).max(1)
    }

    /// Every `stride`-th view, read by `hypothesis`.
    fn views_by(&self, hypothesis: &Hypothesis) -> Vec<View> {
        // Only readings of another view need all of them.
        if matches!(hypothesis, Hypothesis::Shifted(_)) {
            return hypothesis.applied(self.robot, self.views).into_iter().step_by(self.stride()).collect();
        }
        let views: Vec<View> = self.views.iter().step_by(self.stride()).cloned().collect();
        hypothesis.applied(self.robot, &views)
    }

    /// Least score of the readings as they are, with failed sensors and repaired geometry.
    fn score_as_read(&self, views: &[View], stride: usize) -> f64 {
        let of_views = |failure: &Failure| {
            let views = failure.views.iter().filter(|view| view.is_multiple_of(stride)).map(|view| view / stride);
            Failure { views: views.collect(), since: failure.since.map(|since| since / stride), ..failure.clone() }
        };
        let failures: Vec<Failure> = self.failures.iter().map(of_views).collect();
        let with = |failures: &[Failure]| {
            let adjusted = FailureAdjusted::new(self.robot, views, failures, &JointParameters::default());
            let mut input = adjusted.input(HyperparameterMode::Given);
            self.drawing.apply(&mut input);
            estimate(&input).map_or(f64::INFINITY, |found| score(&found))
        };
        with(&[]).min(with(&failures))
    }

    /// Hypotheses that are worth an estimate.
    fn likely(&self) -> Vec<Hypothesis> {
        let all = Hypothesis::all(self.robot);
        if !has_known_mount(self.robot) {
            return all;
        }
        let cost = |hypothesis: &Hypothesis| -> f64 {
            let robot = hypothesis.robot(self.robot);
            let of_view = |view: &View| {
                let angle_rad = |joint: usize| robot.sensors[joint].center_rad + view.travel_rad[joint];
                distance_cost(&robot, view, &JointAngles::from_fn(view.travel_rad.len(), angle_rad))
            };
            let views = self.views_by(hypothesis);
            views.iter().map(of_view).sum::<f64>() / views.len().max(1) as f64
        };
        let by_cost = |all: Vec<Hypothesis>| {
            let mut with_costs: Vec<(f64, Hypothesis)> = all.into_iter().map(|one| (cost(&one), one)).collect();
            with_costs.sort_by(|a, b| a.0.total_cmp(&b.0));
            with_costs.into_iter().map(|(_, hypothesis)| hypothesis)
        };
        let (of_camera, of_readings): (Vec<_>, Vec<_>) = by_cost(all).partition(Hypothesis::is_of_camera);
        let composite = by_cost(Hypothesis::composite(self.robot)).take(MAX_COMPOSITE);
        let n_readings = MAX_ESTIMATED - MAX_OF_CAMERA;
        let simple = of_readings.into_iter().take(n_readings).chain(of_camera.into_iter().take(MAX_OF_CAMERA));
        simple.chain(composite).collect()
    }

    fn name(&self, joint: usize) -> String {
        self.robot.sensors[joint].joint.clone()
    }

    fn attempt(&self, hypothesis: Hypothesis) -> Option<Tried> {
        let mut robot = hypothesis.robot(self.robot).into_owned();
        match &hypothesis {
            Hypothesis::Zeros(zeros) => {
                for (joint, _) in zeros {
                    robot.sensors[*joint].offset_std_rad = robot.sensors[*joint].offset_std_rad.max(ZERO_STD_RAD);
                }
            }
            Hypothesis::Scaled { joint, .. } => robot.sensors[*joint].gain_std = SCALE_STD,
            _ => {}
        }
        let views = self.views_by(&hypothesis);
        let adjusted = FailureAdjusted::new(&robot, &views, &[], &JointParameters::default());
        let found = estimate(&adjusted.input(HyperparameterMode::Given))?;
        Some(Tried::of(hypothesis, &found, &views))
    }

    /// Estimates with all tags moved as one, if the map was measured without the arm.
    fn attempt_map_frame(&self, views: &[View]) -> Option<Tried> {
        let map = self.map.filter(|_| !self.robot.is_watched())?;
        let (robot, views) = map_frame::as_given(self.robot, map, views);
        let map_from_base = map_frame::map_from_base(&robot, &views)?;
        let moved = map_frame::in_base(&robot, &map_from_base);
        let adjusted = FailureAdjusted::new(&moved, &views, &[], &JointParameters::default());
        let mut input = adjusted.input(HyperparameterMode::Given);
        map_frame::free(&mut input);
        let found = estimate(&input)?;
        let base_from_map = map_frame::base_from_map(&found, &map_from_base);
        Some(Tried::of(Hypothesis::MapFrame(base_from_map), &found, &views))
    }

    /// Estimates with sizes and distances of all tags scaled alike, where the arm shows another scale than the map.
    fn attempt_map_scale(&self, views: &[View]) -> Option<Tried> {
        if self.robot.is_watched() {
            return None;
        }
        let (robot, views) = map_frame::as_given(self.robot, self.map.unwrap_or(&self.robot.tags), views);
        let attempt = |scale: MapScale| {
            let (robot, views) = (scale.of_robot(&robot), scale.of_views(&views));
            let adjusted = FailureAdjusted::new(&robot, &views, &[], &JointParameters::default());
            let mut input = adjusted.input(HyperparameterMode::Given);
            map_frame::free(&mut input);
            Some(Tried::of(Hypothesis::MapScale(scale.factor), &estimate(&input)?, &views))
        };
        let scale = MapScale::by_arm(&robot, &views)?.refined(|scale| Some(attempt(scale)?.score))?;
        attempt(scale).filter(|_| scale.is_large())
    }

    /// Returns true if an estimated zero exceeds the sensor's stated error, or a frame exceeds a base's. Other errors
    /// have no size.
    fn is_large(&self, tried: &Tried) -> bool {
        let zeros = match &tried.hypothesis {
            Hypothesis::Zeros(zeros) => zeros,
            Hypothesis::MapFrame(base_from_map) => return map_frame::is_large(base_from_map),
            _ => return true,
        };
        zeros.iter().all(|(joint, off_rad)| {
            let off_rad = wrap_symmetric(off_rad + tried.sensors.offset_rad[*joint], TAU);
            off_rad.abs() > MIN_SIGMAS * self.robot.sensors[*joint].offset_std_rad
        })
    }

    fn named_scale(&self, factor: f64) -> ReadingError {
        let is_in_pixels = self.views.iter().flat_map(|view| &view.tags).any(TagObservation::is_in_pixels);
        let hint = margin_hint(self.robot.tag_family, factor).filter(|_| is_in_pixels);
        ReadingError::MapScale { factor, is_in_pixels, hint }
    }

    fn named(&self, tried: &Tried) -> ReadingError {
        let name = |joint: usize| self.name(joint);
        match &tried.hypothesis {
            Hypothesis::Order(order) => {
                let moved: Vec<usize> = (0..order.len()).filter(|&joint| order[joint] != joint).collect();
                match moved[..] {
                    [a, b] => ReadingError::Exchanged { joints: [a, b].map(name) },
                    [a, b, c] => {
                        let recorded = [a, b, c].map(|joint| name(order[joint])).to_vec();
                        ReadingError::InCircle { joints: [a, b, c].map(name).to_vec(), recorded }
                    }
                    _ => ReadingError::Reversed { joints: (0..order.len()).map(name).collect() },
                }
            }
            Hypothesis::Coupled { joint, with, sign } => {
                ReadingError::Coupled { joint: name(*joint), with: name(*with), sign: *sign }
            }
            Hypothesis::Sum { joint, own, with } => {
                let with = with.iter().map(|(other, sign)| SignedJoint { joint: name(*other), sign: *sign });
                ReadingError::Sum { joint: name(*joint), own: *own, with: with.collect() }
            }
            Hypothesis::OtherTurns(joints) => {
                let turn_counts = |joint: &usize| (TAU * self.robot.sensors[*joint].counts_per_rad).abs();
                let wrap_counts = joints.first().map_or(0.0, turn_counts);
                ReadingError::OtherTurns { joints: joints.iter().map(|&joint| name(joint)).collect(), wrap_counts }
            }
            Hypothesis::Zeros(zeros) => {
                let zero = |(joint, off_rad): &(usize, f64)| {
                    let spec = &self.robot.sensors[*joint];
                    let off_rad = on_turn_within_limits(
                        spec,
                        self.views.iter().map(|view| view.travel_rad[*joint]),
                        off_rad + tried.sensors.offset_rad[*joint],
                    );
                    let offset_counts = spec.offset_counts - spec.counts_per_rad * off_rad;
                    let input_zero = spec.stated.map(|stated| stated.recorded(-off_rad));
                    JointZero { joint: name(*joint), off_rad, moves: spec.moves, offset_counts, input_zero }
                };
                ReadingError::Zeros { joints: zeros.iter().map(zero).collect() }
            }
            Hypothesis::Scaled { joint, factor } => {
                let factor = factor * tried.sensors.gain[*joint];
                let input_factor = self.robot.sensors[*joint].stated.map(|stated| factor * stated.factor);
                ReadingError::Scaled { joint: name(*joint), factor, input_factor }
            }
            Hypothesis::Shifted(views) => ReadingError::Shifted { views: *views as i32 },
            Hypothesis::MapFrame(base_from_map) => {
                let turn = base_from_map.rotation;
                ReadingError::MapFrame {
                    position_m: base_from_map.translation.vector.into(),
                    turn: [turn.w, turn.i, turn.j, turn.k],
                }
            }
            Hypothesis::MapScale(factor) => self.named_scale(*factor),
            Hypothesis::Camera { n_joints, turn } => {
                let is_here = *n_joints == self.robot.camera.mount.n_joints;
                let link = || self.robot.chain.joints()[n_joints - 1].child_link.clone();
                ReadingError::Camera { link: (!is_here).then(link), turn: [turn.w, turn.i, turn.j, turn.k] }
            }
        }
    }
}

/// Zero error, among those that differ by whole turns, that puts most angles within the joint's limits; the smallest of
/// equals.
fn on_turn_within_limits(spec: &JointSensorSpec, travel_rad: impl Iterator<Item = f64> + Clone, off_rad: f64) -> f64 {
    let nearest_rad = wrap_symmetric(off_rad, TAU);
    if !spec.is_limited() || spec.moves.is_slide() {
        return nearest_rad;
    }
    let wrap_rad = spec.wrap_counts / spec.counts_per_rad.abs();
    let n_beyond = |off_rad: f64| {
        let travel_rad = travel_rad.clone().map(|read_rad| wrap_symmetric(read_rad + off_rad, wrap_rad));
        travel_rad.filter(|travel_rad| travel_rad.abs() > spec.half_range_rad + NEXT_TURN_RAD).count()
    };
    let turn_rad = TAU.copysign(nearest_rad);
    let by_size = [nearest_rad, nearest_rad - turn_rad, nearest_rad + turn_rad];
    by_size.into_iter().min_by_key(|&off_rad| n_beyond(off_rad)).unwrap_or(nearest_rad)
}

/// Root mean square distance between predicted and surveyed tags.
fn tag_error_m(found: &Estimate<'_>, views: &[View]) -> Option<f64> {
    let robot = found.as_found(found.problem.robot);
    PositionProblem::new(&robot, views).rms_m(&found.parameters())
}

/// Returns true if both errors name the same joints.
fn concerns_same(a: &ReadingError, b: &ReadingError) -> bool {
    let joints = |error: &ReadingError| match error {
        ReadingError::Exchanged { joints } => joints.to_vec(),
        ReadingError::Reversed { joints } | ReadingError::OtherTurns { joints, .. } => joints.clone(),
        ReadingError::Coupled { joint, with, .. } | ReadingError::Alike { joint, with, .. } => {
            vec![joint.clone(), with.clone()]
        }
        ReadingError::InCircle { joints, recorded } => [&joints[..], recorded].concat(),
        ReadingError::Sum { joint, with, .. } => {
            std::iter::once(joint).chain(with.iter().map(|other| &other.joint)).cloned().collect()
        }
        ReadingError::Zeros { joints } => joints.iter().map(|zero| zero.joint.clone()).collect(),
        ReadingError::Scaled { joint, .. } => vec![joint.clone()],
        ReadingError::Shifted { .. }
        | ReadingError::Unpaired { .. }
        | ReadingError::Camera { .. }
        | ReadingError::MapFrame { .. }
        | ReadingError::MapScale { .. } => Vec::new(),
    };
    std::mem::discriminant(a) == std::mem::discriminant(b) && joints(a) == joints(b)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::fixture::titan;

    /// Readings half a turn off, of a joint that is limited to less than a turn, from any part of its range.
    #[test]
    fn the_zero_is_on_the_turn_on_which_the_angles_are_within_the_limits() {
        for seed in 0..20 {
            let half_range_rad = 2.6 + 0.025 * f64::from(seed);
            let spec = JointSensorSpec { half_range_rad, wrap_counts: 1e12, ..titan().sensors[3].clone() };
            for true_rad in [-PI - 0.02, PI + 0.02, -PI + 0.02, PI - 0.02, -TAU, TAU, 0.5] {
                let travel_rad = |k: i32| half_range_rad * (0.09 * f64::from(k) - 0.9);
                let read_rad = (0..=20).map(|k| travel_rad(k) - true_rad);
                let found_rad = on_turn_within_limits(&spec, read_rad, wrap_symmetric(true_rad, TAU));
                assert!((found_rad - true_rad).abs() < 1e-9, "seed {seed}: {found_rad}, {true_rad}");
            }
        }
    }

    /// The reading repeats: zeros that differ by a turn are the same.
    #[test]
    fn of_zeros_that_mean_the_same_the_smallest_is_advised() {
        let titan = titan();
        let wrap_counts = (TAU * titan.sensors[3].counts_per_rad).abs();
        let spec = JointSensorSpec { half_range_rad: 3.0, wrap_counts, ..titan.sensors[3].clone() };
        for true_rad in [-3.0, -1.0, 2.0, 3.1] {
            let read_rad = (0..=20).map(|k| wrap_symmetric(0.3 * f64::from(k) - 3.0 - true_rad, TAU));
            let found_rad = on_turn_within_limits(&spec, read_rad, true_rad);
            assert!((found_rad - true_rad).abs() < 1e-9, "{found_rad}, {true_rad}");
        }
    }
}
