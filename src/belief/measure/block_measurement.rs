//! Measurements between blocks, independent of the views.
//!
//! Each kind has a file with its prediction; a new kind needs that file, a variant and a line in each function here.

mod tag_distance;

use nalgebra::Vector6;

use crate::measure::block_measurement::tag_distance::DistanceTerm;
use crate::model::blocks::{Block, PerBlock, Value};
use armcal_core::robot::Robot;

/// A measured length.
#[derive(Clone, Copy, Debug)]
pub(crate) enum BlockMeasurement {
    TagDistance(DistanceTerm),
}

/// A measured length and its prediction from the blocks.
pub(crate) struct BlockPrediction {
    pub measured_m: f64,
    /// Standard deviation of the measurement.
    pub std_m: f64,
    pub predicted_m: f64,
    /// d(predicted)/d(columns) of the two poses between which it was measured.
    pub by: [(Block, Vector6<f64>); 2],
}

impl BlockMeasurement {
    /// Returns all measurements that robot.toml states; an error has the name of one between blocks that the arm does
    /// not have.
    pub(crate) fn all(robot: &Robot) -> Vec<Result<Self, String>> {
        tag_distance::all(robot).map(|stated| stated.map(Self::TagDistance)).collect()
    }

    /// Returns the blocks of the two poses between which it was measured.
    pub(crate) fn blocks(self) -> [Block; 2] {
        match self {
            Self::TagDistance(term) => term.blocks(),
        }
    }

    /// Returns the prediction, linearized at the values of `blocks`.
    pub(crate) fn predicted(self, blocks: &PerBlock<Value>) -> BlockPrediction {
        match self {
            Self::TagDistance(term) => term.predicted(blocks),
        }
    }

    /// Returns the measured quantity in words, and the key that states it.
    pub(crate) fn name(self) -> (String, &'static str) {
        match self {
            Self::TagDistance(term) => term.name(),
        }
    }
}
