//! Obstacles `[[world.obstacle]]`, which the scene does not have.

use schemars::JsonSchema;
use serde::Serialize;

use armcal_core::robot::PartFile;

/// Unmodelled obstacles in the water: shapes in the world frame that planning does not know.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
#[serde(transparent)]
pub struct UnmodelledObstacles(pub(super) Vec<PartFile>);

impl UnmodelledObstacles {
    pub(super) fn is_none(&self) -> bool {
        self.0.is_empty()
    }
}
