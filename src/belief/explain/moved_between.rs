//! Search for a motion of camera, base or tags between two views.
//!
//! The views after a gap get a camera or tags of their own, near the stated ones within [`MOVED_STD`]. A coarse to fine
//! search finds the gap of the least [`score`](crate::explain::failure_detection::score). There the evidence for the
//! views in two parts is compared with that for the views in one. Both include all slips, walks, failures and repairs
//! that were found. Tags of their own are estimated once more as one body, and pay for its six numbers.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::explain::constants::moved_between::{BODY_NATS, FIRST_GAPS, MAX_VIEWS, MIN_GAIN_NATS, MIN_SIDE, MOVED_STD};
use crate::explain::constants::tags_freed::FREED_STD;
use crate::explain::drawing::Drawing;
use crate::explain::failure_detection::{is_suspicious, score};
use crate::explain::failures::{Failure, FailureAdjusted};
use crate::explain::model_selection::log_evidence_of_all;
use crate::explain::setup::{BundleSetup, Clocks, declared};
use crate::model::blocks::Block;
use crate::model::parameters::JointParameters;
use crate::model::prior::at_least;
use crate::model::scales::MAX_CAMERAS;
use crate::say::moved_body::MovedBody;
use crate::say::refusal::Refusal;
use crate::solve::estimate::{Estimate, estimate};
use crate::solve::input::HyperparameterMode;
use crate::views::view::View;
use armcal_core::robot::{CameraSpec, Robot, SurveyedTag};
use armcal_core::spatial::Pose;

/// Views that no calibration explains, and the findings on them.
pub(crate) struct MotionSearch<'a> {
    pub robot: &'a Robot,
    pub views: &'a [View],
    pub failures: &'a [Failure],
    pub drawing: &'a Drawing,
    pub clocks: Clocks,
}

/// Element with one pose before a gap and another one after it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mover {
    /// The camera of that number on its mount.
    Camera(usize),
    /// All tags together, or the base the other way.
    Tags,
}

/// Motion that explains the views.
struct Motion {
    mover: Mover,
    /// Last view before the motion and first view after it.
    views: [usize; 2],
    nats: f64,
    moved: Isometry3<f64>,
}

/// Reads evidence and motion from an estimate.
type ReadMotion<'a> = dyn Fn(&Estimate<'_>) -> Option<(f64, Isometry3<f64>)> + 'a;
/// Vector of two poses: before and after.
type OfTwoPoses<'a> = dyn Fn(&Isometry3<f64>, &Isometry3<f64>) -> Vector3<f64> + 'a;

impl MotionSearch<'_> {
    /// Refusal that names the motion, if the views in two parts are much likelier than in one. `refusals`: those of the
    /// views so far.
    pub(crate) fn find(&self, refusals: &[Refusal]) -> Option<Refusal> {
        if !refusals.iter().any(may_follow_from_motion) {
            return None;
        }
        let with_gain = |mover: Mover| {
            let views = self.views_of(mover);
            let motion = self.likeliest(mover, &views)?;
            let gain_nats = motion.nats - self.nats_in_one(&views)?;
            (gain_nats > MIN_GAIN_NATS).then_some((gain_nats, motion))
        };
        let motions = self.movers().into_iter().filter_map(with_gain);
        motions.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, motion)| self.named(&motion))
    }

    /// Views without the data that do not constrain `mover`. The gripper tag belongs to the first camera only, and a
    /// freed tag may go anywhere on its own.
    fn views_of(&self, mover: Mover) -> Vec<View> {
        let mut views = self.views.to_vec();
        for view in &mut views {
            view.gripper_tag = None;
            if mover == Mover::Tags {
                view.tags.retain(|seen| self.robot.tags[seen.tag_idx].position_std_m < FREED_STD);
            }
        }
        views
    }

    fn movers(&self) -> Vec<Mover> {
        let n_cameras = 1 + self.robot.further_cameras.len();
        let cameras = (0..n_cameras).filter(|_| n_cameras < MAX_CAMERAS).map(Mover::Camera);
        cameras.chain([Mover::Tags]).collect()
    }

    /// Indices of the views that constrain `mover`, in the order of time.
    fn order(mover: Mover, views: &[View]) -> Vec<usize> {
        let tells = |k: &usize| {
            let is_seen = mover == Mover::Tags || mover == Mover::Camera(views[*k].camera);
            is_seen && !views[*k].tags.is_empty()
        };
        let mut order: Vec<usize> = (0..views.len()).filter(tells).collect();
        order.sort_by_key(|&k| (views[k].end, k));
        order
    }

    /// Evidence for the views if nothing moved, with all findings on sensors and geometry, nats.
    fn nats_in_one(&self, views: &[View]) -> Option<f64> {
        let setup = BundleSetup::new(self.robot, views, self.failures, None);
        let setup = setup.with_drawing(self.drawing).with_clocks(self.clocks);
        let (found, _) = setup.estimate()?;
        let (found, _) = found.with_walks(&setup.input(), |joint| !setup.has_no_sensor(joint));
        Some(log_evidence_of_all(&found))
    }

    fn likeliest(&self, mover: Mover, views: &[View]) -> Option<Motion> {
        let order = Self::order(mover, views);
        let gap = self.likeliest_gap(mover, views, &order)?;
        let (robot, split) = split(self.robot, mover, views, &order[gap..]);
        let nominal = Drawing::default();
        let drawings: &[&Drawing] = if *self.drawing == nominal { &[&nominal] } else { &[&nominal, self.drawing] };
        let fitted = drawings.iter().filter_map(|drawing| self.fitted(mover, &robot, &split, drawing));
        let (nats, moved) = fitted.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Motion { mover, views: [order[gap - 1], order[gap]], nats, moved })
    }

    /// Index in `order` of the first view after the likeliest motion.
    fn likeliest_gap(&self, mover: Mover, views: &[View], order: &[usize]) -> Option<usize> {
        let last = order.len().checked_sub(MIN_SIDE)?;
        let mut step = order.len().div_ceil(FIRST_GAPS);
        let mut candidates: Vec<usize> = (MIN_SIDE..=last).step_by(step).collect();
        loop {
            let stride = step.min(order.len().div_ceil(MAX_VIEWS));
            let score = |gap: &usize| self.score_of_gap(mover, views, order, (*gap, stride));
            let scores = candidates.iter().map(|gap| (score(gap), *gap));
            let (least, gap) = scores.min_by(|a, b| a.0.total_cmp(&b.0))?;
            if step == 1 {
                // No motion is possible after the last view: its score is that without a motion.
                let saved = score(&order.len()) - least;
                return (saved > 2.0 * MIN_GAIN_NATS).then_some(gap);
            }
            step = step.div_ceil(2);
            candidates = [gap.saturating_sub(step), gap, gap + step].into();
            candidates.retain(|gap| (MIN_SIDE..=last).contains(gap));
        }
    }

    /// Score of every `stride`-th view with a motion at `gap`.
    fn score_of_gap(&self, mover: Mover, views: &[View], order: &[usize], (gap, stride): (usize, usize)) -> f64 {
        let (robot, split) = split(self.robot, mover, views, &order[gap..]);
        let some: Vec<View> = order.iter().step_by(stride).map(|&k| split[k].clone()).collect();
        let adjusted = FailureAdjusted::new(&robot, &some, &declared(&robot, &some), &JointParameters::default());
        estimate(&adjusted.input(HyperparameterMode::Given)).map_or(f64::INFINITY, |found| score(&found))
    }

    /// Evidence for the views in two parts, nats, and the motion between them; `None` if they still do not fit.
    fn fitted(&self, mover: Mover, robot: &Robot, views: &[View], drawing: &Drawing) -> Option<(f64, Isometry3<f64>)> {
        let fit = |robot: &Robot, read: &ReadMotion<'_>| {
            let setup = BundleSetup::new(robot, views, &declared(robot, views), None);
            let setup = setup.with_drawing(drawing).with_clocks(self.clocks);
            let (found, _) = setup.estimate()?;
            read(&found)
        };
        let nats = |found: &Estimate<'_>| (!is_suspicious(found)).then(|| log_evidence_of_all(found));
        match mover {
            Mover::Camera(number) => fit(robot, &|found| {
                let after = *found.solved.state.pose(Block::Mount(robot.further_cameras.len()));
                Some((nats(found)?, found.solved.state.pose(Block::Mount(number)).inv_mul(&after)))
            }),
            Mover::Tags => {
                let n = self.robot.tags.len();
                let (_, moved) = fit(robot, &|found| Some((0.0, motion_of_tags(found, n)?)))?;
                let as_body = with_tags_moved(self.robot, &moved);
                fit(&as_body, &|found| {
                    let moved = motion_of_tags(found, n)?;
                    Some((nats(found)? + nats_of_tag_priors(found, n) - BODY_NATS, moved))
                })
            }
        }
    }

    fn named(&self, motion: &Motion) -> Refusal {
        let views = motion.views.map(|k| self.views[k].pose_idx + 1);
        let is_watched = self.robot.is_watched();
        let body = match motion.mover {
            Mover::Camera(_) if is_watched => MovedBody::StandingCamera,
            Mover::Camera(_) => MovedBody::Camera,
            Mover::Tags if is_watched => MovedBody::CarriedTags,
            Mover::Tags => MovedBody::BaseOrTags,
        };
        let camera = match motion.mover {
            Mover::Camera(number) if !self.robot.further_cameras.is_empty() => {
                Some(self.robot.camera_at(number).name.clone())
            }
            _ => None,
        };
        let (shift_m, turn_rad) = (motion.moved.translation.vector.norm(), motion.moved.rotation.angle());
        Refusal::MovedBetweenViews { body, camera, views, shift_m, turn_rad }
    }
}

/// Returns true for a refusal that a motion between the views may cause.
fn may_follow_from_motion(refusal: &Refusal) -> bool {
    matches!(
        refusal,
        Refusal::NotSolved { .. }
            | Refusal::NoBetterThanDatasheet { .. }
            | Refusal::NoBetterThanBaseline { .. }
            | Refusal::Overfitted { .. }
            | Refusal::HeldOutError { .. }
            | Refusal::RotationNoise { .. }
            | Refusal::Geometry(_)
            | Refusal::RepairTooLarge { .. }
            | Refusal::TagSizeRepair { .. }
            | Refusal::SensorError { .. }
            | Refusal::SensorFailed { .. }
            | Refusal::Nonlinearity { .. }
            | Refusal::CornerNoise { .. }
            | Refusal::CornerNoiseUnderstated { .. }
            | Refusal::BeyondDatasheet { .. }
            | Refusal::Outliers { .. }
            | Refusal::Innovations { .. }
            | Refusal::PriorContradicted { .. }
            | Refusal::TooFewViewsSinceSlip { .. }
    )
}

/// Returns the arm and its views with another camera, or with other tags, in the views `after`.
fn split(robot: &Robot, mover: Mover, views: &[View], after: &[usize]) -> (Robot, Vec<View>) {
    let mut views = views.to_vec();
    let robot = match mover {
        Mover::Camera(number) => {
            let robot = with_other_camera(robot, number);
            let other = robot.further_cameras.len();
            after.iter().for_each(|&k| views[k].camera = other);
            robot
        }
        Mover::Tags => {
            let n = robot.tags.len();
            for &k in after {
                views[k].tags.iter_mut().for_each(|seen| seen.tag_idx += n);
            }
            let mut robot = robot.clone();
            let loose = |tag: &SurveyedTag| SurveyedTag {
                position_std_m: tag.position_std_m.max(MOVED_STD[0]),
                rotation_std_rad: tag.rotation_std_rad.max(MOVED_STD[1]),
                ..tag.clone()
            };
            let others: Vec<SurveyedTag> = robot.tags.iter().map(loose).collect();
            robot.tags.extend(others);
            robot
        }
    };
    (robot, views)
}

/// Returns the arm with one more camera at the pose of camera `number`, both mounts with wide priors.
fn with_other_camera(robot: &Robot, number: usize) -> Robot {
    let mut robot = robot.clone();
    let loosen = |camera: &mut CameraSpec| {
        camera.mount_std_m = camera.mount_std_m.max(MOVED_STD[0]);
        camera.mount_std_rad = camera.mount_std_rad.max(MOVED_STD[1]);
    };
    let mut other = robot.camera_at(number).clone();
    loosen(&mut other);
    match number.checked_sub(1) {
        None => loosen(&mut robot.camera),
        Some(further) => loosen(&mut robot.further_cameras[further]),
    }
    robot.further_cameras.push(other);
    robot
}

/// Returns the arm with a copy of each of its tags, moved by `moved`.
fn with_tags_moved(robot: &Robot, moved: &Isometry3<f64>) -> Robot {
    let mut robot = robot.clone();
    let elsewhere = |tag: &SurveyedTag| SurveyedTag {
        base_from_tag: Pose::from_isometry(moved * tag.base_from_tag.isometry()),
        ..tag.clone()
    };
    let others: Vec<SurveyedTag> = robot.tags.iter().map(elsewhere).collect();
    robot.tags.extend(others);
    robot
}

/// Motion of the first `n` tags to the next `n`, weighted by their information; `None` if none has moved.
fn motion_of_tags(found: &Estimate<'_>, n: usize) -> Option<Isometry3<f64>> {
    let pairs: Vec<(Isometry3<f64>, Isometry3<f64>, [f64; 2])> = (0..n)
        .filter_map(|tag| {
            let (after, covariance) = found.tag(n + tag);
            let variances = covariance?.diagonal();
            let weights = [0, 3].map(|k| 1.0 / variances.fixed_rows::<3>(k).sum().max(f64::MIN_POSITIVE));
            Some((found.tag(tag).0, after, weights))
        })
        .collect();
    let mean = |of: &OfTwoPoses<'_>, kind: usize| {
        let sum: f64 = pairs.iter().map(|(.., weights)| weights[kind]).sum();
        let all = pairs.iter().map(|(before, after, weights)| of(before, after) * weights[kind]);
        all.sum::<Vector3<f64>>() / sum
    };
    if pairs.is_empty() {
        return None;
    }
    let turn = mean(&|before, after| (after.rotation * before.rotation.inverse()).scaled_axis(), 1);
    let turn = UnitQuaternion::from_scaled_axis(turn);
    let shift = mean(&|before, after| after.translation.vector - turn * before.translation.vector, 0);
    Some(Isometry3::from_parts(shift.into(), turn))
}

/// Evidence from the priors of tags that have a column in both parts, nats. The evidence leaves out the priors of all
/// tags, because models of the same tags share them.
fn nats_of_tag_priors(found: &Estimate<'_>, n: usize) -> f64 {
    let is_in_both = |tag: usize| tag >= n && found.has(Block::Tag(tag - n));
    let tags = found.problem.layout.tags().filter(|(tag, _)| is_in_both(*tag));
    let nats = |(tag, _)| -> f64 {
        let block = Block::Tag(tag);
        found.problem.prior.std[block].iter().take(block.n_columns()).map(|std| -at_least(*std).ln()).sum()
    };
    tags.map(nats).sum()
}
