//! Possible meanings of the joint readings, the camera mount and the map's frame, and the views under each.

use crate::explain::angles_by_camera::has_known_mount;
use crate::explain::constants::reading_search_hypothesis::{
    CAMERA_HANDICAP, FRAME_HANDICAP, LEAST_SCALE_STEPS, NEXT_TURN_RAD, PARALLEL_RAD, SCALE_STEP, SCALE_STEPS,
    SUM_HANDICAP,
};
pub(crate) use crate::explain::constants::reading_search_hypothesis::{SCALE_STD, ZERO_STD_RAD};
use std::borrow::Cow;
use std::f64::consts::{FRAC_PI_6, PI, TAU};

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::explain::wrong_input::map::quarter_turns;
use crate::views::view::View;
use armcal_core::robot::Robot;
use armcal_core::sensor::wrap_symmetric;

/// Step of the zeros to try, and standard deviation of the rest, rad.
const ZERO_STEP_RAD: f64 = FRAC_PI_6;
/// One way to read the joints, to carry the camera, or to place the tag map.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Hypothesis {
    /// Joint `k` has the reading of `order[k]`.
    Order(Vec<usize>),
    Coupled {
        joint: usize,
        with: usize,
        sign: f64,
    },
    /// The reading is `own` times the joint's angle plus those of other joints, each times its sign.
    Sum {
        joint: usize,
        own: f64,
        with: Vec<(usize, f64)>,
    },
    /// The readings of these joints are a turn less or more, within their limits.
    OtherTurns(Vec<usize>),
    /// A constant is added to the angle of each of these joints, rad.
    Zeros(Vec<(usize, f64)>),
    /// The angle is `factor` times the reading.
    Scaled {
        joint: usize,
        factor: f64,
    },
    /// The readings of each view are recorded at the view this number of places later.
    Shifted(isize),
    /// The tag map's frame has this pose in the base frame.
    MapFrame(Isometry3<f64>),
    /// Sizes and distances of all tags are this many times the stated ones.
    MapScale(f64),
    /// The camera is mounted after `n_joints` joints, and its frame is turned.
    Camera {
        n_joints: usize,
        turn: UnitQuaternion<f64>,
    },
}

impl Hypothesis {
    /// Joints whose readings go from 0 to 360 deg although their range is one about zero. Some readings are beyond the
    /// limits; all are within them except for a turn.
    pub(crate) fn other_turns(robot: &Robot, views: &[View]) -> Option<Self> {
        let is_turned = |&joint: &usize| {
            let spec = &robot.sensors[joint];
            let travel_rad = || views.iter().map(|view| view.travel_rad[joint]);
            let limit_rad = spec.half_range_rad + NEXT_TURN_RAD;
            let is_possible = spec.is_limited() && !spec.moves.is_slide();
            is_possible
                && travel_rad().any(|travel_rad| travel_rad.abs() > limit_rad)
                && travel_rad().all(|travel_rad| wrap_symmetric(travel_rad, TAU).abs() < limit_rad)
        };
        let joints: Vec<usize> = (0..robot.n_seen_joints()).filter(is_turned).collect();
        (!joints.is_empty()).then_some(Self::OtherTurns(joints))
    }

    /// Hypothesis of `other_turns`, if one of the joints is beyond its limits in most views.
    pub(crate) fn other_turns_in_most(robot: &Robot, views: &[View]) -> Option<Self> {
        let hypothesis = Self::other_turns(robot, views)?;
        let Self::OtherTurns(joints) = &hypothesis else { return None };
        let in_most = |&joint: &usize| {
            let limit_rad = robot.sensors[joint].half_range_rad + NEXT_TURN_RAD;
            2 * views.iter().filter(|view| view.travel_rad[joint].abs() > limit_rad).count() > views.len()
        };
        joints.iter().any(in_most).then_some(hypothesis)
    }

    /// All single hypotheses except readings of 0 to 360 deg.
    pub(crate) fn all(robot: &Robot) -> Vec<Self> {
        let n = robot.n_seen_joints();
        let order: Vec<usize> = (0..robot.n_joints()).collect();
        let pairs = || (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        let exchanged = pairs().map(|[a, b]| {
            let mut order = order.clone();
            order.swap(a, b);
            Self::Order(order)
        });
        let reversed = Self::Order(order.iter().rev().copied().collect());
        let neighbours = (1..n).flat_map(|k| [[k, k - 1], [k - 1, k]]);
        let coupled = neighbours.flat_map(|[joint, with]| [1.0, -1.0].map(|sign| Self::Coupled { joint, with, sign }));
        let turning: Vec<usize> = (0..n).filter(|&joint| !robot.sensors[joint].moves.is_slide()).collect();
        let steps: Vec<f64> = (0..12).map(|k| wrap_symmetric(f64::from(k) * ZERO_STEP_RAD, TAU)).collect();
        let single = turning.iter().flat_map(|&joint| steps.iter().map(move |off| Self::Zeros(vec![(joint, *off)])));
        let parallel = pairs().filter_map(|pair| Some((pair, parallel_sign(robot, pair)?)));
        let opposite = parallel
            .flat_map(|([a, b], sign)| steps.iter().map(move |off| Self::Zeros(vec![(a, *off), (b, -sign * off)])));
        let steps = (-SCALE_STEPS..=SCALE_STEPS).filter(|step| step.abs() >= LEAST_SCALE_STEPS);
        let scaled =
            steps.flat_map(|step| (0..n).map(move |joint| Self::Scaled { joint, factor: SCALE_STEP.powi(step) }));
        let shifted = [-1, 1].map(Self::Shifted);
        let of_joints = exchanged.chain([reversed]).chain(coupled).chain(single).chain(opposite).chain(scaled);
        of_joints.chain(shifted).chain(Self::of_camera(robot)).collect()
    }

    /// Three columns in a circle, and sums of more than one neighbour or with a sign. They are so many that only those
    /// are estimated under which the nominal arm fits well.
    pub(crate) fn composite(robot: &Robot) -> Vec<Self> {
        let n = robot.n_seen_joints();
        let order: Vec<usize> = (0..robot.n_joints()).collect();
        let triples = (0..n).flat_map(|a| (a + 1..n).flat_map(move |b| (b + 1..n).map(move |c| [a, b, c])));
        let circles = triples.flat_map(|[a, b, c]| {
            [[b, c, a], [c, a, b]].map(|from| {
                let mut order = order.clone();
                [a, b, c].into_iter().zip(from).for_each(|(joint, from)| order[joint] = from);
                Self::Order(order)
            })
        });
        let turning: Vec<usize> = (0..n).filter(|&joint| !robot.sensors[joint].moves.is_slide()).collect();
        circles.chain(turning.iter().flat_map(|&joint| Self::sums(joint, &turning))).collect()
    }

    /// Readings of `joint` that contain the angle of any other joint, or of two before it, as an angle against the base
    /// does. Those of a single neighbour that are not reversed are left to `all`.
    fn sums(joint: usize, turning: &[usize]) -> Vec<Self> {
        let others = || turning.iter().copied().filter(move |&other| other != joint);
        let before = || turning.iter().copied().filter(move |&other| other < joint);
        const SIGNS: [f64; 2] = [1.0, -1.0];
        let one = others().flat_map(|other| SIGNS.map(|sign| vec![(other, sign)]));
        let pairs = before().flat_map(|a| before().filter(move |&b| b > a).map(move |b| [a, b]));
        let two = pairs.flat_map(|[a, b]| {
            let signs = SIGNS.into_iter().flat_map(|first| SIGNS.map(|second| [first, second]));
            signs.map(move |[first, second]| vec![(a, first), (b, second)])
        });
        let is_simple =
            |own: f64, with: &[(usize, f64)]| own > 0.0 && with.len() == 1 && with[0].0.abs_diff(joint) == 1;
        let all = one.chain(two).flat_map(|with| SIGNS.map(|own| (own, with.clone())));
        let all = all.filter(|(own, with)| !is_simple(*own, with));
        all.map(|(own, with)| Self::Sum { joint, own, with }).collect()
    }

    /// Camera on each link, at the stated pose with its frame turned by quarters; only if the stated pose is known.
    fn of_camera(robot: &Robot) -> Vec<Self> {
        let camera = &robot.camera;
        if !has_known_mount(robot) || !robot.further_cameras.is_empty() || robot.camera.mount.n_joints == 0 {
            return Vec::new();
        }
        let turns: Vec<_> = std::iter::once(UnitQuaternion::identity()).chain(quarter_turns()).collect();
        let on_link = |n_joints: usize| turns.iter().map(move |&turn| Self::Camera { n_joints, turn });
        let all = (1..=robot.n_joints()).flat_map(on_link);
        let as_stated = Self::Camera { n_joints: camera.mount.n_joints, turn: UnitQuaternion::identity() };
        all.filter(|one| *one != as_stated).collect()
    }

    /// Handicap in the score: for more numbers to fit the views with, or for being less usual.
    pub(crate) fn handicap(&self) -> f64 {
        match self {
            Self::Camera { .. } => CAMERA_HANDICAP,
            Self::MapFrame(_) | Self::MapScale(_) => FRAME_HANDICAP,
            Self::Sum { .. } => SUM_HANDICAP,
            _ => 0.0,
        }
    }

    pub(crate) fn is_of_map(&self) -> bool {
        matches!(self, Self::MapFrame(_))
    }

    pub(crate) fn is_of_camera(&self) -> bool {
        matches!(self, Self::Camera { .. })
    }

    /// Returns the arm with its camera carried by this hypothesis.
    pub(crate) fn robot<'a>(&self, robot: &'a Robot) -> Cow<'a, Robot> {
        let Self::Camera { n_joints, turn } = self else { return Cow::Borrowed(robot) };
        let mut robot = robot.clone();
        let mount = &mut robot.camera.mount;
        mount.n_joints = *n_joints;
        mount.link_from_frame.rotation *= turn;
        Cow::Owned(robot)
    }

    /// Returns the views, in the order of time, with their readings changed by this hypothesis.
    pub(crate) fn applied(&self, robot: &Robot, views: &[View]) -> Vec<View> {
        let Self::Shifted(by) = self else { return views.iter().map(|view| self.applied_to(robot, view)).collect() };
        let shifted = |(at, view): (usize, &View)| {
            let source = views.get(at.checked_add_signed(*by)?)?;
            Some(View {
                travel_rad: source.travel_rad,
                rate_rad_s: source.rate_rad_s,
                approach: source.approach,
                ..view.clone()
            })
        };
        views.iter().enumerate().filter_map(shifted).collect()
    }

    /// Returns the view with its own readings changed by this hypothesis.
    fn applied_to(&self, robot: &Robot, view: &View) -> View {
        let mut changed = view.clone();
        match self {
            Self::Order(order) => {
                for (joint, &from) in order.iter().enumerate().filter(|(joint, from)| joint != *from) {
                    let (spec, other) = (&robot.sensors[joint], &robot.sensors[from]);
                    let angle_rad = other.center_rad + view.travel_rad[from];
                    let read = |angle_rad: f64| spec.angle_rad(other.recorded(angle_rad));
                    changed.travel_rad[joint] = wrapped(robot, joint, read(angle_rad) - spec.center_rad);
                    changed.rate_rad_s[joint] = view.rate_rad_s[from] * (read(1.0) - read(0.0));
                    changed.approach[joint] = view.approach[from];
                }
            }
            Self::Coupled { joint, with, sign } => {
                let with_rad = robot.sensors[*with].center_rad + view.travel_rad[*with];
                changed.travel_rad[*joint] = wrapped(robot, *joint, view.travel_rad[*joint] - sign * with_rad);
                changed.rate_rad_s[*joint] -= sign * view.rate_rad_s[*with];
            }
            Self::Sum { joint, own, with } => {
                let spec = &robot.sensors[*joint];
                let of_others_rad = with
                    .iter()
                    .map(|(other, sign)| sign * (robot.sensors[*other].center_rad + view.travel_rad[*other]));
                let angle_rad = own * (spec.center_rad + view.travel_rad[*joint] - of_others_rad.sum::<f64>());
                let rate_of_others: f64 = with.iter().map(|(other, sign)| sign * view.rate_rad_s[*other]).sum();
                changed.travel_rad[*joint] = wrapped(robot, *joint, angle_rad - spec.center_rad);
                changed.rate_rad_s[*joint] = own * (view.rate_rad_s[*joint] - rate_of_others);
                changed.approach[*joint] *= own;
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
            Self::Shifted(_) | Self::Camera { .. } | Self::MapFrame(_) | Self::MapScale(_) => {}
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

/// Sign 1 or -1 if both joints turn about parallel axes at any angles of the joints between them.
fn parallel_sign(robot: &Robot, [a, b]: [usize; 2]) -> Option<f64> {
    let joints = robot.chain.joints();
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
