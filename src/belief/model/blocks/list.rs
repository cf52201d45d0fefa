//! List of blocks; the variants are in the order of their columns.

use crate::model::blocks::{MAX_COLUMNS, Std, Value, clock, gripper_tag, lens, mount, tag};
use crate::model::scales::Hyperparameters;
use armcal_core::robot::Robot;

/// A group of parameters that move together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Block {
    /// Mount of a camera on its link, by the camera's number, about the nominal one.
    Mount(usize),
    /// Delay of the joint sensors' stamps after the camera's.
    Clock,
    /// Focal lengths, centre and distortion of a camera, by its number, about robot.toml's.
    Lens(usize),
    /// Pose of a tag, by its index among the robot's, about its survey.
    Tag(usize),
    /// Pose of the tag on the gripper, about the nominal one.
    GripperTag,
}

/// Content of the views that decides which blocks are estimated.
pub(crate) struct Shown<'a> {
    /// True if the arm moves in some views.
    pub motion: bool,
    /// True if enough views show the tag on the gripper.
    pub gripper_tag: bool,
    /// Returns true for the number of a camera that sees tags.
    pub by_camera: &'a dyn Fn(usize) -> bool,
}

impl Block {
    /// Returns all blocks of `robot`, in the order of their columns.
    pub fn all(robot: &Robot) -> impl Iterator<Item = Self> + use<> {
        Self::in_order(1 + robot.further_cameras.len(), robot.tags.len())
    }

    pub(super) fn in_order(n_cameras: usize, n_tags: usize) -> impl Iterator<Item = Self> {
        let mounts = (0..n_cameras).map(Self::Mount);
        let lenses = (0..n_cameras).map(Self::Lens);
        mounts.chain([Self::Clock]).chain(lenses).chain((0..n_tags).map(Self::Tag)).chain([Self::GripperTag])
    }

    /// Returns the block's index in that order.
    #[inline]
    pub(super) fn place(self, n_cameras: usize, n_tags: usize) -> usize {
        match self {
            Self::Mount(camera) => camera,
            Self::Clock => n_cameras,
            Self::Lens(camera) => n_cameras + 1 + camera,
            Self::Tag(tag) => 2 * n_cameras + 1 + tag,
            Self::GripperTag => 2 * n_cameras + 1 + n_tags,
        }
    }

    /// Returns the blocks of the robot's tags.
    pub fn tags(robot: &Robot) -> impl Iterator<Item = Self> + use<> {
        (0..robot.tags.len()).map(Self::Tag)
    }

    /// Returns the number of columns.
    #[inline]
    pub(crate) fn n_columns(self) -> usize {
        match self {
            Self::Mount(_) | Self::Tag(_) | Self::GripperTag => 6,
            Self::Clock => 1,
            Self::Lens(_) => MAX_COLUMNS,
        }
    }

    /// Returns true if the block is estimated from the start; a lens is added only if the views require it.
    pub(crate) fn is_told(self, robot: &Robot, shown: &Shown<'_>) -> bool {
        match self {
            Self::Mount(camera) => mount::is_loose(robot.camera_at(camera)) && (shown.by_camera)(camera),
            Self::Clock => shown.motion,
            Self::Lens(_) => false,
            Self::Tag(_) => true,
            Self::GripperTag => shown.gripper_tag,
        }
    }

    /// Returns the nominal value: from the URDF, robot.toml or the survey.
    pub(crate) fn drawn(self, robot: &Robot) -> Value {
        match self {
            Self::Mount(camera) => mount::drawn(robot, camera),
            Self::Clock => clock::drawn(),
            Self::Lens(camera) => lens::drawn(robot, camera),
            Self::Tag(tag) => tag::drawn(robot, tag),
            Self::GripperTag => gripper_tag::drawn(robot),
        }
    }

    /// Returns the standard deviation of the nominal value for each column, in the column's unit; infinite if unknown.
    pub(crate) fn drawn_std(self, robot: &Robot, scales: &Hyperparameters) -> Std {
        match self {
            Self::Mount(camera) => mount::drawn_std(robot, camera, scales),
            Self::Clock => clock::drawn_std(),
            Self::Lens(camera) => lens::drawn_std(robot, camera, scales),
            Self::Tag(tag) => tag::drawn_std(robot, tag),
            Self::GripperTag => gripper_tag::drawn_std(robot),
        }
    }

    /// Returns the name of one of the block's columns.
    pub(crate) fn name(self, robot: &Robot, column: usize) -> String {
        match self {
            Self::Mount(camera) => mount::name(robot, camera, column),
            Self::Clock => clock::name(),
            Self::Lens(camera) => lens::name(robot, camera, column),
            Self::Tag(tag) => tag::name(robot, tag, column),
            Self::GripperTag => gripper_tag::name(column),
        }
    }

    /// Returns true if the columns are a position and an attitude: shifts in m, then turns in rad.
    pub(crate) fn is_pose(self) -> bool {
        matches!(self, Self::Mount(_) | Self::Tag(_) | Self::GripperTag)
    }

    /// Returns the index of a tag around the arm; `None` for other blocks.
    pub(crate) fn tag_about_arm(self) -> Option<usize> {
        match self {
            Self::Tag(tag) => Some(tag),
            _ => None,
        }
    }

    /// Returns true for a tag around the arm or on its gripper.
    pub(crate) fn is_tag(self) -> bool {
        matches!(self, Self::Tag(_) | Self::GripperTag)
    }
}
