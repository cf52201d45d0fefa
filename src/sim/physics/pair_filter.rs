//! Filter of the pairs of shapes for which rapier makes contacts.

use rapier3d::pipeline::{PairFilterContext, PhysicsHooks};
use rapier3d::prelude::SolverFlags;

use crate::solids::{PairTable, Solids};

/// Filter that passes watched pairs of parts; a collider's user data is its part.
pub(super) struct PairFilter {
    pairs: PairTable,
}

impl PairFilter {
    pub(super) fn new(solids: &Solids) -> Self {
        Self { pairs: solids.pairs().clone() }
    }
}

impl PhysicsHooks for PairFilter {
    fn filter_contact_pair(&self, context: &PairFilterContext) -> Option<SolverFlags> {
        let part = |handle| context.colliders.get(handle).map(|c| c.user_data as usize);
        let (a, b) = (part(context.collider1)?, part(context.collider2)?);
        self.pairs.is_watched(a, b).then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }
}
