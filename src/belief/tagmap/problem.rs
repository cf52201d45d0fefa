//! Data and state of the bundle adjustment.

use std::borrow::Cow;
use std::ops::Range;

use nalgebra::{Isometry3, Matrix2, Vector2, Vector3};

use armcal_core::optics::{CameraModel, SquarePose};

/// One tag in one image, checked and solved individually.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    /// Index into the sorted views.
    pub(super) view: usize,
    /// Index into the sorted tags.
    pub(super) tag: usize,
    pub(super) camera: usize,
    pub(super) corners_px: [Vector2<f64>; 4],
    /// Makes a pixel difference a unit-variance vector.
    pub(super) whiten: [Matrix2<f64>; 4],
    /// Corners in the tag's frame, m.
    pub(super) corners_m: [Vector3<f64>; 4],
    pub(super) best: SquarePose,
    pub(super) other: Option<SquarePose>,
    pub(super) is_used: bool,
}

impl Observation {
    /// Both solutions for camera_from_tag of the square.
    pub(super) fn solutions(&self) -> impl Iterator<Item = &SquarePose> {
        std::iter::once(&self.best).chain(&self.other)
    }
}

/// A pose that is known within standard deviations.
#[derive(Clone, Copy, Debug)]
pub(super) struct PosePrior {
    /// Pose owner_from_tag.
    pub(super) pose: Isometry3<f64>,
    /// Information 1/std^2 along the tag's axes.
    pub(super) information: nalgebra::Vector6<f64>,
    /// Index of the owner in the extras if its place is estimated; `None`: the owner's frame is the group's.
    pub(super) owner: Option<usize>,
}

/// A tag in the adjustment.
#[derive(Clone, Debug)]
pub(super) struct TagState {
    pub(super) id: u32,
    pub(super) size_m: f64,
    pub(super) body: usize,
    /// Given pose, body_from_tag, and its standard deviations; exact if these are `None`.
    pub(super) given: Option<(Isometry3<f64>, Option<[f64; 6]>)>,
    pub(super) group: usize,
    /// Index in the reduced system; `None` for a held tag.
    pub(super) node: Option<usize>,
    pub(super) prior: Option<PosePrior>,
    pub(super) pose: Isometry3<f64>,
}

/// One image's view of one group: six unknowns.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub(super) view: usize,
    pub(super) group: usize,
    /// Range of the block's observations.
    pub(super) range: Range<usize>,
    /// Index in the reduced system if another block depends on it (attitude); `None`: the block is marginalised.
    pub(super) node: Option<usize>,
    /// Pose frame_from_camera.
    pub(super) pose: Isometry3<f64>,
}

/// A pose in the reduced system that is no tag's: a body's place in its group, or the rotation of the world.
#[derive(Clone, Debug)]
pub(super) struct Extra {
    pub(super) node: usize,
    pub(super) pose: Isometry3<f64>,
}

/// Link by the attitude sensor between the rotations of two blocks of one view:
/// world_from_moving * moving_from_camera = world_from_fixed * fixed_from_camera.
#[derive(Clone, Debug)]
pub(super) struct AttitudeLink {
    pub(super) moving: usize,
    pub(super) fixed: usize,
    /// Index into the extras: world_from_fixed, of which only the rotation counts.
    pub(super) world: usize,
    pub(super) world_from_moving: nalgebra::UnitQuaternion<f64>,
    pub(super) information: f64,
}

#[derive(Clone, Debug)]
pub(super) struct MapProblem<'a> {
    pub(super) cameras: Cow<'a, [CameraModel]>,
    /// Observations, sorted by block and tag.
    pub(super) observations: Vec<Observation>,
    pub(super) tags: Vec<TagState>,
    pub(super) blocks: Vec<Block>,
    pub(super) extras: Vec<Extra>,
    pub(super) links: Vec<AttitudeLink>,
    pub(super) n_nodes: usize,
    /// Number of steps that adjustments may still make.
    pub(super) steps_left: usize,
}
