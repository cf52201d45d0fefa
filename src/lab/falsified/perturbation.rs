//! One falsification, applied to the description of the arm or to the readings of a joint.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;

use crate::falsified::cases::{Case, CaseKind, Element};
use armcal_core::kinematics::{Chain, ChainJoint};
use armcal_core::robot::Robot;
use armcal_core::sensor::SensorModel;
use armcal_core::spatial::Pose;
use armcal_core::stats::stream_rng;

/// A change of the estimator's input. Lengths m, angles rad; ratios are relative changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Perturbation {
    /// Shift of the camera on its link, in its own axes.
    MountShift(Vector3<f64>),
    MountTurn(Vector3<f64>),
    /// Shift of a joint's origin on its parent link, in the link's axes. `LinkTurn` turns about the joint's origin.
    LinkShift(usize, Vector3<f64>),
    LinkTurn(usize, Vector3<f64>),
    ToolShift(Vector3<f64>),
    /// Shift of a tag in the base's axes. `TagTurn` turns about the tag's own centre.
    TagShift(usize, Vector3<f64>),
    TagTurn(usize, Vector3<f64>),
    TagSize(usize, f64),
    AllTagSizes(f64),
    TagsSwapped(usize, usize),
    /// Turn of all tags about the base's origin.
    SurveyTurn(Vector3<f64>),
    FocalLength([f64; 2]),
    ImageCentre([f64; 2]),
    Sensor(SensorFault),
}

/// A faulty sensor and its wrong reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SensorFault {
    pub joint: usize,
    pub reading: WrongReading,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum WrongReading {
    /// The reading of the middle of the capture, kept from then on.
    Stuck,
    /// A constant word of zero.
    Dead,
    Reversed,
    Rescaled(f64),
    /// An increase by this angle from the middle of the capture on, rad.
    Slipped(f64),
}

/// The right reading of a joint at one moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct SoundReading {
    /// Travel from the middle of the range by the datasheet, rad.
    pub travel_rad: f64,
    /// Travel in the middle of the capture, rad.
    pub middle_travel_rad: f64,
    pub half: CaptureHalf,
}

/// Half of the capture; the time after the capture belongs to the second half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CaptureHalf {
    First,
    Second,
}

impl SensorFault {
    /// Reading of the faulty sensor, as travel by the datasheet, rad.
    pub(super) fn travel_rad(&self, sensor: &SensorModel, sound: &SoundReading) -> f64 {
        let is_late = sound.half == CaptureHalf::Second;
        match self.reading {
            WrongReading::Stuck if is_late => sound.middle_travel_rad,
            WrongReading::Slipped(by_rad) if is_late => sound.travel_rad + by_rad,
            WrongReading::Stuck | WrongReading::Slipped(_) => sound.travel_rad,
            WrongReading::Dead => sensor.nominal_travel_rad(0.0),
            WrongReading::Reversed => -sound.travel_rad,
            WrongReading::Rescaled(gain) => gain * sound.travel_rad,
        }
    }
}

impl Case {
    /// Changes that the case makes; empty for the good arm, and where the case only removes views.
    pub(super) fn perturbations(&self, robot: &Robot, seed: u64) -> Vec<Perturbation> {
        use Perturbation as P;
        let n_tags = robot.tags.len();
        let size = self.size;
        let along = match self.element {
            Element::Axis(axis) | Element::JointAxis { axis, .. } => Vector3::ith(axis, size),
            _ => Vector3::zeros(),
        };
        let tags = self.tags(n_tags, seed);
        match (self.kind, self.element) {
            (CaseKind::MountTurned, _) => vec![P::MountTurn(along)],
            (CaseKind::MountShifted, _) => vec![P::MountShift(along)],
            (CaseKind::TagMoved | CaseKind::TagsMoved, _) => {
                let by = size * self.direction(seed);
                tags.into_iter().map(|tag| P::TagShift(tag, by)).collect()
            }
            (CaseKind::TagSize, _) => tags.into_iter().map(|tag| P::TagSize(tag, size)).collect(),
            (CaseKind::AllTagSizes, _) => vec![P::AllTagSizes(size)],
            (CaseKind::IdsSwapped, _) => tags.chunks_exact(2).map(|pair| P::TagsSwapped(pair[0], pair[1])).collect(),
            (CaseKind::FocalLength, _) => vec![P::FocalLength([size; 2])],
            (CaseKind::ImageCentre, _) => vec![P::ImageCentre([along.x, along.y])],
            (CaseKind::LinkShifted | CaseKind::BaseShifted, Element::JointAxis { joint, .. }) => {
                vec![P::LinkShift(joint, along)]
            }
            (
                CaseKind::LinkTurned | CaseKind::BaseTurned | CaseKind::GripperAxisTurned,
                Element::JointAxis { joint, .. },
            ) => vec![P::LinkTurn(joint, along)],
            (CaseKind::ToolShifted, _) => vec![P::ToolShift(along)],
            (CaseKind::SurveyTurned, _) => vec![P::SurveyTurn(along)],
            (_, Element::Joint(joint)) => {
                self.wrong_reading().map_or_else(Vec::new, |reading| vec![P::Sensor(SensorFault { joint, reading })])
            }
            _ => Vec::new(),
        }
    }

    fn wrong_reading(&self) -> Option<WrongReading> {
        match self.kind {
            CaseKind::SensorStuck => Some(WrongReading::Stuck),
            CaseKind::SensorDead => Some(WrongReading::Dead),
            CaseKind::SensorReversed => Some(WrongReading::Reversed),
            CaseKind::SensorRescaled => Some(WrongReading::Rescaled(self.size)),
            CaseKind::SensorSlipped => Some(WrongReading::Slipped(self.size)),
            _ => None,
        }
    }

    /// A direction for a seed, uniform over the sphere: the same for all sizes of an element.
    fn direction(&self, seed: u64) -> Vector3<f64> {
        let mut rng = stream_rng(seed, &format!("{} {:?}", self.kind.name(), self.element));
        loop {
            let [x, y, z]: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            let drawn = Vector3::new(x, y, z);
            if (0.01..=1.0).contains(&drawn.norm_squared()) {
                return drawn.normalize();
            }
        }
    }
}

impl Perturbation {
    /// The sensor's fault; `None` for other perturbations.
    pub(super) fn sensor_fault(&self) -> Option<SensorFault> {
        match self {
            Self::Sensor(fault) => Some(*fault),
            _ => None,
        }
    }

    /// The perturbation, `factor` times as large where that has a meaning.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        match *self {
            Self::MountShift(by) => Self::MountShift(by * factor),
            Self::MountTurn(by) => Self::MountTurn(by * factor),
            Self::LinkShift(joint, by) => Self::LinkShift(joint, by * factor),
            Self::LinkTurn(joint, by) => Self::LinkTurn(joint, by * factor),
            Self::ToolShift(by) => Self::ToolShift(by * factor),
            Self::TagShift(tag, by) => Self::TagShift(tag, by * factor),
            Self::TagTurn(tag, by) => Self::TagTurn(tag, by * factor),
            Self::TagSize(tag, by) => Self::TagSize(tag, by * factor),
            Self::AllTagSizes(by) => Self::AllTagSizes(by * factor),
            Self::SurveyTurn(by) => Self::SurveyTurn(by * factor),
            Self::FocalLength(by) => Self::FocalLength(by.map(|by| by * factor)),
            Self::ImageCentre(by) => Self::ImageCentre(by.map(|by| by * factor)),
            Self::Sensor(SensorFault { joint, reading: WrongReading::Slipped(by) }) => {
                Self::Sensor(SensorFault { joint, reading: WrongReading::Slipped(by * factor) })
            }
            Self::TagsSwapped(..) | Self::Sensor(_) => *self,
        }
    }

    /// Applies the perturbation to the description of an arm.
    pub(super) fn apply(&self, robot: &mut Robot) {
        match *self {
            Self::MountShift(by) => shift_after(&mut robot.camera.mount.link_from_frame, &by),
            Self::MountTurn(by) => {
                robot.camera.mount.link_from_frame *= UnitQuaternion::from_scaled_axis(by);
            }
            Self::LinkShift(joint, by) => {
                change_joint(robot, joint, |place| Translation3::from(by) * place);
            }
            Self::LinkTurn(joint, by) => {
                change_joint(robot, joint, |place| turned_in_place(&place, &by));
            }
            Self::ToolShift(by) => {
                let place = &mut robot.tool.mount.link_from_frame;
                *place = Translation3::from(by) * *place;
            }
            Self::TagShift(tag, by) => change_tag(robot, tag, |place| Translation3::from(by) * place),
            Self::TagTurn(tag, by) => change_tag(robot, tag, |place| turned_in_place(&place, &by)),
            Self::TagSize(tag, by) => robot.tags[tag].size_m *= 1.0 + by,
            Self::AllTagSizes(by) => {
                robot.tags.iter_mut().for_each(|tag| tag.size_m *= 1.0 + by);
                robot.gripper_tag.iter_mut().for_each(|tag| tag.size_m *= 1.0 + by);
            }
            Self::TagsSwapped(one, other) => {
                let places = [robot.tags[one].base_from_tag, robot.tags[other].base_from_tag];
                [robot.tags[other].base_from_tag, robot.tags[one].base_from_tag] = places;
            }
            Self::SurveyTurn(by) => {
                let turn = UnitQuaternion::from_scaled_axis(by);
                (0..robot.tags.len()).for_each(|tag| change_tag(robot, tag, |place| turn * place));
            }
            Self::FocalLength(by) => {
                let mut at = robot.camera.lens.intrinsics();
                at.iter_mut().zip(by).for_each(|(focal_px, by)| *focal_px *= 1.0 + by);
                robot.camera.lens = robot.camera.lens.with_intrinsics(at);
            }
            Self::ImageCentre(by) => {
                let mut at = robot.camera.lens.intrinsics();
                at[2..].iter_mut().zip(by).for_each(|(center_px, by)| *center_px += by);
                robot.camera.lens = robot.camera.lens.with_intrinsics(at);
            }
            Self::Sensor(_) => {}
        }
    }
}

/// The description of `robot` with all `perturbations` applied.
pub(super) fn falsified_robot(robot: &Robot, perturbations: &[Perturbation]) -> Robot {
    let mut falsified = robot.clone();
    perturbations.iter().for_each(|perturbation| perturbation.apply(&mut falsified));
    falsified
}

/// Shifts a pose in its own axes.
fn shift_after(place: &mut Isometry3<f64>, by: &Vector3<f64>) {
    *place *= Translation3::from(*by);
}

/// Turns a pose about its own origin, in the parent's axes.
fn turned_in_place(place: &Isometry3<f64>, by: &Vector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(place.translation, UnitQuaternion::from_scaled_axis(*by) * place.rotation)
}

fn change_joint(robot: &mut Robot, joint: usize, change: impl Fn(Isometry3<f64>) -> Isometry3<f64>) {
    let mut joints: Vec<ChainJoint> = robot.chain.joints().to_vec();
    joints[joint].parent_from_joint = change(joints[joint].parent_from_joint);
    robot.chain = Chain::new(joints).with_loads(*robot.chain.loads());
}

fn change_tag(robot: &mut Robot, tag: usize, change: impl Fn(Isometry3<f64>) -> Isometry3<f64>) {
    let place = &mut robot.tags[tag].base_from_tag;
    *place = Pose::from_isometry(change(*place.isometry()));
}
