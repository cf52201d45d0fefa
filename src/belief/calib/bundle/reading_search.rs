//! Searches for a way to read the joints that explains views which no arm of this URDF explains as they are read.
//!
//! Each hypothesis changes the readings of all views alike, and the joints are estimated by the datasheet's scales; the
//! score is that of [`failure_detection`](crate::calib::bundle::failure_detection). A hypothesis is named if it is
//! likelier than the readings as they are by [`MARGIN`], and if its estimate leaves no sensor suspicious.

use std::f64::consts::{FRAC_PI_6, PI, TAU};

use nalgebra::Vector3;

use crate::calib::angles_by_camera::distance_cost;
use crate::calib::bundle::drawing::Drawing;
use crate::calib::bundle::estimate::{Estimate, estimate};
use crate::calib::bundle::failure_detection::{is_suspicious, score};
use crate::calib::bundle::failures::{Failure, FailureAdjusted};
use crate::calib::bundle::input::HyperparameterMode;
use crate::calib::methods::position_problem::PositionProblem;
use crate::calib::parameters::JointParameters;
use crate::calib::reading_error::{JointZero, MisreadReadings, ReadingError};
use crate::calib::views::view::View;
use armcal_core::joints::JointAngles;
use armcal_core::robot::Robot;
use armcal_core::sensor::wrap_symmetric;

/// Evidence that a reading error needs, twice the logarithm of the odds: e^30, as about 300 are tried.
const MARGIN: f64 = 60.0;
/// Hypotheses within this of the best one are printed with it, in the same unit: odds of e^5.
const ALTERNATIVE: f64 = 10.0;
const MAX_ALTERNATIVES: usize = 2;
/// More views do not change the answer; they would cost time.
const MAX_VIEWS: usize = 40;
/// Hypotheses that are estimated: those under which the nominal arm places the tags nearest to their survey.
const MAX_ESTIMATED: usize = 30;
/// A camera mount with larger stated sigmas does not place the tags, m and rad: then all hypotheses are estimated.
const KNOWN_MOUNT: [f64; 2] = [0.05, 0.2];
/// Excess over the half range from which a reading is on another turn, rad.
const NEXT_TURN_RAD: f64 = 0.1;
/// Zeros are tried at these steps; one sigma of what is left, rad.
const ZERO_STEP_RAD: f64 = FRAC_PI_6;
const ZERO_STD_RAD: f64 = 0.2;
/// Scales are tried at these steps, up to about a thousandth and a thousand; one sigma of what is left.
const SCALE_STEP: f64 = 1.6;
const SCALE_STEPS: i32 = 15;
const SCALE_STD: f64 = 0.2;
/// A scale that is off by fewer steps shows in the sensor's line.
const LEAST_SCALE_STEPS: i32 = 4;
/// Axes within this angle are parallel, rad.
const PARALLEL_RAD: f64 = 0.02;
/// A zero error in stated sigmas below which a sensor is as stated.
const MIN_SIGMAS: f64 = 4.0;

/// One way to read the joints.
#[derive(Clone, Debug, PartialEq)]
enum Hypothesis {
    /// Joint `k` has the reading of `order[k]`.
    Order(Vec<usize>),
    Coupled {
        joint: usize,
        with: usize,
        sign: f64,
    },
    /// A turn less or more, where that is within the limits.
    OtherTurns(Vec<usize>),
    /// Added to the angles.
    Zeros(Vec<(usize, f64)>),
    /// The angle over the reading.
    Scaled {
        joint: usize,
        factor: f64,
    },
}

/// A hypothesis and what it explains.
struct Tried {
    hypothesis: Hypothesis,
    score: f64,
    fits: bool,
    sensors: JointParameters,
    tag_error_m: Option<f64>,
}

/// An arm whose views no calibration explains.
pub(crate) struct ReadingSearch<'a> {
    pub robot: &'a Robot,
    /// As they were read.
    pub views: &'a [View],
    /// Failed sensors as detected: the alternative that a reading error must beat.
    pub failures: &'a [Failure],
    /// Repaired geometry, another alternative.
    pub drawing: &'a Drawing,
}

impl ReadingSearch<'_> {
    /// The reading error, if one explains the views and the readings as they are do not.
    pub(crate) fn find(&self) -> Option<MisreadReadings> {
        let stride = self.views.len().div_ceil(MAX_VIEWS).max(1);
        let views: Vec<View> = self.views.iter().step_by(stride).cloned().collect();
        let before_m = PositionProblem::new(self.robot, &views).rms_m(&JointParameters::default())?;
        let as_read = self.score_as_read(&views, stride);
        let turned = self.other_turns().and_then(|hypothesis| self.attempt(hypothesis, &views));
        if let Some(turned) = turned.filter(|turned| turned.fits && turned.score < as_read) {
            let (found, alternatives) = (self.named(&turned), Vec::new());
            return Some(MisreadReadings {
                found,
                alternatives,
                tag_error_m: before_m,
                corrected_m: turned.tag_error_m,
            });
        }
        let tried = self.likely(&views).into_iter().filter_map(|hypothesis| self.attempt(hypothesis, &views));
        let mut tried: Vec<Tried> =
            tried.filter(|tried| tried.fits && as_read - tried.score > MARGIN && self.is_large(tried)).collect();
        tried.sort_by(|a, b| a.score.total_cmp(&b.score));
        let best = tried.first()?;
        let found = self.named(best);
        let mut alternatives: Vec<ReadingError> = Vec::new();
        for other in tried.iter().take_while(|other| other.score - best.score < ALTERNATIVE) {
            let error = self.named(other);
            let is_new = !concerns_same(&error, &found) && !alternatives.iter().any(|one| concerns_same(one, &error));
            if is_new && alternatives.len() < MAX_ALTERNATIVES {
                alternatives.push(error);
            }
        }
        Some(MisreadReadings { found, alternatives, tag_error_m: before_m, corrected_m: best.tag_error_m })
    }

    /// The least that the readings as they are cost, failed sensors and repaired geometry included.
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

    /// Joints with readings of 0 to 360 deg, where their range is one about zero: some beyond their limits, all within
    /// them but for a turn.
    fn other_turns(&self) -> Option<Hypothesis> {
        let is_turned = |&joint: &usize| {
            let spec = &self.robot.sensors[joint];
            let travel_rad = || self.views.iter().map(|view| view.travel_rad[joint]);
            let limit_rad = spec.half_range_rad + NEXT_TURN_RAD;
            let is_possible = spec.is_limited() && !spec.moves.is_slide();
            is_possible
                && travel_rad().any(|travel_rad| travel_rad.abs() > limit_rad)
                && travel_rad().all(|travel_rad| wrap_symmetric(travel_rad, TAU).abs() < limit_rad)
        };
        let joints: Vec<usize> = (0..self.robot.n_seen_joints()).filter(is_turned).collect();
        (!joints.is_empty()).then_some(Hypothesis::OtherTurns(joints))
    }

    /// The hypotheses that are worth an estimate.
    fn likely(&self, views: &[View]) -> Vec<Hypothesis> {
        let all = self.hypotheses();
        let camera = &self.robot.camera;
        if camera.mount_std_m > KNOWN_MOUNT[0] || camera.mount_std_rad > KNOWN_MOUNT[1] {
            return all;
        }
        let cost = |hypothesis: &Hypothesis| -> f64 {
            let of_view = |view: &View| {
                let view = hypothesis.applied(self.robot, view);
                let angle_rad = |joint: usize| self.robot.sensors[joint].center_rad + view.travel_rad[joint];
                distance_cost(self.robot, &view, &JointAngles::from_fn(view.travel_rad.len(), angle_rad))
            };
            views.iter().map(of_view).sum()
        };
        let mut with_costs: Vec<(f64, Hypothesis)> = all.into_iter().map(|one| (cost(&one), one)).collect();
        with_costs.sort_by(|a, b| a.0.total_cmp(&b.0));
        with_costs.into_iter().take(MAX_ESTIMATED).map(|(_, hypothesis)| hypothesis).collect()
    }

    fn name(&self, joint: usize) -> String {
        self.robot.sensors[joint].joint.clone()
    }

    fn hypotheses(&self) -> Vec<Hypothesis> {
        let n = self.robot.n_seen_joints();
        let order: Vec<usize> = (0..self.robot.n_joints()).collect();
        let pairs = || (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        let exchanged = pairs().map(|[a, b]| {
            let mut order = order.clone();
            order.swap(a, b);
            Hypothesis::Order(order)
        });
        let reversed = Hypothesis::Order(order.iter().rev().copied().collect());
        let neighbours = (1..n).flat_map(|k| [[k, k - 1], [k - 1, k]]);
        let coupled =
            neighbours.flat_map(|[joint, with]| [1.0, -1.0].map(|sign| Hypothesis::Coupled { joint, with, sign }));
        let turning: Vec<usize> = (0..n).filter(|&joint| !self.robot.sensors[joint].moves.is_slide()).collect();
        let steps: Vec<f64> = (0..12).map(|k| wrap_symmetric(f64::from(k) * ZERO_STEP_RAD, TAU)).collect();
        let single =
            turning.iter().flat_map(|&joint| steps.iter().map(move |off| Hypothesis::Zeros(vec![(joint, *off)])));
        let parallel = pairs().filter_map(|pair| Some((pair, self.parallel_sign(pair)?)));
        let opposite = parallel.flat_map(|([a, b], sign)| {
            steps.iter().map(move |off| Hypothesis::Zeros(vec![(a, *off), (b, -sign * off)]))
        });
        let steps = (-SCALE_STEPS..=SCALE_STEPS).filter(|step| step.abs() >= LEAST_SCALE_STEPS);
        let scaled =
            steps.flat_map(|step| (0..n).map(move |joint| Hypothesis::Scaled { joint, factor: SCALE_STEP.powi(step) }));
        exchanged.chain([reversed]).chain(coupled).chain(single).chain(opposite).chain(scaled).collect()
    }

    /// 1 or -1 where both joints turn about parallel axes however the joints between them stand.
    fn parallel_sign(&self, [a, b]: [usize; 2]) -> Option<f64> {
        let joints = self.robot.chain.joints();
        if joints[a..=b].iter().any(|joint| joint.kind.is_slide()) {
            return None;
        }
        let mut axis: Vector3<f64> = joints[a].axis.into_inner();
        for joint in &joints[a + 1..=b] {
            axis = joint.parent_from_joint.rotation.inverse() * axis;
            let cosine = axis.dot(&joint.axis);
            let is_parallel = cosine.abs().min(1.0).acos() < PARALLEL_RAD;
            if !is_parallel {
                return None;
            }
            axis = joint.axis.into_inner() * cosine.signum();
        }
        Some(axis.dot(&joints[b].axis).signum())
    }

    fn attempt(&self, hypothesis: Hypothesis, views: &[View]) -> Option<Tried> {
        let mut robot = self.robot.clone();
        match &hypothesis {
            Hypothesis::Zeros(zeros) => {
                for (joint, _) in zeros {
                    robot.sensors[*joint].offset_std_rad = robot.sensors[*joint].offset_std_rad.max(ZERO_STD_RAD);
                }
            }
            Hypothesis::Scaled { joint, .. } => robot.sensors[*joint].gain_std = SCALE_STD,
            _ => {}
        }
        let views: Vec<View> = views.iter().map(|view| hypothesis.applied(self.robot, view)).collect();
        let adjusted = FailureAdjusted::new(&robot, &views, &[], &JointParameters::default());
        let found = estimate(&adjusted.input(HyperparameterMode::Given))?;
        Some(Tried {
            hypothesis,
            score: score(&found),
            fits: !is_suspicious(&found),
            sensors: found.parameters(),
            tag_error_m: tag_error_m(&found, &views),
        })
    }

    /// Zeros as they were found, beyond what the sensors are stated to be off; other errors have no size.
    fn is_large(&self, tried: &Tried) -> bool {
        let Hypothesis::Zeros(zeros) = &tried.hypothesis else { return true };
        zeros.iter().all(|(joint, off_rad)| {
            let off_rad = wrap_symmetric(off_rad + tried.sensors.offset_rad[*joint], TAU);
            off_rad.abs() > MIN_SIGMAS * self.robot.sensors[*joint].offset_std_rad
        })
    }

    fn named(&self, tried: &Tried) -> ReadingError {
        let name = |joint: usize| self.name(joint);
        match &tried.hypothesis {
            Hypothesis::Order(order) => {
                let moved: Vec<usize> = (0..order.len()).filter(|&joint| order[joint] != joint).collect();
                match moved[..] {
                    [a, b] => ReadingError::Exchanged { joints: [a, b].map(name) },
                    _ => ReadingError::Reversed { joints: (0..order.len()).map(name).collect() },
                }
            }
            Hypothesis::Coupled { joint, with, sign } => {
                ReadingError::Coupled { joint: name(*joint), with: name(*with), sign: *sign }
            }
            Hypothesis::OtherTurns(joints) => {
                let turn_counts = |joint: &usize| (TAU * self.robot.sensors[*joint].counts_per_rad).abs();
                let wrap_counts = joints.first().map_or(0.0, turn_counts);
                ReadingError::OtherTurns { joints: joints.iter().map(|&joint| name(joint)).collect(), wrap_counts }
            }
            Hypothesis::Zeros(zeros) => {
                let zero = |(joint, off_rad): &(usize, f64)| {
                    let spec = &self.robot.sensors[*joint];
                    let off_rad = wrap_symmetric(off_rad + tried.sensors.offset_rad[*joint], TAU);
                    let offset_counts = spec.offset_counts - spec.counts_per_rad * off_rad;
                    JointZero { joint: name(*joint), off_rad, moves: spec.moves, offset_counts }
                };
                ReadingError::Zeros { joints: zeros.iter().map(zero).collect() }
            }
            Hypothesis::Scaled { joint, factor } => {
                ReadingError::Scaled { joint: name(*joint), factor: factor * tried.sensors.gain[*joint] }
            }
        }
    }
}

impl Hypothesis {
    /// The view with its readings taken that way.
    fn applied(&self, robot: &Robot, view: &View) -> View {
        let mut changed = view.clone();
        match self {
            Self::Order(order) => {
                for (joint, &from) in order.iter().enumerate().filter(|(joint, from)| joint != *from) {
                    let (spec, other) = (&robot.sensors[joint], &robot.sensors[from]);
                    let angle_rad = other.center_rad + view.travel_rad[from];
                    let counts = other.offset_counts + other.counts_per_rad * angle_rad;
                    changed.travel_rad[joint] =
                        wrapped(robot, joint, (counts - spec.offset_counts) / spec.counts_per_rad - spec.center_rad);
                    changed.rate_rad_s[joint] = view.rate_rad_s[from] * other.counts_per_rad / spec.counts_per_rad;
                    changed.approach[joint] = view.approach[from];
                }
            }
            Self::Coupled { joint, with, sign } => {
                let with_rad = robot.sensors[*with].center_rad + view.travel_rad[*with];
                changed.travel_rad[*joint] = wrapped(robot, *joint, view.travel_rad[*joint] - sign * with_rad);
                changed.rate_rad_s[*joint] -= sign * view.rate_rad_s[*with];
            }
            Self::OtherTurns(joints) => {
                for &joint in joints {
                    changed.travel_rad[joint] = wrap_symmetric(view.travel_rad[joint], TAU);
                }
            }
            Self::Zeros(zeros) => {
                for (joint, off_rad) in zeros {
                    changed.travel_rad[*joint] = wrapped(robot, *joint, view.travel_rad[*joint] + off_rad);
                }
            }
            Self::Scaled { joint, factor } => {
                let center_rad = robot.sensors[*joint].center_rad;
                let angle_rad = factor * (center_rad + view.travel_rad[*joint]);
                changed.travel_rad[*joint] = wrapped(robot, *joint, angle_rad - center_rad);
                changed.rate_rad_s[*joint] *= factor;
            }
        }
        changed
    }
}

/// Travel of a turning joint within half a turn of the middle of its range.
fn wrapped(robot: &Robot, joint: usize, travel_rad: f64) -> f64 {
    if robot.sensors[joint].moves.is_slide() || travel_rad.abs() <= PI {
        travel_rad
    } else {
        wrap_symmetric(travel_rad, TAU)
    }
}

/// Root mean square distance between predicted and surveyed tags.
fn tag_error_m(found: &Estimate<'_>, views: &[View]) -> Option<f64> {
    let robot = found.as_found(found.problem.robot);
    PositionProblem::new(&robot, views).rms_m(&found.parameters())
}

/// Two names for the same joints.
fn concerns_same(a: &ReadingError, b: &ReadingError) -> bool {
    let joints = |error: &ReadingError| match error {
        ReadingError::Exchanged { joints } => joints.to_vec(),
        ReadingError::Reversed { joints } | ReadingError::OtherTurns { joints, .. } => joints.clone(),
        ReadingError::Coupled { joint, with, .. } => vec![joint.clone(), with.clone()],
        ReadingError::Zeros { joints } => joints.iter().map(|zero| zero.joint.clone()).collect(),
        ReadingError::Scaled { joint, .. } => vec![joint.clone()],
    };
    std::mem::discriminant(a) == std::mem::discriminant(b) && joints(a) == joints(b)
}
