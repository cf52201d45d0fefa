//! Everything that is estimated.

use nalgebra::{DVector, Isometry3};

use crate::model::blocks::{Block, PerBlock, Value};
use crate::model::layout::Layout;
use armcal_core::joints::MAX_JOINTS;

/// Parameters of the joints, blocks, and what each view has of its own.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub joint: DVector<f64>,
    pub blocks: PerBlock<Value>,
    /// Each joint's error beyond its sensor's model in each view, rad.
    pub joint_error: Vec<[f64; MAX_JOINTS]>,
    /// The camera's pose error in each view.
    pub camera_error: Vec<Isometry3<f64>>,
}

impl State {
    /// Becomes `other` in its own memory; both are of one problem.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.joint.copy_from(&other.joint);
        self.blocks.copy_from(&other.blocks);
        self.joint_error.copy_from_slice(&other.joint_error);
        self.camera_error.copy_from_slice(&other.camera_error);
    }

    /// A state with `n_views` views that have no errors of their own.
    pub(crate) fn with_views(&self, n_views: usize) -> Self {
        Self {
            joint: self.joint.clone(),
            blocks: self.blocks.clone(),
            joint_error: vec![[0.0; MAX_JOINTS]; n_views],
            camera_error: vec![Isometry3::identity(); n_views],
        }
    }

    /// Moves the common parameters by a step of their columns.
    pub(crate) fn step(&mut self, layout: &Layout, step: &DVector<f64>) {
        self.joint += step.rows(0, layout.n_joint());
        for (block, at) in layout.blocks() {
            self.blocks[block] = self.blocks[block].moved(&step.as_slice()[at..at + block.n_columns()]);
        }
    }

    /// The pose of a block.
    #[inline]
    pub(crate) fn pose(&self, block: Block) -> &Isometry3<f64> {
        self.blocks.pose(block)
    }
}
