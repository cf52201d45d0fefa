//! The service that stops an arm.

use serde::{Deserialize, Serialize};

/// std_srvs/srv/Trigger, asked; an empty request is one byte.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct TriggerRequest {
    pub structure_needs_at_least_one_member: u8,
}

impl ros2_client::Message for TriggerRequest {}

/// std_srvs/srv/Trigger, answered.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct TriggerResponse {
    pub success: bool,
    pub message: String,
}

impl ros2_client::Message for TriggerResponse {}
