//! `[[world.obstacle]]`: obstacles that the scene does not have.

use schemars::JsonSchema;
use serde::Serialize;

use armcal_core::robot::PartFile;

/// What stands in the water and is in no drawing: shapes in the world frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct UnmodelledObstacles(pub(super) Vec<PartFile>);

impl UnmodelledObstacles {
    pub(super) fn is_none(&self) -> bool {
        self.0.is_empty()
    }
}
