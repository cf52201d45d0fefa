//! The choice of the estimated quantities.

use std::collections::BTreeSet;

use crate::model::blocks::Block;
use crate::model::parameters::{Parameter, ParameterKind};
use armcal_core::joints::MAX_JOINTS;
use armcal_core::time::Stamp;

/// Which parameters have a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Parameters of each joint of the arm, base first.
    pub joints: Vec<Vec<ParameterKind>>,
    /// Number of joints, base first, with columns of their place on the parent link.
    pub n_links: usize,
    /// Number of joints, base first, with a column of their compliance, next to the base's and a load at the tool; 0:
    /// none of these.
    pub n_compliant: usize,
    /// Groups of parameters next to these; tags that no view shows have no columns all the same.
    pub blocks: BTreeSet<Block>,
    /// Random walk of the offsets during the views; `None`: they do not walk.
    pub walk: Option<Walk>,
}

/// A random walk of every joint's offset during the views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Ends of the first and the last view.
    pub span: [Stamp; 2],
    /// Probability of each joint's errors in time where its offset does not walk (`permutation_test`); one where no
    /// view constrains the joint.
    pub p_value: [f64; MAX_JOINTS],
    /// Log evidence of all joints' walks over none.
    pub gain_nats: f64,
}

impl Model {
    /// A model of an arm of `n_joints` whose sensors are not estimated.
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

    /// The joints' parameters in the order of their columns: sensors joint by joint, links joint by joint, sag.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let of_sensors =
            self.joints.iter().enumerate().flat_map(|(joint, kinds)| kinds.iter().map(move |&kind| (joint, kind)));
        let of_links = (0..self.n_links).flat_map(|joint| ParameterKind::all_of_link().map(move |kind| (joint, kind)));
        let of_sag = Parameter::all_of_sag(self.n_compliant).filter(|_| self.n_compliant > 0);
        of_sensors.chain(of_links).map(|(joint, kind)| Parameter { joint, kind }).chain(of_sag).collect()
    }
}
