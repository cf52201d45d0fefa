//! The distance between the centres of two tags, measured by tape or laser: `|p_i - p_j|`.
//!
//! The unit vector u points from j to i. A small motion of tag i (right, its own axes) lengthens the distance by `u^T
//! R_i` times its shift, one of tag j by `-u^T R_j`; a turn about the centre does not change it.

use nalgebra::{Isometry3, Vector3, Vector6};

use crate::measure::block_measurement::BlockPrediction;
use crate::model::blocks::{Block, PerBlock, Value};
use armcal_core::robot::Robot;
use armcal_core::robot::geometry::TagDistance;

/// A stated distance, with the tags' indices among the robot's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DistanceTerm {
    stated: TagDistance,
    between: [usize; 2],
}

pub(super) fn all(robot: &Robot) -> impl Iterator<Item = Result<DistanceTerm, String>> {
    let index = |id: u32| robot.tags.iter().position(|tag| tag.id == id);
    robot.geometry.tag_distances.iter().map(move |stated| {
        let [a, b] = stated.tags.map(index);
        let between = a.zip(b).ok_or_else(|| named(stated.tags))?;
        Ok(DistanceTerm { stated: *stated, between: between.into() })
    })
}

fn named([a, b]: [u32; 2]) -> String {
    format!("the distance of tags {a} and {b}")
}

impl DistanceTerm {
    pub(super) fn blocks(&self) -> [Block; 2] {
        self.between.map(Block::Tag)
    }

    pub(super) fn predicted(&self, blocks: &PerBlock<Value>) -> BlockPrediction {
        let [a, b] = self.blocks();
        let [at_a, at_b] = [a, b].map(|block| blocks.pose(block));
        let apart = at_a.translation.vector - at_b.translation.vector;
        let predicted_m = apart.norm();
        let along = apart / predicted_m.max(f64::MIN_POSITIVE);
        BlockPrediction {
            measured_m: self.stated.distance_m,
            std_m: self.stated.std_m,
            predicted_m,
            by: [(a, by_shift(at_a, &along)), (b, by_shift(at_b, &-along))],
        }
    }

    pub(super) fn name(&self) -> (String, &'static str) {
        (named(self.stated.tags), "[[geometry.tag_distance]]")
    }
}

/// Returns the derivative of a length along `along` by the columns of the pose at one end.
fn by_shift(pose: &Isometry3<f64>, along: &Vector3<f64>) -> Vector6<f64> {
    let by = pose.rotation.inverse() * along;
    Vector6::new(by.x, by.y, by.z, 0.0, 0.0, 0.0)
}
