//! `[[world.obstacle]]`: obstacles that the scene does not have.

use serde::Serialize;

use armcal_core::robot::PartFile;

/// What stands in the water and is in no drawing: shapes in the world frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct UnmodelledObstacles(Vec<PartFile>);

impl UnmodelledObstacles {
    fn is_none(&self) -> bool {
        self.0.is_empty()
    }
}
