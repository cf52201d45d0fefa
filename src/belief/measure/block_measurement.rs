//! What is measured of blocks against each other, in no view.
//!
//! Each kind has a file with its prediction; a new kind is that file, a variant and a line in each function here.

mod tag_distance;

use nalgebra::Vector6;

use crate::measure::block_measurement::tag_distance::DistanceTerm;
use crate::model::blocks::{Block, PerBlock, Value};
use armcal_core::robot::Robot;

/// One measured length.
#[derive(Clone, Copy, Debug)]
pub(crate) enum BlockMeasurement {
    TagDistance(DistanceTerm),
}

/// A measured length and what blocks predict for it.
pub(crate) struct BlockPrediction {
    pub measured_m: f64,
    /// One sigma of the measurement.
    pub std_m: f64,
    pub predicted_m: f64,
    /// d(predicted)/d(columns) of the two poses that it is between.
    pub by: [(Block, Vector6<f64>); 2],
}

impl BlockMeasurement {
    /// All that robot.toml states; the name of one between blocks that the arm does not have.
    pub(crate) fn all(robot: &Robot) -> Vec<Result<Self, String>> {
        tag_distance::all(robot).map(|stated| stated.map(Self::TagDistance)).collect()
    }

    /// The two poses that it is between.
    pub(crate) fn blocks(self) -> [Block; 2] {
        match self {
            Self::TagDistance(term) => term.blocks(),
        }
    }

    /// Linearized at the values of `blocks`.
    pub(crate) fn predicted(self, blocks: &PerBlock<Value>) -> BlockPrediction {
        match self {
            Self::TagDistance(term) => term.predicted(blocks),
        }
    }

    /// What was measured, in words, and the key that states it.
    pub(crate) fn name(self) -> (String, &'static str) {
        match self {
            Self::TagDistance(term) => term.name(),
        }
    }
}
