//! Something of each block of an arm, found by the block.

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
    /// `of` each block that `robot` has.
    pub(crate) fn new(robot: &Robot, of: impl FnMut(Block) -> T) -> Self {
        let (n_cameras, n_tags) = (1 + robot.further_cameras.len(), robot.tags.len());
        Self { all: Block::all(robot).map(of).collect(), n_cameras, n_tags }
    }

    /// Each with its block.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Block, &T)> {
        self.blocks().zip(&self.all)
    }

    /// Each with its block, to be changed.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (Block, &mut T)> {
        self.blocks().zip(&mut self.all)
    }

    /// Those of the tags about the arm.
    pub(crate) fn tags(&self) -> &[T] {
        let first = self.place(Block::Tag(0));
        &self.all[first..first + self.n_tags]
    }

    /// Entries of the tags, mutable.
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
    /// Becomes `other` in its own memory; both are of one arm.
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
    /// The pose of a block.
    #[inline]
    pub(crate) fn pose(&self, block: Block) -> &Isometry3<f64> {
        match &self[block] {
            Value::Pose(pose) => pose,
            other => unreachable!("{block:?} is a pose, not {other:?}"),
        }
    }

    /// The lens of a block.
    #[inline]
    pub(crate) fn lens(&self, block: Block) -> &CameraModel {
        match &self[block] {
            Value::Lens(lens) => lens,
            other => unreachable!("{block:?} is a lens, not {other:?}"),
        }
    }

    /// The number of a block.
    #[inline]
    pub(crate) fn number(&self, block: Block) -> f64 {
        match &self[block] {
            Value::Number(number) => *number,
            other => unreachable!("{block:?} is a number, not {other:?}"),
        }
    }
}
