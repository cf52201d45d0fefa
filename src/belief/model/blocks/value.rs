//! Parameters of a block, and the step of its columns.

pub(crate) use crate::model::constants::blocks_value::MAX_COLUMNS;
use nalgebra::{Isometry3, Vector6};

use armcal_core::optics::CameraModel;
use armcal_core::spatial::{exp, log};

/// One sigma of each column; zero beyond the block's own.
pub(crate) type Std = [f64; MAX_COLUMNS];

/// The value of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    /// Six columns: a small motion on the right, shift m before turn rad.
    Pose(Isometry3<f64>),
    /// One column.
    Number(f64),
    /// Eight columns: focal lengths and centre px, then distortion.
    Lens(CameraModel),
}

impl Value {
    /// Moved by a step of its columns.
    pub(crate) fn moved(&self, step: &[f64]) -> Self {
        match self {
            Self::Pose(pose) => Self::Pose(pose * exp(&Vector6::from_fn(|k, _| step[k]))),
            Self::Number(number) => Self::Number(number + step[0]),
            Self::Lens(lens) => {
                let now = lens.intrinsics();
                Self::Lens(lens.with_intrinsics(std::array::from_fn(|k| now[k] + step[k])))
            }
        }
    }

    /// The step that leads here from `mean`, zero beyond the block's own columns; both are of one block.
    pub(crate) fn off(&self, mean: &Self) -> [f64; MAX_COLUMNS] {
        let mut off = [0.0; MAX_COLUMNS];
        match (self, mean) {
            (Self::Pose(pose), Self::Pose(mean)) => off[..6].copy_from_slice(log(&mean.inv_mul(pose)).as_slice()),
            (Self::Number(number), Self::Number(mean)) => off[0] = number - mean,
            (Self::Lens(lens), Self::Lens(mean)) => {
                let (now, mean) = (lens.intrinsics(), mean.intrinsics());
                off = std::array::from_fn(|k| now[k] - mean[k]);
            }
            _ => unreachable!("{self:?} and {mean:?} are of one block"),
        }
        off
    }
}

/// Sigmas of a pose.
pub(crate) fn six(shift_m: f64, turn_rad: f64) -> Std {
    [shift_m, shift_m, shift_m, turn_rad, turn_rad, turn_rad, 0.0, 0.0]
}

/// A column of a pose in words.
pub(super) fn pose_column(column: usize) -> &'static str {
    ["along x", "along y", "along z", "turn about x", "turn about y", "turn about z"][column]
}
