//! The choice of the estimated quantities.

use std::collections::BTreeSet;

use crate::model::blocks::Block;
use crate::model::parameters::{Parameter, ParameterKind};
use armcal_core::joints::MAX_JOINTS;
use armcal_core::time::Stamp;

/// Choice of the parameters that have a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Parameters of each joint of the arm, base first.
    pub joints: Vec<Vec<ParameterKind>>,
    /// Number of joints, base first, with columns of their pose on the parent link.
    pub n_links: usize,
    /// Number of joints, base first, with a column of their compliance, in addition to those of the base and of the
    /// tool load. 0: none of these.
    pub n_compliant: usize,
    /// Further blocks of parameters; tags that no view shows have no columns even if they are listed.
    pub blocks: BTreeSet<Block>,
    /// Random walk of the offsets during the views; `None` if the offsets are constant.
    pub walk: Option<Walk>,
}

/// A random walk of every joint's offset during the views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Stamps at the end of the first and of the last view.
    pub span: [Stamp; 2],
    /// Probability of each joint's errors over time if its offset is constant (`permutation_test`); one if no view
    /// constrains the joint.
    pub p_value: [f64; MAX_JOINTS],
    /// Log evidence of all joints' walks relative to no walk, nats.
    pub gain_nats: f64,
}

impl Model {
    /// Returns a model of an arm of `n_joints` whose sensors are not estimated.
    #[must_use]
    pub fn of_blocks(n_joints: usize, blocks: impl IntoIterator<Item = Block>) -> Self {
        let joints = vec![Vec::new(); n_joints];
        Self { joints, n_links: 0, n_compliant: 0, blocks: blocks.into_iter().collect(), walk: None }
    }

    /// Returns true for a block that is estimated.
    #[must_use]
    pub fn has(&self, block: Block) -> bool {
        self.blocks.contains(&block)
    }

    /// Returns the joints' parameters in the order of their columns: sensors joint by joint, links joint by joint, sag.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let of_sensors =
            self.joints.iter().enumerate().flat_map(|(joint, kinds)| kinds.iter().map(move |&kind| (joint, kind)));
        let of_links = (0..self.n_links).flat_map(|joint| ParameterKind::all_of_link().map(move |kind| (joint, kind)));
        let of_sag = Parameter::all_of_sag(self.n_compliant).filter(|_| self.n_compliant > 0);
        of_sensors.chain(of_links).map(|(joint, kind)| Parameter { joint, kind }).chain(of_sag).collect()
    }
}
