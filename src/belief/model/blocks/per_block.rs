//! A value for each block of an arm, found by the block.

use nalgebra::Isometry3;

use crate::model::blocks::{Block, Value};
use armcal_core::optics::CameraModel;
use armcal_core::robot::Robot;

/// One `T` for each block, in the blocks' order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PerBlock<T> {
    all: Vec<T>,
    n_cameras: usize,
    n_tags: usize,
}

impl<T> PerBlock<T> {
    /// Returns `of` each block that `robot` has.
    pub(crate) fn new(robot: &Robot, of: impl FnMut(Block) -> T) -> Self {
        let (n_cameras, n_tags) = (1 + robot.further_cameras.len(), robot.tags.len());
        Self { all: Block::all(robot).map(of).collect(), n_cameras, n_tags }
    }

    /// Returns each value with its block.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Block, &T)> {
        self.blocks().zip(&self.all)
    }

    /// Returns each value, mutable, with its block.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (Block, &mut T)> {
        self.blocks().zip(&mut self.all)
    }

    /// Returns the values of the tags around the arm.
    pub(crate) fn tags(&self) -> &[T] {
        let first = self.place(Block::Tag(0));
        &self.all[first..first + self.n_tags]
    }

    /// Returns the values of these tags, mutable.
    pub(crate) fn tags_mut(&mut self) -> &mut [T] {
        let first = self.place(Block::Tag(0));
        &mut self.all[first..first + self.n_tags]
    }

    fn blocks(&self) -> impl Iterator<Item = Block> + use<T> {
        Block::in_order(self.n_cameras, self.n_tags)
    }

    #[inline]
    fn place(&self, block: Block) -> usize {
        block.place(self.n_cameras, self.n_tags)
    }
}

impl<T: Copy> PerBlock<T> {
    /// Copies `other` into the same memory; both are of one arm.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.all.copy_from_slice(&other.all);
    }
}

impl<T> std::ops::Index<Block> for PerBlock<T> {
    type Output = T;

    #[inline]
    fn index(&self, block: Block) -> &T {
        &self.all[self.place(block)]
    }
}

impl<T> std::ops::IndexMut<Block> for PerBlock<T> {
    #[inline]
    fn index_mut(&mut self, block: Block) -> &mut T {
        let place = self.place(block);
        &mut self.all[place]
    }
}

impl PerBlock<Value> {
    /// Returns the pose of a block.
    #[inline]
    pub(crate) fn pose(&self, block: Block) -> &Isometry3<f64> {
        match &self[block] {
            Value::Pose(pose) => pose,
            other => unreachable!("{block:?} is a pose, not {other:?}"),
        }
    }

    /// Returns the lens of a block.
    #[inline]
    pub(crate) fn lens(&self, block: Block) -> &CameraModel {
        match &self[block] {
            Value::Lens(lens) => lens,
            other => unreachable!("{block:?} is a lens, not {other:?}"),
        }
    }

    /// Returns the number that is the value of a block.
    #[inline]
    pub(crate) fn number(&self, block: Block) -> f64 {
        match &self[block] {
            Value::Number(number) => *number,
            other => unreachable!("{block:?} is a number, not {other:?}"),
        }
    }
}
