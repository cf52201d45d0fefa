//! Assignment of parameters to columns.

use std::ops::Range;

use crate::model::blocks::{Block, PerBlock};
use crate::model::estimated::Model;
use crate::model::parameters::Parameter;
use armcal_core::robot::Robot;

/// Columns of a problem: the joints' parameters first, then the blocks in their order.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    /// Parameters of the joints' columns, from column 0 on, joint by joint.
    pub parameters: Vec<Parameter>,
    pub of_joint: Vec<Range<usize>>,
    /// Six columns of each joint whose pose on its parent link is estimated, base first, after those of the sensors.
    pub links: Range<usize>,
    /// Columns of the compliance, right after those of the links.
    pub sag: Range<usize>,
    /// First column of each block; `None` for a block without columns.
    first: PerBlock<Option<usize>>,
    pub n: usize,
}

impl Layout {
    /// Returns the layout of `model`; of the tags only those with `has_column` get columns.
    pub(crate) fn new(robot: &Robot, model: &Model, has_column: impl Fn(usize) -> bool) -> Self {
        let is_wanted = |block: Block| match block {
            Block::Tag(tag) => model.has(block) && has_column(tag),
            _ => model.has(block),
        };
        let parameters = model.parameters();
        let mut of_joint = Vec::with_capacity(model.joints.len());
        let mut start = 0;
        for kinds in &model.joints {
            of_joint.push(start..start + kinds.len());
            start += kinds.len();
        }
        let links = start..start + 6 * model.n_links;
        let sag = links.end..parameters.len();
        let mut n = parameters.len();
        let first = PerBlock::new(robot, |block| is_wanted(block).then(|| take(&mut n, block)));
        Self { parameters, of_joint, links, sag, first, n }
    }

    /// Returns a layout with one more block.
    pub(crate) fn with(&self, block: Block) -> Self {
        let mut n = self.n_joint();
        let mut first = self.first.clone();
        for (of, at) in first.iter_mut() {
            *at = (at.is_some() || of == block).then(|| take(&mut n, of));
        }
        Self { first, n, ..self.clone() }
    }

    /// Returns the first column of a block.
    #[inline]
    pub(crate) fn at(&self, block: Block) -> Option<usize> {
        self.first[block]
    }

    /// Returns the blocks that have columns, each with its first column, in their order.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = (Block, usize)> + '_ {
        self.first.iter().filter_map(|(block, at)| Some((block, (*at)?)))
    }

    /// Returns the block of a column, and the column's index in the block; `None` for the joints' parameters.
    pub(crate) fn block_of(&self, column: usize) -> Option<(Block, usize)> {
        let mut blocks = self.blocks();
        let (block, at) = blocks.find(|(block, at)| (*at..at + block.n_columns()).contains(&column))?;
        Some((block, column - at))
    }

    /// Returns the index and first column of each tag around the arm that has columns.
    pub(crate) fn tags(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.first.tags().iter().enumerate().filter_map(|(tag, at)| Some((tag, (*at)?)))
    }

    /// Returns the columns of links and sag.
    pub(crate) fn body(&self) -> Range<usize> {
        self.links.start..self.sag.end
    }

    pub(crate) fn n_joint(&self) -> usize {
        self.parameters.len()
    }
}

fn take(n: &mut usize, block: Block) -> usize {
    let at = *n;
    *n += block.n_columns();
    at
}
